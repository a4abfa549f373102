//! The rules that sections must keep.

use super::{LEAST_POINTS, MAX_POINTS, Outline, Section, SectionCurve, SectionError, SectionPlace};
use geometry::{MAX_COORDINATE, Point2, Vector2, first_crossing};

/// Neighbouring points nearer than this share of their section's size are the same. Below it chord lengths,
/// by which splines are laid, are rounding; tables with ten digits stay above it.
const REPEATED: f64 = 1e-9;

/// Less area than this share of the square of its size is none.
const NO_AREA: f64 = 1e-9;

/// A section this many times larger or smaller than the median is in another unit: an inch is 25.4 mm. Blades
/// that run out into a point stay below.
const GREATEST_SIZE_RATIO: f64 = 20.0;

/// Heights that span this many times the greatest section, or this part of it, are in another unit: a metre
/// is 1000 mm. Long blades have 10, discs of a short duct 1/50.
const GREATEST_SPAN_RATIO: f64 = 200.0;

/// The sections, if every rule holds, outlines counter-clockwise.
pub(super) fn checked(mut sections: Vec<Section>) -> Result<Vec<Section>, SectionError> {
    if sections.len() < 2 {
        return Err(SectionError::TooFewSections { count: sections.len() });
    }
    let count = sections.iter().map(|s| s.outline.point_count()).sum();
    if count > MAX_POINTS {
        return Err(SectionError::TooManyPoints { count });
    }
    check_heights(&sections)?;
    check_kinds(&sections)?;
    for (k, section) in sections.iter_mut().enumerate() {
        let place = place(k, section);
        if let Outline::Closed(points) = &mut section.outline
            && points.len() > 1
            && points.first() == points.last()
        {
            points.pop();
        }
        check_points(&section.outline, place)?;
    }
    check_sizes(&sections)?;
    for (k, section) in sections.iter().enumerate() {
        check_shape(&section.outline, place(k, section))?;
    }
    check_senses(&sections)?;
    for section in &mut sections {
        let clockwise = section.outline.signed_area() < 0.0;
        if let Outline::Closed(points) = &mut section.outline
            && clockwise
        {
            points.reverse();
        }
    }
    Ok(sections)
}

fn place(k: usize, section: &Section) -> SectionPlace {
    SectionPlace { section: k, height: section.height, point: None }
}

fn at_point(place: SectionPlace, curve: SectionCurve, point: usize) -> SectionPlace {
    SectionPlace { point: Some((curve, point)), ..place }
}

fn check_heights(sections: &[Section]) -> Result<(), SectionError> {
    for (k, section) in sections.iter().enumerate() {
        let height = section.height;
        if height.is_nan() || height.abs() > MAX_COORDINATE {
            return Err(SectionError::Height { section: k, height });
        }
        let before = k.checked_sub(1).and_then(|k| sections.get(k)).map_or(f64::NEG_INFINITY, |s| s.height);
        if height <= before {
            return Err(SectionError::NotRising { place: place(k, section), before });
        }
    }
    Ok(())
}

fn check_kinds(sections: &[Section]) -> Result<(), SectionError> {
    let closed = sections.first().is_some_and(|s| s.outline.is_closed());
    match sections.iter().enumerate().find(|(_, s)| s.outline.is_closed() != closed) {
        Some((k, s)) => Err(SectionError::Kind { place: place(k, s), closed: !closed }),
        None => Ok(()),
    }
}

fn check_points(outline: &Outline, place: SectionPlace) -> Result<(), SectionError> {
    for (curve, points) in outline.curves() {
        let bad = |p: &Point2| p.coords.iter().any(|c| c.is_nan() || c.abs() > MAX_COORDINATE);
        if let Some((k, at)) = points.iter().enumerate().find(|(_, p)| bad(p)) {
            return Err(SectionError::Coordinate { place: at_point(place, curve, k), at: *at });
        }
    }
    let least = REPEATED * outline.size();
    for (curve, points) in outline.curves() {
        if points.len() < LEAST_POINTS {
            return Err(SectionError::TooFewPoints { place, curve, count: points.len() });
        }
        let same = |a: &Point2, b: &Point2| (a - b).norm() <= least;
        if let Some(k) = points.windows(2).position(|w| matches!(w, [a, b] if same(a, b))) {
            return Err(SectionError::Repeated { place: at_point(place, curve, k + 1), of: k });
        }
        if let (true, Some(first), Some(last)) = (outline.is_closed(), points.first(), points.last())
            && same(first, last)
        {
            return Err(SectionError::Repeated { place: at_point(place, curve, points.len() - 1), of: 0 });
        }
    }
    Ok(())
}

/// The size that most sections have: the median of them, the greater of two.
fn usual_size(sizes: &[f64]) -> f64 {
    let mut sorted = sizes.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

fn check_sizes(sections: &[Section]) -> Result<(), SectionError> {
    let sizes: Vec<f64> = sections.iter().map(|s| s.outline.size()).collect();
    let usual = usual_size(&sizes);
    let unlike =
        |size: f64| size > GREATEST_SIZE_RATIO * usual || usual > GREATEST_SIZE_RATIO * size || size == 0.0;
    if let Some((k, &size)) = sizes.iter().enumerate().find(|(_, size)| unlike(**size)) {
        let place =
            sections.get(k).map_or(SectionPlace { section: k, height: 0.0, point: None }, |s| place(k, s));
        return Err(SectionError::Size { place, size, usual });
    }
    let size = sizes.iter().copied().fold(0.0, f64::max);
    let span = sections.last().map_or(0.0, |s| s.height) - sections.first().map_or(0.0, |s| s.height);
    if span > GREATEST_SPAN_RATIO * size || size > GREATEST_SPAN_RATIO * span {
        return Err(SectionError::HeightUnit { span, size });
    }
    Ok(())
}

/// Refuses outlines without area and curves that cross.
fn check_shape(outline: &Outline, place: SectionPlace) -> Result<(), SectionError> {
    if let Outline::Sides { pressure, suction } = outline {
        check_directions(pressure, suction, place)?;
    }
    let (names, points) = around(outline);
    if let Some((a, b, at)) = first_crossing(std::slice::from_ref(&points)) {
        let ends = |k: u32| {
            let name = |k: usize| names.get(k % names.len()).copied().unwrap_or((SectionCurve::Outline, 0));
            [name(k as usize), name(k as usize + 1)]
        };
        return Err(crossing(place, ends(a.index), ends(b.index), at));
    }
    if outline.signed_area().abs() <= NO_AREA * outline.size().powi(2) {
        return Err(SectionError::NoArea { place });
    }
    Ok(())
}

/// A section as one closed curve, and which point of which curve each of its points is.
fn around(outline: &Outline) -> (Vec<(SectionCurve, usize)>, Vec<Point2>) {
    match outline {
        Outline::Closed(points) => {
            ((0..points.len()).map(|k| (SectionCurve::Outline, k)).collect(), points.clone())
        }
        Outline::Sides { pressure, suction } => {
            let least = REPEATED * outline.size();
            let shared = |a: Option<&Point2>, b: Option<&Point2>| {
                a.zip(b).is_some_and(|(a, b)| (a - b).norm() <= least)
            };
            // Ends that the sides share stand once.
            let first = usize::from(shared(pressure.first(), suction.first()));
            let last = suction.len() - usize::from(shared(pressure.last(), suction.last()));
            let along = pressure.iter().enumerate().map(|(k, p)| ((SectionCurve::Pressure, k), *p));
            let back = suction.iter().enumerate().take(last).skip(first).rev();
            along.chain(back.map(|(k, p)| ((SectionCurve::Suction, k), *p))).unzip()
        }
    }
}

/// The error about two sides, each given by its ends.
fn crossing(
    place: SectionPlace,
    a: [(SectionCurve, usize); 2],
    b: [(SectionCurve, usize); 2],
    at: Point2,
) -> SectionError {
    let [curve, others @ ..] = [a[0].0, a[1].0, b[0].0, b[1].0];
    if others == [curve; 3] {
        let sides = [[a[0].1, a[1].1], [b[0].1, b[1].1]];
        return SectionError::CrossesItself { place: at_point(place, curve, a[0].1), curve, sides, at };
    }
    let on = |wanted: SectionCurve| {
        let found = [a[0], a[1], b[0], b[1]].into_iter().find(|(curve, _)| *curve == wanted);
        found.map_or(0, |(_, k)| k)
    };
    let points = [on(SectionCurve::Pressure), on(SectionCurve::Suction)];
    SectionError::SidesCross { place: at_point(place, SectionCurve::Pressure, points[0]), points, at }
}

/// Both sides must run the same way.
fn check_directions(
    pressure: &[Point2],
    suction: &[Point2],
    place: SectionPlace,
) -> Result<(), SectionError> {
    let ends = (pressure.first(), pressure.last(), suction.first(), suction.last());
    if let (Some(p0), Some(p1), Some(s0), Some(s1)) = ends
        && (p0 - s0).norm() + (p1 - s1).norm() > (p0 - s1).norm() + (p1 - s0).norm()
    {
        return Err(SectionError::SidesOpposed { place });
    }
    Ok(())
}

/// From the leading to the trailing edge of two sides.
fn chord(outline: &Outline) -> Option<Vector2> {
    match outline {
        Outline::Closed(_) => None,
        Outline::Sides { pressure, suction } => {
            let along = |side: &[Point2]| Some(side.last()? - side.first()?);
            Some((along(pressure)? + along(suction)?) * 0.5)
        }
    }
}

/// Sections must run as the one before them does.
fn check_senses(sections: &[Section]) -> Result<(), SectionError> {
    for (k, pair) in sections.windows(2).enumerate() {
        let [before, after] = pair else { continue };
        let place = place(k + 1, after);
        if let (Some(a), Some(b)) = (chord(&before.outline), chord(&after.outline))
            && a.dot(&b) < 0.0
        {
            return Err(SectionError::LeadingSwitched { place });
        }
        if (before.outline.signed_area() > 0.0) != (after.outline.signed_area() > 0.0) {
            return Err(SectionError::Sense { place, closed: after.outline.is_closed() });
        }
    }
    Ok(())
}
