//! Tools that programs speak of.

/// Whether a comment may describe a tool.
pub(crate) fn may_describe_a_tool(text: &str) -> bool {
    let text = text.trim_start();
    let begins_with_t = text.len() > 1
        && text.as_bytes()[0].eq_ignore_ascii_case(&b'T')
        && text.as_bytes()[1..].iter().find(|b| **b != b' ').is_some_and(u8::is_ascii_digit);
    begins_with_t || text.to_ascii_uppercase().contains("D=")
}
