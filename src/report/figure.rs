//! A figure of the report as plain data: its numbers, and the words that table and page show.

use serde::ser::{SerializeMap as _, Serializer};
use serde_json::Value;

/// One figure of a toolpath.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figure {
    /// Its key in report.json.
    pub key: &'static str,
    /// Its value there.
    pub value: Value,
    /// Name and value in the list of the page.
    pub rows: Vec<(&'static str, String)>,
    /// What the word of this figure means, for the end of the page.
    pub meaning: Option<(&'static str, &'static str)>,
    /// A sentence for the table, under a heading that figures of this kind share.
    pub sentence: Option<(&'static str, String)>,
    /// A table of the page.
    pub table: Option<FigureTable>,
    /// Files of the toolpath's folder.
    pub files: Vec<FigureFile>,
}

/// A table on the page.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureTable {
    /// Its heading.
    pub title: &'static str,
    /// What it shows.
    pub caption: &'static str,
    /// Names of the columns with their units.
    pub columns: Vec<&'static str>,
    /// One text for each column.
    pub rows: Vec<Vec<String>>,
}

/// A file beside the report.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureFile {
    /// Its name.
    pub name: &'static str,
    /// What is in it.
    pub content: FileContent,
}

/// What is in a file.
#[derive(Debug, Clone, PartialEq)]
pub enum FileContent {
    /// Text.
    Text(String),
    /// A triangle mesh, mm, for STL.
    Mesh {
        /// Corners.
        vertices: Vec<[f32; 3]>,
        /// Three corners each.
        triangles: Vec<[u32; 3]>,
    },
}

/// Figures as entries of the map that they stand in.
pub(super) fn by_key<S: Serializer>(figures: &[Figure], serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(figures.len()))?;
    figures.iter().try_for_each(|figure| map.serialize_entry(figure.key, &figure.value))?;
    map.end()
}
