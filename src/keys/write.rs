//! Values as TOML spells them.

use geometry::Point2;

/// A number as TOML takes it, rounded to 12 digits so that an angle that went through radians comes
/// back as it was written.
pub fn toml_number(value: f64) -> String {
    let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// Numbers as a list.
pub fn toml_numbers(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|value| toml_number(*value)).collect::<Vec<_>>().join(", "))
}

/// Points as a list of lists.
pub fn toml_points(points: &[Point2]) -> String {
    let all: Vec<String> = points.iter().map(|p| toml_numbers(p.coords.as_slice())).collect();
    format!("[{}]", all.join(", "))
}

/// A string between quotes.
pub fn toml_string(value: &str) -> String {
    toml::Value::String(value.to_owned()).to_string()
}

/// The word that stands for a value in a list of words and values; the first one where none does.
pub fn word_of<T: PartialEq>(values: &[(&'static str, T)], value: &T) -> &'static str {
    values.iter().find(|(_, other)| other == value).map_or(values[0].0, |(word, _)| word)
}
