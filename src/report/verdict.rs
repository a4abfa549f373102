//! What a verdict is: figures, each with the bound of its error, held against their limits.

use serde::ser::{SerializeMap as _, Serializer};
use serde::{Deserialize, Serialize};

/// What can be said of a limit, a toolpath, or a run; the later, the worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Verdict {
    /// Proven: every figure with its bound is within its limit.
    #[serde(rename = "pass")]
    Pass,
    /// A limit lies within the bound of its figure, or a figure is missing.
    #[serde(rename = "undecided")]
    Undecided,
    /// Proven not to hold: a figure less its bound exceeds its limit, or what is there for certain does.
    #[serde(rename = "fail")]
    Fail,
    /// There is no path to be judged.
    #[serde(rename = "not planned")]
    NotPlanned,
}

impl Verdict {
    /// As reports write it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Undecided => "undecided",
            Self::Fail => "fail",
            Self::NotPlanned => "not planned",
        }
    }

    /// By all of some limits: that of the worst; undecided where there are none.
    pub fn by(claims: &[Claim]) -> Self {
        claims.iter().map(Claim::verdict).max().unwrap_or(Self::Undecided)
    }

    /// Of a run whose toolpaths have these verdicts: what was not planned fails it.
    pub fn of_run(verdicts: impl IntoIterator<Item = Self>) -> Self {
        verdicts.into_iter().max().map_or(Self::Fail, |worst| worst.min(Self::Fail))
    }
}

/// What follows if a limit does not hold; the later, the worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Gravity {
    /// The surface is not as good as it was to be, and can be worked on.
    Finish,
    /// The part is spoilt.
    Scrap,
    /// Tool or machine break.
    Crash,
}

/// A figure held against the limit that it must not exceed.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// What is limited: `scallop`, `gouge`, `collision` …
    pub what: &'static str,
    /// What follows if the limit does not hold.
    pub gravity: Gravity,
    /// Unit of limit, figure and bound, as keys of report.json end: `mm`, `deg`, `mm_min`; empty for shares.
    pub unit: &'static str,
    /// The limit.
    pub limit: f64,
    /// The figure; `None` if it should exist and could not be measured.
    pub measured: Option<f64>,
    /// The true value differs from the figure by no more.
    pub error_bound: f64,
    /// The true value is no less, where that is known beside figure and bound.
    pub at_least: Option<f64>,
    /// The finding in a sentence, with its place.
    pub text: String,
    /// What would decide it, if it is undecided.
    pub decided_by: &'static str,
}

/// What decides most measurements.
const FINER: &str = "a finer cell, or more memory for it, would decide it";

impl Claim {
    /// That a length, mm, is within its limit.
    pub fn length(what: &'static str, gravity: Gravity, limit: f64, measured: f64, bound: f64) -> Self {
        let (measured, text) = (Some(measured), String::new());
        Self {
            what,
            gravity,
            unit: "mm",
            limit,
            measured,
            error_bound: bound,
            at_least: None,
            text,
            decided_by: FINER,
        }
    }

    /// The same with its sentence.
    pub fn told(self, text: String) -> Self {
        Self { text, ..self }
    }

    /// Whether the limit holds. A figure that is no number proves nothing.
    pub fn verdict(&self) -> Verdict {
        let Some(measured) = self.measured else { return Verdict::Undecided };
        if measured + self.error_bound <= self.limit {
            Verdict::Pass
        } else if measured - self.error_bound > self.limit
            || self.at_least.is_some_and(|least| least > self.limit)
        {
            Verdict::Fail
        } else {
            Verdict::Undecided
        }
    }

    /// The sentence for whoever reads the result; of what is undecided with what would decide it.
    pub fn sentence(&self) -> String {
        match self.verdict() {
            Verdict::Undecided => format!("{}: undecided; {}", self.text, self.decided_by),
            _ => self.text.clone(),
        }
    }
}

impl Serialize for Claim {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let keyed = |name: &str| match self.unit {
            "" => name.to_owned(),
            unit => format!("{name}_{unit}"),
        };
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("what", self.what)?;
        map.serialize_entry("verdict", &self.verdict())?;
        map.serialize_entry(&keyed("limit"), &self.limit)?;
        // Without end, a machining time for one, is no number of a report.
        let measured = self.measured.filter(|measured| measured.is_finite());
        map.serialize_entry(&keyed("measured"), &measured)?;
        let bound = measured.map(|_| self.error_bound).filter(|bound| bound.is_finite());
        map.serialize_entry(&keyed("error_bound"), &bound)?;
        if let Some(least) = self.at_least {
            map.serialize_entry(&keyed("at_least"), &least)?;
        }
        map.serialize_entry("text", &self.sentence())?;
        if bound.is_none() {
            let endless = self.measured == Some(f64::INFINITY);
            map.serialize_entry("reason", if endless { "it is not finite" } else { self.decided_by })?;
        }
        map.end()
    }
}

/// A place as reports write it.
pub fn place(at: [f64; 3]) -> String {
    format!("x {:.3} y {:.3} z {:.3}", at[0], at[1], at[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(measured: f64, bound: f64) -> Verdict {
        Claim::length("gouge", Gravity::Scrap, 0.005, measured, bound).verdict()
    }

    #[test]
    fn a_limit_holds_only_where_figure_and_bound_lie_within_it() {
        assert_eq!(verdict(0.004, 0.001), Verdict::Pass);
        assert_eq!(verdict(0.004, 0.0011), Verdict::Undecided);
        assert_eq!(verdict(0.006, 0.001), Verdict::Undecided);
        assert_eq!(verdict(0.006, 0.0009), Verdict::Fail);
        assert_eq!(verdict(f64::NAN, 0.0), Verdict::Undecided);
        assert_eq!(verdict(0.0, f64::INFINITY), Verdict::Undecided);
        assert_eq!(verdict(f64::INFINITY, 0.0), Verdict::Fail);
    }

    #[test]
    fn a_wider_bound_never_makes_a_pass_of_a_fail_nor_a_fail_of_a_pass() {
        for (measured, bound) in [(0.001, 1e-6), (0.0049, 1e-4), (0.0051, 1e-6), (1.0, 0.1)] {
            let fine = verdict(measured, bound);
            for wider in [2.0 * bound, 0.01, 10.0] {
                let coarse = verdict(measured, wider);
                assert!(coarse == fine || coarse == Verdict::Undecided, "{measured} {bound} {wider}");
            }
        }
    }

    #[test]
    fn a_run_is_as_good_as_its_worst_toolpath() {
        use Verdict::{Fail, NotPlanned, Pass, Undecided};
        assert_eq!(Verdict::of_run([Pass, Pass]), Pass);
        assert_eq!(Verdict::of_run([Pass, Undecided]), Undecided);
        assert_eq!(Verdict::of_run([Undecided, Fail, Pass]), Fail);
        assert_eq!(Verdict::of_run([Pass, NotPlanned]), Fail);
        assert_eq!(Verdict::of_run([]), Fail);
    }

    #[test]
    fn a_missing_figure_is_null_with_a_reason_and_undecided() {
        let mut claim = Claim::length("scallop", Gravity::Finish, 0.01, 0.0, 0.0).told("no scallop".into());
        claim.measured = None;
        let json = serde_json::to_value(&claim).unwrap();
        assert_eq!(json["verdict"], "undecided");
        assert!(json["measured_mm"].is_null() && json["reason"].is_string(), "{json}");
        assert_eq!(json["limit_mm"], 0.01);
        let endless = Claim { measured: Some(f64::INFINITY), ..claim };
        let json = serde_json::to_value(&endless).unwrap();
        assert_eq!((&json["verdict"], &json["reason"]), (&"fail".into(), &"it is not finite".into()));
        assert!(json["measured_mm"].is_null());
    }
}
