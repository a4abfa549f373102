//! Dates without a calendar crate.

/// Seconds since 1970 as UTC, `2026-11-23T04:30:00Z` (RFC 3339).
///
/// The calendar is that of H. F. Fliegel and T. C. van Flandern (Communications of the ACM 11, 1968, p. 657),
/// in the form that counts years from March, so that the leap day is the last of its year.
pub fn date_of(unix_s: u64) -> String {
    const DAY: u64 = 86_400;
    /// Days from 1 March of year 0 to 1 January 1970.
    const TO_1970: u64 = 719_468;
    /// Days of 400 years.
    const ERA: u64 = 146_097;
    let (day, second) = (unix_s / DAY + TO_1970, unix_s % DAY);
    let of_era = day % ERA;
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day_of_month = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = 400 * (day / ERA) + year_of_era + u64::from(month <= 2);
    let [hour, minute, second] = [second / 3600, second / 60 % 60, second % 60];
    format!("{year:04}-{month:02}-{day_of_month:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected texts from `date -u -d @N`.
    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(date_of(0), "1970-01-01T00:00:00Z");
        assert_eq!(date_of(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(date_of(1_735_689_599), "2024-12-31T23:59:59Z");
        assert_eq!(date_of(4_107_542_400), "2100-03-01T00:00:00Z");
    }
}
