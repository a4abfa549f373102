//! Deviation at the sections of a blade.

use metrology::{SectionFigures, View, section_figures};
use report::{Figure, FigureTable, micrometres};
use serde::Serialize;
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// A section as the report has it.
#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    at: SectionFigures,
    /// The deviation with the least and the greatest distance of the faired curve from the drawn one, where
    /// the section was faired. No bound: other places may stand lower or higher.
    #[serde(skip_serializing_if = "Option::is_none")]
    from_drawing_mm: Option<[f64; 2]>,
}

/// Of blades that are measured along their normals.
pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let (View::Normals(view), Some(blade)) = (run.view(), &run.session.blade) else {
        return Ok(Finding::default());
    };
    let sections = section_figures(&view.map, blade.heights(), &blade.section_parameters());
    if sections.is_empty() {
        return Ok(Finding::default());
    }
    // All curves of a section together.
    let off = |height: f64| {
        let of = blade.sections.iter().filter(|section| section.height == height);
        let ends = of.filter_map(|section| section.off_drawing());
        ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    };
    let rows: Vec<Row> = sections
        .into_iter()
        .map(|at| {
            let from_drawing_mm =
                off(at.height_mm).map(|[least, most]| [at.min_mm + least, at.max_mm + most]);
            Row { at, from_drawing_mm }
        })
        .collect();
    let um = |length| micrometres(Some(length));
    let row = |row: &Row| {
        let s = &row.at;
        let places = s.places.to_string();
        let drawn = row
            .from_drawing_mm
            .map_or(String::new(), |[least, most]| format!("{} to {}", um(least), um(most)));
        vec![
            format!("{:.3}", s.height_mm),
            um(s.min_mm),
            um(s.max_mm),
            um(s.mean_mm),
            places,
            format!("{:.3}", s.row_off_mm),
            drawn,
        ]
    };
    let table = FigureTable {
        title: "Deviation at the sections",
        caption: "At the row of places nearest to each section, along the normals of the design. Where the section was faired, \
                  the last column adds how far the faired curve is from the drawn one. Between the places more may stand.",
        columns: vec![
            "height mm",
            "from µm",
            "to µm",
            "mean µm",
            "places",
            "rows off it, mm",
            "from the drawing µm",
        ],
        rows: rows.iter().map(row).collect(),
    };
    let figure = Figure { key: "sections", value: value(&rows)?, table: Some(table), ..Figure::default() };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
