//! Texts that a terminal, a page or a log shows and never obeys.

/// Turns of the direction of writing: with them a name can show other than it is (Boucher and Anderson,
/// Trojan Source, 2021).
const TURNS: [std::ops::RangeInclusive<char>; 2] = ['\u{202a}'..='\u{202e}', '\u{2066}'..='\u{2069}'];

fn shown(c: char) -> char {
    let obeyed = c.is_control() || TURNS.iter().any(|range| range.contains(&c));
    if obeyed { char::REPLACEMENT_CHARACTER } else { c }
}

/// A name or a sentence, with a sign in the place of every control character.
pub fn printable(text: &str) -> String {
    text.chars().map(shown).collect()
}

/// A text of lines: line breaks and tabs stay.
pub fn printable_lines(text: &str) -> String {
    text.chars().map(|c| if matches!(c, '\n' | '\r' | '\t') { c } else { shown(c) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_left_that_a_terminal_obeys() {
        let bad = "a\u{1b}[31m\u{9b}b\u{202e}c\u{7f}\u{0}µ\n\t";
        assert_eq!(printable(bad), "a\u{fffd}[31m\u{fffd}b\u{fffd}c\u{fffd}\u{fffd}µ\u{fffd}\u{fffd}");
        assert_eq!(printable_lines(bad), "a\u{fffd}[31m\u{fffd}b\u{fffd}c\u{fffd}\u{fffd}µ\n\t");
    }
}
