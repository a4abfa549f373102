//! The rotary axes of a machine in a scene: a name, or a table `[machine.kinematics]`.

use std::fmt::{self, Write as _};

use geometry::{Point3, Vector3};
use io::gcode::{Style, TCP_WORDS};
use keys::{Located, SceneError, Section};
use keys::{toml_number as number, toml_numbers as list, toml_string as text};
use machine::Machine;
use machine::kinematics::{
    DEFAULT_GAUGE_LENGTH, DEFAULT_ROTARY_ACCELERATION, DEFAULT_ROTARY_RATE, Kinematics, KinematicsError,
    PRESETS, RotaryAxis, Side, preset,
};

/// The key of the rotary axes of a machine.
pub(super) const KEY: &str = "kinematics";

/// The word for a machine of three axes.
const NONE: &str = "none";

/// Limits of rotary axes, degrees: twenty turns.
const LIMITS: std::ops::RangeInclusive<f64> = -7200.0..=7200.0;

/// Rotary rates that make sense, degrees/min.
const RATE: std::ops::RangeInclusive<f64> = 1.0..=1e7;

/// Rotary accelerations that make sense, degrees/s².
const ACCELERATION: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// Rotary jerks that make sense, degrees/s³.
const JERK: std::ops::RangeInclusive<f64> = 1.0..=1e8;

/// Coordinates of machines, mm.
pub(super) const PLACE: std::ops::RangeInclusive<f64> = -99_999.0..=99_999.0;

/// rad/s of a degree a minute.
const DEGREE_A_MINUTE: f64 = std::f64::consts::PI / 180.0 / 60.0;

const SECONDS_PER_MINUTE: f64 = 60.0;

/// Rates of linear axes, mm/min.
const RATES: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// Accelerations of linear axes, mm/s².
const ACCELERATIONS: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// Jerks of linear axes, mm/s³.
const JERKS: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// The keys of the words with which tool centre point control begins and ends.
const TCP_KEYS: [&str; 2] = ["tcp_on", "tcp_off"];

const SIDES: [&str; 2] = ["head", "table"];

/// A five-axis machine and how programs for it are written.
#[derive(Debug, Clone, PartialEq)]
pub struct FiveAxis {
    /// The machine.
    pub kinematics: Kinematics,
    /// How programs are written.
    pub post: Style,
    /// The words with which tool centre point control begins and ends.
    pub tcp_words: [String; 2],
    /// Whether the scene says where the workpiece's zero is; else it is taken to be the machine's.
    pub zero_is_given: bool,
    /// Whether the scene has the length from the spindle nose to the tip; else it is a usual one.
    pub gauge_is_given: bool,
    /// Directions of the rotary axes as the scene has them, of any length.
    directions: [Vector3; 2],
}

/// Reads the rotary axes of `[machine]`; `None` for a machine of three axes.
///
/// Linear axes are as fast as rapids and accelerate as the path does, unless the table says otherwise.
pub(super) fn read(machine: &Section<'_>, limits: &Machine) -> Result<Option<FiveAxis>, SceneError> {
    let linear = |rates: [f64; 3], accelerations: [f64; 3], jerks: [f64; 3]| {
        move |kinematics: Kinematics| {
            kinematics
                .with_rates(rates.map(|rate| rate / SECONDS_PER_MINUTE))
                .with_accelerations(accelerations)
                .with_jerks(jerks)
        }
    };
    let rapid = limits.rates.map(|rate| rate.min(limits.rapid_rate));
    let even = limits.accelerations.map(|own| if own.is_finite() { own } else { limits.acceleration });
    let words: Vec<&str> = [NONE].into_iter().chain(PRESETS).collect();
    let Some(table) = machine.inline(KEY) else {
        let Some(word) = machine.word(KEY, &words)?.filter(|word| word.value != NONE) else {
            return Ok(None);
        };
        let made = preset(word.value).map(|axes| {
            let kinematics =
                Kinematics::new(axes[0], axes[1], DEFAULT_GAUGE_LENGTH, Point3::origin(), [None; 3]);
            kinematics.map(|kinematics| FiveAxis {
                kinematics: linear(rapid, even, limits.jerks)(kinematics),
                post: Style::Tcp,
                tcp_words: TCP_WORDS.map(str::to_owned),
                zero_is_given: false,
                gauge_is_given: false,
                directions: axes.map(|axis| axis.direction),
            })
        });
        return made.transpose().map_err(|e| machine.error(&word.span, e.to_string(), e.cure()));
    };
    table.only(
        &[
            "preset",
            "post",
            TCP_KEYS[0],
            TCP_KEYS[1],
            "first",
            "second",
            "gauge_length",
            "workpiece_zero",
            "x",
            "y",
            "z",
            "rates",
            "accelerations",
            "jerks",
        ],
        &[],
        "`kinematics`",
    )?;
    let named = table.word("preset", &PRESETS)?.and_then(|word| preset(word.value));
    let first = read_axis(&table, "first", named.map(|axes| axes[0]))?;
    let second = read_axis(&table, "second", named.map(|axes| axes[1]))?;
    let post = table.word("post", &Style::WORDS)?.and_then(|word| Style::from_word(word.value));
    let post = post.unwrap_or(Style::Tcp);
    let tcp_words = tcp_words(&table, post)?;
    let gauge_length = table.number("gauge_length", 0.0..=*PLACE.end(), " mm")?;
    let workpiece_zero = place(&table, "workpiece_zero")?;
    let has = |side| [&first, &second].iter().any(|axis| axis.side == side);
    // Linear axes follow from them: a guess would be cut into the part.
    if post == Style::Full {
        let asked = |missing: bool, key: &str, example: &str, why: &str| {
            let message = format!("`post = \"full\"` needs `{key}`: {why}");
            if missing {
                Err(table.key_error("post", message, format!("add `{key} = {example}`")))
            } else {
                Ok(())
            }
        };
        let of_head = "the head swings the tip round its axes";
        asked(gauge_length.is_none() && has(Side::Head), "gauge_length", "150.0", of_head)?;
        let of_table = "the table swings the workpiece round its axes";
        asked(workpiece_zero.is_none() && has(Side::Table), "workpiece_zero", "[0.0, 0.0, 0.0]", of_table)?;
    }
    let travel = ["x", "y", "z"].map(|key| table.interval(key, PLACE, " mm"));
    let [x, y, z] = travel;
    let gauge_is_given = gauge_length.is_some();
    let kinematics = Kinematics::new(
        first,
        second,
        gauge_length.map_or(DEFAULT_GAUGE_LENGTH, |length| length.value),
        workpiece_zero.as_ref().map_or(Point3::origin(), |zero| Point3::from(zero.value)),
        [x?, y?, z?],
    );
    let kinematics = kinematics.map_err(|e| refused(&table, first.letter, &e))?;
    let (rates, accelerations) = (rates(&table)?.unwrap_or(rapid), accelerations(&table)?.unwrap_or(even));
    let jerks = jerks(&table)?.unwrap_or(limits.jerks);
    Ok(Some(FiveAxis {
        kinematics: linear(rates, accelerations, jerks)(kinematics),
        post,
        tcp_words,
        zero_is_given: workpiece_zero.is_some(),
        gauge_is_given,
        directions: [first, second].map(|axis| axis.direction),
    }))
}

/// The words with which tool centre point control begins and ends. Both are needed to leave it as it was
/// begun.
fn tcp_words(table: &Section<'_>, post: Style) -> Result<[String; 2], SceneError> {
    let given = [table.text(TCP_KEYS[0])?, table.text(TCP_KEYS[1])?];
    let at = |k: usize| table.key_span(TCP_KEYS[k]);
    if let Some(k) = given.iter().position(Option::is_some)
        && post == Style::Full
    {
        let message = format!("`{}` acts only with `post = \"tcp\"`", TCP_KEYS[k]);
        return Err(table.error(&at(k), message, "leave it out, or write `post = \"tcp\"`"));
    }
    if let Some(text) = given.iter().flatten().find(|text| !text.value.is_ascii()) {
        return Err(table.error(&text.span, "controls read ASCII only", "write plain letters and digits"));
    }
    match given {
        [Some(begin), Some(end)] => Ok([begin.value.to_owned(), end.value.to_owned()]),
        [None, None] => Ok(TCP_WORDS.map(str::to_owned)),
        [begin, _] => {
            let (has, lacks) = if begin.is_some() { (0, 1) } else { (1, 0) };
            let message = format!("`{}` needs `{}`", TCP_KEYS[has], TCP_KEYS[lacks]);
            Err(table.error(
                &at(has),
                message,
                format!("add `{} = \"{}\"`", TCP_KEYS[lacks], TCP_WORDS[lacks]),
            ))
        }
    }
}

/// Refuses a machine for which it is not known how high its spindle nose has to be to stand over the work: no
/// program for it could begin or end safely.
pub(super) fn known_height(machine: &Section<'_>, five_axis: Option<&FiveAxis>) -> Result<(), SceneError> {
    let Some(FiveAxis { zero_is_given, gauge_is_given, .. }) = five_axis else { return Ok(()) };
    let keys =
        [("gauge_length", gauge_is_given, "150.0"), ("workpiece_zero", zero_is_given, "[0.0, 0.0, -300.0]")];
    let Some((key, _, example)) = keys.into_iter().find(|(_, given, _)| !*given) else { return Ok(()) };
    let message =
        format!("without `{key}` no height is known at which programs can begin and end free of the work");
    let cure = match machine.inline(KEY) {
        Some(_) => format!("add `{key} = {example}`"),
        None => "write it as a table: `kinematics = { preset = \"ac-table\", gauge_length = 150.0, workpiece_zero = [0.0, 0.0, -300.0] }`".to_owned(),
    };
    Err(machine.key_error(KEY, message, cure))
}

/// A refusal of the machine at the axis that it is about.
fn refused(table: &Section<'_>, first: char, error: &KinematicsError) -> SceneError {
    let of = |letter: char| if letter == first { "first" } else { "second" };
    let key = match error {
        KinematicsError::Direction { letter } | KinematicsError::Order { letter } => of(*letter),
        KinematicsError::Limits { joint } => of(*joint),
        KinematicsError::Letters { .. }
        | KinematicsError::Parallel { .. }
        | KinematicsError::AlongSpindle { .. }
        | KinematicsError::Number { .. } => "second",
    };
    table.key_error(key, error.to_string(), error.cure())
}

/// An axis, completed from that of the preset.
fn read_axis(table: &Section<'_>, key: &str, named: Option<RotaryAxis>) -> Result<RotaryAxis, SceneError> {
    let example = "{ name = \"C\", side = \"table\", direction = [0, 0, 1] }";
    let Some(section) = table.inline(key) else {
        return match named {
            Some(axis) if !table.has(key) => Ok(axis),
            _ => Err(table.key_error(
                key,
                format!("`kinematics` needs `{key}` as a table, or a `preset`"),
                format!("write `{key} = {example}`, or `preset = \"ac-table\"`"),
            )),
        };
    };
    section.only(
        &["name", "side", "direction", "point", "limits", "rate", "acceleration", "jerk"],
        &[],
        "a rotary axis",
    )?;
    let names = ["A", "B", "C"];
    let word = |key: &str, words: &[&'static str], has_default: bool| {
        if has_default { section.word(key, words) } else { section.required_word(key, words).map(Some) }
    };
    let name = word("name", &names, named.is_some())?.and_then(|word| word.value.chars().next());
    let side = word("side", &SIDES, named.is_some())?;
    let direction = section.vector("direction")?;
    if direction.is_none() && named.is_none() {
        let message = format!("`{key}` has no `direction`");
        return Err(section.error(section.header(), message, "add `direction = [0, 0, 1]`"));
    }
    if let Some(direction) = direction.as_ref().filter(|v| v.value.iter().all(|c| *c == 0.0)) {
        let message = "a direction of no length is none";
        return Err(section.error(
            &direction.span,
            message,
            "write three numbers, not all zero: `[0, 0, 1]`",
        ));
    }
    let limits = if section.is_text("limits") {
        section.word("limits", &[NONE])?;
        None
    } else {
        let given = section.interval("limits", LIMITS, " degrees")?;
        given.map(|limits| limits.map(f64::to_radians)).or(named.and_then(|axis| axis.limits))
    };
    let rate = section.number("rate", RATE, " degrees/min")?;
    let acceleration = section.number("acceleration", ACCELERATION, " degrees/s²")?;
    let jerk = section.number("jerk", JERK, " degrees/s³")?;
    let base = named.unwrap_or(RotaryAxis {
        letter: 'A',
        direction: Vector3::zeros(),
        point: Point3::origin(),
        side: Side::Table,
        limits: None,
        rate: DEFAULT_ROTARY_RATE,
        acceleration: DEFAULT_ROTARY_ACCELERATION,
        jerk: f64::INFINITY,
    });
    Ok(RotaryAxis {
        letter: name.unwrap_or(base.letter),
        direction: direction.map_or(base.direction, |v| Vector3::from(v.value)),
        point: place(&section, "point")?.map_or(base.point, |p| Point3::from(p.value)),
        side: side.map_or(base.side, |word| if word.value == SIDES[0] { Side::Head } else { Side::Table }),
        limits,
        rate: rate.map_or(base.rate, |rate| rate.value * DEGREE_A_MINUTE),
        acceleration: acceleration.map_or(base.acceleration, |given| given.value.to_radians()),
        jerk: jerk.map_or(base.jerk, |given| given.value.to_radians()),
    })
}

/// Three coordinates that a machine can have.
pub(super) fn place(section: &Section<'_>, key: &str) -> Result<Option<Located<[f64; 3]>>, SceneError> {
    let Some(place) = section.vector(key)? else { return Ok(None) };
    if place.value.iter().all(|c| PLACE.contains(c)) {
        return Ok(Some(place));
    }
    let message = format!("`{key}` lies farther out than any machine reaches");
    let cure = format!("write mm from {} to {}", PLACE.start(), PLACE.end());
    Err(section.error(&place.span, message, cure))
}

/// Fastest X, Y and Z, mm/min, where a table has them.
pub(super) fn rates(section: &Section<'_>) -> Result<Option<[f64; 3]>, SceneError> {
    of_linear(section, "rates", RATES, "mm/min")
}

/// Accelerations of X, Y and Z, mm/s², where a table has them.
pub(super) fn accelerations(section: &Section<'_>) -> Result<Option<[f64; 3]>, SceneError> {
    of_linear(section, "accelerations", ACCELERATIONS, "mm/s²")
}

/// Jerks of X, Y and Z, mm/s³, where a table has them.
pub(super) fn jerks(section: &Section<'_>) -> Result<Option<[f64; 3]>, SceneError> {
    of_linear(section, "jerks", JERKS, "mm/s³")
}

/// Limits of X, Y and Z.
fn of_linear(
    section: &Section<'_>,
    key: &str,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
) -> Result<Option<[f64; 3]>, SceneError> {
    let Some(given) = section.vector(key)? else { return Ok(None) };
    if given.value.iter().all(|value| range.contains(value)) {
        return Ok(Some(given.value));
    }
    let cure = format!("write {unit} of X, Y and Z, from {} to {}", range.start(), range.end());
    Err(section.error(&given.span, format!("`{key}` are no {key} of linear axes"), cure))
}

/// Writes the machine as scenes spell it, after all other keys of `[machine]`.
pub(super) fn write(out: &mut String, five_axis: Option<&FiveAxis>) -> fmt::Result {
    let Some(FiveAxis { kinematics, post, tcp_words, zero_is_given, gauge_is_given, directions }) = five_axis
    else {
        return writeln!(out, "{KEY} = {}  # three axes", text(NONE));
    };
    writeln!(out, "\n[machine.{KEY}]  # mm, degrees")?;
    writeln!(out, "post = {}  # who moves the linear axes along with the rotary ones", text(post.name()))?;
    if *post == Style::Tcp {
        for (key, words) in TCP_KEYS.iter().zip(tcp_words) {
            writeln!(out, "{key} = {}", text(words))?;
        }
    }
    for (key, (axis, direction)) in
        ["first", "second"].into_iter().zip(kinematics.axes().iter().zip(directions))
    {
        let side = if axis.side == Side::Head { SIDES[0] } else { SIDES[1] };
        let limits = axis.limits.map_or_else(|| text(NONE), |limits| list(&limits.map(f64::to_degrees)));
        let jerk = if axis.jerk.is_finite() {
            format!(", jerk = {}", number(axis.jerk.to_degrees()))
        } else {
            String::new()
        };
        let (direction, point) = (list(direction.as_slice()), list(axis.point.coords.as_slice()));
        writeln!(
            out,
            "{key} = {{ name = {}, side = {}, direction = {direction}, point = {point}, limits = {limits}, rate = {}, acceleration = {}{jerk} }}",
            text(&axis.letter.to_string()),
            text(side),
            number(axis.rate / DEGREE_A_MINUTE),
            number(axis.acceleration.to_degrees()),
        )?;
    }
    let length = number(kinematics.gauge_length());
    if *gauge_is_given {
        writeln!(out, "gauge_length = {length}  # spindle nose to tip")?;
    } else {
        writeln!(out, "# gauge_length is not given: it is taken to be {length}")?;
    }
    let zero = list(kinematics.workpiece_zero().coords.as_slice());
    if *zero_is_given {
        writeln!(out, "workpiece_zero = {zero}  # in machine coordinates, table at zero")?;
    } else {
        writeln!(out, "# workpiece_zero is not given: it is taken to be the machine's zero")?;
    }
    let [x, y, z, ..] = kinematics.rates().map(|rate| rate * SECONDS_PER_MINUTE);
    writeln!(out, "rates = {}  # mm/min of X, Y and Z", list(&[x, y, z]))?;
    writeln!(out, "accelerations = {}  # mm/s² of X, Y and Z", list(&kinematics.accelerations()[..3]))?;
    let jerks = kinematics.jerks();
    if jerks[..3].iter().all(|jerk| jerk.is_finite()) {
        writeln!(out, "jerks = {}  # mm/s³ of X, Y and Z", list(&jerks[..3]))?;
    }
    for (key, limits) in ["x", "y", "z"].into_iter().zip(kinematics.travel()) {
        if let Some(limits) = limits {
            writeln!(out, "{key} = {}", list(limits))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, SceneText, complete_toml};

    /// No program is planned for the machine, so that not all of it has to be known.
    const SCENE: &str = "[part]\nsurface = \"plane\"\nx = [0, 9]\ny = [0, 9]\n[cutter]\nshape = \"ball\"\n\
                         diameter = 6\n[[toolpath]]\nstrategy = \"program\"\nfile = \"a.nc\"\n[machine]\n";

    fn parse(machine: &str) -> Result<Scene, SceneError> {
        Scene::parse("plane.toml", format!("{SCENE}{machine}"))
    }

    /// What is wrong, the cure, and the text at the place.
    fn refused(machine: &str) -> (String, String, String) {
        let text = format!("{SCENE}{machine}");
        match parse(machine) {
            Err(SceneError::Invalid(finding)) => {
                let source = SceneText::new("", text.as_str());
                let (line, column) = source.line_and_column(finding.at.offset());
                let place = text.lines().nth(line - 1).unwrap()[column - 1..].to_owned();
                (finding.message.clone(), finding.cure.clone(), place)
            }
            other => panic!("{machine}: {other:?}"),
        }
    }

    #[test]
    fn a_machine_by_name_or_word_by_word() {
        assert_eq!(parse("").unwrap().five_axis, None);
        assert_eq!(parse("kinematics = \"none\"").unwrap().five_axis, None);
        for name in PRESETS {
            let five_axis = parse(&format!("kinematics = \"{name}\"")).unwrap().five_axis.unwrap();
            let rapid = [250.0; 3];
            let expected =
                Kinematics::by_name(name).map(|made| made.with_rates(rapid).with_accelerations([3000.0; 3]));
            assert_eq!(Some(five_axis.kinematics), expected, "{name}");
            assert_eq!(five_axis.post, Style::Tcp);
        }
        let table = "[machine.kinematics]\npost = \"full\"\ngauge_length = 120\nz = [-500, 0]\n\
                     first = { name = \"B\", side = \"head\", direction = [0, -2, 0], limits = [-90, 400], rate = 3600, acceleration = 90, jerk = 180 }\naccelerations = [1, 2, 3]\njerks = [4, 5, 6]\n\
                     second = { name = \"A\", side = \"head\", direction = [1, 0, 1], point = [0, 0, 80] }\n";
        let made = parse(table).unwrap().five_axis.unwrap();
        let [first, second] = *made.kinematics.axes();
        assert_eq!((first.letter, first.side, first.direction), ('B', Side::Head, -Vector3::y()));
        assert!((first.rate - std::f64::consts::PI / 3.0).abs() < 1e-12);
        assert!((first.acceleration - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!(made.kinematics.accelerations()[..3], [1.0, 2.0, 3.0]);
        assert_eq!(made.kinematics.jerks()[..3], [4.0, 5.0, 6.0]);
        assert!((first.jerk - std::f64::consts::PI).abs() < 1e-12 && second.jerk.is_infinite());
        let [least, greatest] = first.limits.unwrap();
        assert!((least + 90f64.to_radians()).abs() + (greatest - 400f64.to_radians()).abs() < 1e-12);
        assert_eq!((second.letter, second.limits, second.point.z), ('A', None, 80.0));
        assert_eq!((made.post, made.kinematics.gauge_length()), (Style::Full, 120.0));
        assert_eq!(made.kinematics.travel()[2], Some([-500.0, 0.0]));
    }

    #[test]
    fn a_preset_is_completed() {
        let text = "kinematics = { preset = \"ac-table\", second = { point = [1, 2, 3], limits = [-30, 110] }, \
                    first = { limits = \"none\" }, workpiece_zero = [4, 5, 6], post = \"full\" }";
        let made = parse(text).unwrap().five_axis.unwrap();
        let [first, second] = *made.kinematics.axes();
        assert_eq!((second.letter, second.direction, second.point.z), ('A', Vector3::x(), 3.0));
        assert!((second.limits.unwrap()[1] - 110f64.to_radians()).abs() < 1e-12);
        assert_eq!((first.limits, made.kinematics.workpiece_zero().x), (None, 4.0));
    }

    #[test]
    fn the_complete_machine_reads_back_as_itself() {
        let any = "[machine.kinematics]\nx = [-1, 2.5]\nfirst = { name = \"C\", side = \"table\", \
                   direction = [0.1, 0.3, 1], limits = [-7200, 7200] }\nsecond = { name = \"B\", side = \"head\", \
                   direction = [0.123456789012345, 1, 0.7], point = [1, 2, 3.3], rate = 1e7, jerk = 999, limits = [-0.1, 33.3] }\n\
                   jerks = [7e4, 1, 1e6]\ntcp_on = \"G43 H1 M428\"\ntcp_off = \"M429 G49\"\n";
        let named = PRESETS.iter().map(|name| format!("kinematics = \"{name}\"\n"));
        for text in named.chain([any.to_owned(), String::new()]) {
            let complete = complete_toml(&parse(&text).unwrap());
            let again =
                Scene::parse("plane.toml", complete.clone()).unwrap_or_else(|e| panic!("{e}\n{complete}"));
            assert_eq!(complete_toml(&again), complete);
        }
    }

    #[test]
    fn programs_need_a_height_that_is_known_to_be_free() {
        let planned = SCENE.replace("program\"\nfile = \"a.nc", "zigzag");
        let refused = |machine: &str| match Scene::parse("plane.toml", format!("{planned}{machine}")) {
            Err(SceneError::Invalid(found)) => {
                assert!(found.message.contains("free of the work"), "{}", found.message);
                (found.message.clone(), found.cure.clone())
            }
            other => panic!("{machine}: {other:?}"),
        };
        let (_, cure) = refused("kinematics = \"ac-table\"");
        let table = cure.split('`').nth(1).unwrap();
        assert!(Scene::parse("plane.toml", format!("{planned}{table}")).is_ok(), "{table}");
        for missing in ["gauge_length", "workpiece_zero"] {
            let given = ["gauge_length = 90", "workpiece_zero = [1, 2, 3]"].into_iter();
            let given: Vec<&str> = given.filter(|key| !key.contains(missing)).collect();
            let (message, cure) =
                refused(&format!("kinematics = {{ preset = \"bc-head\", {} }}", given.join(", ")));
            assert!(message.contains(missing) && cure.contains(missing), "{message} {cure}");
        }
    }

    /// The example of the README.
    #[test]
    fn a_table_with_a_trunnion_off_its_centre() {
        let readme = include_str!("../../README.md");
        let table = readme.split("```toml\n").find(|text| text.starts_with("[machine.kinematics]")).unwrap();
        let made = parse(table.split("```").next().unwrap()).unwrap().five_axis.unwrap();
        assert_eq!(made.kinematics.axes()[1].point, Point3::new(250.0, 203.0, -350.0));
        assert_eq!((made.post, made.kinematics.workpiece_zero().z), (Style::Full, -300.0));
        assert_eq!((made.zero_is_given, made.kinematics.rates()[2]), (true, 10_000.0 / 60.0));
        assert!(PRESETS.iter().all(|name| readme.contains(&format!("`{name}`"))));
    }

    #[test]
    fn what_is_no_machine_is_refused_where_it_stands() {
        let axis = |direction: &str| format!("{{ name = \"A\", side = \"table\", direction = {direction} }}");
        let table =
            |first: &str, second: &str| format!("[machine.kinematics]\nfirst = {first}\nsecond = {second}\n");
        let c = "{ name = \"C\", side = \"table\", direction = [0, 0, 1] }";
        let cases = [
            ("kinematics = \"ac-tabel\"".to_owned(), "cannot be", "`ac-table`", "\"ac-tabel\""),
            ("kinematics = 5".to_owned(), "expected a string", "quotes", "5"),
            ("kinematic = \"ac-table\"".to_owned(), "unknown key", "`kinematics`", "kinematic"),
            ("[machine.kinematics]\n".to_owned(), "needs `first`", "preset", "[machine.kinematics]"),
            (
                "[machine.kinematics]\npreset = \"ac-table\"\nfirst = 3".to_owned(),
                "needs `first`",
                "write",
                "first",
            ),
            (
                table(c, "{ name = \"A\", side = \"table\" }"),
                "no `direction`",
                "add `direction",
                "{ name = \"A\"",
            ),
            (table(c, "{ name = \"A\", direction = [1, 0, 0] }"), "no `side`", "add `side", "{ name = \"A\""),
            (table(c, "{ side = \"head\", direction = [1, 0, 0] }"), "no `name`", "add `name", "{ side"),
            (table(c, "{ nane = \"A\" }"), "unknown key `nane`", "`name`", "nane"),
            (table(c, &axis("[0, 0.0, -0.0]")), "no length", "not all zero", "[0, 0.0, -0.0]"),
            (table(c, &axis("[nan, 0, 1]")), "expected a number", "write", "nan"),
            (table(c, &axis("[1, 0]")), "a list of three numbers", "three numbers", "[1, 0]"),
            (table(c, &axis("[0, 0, 3]")), "are parallel", "different directions", "second"),
            (table(c, c), "called C and C", "each letter once", "second"),
            (table(&axis("[1, 0, 0]"), c), "parallel to the spindle", "exchange first and second", "second"),
            (
                table(&c.replace("table", "head"), &axis("[1, 0, 0]")),
                "comes before the table's",
                "exchange",
                "first",
            ),
            (
                table(c, &axis("[1, 0, 0], limits = [30, -30]")),
                "from a lesser to a greater",
                "the lesser first",
                "[30, -30]",
            ),
            (table(c, &axis("[1, 0, 0], limits = [30, inf]")), "expected a number", "write", "inf"),
            (table(c, &axis("[1, 0, 0], limits = [30, 30.00001]")), "no room", "lesser limit", "second"),
            (table(c, &axis("[1, 0, 0], limits = \"no\"")), "cannot be \"no\"", "`none`", "\"no\""),
            (
                table(c, &axis("[1, 0, 0], rate = 0")),
                "expected a number in degrees/min (1 to",
                "write",
                "0 }",
            ),
            (table(c, &axis("[1, 0, 0], point = [0, 0, 2e5]")), "farther out", "write mm", "[0, 0, 2e5]"),
            (
                "kinematics = { preset = \"ac-table\", post = \"full\" }".to_owned(),
                "needs `workpiece_zero`",
                "add `workpiece_zero",
                "post",
            ),
            (
                "kinematics = { preset = \"bc-head\", post = \"full\" }".to_owned(),
                "needs `gauge_length`",
                "add `gauge_length",
                "post",
            ),
            (
                "kinematics = { preset = \"bc-head\", post = \"ful\" }".to_owned(),
                "cannot be",
                "`full`",
                "\"ful\"",
            ),
            (
                "kinematics = { preset = \"bc-head\", tcp_on = \"M128\" }".to_owned(),
                "`tcp_on` needs `tcp_off`",
                "add `tcp_off = \"G49\"`",
                "tcp_on",
            ),
            (
                "kinematics = { preset = \"bc-head\", post = \"full\", gauge_length = 9, tcp_off = \"M129\" }".to_owned(),
                "acts only with `post = \"tcp\"`",
                "leave it out",
                "tcp_off",
            ),
            (
                "kinematics = { preset = \"bc-head\", tcp_on = \"M12€\", tcp_off = \"M129\" }".to_owned(),
                "ASCII only",
                "plain letters",
                "\"M12€",
            ),
            (
                "kinematics = { preset = \"bc-head\", x = [3, 1] }".to_owned(),
                "from a lesser",
                "lesser",
                "[3, 1]",
            ),
        ];
        let wrong: Vec<String> = cases
            .iter()
            .filter_map(|(text, message, cure, place)| {
                let found = refused(text);
                let right = found.0.contains(message) && found.1.contains(cure) && found.2.starts_with(place);
                (!right).then(|| format!("{text}: {found:?}\n"))
            })
            .collect();
        assert!(wrong.is_empty(), "{}", wrong.concat());
    }
}
