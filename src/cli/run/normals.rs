//! One toolpath measured along the normals of the design: planned upright or tilted, for any cutter axis.

use std::path::Path;
use std::time::Instant;

use super::removal::Held;
use super::{BYTES_PER_MOVE, Job, MIB, part_bytes};
use crate::error::CliError;
use crate::load::load_mesh;
use crate::outputs::Outputs;
use crate::program;
use collision::{Check, Interference, Obstacle};
use cutter::Solid;
use geometry::{Aabb, Bvh, Point2, TriangleMesh, Vector3};
use io::{exr, ply_write, png, stl_write};
use machine::slow_corners;
use metrology::{
    FirstCut, Measurement, NormalMap, PatchGrid, RaysCut, RoughnessFigures, SweptVolume, VoxelCut,
    measure_along_normals, net_places, path_figures, roughness, section_figures,
};
use motion::{Move, MoveKind, Toolpath};
use report::{
    HIGHEST_RIDGE, Histogram, MapSize, MapWords, SimulationFigures, SurfaceMeshFigures, ToolpathPage,
    ToolpathResult, Verdict, Violation, deviation_colours, deviation_picture, tool_collision,
};
use scene::{Engine, Fixture, Scene, ToolpathRequest};
use sim::{Grid, Rays, VoxelEngine, VoxelStock, Voxels};
use toolpath::{Tilting, plan, plan_tilted};
use work::monitor;
use work::monitor::Monitor as _;

/// Bytes a place of the net: place, hit, triangles with their crossings, and the map; 480 were counted.
const BYTES_PER_PLACE: u64 = 600;

/// Distance of the places over that of cells where the program chooses: three places from pass to pass.
const PLACES_OVER_CELLS: f64 = 2.0;

/// Material is looked for this many uncut tolerances above the design, and no less far than the cutter's radius; cuts as
/// far below it as that radius, so that the far side of a thin part counts for nothing.
const REACH_OVER_UNCUT: f64 = 4.0;

/// By how much space for voxels is larger than it need be, mm: then none of its own surface is met.
const BEYOND: f64 = 1.0;

/// The solids of a tool.
struct Tool {
    cutter: Solid,
    /// Shank and holder.
    holder: Option<Solid>,
}

impl Tool {
    fn of(scene: &Scene) -> Self {
        let cutter = Solid::of_cutter(&scene.cutter, scene.holder.as_ref());
        Self { cutter, holder: scene.holder.as_ref().map(Solid::of_holder) }
    }
}

impl Job<'_> {
    /// Plans one toolpath, measures it along the normals by rays or voxels and writes its folder.
    pub(super) fn along_normals(
        &self,
        request: &ToolpathRequest,
        engine: Engine,
        outputs: &Outputs,
    ) -> Result<(ToolpathResult, ToolpathPage), CliError> {
        let (scene, monitor) = (self.scene, self.progress);
        let settings = self.settings(request);
        let fixtures = self.fixtures()?;
        let tool = Tool::of(scene);
        let strategy = self.strategy(request)?;
        let planned = match &request.axis {
            Some(axis) => {
                let keep = self.keep_clear(&tool, &fixtures);
                let tilting = Tilting {
                    axis: &axis.rule,
                    most_turning: axis.most_turning,
                    most_turning_across: axis.most_turning_across,
                    interference: Some(&keep),
                };
                plan_tilted(&self.part, &scene.cutter, &*strategy, &tilting, &settings, monitor)
            }
            None => plan(&self.part, &scene.cutter, &*strategy, &settings, monitor),
        };
        let mut planned = planned.map_err(|reason| CliError::plan(scene, &request.name, reason))?;
        if scene.machine.slow_corners {
            planned.path = slow_corners(&planned.path, &scene.machine);
        }
        let joints = program::joints(scene, &request.name, &planned.path)?;
        // Deviations are exact at the places, and ridges are found between them, so that fewer do than cells.
        let wider = if scene.simulation.cell_is_auto { PLACES_OVER_CELLS } else { 1.0 };
        let spacing = wider * scene.simulation.cell;
        self.check_places(spacing, planned.path.len())?;
        let begun = Instant::now();
        let cutter = &tool.cutter;
        let reach = (REACH_OVER_UNCUT * scene.tolerance.uncut).max(scene.cutter.radius());
        let rays = Rays::new(&planned.path, cutter, monitor).map_err(CliError::rays(scene, &request.name))?;
        let inward = scene.cutter.radius();
        let space = self.space(inward.max(reach));
        let voxels = match engine {
            Engine::Voxel => Some(self.voxels(request, &space, cutter, &planned.path, spacing)?),
            _ => None,
        };
        let by_rays = RaysCut { rays: &rays, path: &planned.path, solid: cutter };
        let by_voxels = voxels.as_ref().map(|(engine, voxels)| VoxelCut { engine, voxels });
        let first: &dyn FirstCut = by_voxels.as_ref().map_or(&by_rays, |cut| cut);
        let cut = SweptVolume { part: &self.part, cut: first, inward, outward: reach };
        let asked = scene.simulation.error_bound;
        let (mut measured, map) = measure_along_normals(
            &self.part,
            &scene.cutter,
            &planned.path,
            &cut,
            spacing,
            &scene.tolerance,
            asked,
            monitor,
        )?;
        let roughness = self.roughness_by(&rays, cutter, &planned.path, &measured)?;
        monitor::check(monitor)?;
        monitor.start("writing results", 0);
        outputs.folder(&request.folder)?;
        let lines = self.write_programs(request, &planned, joints.as_ref(), outputs)?;
        for region in &mut measured.gouge.regions {
            region.line = lines.get(region.move_index as usize).copied().unwrap_or_default();
        }
        self.write_pairs(request, &measured, outputs)?;
        let surface_mesh = self.write_normal_mesh(request, &map, outputs)?;
        let page = self.write_normal_maps(request, engine, &map, &measured, spacing, outputs)?;
        let solid = self.write_solid(request, &planned.path, outputs)?;
        let in_order = self.in_order(request, &planned.path)?;
        let (removal, held) = in_order.map(|found| found.in_program(&lines)).unzip();
        let simulation = SimulationFigures {
            engine: engine.name(),
            cell_mm: spacing,
            cells: map.points.len(),
            error_bound_asked_mm: asked,
            refined_rectangles: 0,
            finest_cell_mm: voxels.as_ref().map_or(spacing, |(_, voxels)| voxels.voxel()),
            moves: planned.path.len(),
            wall_s: begun.elapsed().as_secs_f64(),
            threads: rayon::current_num_threads(),
        };
        let mut result = self.result(
            request,
            &planned,
            joints.as_ref(),
            None,
            measured,
            removal,
            simulation,
            surface_mesh,
        );
        result.solid = solid;
        result.roughness = Some(roughness);
        if let Some(blade) = &self.blade {
            result.sections = section_figures(&map, blade.heights(), &blade.section_parameters());
        }
        self.add_offset(&*strategy, &mut result);
        monitor.start("looking for collisions", 0);
        let Held { note, violation } = held.unwrap_or_default();
        result.notes.extend(note);
        for violation in violation.into_iter().chain(self.collision(&tool, &fixtures, &planned.path, &lines))
        {
            result.violations.insert(0, violation);
            result.verdict = Verdict::Fail;
        }
        Ok((result, page))
    }

    /// More than the part by `reach` all around, so that what a normal leaves is what was cut.
    fn space(&self, reach: f64) -> VoxelStock {
        let Aabb { min, max } = self.part.bounds();
        let around = Vector3::repeat(reach + BEYOND);
        VoxelStock::Box(Aabb { min: min - around, max: max + around })
    }

    /// What a path leaves of `space` where places `spacing` mm apart take their memory too.
    fn voxels<'a>(
        &self,
        request: &ToolpathRequest,
        space: &'a VoxelStock,
        cutter: &Solid,
        path: &Toolpath,
        spacing: f64,
    ) -> Result<(VoxelEngine<'a>, Voxels), CliError> {
        let scene = self.scene;
        let refused = |reason| CliError::voxels(scene, &request.name, reason);
        let voxel = scene.simulation.voxel.unwrap_or(scene.simulation.cell);
        let places = net_places(&self.part, spacing) * BYTES_PER_PLACE as f64;
        let besides = part_bytes(&self.part) + (path.len() * BYTES_PER_MOVE) as u64 + places as u64;
        let left = (u64::from(scene.simulation.memory_mib) * MIB).saturating_sub(besides);
        let engine = VoxelEngine::new(space, cutter, path).map_err(refused)?;
        let voxels = engine.cut(voxel, left, self.progress).map_err(refused)?;
        Ok((engine, voxels))
    }

    /// The roughness of an upright path, by rays along the normals.
    pub(super) fn roughness(
        &self,
        request: &ToolpathRequest,
        path: &Toolpath,
        measured: &Measurement,
    ) -> Result<RoughnessFigures, CliError> {
        let (scene, monitor) = (self.scene, self.progress);
        let solid = Solid::of_cutter(&scene.cutter, None);
        let rays = Rays::new(path, &solid, monitor).map_err(CliError::rays(scene, &request.name))?;
        self.roughness_by(&rays, &solid, path, measured)
    }

    fn roughness_by(
        &self,
        rays: &Rays,
        solid: &Solid,
        path: &Toolpath,
        measured: &Measurement,
    ) -> Result<RoughnessFigures, CliError> {
        let reach = REACH_OVER_UNCUT * self.scene.tolerance.uncut;
        let by_rays = RaysCut { rays, path, solid };
        let cut = SweptVolume { part: &self.part, cut: &by_rays, inward: reach, outward: reach };
        // About how far passes are apart.
        let interval = measured.deviation.area_mm2 / path_figures(path, 0.0).cutting_length_mm;
        Ok(roughness(&self.part, &self.scene.cutter, path, &cut, interval, self.progress)?)
    }

    /// The meshes that are not to be touched.
    fn fixtures(&self) -> Result<Vec<(TriangleMesh, Bvh)>, CliError> {
        let load = |fixture: &Fixture| {
            let (mesh, _) = load_mesh(self.scene, &fixture.file, fixture.format, fixture.scale)?;
            let bvh = Bvh::new(&mesh);
            Ok((mesh, bvh))
        };
        self.scene.keep_clear.fixtures.iter().map(load).collect()
    }

    /// What the planner keeps the tool away from: shank and holder from all, the cutter from fixtures, and from cutting
    /// deeper into the part than half the gouge tolerance and what the part's triangles are off its surface.
    fn keep_clear<'a>(&'a self, tool: &'a Tool, fixtures: &'a [(TriangleMesh, Bvh)]) -> Interference<'a> {
        let keep = &self.scene.keep_clear;
        let part = Obstacle::new(self.part.mesh(), self.part.bvh());
        let depth = 0.5 * self.scene.tolerance.gouge + self.part.mesh_deviation();
        let mut checks = vec![Check { solid: &tool.cutter, obstacle: part, needed: -depth }];
        checks.extend(tool.holder.as_ref().map(|solid| Check {
            solid,
            obstacle: part,
            needed: keep.clearance,
        }));
        for (mesh, bvh) in fixtures {
            let obstacle = Obstacle::new(mesh, bvh);
            let solids = std::iter::once(&tool.cutter).chain(&tool.holder);
            checks.extend(solids.map(|solid| Check { solid, obstacle, needed: keep.clearance }));
        }
        Interference { checks, greatest_tilt: keep.greatest_tilt, greatest_lift: keep.greatest_lift }
    }

    /// The violation that shank or holder touch the part or a fixture, the cutter a fixture, or the cutter the part while it
    /// is not cutting. Asked of the finished path, whatever its planner thought.
    fn collision(
        &self,
        tool: &Tool,
        fixtures: &[(TriangleMesh, Bvh)],
        path: &Toolpath,
        lines: &[u32],
    ) -> Option<Violation> {
        let part = Obstacle::new(self.part.mesh(), self.part.bvh());
        let slack = -(self.scene.tolerance.gouge + self.part.mesh_deviation());
        let obstacles: Vec<Obstacle> = fixtures.iter().map(|(mesh, bvh)| Obstacle::new(mesh, bvh)).collect();
        let check = |solid, obstacle, needed| Check { solid, obstacle, needed };
        let mut always: Vec<Check> =
            tool.holder.iter().map(|solid| check(solid, part, -self.part.mesh_deviation())).collect();
        for &obstacle in &obstacles {
            always.extend(
                std::iter::once(&tool.cutter).chain(&tool.holder).map(|solid| check(solid, obstacle, 0.0)),
            );
        }
        let names = |always: &Check| {
            if std::ptr::eq(always.solid, &tool.cutter) { "the cutter" } else { "the holder" }
        };
        let with = |checks: Vec<Check<'_>>, chosen: &(dyn Fn(&Move) -> bool + Sync)| {
            let whose: Vec<&str> = checks.iter().map(names).collect();
            let keep = Interference { checks, greatest_tilt: 0.0, greatest_lift: 0.0 };
            let found = keep.on_path(path, chosen);
            found.into_iter().map(|(k, hit)| (k, hit, whose[hit.check])).collect::<Vec<_>>()
        };
        let mut found = with(always, &|_| true);
        found.extend(with(vec![check(&tool.cutter, part, slack)], &|to| to.kind == MoveKind::Rapid));
        tool_collision(&found, lines)
    }

    /// Refuses places that do not fit into the memory.
    fn check_places(&self, spacing: f64, moves: usize) -> Result<(), CliError> {
        let allowed_mib = self.scene.simulation.memory_mib;
        let besides = part_bytes(&self.part) + (moves * BYTES_PER_MOVE) as u64;
        let needed = net_places(&self.part, spacing) * BYTES_PER_PLACE as f64;
        let left = (u64::from(allowed_mib) * MIB).saturating_sub(besides) as f64;
        if needed <= left {
            return Ok(());
        }
        // Places grow as the square of what their distance shrinks; two digits, rounded up.
        let exact = spacing * (needed / left.max(1.0)).sqrt();
        let digit = 10f64.powf(exact.log10().floor() - 1.0);
        Err(CliError::Places {
            scene: self.scene.source.name.clone(),
            spacing,
            needed_mib: (needed as u64 + besides).div_ceil(MIB),
            allowed_mib,
            fitting: (exact / digit).ceil() * digit,
        })
    }

    /// Writes machined.stl and machined.ply: the design moved by its deviation.
    fn write_normal_mesh(
        &self,
        request: &ToolpathRequest,
        map: &NormalMap,
        outputs: &Outputs,
    ) -> Result<SurfaceMeshFigures, CliError> {
        let moved = |k: usize| {
            let deviation = if map.deviations[k].is_nan() { 0.0 } else { f64::from(map.deviations[k]) };
            (map.points[k] + map.normals[k] * deviation).coords.map(|c| c as f32).into()
        };
        let places: Vec<[f32; 3]> = work::parallel::map(map.points.len(), moved);
        outputs.file(&format!("{}/machined.stl", request.folder), |out| {
            stl_write::write(out, &places, &map.triangles)
        })?;
        let colours = deviation_colours(&map.deviations, &self.scene.tolerance);
        outputs.file(&format!("{}/machined.ply", request.folder), |out| {
            let vertices =
                ply_write::Vertices { places: &places, colours: &colours, deviations: &map.deviations };
            ply_write::write(out, &vertices, &map.triangles)
        })?;
        Ok(SurfaceMeshFigures { triangles: map.triangles.len(), tolerance_mm: self.scene.tolerance.scallop })
    }

    /// Writes deviation.png and deviation.exr, of several patches with their number; a mesh is shown in the plan view.
    fn write_normal_maps(
        &self,
        request: &ToolpathRequest,
        engine: Engine,
        map: &NormalMap,
        measured: &Measurement,
        spacing: f64,
        outputs: &Outputs,
    ) -> Result<ToolpathPage, CliError> {
        let mut page = Vec::new();
        if map.grids.is_empty() {
            let (grid, values) = plan_view(map, spacing);
            page = self.write_normal_picture(
                request,
                engine,
                "deviation.png",
                ["x", "y"],
                spacing,
                &grid,
                &values,
                outputs,
            )?;
        }
        for (k, patch) in map.grids.iter().enumerate() {
            let number = if map.grids.len() > 1 { format!("-{}", k + 1) } else { String::new() };
            let name = format!("{}/deviation{number}.exr", request.folder);
            let bytes = exr::encode_patch(map, patch).map_err(CliError::output(Path::new(&name)))?;
            outputs.file(&name, |out| out.write_all(&bytes))?;
            let (grid, values) = unrolled(map, patch);
            let name = format!("deviation{number}.png");
            let picture = self.write_normal_picture(
                request,
                engine,
                &name,
                ["u", "v"],
                spacing,
                &grid,
                &values,
                outputs,
            )?;
            if k == 0 {
                page = picture;
            }
        }
        let scallop = self.scene.tolerance.scallop;
        Ok(ToolpathPage {
            deviation_png: page,
            height_png: None,
            field_pngs: None,
            histogram: Histogram::new(&measured.ridge_samples, scallop, HIGHEST_RIDGE * scallop),
        })
    }

    /// Writes one picture; leaves the smaller one for the page.
    fn write_normal_picture(
        &self,
        request: &ToolpathRequest,
        engine: Engine,
        name: &str,
        axes: [&str; 2],
        spacing: f64,
        grid: &Grid,
        values: &[f32],
        outputs: &Outputs,
    ) -> Result<Vec<u8>, CliError> {
        let scene = self.scene;
        let title = format!("Deviation, {}", request.name);
        let cell = format!("{spacing} mm");
        let subtitle = format!(
            "{} · along {} and {} · every {cell} · engine {}",
            scene.title,
            axes[0],
            axes[1],
            engine.name()
        );
        let notes = [("Title", scene.title.as_str()), ("Scene", &scene.source.name), ("Cell", &cell)];
        let name = format!("{}/{name}", request.folder);
        let words = MapWords { title: &title, subtitle: &subtitle, marks: &[], axes };
        let encode = |size| {
            let picture = deviation_picture(grid, values, &scene.tolerance, &words, size);
            png::encode(&picture, &notes).map_err(CliError::output(Path::new(&name)))
        };
        let bytes = encode(MapSize::File)?;
        outputs.file(&name, |out| out.write_all(&bytes))?;
        encode(MapSize::Page)
    }
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
    let bounds = geometry::Aabb::of(&map.points);
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
