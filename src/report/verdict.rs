//! The rule by which a toolpath passes or is violated, and the words for it.
//!
//! A tolerance is violated when the MEASURED figure exceeds the limit; the bound of the figure's
//! error stands beside it and decides nothing, so that the verdict never depends on how cautious a
//! bound is. The limits:
//!
//! - scallop: 95 % of the ridge length stay below the scallop tolerance, and the highest ridge
//!   below [`HIGHEST_RIDGE`] times that. A planner steps for the tolerance itself and meets it up
//!   to its own discretisation, so that the highest ridge would otherwise fail by a hair in the
//!   best of plans.
//! - gouge: the greatest depth stays within the gouge tolerance.
//! - rapid: no rapid move touches stock, where the scene asks for what each move removes.
//! - collision: shank and holder touch nothing that stands when all is cut; of tilted tools, nothing that stands when they
//!   come.
//! - wall: nothing is cut beyond a pocket's outline by more than the gouge tolerance.
//! - uncut: no place stands higher than the uncut tolerance.

use serde::Serialize;

use super::map::MapMark;
use super::table::{micrometres, with_bound};
use collision::Shortfall;
use metrology::{Limits, Measurement, PocketFigures, RemovalFigures};
use sim::{HolderClearance, StandingHits};

/// The highest ridge may exceed the scallop tolerance by this factor. Less fails plans for single
/// points of a few per cent; more lets visible ridges pass.
pub const HIGHEST_RIDGE: f64 = 1.25;

/// Whether all tolerances hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Every tolerance holds.
    Pass,
    /// At least one does not.
    Fail,
}

impl Verdict {
    /// `pass` or `fail`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
        }
    }
}

/// One tolerance that does not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Violation {
    /// `collision`, `rapid`, `wall`, `scallop`, `gouge` or `uncut`.
    pub what: &'static str,
    /// The limit that was exceeded.
    pub limit_mm: f64,
    /// What was measured.
    pub measured_mm: f64,
    /// The finding in a sentence, with its place.
    pub text: String,
}

/// The line of a move, where there is a program.
fn program_line(index: u32, lines: &[u32]) -> String {
    lines.get(index as usize).map_or_else(String::new, |line| format!(", toolpath.nc line {line}"))
}

fn more_moves(count: usize) -> String {
    match count {
        0 | 1 => String::new(),
        2 => ", and on one more move".to_owned(),
        n => format!(", and on {} more moves", n - 1),
    }
}

/// A place as reports write it.
pub fn place(at: [f64; 3]) -> String {
    format!("x {:.3} y {:.3} z {:.3}", at[0], at[1], at[2])
}

/// All violations of `limits`, gravest kind first.
pub fn violations(measured: &Measurement, limits: &Limits) -> Vec<Violation> {
    [gouge(measured, limits), uncut(measured, limits)]
        .into_iter()
        .flatten()
        .chain(scallop(measured, limits))
        .collect()
}

/// The violation of rapid moves that touched stock, told of the first of them: on a machine it is the
/// one that breaks the cutter.
pub fn rapid_violation(removal: &RemovalFigures) -> Option<Violation> {
    let first = removal.rapid_contacts.first()?;
    let deepest = removal.rapid_contacts.iter().map(|c| c.depth_mm).fold(0.0, f64::max);
    let mut text = format!(
        "a rapid move touches stock, {:.3} mm deep, at {}, move {}",
        first.depth_mm,
        place(first.at_mm),
        first.move_index
    );
    // Paths that tilt the tool have no program where the scene names no machine for it.
    if first.line > 0 {
        text += &format!(", toolpath.nc line {}", first.line);
    }
    match removal.rapid_contact_count {
        0 | 1 => {}
        2 => text += ", and one more rapid move does",
        n => text += &format!(", and {} more rapid moves do", n - 1),
    }
    Some(Violation { what: "rapid", limit_mm: 0.0, measured_mm: deepest, text })
}

/// The violation that shank or holder meet the stock; `lines` are those of the moves in the program.
pub fn collision(holder: &HolderClearance, lines: &[u32]) -> Option<Violation> {
    let worst = holder.collisions.iter().reduce(|a, b| if b.depth > a.depth { b } else { a })?;
    let text = format!(
        "section {} of the holder stands {:.3} ± {:.3} mm deep in the stock at {}, move {}, toolpath.nc line {}{}",
        worst.section + 1,
        worst.depth,
        worst.error_bound,
        place([worst.at.x, worst.at.y, worst.at.z]),
        worst.move_index,
        lines.get(worst.move_index as usize).copied().unwrap_or_default(),
        more_moves(holder.collisions.len())
    );
    Some(Violation { what: "collision", limit_mm: 0.0, measured_mm: worst.depth, text })
}

/// The violation that shank or holder run into stock that still stands, by voxels of `voxel` mm; `lines` are those of the
/// moves in the program, if there is one.
pub fn standing_collision(hits: &StandingHits, voxel: f64, lines: &[u32]) -> Option<Violation> {
    let worst = hits.worst.as_ref()?;
    let text = format!(
        "section {} of the holder runs at least {:.3} mm into stock that still stands at {}, move {}{}{} (voxels of {:.3} mm)",
        worst.section + 1,
        worst.depth,
        place(worst.at.into()),
        worst.move_index,
        program_line(worst.move_index, lines),
        more_moves(hits.moves.len()),
        voxel
    );
    Some(Violation { what: "collision", limit_mm: 0.0, measured_mm: worst.depth, text })
}

/// What else is to be said about a holder that was held against standing stock.
pub fn standing_note(hits: &StandingHits, voxel: f64) -> String {
    if hits.worst.is_some() {
        return "shank and holder meet stock that still stands; rough the block first, or take a longer cutter or a \
                slimmer holder"
            .to_owned();
    }
    format!(
        "shank and holder stay clear of what still stands when they come; less than {:.3} mm across would not be seen",
        3f64.sqrt() * voxel
    )
}

/// The violation that a tool touches what it should not: moves, what is missing there, and what of the tool it is; `lines`
/// are those of the moves in the program, if there is one.
pub fn tool_collision(found: &[(usize, Shortfall, &str)], lines: &[u32]) -> Option<Violation> {
    let (index, worst, what) = found.iter().reduce(|a, b| if b.1.depth > a.1.depth { b } else { a })?;
    let at = worst.nearest.place;
    let text = format!(
        "{what} runs at least {:.3} mm into part or fixture at {}, move {index}{}{}",
        worst.depth,
        place(at.into()),
        program_line(*index as u32, lines),
        more_moves(found.len())
    );
    Some(Violation { what: "collision", limit_mm: 0.0, measured_mm: worst.depth, text })
}

/// The violation that the cutter came beyond a pocket's outline; `lines` are those of the moves.
pub fn wall_violation(pocket: &PocketFigures, limits: &Limits, lines: &[u32]) -> Option<Violation> {
    let measured = pocket.wall_gouge_mm.max(pocket.wall_gouge_of_cells_mm);
    if measured <= limits.gouge {
        return None;
    }
    let index = pocket.wall_gouge_move;
    let text = format!(
        "the wall is cut {} µm beyond the outline (limit {}) by move {index}, toolpath.nc line {}",
        with_bound(Some(measured), Some(pocket.wall_gouge_error_bound_mm)),
        micrometres(Some(limits.gouge)),
        lines.get(index as usize).copied().unwrap_or_default()
    );
    Some(Violation { what: "wall", limit_mm: limits.gouge, measured_mm: measured, text })
}

/// What else is to be said about a holder that was checked.
pub fn holder_note(holder: &HolderClearance) -> String {
    let clearance = if holder.lowest == f64::INFINITY {
        "shank and holder are never above the stock".to_owned()
    } else if holder.lowest < 0.0 {
        "shank and holder meet the stock; a longer cutter or a slimmer holder may clear it".to_owned()
    } else {
        format!(
            "shank and holder stay {:.3} ± {:.3} mm above the finished stock",
            holder.lowest, holder.error_bound
        )
    };
    match holder.uncertain {
        0 => clearance,
        n => format!("{clearance}; on {n} moves only a finer cell can tell whether they touch it"),
    }
}

fn gouge(measured: &Measurement, limits: &Limits) -> Option<Violation> {
    let figures = &measured.gouge;
    if figures.max_depth_mm <= limits.gouge {
        return None;
    }
    let mut text = format!(
        "gouge {} µm deep (limit {})",
        with_bound(Some(figures.max_depth_mm), Some(figures.error_bound_mm)),
        micrometres(Some(limits.gouge))
    );
    if let Some(worst) = figures.regions.first() {
        text += &format!(" at {}, move {}", place(worst.at_mm), worst.move_index);
        // Paths that tilt the tool have no program where the scene names no machine for it.
        if worst.line > 0 {
            text += &format!(", toolpath.nc line {}", worst.line);
        }
        text += &others(figures.region_count);
    }
    Some(Violation { what: "gouge", limit_mm: limits.gouge, measured_mm: figures.max_depth_mm, text })
}

fn uncut(measured: &Measurement, limits: &Limits) -> Option<Violation> {
    let figures = &measured.uncut;
    let worst = figures.regions.first()?;
    let text = format!(
        "uncut material {} µm high (limit {}) over {:.3} mm² at {}{}",
        with_bound(Some(figures.max_height_mm), Some(figures.error_bound_mm)),
        micrometres(Some(limits.uncut)),
        figures.area_mm2,
        place(worst.at_mm),
        others(figures.region_count)
    );
    Some(Violation { what: "uncut", limit_mm: limits.uncut, measured_mm: figures.max_height_mm, text })
}

fn scallop(measured: &Measurement, limits: &Limits) -> Vec<Violation> {
    let figures = &measured.scallop;
    let violation = |limit: f64, value: Option<f64>, error: Option<f64>, what: &str, place: String| {
        let value = value.filter(|value| *value > limit)?;
        let text = format!(
            "{what} is {} µm (limit {}){place}",
            with_bound(Some(value), error),
            micrometres(Some(limit))
        );
        Some(Violation { what: "scallop", limit_mm: limit, measured_mm: value, text })
    };
    let at = figures.max_at_mm.map_or(String::new(), |at| format!(" at {}", place(at)));
    let highest = violation(
        HIGHEST_RIDGE * limits.scallop,
        figures.max_mm,
        figures.error_bound_mm,
        "the highest scallop",
        at,
    );
    let most = violation(
        limits.scallop,
        figures.p95_mm,
        None,
        "the scallop height that 95 % of the ridges stay below",
        String::new(),
    );
    highest.into_iter().chain(most).collect()
}

/// The gravest places of each kind of violation, named `G1`, `G2` … for gouges, `U1` … for uncut
/// material, in the order of their lists, and `S` for a scallop that is too high.
pub fn marks(measured: &Measurement, limits: &Limits) -> Vec<MapMark> {
    /// More rings of one kind hide the map.
    const MOST: usize = 5;
    let numbered = |letter: char, places: Vec<[f64; 3]>| {
        let named =
            |(k, [x, y, _]): (usize, [f64; 3])| MapMark { at: [x, y], name: format!("{letter}{}", k + 1) };
        places.into_iter().take(MOST).enumerate().map(named).collect::<Vec<_>>()
    };
    let high = measured.scallop.max_mm.is_some_and(|height| height > HIGHEST_RIDGE * limits.scallop);
    let scallop = measured.scallop.max_at_mm.filter(|_| high);
    let mut marks = numbered('G', measured.gouge.regions.iter().map(|r| r.at_mm).collect());
    marks.extend(numbered('U', measured.uncut.regions.iter().map(|r| r.at_mm).collect()));
    marks.extend(scallop.map(|[x, y, _]| MapMark { at: [x, y], name: "S".to_owned() }));
    marks
}

fn others(region_count: usize) -> String {
    match region_count {
        0 | 1 => String::new(),
        2 => ", and one more place".to_owned(),
        n => format!(", and {} more places", n - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{LIMITS, measurement};
    use super::*;
    use metrology::UncutRegion;
    use sim::Collision;

    #[test]
    fn a_limit_is_violated_above_it_and_not_at_it() {
        let mut measured = measurement(LIMITS.gouge);
        measured.scallop.max_mm = Some(HIGHEST_RIDGE * LIMITS.scallop);
        measured.scallop.p95_mm = Some(LIMITS.scallop);
        assert_eq!(violations(&measured, &LIMITS), []);
        measured.gouge.max_depth_mm = LIMITS.gouge * (1.0 + 1e-12);
        measured.scallop.max_mm = Some(HIGHEST_RIDGE * LIMITS.scallop * (1.0 + 1e-12));
        measured.scallop.p95_mm = Some(LIMITS.scallop * (1.0 + 1e-12));
        let kinds: Vec<&str> = violations(&measured, &LIMITS).iter().map(|v| v.what).collect();
        assert_eq!(kinds, ["gouge", "scallop", "scallop"]);
    }

    #[test]
    fn any_uncut_region_is_a_violation_with_its_place() {
        let mut measured = measurement(0.0);
        let at_mm = [1.0, 2.0, 3.0];
        measured.uncut.regions = vec![UncutRegion { height_mm: 0.2, area_mm2: 1.0, volume_mm3: 0.1, at_mm }];
        measured.uncut.max_height_mm = 0.2;
        measured.uncut.region_count = 3;
        let found = violations(&measured, &LIMITS);
        assert_eq!(found[0].what, "uncut");
        assert!(
            found[0].text.ends_with("at x 1.000 y 2.000 z 3.000, and 2 more places"),
            "{}",
            found[0].text
        );
    }

    #[test]
    fn the_gravest_places_are_marked_and_those_within_limits_are_not() {
        assert_eq!(marks(&measurement(0.001), &LIMITS), []);
        let mut measured = measurement(0.032);
        let region = measured.gouge.regions[0];
        measured.gouge.regions.resize(7, region);
        measured.scallop.max_mm = Some(1.01 * HIGHEST_RIDGE * LIMITS.scallop);
        let found = marks(&measured, &LIMITS);
        let names: Vec<&str> = found.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, ["G1", "G2", "G3", "G4", "G5", "S"]);
        assert_eq!((found[0].at, found[5].at), ([12.5, 7.25], [3.0, 4.0]));
    }

    #[test]
    fn the_first_rapid_in_stock_is_told_with_its_line() {
        use metrology::RapidContactFigures;
        assert_eq!(rapid_violation(&RemovalFigures::default()), None);
        let contact =
            |depth_mm| RapidContactFigures { move_index: 7, line: 12, at_mm: [1.0, 2.0, 3.0], depth_mm };
        let rapid_contacts = vec![contact(0.25), contact(1.5)];
        let removal = RemovalFigures { rapid_contacts, rapid_contact_count: 3, ..Default::default() };
        let found = rapid_violation(&removal).unwrap();
        assert_eq!((found.what, found.measured_mm), ("rapid", 1.5));
        let place =
            "0.250 mm deep, at x 1.000 y 2.000 z 3.000, move 7, toolpath.nc line 12, and 2 more rapid";
        assert!(found.text.contains(place), "{}", found.text);
    }

    #[test]
    fn a_collision_names_section_move_and_line() {
        let at = geometry::Point3::new(1.0, 2.0, 3.0);
        let one = Collision { move_index: 4, section: 1, at, depth: 0.5, error_bound: 0.1 };
        let collisions = vec![one, Collision { move_index: 6, depth: 2.25, ..one }];
        let mut holder = HolderClearance {
            lowest: -2.25,
            error_bound: 0.1,
            at: Some((6, 1, at)),
            collisions,
            uncertain: 3,
        };
        let found = collision(&holder, &[0, 0, 0, 0, 14, 15, 16]).unwrap();
        assert_eq!((found.what, found.measured_mm), ("collision", 2.25));
        let expected = "section 2 of the holder stands 2.250 ± 0.100 mm deep in the stock at x 1.000 y 2.000 z 3.000, \
                        move 6, toolpath.nc line 16, and on one more move";
        assert_eq!(found.text, expected);
        assert!(holder_note(&holder).contains("on 3 moves only a finer cell"));
        (holder.collisions, holder.lowest, holder.uncertain) = (vec![], 1.5, 0);
        assert_eq!(collision(&holder, &[]), None);
        assert_eq!(holder_note(&holder), "shank and holder stay 1.500 ± 0.100 mm above the finished stock");
    }

    #[test]
    fn a_holder_in_standing_stock_is_told_with_its_place_and_line() {
        let at = geometry::Point3::new(1.0, 2.0, 3.0);
        let worst = sim::HolderHit { move_index: 2, section: 1, at, depth: 0.75 };
        let hits = StandingHits { moves: vec![2, 5, 9], worst: Some(worst) };
        let found = standing_collision(&hits, 0.3, &[4, 5, 6]).unwrap();
        assert_eq!((found.what, found.measured_mm), ("collision", 0.75));
        let expected = "section 2 of the holder runs at least 0.750 mm into stock that still stands at x 1.000 y 2.000 z \
                        3.000, move 2, toolpath.nc line 6, and on 2 more moves (voxels of 0.300 mm)";
        assert_eq!(found.text, expected);
        assert!(standing_note(&hits, 0.3).contains("rough the block first"));
        let clear = StandingHits::default();
        assert_eq!(standing_collision(&clear, 0.3, &[]), None);
        assert!(standing_note(&clear, 0.3).contains("less than 0.520 mm across"));
    }

    #[test]
    fn a_gouge_names_move_and_line() {
        let text = violations(&measurement(0.032), &LIMITS)[0].text.clone();
        assert!(text.contains("gouge 32.0 ± 0.50 µm deep (limit 5.00)"), "{text}");
        assert!(text.contains("at x 12.500 y 7.250 z -1.032, move 1234, toolpath.nc line 1240"), "{text}");
    }
}
