//! What the system says of processes and memory. Only Linux says so without unsafe code; elsewhere nothing is
//! known.

/// The text of a file below /proc; empty where there is none.
pub fn text(name: &str) -> String {
    std::fs::read_to_string(format!("/proc/{name}")).unwrap_or_default()
}

/// The value of a key in such a text, KiB.
pub fn kib(text: &str, key: &str) -> Option<u64> {
    let value = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    value.trim().strip_suffix("kB")?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_found_by_its_whole_key() {
        let text = "Name:\tx\nVmHWMore:\t 7 kB\nVmHWM:\t    2048 kB\nSigIgn:\t0001\n";
        assert_eq!((kib(text, "VmHWM"), kib(text, "VmRSS"), kib(text, "SigIgn")), (Some(2048), None, None));
    }
}
