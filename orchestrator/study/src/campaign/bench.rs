//! One run of a study: its system from parts that were read once, and its row.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use super::command::{command, quoted};
use super::factor::Values;
use super::journal::Head;
use super::row::{
    FIGURES, VariableError, figures, nominal, number_unit, output, outputs, times, written,
};
use super::runs::Runs;
use super::setting::{Key, OWN_MODEL};
use super::study::{Limit, Study};
use super::table::{Cell, Column, INVALID, Kind, Role, Row};
use fmi_import::Held;
use fmi_master::Ending;
use fmi_system::{Setting, System, SystemFile, assemble};
use laboratory::commission::rules_on_recordings;
use laboratory::error::Error;
use laboratory::run::experiment::{Motions, Prepared, Request, prepare_shared, system_file};
use laboratory::systems::tuning::Rules;
use pack::Installation;
use pack::library::FmuLibrary;
use units::{hint, value_in};

/// Length of the recordings on which a rig's own controllers are designed, s.
const RECORDED: f64 = 60.0;

/// Rigs whose rules are kept: runs on one rig follow each other.
const MOST_RIGS: usize = 32;

/// Carries out a study's runs; what they have in common is read once.
pub struct Bench<'a> {
    study: &'a Study,
    installation: Installation,
    systems: Mutex<HashMap<String, Arc<Assembled>>>,
    /// FMUs of the built-in systems, by version.
    libraries: Mutex<HashMap<String, Arc<Mutex<FmuLibrary>>>>,
    motions: Motions,
    /// Rules on the recordings of each rig, by what makes it.
    rigs: Mutex<HashMap<String, Arc<Mutex<Option<Tuned>>>>>,
}

type Tuned = Result<Arc<Rules>, String>;

/// A system whose FMUs are open.
struct Assembled {
    /// Its components' libraries, loaded once for all runs. They go before the folders in which they lie.
    _held: Vec<Held>,
    file: SystemFile,
    library: Arc<Mutex<FmuLibrary>>,
    /// As it is without what the study varies.
    system: System,
}

impl<'a> Bench<'a> {
    /// A bench for a study.
    #[must_use]
    pub fn new(study: &'a Study, installation: &Installation) -> Self {
        Self {
            study,
            installation: installation.clone(),
            systems: Mutex::default(),
            libraries: Mutex::default(),
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
        let (_, assembled, _) = self.request(&settings)?;
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

    /// The value of a limit in the unit of its column.
    ///
    /// # Errors
    /// A signal that the system has not, a unit that does not fit.
    pub fn limit(&self, system: &System, limit: &Limit) -> Result<f64, Error> {
        let unit = match &limit.signal {
            Some(signal) => {
                let (component, position) = output(system, signal).ok_or_else(|| {
                    let known: Vec<String> = outputs(system).collect();
                    let hint = hint(signal, known.iter().map(String::as_str));
                    self.study.fault(&format!(
                        "[limits] `{signal}` is not an output of {}{hint}",
                        system.name
                    ))
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
        let named = |reason: String| {
            let reason = format!("[limits] {}: {reason}", limit.column);
            self.study.fault(&reason)
        };
        let value = match &limit.written {
            Setting::Integer(number) => *number as f64,
            Setting::Number(number) => *number,
            Setting::Text(text) if unit == "%" => {
                let number = text.trim().trim_end_matches('%').trim().parse();
                number.map_err(|_| named(format!("`{text}` is not a number in %")))?
            }
            Setting::Text(text) => {
                value_in(text, &unit).map_err(|error| named(error.to_string()))?
            }
            other => return Err(named(format!("`{other}` is not a number"))),
        };
        if limit.signal.is_some() && !unit.is_empty() && !matches!(limit.written, Setting::Text(_))
        {
            return Err(named(format!(
                "`{}` has no unit; expected for example \"1 {unit}\"",
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
        let (_, assembled, _) = self.request(&self.study.settings(0))?;
        let limits = self.study.limits.iter().map(|limit| {
            let value = self.limit(&assembled.system, limit)?;
            Ok((limit.column.clone(), value))
        });
        limits.collect()
    }

    /// The command that repeats a run.
    #[must_use]
    pub fn command(&self, number: u64) -> String {
        match self.request(&self.study.settings(number)) {
            // A run has no controllers that are designed on the rig's own recordings.
            Ok((.., true)) => format!(
                "shakebench campaign {} --rows {number}-{}",
                quoted(&self.study.path.display().to_string()),
                number + 1
            ),
            Ok((request, ..)) => command(&request),
            Err(error) => error.to_string(),
        }
    }

    /// Carries a run out; one that fails, or cannot begin, is a row too. `also` are parameters besides the
    /// study's own, as `--set` takes them.
    #[must_use]
    pub fn run_with(&self, number: u64, also: &[String]) -> Row {
        let settings = self.study.settings(number);
        let done = catch_unwind(AssertUnwindSafe(|| self.outcome(&settings, also)));
        let factors = self.factors(&settings);
        let mut cells = factors.unwrap_or_else(|_| vec![Cell::Missing; settings.len()]);
        let signals = self
            .study
            .limits
            .iter()
            .filter(|limit| limit.signal.is_some());
        let figures = FIGURES.len() + signals.count();
        let without_figures = |ended: &str, reason: String| {
            let mut cells = vec![Cell::Missing; figures];
            cells.extend([ended.into(), Cell::Missing, reason.into()]);
            cells
        };
        cells.extend(match done {
            Ok(Ok(cells)) => cells,
            Ok(Err(error)) => without_figures(INVALID, error.to_string()),
            Err(_) => {
                let reason = "the run panicked; its output shows where".to_string();
                without_figures(Ending::Failed.word(), reason)
            }
        });
        Row {
            run: self.study.name(&settings),
            cells,
        }
    }

    /// The cells of a run behind its factors.
    fn outcome(&self, settings: &[Setting], also: &[String]) -> Result<Vec<Cell>, Error> {
        let prepared = self.prepare(settings, also)?;
        let outcome = prepared.run(prepared.algorithm)?;
        let mut cells = figures(&prepared, &outcome).to_vec();
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

    fn prepare(&self, settings: &[Setting], also: &[String]) -> Result<Prepared, Error> {
        let (mut request, assembled, is_own) = self.request(settings)?;
        request.set.extend_from_slice(also);
        let own = match is_own {
            true => Some(system_file(&request, Some(&*self.own_rules(&request)?))?),
            false => None,
        };
        let file = own.as_ref().unwrap_or(&assembled.file);
        prepare_shared(&request, file, &assembled.library, &self.motions)
    }

    /// The request of a run and the system that it names.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn request_of(&self, number: u64) -> Result<(Request, SystemFile), Error> {
        let (request, assembled, _) = self.request(&self.study.settings(number))?;
        Ok((request, assembled.file.clone()))
    }

    /// The value of a variable that the study does not touch, and its unit.
    ///
    /// # Errors
    /// A variable that its systems have not, or one that is not a number.
    pub fn nominal(&self, name: &str) -> Result<(f64, String), VariableError> {
        let (_, assembled, _) = self.request(&self.study.settings(0))?;
        nominal(&assembled.system, name)
    }

    /// The request of a run, with its system as it is without what is set, and whether its controllers are
    /// designed on the rig's own recordings.
    fn request(&self, settings: &[Setting]) -> Result<(Request, Arc<Assembled>, bool), Error> {
        let fault = |reason: String| self.study.fault(&reason);
        let folder = self.study.folder();
        let mut request = Request {
            installation: self.installation.clone(),
            ..Request::built_in(laboratory::systems::built_in::DEFAULT_SYSTEM)
        };
        let mut is_own = false;
        let mut variables = Vec::new();
        for (name, key, value, is_relative) in self.study.all_values(settings) {
            if key.variables().is_empty() {
                is_own |= *key == Key::ControlModel && value.to_string() == OWN_MODEL;
                key.apply(value, &folder, &mut request)
                    .map_err(|reason| fault(format!("`{name}`: {reason}")))?;
            } else {
                variables.push((key, value, is_relative));
            }
        }
        let assembled = self.assembled(&request)?;
        for (key, value, is_relative) in variables {
            for name in key.variables() {
                let set = match is_relative {
                    true => times(&assembled.system, name, value)
                        .map_err(|error| fault(error.to_string()))?,
                    false => value.to_string(),
                };
                request.set.push(format!("{name}={set}"));
            }
        }
        Ok((request, assembled, is_own))
    }

    /// The system of a request without what is set, from those that are open.
    fn assembled(&self, request: &Request) -> Result<Arc<Assembled>, Error> {
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
        let open = || self.systems.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = open().get(&key) {
            return Ok(found.clone());
        }
        let file = system_file(request, None)?;
        let library = || {
            Arc::new(Mutex::new(
                FmuLibrary::of(*fmi, &file).from(&self.installation),
            ))
        };
        let library = match file.directory.is_none() && file.package.is_none() {
            // Built-in systems have most of their components in common.
            true => {
                let libraries = self.libraries.lock();
                let mut libraries = libraries.unwrap_or_else(PoisonError::into_inner);
                libraries
                    .entry(fmi.to_string())
                    .or_insert_with(library)
                    .clone()
            }
            false => library(),
        };
        let system = {
            let mut library = library.lock().unwrap_or_else(PoisonError::into_inner);
            assemble(&file, &[], &mut *library)?
        };
        let components = system.components.iter();
        let held = components
            .filter_map(|component| component.fmu.hold())
            .collect();
        let found = Arc::new(Assembled {
            file,
            library,
            system,
            _held: held,
        });
        Ok(open().entry(key).or_insert(found).clone())
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
            if rigs.len() >= MOST_RIGS {
                rigs.clear();
            }
            rigs.entry(key).or_default().clone()
        };
        let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
        let set = rig.into_iter().cloned().collect();
        let found = place.get_or_insert_with(|| {
            let rules = rules_on_recordings(
                &request.plant,
                set,
                RECORDED,
                self.study.seed,
                &self.installation,
            );
            rules.map(Arc::new).map_err(|error| error.to_string())
        });
        found.clone().map_err(|reason| Error::Option {
            option: "control_model = \"own\"",
            reason,
        })
    }

    /// The factors of a run as in its row.
    fn factors(&self, settings: &[Setting]) -> Result<Vec<Cell>, Error> {
        let (request, assembled, _) = self.request(settings)?;
        let varied = self.study.factors.iter().zip(settings);
        let cells = varied.map(|(factor, value)| {
            let Key::Variable(name) = &factor.key else {
                return written(&factor.key, value);
            };
            let Some(unit) = number_unit(&assembled.system, name) else {
                return value.to_string().into();
            };
            // The last one counts, as it does when it is set.
            let set = request.set.iter().rev();
            let mut own = set.filter_map(|set| set.strip_prefix(name.as_str())?.strip_prefix('='));
            let text = own.next().unwrap_or_default();
            value_in(text, &unit).ok().into()
        });
        Ok(cells.collect())
    }
}

impl Runs for Bench<'_> {
    /// Finds what is wrong before the first run: every combination of components is assembled and
    /// initialised, with every value of a list and both ends of what is drawn, and every motion is read.
    ///
    /// # Errors
    /// Names that no system has, values that do not fit, files at fault.
    fn check(&self) -> Result<(), Error> {
        let fault = |reason: String| self.study.fault(&reason);
        let base = self.study.settings(0);
        let mut tried: Vec<Vec<Setting>> = vec![base.clone()];
        // All combinations of what chooses components, and then each value of the others alone.
        for (place, factor) in self.study.factors.iter().enumerate() {
            let Values::List(list) = &factor.values else {
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
            let prepared = self.request(settings).and_then(|(request, assembled, _)| {
                let (file, library) = (&assembled.file, &assembled.library);
                let prepared = prepare_shared(&request, file, library, &self.motions)?;
                // Components check their parameters when they are initialised.
                prepared.simulation(prepared.algorithm)?;
                Ok(prepared)
            });
            let prepared = prepared.map_err(|error| {
                let all = self.study.factors.iter().zip(settings);
                let all: Vec<String> = all
                    .map(|(factor, value)| format!("{} = {value}", factor.name))
                    .collect();
                fault(format!("a run with {}: {error}", all.join(", ")))
            })?;
            for limit in &self.study.limits {
                self.limit(&prepared.system, limit)?;
            }
        }
        let columns = self.columns()?;
        let known = |name: &str| match columns.iter().find(|column| column.name == name) {
            Some(column) if column.kind == Kind::Number => Ok(()),
            Some(_) => Err(format!("`{name}` is not a number")),
            None => {
                let known = columns.iter().map(|column| column.name.as_str());
                Err(format!("`{name}` is not a column{}", hint(name, known)))
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

    fn head(&self) -> Result<Head, Error> {
        Head::new(self.columns()?, &self.installation)
    }

    fn count(&self) -> u64 {
        self.study.runs()
    }

    fn name(&self, number: u64) -> String {
        self.study.name(&self.study.settings(number))
    }

    fn run(&self, number: u64) -> Row {
        self.run_with(number, &[])
    }
}

#[cfg(test)]
/// A system file in `folder` with a component whose FMU has no library, and a study of it.
pub(crate) fn made_study(folder: &std::path::Path, text: &str) -> Study {
    let description = r#"<fmiModelDescription fmiVersion="3.0" modelName="Own" instantiationToken="1">
        <CoSimulation modelIdentifier="Own"/>
        <UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit><Unit name="V/m"><BaseUnit kg="1" m="1" s="-3" A="-1"/></Unit></UnitDefinitions>
        <ModelVariables>
        <Float64 name="y" valueReference="1" causality="output" unit="m"/>
        <Float64 name="gain" valueReference="2" causality="parameter" variability="fixed" start="4" unit="V/m"/>
        <Float64 name="share" valueReference="3" causality="parameter" variability="fixed" start="0"/>
        <String name="word" valueReference="4" causality="parameter" variability="fixed"><Start value="a"/></String>
        </ModelVariables><ModelStructure><Output valueReference="1"/></ModelStructure></fmiModelDescription>"#;
    let entries = [(
        "modelDescription.xml".to_string(),
        description.as_bytes().to_vec(),
    )];
    pack::write_archive(&folder.join("own.fmu"), &entries.into(), None).unwrap();
    let file = "name = \"own\"\n[components.own]\nfmu = \"own.fmu\"\n";
    std::fs::write(folder.join("own.toml"), file).unwrap();
    Study::parse(&folder.join("study.toml"), text.to_string()).unwrap()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STUDY: &str = r#"
[study]
runs = 4
cross = ["own.gain"]
[fixed]
system = "own.toml"
seed = 3
[factors]
"own.gain" = ["1 V/m", "0.002 V/mm"]
scale = { uniform = [0.5, 1.5] }
[limits]
"own.y" = "2 mm"
time_domain_percent = "5 %"
"#;

    fn numbers(cells: &[Cell]) -> Vec<Option<f64>> {
        cells.iter().map(Cell::number).collect()
    }

    #[test]
    fn columns_and_limits_have_the_units_of_their_variables() {
        let folder = tempfile::tempdir().unwrap();
        let own = made_study(folder.path(), STUDY);
        let bench = Bench::new(&own, &Installation::default());
        let columns = bench.columns().unwrap();
        let shown = |column: &Column| {
            let unit = column.unit.as_deref().unwrap_or("-");
            format!(
                "{} [{unit}] {:?} {:?}",
                column.name, column.role, column.kind
            )
        };
        let all: Vec<String> = columns.iter().map(shown).collect();
        assert_eq!(
            all[..5],
            [
                "number [-] Run Number",
                "run [-] Run Text",
                "own.gain [V/m] Factor Number",
                "scale [-] Factor Number",
                "pga_g [g] Result Number",
            ]
        );
        assert_eq!(
            all[all.len() - 4..],
            [
                "peak.own.y [m] Result Number",
                "ended [-] Ending Text",
                "ended_s [s] Ending Number",
                "reason [-] Ending Text",
            ]
        );
        assert_eq!(
            bench.limits().unwrap(),
            [
                ("peak.own.y".to_string(), 0.002),
                ("time_domain_percent".to_string(), 5.0)
            ]
        );
        let told = |limits: &str| {
            let own = made_study(
                folder.path(),
                &STUDY.replace("\"own.y\" = \"2 mm\"", limits),
            );
            let bench = Bench::new(&own, &Installation::default());
            bench.limits().unwrap_err().to_string()
        };
        for (limits, expected) in [
            (
                "\"own.x\" = \"2 mm\"",
                "[limits] `own.x` is not an output of own",
            ),
            (
                "\"own.y\" = 2",
                "[limits] peak.own.y: `2` has no unit; expected for example \"1 m\"",
            ),
            ("\"own.y\" = \"2 V\"", "[limits] peak.own.y: "),
            (
                "\"own.y\" = true",
                "[limits] peak.own.y: `true` is not a number",
            ),
            ("pga_g = \"a %\"", "[limits] pga_g"),
        ] {
            let told = told(limits);
            assert!(told.contains(expected), "{limits}: {told}");
        }
    }

    #[test]
    fn a_variable_has_its_value_and_unit_without_the_study() {
        let folder = tempfile::tempdir().unwrap();
        let own = made_study(folder.path(), STUDY);
        let bench = Bench::new(&own, &Installation::default());
        assert_eq!(bench.nominal("own.gain").unwrap(), (4.0, "V/m".to_string()));
        assert_eq!(bench.nominal("own.share").unwrap(), (0.0, String::new()));
        let told = |name: &str| bench.nominal(name).unwrap_err().to_string();
        assert!(
            told("own.gian").starts_with("`own.gian` is not a variable of own"),
            "{}",
            told("own.gian")
        );
        assert!(
            told("own.gian").contains("own.gain"),
            "{}",
            told("own.gian")
        );
        assert_eq!(told("own.word"), "`own.word` is not a number");
        let (_, assembled, _) = bench.request(&own.settings(0)).unwrap();
        let system = &assembled.system;
        assert_eq!(number_unit(system, "own.gain").as_deref(), Some("V/m"));
        assert_eq!(number_unit(system, "own.share").as_deref(), Some(""));
        assert_eq!(
            (
                number_unit(system, "own.word"),
                number_unit(system, "own.x")
            ),
            (None, None)
        );
        assert_eq!(outputs(system).collect::<Vec<_>>(), ["own.y"]);
        assert!(output(system, "own.y").is_some() && output(system, "own.gain").is_none());
        let factor = |factor| times(system, "own.gain", &factor).map_err(|error| error.to_string());
        assert_eq!(factor(Setting::Number(1.5)), Ok("6.0 V/m".to_string()));
        assert_eq!(
            factor(Setting::Text("a".into())),
            Err("`a` is not a factor of `own.gain`".into())
        );
        let zero = times(system, "own.share", &Setting::Number(2.0))
            .unwrap_err()
            .to_string();
        assert!(zero.contains("`own.share` is 0 in own"), "{zero}");
    }

    #[test]
    fn a_run_that_cannot_begin_is_a_row_with_its_factors_and_reason() {
        let folder = tempfile::tempdir().unwrap();
        let own = made_study(folder.path(), STUDY);
        let bench = Bench::new(&own, &Installation::default());
        assert_eq!(bench.count(), 8);
        let row = bench.run(1);
        assert_eq!(row.run, own.name(&own.settings(1)));
        assert_ne!(row.run, bench.name(0));
        let cells = &row.cells;
        assert_eq!(cells.len() + 2, bench.columns().unwrap().len());
        // The second value of the crossed factor, in the unit of the variable.
        assert_eq!(numbers(&cells[..1]), [Some(2.0)]);
        let scale = cells[1].number().unwrap();
        assert!((0.5..1.5).contains(&scale), "{scale}");
        let [ended, at, reason] = &cells[cells.len() - 3..] else {
            panic!("no ending")
        };
        assert_eq!((ended.text(), at), (Some(INVALID), &Cell::Missing));
        assert!(
            reason
                .text()
                .unwrap()
                .starts_with("--duration: neither the system"),
            "{reason:?}"
        );
        assert!(
            cells[2..cells.len() - 3]
                .iter()
                .all(|cell| *cell == Cell::Missing)
        );
        let command = bench.command(1);
        let place = folder.path().join("own.toml");
        assert_eq!(
            command,
            format!(
                "shakebench run {} --seed 3 --scale {scale:?} --set 'own.gain=0.002 V/mm'",
                quoted(&place.display().to_string())
            )
        );
        let (request, file) = bench.request_of(0).unwrap();
        assert_eq!(
            (request.set, &*file.name),
            (vec!["own.gain=1 V/m".to_string()], "own")
        );
    }

    #[test]
    fn relative_factors_are_multiples_of_what_the_system_has() {
        let folder = tempfile::tempdir().unwrap();
        let text = STUDY.replace("cross = [\"own.gain\"]", "").replace(
            "[\"1 V/m\", \"0.002 V/mm\"]",
            "{ uniform = [0.5, 1.0], relative = true }",
        );
        let own = made_study(folder.path(), &text);
        let bench = Bench::new(&own, &Installation::default());
        for number in 0..own.runs() {
            let settings = own.settings(number);
            let Setting::Number(factor) = settings[0] else {
                panic!("{settings:?}")
            };
            let cells = bench.factors(&settings).unwrap();
            assert_eq!(
                numbers(&cells),
                [
                    Some(4.0 * factor),
                    bench.study.factors[1].key.number(&settings[1]).ok()
                ]
            );
        }
    }
}
