//! A table of figures: the one form in which results reach standard output, the page and the JSON.

use serde_json::{Map, Value, json};

/// Name and unit of a column of figures.
#[derive(Debug, Clone, Copy)]
pub struct Column(pub &'static str, pub &'static str);

/// Rows of figures, each with a name.
#[derive(Debug, Clone)]
pub struct Table {
    /// Its name in the JSON.
    pub key: &'static str,
    pub title: &'static str,
    /// How it was measured.
    pub note: String,
    pub columns: Vec<Column>,
    /// A figure that is not known is NaN.
    pub rows: Vec<(String, Vec<f64>)>,
}

impl Table {
    pub fn new(key: &'static str, title: &'static str, note: impl Into<String>, columns: &[Column]) -> Self {
        Self { key, title, note: note.into(), columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Adds a row, with a figure for each column.
    pub fn row<const N: usize>(&mut self, name: impl Into<String>, figures: [f64; N]) {
        assert_eq!(N, self.columns.len(), "{}", self.key);
        self.rows.push((name.into(), figures.to_vec()));
    }

    /// For a terminal.
    pub fn text(&self) -> String {
        let head =
            |line: fn(&Column) -> &'static str| self.columns.iter().map(line).map(String::from).collect();
        let mut lines: Vec<(String, Vec<String>)> =
            vec![(String::new(), head(|c| c.0)), (String::new(), head(|c| c.1))];
        lines.extend(
            self.rows.iter().map(|(name, row)| (name.clone(), row.iter().map(|v| figure(*v)).collect())),
        );
        let wide = |text: &String| text.chars().count();
        let first = lines.iter().map(|(name, _)| wide(name)).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|k| lines.iter().map(|(_, row)| wide(&row[k])).max().unwrap_or(0))
            .collect();
        let mut text = format!("{}\n{}\n", self.title, self.note);
        for (name, row) in &lines {
            text += &format!("{name:first$}");
            row.iter().zip(&widths).for_each(|(figure, width)| text += &format!("  {figure:>width$}"));
            text += "\n";
        }
        text
    }

    /// The rows as objects, figures in full.
    pub fn json(&self) -> Value {
        let row = |(name, figures): &(String, Vec<f64>)| {
            let figures = self.columns.iter().zip(figures).map(|(c, v)| (c.0.to_string(), json!(v)));
            let named = [("case".to_string(), json!(name))].into_iter();
            Value::Object(named.chain(figures).collect())
        };
        let units: Map<String, Value> = self.columns.iter().map(|c| (c.0.to_string(), json!(c.1))).collect();
        json!({
            "title": self.title,
            "note": self.note,
            "units": units,
            "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
        })
    }
}

/// Three digits that count, `-` for a figure that is not known.
pub fn figure(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if !value.is_finite() => "-".to_string(),
        0.0 => "0".to_string(),
        _ if size >= 99.95 => format!("{value:.0}"),
        _ if size >= 9.995 => format!("{value:.1}"),
        _ if size >= 0.9995 => format!("{value:.2}"),
        _ if size >= 0.0995 => format!("{value:.3}"),
        _ if size >= 0.00995 => format!("{value:.4}"),
        _ => format!("{value:.2e}"),
    }
}
