//! Deviation at the sections of a blade.

use metrology::{View, section_figures};
use report::{Figure, FigureTable, micrometres};
use work::monitor::Monitor;

use super::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// Of blades that are measured along their normals.
pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let (View::Normals(view), Some(blade)) = (run.view(), &run.session.blade) else {
        return Ok(Finding::default());
    };
    let sections = section_figures(&view.map, blade.heights(), &blade.section_parameters());
    if sections.is_empty() {
        return Ok(Finding::default());
    }
    let um = |length| micrometres(Some(length));
    let row = |s: &metrology::SectionFigures| {
        let places = s.places.to_string();
        vec![
            format!("{:.3}", s.height_mm),
            um(s.min_mm),
            um(s.max_mm),
            um(s.mean_mm),
            places,
            format!("{:.3}", s.row_off_mm),
        ]
    };
    let table = FigureTable {
        title: "Deviation at the sections",
        caption: "At the row of places nearest to each section, along the normals of the design.",
        columns: vec!["height mm", "from µm", "to µm", "mean µm", "places", "rows off it, mm"],
        rows: sections.iter().map(row).collect(),
    };
    let figure =
        Figure { key: "sections", value: value(&sections)?, table: Some(table), ..Figure::default() };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
