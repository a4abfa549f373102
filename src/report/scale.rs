//! Round numbers for axes, keys and bars, and lengths in words.

/// The least of 1, 2 and 5 times a power of ten that is not below `value`, which must be positive
/// and finite (else 1).
pub fn round_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let power = 10f64.powf(value.log10().floor());
    // The hair keeps 0.02 / 0.01 = 2.0000000000000004 from becoming 5.
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|r| *r >= value * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

/// The greatest of 1, 2 and 5 times a power of ten that is not above `value`, which must be positive
/// and finite (else 1).
pub fn round_down(value: f64) -> f64 {
    let above = round_up(value);
    let candidates = [above, 0.5 * above, 0.4 * above, 0.2 * above];
    // 0.4 only leads from 5 to 2; from 1 and 2 the halves are round already.
    candidates
        .into_iter()
        .find(|r| *r <= value * (1.0 + 1e-9) && round_up(*r) <= r * (1.0 + 1e-9))
        .unwrap_or(above)
}

/// Round positions from `from` to `to`, at most `count` of them (about).
pub fn ticks(from: f64, to: f64, count: f64) -> Vec<f64> {
    if !(to > from && (to - from).is_finite()) {
        return vec![from];
    }
    let step = round_up((to - from) / count);
    let first = (from / step - 1e-9).ceil() as i64;
    let last = (to / step + 1e-9).floor() as i64;
    (first..=last).map(|k| k as f64 * step).collect()
}

/// A unit of length for a range of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// `µm` or `mm`.
    pub name: &'static str,
    /// How many of it a millimetre has.
    pub a_millimetre: f64,
}

impl Unit {
    /// Micrometres for ranges below half a millimetre, else millimetres.
    pub fn for_range(range_mm: f64) -> Self {
        if range_mm < 0.5 {
            Self { name: "µm", a_millimetre: 1000.0 }
        } else {
            Self { name: "mm", a_millimetre: 1.0 }
        }
    }

    /// A value in this unit, without digits that say nothing at steps of `step_mm`.
    pub fn text(&self, value_mm: f64, step_mm: f64) -> String {
        plain(value_mm * self.a_millimetre, step_mm * self.a_millimetre)
    }
}

/// `value` with as many decimals as a step of `step` needs.
pub fn plain(value: f64, step: f64) -> String {
    let decimals = if step > 0.0 { (-(step * 1.000001).log10().floor()).clamp(0.0, 9.0) as usize } else { 3 };
    let text = format!("{value:.decimals$}");
    // No "-0".
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_up_to_one_two_five() {
        let rounded = [0.0125, 0.02, 0.021, 5.0, 5.1, 0.7].map(round_up);
        for (got, expected) in rounded.into_iter().zip([0.02, 0.02, 0.05, 5.0, 10.0, 1.0]) {
            assert!((got / expected - 1.0).abs() < 1e-12, "{got} {expected}");
        }
        assert_eq!(round_up(f64::NAN), 1.0);
    }

    #[test]
    fn numbers_are_rounded_down_to_one_two_five() {
        let rounded = [0.0125, 0.02, 0.049, 5.0, 5.1, 0.7, 1.99].map(round_down);
        for (got, expected) in rounded.into_iter().zip([0.01, 0.02, 0.02, 5.0, 5.0, 0.5, 1.0]) {
            assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
        }
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-3.0, 62.0, 7.0), [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0]);
        assert_eq!(ticks(1.0, 1.0, 7.0), [1.0]);
    }

    #[test]
    fn values_carry_the_decimals_of_their_step() {
        assert_eq!(plain(0.25, 0.05), "0.25");
        assert_eq!(plain(-0.0001, 0.05), "0.00");
        assert_eq!(plain(20.0, 10.0), "20");
        assert_eq!(Unit::for_range(0.02).text(0.0125, 0.005), "12");
        assert_eq!(Unit::for_range(0.02).text(0.0125, 0.0005), "12.5");
    }
}
