//! One run of a study: its system from parts that were read once, and its row.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use super::setting::{Key, OWN_MODEL};
use super::study::Study;
use super::table::{Cell, Column, Kind, Role};
use crate::commission::rules_on_recordings;
use crate::error::Error;
use crate::fmu::{Causality, Datum};
use crate::library::FmuLibrary;
use crate::master::Outcome;
use crate::metrics;
use crate::run::experiment::{Motions, Prepared, Request, prepare_shared, system_file};
use crate::run::summary::{Table, asked};
use crate::system::tuning::Rules;
use crate::system::{Component, Link, Setting, System, SystemFile};
use crate::units::{STANDARD_GRAVITY, hint};

use super::factor::setting as with_unit;

/// The figures of a run, and their units.
const FIGURES: [(&str, &str); 11] = [
    ("pga_g", "g"),
    ("peak_reference_m", "m"),
    ("time_domain_percent", "%"),
    ("frequency_domain_percent", "%"),
    ("displacement_percent", "%"),
    ("peak_displacement_m", "m"),
    ("peak_displacement_error_m", "m"),
    ("peak_acceleration_m_s2", "m/s2"),
    ("peak_acceleration_error_m_s2", "m/s2"),
    ("correlation", ""),
    ("delay_s", "s"),
];

/// Length of the recordings on which a rig's own controllers are designed, s.
const RECORDED: f64 = 60.0;

/// A row of the results.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The run's name.
    pub run: String,
    /// Its cells, one a column but for those that say which run it is.
    pub cells: Vec<Cell>,
}

/// Carries out a study's runs; what they have in common is read once.
pub struct Bench<'a> {
    study: &'a Study,
    systems: Mutex<HashMap<String, Arc<Assembled>>>,
    motions: Motions,
    /// Rules on the recordings of each rig, by what makes it.
    rigs: Mutex<HashMap<String, Arc<Mutex<Option<Tuned>>>>>,
}

type Tuned = Result<Arc<Rules>, String>;

/// A system whose FMUs are open.
struct Assembled {
    file: SystemFile,
    library: Mutex<FmuLibrary>,
    /// As it is without what the study varies; for the values that are times the system's own.
    system: System,
}

impl<'a> Bench<'a> {
    /// A bench for a study.
    #[must_use]
    pub fn new(study: &'a Study) -> Self {
        Self {
            study,
            systems: Mutex::default(),
            motions: Motions::default(),
            rigs: Mutex::default(),
        }
    }

    /// The columns of its rows, those that say which run it is among them.
    ///
    /// # Errors
    /// As [`Bench::check`].
    pub fn columns(&self) -> Result<Vec<Column>, Error> {
        let column = |name: &str, unit: Option<&str>, role, kind| Column {
            name: name.to_string(),
            unit: unit.filter(|unit| !unit.is_empty()).map(str::to_string),
            role,
            kind,
        };
        let mut columns = vec![
            column("number", None, Role::Run, Kind::Number),
            column("run", None, Role::Run, Kind::Text),
        ];
        let settings = self.study.settings(0);
        let (_, assembled) = self.request(&settings)?;
        for factor in &self.study.factors {
            let (unit, kind) = match &factor.key {
                Key::Variable(name) => match number_unit(&assembled.system, name) {
                    Some(unit) => (Some(unit), Kind::Number),
                    None => (None, Kind::Text),
                },
                key => match key.unit() {
                    Some(unit) => (Some(unit.to_string()), Kind::Number),
                    None => (None, Kind::Text),
                },
            };
            columns.push(column(&factor.name, unit.as_deref(), Role::Factor, kind));
        }
        for (name, unit) in FIGURES {
            columns.push(column(name, Some(unit), Role::Result, Kind::Number));
        }
        for limit in &self.study.limits {
            if let Some(signal) = &limit.signal {
                let unit = output(&assembled.system, signal).and_then(|(component, position)| {
                    component.fmu.description.variables[position].unit.clone()
                });
                columns.push(column(
                    &limit.column,
                    unit.as_deref(),
                    Role::Result,
                    Kind::Number,
                ));
            }
        }
        columns.push(column("ended", None, Role::Ending, Kind::Text));
        columns.push(column("ended_s", Some("s"), Role::Ending, Kind::Number));
        columns.push(column("reason", None, Role::Ending, Kind::Text));
        Ok(columns)
    }

    /// Finds what is wrong before the first run: every combination of components is assembled, with
    /// every value of a list, and every motion is read.
    ///
    /// # Errors
    /// Names that no system has, values that do not fit, files at fault.
    pub fn check(&self) -> Result<(), Error> {
        let fault = |reason: String| self.study.fault(&reason);
        let base = self.study.settings(0);
        let mut tried: Vec<Vec<Setting>> = vec![base.clone()];
        // All combinations of what chooses components, and then each value of the others alone.
        for (place, factor) in self.study.factors.iter().enumerate() {
            let super::factor::Values::List(list) = &factor.values else {
                continue;
            };
            let others = match factor.key.is_structural() {
                true => tried.clone(),
                false => vec![base.clone()],
            };
            for other in others {
                for value in list.iter().skip(usize::from(base[place] == list[0])) {
                    let mut settings = other.clone();
                    settings[place] = value.clone();
                    tried.push(settings);
                }
            }
        }
        // The ends of what is drawn.
        for (place, factor) in self.study.factors.iter().enumerate() {
            if factor.values.count().is_none() {
                for end in [0.0, 1.0 - f64::EPSILON] {
                    let mut settings = base.clone();
                    settings[place] = factor.values.value(end);
                    tried.push(settings);
                }
            }
        }
        for settings in &tried {
            let prepared = self.prepare(settings).map_err(|error| {
                let all = self.study.factors.iter().zip(settings);
                let all: Vec<String> = all
                    .map(|(factor, value)| format!("{} = {value}", factor.name))
                    .collect();
                fault(format!("a run with {}: {error}", all.join(", ")))
            })?;
            for limit in &self.study.limits {
                self.limit(&prepared.system, limit).map_err(fault)?;
            }
        }
        let columns = self.columns()?;
        let known = |name: &str| match columns.iter().find(|column| column.name == name) {
            Some(column) if column.kind == Kind::Number => Ok(()),
            Some(_) => Err(format!("`{name}` is no number")),
            None => {
                let known = columns.iter().map(|column| column.name.as_str());
                Err(format!("`{name}` is no column{}", hint(name, known)))
            }
        };
        known(&self.study.intensity)
            .map_err(|reason| fault(format!("[study] intensity: {reason}")))?;
        for name in &self.study.results {
            known(name).map_err(|reason| fault(format!("[study] results: {reason}")))?;
        }
        for limit in self
            .study
            .limits
            .iter()
            .filter(|limit| limit.signal.is_none())
        {
            known(&limit.column).map_err(|reason| fault(format!("[limits] {reason}")))?;
        }
        Ok(())
    }

    /// The value of a limit in the unit of its column.
    ///
    /// # Errors
    /// A signal that the system has not, a unit that does not fit.
    pub fn limit(&self, system: &System, limit: &super::study::Limit) -> Result<f64, String> {
        let unit = match &limit.signal {
            Some(signal) => {
                let (component, position) = output(system, signal).ok_or_else(|| {
                    let known: Vec<String> = outputs(system).collect();
                    let hint = hint(signal, known.iter().map(String::as_str));
                    format!("[limits] `{signal}` is no output of {}{hint}", system.name)
                })?;
                component.fmu.description.variables[position]
                    .unit
                    .clone()
                    .unwrap_or_default()
            }
            None => FIGURES
                .iter()
                .find(|(name, _)| *name == limit.column)
                .map_or(String::new(), |(_, unit)| (*unit).to_string()),
        };
        let named = |reason: String| format!("[limits] {}: {reason}", limit.column);
        let value = match &limit.written {
            Setting::Integer(number) => *number as f64,
            Setting::Number(number) => *number,
            Setting::Text(text) if unit == "%" => {
                let number = text.trim().trim_end_matches('%').trim().parse();
                number.map_err(|_| named(format!("`{text}` is no number in %")))?
            }
            Setting::Text(text) => {
                crate::units::value_in(text, &unit).map_err(|error| named(error.to_string()))?
            }
            other => return Err(named(format!("`{other}` is no number"))),
        };
        if limit.signal.is_some() && !unit.is_empty() && !matches!(limit.written, Setting::Text(_))
        {
            return Err(named(format!(
                "`{}` has no unit; expected such as \"1 {unit}\"",
                limit.written
            )));
        }
        Ok(value)
    }

    /// Limits by their column, in the column's unit.
    ///
    /// # Errors
    /// As [`Bench::check`].
    pub fn limits(&self) -> Result<Vec<(String, f64)>, Error> {
        let (_, assembled) = self.request(&self.study.settings(0))?;
        let limits = self.study.limits.iter().map(|limit| {
            let value = self.limit(&assembled.system, limit);
            let value = value.map_err(|reason| self.study.fault(&reason))?;
            Ok((limit.column.clone(), value))
        });
        limits.collect()
    }

    /// The command that repeats a run.
    #[must_use]
    pub fn command(&self, number: u64) -> String {
        match self.request(&self.study.settings(number)) {
            Ok((request, _)) => command(&request),
            Err(error) => error.to_string(),
        }
    }

    /// Carries a run out; one that fails is a row too.
    #[must_use]
    pub fn run(&self, number: u64) -> Row {
        let settings = self.study.settings(number);
        let done = catch_unwind(AssertUnwindSafe(|| self.outcome(&settings)));
        let factors = self.factors(&settings);
        let mut cells = factors.unwrap_or_else(|_| vec![Cell::Missing; settings.len()]);
        let signals = self
            .study
            .limits
            .iter()
            .filter(|limit| limit.signal.is_some());
        let figures = FIGURES.len() + signals.count();
        let failed = |reason: String| {
            let mut cells = vec![Cell::Missing; figures];
            cells.extend(["failed".into(), Cell::Missing, reason.into()]);
            cells
        };
        cells.extend(match done {
            Ok(Ok(cells)) => cells,
            Ok(Err(error)) => failed(error.to_string()),
            Err(_) => failed("the run panicked; what it printed says where".to_string()),
        });
        Row {
            run: self.study.name(&settings),
            cells,
        }
    }

    /// The cells of a run behind its factors.
    fn outcome(&self, settings: &[Setting]) -> Result<Vec<Cell>, Error> {
        let prepared = self.prepare(settings)?;
        let outcome = prepared.run(prepared.algorithm)?;
        let mut cells = Vec::new();
        cells.extend(figures(&prepared, &outcome));
        for signal in self
            .study
            .limits
            .iter()
            .filter_map(|limit| limit.signal.as_ref())
        {
            let history = outcome.record.column(signal);
            let peak =
                history.map(|history| history.iter().fold(0.0, |most: f64, x| most.max(x.abs())));
            cells.push(peak.into());
        }
        cells.push(outcome.ended.kind().word().into());
        cells.push(outcome.ended.time().into());
        cells.push(outcome.ended.reason().map_or(Cell::Missing, Cell::from));
        Ok(cells)
    }

    fn prepare(&self, settings: &[Setting]) -> Result<Prepared, Error> {
        let (request, assembled) = self.request(settings)?;
        prepare_shared(&request, &assembled.file, &assembled.library, &self.motions)
    }

    /// The request of a run, with its system.
    fn request(&self, settings: &[Setting]) -> Result<(Request, Arc<Assembled>), Error> {
        let folder = self.study.folder();
        let mut request = Request::built_in(crate::system::built_in::DEFAULT_SYSTEM);
        let mut own = false;
        let fixed = self
            .study
            .fixed
            .iter()
            .map(|(name, key, value)| (name, key, value));
        let varied = self.study.factors.iter().zip(settings);
        let mut times: Vec<(&str, &Setting)> = Vec::new();
        let mut set = Vec::new();
        for (name, key, value) in fixed.chain(
            varied
                .clone()
                .map(|(factor, value)| (&factor.name, &factor.key, value)),
        ) {
            let is_relative = self
                .study
                .factors
                .iter()
                .any(|f| f.name == *name && f.values.is_relative());
            if is_relative {
                times.push((name, value));
                continue;
            }
            if let Key::Variable(_) = key {
                set.push((key, value));
                continue;
            }
            own |= *key == Key::ControlModel && value.to_string() == OWN_MODEL;
            key.apply(value, &folder, &mut request)
                .map_err(|reason| self.study.fault(&format!("`{name}`: {reason}")))?;
        }
        let plain = self.assembled(&request, None)?;
        for (key, value) in set {
            key.apply(value, &folder, &mut request)
                .map_err(|reason| self.study.fault(&reason))?;
        }
        for (name, value) in times {
            let nominal =
                nominal(&plain.system, name).map_err(|reason| self.study.fault(&reason))?;
            let factor = match value {
                Setting::Number(factor) => *factor,
                _ => 1.0,
            };
            let (nominal, unit) = nominal;
            request
                .set
                .push(format!("{name}={}", with_unit(factor * nominal, &unit)));
        }
        if !own {
            return Ok((request, plain));
        }
        let rules = self.own_rules(&request)?;
        Ok((request.clone(), self.assembled(&request, Some(&rules))?))
    }

    /// The system of a request without what is set, from those that are open; one with rules of its own
    /// is not kept.
    fn assembled(&self, request: &Request, rules: Option<&Rules>) -> Result<Arc<Assembled>, Error> {
        let Request {
            system,
            plant,
            specimen,
            structure,
            tuning,
            control_model,
            fmi,
            ..
        } = request;
        let key = format!(
            "{system:?} {plant:?} {specimen:?} {structure:?} {tuning:?} {control_model:?} {fmi:?}"
        );
        if rules.is_none() {
            let systems = self.systems.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(found) = systems.get(&key) {
                return Ok(found.clone());
            }
        }
        let file = system_file(request, rules)?;
        let mut library = FmuLibrary::of(*fmi, &file);
        let system = crate::system::assemble(&file, &[], &mut |name| library.find(name))?;
        let found = Arc::new(Assembled {
            file,
            library: Mutex::new(library),
            system,
        });
        if rules.is_none() {
            let mut systems = self.systems.lock().unwrap_or_else(PoisonError::into_inner);
            return Ok(systems.entry(key).or_insert(found).clone());
        }
        Ok(found)
    }

    /// The rules on the recordings of the rig that a request has, which is recorded once.
    fn own_rules(&self, request: &Request) -> Result<Arc<Rules>, Error> {
        let rig: Vec<&String> = request
            .set
            .iter()
            .filter(|set| !set.starts_with("control.") && !set.starts_with("specimen."))
            .collect();
        let key = format!("{} {rig:?}", request.plant);
        let place = {
            let mut rigs = self.rigs.lock().unwrap_or_else(PoisonError::into_inner);
            rigs.entry(key).or_default().clone()
        };
        let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
        let set = rig.into_iter().cloned().collect();
        let found = place.get_or_insert_with(|| {
            rules_on_recordings(&request.plant, set, RECORDED, request.seed).map(Arc::new)
        });
        found.clone().map_err(|reason| Error::Option {
            option: "control_model = \"own\"",
            reason,
        })
    }

    /// The factors of a run as they stand in its row.
    fn factors(&self, settings: &[Setting]) -> Result<Vec<Cell>, Error> {
        let (request, assembled) = self.request(settings)?;
        let cells = self
            .study
            .factors
            .iter()
            .zip(settings)
            .map(|(factor, value)| {
                let Key::Variable(name) = &factor.key else {
                    return written(&factor.key, value);
                };
                let Some(unit) = number_unit(&assembled.system, name) else {
                    return value.to_string().into();
                };
                // The last one counts, as it does when it is set.
                let set = request.set.iter().rev();
                let mut own =
                    set.filter_map(|set| set.strip_prefix(name.as_str())?.strip_prefix('='));
                let text = own.next().unwrap_or_default();
                crate::units::value_in(text, &unit).ok().into()
            });
        Ok(cells.collect())
    }
}

/// The unit of a variable that is a number, empty where it has none; none for other variables.
fn number_unit(system: &System, name: &str) -> Option<String> {
    let (component, position) = variable(system, name)?;
    let variable = &component.fmu.description.variables[position];
    let is_number = variable.kind.is_numeric()
        && !matches!(
            variable.kind,
            crate::fmu::Kind::Enumeration(_) | crate::fmu::Kind::Boolean
        );
    is_number.then(|| variable.unit.clone().unwrap_or_default())
}

/// The value of a factor that is no variable, as it stands in the table.
fn written(key: &Key, value: &Setting) -> Cell {
    match (key.unit(), key.number(value)) {
        (Some(_), Ok(number)) => number.into(),
        _ => value.to_string().into(),
    }
}

/// The figures of a run in the order of [`FIGURES`].
fn figures(prepared: &Prepared, outcome: &Outcome) -> [Cell; FIGURES.len()] {
    let motion = &prepared.motion;
    let mut cells = [const { Cell::Missing }; FIGURES.len()];
    if motion.is_empty() {
        return cells;
    }
    let wanted = asked(&outcome.record, motion);
    let wanted = wanted.as_ref().unwrap_or(motion);
    cells[0] = (motion.peak_acceleration() / STANDARD_GRAVITY).into();
    cells[1] = motion.peak_displacement().into();
    let names = prepared
        .system
        .components
        .iter()
        .map(|own| own.name.as_str());
    let links: Vec<Link> = prepared.system.links().collect();
    let Some(table) = Table::among(names, &links, &outcome.record) else {
        return cells;
    };
    let column = |name: &str| outcome.record.column(&table.name(name));
    let (Some(x), Some(a)) = (column("displacement"), column("acceleration")) else {
        return cells;
    };
    let Ok(own) = metrics::errors(wanted, &x, &a) else {
        return cells;
    };
    let numbers = [
        own.time_domain_percent,
        own.frequency_domain_percent,
        own.displacement_percent,
        own.peak_displacement,
        own.peak_displacement_error,
        own.peak_acceleration,
        own.peak_acceleration_error,
        own.correlation,
        own.delay,
    ];
    for (cell, number) in cells[2..].iter_mut().zip(numbers) {
        *cell = number.into();
    }
    cells
}

/// Component and position of a variable called `instance.variable`.
fn variable<'a>(system: &'a System, name: &str) -> Option<(&'a Component, usize)> {
    system.components.iter().find_map(|component| {
        let variable = name.strip_prefix(&component.name)?.strip_prefix('.')?;
        Some((component, component.fmu.description.position(variable)?))
    })
}

/// As [`variable`], of an output.
fn output<'a>(system: &'a System, name: &str) -> Option<(&'a Component, usize)> {
    variable(system, name).filter(|(component, position)| {
        component.fmu.description.variables[*position].causality == Causality::Output
    })
}

fn outputs(system: &System) -> impl Iterator<Item = String> {
    system.components.iter().flat_map(|component| {
        let description = &component.fmu.description;
        description.of(Causality::Output).map(|position| {
            format!(
                "{}.{}",
                component.name, description.variables[position].name
            )
        })
    })
}

/// What a variable is when the study does not vary it, and its unit.
fn nominal(system: &System, name: &str) -> Result<(f64, String), String> {
    let (component, position) = variable(system, name).ok_or_else(|| {
        let known = system.components.iter().flat_map(|component| {
            let variables = component.fmu.description.variables.iter();
            variables.map(|variable| format!("{}.{}", component.name, variable.name))
        });
        let known: Vec<String> = known.collect();
        format!(
            "`{name}` is no variable of {}{}",
            system.name,
            hint(name, known.iter().map(String::as_str))
        )
    })?;
    let variable = &component.fmu.description.variables[position];
    match component.start_value(&component.given(), position) {
        Datum::Number(number) if number != 0.0 => {
            Ok((number, variable.unit.clone().unwrap_or_default()))
        }
        Datum::Number(_) => Err(format!(
            "`{name}` is 0 in {}: times that is 0 always; expected a distribution that is not relative",
            system.name
        )),
        _ => Err(format!("`{name}` is no number; `relative` needs one")),
    }
}

/// The command that carries a request out.
fn command(request: &Request) -> String {
    use crate::run::experiment::{Scale, is_file};
    let mut words = vec!["shakebench run".to_string(), quoted(&request.system)];
    let mut option = |name: &str, value: String| words.push(format!("--{name} {}", quoted(&value)));
    let path = |path: &Path| path.display().to_string();
    if !is_file(&request.system) {
        option("plant", request.plant.clone());
        option("specimen", request.specimen.clone());
        if let Some(structure) = &request.structure {
            option("structure", structure.clone());
        }
        if let Some(tuning) = request
            .tuning
            .and_then(|tuning| clap::ValueEnum::to_possible_value(&tuning))
        {
            option("tuning", tuning.get_name().to_string());
        }
        if let Some(model) = &request.control_model {
            option("control-model", path(model));
        }
    }
    match (&request.record, &request.reference) {
        (_, Some(reference)) => option("reference", path(reference)),
        (Some(record), None) => option("record", path(record)),
        (None, None) => option("seed", request.seed.to_string()),
    }
    match request.scaling {
        Some(Scale::Factor(factor)) => option("scale", format!("{factor:?}")),
        Some(Scale::PeakAcceleration(peak)) => option("pga", format!("{:?} m/s2", peak)),
        Some(Scale::PeakDisplacement(peak)) => option("peak", format!("{peak:?} m")),
        None => {}
    }
    if request.fmi == crate::fmu::FmiVersion::V2 {
        option("fmi", "2".to_string());
    }
    if let Some(algorithm) = request.algorithm {
        option("algorithm", algorithm.to_string());
    }
    if let Some(step) = request.step_s {
        option("step", format!("{step:?} s"));
    }
    if let Some(duration) = request.duration_s {
        option("duration", format!("{duration:?} s"));
    }
    for set in &request.set {
        option("set", set.clone());
    }
    words.join(" ")
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_string(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}
