//! Numbers as the pages show them.

/// A number with four significant digits, or all before the point where they are more.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let before = value.abs().log10().floor().clamp(-9.0, 15.0) as i32;
    format!("{value:.*}", (3 - before).max(0) as usize)
}

/// A number without zeros that say nothing, as axes have it.
pub fn tick(value: f64) -> String {
    let text = number(value);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A change in per cent, with its sign. Of nothing, and where nothing changed, none.
pub fn change(before: f64, now: f64) -> Option<String> {
    let share = 100.0 * (now - before) / before.abs();
    (share.is_finite() && share != 0.0).then(|| format!("{share:+.2} %"))
}

/// The first line of a longer reason, which tables have room for.
pub fn first_line(text: &str) -> &str {
    text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("no reason was given")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!([10.434814, 0.0, 21312.4, -0.00123456].map(number), ["10.43", "0", "21312", "-0.001235"]);
        assert_eq!([0.1, 2.0, 100.0].map(tick), ["0.1", "2", "100"]);
        assert_eq!(change(100.0, 102.0).as_deref(), Some("+2.00 %"));
        assert_eq!((change(0.0, 1.0), change(1.0, 1.0)), (None, None));
    }
}
