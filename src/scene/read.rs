//! From text to a checked scene.

use std::path::Path;
use std::sync::Arc;

use super::tooling::SPEEDS;
use super::{
    DEFAULT_CLEARANCE, DEFAULT_LIMITS, DEFAULT_MEMORY_MIB, DEFAULT_REMOVAL, EngineChoice, NamedFile,
    PartSource, Scene, Simulation, Tooling, ToolpathRequest, auto_cell, default_error_bound,
};
use super::{axis, bodies, compare, direction, foreign, interference, kinematics, part, stock, tooling};
use cutter::Cutter;
use geometry::Region;
use io::regular;
use keys::{Located, SceneError, SceneText, Section, printable};
use machine::{Blending, Machine};
use metrology::{Limits, ScallopRule};
use toolpath::{Joining, Links, PartKind, Step, Strategy, read_pocket_step, read_strategy, words_for};

/// Largest scene that is read, bytes. A scene is a page of text; a larger file is a mistake.
const MAX_BYTES: u64 = 1 << 20;

/// Feeds and speeds that make sense.
pub(super) const RATE: std::ops::RangeInclusive<f64> = 0.001..=1e6;

/// Lines of a program that controls run in a second.
const BLOCK_RATE: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// Jerks that make sense, mm/s³.
const JERK: std::ops::RangeInclusive<f64> = 1.0..=1e12;

/// How controls share acceleration at corners.
pub(super) const BLENDINGS: [(&str, Blending); 2] = [("full", Blending::Full), ("arcs", Blending::Arcs)];

impl Scene {
    /// Reads and checks a scene file. Files that it names are looked for beside it.
    ///
    /// # Errors
    /// [`SceneError`] when the file cannot be read or anything in it is wrong.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let unreadable = |reason: String| SceneError::unreadable(path, reason);
        let bytes = regular::read(path, MAX_BYTES).map_err(|e| unreadable(e.to_string()))?;
        if bytes.len() as u64 > MAX_BYTES {
            return Err(unreadable(format!("it is larger than {MAX_BYTES} bytes, too large for a scene")));
        }
        let text = String::from_utf8(bytes).map_err(|e| {
            let line =
                e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count() + 1;
            unreadable(format!("line {line} is not UTF-8 text"))
        })?;
        Self::of_text(&path.to_string_lossy(), text)
    }

    /// Checks a scene's text and reads what its toolpaths need from files. `name` is what messages call it,
    /// and relative paths start from its folder.
    ///
    /// # Errors
    /// [`SceneError`] when anything in it, or a file that it names, is wrong.
    pub fn of_text(name: &str, text: impl Into<String>) -> Result<Self, SceneError> {
        let mut scene = Self::parse(name, text)?;
        scene.check_files()?;
        scene.load_directions()?;
        scene.load_programs()?;
        Ok(scene)
    }

    /// Checks a scene's text. `name` is what messages call it, and relative paths start from its
    /// folder. Touches no file.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] for the first thing that is wrong.
    pub fn parse(name: &str, text: impl Into<String>) -> Result<Self, SceneError> {
        let source = SceneText::new(name, text);
        let table = source.table()?;
        let root = Section::root(&source, table.get_ref());
        root.only(
            &[
                "title",
                "part",
                "stock",
                "cutter",
                "holder",
                "tolerance",
                "simulation",
                "machine",
                "interference",
                "fixture",
                "compare",
                "toolpath",
            ],
            &[],
            "a scene",
        )?;
        let title = match root.text("title")? {
            Some(title) => title.value.to_owned(),
            None => Path::new(name).file_stem().map_or("scene".into(), |s| printable(&s.to_string_lossy())),
        };
        let folder = Path::new(name).parent().unwrap_or(Path::new("")).to_owned();
        let part = part::read(&root.section("part")?, &folder)?;
        let judged = part::read_judged(&root.section("part")?)?;
        let tooling = tooling::read(&root)?;
        let section = root.section("stock")?;
        let stock = stock::read(&section, &folder, &part, &tooling.cutter)?;
        let stock_is_stated = !stock.is_around() || section.has("margin");
        let section = root.section("tolerance")?;
        let tolerance = read_tolerance(&section)?;
        let scallop_rule = read_scallop_rule(&section)?;
        let off_direction =
            section.number("direction", OFF_DIRECTION, " degrees")?.map(|v| v.value.to_radians());
        let correct = section.flag("correct")?.unwrap_or(true);
        let minutes = compare::read(&root)?;
        if !minutes.is_empty() && section.has("correct") {
            let message = "`correct` does not apply where [compare] plans for a machining time";
            return Err(section.key_error("correct", message, "delete it, or delete [compare]"));
        }
        let simulation = read_simulation(&root.section("simulation")?, &tolerance)?;
        let section = root.section("machine")?;
        let keep_clear = interference::read(&root, &folder)?;
        let (machine, clearance) = read_machine(&section)?;
        let five_axis = kinematics::read(&section, &machine)?;
        let arcs = read_arcs(&section, five_axis.is_some(), &tolerance)?;
        if five_axis.is_some() && section.has("blending") {
            let message = "`blending` does not apply to machines with rotary axes";
            return Err(section.key_error("blending", message, "delete it"));
        }
        let bodies = bodies::read(&section, five_axis.as_ref())?;
        let toolpaths = read_toolpaths(&root, &folder, &tolerance, correct, &tooling, &minutes)?;
        if toolpaths.iter().any(|request| !request.is_foreign()) {
            kinematics::known_height(&section, five_axis.as_ref())?;
            tooling::check_rates(&root, &tooling, &toolpaths, &machine)?;
        }
        check_pocket_strategies(&root, &part, &toolpaths)?;
        Ok(Self {
            source: source.clone(),
            title,
            part,
            judged,
            stock,
            stock_is_stated,
            tooling,
            tolerance,
            scallop_rule,
            off_direction,
            simulation: simulation(&toolpaths),
            machine,
            five_axis,
            arcs,
            bodies,
            clearance,
            keep_clear,
            toolpaths,
        })
    }

    /// The file that the part comes from, if it comes from one.
    pub fn part_file(&self) -> Option<&NamedFile> {
        self.part.file()
    }

    /// Every file that the scene names: of the part, the stock, the fixtures, and the feed directions.
    pub fn files(&self) -> impl Iterator<Item = &NamedFile> {
        let fixtures = self.keep_clear.fixtures.iter().map(|fixture| &fixture.file);
        let directions = self.toolpaths.iter().flat_map(|request| &request.directions);
        let stock = self.stock.file().map(|mesh| &mesh.file);
        self.part_file().into_iter().chain(stock).chain(fixtures).chain(directions)
    }

    /// Reads the files of feed directions into the strategies that follow them.
    fn load_directions(&mut self) -> Result<(), SceneError> {
        for request in &mut self.toolpaths {
            direction::load(request, &self.source)?;
        }
        Ok(())
    }

    /// Reads the programs from elsewhere.
    fn load_programs(&mut self) -> Result<(), SceneError> {
        let mut requests = std::mem::take(&mut self.toolpaths);
        let loaded = requests.iter_mut().try_for_each(|request| foreign::load(request, self));
        self.toolpaths = requests;
        loaded
    }

    /// Refuses a file that is not there or cannot be opened, pointing at its name in the scene.
    fn check_files(&self) -> Result<(), SceneError> {
        let fixtures = self.keep_clear.fixtures.iter().map(|fixture| ("fixture", &fixture.file));
        let stock = self.stock.file().map(|mesh| ("stock", &mesh.file));
        self.part_file().map(|file| ("part", file)).into_iter().chain(stock).chain(fixtures).try_for_each(
            |(whose, file)| {
                let Err(reason) = regular::open(&file.path) else { return Ok(()) };
                let message = format!("cannot read the {whose}'s file {}: {reason}", file.path.display());
                Err(self.source.error(
                    file.span.clone(),
                    message,
                    "relative paths start from the scene's folder",
                ))
            },
        )
    }
}

fn read_tolerance(section: &Section<'_>) -> Result<Limits, SceneError> {
    const KEYS: [&str; 8] =
        ["scallop", "scallop_share", "scallop_highest", "gouge", "uncut", "chord", "direction", "correct"];
    section.only(&KEYS, &[], "[tolerance]")?;
    let scallop = section.length_or("scallop", DEFAULT_LIMITS.scallop)?;
    let highest = read_scallop_rule(section)?.highest * scallop;
    Ok(Limits {
        scallop,
        gouge: section.length_or("gouge", DEFAULT_LIMITS.gouge)?,
        // What ridges may be, other material may be as well where nothing is said of it.
        uncut: section.length_or("uncut", DEFAULT_LIMITS.uncut.max(highest))?,
        // A tenth of the ridges at most: what chords leave or cut stands beside them.
        chord: section.length_or("chord", DEFAULT_LIMITS.chord.min(CHORD_SHARE * scallop))?,
    })
}

/// Of the scallop tolerance: the chord tolerance where none is given and the scallop tolerance is small.
const CHORD_SHARE: f64 = 0.1;

/// Limits of how far passes may be off their directions, degrees: none is off by more than a right angle.
const OFF_DIRECTION: std::ops::RangeInclusive<f64> = 0.0..=90.0;

/// Ridges of which less must hold the target are not judged by it; ridges that may be higher neither.
const LEAST_SHARE: f64 = 0.01;
const GREATEST_FACTOR: f64 = 100.0;

fn read_scallop_rule(section: &Section<'_>) -> Result<ScallopRule, SceneError> {
    let strict = ScallopRule::default();
    Ok(ScallopRule {
        share: section.number_or("scallop_share", LEAST_SHARE..=1.0, "", strict.share)?,
        highest: section.number_or("scallop_highest", 1.0..=GREATEST_FACTOR, "", strict.highest)?,
    })
}

/// What there is once the toolpaths are read, which an automatic cell follows from.
fn read_simulation(
    section: &Section<'_>,
    limits: &Limits,
) -> Result<impl FnOnce(&[ToolpathRequest]) -> Simulation + use<>, SceneError> {
    section.only(
        &["cell", "memory_mib", "engine", "removal", "error_bound", "voxel"],
        &[],
        "[simulation]",
    )?;
    let cell = section.length_or_word("cell", "auto")?;
    let engine =
        section.word("engine", &EngineChoice::words())?.and_then(|word| EngineChoice::from_word(word.value));
    let memory_mib = section.count("memory_mib", 1..=1 << 20)?.unwrap_or(DEFAULT_MEMORY_MIB);
    let removal = section.flag("removal")?.unwrap_or(DEFAULT_REMOVAL);
    let error_bound = section.length("error_bound")?.map_or_else(|| default_error_bound(limits), |v| v.value);
    let voxel = section.length("voxel")?.map(|v| v.value);
    Ok(move |toolpaths: &[ToolpathRequest]| Simulation {
        cell: cell.unwrap_or_else(|| auto_cell(toolpaths)),
        cell_is_auto: cell.is_none(),
        memory_mib,
        engine: engine.unwrap_or_default(),
        removal,
        error_bound,
        voxel,
    })
}

/// The key for arcs in programs.
const ARCS: &str = "arcs";

/// How near arcs of a program stay to its moves, mm; `None` without arcs.
fn read_arcs(section: &Section<'_>, five_axis: bool, tolerance: &Limits) -> Result<Option<f64>, SceneError> {
    let Some(arcs) = section.length(ARCS)? else { return Ok(None) };
    let refuse = |message: String, cure: &str| Err(section.error(&arcs.span, message, cure));
    if five_axis {
        return refuse(
            "`arcs` does not apply to programs of machines with rotary axes".into(),
            "delete one of `arcs` and `kinematics`",
        );
    }
    if arcs.value > tolerance.chord {
        let message =
            format!("`arcs` is {} mm, more than the chord tolerance of {} mm", arcs.value, tolerance.chord);
        return refuse(message, "write less, or a greater `chord` in [tolerance]");
    }
    Ok(Some(arcs.value))
}

fn read_machine(section: &Section<'_>) -> Result<(Machine, f64), SceneError> {
    if let Some(key) = SPEEDS.into_iter().find(|key| section.has(key)) {
        let message = format!("the key `{key}` does not apply to [machine]");
        return Err(section.key_error(key, message, format!("write `{key}` in [cutter]")));
    }
    let bodies = bodies::KEYS;
    section.only(
        &[
            "rapid_rate",
            "acceleration",
            "junction_deviation",
            "jerk",
            "block_rate",
            "rates",
            "accelerations",
            "jerks",
            "blending",
            "slow_corners",
            "clearance",
            ARCS,
            kinematics::KEY,
            bodies[0],
            bodies[1],
            bodies[2],
        ],
        &[],
        "[machine]",
    )?;
    let default = Machine::default();
    let rate = |key, default| section.number_or(key, RATE, "", default);
    let blending = section.choice("blending", &BLENDINGS)?;
    let machine = Machine {
        rapid_rate: rate("rapid_rate", default.rapid_rate)?,
        acceleration: rate("acceleration", default.acceleration)?,
        junction_deviation: section.length_or("junction_deviation", default.junction_deviation)?,
        jerk: section.number_or("jerk", JERK, " mm/s3", default.jerk)?,
        block_rate: section.number_or("block_rate", BLOCK_RATE, " lines/s", default.block_rate)?,
        rates: kinematics::rates(section)?.unwrap_or(default.rates),
        accelerations: kinematics::accelerations(section)?.unwrap_or(default.accelerations),
        jerks: kinematics::jerks(section)?.unwrap_or(default.jerks),
        blending,
        slow_corners: section.flag("slow_corners")?.unwrap_or(default.slow_corners),
    };
    Ok((machine, section.length_or("clearance", DEFAULT_CLEARANCE)?))
}

fn read_toolpaths(
    root: &Section<'_>,
    folder: &Path,
    limits: &Limits,
    correct: bool,
    of_scene: &Tooling,
    minutes: &[f64],
) -> Result<Vec<ToolpathRequest>, SceneError> {
    let sections = root.sections("toolpath")?;
    if sections.is_empty() {
        return Err(root.key_error(
            "toolpath",
            "the scene has no toolpath",
            "add a table [[toolpath]] with `strategy = \"zigzag\"`",
        ));
    }
    let mut requests: Vec<ToolpathRequest> = Vec::with_capacity(sections.len());
    let read = |section| {
        let request = read_toolpath(section, folder, limits, correct, of_scene)?;
        let times = compare::at_times(request, section, minutes)?;
        Ok(times.into_iter().map(move |request| (section, request)))
    };
    let all = sections.iter().map(read).collect::<Result<Vec<_>, SceneError>>()?;
    if let Some(first) = sections.first().filter(|section| section.has("stock")) {
        let place = first.key_span("stock");
        return Err(first.error(&place, "no toolpath comes before this one", "delete `stock` here"));
    }
    let all: Vec<(&Section<'_>, ToolpathRequest)> = all.into_iter().flatten().collect();
    check_allowances(&all)?;
    // What it leaves elsewhere is a matter of the toolpath behind it.
    let goes_on =
        |k: usize| all.get(k + 1).is_some_and(|(_, next): &(_, ToolpathRequest)| next.stock_is_previous);
    let goes_on: Vec<bool> = (0..all.len()).map(goes_on).collect();
    for ((section, mut request), goes_on) in all.into_iter().zip(goes_on) {
        if goes_on && request.is_for_places() {
            request.correct = false;
        }
        if let Some(other) = requests.iter().find(|other| other.folder == request.folder) {
            let place = if section.has("name") { section.key_span("name") } else { section.header().clone() };
            let message = if other.name == request.name {
                format!("two toolpaths are called \"{}\"", request.name)
            } else {
                format!(
                    "the toolpaths \"{}\" and \"{}\" would share the folder {}",
                    other.name, request.name, request.folder
                )
            };
            return Err(section.error(
                &place,
                message,
                format!("give this one another name, such as `name = \"{}-2\"`", request.folder),
            ));
        }
        requests.push(request);
    }
    Ok(requests)
}

/// How scenes spell the stock that the toolpath before left.
pub(super) const PREVIOUS_STOCK: &str = "previous";

/// The key of the slopes that a toolpath is made for.
pub(super) const SLOPE: &str = "slope";

/// The key of how far levels lie apart at most.
pub(super) const STEPDOWN: &str = "stepdown";

/// The key of what a toolpath leaves on the part.
pub(super) const ALLOWANCE: &str = "allowance";

/// The key of the curves within which a toolpath stays, and that of what others left.
pub(super) const BOUNDARY: &str = "boundary";
pub(super) const REST: &str = "rest";

/// From level ground to walls, degrees.
pub(super) const ALL_SLOPES: [f64; 2] = [0.0, 90.0];

fn read_toolpath(
    section: &Section<'_>,
    folder: &Path,
    limits: &Limits,
    correct: bool,
    of_scene: &Tooling,
) -> Result<ToolpathRequest, SceneError> {
    let tooling = tooling::read_own(section, of_scene)?;
    let cutter = &tooling.cutter;
    let read = read_strategy(section, cutter.radius())?;
    let kind = read.strategy.definition().part;
    let surface = kind == PartKind::Surface;
    let step = match kind {
        PartKind::Surface => read_step(section, limits, cutter)?,
        PartKind::Pocket => read_pocket_step(section, cutter, limits.scallop)?,
        // A program's steps are its own; cells are laid out as for the scallop that is allowed.
        PartKind::Any => Step::Scallop(limits.scallop),
    };
    let (name, own_folder) = read_name(section, &read.word)?;
    let axis = if surface { axis::read(section)? } else { None };
    let usual = if axis.is_none() { read.strategy.usual_links() } else { Links::Retract };
    let slope = if surface { read_slope(section, axis.is_some())? } else { ALL_SLOPES };
    let joining = if surface { read_joining(section, usual)? } else { Joining::default() };
    let named = |file: Located<String>| NamedFile::beside(folder, &file.value, file.span);
    let directions = read.tables.into_iter().map(named).collect();
    let stock_is_previous = kind != PartKind::Pocket && section.word("stock", &[PREVIOUS_STOCK])?.is_some();
    let correct = if surface { section.flag("correct")?.unwrap_or(correct) } else { false };
    let boundary = if surface { read_boundary(section, axis.is_some())? } else { None };
    let rest = surface && read_rest(section, axis.is_some())?;
    let [stepdown, allowance] =
        if surface { read_roughing(section, axis.is_some(), &*read.strategy)? } else { [None; 2] };
    Ok(ToolpathRequest {
        name,
        folder: own_folder,
        strategy: read.strategy,
        tooling,
        step,
        stepdown,
        allowance: allowance.unwrap_or_default(),
        directions,
        correct,
        joining,
        slope,
        boundary,
        rest,
        axis,
        stock_is_previous,
        equal_time: None,
    })
}

/// The name of a toolpath, by default its strategy's word, and the name of its folder.
fn read_name(section: &Section<'_>, word: &Located<&str>) -> Result<(String, String), SceneError> {
    let (name, span) = match section.text("name")? {
        Some(name) => (name.value.to_owned(), name.span),
        None => (word.value.to_owned(), word.span.clone()),
    };
    let folder = folder_name(&name).ok_or_else(|| {
        section.error(
            &span,
            format!("\"{name}\" cannot name a toolpath"),
            "use up to 64 characters, at least one of them a letter or a digit of the Latin alphabet",
        )
    })?;
    Ok((name, folder))
}

/// The slopes that a toolpath is made for, degrees from the level: all where nothing is said.
fn read_slope(section: &Section<'_>, tilts: bool) -> Result<[f64; 2], SceneError> {
    let slope = section.interval(SLOPE, ALL_SLOPES[0]..=ALL_SLOPES[1], " degrees")?.unwrap_or(ALL_SLOPES);
    if tilts && slope != ALL_SLOPES {
        let cure = "delete one of the two: a tool that leans goes over all that its strategy covers";
        return Err(section.key_error(SLOPE, "`slope` does not apply beside `axis`", cure));
    }
    Ok(slope)
}

/// The curves within which a toolpath stays: those within others are islands.
fn read_boundary(section: &Section<'_>, tilts: bool) -> Result<Option<Arc<Region>>, SceneError> {
    let curves = section.curves(BOUNDARY)?;
    if curves.is_empty() {
        return Ok(None);
    }
    if tilts {
        return Err(beside_axis(section, BOUNDARY));
    }
    let curves = curves.into_iter().map(|curve| curve.value).collect();
    let region = Region::nested(curves).map_err(|error| {
        let cure = format!(
            "write closed curves that neither cross nor touch: `{BOUNDARY} = [[[0, 0], [40, 0], [40, 30]]]`"
        );
        section.key_error(BOUNDARY, format!("`{BOUNDARY}`: {error}"), cure)
    })?;
    Ok(Some(Arc::new(region.0)))
}

/// Whether a toolpath is for what those before it left.
fn read_rest(section: &Section<'_>, tilts: bool) -> Result<bool, SceneError> {
    let rest = section.flag(REST)?.unwrap_or(false);
    if rest && tilts {
        return Err(beside_axis(section, REST));
    }
    if rest && !section.has("stock") {
        let message = format!("`{REST}` in a toolpath that cuts a block of its own");
        let cure =
            format!("add `stock = \"{PREVIOUS_STOCK}\"`: the rest is what the toolpaths before it left");
        return Err(section.key_error(REST, message, cure));
    }
    Ok(rest)
}

fn beside_axis(section: &Section<'_>, key: &str) -> SceneError {
    let message = format!("`{key}` does not apply beside `axis`");
    section.key_error(key, message, "delete one of the two")
}

/// How deep each level of a toolpath goes below the one above, and what it leaves on the part, mm.
fn read_roughing(
    section: &Section<'_>,
    tilts: bool,
    strategy: &dyn Strategy,
) -> Result<[Option<f64>; 2], SceneError> {
    let mut found = [None; 2];
    for (value, key) in found.iter_mut().zip([STEPDOWN, ALLOWANCE]) {
        let least = if key == ALLOWANCE { 0.0 } else { *keys::LENGTH.start() };
        *value = section.number(key, least..=*keys::LENGTH.end(), " mm")?.map(|v| v.value);
        if value.is_some() && tilts {
            return Err(beside_axis(section, key));
        }
    }
    let [stepdown, allowance] = found;
    if stepdown.is_some() && !strategy.is_spaced_in_plan() {
        let message =
            format!("`{STEPDOWN}` does not apply to strategy = \"{}\" as it is here", strategy.word());
        let cure = "rough by `zigzag` or a plain `spiral`: between other passes, held up at a level, stock may stand";
        return Err(section.key_error(STEPDOWN, message, cure));
    }
    // Ridges over what is left on the part are none of the part's.
    if allowance.is_some_and(|allowance| allowance > 0.0) && !section.has("stepover") {
        let message =
            format!("a toolpath with an `{ALLOWANCE}` is planned by a `stepover`, and none is given");
        let cure = "add `stepover`: no scallop height is judged of what another toolpath cuts off";
        return Err(section.key_error(ALLOWANCE, message, cure));
    }
    Ok(found)
}

/// Refuses a toolpath that leaves material on the part for none behind it.
fn check_allowances(toolpaths: &[(&Section<'_>, ToolpathRequest)]) -> Result<(), SceneError> {
    let follows = |k: usize| toolpaths.get(k + 1).is_some_and(|(_, next)| next.stock_is_previous);
    let leaves = |k: &usize| toolpaths[*k].1.allowance > 0.0 && !follows(*k);
    let Some(k) = (0..toolpaths.len()).find(leaves) else { return Ok(()) };
    let (section, request) = &toolpaths[k];
    let message = format!(
        "\"{}\" leaves an allowance on the part, and no toolpath behind it cuts that off",
        request.name
    );
    let cure =
        format!("add a [[toolpath]] with `stock = \"{PREVIOUS_STOCK}\"` behind it, or delete `{ALLOWANCE}`");
    Err(section.key_error(ALLOWANCE, message, cure))
}

/// How passes are smoothed and joined, in the usual way where nothing is said.
fn read_joining(section: &Section<'_>, usual: Links) -> Result<Joining, SceneError> {
    let default = Joining::default();
    let links = match section.word("links", &["surface", "retract"])?.map(|word| word.value) {
        Some("surface") => Links::Surface,
        Some(_) => Links::Retract,
        None => usual,
    };
    let longest_link = section.length_or_word("longest_link", "auto")?;
    if links == Links::Retract && longest_link.is_some() {
        return Err(section.key_error(
            "longest_link",
            "`longest_link` does not apply to links = \"retract\"",
            "delete one of the two",
        ));
    }
    let smoothing = section.flag("smoothing")?.unwrap_or(default.smoothing);
    Ok(Joining { links, longest_link, smoothing })
}

/// Pockets are milled by their own strategies, and nothing else is.
fn check_pocket_strategies(
    root: &Section<'_>,
    part: &PartSource,
    toolpaths: &[ToolpathRequest],
) -> Result<(), SceneError> {
    let (kind, what) = match part {
        PartSource::Pocket { .. } => (PartKind::Pocket, "a pocket"),
        _ => (PartKind::Surface, "anything but a pocket"),
    };
    let strange = |request: &&ToolpathRequest| !request.strategy.definition().part.suits(kind);
    let Some(wrong) = toolpaths.iter().find(strange) else { return Ok(()) };
    let message = format!("strategy = \"{}\" does not mill {what}", wrong.strategy_name());
    let cure = match kind {
        PartKind::Pocket => format!("use one of {}", words_for(kind)),
        _ => format!("use one of {}, or `surface = \"pocket\"` in [part]", words_for(kind)),
    };
    Err(root.key_error("toolpath", message, cure))
}

/// The step of one toolpath: its own stepover or scallop, or else the scene's scallop.
fn read_step(section: &Section<'_>, limits: &Limits, cutter: &Cutter) -> Result<Step, SceneError> {
    match (section.length("stepover")?, section.length("scallop")?) {
        (Some(_), Some(scallop)) => Err(section.error(
            &scallop.span,
            "a toolpath has either `stepover` or `scallop`",
            "delete one of the two",
        )),
        (Some(stepover), None) if stepover.value > 2.0 * cutter.radius() => {
            let message = format!(
                "`stepover` is {} mm, wider than the cutter's diameter of {} mm",
                stepover.value,
                2.0 * cutter.radius()
            );
            Err(section.error(
                &stepover.span,
                message,
                "write a stepover below the diameter, or delete it to step by scallop height",
            ))
        }
        (Some(stepover), None) => Ok(Step::Stepover(stepover.value)),
        (None, Some(scallop)) => Ok(Step::Scallop(scallop.value)),
        (None, None) => Ok(Step::Scallop(limits.scallop)),
    }
}

/// A folder's name for a toolpath's name: lower case, and every run of other characters than
/// letters, digits and `_` becomes one `-`. `None` when nothing is left or it is too long.
pub(super) fn folder_name(name: &str) -> Option<String> {
    /// File systems take 255 bytes a name; tables become unreadable long before.
    const MAX_CHARACTERS: usize = 64;
    let mut folder = String::new();
    for c in name.chars() {
        if c.is_ascii_alphanumeric() || c == '_' {
            folder.push(c.to_ascii_lowercase());
        } else if !folder.is_empty() && !folder.ends_with('-') {
            folder.push('-');
        }
    }
    let folder = folder.trim_end_matches('-').to_owned();
    let printable = name.chars().count() <= MAX_CHARACTERS && !name.chars().any(char::is_control);
    (printable && folder.chars().any(|c| c.is_ascii_alphanumeric())).then_some(folder)
}
