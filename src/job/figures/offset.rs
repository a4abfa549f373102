//! The offset surface that a path's ball rides on: how far it is off the part.

use metrology::{OffsetFigures, offset_figures};
use report::{Figure, bound, place};
use toolpath::{OffsetAlong, OffsetDrive, OffsetSurface};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// Distances that are off by less than this, mm, are as asked.
const AS_ASKED: f64 = 1.0e-6;

/// Of a path along an offset surface. A mesh has none: there passes are put on the level set of its distance,
/// place by place.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(OffsetSurface { along, drive }) = run.planned.strategy.downcast_ref() else {
        return Ok(Finding::default());
    };
    if matches!(along, OffsetAlong::Angle(_)) {
        return Ok(Finding::default());
    }
    monitor.start("measuring the offset surface", 0);
    let given = match drive {
        OffsetDrive::Given(surfaces) => Some(surfaces.as_slice()),
        OffsetDrive::Exact | OffsetDrive::InPlane | OffsetDrive::Published => None,
    };
    let Some(offset) = offset_figures(run.part(), run.tooling().cutter.radius(), given) else {
        return Ok(Finding::default());
    };
    let figure = Figure { key: "offset", value: value(&offset)?, rows: rows(&offset), ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes: notes(&offset), ..Finding::default() })
}

fn rows(offset: &OffsetFigures) -> Vec<(&'static str, String)> {
    let distance = offset.distance.map_or("-".to_owned(), |d| {
        let bound = bound(d.error_bound_mm);
        format!("{:.4} to {:.4} mm ± {bound} µm, asked {} mm", d.least_mm, d.greatest_mm, offset.asked_mm)
    });
    vec![
        ("offset surface off the design", distance),
        ("places as hollow as the ball", offset.singular_place_count.to_string()),
    ]
}

/// An offset surface in words.
fn notes(figures: &OffsetFigures) -> Vec<String> {
    let radius = figures.asked_mm;
    let mut notes = Vec::new();
    if let Some(d) = &figures.distance {
        let how = if figures.made == "normal" { "" } else { ", made of sections offset in their planes," };
        let off = [d.least_mm, d.greatest_mm].map(|distance| (distance - radius).abs());
        let bound = 1e3 * d.error_bound_mm;
        notes.push(if off[0].max(off[1]) + d.error_bound_mm <= AS_ASKED {
            format!("the offset surface{how} is {radius} mm off the part everywhere, within {AS_ASKED:e} mm")
        } else {
            format!(
                "the offset surface{how} is {:.4} to {:.4} mm off the part (± {bound:.1} µm) instead of {radius} mm: nearest \
                 at {}, farthest at {}",
                d.least_mm,
                d.greatest_mm,
                place(d.least_at_mm),
                place(d.greatest_at_mm)
            )
        });
    }
    if let Some(worst) = figures.singular_places.first() {
        let count = figures.singular_place_count;
        let places = if count == 1 { "in one place".to_owned() } else { format!("in {count} places") };
        let what = worst.curvature_per_mm.map_or_else(
            || "a crease".to_owned(),
            |k| format!("a radius of {:.4} mm (curvature {k:.4} /mm)", worst.radius_mm),
        );
        notes.push(format!(
            "the part is at least as hollow as the ball of {radius} mm {places}, where the offset surface is singular; most at {} \
             (patch {}, u {:.4} v {:.4}), {what}: take a smaller ball there",
            place(worst.at_mm),
            worst.patch,
            worst.u,
            worst.v
        ));
    }
    notes
}
