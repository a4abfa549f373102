//! The tables, pictures and pages that people read. Enters: figures and maps. Leaves: texts and
//! rasters; writing them to files is the business of `io` and `cli`.

mod canvas;
mod comb;
mod field_map;
mod figure;
#[cfg(test)]
mod fixture;
mod histogram;
mod html;
mod junit;
mod map;
mod path_map;
mod plot;
mod result;
mod scale;
mod stream_map;
mod surface_mesh;
mod table;
mod time_plot;
mod verdict;

pub use canvas::Picture;
pub use comb::comb_picture;
pub use field_map::{field_picture, interval_picture};
pub use figure::{Figure, FigureFile, FigureTable, FileContent};
pub use histogram::Histogram;
pub use html::{ToolpathPage, html_document, html_page};
pub use junit::{junit, xml_escaped};
pub use map::{MapMark, MapSize, MapWords, deviation_colours, deviation_picture, height_picture};
pub use path_map::{PathLine, path_picture};
pub use result::{
    ExcessReport, InputFile, NotPlanned, ReportError, RunReport, SimulationFigures, SurfaceMeshFigures,
    ToleranceFigures, ToolpathReport, ToolpathResult, WALL,
};
pub use stream_map::stream_picture;
pub use surface_mesh::{MAX_TRIANGLES, SurfaceMesh, VertexPlace, surface_mesh};
pub use table::{
    beside_limit, bound, capital, conclusion, duration, micrometres, per_cent, result_table, with_bound,
};
pub use verdict::{Claim, Gravity, Verdict, place};
