//! The machine's own bodies: `[[machine.body]]`.

use std::fmt::{self, Write as _};

use super::kinematics::{FiveAxis, PLACE, place};
use geometry::Point3;
use keys::{LENGTH, SceneError, Section};
use keys::{toml_number as number, toml_numbers as list, toml_string as text};
use machine::kinematics::{Chain, Link};

/// The keys of `[machine]` that this module reads.
pub(super) const KEYS: [&str; 3] = ["body", "gauge_length", "workpiece_zero"];

const SHAPES: [&str; 2] = ["box", "cylinder"];

/// The words of links that every machine has.
const FRAME: &str = "frame";
const LINEAR: &str = "Z";

/// A simple solid, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodyShape {
    /// Between two opposite corners.
    Box {
        /// The one.
        from: Point3,
        /// The other.
        to: Point3,
    },
    /// About the line between two places.
    Cylinder {
        /// The one end.
        from: Point3,
        /// The other.
        to: Point3,
        /// Its diameter.
        diameter: f64,
    },
}

/// A body of the machine.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineBody {
    /// What messages call it.
    pub name: String,
    /// What it is fixed to.
    pub link: Link,
    /// In the frame of the link.
    pub shape: BodyShape,
}

/// The bodies of a machine, and how it moves them.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineBodies {
    /// The links.
    pub chain: Chain,
    /// In the order of the scene; at least one.
    pub bodies: Vec<MachineBody>,
}

/// Reads the bodies of `[machine]`; `None` without.
pub(super) fn read(
    machine: &Section<'_>,
    five_axis: Option<&FiveAxis>,
) -> Result<Option<MachineBodies>, SceneError> {
    let sections = machine.sections("body")?;
    let elsewhere = |key: &str| {
        let (message, cure) = match five_axis {
            Some(_) => ("belongs to the rotary axes", "move it into [machine.kinematics]"),
            None => ("does nothing without a body of the machine", "delete it, or add [[machine.body]]"),
        };
        machine.key_error(key, format!("`{key}` of [machine] {message}"), cure)
    };
    if let Some(key) =
        KEYS[1..].iter().find(|key| machine.has(key) && (five_axis.is_some() || sections.is_empty()))
    {
        return Err(elsewhere(key));
    }
    let Some(first) = sections.first() else { return Ok(None) };
    let needed = |key: &str, example: &str, what: &str| {
        let table = if five_axis.is_some() { "[machine.kinematics]" } else { "[machine]" };
        let message = format!("bodies of the machine need `{key}` in {table}: {what}");
        first.error(first.header(), message, format!("add `{key} = {example}` to {table}"))
    };
    let (length, zero) = match five_axis {
        Some(made) => (
            made.gauge_is_given.then(|| made.kinematics.gauge_length()),
            made.zero_is_given.then(|| made.kinematics.workpiece_zero()),
        ),
        None => (
            machine.number("gauge_length", 0.0..=*PLACE.end(), " mm")?.map(|length| length.value),
            place(machine, "workpiece_zero")?.map(|zero| Point3::from(zero.value)),
        ),
    };
    let length = length
        .ok_or_else(|| needed("gauge_length", "150.0", "how far the tip is from the spindle nose, mm"))?;
    let zero = zero.ok_or_else(|| {
        needed("workpiece_zero", "[0.0, 0.0, -300.0]", "where the part's zero is in machine coordinates")
    })?;
    let chain = five_axis.map_or_else(|| Chain::three_axes(length, zero), |made| Chain::of(&made.kinematics));
    let bodies = sections.iter().map(|section| read_body(section, five_axis));
    Ok(Some(MachineBodies { chain, bodies: bodies.collect::<Result<_, _>>()? }))
}

/// The links of a machine by their words.
fn links(five_axis: Option<&FiveAxis>) -> Vec<(&'static str, Link)> {
    let letter = |letter: char| ["A", "B", "C"].into_iter().find(|word| word.starts_with(letter));
    let rotary = five_axis.into_iter().flat_map(|made| made.kinematics.axes().iter().enumerate());
    let rotary = rotary.filter_map(|(k, axis)| Some((letter(axis.letter)?, Link::Rotary(k))));
    [(FRAME, Link::Frame), (LINEAR, Link::Linear)].into_iter().chain(rotary).collect()
}

fn read_body(section: &Section<'_>, five_axis: Option<&FiveAxis>) -> Result<MachineBody, SceneError> {
    section.only(&["name", "on", "shape", "from", "to", "diameter"], &[], "a body of the machine")?;
    let name = section.required_text("name", "table")?.value.to_owned();
    let links = links(five_axis);
    let words: Vec<&'static str> = links.iter().map(|(word, _)| *word).collect();
    let on = section.required_word("on", &words)?;
    let link = links.iter().find(|(word, _)| *word == on.value).map_or(Link::Frame, |(_, link)| *link);
    let shape = section.required_word("shape", &SHAPES)?.value;
    let end = |key: &str| {
        let missing = || {
            let what = if shape == SHAPES[0] { "a corner" } else { "an end of its axis" };
            let message = format!("`{name}` has no `{key}`: {what}, mm");
            section.error(section.header(), message, format!("add `{key} = [0.0, 0.0, 0.0]`"))
        };
        place(section, key)?.ok_or_else(missing)
    };
    let (from, to) = (end("from")?, end("to")?);
    let no_volume = |message: &str| {
        section.error(&to.span, format!("`{name}` has no volume: {message}"), "write two different places")
    };
    let way = Point3::from(to.value) - Point3::from(from.value);
    let ends = (Point3::from(from.value), Point3::from(to.value));
    let shape = if shape == SHAPES[0] {
        if section.has("diameter") {
            let message = "a box has no `diameter`";
            return Err(section.key_error("diameter", message, "delete it, or write `shape = \"cylinder\"`"));
        }
        if way.iter().any(|side| side.abs() < *LENGTH.start()) {
            return Err(no_volume("the corners share a coordinate"));
        }
        BodyShape::Box { from: ends.0, to: ends.1 }
    } else {
        if way.norm() < *LENGTH.start() {
            return Err(no_volume("both ends of its axis are one place"));
        }
        let diameter = section.required_length("diameter", 100.0)?.value;
        BodyShape::Cylinder { from: ends.0, to: ends.1, diameter }
    };
    Ok(MachineBody { name, link, shape })
}

/// Writes what machines of three axes have for their bodies, among the keys of `[machine]`.
pub(super) fn write_places(out: &mut String, scene: &super::Scene) -> fmt::Result {
    let Some(made) = scene.bodies.as_ref().filter(|_| scene.five_axis.is_none()) else { return Ok(()) };
    writeln!(out, "gauge_length = {}  # mm, spindle nose to tip", number(-made.chain.tip().z))?;
    let zero = list(made.chain.workpiece_zero().coords.as_slice());
    writeln!(out, "workpiece_zero = {zero}  # mm, in machine coordinates")
}

/// Writes the bodies, behind all other keys of `[machine]`.
pub(super) fn write(out: &mut String, scene: &super::Scene) -> fmt::Result {
    let links = links(scene.five_axis.as_ref());
    for body in scene.bodies.iter().flat_map(|made| &made.bodies) {
        let on = links.iter().find(|(_, link)| *link == body.link).map_or(FRAME, |(word, _)| *word);
        writeln!(out, "\n[[machine.body]]  # mm")?;
        writeln!(out, "name = {}", text(&body.name))?;
        writeln!(out, "on = {}  # the joint that moves it last", text(on))?;
        let (shape, from, to) = match &body.shape {
            BodyShape::Box { from, to } => (SHAPES[0], from, to),
            BodyShape::Cylinder { from, to, .. } => (SHAPES[1], from, to),
        };
        writeln!(out, "shape = {}", text(shape))?;
        if let BodyShape::Cylinder { diameter, .. } = body.shape {
            writeln!(out, "diameter = {}", number(diameter))?;
        }
        writeln!(out, "from = {}", list(from.coords.as_slice()))?;
        writeln!(out, "to = {}", list(to.coords.as_slice()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, complete_toml};

    const SCENE: &str = "[part]\nsurface = \"plane\"\nx = [0, 9]\ny = [0, 9]\n[cutter]\nshape = \"ball\"\n\
                         diameter = 6\n[[toolpath]]\nstrategy = \"zigzag\"\n[machine]\n";
    const TABLE: &str = "[[machine.body]]\nname = \"table\"\non = \"frame\"\nshape = \"box\"\nfrom = [0, 0, -20]\nto = [9, 9, -1]\n";
    const NOSE: &str = "[[machine.body]]\nname = \"nose\"\non = \"Z\"\nshape = \"cylinder\"\ndiameter = 80\n\
                        from = [0, 0, 0]\nto = [0, 0, 60]\n";
    const PLACES: &str = "gauge_length = 120\nworkpiece_zero = [1, 2, 3]\n";

    fn parse(machine: &str) -> Result<Scene, SceneError> {
        Scene::parse("plane.toml", format!("{SCENE}{machine}"))
    }

    #[test]
    fn bodies_of_three_and_of_five_axes_read_back_as_themselves() {
        let three = format!("{PLACES}{TABLE}{NOSE}");
        let turned = TABLE.replace("frame", "C");
        let five = format!("[machine.kinematics]\npreset = \"ac-table\"\n{PLACES}{turned}{NOSE}");
        for (text, link) in [(three, Link::Frame), (five, Link::Rotary(0))] {
            let scene = parse(&text).unwrap();
            let made = scene.bodies.as_ref().unwrap();
            assert_eq!((made.bodies[0].link, made.bodies[1].link), (link, Link::Linear));
            assert_eq!((made.chain.tip().z, made.chain.workpiece_zero().y), (-120.0, 2.0));
            assert!(matches!(made.bodies[1].shape, BodyShape::Cylinder { diameter: 80.0, .. }));
            let complete = complete_toml(&scene);
            let again =
                Scene::parse("plane.toml", complete.clone()).unwrap_or_else(|e| panic!("{e}\n{complete}"));
            assert_eq!(complete_toml(&again), complete);
            assert_eq!(again.bodies.unwrap().bodies, made.bodies);
        }
    }

    #[test]
    fn what_is_no_body_is_refused_with_a_cure() {
        let five = |rest: &str| format!("[machine.kinematics]\npreset = \"bc-head\"\n{rest}");
        let cases = [
            (TABLE.to_owned(), "need `gauge_length` in [machine]", "add `gauge_length"),
            (format!("gauge_length = 9\n{TABLE}"), "need `workpiece_zero`", "add `workpiece_zero"),
            (PLACES.to_owned(), "does nothing without a body", "delete it"),
            (format!("{PLACES}{}", five(PLACES)), "belongs to the rotary axes", "move it"),
            (format!("{PLACES}{}", TABLE.replace("frame", "C")), "cannot be \"C\"", "`frame`"),
            (five(&format!("{PLACES}{}", TABLE.replace("frame", "A"))), "cannot be \"A\"", "`B`"),
            (format!("{PLACES}{}", TABLE.replace("-1]", "-20]")), "share a coordinate", "two different"),
            (format!("{PLACES}{}", NOSE.replace("60]", "0]")), "one place", "two different"),
            (format!("{PLACES}{}", NOSE.replace("diameter = 80\n", "")), "no `diameter`", "diameter = 100"),
            (format!("{PLACES}{TABLE}diameter = 4\n"), "a box has no `diameter`", "delete it"),
            (format!("{PLACES}{}", TABLE.replace("from = [0, 0, -20]\n", "")), "no `from`", "add `from"),
            (format!("{PLACES}{TABLE}colour = 4\n"), "unknown key `colour`", "`"),
        ];
        for (text, message, cure) in cases {
            match parse(&text) {
                Err(SceneError::Invalid(found)) => {
                    let right = found.message.contains(message) && found.cure.contains(cure);
                    assert!(right, "{text}: {} / {}", found.message, found.cure);
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
