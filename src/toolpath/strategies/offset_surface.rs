//! Passes of a ball whose centre rides on an offset surface: along its parameter lines, or as one spiral
//! around it.
//!
//! Enters: the part's patches and the radius, or offset surfaces that were made before (from sections that
//! were offset each in its plane). Leaves: passes with the ball's centre exactly on the surface at their
//! points. On the exact offset of a patch the centre stands the radius off the contact, so its lines are
//! those of the patch; an offset surface of another origin is ridden on as it is, and what it is off the true
//! distance is cut off the part, or left.
//!
//! Between two lines the centres may lie `e = w (1 − κ r)` apart, `w` the strip and `κ` the design's
//! curvature across the feed; on the offset surface itself that curvature is `κ/(1 − κ r)` (FORMULAS of
//! parallel surfaces, e.g. do Carmo 1976, §3.5 exercise 11), which is how a surface of another origin is
//! planned on.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use super::offset_mesh;
use crate::levels::halving::{Allowed, LevelSource, Track, along_and_between};
use crate::levels::spacing::{AllowedStep, LevelSteps, place_levels};
use crate::moves::touch::Touch;
use crate::surface::chart::{Chart, ChartPoint};
use crate::tilt::tilted;
use crate::vocabulary::{
    Along, Contact, Definition, PartKind, PassSettings, Passes, PlanError, Reading, Step, Strategy, Task,
};
use cutter::Cutter;
use drop_cutter::{Beside, DropCutter};
use field::surface_gradient_length;
use geometry::{NurbsSurface, Point3, Vector3};
use keys::{SceneError, toml_number};
use motion::CcPoint;
use scallop::{FeedCurvature, least_gap, strip_width};
use work::monitor::{Cancelled, Monitor};

/// Places a side at which steps between passes are computed.
const SAMPLES: usize = 160;

/// Places along a parameter line by which its length is measured.
const LENGTH_SAMPLES: usize = 64;

/// Lines run on beyond open borders by this share of the interval, on the surface's tangent planes: where
/// they do not meet the border squarely, one side of the strip would end before it.
const OVERRUN: f64 = 0.3;

/// Ends of a line nearer than this, mm, are one place of a closed one.
const SEAM: f64 = 1e-7;

/// How passes run on an offset surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OffsetAlong {
    /// u grows along a pass: along the sections of a blade.
    U,
    /// v grows along a pass: across the sections, from hub to tip.
    V,
    /// One spiral, u growing along it, on surfaces that close along u.
    Spiral,
    /// Vertical planes in this direction of the plan view, rad from x: on meshes, which have no parameters.
    Angle(f64),
}

/// Which offset surface the ball's centre rides on.
#[derive(Debug, Clone, PartialEq)]
pub enum OffsetDrive {
    /// The part's own, everywhere the radius off along the normal.
    Exact,
    /// Sections offset in their planes, and lofted. It lies too near wherever the surface leans out of these
    /// planes; whoever has the sections puts [`OffsetDrive::Given`] in its place. A tilted tool that keeps
    /// clear leaves such places out.
    InPlane,
    /// The same as published: offsets that cross themselves are not trimmed. Put in its place as for
    /// [`OffsetDrive::InPlane`].
    Published,
    /// These surfaces, `du × dv` away from the part.
    Given(Arc<Vec<NurbsSurface>>),
}

/// A ball whose centre rides on an offset surface.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetSurface {
    /// How passes run.
    pub along: OffsetAlong,
    /// On what.
    pub drive: OffsetDrive,
}

/// Words for `along`.
const ALONG: [(&str, OffsetAlong); 3] =
    [("u", OffsetAlong::U), ("v", OffsetAlong::V), ("spiral", OffsetAlong::Spiral)];

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "offset-surface",
    help: "the centre of a ball rides on an offset of the part: along a parameter, as a spiral, or at an angle over a mesh",
    part: PartKind::Surface,
    keys: &["along", "angle", "offset"],
    read,
};

fn read(from: &mut Reading<'_>) -> Result<Box<dyn Strategy>, SceneError> {
    let section = from.section;
    let drive = match section.word("offset", &["normal", "in-plane", "published"])?.map(|word| word.value) {
        Some("in-plane") => OffsetDrive::InPlane,
        Some("published") => OffsetDrive::Published,
        _ => OffsetDrive::Exact,
    };
    let angle = section.number("angle", -360.0..=360.0, " degrees")?;
    let along = section.choice("along", &ALONG)?;
    let along = match angle {
        Some(_) if section.has("along") => {
            return Err(section.key_error(
                "angle",
                "passes run along a parameter or at an angle, not both",
                "delete `angle` on patches and blades, `along` on meshes",
            ));
        }
        Some(_) if drive != OffsetDrive::Exact => {
            return Err(section.key_error(
                "offset",
                "passes at an angle ride on the offset along the normals, and on no other",
                "delete `offset`, or write `along = \"u\"` instead of `angle`",
            ));
        }
        Some(angle) => OffsetAlong::Angle(angle.value.to_radians()),
        None => along,
    };
    Ok(Box::new(OffsetSurface { along, drive }))
}

impl Strategy for OffsetSurface {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        match self.along {
            OffsetAlong::U => writeln!(out, "along = \"u\"")?,
            OffsetAlong::V => writeln!(out, "along = \"v\"")?,
            OffsetAlong::Spiral => writeln!(out, "along = \"spiral\"")?,
            OffsetAlong::Angle(angle) => {
                writeln!(out, "angle = {}  # degrees from the x axis", toml_number(angle.to_degrees()))?;
            }
        }
        let drive = match self.drive {
            OffsetDrive::Exact => "normal",
            OffsetDrive::Published => "published",
            OffsetDrive::InPlane | OffsetDrive::Given(_) => "in-plane",
        };
        writeln!(out, "offset = \"{drive}\"")
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        match self.along {
            OffsetAlong::Angle(angle) => offset_mesh::passes(task, angle),
            along => passes(task, along, &self.drive),
        }
    }

    fn on_facets(&self, _task: &Task<'_>) -> bool {
        true
    }
}

/// Plans passes on the offset surfaces of all patches.
fn passes(task: &Task<'_>, along: OffsetAlong, drive: &OffsetDrive) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    if !cutter.is_ball() {
        return Err(refused("the centre of a ball rides on the offset surface; use a ball cutter"));
    }
    if part.patches().is_empty() && *drive == OffsetDrive::Exact {
        return Err(refused("a mesh has no parameters; write `angle = 0`"));
    }
    let charts = match drive {
        OffsetDrive::Exact => Chart::all(part, cutter, settings.guide())?,
        OffsetDrive::InPlane | OffsetDrive::Published => {
            return Err(refused(
                "sections are offset in their planes, and the part has none; write `offset = \"normal\"`",
            ));
        }
        OffsetDrive::Given(surfaces) => {
            surfaces.iter().map(|s| Chart::of_surface(s, settings.guide())).collect()
        }
    };
    let mut all = Passes::default();
    for (k, chart) in charts.iter().enumerate() {
        let exact = matches!(drive, OffsetDrive::Exact);
        let drop = (exact && settings.axis.is_none()).then(|| DropCutter::watched(part, cutter, monitor));
        let drop = drop.transpose()?;
        let rider = PatchRider { chart, cutter, exact, drop, along: along.parameter(), settings, monitor };
        let passes = match along {
            OffsetAlong::Spiral => rider.spiral()?,
            _ => rider.lines()?,
        };
        all.append_patch([k, charts.len()], passes);
    }
    Ok(all)
}

fn refused(reason: &str) -> PlanError {
    PlanError::NotApplicable { strategy: DEFINITION.word, reason: reason.to_owned() }
}

impl OffsetAlong {
    /// The parameter that grows along a pass.
    fn parameter(self) -> Along {
        match self {
            Self::V => Along::V,
            Self::U | Self::Spiral | Self::Angle(_) => Along::U,
        }
    }
}

impl OffsetDrive {
    /// Rides on surfaces that were made before; `du × dv` points away from the part.
    pub fn on(surfaces: Vec<NurbsSurface>) -> Self {
        Self::Given(Arc::new(surfaces))
    }
}

/// Lays passes on one offset surface.
struct PatchRider<'a> {
    /// The patch, or the offset surface itself.
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    /// Whether the chart is the patch, from which the centre stands the radius off.
    exact: bool,
    /// Holds an upright ball off all places of the part.
    drop: Option<DropCutter<'a>>,
    along: Along,
    settings: &'a PassSettings<'a>,
    monitor: &'a dyn Monitor,
}

/// A place of the offset surface.
struct Ride {
    contact: CcPoint,
    centre: Point3,
    /// Unit feed direction.
    feed: Vector3,
}

impl PatchRider<'_> {
    /// Ranges of the parameter along passes and of the one across.
    fn ranges(&self) -> [[f64; 2]; 2] {
        let [u, v] = self.chart.domain;
        if self.along == Along::U { [u, v] } else { [v, u] }
    }

    /// Parameters of the chart at a place along and a level across.
    fn at(&self, along: f64, level: f64) -> [f64; 2] {
        if self.along == Along::U { [along, level] } else { [level, along] }
    }

    fn feed(&self, p: &ChartPoint) -> Option<Vector3> {
        let along = if self.along == Along::U { p.jet.du } else { p.jet.dv };
        along.try_normalize(1e-300)
    }

    fn ride(&self, [u, v]: [f64; 2]) -> Option<Ride> {
        let p = self.chart.at(u, v)?;
        let off = p.normal * self.cutter.radius();
        let (contact, centre) = if self.exact { (p.jet.p, p.jet.p + off) } else { (p.jet.p - off, p.jet.p) };
        Some(Ride { contact: CcPoint { point: contact, normal: p.normal }, centre, feed: self.feed(&p)? })
    }

    /// What a place allows, as one of the places by which levels are placed.
    fn place(&self, [u, v]: [f64; 2]) -> Option<(AllowedStep, f64)> {
        let p = self.chart.at(u, v)?;
        let feed = self.feed(&p)?;
        let (e, f, g) = p.jet.first_form();
        let (level, gradient) = match self.along {
            Along::U => (v, surface_gradient_length((e, f, g), 0.0, 1.0)),
            Along::V => (u, surface_gradient_length((e, f, g), 1.0, 0.0)),
        };
        let (width, too_concave) = if self.exact {
            p.strip_width(self.cutter, &feed, self.settings.step)
        } else {
            self.width_between_centres(&p, &feed)
        };
        let area = (e * g - f * f).max(0.0).sqrt();
        Some((
            AllowedStep { psi: level, step: width * gradient, length: area * gradient, too_concave },
            width,
        ))
    }

    /// The distance that centres may have across the feed on an offset surface of another origin, mm, and
    /// whether the part is too concave there.
    fn width_between_centres(&self, p: &ChartPoint, feed: &Vector3) -> (f64, bool) {
        let radius = self.cutter.radius();
        let FeedCurvature { along, across, twist } = p.bends(feed);
        // Seen from the centres, the part lies on the other side.
        let hollow = FeedCurvature { along: -along, across: -across, twist: -twist };
        let gap = least_gap(self.cutter, &p.normal, &p.normal.cross(feed), &hollow);
        let across = gap - 1.0 / radius;
        // 1 − κ r of the design.
        let narrower = 1.0 / (1.0 + across * radius).max(1e-3);
        match self.settings.step {
            Step::Stepover(width) => (width * narrower, false),
            Step::Scallop(h) => {
                let (width, limited) = strip_width(1.0 / radius, across * narrower, h, radius);
                let contact = p.jet.p - p.normal * radius;
                let width = self.settings.guide().corrected(width, &contact, self.settings.step);
                (width * narrower, limited)
            }
        }
    }

    /// Passes along parameter lines.
    fn lines(&self) -> Result<Passes, PlanError> {
        let (levels, notes) = self.levels(LevelSteps::Shortest)?;
        let [_, range] = self.ranges();
        let mut passes = along_and_between(self, &levels, range, self.settings.sampling, self.monitor)?;
        passes.notes.splice(0..0, notes);
        Ok(passes)
    }

    /// Whether the line at a level ends where it begins.
    fn is_closed_at(&self, level: f64) -> bool {
        let [ends, _] = self.ranges();
        let ends = ends.map(|end| self.ride(self.at(end, level)).map(|ride| ride.centre));
        matches!(ends, [Some(a), Some(b)] if (a - b).norm() <= SEAM)
    }

    fn levels(&self, placing: LevelSteps) -> Result<(Vec<f64>, Vec<String>), PlanError> {
        let places: Vec<AllowedStep> =
            self.chart.grid(SAMPLES).filter_map(|uv| self.place(uv)).map(|(place, _)| place).collect();
        if places.is_empty() {
            return Err(refused("the offset surface has no area; check the part"));
        }
        let mut notes = Vec::new();
        let [_, range] = self.ranges();
        Ok((place_levels(&places, range, placing, &mut notes), notes))
    }

    /// One spiral: a turn along the first level, then from level to level with every turn, then a turn along
    /// the last.
    fn spiral(&self) -> Result<Passes, PlanError> {
        let [[u0, u1], [v0, v1]] = self.ranges();
        if ![v0, 0.5 * (v0 + v1), v1].into_iter().all(|v| self.is_closed_at(v)) {
            return Err(refused(
                "a spiral needs a surface that closes along u, as around a blade; write `side = \"around\"` in [part], or \
                 `along = \"u\"`",
            ));
        }
        let (levels, notes) = self.levels(LevelSteps::Least)?;
        let turn = levels.iter().map(|&v| self.line_length(v)).fold(0.0, f64::max);
        let steps = (turn / self.settings.sampling).ceil().max(4.0);
        let last = levels.len() as f64;
        // The first and the last turn stay on their levels.
        let level = |turns: f64| {
            let t = (turns - 1.0).clamp(0.0, last - 1.0);
            let k = (t as usize).min(levels.len().saturating_sub(2));
            let next = levels[(k + 1).min(levels.len() - 1)];
            levels[k] + (t - k as f64) * (next - levels[k])
        };
        let at = |s: f64| {
            let turns = s / steps;
            let share = turns - turns.floor();
            self.at(u0 + share * (u1 - u0), level(turns))
        };
        let mut all = Passes { notes, ..Passes::default() };
        self.add(&at, (last + 1.0) * steps, &mut all)?;
        Ok(all)
    }

    /// Appends the pass along a curve over `[0, end]`.
    fn add(&self, at: &dyn Fn(f64) -> [f64; 2], end: f64, all: &mut Passes) -> Result<(), PlanError> {
        if let Some(touches) = self.touches_along(at, end)? {
            all.passes.push(touches.iter().map(|touch| touch.contact.point).collect());
            all.touches.push(touches);
        } else {
            all.passes.push(self.tips_along(at, end)?);
        }
        Ok(())
    }

    /// Length of the parameter line at a level, mm.
    fn line_length(&self, level: f64) -> f64 {
        let [[a, b], _] = self.ranges();
        let point = |k: usize| {
            let [u, v] = self.at(a + (b - a) * k as f64 / LENGTH_SAMPLES as f64, level);
            self.chart.jet(u, v).p
        };
        (0..LENGTH_SAMPLES).map(|k| (point(k + 1) - point(k)).norm()).sum()
    }

    /// Tips of an upright ball along a curve over `[0, end]`.
    fn tips_along(&self, at: &dyn Fn(f64) -> [f64; 2], end: f64) -> Result<Vec<Point3>, Cancelled> {
        let mut beside = Beside::default();
        let mut tip = |s: f64| {
            let centre = self.ride(at(s))?.centre;
            let own = centre.z - self.cutter.radius();
            let z = match &self.drop {
                Some(drop) => drop.at_beside(centre.x, centre.y, &mut beside)?.tip_z,
                None => own,
            };
            Some(Point3::new(centre.x, centre.y, z))
        };
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        let mut tips = settings.moves(0.0, end, &mut tip, self.monitor)?;
        close(&mut tips, |tip| *tip);
        Ok(tips)
    }

    /// Touches of a tilted ball along a curve over `[0, end]`; `None` for an upright one.
    fn touches_along(&self, at: &dyn Fn(f64) -> [f64; 2], end: f64) -> Result<Option<Vec<Touch>>, PlanError> {
        let Some(rule) = self.settings.axis else { return Ok(None) };
        let contact = |s: f64| {
            let ride = self.ride(at(s))?;
            Some((ride.contact, ride.feed))
        };
        let tolerance = self.settings.chord_tolerance;
        let mut touches = tilted::along(&contact, [0.0, end], self.cutter, rule, tolerance, self.monitor)?;
        close(&mut touches, |touch| touch.contact.point);
        Ok((touches.len() > 1).then_some(touches))
    }
}

/// Makes the end of a pass its very beginning where rounding alone keeps them apart.
fn close<P: Copy>(pass: &mut [P], place: impl Fn(&P) -> Point3) {
    if let [first, .., last] = pass
        && (place(first) - place(last)).norm() <= SEAM
    {
        *last = *first;
    }
}

impl LevelSource for PatchRider<'_> {
    type Place = [f64; 2];

    /// The parameter line at a level, its points about a sampling distance apart.
    fn curves(&self, level: f64) -> Vec<Track<[f64; 2]>> {
        let [[a, b], _] = self.ranges();
        let beyond = |end: f64| {
            let [u, v] = self.at(end, level);
            let speed =
                self.chart.at(u, v).map(|p| if self.along == Along::U { p.jet.du } else { p.jet.dv }.norm());
            let interval = self.place([u, v]).map(|(_, width)| width);
            interval.zip(speed).map_or(0.0, |(w, speed)| OVERRUN * w / speed.max(f64::MIN_POSITIVE))
        };
        let more = if self.is_closed_at(level) { [0.0; 2] } else { [a, b].map(beyond) };
        let [a, b] = [a - more[0], b + more[1]];
        let steps = (self.line_length(level) / self.settings.sampling).ceil().max(2.0) as usize;
        let points = (0..=steps).map(|k| self.at(a + (b - a) * k as f64 / steps as f64, level)).collect();
        vec![Track { points, closed: false }]
    }

    fn allowed(&self, &uv: &[f64; 2]) -> Option<Allowed> {
        let (place, width) = self.place(uv)?;
        Some(Allowed { step: place.step, width })
    }

    fn pass(
        &self,
        curve: &Track<[f64; 2]>,
        _level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let (at, end) = along_track(curve, run);
        let tips = self.tips_along(&at, end)?;
        Ok(if tips.len() > 1 { vec![tips] } else { Vec::new() })
    }

    fn touches(
        &self,
        curve: &Track<[f64; 2]>,
        _level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Option<Vec<Vec<Touch>>>, PlanError> {
        let (at, end) = along_track(curve, run);
        Ok(self.touches_along(&at, end)?.map(|touches| vec![touches]))
    }

    fn contacts(&self, curve: &Track<[f64; 2]>, run: Option<[usize; 2]>) -> Vec<Contact> {
        let contact = |&uv: &[f64; 2]| {
            let ride = self.ride(uv)?;
            let (_, allowed) = self.place(uv)?;
            let across = ride.contact.normal.cross(&ride.feed);
            Some(Contact {
                at: ride.contact.point,
                across,
                normal: ride.contact.normal,
                allowed,
                inside: true,
                parameters: None,
                asked: None,
            })
        };
        curve.along(run).filter_map(contact).collect()
    }
}

/// A run of a parameter line as a curve over `[0, end]`, a unit from point to point.
fn along_track(curve: &Track<[f64; 2]>, run: Option<[usize; 2]>) -> (impl Fn(f64) -> [f64; 2] + '_, f64) {
    let points = &curve.points;
    let [first, last] = run.unwrap_or([0, points.len() - 1]);
    let at = move |s: f64| {
        let k = (first + s as usize).min(points.len() - 2);
        let t = first as f64 + s - k as f64;
        let [a, b] = [points[k], points[k + 1]];
        [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
    };
    (at, (last - first) as f64)
}
