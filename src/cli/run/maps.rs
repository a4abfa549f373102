//! Maps and pictures of one toolpath.

use std::path::Path;

use geometry::{Aabb, Point2};
use io::{exr, png};
use job::{Outcome, Session, marks};
use metrology::{NormalMap, PatchGrid, View, contacts_on_patches};
use motion::{Move, Toolpath};
use part::PatchPoint;
use report::{
    Histogram, MapSize, MapWords, PathLine, Picture, ToolpathPage, deviation_picture, field_picture,
    height_picture, interval_picture, path_picture, stream_picture,
};
use sim::{Grid, ZMap};
use work::parallel;

use crate::error::CliError;
use crate::outputs::Outputs;

/// Writes the maps of a toolpath; leaves what the page shows.
///
/// # Errors
/// [`CliError::Output`].
pub fn maps(session: &Session, outcome: &Outcome, outputs: &Outputs) -> Result<ToolpathPage, CliError> {
    let maps = Maps { session, outcome, outputs };
    let page = match &outcome.view {
        View::Heights(cut) => maps.of_heights(cut)?,
        View::Normals(view) => maps.of_normals(&view.map, view.spacing)?,
    };
    let (scallop, rule) = (session.scene.tolerance.scallop, session.scene.scallop_rule);
    let histogram = Histogram::new(&outcome.measurement.ridge_samples, scallop, rule.highest * scallop);
    Ok(ToolpathPage { histogram, ..page })
}

/// What all maps of a toolpath need.
struct Maps<'a> {
    session: &'a Session,
    outcome: &'a Outcome,
    outputs: &'a Outputs,
}

impl Maps<'_> {
    /// A file's name in the toolpath's folder.
    fn file(&self, name: &str) -> String {
        format!("{}/{name}", self.outcome.result.folder)
    }

    /// Writes a picture; leaves the smaller one for the page.
    fn picture(
        &self,
        name: &str,
        cell: &str,
        draw: &dyn Fn(MapSize) -> Picture,
    ) -> Result<Vec<u8>, CliError> {
        let (name, scene) = (self.file(name), &self.session.scene);
        let notes = [("Title", scene.title.as_str()), ("Scene", &scene.source.name), ("Cell", cell)];
        let encode = |size| png::encode(&draw(size), &notes).map_err(CliError::output(Path::new(&name)));
        let bytes = encode(MapSize::File)?;
        self.outputs.file(&name, |out| out.write_all(&bytes))?;
        encode(MapSize::Page)
    }

    /// Writes height.exr and the pictures over the plan view.
    fn of_heights(&self, cut: &ZMap) -> Result<ToolpathPage, CliError> {
        let exr = || {
            let name = self.file("height.exr");
            let bytes = exr::encode(cut, &self.outcome.measurement.deviation_map, self.outcome.first_move)
                .map_err(CliError::output(Path::new(&name)))?;
            self.outputs.file(&name, |out| out.write_all(&bytes))
        };
        let (exr, pictures) = parallel::join(exr, || self.pictures(cut));
        exr?;
        pictures
    }

    /// Writes deviation.png, height.png, path.png, and field.png, interval.png and psi.png of streamlines.
    fn pictures(&self, cut: &ZMap) -> Result<ToolpathPage, CliError> {
        let (scene, result) = (&self.session.scene, &self.outcome.result);
        let (grid, deviation) = (&cut.grid, &self.outcome.measurement.deviation_map);
        let cell = format!("{} mm", grid.cell);
        let subtitle = format!("{} · cell {cell} · engine {}", scene.title, result.simulation.engine);
        let title = |what: &str| format!("{what}, {}", result.name);
        let [deviations, heights, paths, fields, intervals, streams] =
            ["Deviation", "Height", "Path", "Feed directions", "Interval of passes", "Stream function"]
                .map(title);
        let rings = marks(&self.outcome.measurement, &scene.tolerance, &scene.scallop_rule);
        let words = |title, marks| MapWords { title, subtitle: &subtitle, marks, axes: ["x", "y"] };
        let lines = plan_lines(&self.outcome.path);
        let draw_path = || {
            self.picture("path.png", &cell, &|size| {
                path_picture(grid, deviation, &lines, &words(&paths, &[]), size)
            })
        };
        let (path_png, (deviation_png, height_png)) = parallel::join(draw_path, || {
            parallel::join(
                || {
                    self.picture("deviation.png", &cell, &|size| {
                        deviation_picture(
                            grid,
                            deviation,
                            &scene.tolerance,
                            &words(&deviations, &rings),
                            size,
                        )
                    })
                },
                || {
                    self.picture("height.png", &cell, &|size| {
                        height_picture(grid, &cut.height, &words(&heights, &[]), size)
                    })
                },
            )
        });
        let field_pngs = self.outcome.field.as_ref().map(|field| {
            let (field, interval) = parallel::join(
                || {
                    self.picture("field.png", &cell, &|size| {
                        field_picture(grid, deviation, field, &words(&fields, &[]), size)
                    })
                },
                || {
                    let interval = self.picture("interval.png", &cell, &|size| {
                        interval_picture(grid, deviation, field, &words(&intervals, &[]), size)
                    });
                    let psi = self.picture("psi.png", &cell, &|size| {
                        stream_picture(field, &words(&streams, &[]), size)
                    });
                    Ok::<_, CliError>([interval?, psi?])
                },
            );
            let [interval, psi] = interval?;
            Ok::<_, CliError>([field?, interval, psi])
        });
        Ok(ToolpathPage {
            deviation_png: deviation_png?,
            path_png: path_png?,
            height_png: Some(height_png?),
            field_pngs: field_pngs.transpose()?,
            histogram: None,
        })
    }

    /// Writes deviation.png, path.png and deviation.exr, of several patches with their number; a mesh is
    /// shown in the plan view.
    fn of_normals(&self, map: &NormalMap, spacing: f64) -> Result<ToolpathPage, CliError> {
        if map.grids.is_empty() {
            let lines = plan_lines(&self.outcome.path);
            return self.laid_flat("", ["x", "y"], spacing, &plan_view(map, spacing), &lines);
        }
        let contacts =
            contacts_on_patches(&self.session.part, self.outcome.cutters.first(), &self.outcome.path);
        let mut first: Option<ToolpathPage> = None;
        for (k, patch) in map.grids.iter().enumerate() {
            let number = if map.grids.len() > 1 { format!("-{}", k + 1) } else { String::new() };
            let name = self.file(&format!("deviation{number}.exr"));
            let bytes = exr::encode_patch(map, patch).map_err(CliError::output(Path::new(&name)))?;
            self.outputs.file(&name, |out| out.write_all(&bytes))?;
            let flat = unrolled(map, patch);
            let lines = patch_lines(&self.outcome.path, &contacts, k as u32, patch, &flat.0);
            let page = self.laid_flat(&number, ["u", "v"], spacing, &flat, &lines)?;
            first.get_or_insert(page);
        }
        Ok(first.unwrap_or_default())
    }

    /// Writes the pictures of deviation and path over a map; leaves the smaller ones for the page.
    fn laid_flat(
        &self,
        number: &str,
        axes: [&str; 2],
        spacing: f64,
        (grid, values): &(Grid, Vec<f32>),
        lines: &[PathLine],
    ) -> Result<ToolpathPage, CliError> {
        let (scene, result) = (&self.session.scene, &self.outcome.result);
        let [deviations, paths] = ["Deviation", "Path"].map(|what| format!("{what}, {}", result.name));
        let (cell, engine) = (format!("{spacing} mm"), result.simulation.engine);
        let [u, v] = axes;
        let subtitle = format!("{} · along {u} and {v} · every {cell} · engine {engine}", scene.title);
        let words = |title| MapWords { title, subtitle: &subtitle, marks: &[], axes };
        let deviation_png = self.picture(&format!("deviation{number}.png"), &cell, &|size| {
            deviation_picture(grid, values, &scene.tolerance, &words(&deviations), size)
        })?;
        let path_png = self.picture(&format!("path{number}.png"), &cell, &|size| {
            path_picture(grid, values, lines, &words(&paths), size)
        })?;
        Ok(ToolpathPage { deviation_png, path_png, height_png: None, field_pngs: None, histogram: None })
    }
}

/// The moves seen from above.
fn plan_lines(path: &Toolpath) -> Vec<PathLine> {
    let line = |(from, to, step): (_, _, &Move)| {
        let ends = [from, to].map(|end: geometry::Point3| end.xy());
        PathLine { ends, kind: step.kind }
    };
    path.segments().map(line).collect()
}

/// The moves whose contacts run on a patch, over the patch laid flat.
fn patch_lines(
    path: &Toolpath,
    contacts: &[Option<PatchPoint>],
    patch: u32,
    laid: &PatchGrid,
    grid: &Grid,
) -> Vec<PathLine> {
    let size = [grid.nx, grid.ny].map(|n| n as f64 * grid.cell);
    let place = |at: PatchPoint| {
        let share = |c: usize, t: f64| (t - laid.domain[c][0]) / (laid.domain[c][1] - laid.domain[c][0]);
        Point2::new(share(0, at.u) * size[0], share(1, at.v) * size[1])
    };
    let on = |k: usize| contacts[k].filter(|at| at.patch == patch).map(place);
    let line = |k: usize| {
        let (from, to) = (on(k - 1)?, on(k)?);
        Some(PathLine { ends: [from, to], kind: path.moves[k].kind })
    };
    (1..path.len()).filter_map(line).collect()
}

/// A patch laid flat: cells of its mean distances along u and v, made square.
fn unrolled(map: &NormalMap, patch: &PatchGrid) -> (Grid, Vec<f32>) {
    let [nu, nv] = patch.counts;
    let cell = patch.pitch[0].min(patch.pitch[1]).max(f64::MIN_POSITIVE);
    let [nx, ny] =
        [0, 1].map(|c| (patch.counts[c] as f64 * (patch.pitch[c] / cell).min(8.0)).round() as usize);
    let grid = Grid { origin: Point2::new(0.5 * cell, 0.5 * cell), cell, nx, ny };
    let value = |i: usize, j: usize| map.deviations[patch.first + j * nv / ny * nu + i * nu / nx];
    (grid, (0..ny).flat_map(|j| (0..nx).map(move |i| value(i, j))).collect())
}

/// The places seen from above, of those in one cell the one farthest from the design.
fn plan_view(map: &NormalMap, cell: f64) -> (Grid, Vec<f32>) {
    let bounds = Aabb::of(&map.points);
    let size = bounds.size();
    let (nx, ny) = ((size.x / cell) as usize + 1, (size.y / cell) as usize + 1);
    let grid = Grid { origin: bounds.min.xy(), cell, nx, ny };
    let mut values = vec![f32::NAN; grid.len()];
    for (point, deviation) in map.points.iter().zip(&map.deviations) {
        let at = (point.xy() - grid.origin) / cell;
        let (i, j) = ((at.x.round() as usize).min(nx - 1), (at.y.round() as usize).min(ny - 1));
        let value = &mut values[grid.index(i, j)];
        if value.is_nan() || deviation.abs() > value.abs() {
            *value = *deviation;
        }
    }
    (grid, values)
}
