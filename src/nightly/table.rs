//! A table of a page, as Markdown and as HTML.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::markdown::escaped;

/// A cell with more bytes is a sentence, and not a number or a few of them.
const LONGEST_NUMBER: usize = 80;

/// Rows of words under heads. The first column names the row.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Table {
    pub title: &'static str,
    /// What the columns say.
    pub intro: &'static str,
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(title: &'static str, intro: &'static str, head: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self { title, intro, head: head.iter().map(|word| (*word).to_owned()).collect(), rows }
    }

    /// Nothing where there are no rows.
    pub fn markdown(&self) -> String {
        let mut out = String::new();
        if self.rows.is_empty() {
            return out;
        }
        let row = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|cell| escaped(cell)).collect();
            format!("| {} |", cells.join(" | "))
        };
        // Numbers end in line, sentences begin so.
        let is_text = |column: usize| {
            let mut cells = self.rows.iter().filter_map(|cells| cells.get(column));
            column == 0 || cells.any(|cell| cell.len() > LONGEST_NUMBER)
        };
        let lines = (0..self.head.len()).map(|column| if is_text(column) { "---|" } else { "---:|" });
        // Writing into a string cannot fail.
        let _ = writeln!(out, "\n## {}\n\n{}\n\n{}", self.title, self.intro, row(&self.head));
        let _ = writeln!(out, "|{}", lines.collect::<String>());
        for cells in &self.rows {
            let _ = writeln!(out, "{}", row(cells));
        }
        out
    }

    /// Nothing where there are no rows.
    pub fn html(&self) -> Markup {
        html! {
            @if !self.rows.is_empty() {
                section {
                    h2 { (self.title) }
                    p.faint { (self.intro) }
                    div.scroll { table {
                        thead { tr { @for word in &self.head { th { (word) } } } }
                        tbody { @for cells in &self.rows {
                            tr { @for (k, cell) in cells.iter().enumerate() {
                                @if k == 0 { th { (cell) } } @else { td { (cell) } }
                            } }
                        } }
                    } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_every_cell_and_none_breaks_the_table() {
        let table = Table::new("Title", "Intro.", &["a", "b"], vec![vec!["x|y".into(), "<b>".into()]]);
        let text = table.markdown();
        assert!(text.contains("## Title") && text.contains("| x\\|y | \\<b\\> |"), "{text}");
        assert!(text.contains("|---|---:|"), "{text}");
        let told =
            Table { rows: vec![vec!["x".into(), "long ".repeat(20)]], head: table.head.clone(), ..table };
        assert!(told.markdown().contains("|---|---|"));
        let page = table.html().into_string();
        assert!(page.contains("<th>x|y</th><td>&lt;b&gt;</td>"), "{page}");
        let empty = Table { rows: Vec::new(), ..table };
        assert!(empty.markdown().is_empty() && empty.html().into_string().is_empty());
    }
}
