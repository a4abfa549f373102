//! The figures that are followed from night to night: one list. A new figure is one line of it.

use serde_json::Value;

/// What kind of figure it is, and so which rule judges it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Heights and depths on the part, mm.
    Accuracy,
    /// Lengths of paths, mm.
    Length,
    /// Machining times, s.
    Time,
}

/// One figure of a toolpath. Less is better for all of them.
#[derive(Debug, PartialEq, Eq)]
pub struct Figure {
    /// Its key in nightly.json, with the unit.
    pub key: &'static str,
    /// Its name on the page.
    pub name: &'static str,
    /// Which rule judges it.
    pub group: Group,
    /// Where report.json has it, from the toolpath (RFC 6901).
    pointer: &'static str,
    /// Where report.json has its error bound, if anywhere.
    bound: Option<&'static str>,
}

const fn figure(key: &'static str, name: &'static str, group: Group, pointer: &'static str) -> Figure {
    Figure { key, name, group, pointer, bound: None }
}

const fn bounded(
    key: &'static str,
    name: &'static str,
    pointer: &'static str,
    bound: &'static str,
) -> Figure {
    Figure { bound: Some(bound), ..figure(key, name, Group::Accuracy, pointer) }
}

/// All figures of a toolpath, in the order of the table.
pub const FIGURES: [Figure; 7] = [
    bounded("highest_mm", "highest material", "/excess/max_mm", "/excess/error_bound_mm"),
    bounded("scallop_max_mm", "scallop max", "/scallop/max_mm", "/scallop/error_bound_mm"),
    figure("scallop_p95_mm", "scallop p95", Group::Accuracy, "/scallop/p95_mm"),
    bounded("gouge_mm", "gouge", "/gouge/max_depth_mm", "/gouge/error_bound_mm"),
    bounded("uncut_mm", "uncut", "/uncut/max_height_mm", "/uncut/error_bound_mm"),
    figure("cutting_length_mm", "cutting length", Group::Length, "/path/cutting_length_mm"),
    figure("machining_time_s", "machining time", Group::Time, "/path/machining_time_s"),
];

impl Figure {
    /// Its value in a toolpath of report.json; `None` where it was not measured.
    pub(crate) fn of(&self, toolpath: &Value) -> Option<f64> {
        toolpath.pointer(self.pointer).and_then(Value::as_f64)
    }

    /// The error bound of its value, mm; `None` where it has none.
    pub(crate) fn bound_of(&self, toolpath: &Value) -> Option<f64> {
        toolpath.pointer(self.bound?).and_then(Value::as_f64)
    }

    /// Unit on the page.
    pub fn unit(&self) -> &'static str {
        match self.group {
            Group::Accuracy => "µm",
            Group::Length => "mm",
            Group::Time => "s",
        }
    }

    /// A value as the page shows it, in [`Self::unit`].
    pub(crate) fn shown(&self, value: f64) -> f64 {
        if self.group == Group::Accuracy { 1e3 * value } else { value }
    }
}
