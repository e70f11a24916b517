//! What is run: a system on a motion, from what was asked for to what has been checked.

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use clap::ValueEnum;

pub use super::motions::Motions;
pub use super::request::Request;
use super::table::Table;
use crate::error::Error;
use crate::systems::tuning::{Rules, Wanted};
use crate::systems::{built_in, jacobi, opensees};
use fmi_import::{Description, Fmu, Options};
use fmi_master::{
    Algorithm, Column, Ended, MasterError, Outcome, Pace, Plan, Samples, Simulation, VariableStep,
};
use fmi_ssp as ssp;
use fmi_system::{
    Between, InputTable, Library, Link, Origin, Quantity, System, SystemFile, Value, VariableName,
    assemble,
};
use motion::Motion;
use motion::metrics::LONGEST_REST;
use pack::library::FmuLibrary;
use pages::live::Run as Shown;
use units::hint;

/// A request with everything it needs, checked.
pub struct Prepared {
    /// The system.
    pub system: System,
    /// The motion; one without samples for a system that follows none.
    pub motion: Motion,
    /// Order of calls.
    pub algorithm: Algorithm,
    /// Coupling step, s; the greatest one where it varies.
    pub step: f64,
    /// How it varies, if it does.
    pub variable: Option<VariableStep>,
    /// Samples to play.
    pub samples: usize,
    /// How FMUs are run.
    pub options: Options,
}

impl Prepared {
    /// The same system on another motion, played to its end.
    #[must_use]
    pub fn playing(&self, motion: Motion) -> Self {
        Self {
            algorithm: self.algorithm,
            system: self.system.clone(),
            step: self.step,
            variable: self.variable,
            samples: motion.len(),
            motion,
            options: self.options.clone(),
        }
    }

    /// Loads and initializes the system.
    ///
    /// # Errors
    /// An FMU that cannot be loaded or refuses its parameters, a step that does not fit, a loop.
    pub fn simulation(&self, algorithm: Algorithm) -> Result<Simulation, MasterError> {
        let stop = self.samples as f64 * self.motion.dt;
        let plan = Plan {
            algorithm,
            step: self.step,
            stop,
            variable: self.variable,
        };
        Simulation::planned(&self.system, &samples(&self.motion), &plan, &self.options)
    }

    /// What a page that watches the run is made from.
    #[must_use]
    pub fn shown(&self) -> Shown<'_> {
        Shown {
            system: &self.system,
            motion: &self.motion.name,
            duration: self.samples as f64 * self.motion.dt,
        }
    }

    /// Runs it as fast as it goes.
    ///
    /// # Errors
    /// As [`Prepared::simulation`]; a run that ends early is not an error.
    pub fn run(&self, algorithm: Algorithm) -> Result<Outcome, MasterError> {
        let mut outcome = self
            .simulation(algorithm)?
            .run(self.samples, Pace::Fastest, &mut |_| {});
        self.judge(&mut outcome);
        Ok(outcome)
    }

    /// A run whose table does not follow at all is not complete, though every step was made.
    pub fn judge(&self, outcome: &mut Outcome) {
        /// An error of so many times the motion's peak is not tracking.
        const LOST: f64 = 5.0;
        let names = self.system.components.iter().map(|own| own.name.as_str());
        let links: Vec<Link> = self.system.links().collect();
        let Some(table) = Table::among(names, &links, &outcome.record) else {
            return;
        };
        let asked = Origin::Reference {
            quantity: Quantity::Displacement,
            ahead: 0,
        };
        let column = |name: &str| outcome.record.column(name);
        let (Some(table), Some(asked), Some(times)) = (
            column(&table.name("displacement")),
            column(&asked.to_string()),
            column("time"),
        ) else {
            return;
        };
        let peak = self.motion.peak_displacement();
        let errors = table
            .iter()
            .zip(&asked)
            .map(|(x, wanted)| (x - wanted).abs());
        let errors: Vec<f64> = errors.collect();
        let first = errors.iter().position(|error| *error > LOST * peak);
        let Some(first) = first.filter(|_| peak > 0.0 && outcome.ended.is_regular()) else {
            return;
        };
        outcome.ended = Ended::Failed(MasterError::RanAway {
            time: times[first],
            error: errors.iter().copied().fold(0.0, f64::max),
            peak,
        });
    }
}

/// A library that several requests use, locked for one FMU at a time.
struct Shared<'a>(&'a Mutex<FmuLibrary>);

impl Shared<'_> {
    fn library(&self) -> MutexGuard<'_, FmuLibrary> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Library for Shared<'_> {
    fn fmu(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn std::error::Error>> {
        self.library().fmu(name)
    }

    fn parameters(
        &mut self,
        set: &str,
        component: &Description,
        directory: Option<&Path>,
    ) -> Result<Vec<(usize, Value)>, Box<dyn std::error::Error + Send + Sync>> {
        self.library().parameters(set, component, directory)
    }
}

/// A motion as the master plays it, axis by axis: after its end the table rests at the last displacement.
#[must_use]
pub fn samples(motion: &Motion) -> Samples {
    let column = |values: &[f64], after| Column {
        values: values.to_vec(),
        after,
    };
    let axes = std::iter::once(motion).chain(motion.across.as_deref());
    let columns = axes.flat_map(|axis| {
        let last = axis.displacement.last().copied().unwrap_or(0.0);
        [
            column(&axis.displacement, last),
            column(&axis.velocity, 0.0),
            column(&axis.acceleration, 0.0),
        ]
    });
    Samples {
        period: motion.dt,
        columns: columns.collect(),
    }
}

/// The coupling step of a system without a motion without other settings, s.
const USUAL_STEP: f64 = 0.002;
/// More samples than this are mistakes: a record of them would not fit into memory.
const MOST_SAMPLES: f64 = 1e10;

/// Reads and checks everything that a request names.
///
/// # Errors
/// Whatever is at fault.
pub fn prepare(request: &Request) -> Result<Prepared, Error> {
    prepare_file(request, &system_file(request, None)?)
}

/// As [`prepare`], of a system that has been read or put together.
///
/// # Errors
/// Whatever is at fault.
pub fn prepare_file(request: &Request, file: &SystemFile) -> Result<Prepared, Error> {
    let library = Mutex::new(FmuLibrary::of(request.fmi, file).from(&request.installation));
    prepare_shared(request, file, &library, &Motions::default())
}

/// As [`prepare_file`], with FMUs and motions that other requests have opened already; `library` is
/// one of `file`.
///
/// # Errors
/// Whatever is at fault.
pub fn prepare_shared(
    request: &Request,
    file: &SystemFile,
    library: &Mutex<FmuLibrary>,
    motions: &Motions,
) -> Result<Prepared, Error> {
    let mut file = file.clone();
    let mut algorithm = algorithm(request, &file)?;
    if algorithm == Algorithm::Jacobi {
        // An FMU that is not found is at fault when the system is assembled.
        let mut shared = Shared(library);
        let mut has = |fmu: &str, parameter: &str| {
            let found = shared.fmu(fmu);
            found.is_ok_and(|fmu| fmu.description.position(parameter).is_some())
        };
        jacobi::know_jacobi(&mut file, !is_file(&request.system), &mut has);
    }
    for path in &request.inputs {
        drive(&mut file, path)?;
    }
    let follows = |link: &Link| matches!(link.from, Origin::Reference { .. });
    let has_motion = request.record.is_some()
        || request.reference.is_some()
        || file.experiment.record.is_some()
        || file.experiment.reference.is_some()
        || file.connections.iter().any(follows);
    let mut motion = match has_motion {
        true => motions.find(request, &file)?,
        false => no_motion(),
    };
    let mut system = assemble(&file, &request.set, &mut Shared(library))?;
    // Archives of other tools do not say how their loops are solved.
    let is_free = request.algorithm.is_none() && file.experiment.algorithm.is_none();
    if is_free && file.package.is_some() && system.schedule(false).is_err() {
        algorithm = Algorithm::Iterative;
        let note =
            "the system has a loop of direct feedthrough, which is solved by --algorithm iterative";
        system.notes.push(note.to_string());
    }
    if motion.is_empty() {
        motion.dt = rest_step(request, &file, &system)?;
    }
    let step = request.step_s.or(file.step()?).unwrap_or(motion.dt);
    let mut samples = motion.len();
    let mut duration = request.duration_s.or(file.duration()?);
    if motion.is_empty() && duration.is_none() {
        duration = Some(natural_end(&system)?);
    }
    if let Some(duration) = duration {
        let fault = |reason: String| Error::Option {
            option: "--duration",
            reason,
        };
        if !(duration >= motion.dt && duration.is_finite()) {
            let reason = format!("{duration} s is shorter than a sample of {} s", motion.dt);
            return Err(fault(reason));
        }
        let count = (duration / motion.dt).round();
        if count > MOST_SAMPLES {
            return Err(fault(format!(
                "a duration of {duration:e} s needs {count:e} samples; the limit is \
                 {MOST_SAMPLES:e}"
            )));
        }
        samples = count as usize;
        if motion.is_empty() {
            // A row at the end, too.
            samples += 1;
        } else if samples > motion.len() {
            let ends = motion.len() as f64 * motion.dt;
            let long = samples as f64 * motion.dt - ends > LONGEST_REST;
            let means = if long {
                ", which is not in the means of errors"
            } else {
                ""
            };
            let note = format!("the motion ends at {ends:.3} s; afterwards the table rests{means}");
            motion.rest_until(samples);
            motion.notes.push(note.clone());
            system.notes.push(note);
        }
    }
    Ok(Prepared {
        system,
        motion,
        algorithm,
        step,
        variable: variable_step(request, &file)?,
        samples,
        options: request.installation.options(),
    })
}

/// The system that a request names; `rules` tune a built-in one's controllers, where there are some.
///
/// # Errors
/// Unknown names, a file at fault, a model that a rule refuses.
pub fn system_file(request: &Request, rules: Option<&Rules>) -> Result<SystemFile, Error> {
    let mut file = named(request, rules)?;
    if let Some(structure) = &request.structure {
        built_in::add_structure(&mut file, structure, &request.plant)?;
    }
    Ok(file)
}

fn named(request: &Request, rules: Option<&Rules>) -> Result<SystemFile, Error> {
    let name = &request.system;
    if ssp::is_ssp(name) {
        return Ok(ssp::read(name)?);
    }
    if is_fmu(name) {
        return Ok(SystemFile::of_fmu(Path::new(name)));
    }
    if is_file(name) {
        let mut file = SystemFile::read(Path::new(name))?;
        opensees::find_models(&mut file);
        return Ok(file);
    }
    let wanted = Wanted {
        tuning: request.tuning,
        model: request.control_model.as_deref(),
        rules,
        inside: false,
    };
    Ok(built_in::system(
        name,
        &request.plant,
        &request.specimen,
        wanted,
    )?)
}

/// How the step varies: as was asked for, or as the system says.
fn variable_step(request: &Request, file: &SystemFile) -> Result<Option<VariableStep>, Error> {
    let percent = request.variable_step_percent.or(file.variable_step()?);
    let least = request.least_step_s.or(file.least_step()?);
    if let (None, Some(_)) = (percent, least) {
        return Err(Error::Option {
            option: "--least-step",
            reason: "it applies only to variable steps; expected --variable-step, such as         \
                             --variable-step \"0.1 %\", beside it"
                .to_string(),
        });
    }
    Ok(percent.map(|percent| VariableStep {
        tolerance: percent / 100.0,
        least,
    }))
}

/// The order of calls: what was asked for, what the system says, or the usual one.
fn algorithm(request: &Request, file: &SystemFile) -> Result<Algorithm, Error> {
    if let Some(algorithm) = request.algorithm {
        return Ok(algorithm);
    }
    let Some(name) = &file.experiment.algorithm else {
        return Ok(Algorithm::default());
    };
    Algorithm::from_str(name, true).map_err(|_| {
        let known: Vec<String> = Algorithm::value_variants()
            .iter()
            .map(ToString::to_string)
            .collect();
        let reason = format!("`{name}` is none of {}", known.join(", "));
        file.at_fault("experiment.algorithm", reason).into()
    })
}

/// Connects the columns of an input table to the inputs that bear their names: of components, as
/// `component.input`, of a system with inputs of its own, or of a single component.
fn drive(file: &mut SystemFile, path: &Path) -> Result<(), Error> {
    let fault = |reason: String| Error::Option {
        option: "--input",
        reason,
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let is_taken = |name: &str| {
        let own = file.own_tables.iter().any(|table| table.name == name);
        own || file.components.contains_key(name) || file.tables.contains_key(name)
    };
    let mut name = stem.replace('.', "_");
    while is_taken(&name) || name == "reference" {
        name += "_";
    }
    let table =
        InputTable::read(&name, path, Between::Linear).map_err(|error| fault(error.to_string()))?;
    let single = match file.components.len() {
        1 => file.components.keys().next().cloned(),
        _ => None,
    };
    for column in &table.columns {
        let mut targets: Vec<VariableName> = file
            .open_inputs
            .iter()
            .filter(|(input, _)| input == column)
            .map(|(_, to)| to.clone())
            .collect();
        if targets.is_empty() {
            let fitting = file.components.keys().filter_map(|component| {
                let variable = column.strip_prefix(component)?.strip_prefix('.')?;
                Some(VariableName::new(component, variable))
            });
            let longest = fitting.max_by_key(|name| name.component.len());
            targets.extend(longest.or_else(|| {
                let single = single.as_ref()?;
                Some(VariableName::new(single, column))
            }));
        }
        if targets.is_empty() {
            let known = file.open_inputs.iter().map(|(input, _)| input.as_str());
            return Err(fault(format!(
                "{}: the column `{column}` is not an input of the system{}; expected \
                 `component.input`",
                path.display(),
                hint(column, known)
            )));
        }
        for to in targets {
            file.connect(Origin::output(&name, column), to);
        }
    }
    file.own_tables.push(table);
    Ok(())
}

/// No motion: without samples.
fn no_motion() -> Motion {
    Motion {
        name: "none".to_string(),
        dt: USUAL_STEP,
        displacement: Vec::new(),
        velocity: Vec::new(),
        acceleration: Vec::new(),
        notes: Vec::new(),
        seed: None,
        across: None,
    }
}

/// Time between rows where there is no motion: what was asked for, what the system says, or the
/// smallest step that its FMUs would like.
fn rest_step(request: &Request, file: &SystemFile, system: &System) -> Result<f64, Error> {
    if let Some(step) = file.sampling()?.or(request.step_s).or(file.step()?) {
        return Ok(step);
    }
    let parts = system.components.iter();
    let wishes = parts.filter_map(|part| part.period.or(part.fmu.description.preferred_step));
    let least = wishes.reduce(f64::min);
    if let (None, [part], []) = (least, &system.components[..], &system.connections[..])
        && !part.fmu.is_own
    {
        let duration = match request.duration_s.or(file.duration()?) {
            Some(duration) => duration,
            None => natural_end(system)?,
        };
        return Ok(step_alone(duration));
    }
    Ok(least.unwrap_or(USUAL_STEP))
}

/// Time between rows of an FMU alone, to which nothing else is coupled: 1, 2 or 5 times a power of ten, so
/// that a long run has some thousand rows.
fn step_alone(duration: f64) -> f64 {
    /// Rows at least.
    const ROWS: f64 = 5000.0;
    let wanted = duration / ROWS;
    if !wanted.is_finite() || wanted <= USUAL_STEP {
        return USUAL_STEP;
    }
    let power = 10_f64.powf(wanted.log10().floor());
    let digits = [5.0, 2.0, 1.0].into_iter();
    let digit = digits.filter(|digit| digit * power <= wanted * (1.0 + 1e-9));
    digit.fold(power, |most, digit| most.max(digit * power))
}

/// How long a system without a motion runs by default, s: to the end of its input tables,
/// or of the latest default experiment of its FMUs.
fn natural_end(system: &System) -> Result<f64, Error> {
    let tables = system.tables.iter().map(|table| table.end() - system.start);
    let parts = system.components.iter();
    let stops = parts.filter_map(|part| part.fmu.description.default_stop);
    let end = tables.reduce(f64::max).or(stops.reduce(f64::max));
    end.filter(|end| end.is_finite() && *end > 0.0)
        .ok_or_else(|| Error::Option {
            option: "--duration",
            reason: "neither the system nor its FMUs define a duration; pass it, such as \
                --duration \"10 s\""
                .to_string(),
        })
}

/// Whether a system is named by a file.
pub fn is_file(system: &str) -> bool {
    let is_named = system.ends_with(".toml") || is_fmu(system) || ssp::is_ssp(system);
    is_named || system.contains(['/', '\\'])
}

/// Whether a system is a single FMU.
fn is_fmu(system: &str) -> bool {
    system.to_lowercase().ends_with(".fmu")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_fmu_alone_has_rows_at_round_times_some_thousand_of_them() {
        for (duration, step) in [
            (1.0, 0.002),
            (10.0, 0.002),
            (25.0, 0.005),
            (49.0, 0.005),
            (50.0, 0.01),
            (100.0, 0.02),
            (260.0, 0.05),
            (3600.0, 0.5),
            (86_400.0, 10.0),
            (f64::INFINITY, 0.002),
            (f64::NAN, 0.002),
        ] {
            let found = step_alone(duration);
            assert!(
                (found / step - 1.0).abs() < 1e-9,
                "{duration} s: {found}, expected {step}"
            );
        }
    }

    #[test]
    fn a_system_with_a_suffix_or_a_folder_is_a_file() {
        for name in ["own.toml", "Own.FMU", "a.ssp", "folder/own", "folder\\own"] {
            assert!(is_file(name), "{name}");
        }
        for name in ["mpc", "three-variable", "toml", "fmu"] {
            assert!(!is_file(name), "{name}");
        }
        assert!(is_fmu("a.fmu") && is_fmu("A.FMU") && !is_fmu("fmu") && !is_fmu("a.fmu.toml"));
    }

    #[test]
    fn an_order_of_calls_is_that_of_the_request_then_of_the_system() {
        let mut file = SystemFile::new("own");
        let mut request = Request::built_in("mpc");
        assert_eq!(algorithm(&request, &file).unwrap(), Algorithm::default());
        file.experiment.algorithm = Some("jacobi".to_string());
        assert_eq!(algorithm(&request, &file).unwrap(), Algorithm::Jacobi);
        request.algorithm = Some(Algorithm::GaussSeidel);
        assert_eq!(algorithm(&request, &file).unwrap(), Algorithm::GaussSeidel);
        request.algorithm = None;
        file.experiment.algorithm = Some("sideways".to_string());
        let told = algorithm(&request, &file).unwrap_err().to_string();
        assert!(
            told.contains("experiment.algorithm") && told.contains("`sideways` is none of "),
            "{told}"
        );
    }

    #[test]
    fn a_step_varies_where_an_error_is_stated_and_a_least_step_needs_one() {
        let file = SystemFile::new("own");
        let request = |percent: Option<f64>, least: Option<f64>| Request {
            variable_step_percent: percent,
            least_step_s: least,
            ..Request::built_in("mpc")
        };
        let found = |own: &Request| variable_step(own, &file).map_err(|error| error.to_string());
        assert!(found(&request(None, None)).unwrap().is_none());
        let own = found(&request(Some(0.5), Some(1e-5))).unwrap().unwrap();
        assert_eq!((own.tolerance, own.least), (0.005, Some(1e-5)));
        let told = found(&request(None, Some(1e-5))).err().unwrap();
        assert!(told.starts_with("--least-step: "), "{told}");
    }

    #[test]
    fn a_motion_rests_at_its_last_displacement() {
        let axis = |first: f64| Motion {
            displacement: vec![first, first + 1.0],
            velocity: vec![3.0, 4.0],
            acceleration: vec![5.0, 6.0],
            ..no_motion()
        };
        let mut both = axis(1.0);
        both.across = Some(Box::new(axis(10.0)));
        let found = samples(&both);
        assert_eq!(found.period, USUAL_STEP);
        let after: Vec<f64> = found.columns.iter().map(|own| own.after).collect();
        assert_eq!(after, [2.0, 0.0, 0.0, 11.0, 0.0, 0.0]);
        assert_eq!(found.columns[3].values, [10.0, 11.0]);
        assert_eq!(samples(&axis(1.0)).columns.len(), 3);
        let none = samples(&no_motion());
        assert!(
            none.columns
                .iter()
                .all(|own| own.after == 0.0 && own.values.is_empty())
        );
    }

    /// A system of one table, with these lines of its file, as a request prepares it.
    fn prepared(request: &Request, lines: &str) -> Result<Prepared, Error> {
        let mut library = FmuLibrary::new(request.fmi, None);
        let table = crate::made::computed("Table", [&["u"], &["y"]], "", false, |_, _| {});
        library.give("Table", table);
        let text = format!("name = \"own\"\n{lines}\n[components.table]\nfmu = \"Table\"\n");
        let file = SystemFile::parse("own", &text).unwrap();
        prepare_shared(request, &file, &Mutex::new(library), &Motions::default())
    }

    #[test]
    fn a_motion_is_played_if_anything_asks_for_one() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: String| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let wave = crate::made::wave("wave", 3001);
        let [x, v, a] = [&wave.displacement, &wave.velocity, &wave.acceleration];
        let rows = (0..wave.len()).map(|n| (n as f64 * wave.dt, n));
        let head = "time [s],displacement [m],velocity [m/s],acceleration [m/s2]\n".to_string();
        let all = rows
            .clone()
            .map(|(t, n)| format!("{t},{},{},{}\n", x[n], v[n], a[n]));
        let moved = write("reference.csv", all.fold(head, |text, row| text + &row));
        let head = "time [s],acceleration [m/s2]\n".to_string();
        let ground = rows.map(|(t, n)| format!("{t},{}\n", a[n]));
        let shaken = write("record.csv", ground.fold(head, |text, row| text + &row));
        let quiet = Request {
            duration_s: Some(1.0),
            ..Request::built_in("own.toml")
        };
        let played = |request: &Request, lines: &str| prepared(request, lines).unwrap();
        // At rest there is a row at the end, too.
        let rest = played(&quiet, "");
        assert!(rest.motion.is_empty());
        assert_eq!((rest.motion.dt, rest.samples), (USUAL_STEP, 501));
        let record = Request {
            record: Some(shaken.clone()),
            ..quiet.clone()
        };
        let reference = Request {
            reference: Some(moved.clone()),
            ..quiet.clone()
        };
        let by_file = |key: &str, path: &Path| {
            format!("[experiment]\n{key} = {:?}", path.display().to_string())
        };
        for own in [
            played(&record, ""),
            played(&reference, ""),
            played(&quiet, &by_file("record", &shaken)),
            played(&quiet, &by_file("reference", &moved)),
            played(
                &quiet,
                "connections = [\"reference.displacement -> table.u\"]",
            ),
        ] {
            assert!(!own.motion.is_empty());
            assert_eq!((own.samples, own.step), (500, own.motion.dt));
        }
        let twice = played(&reference, "");
        assert!((twice.motion.displacement[100] - wave.displacement[100]).abs() < 1e-12);
    }

    #[test]
    fn a_run_longer_than_its_motion_rests_at_the_end_and_says_so() {
        let follows = "connections = [\"reference.displacement -> table.u\"]";
        let request = |duration: f64| Request {
            duration_s: Some(duration),
            ..Request::built_in("own.toml")
        };
        let whole = prepared(&Request::built_in("own.toml"), follows).unwrap();
        let (count, ends) = (whole.samples, whole.samples as f64 * whole.motion.dt);
        assert!(whole.system.notes.is_empty());
        for (more, means) in [(0.5, false), (10.0, true)] {
            let own = prepared(&request(ends + more), follows).unwrap();
            let expected = count + (more / own.motion.dt).round() as usize;
            assert_eq!((own.samples, own.motion.len()), (expected, expected));
            let [note] = &own.system.notes[..] else {
                panic!("{:?}", own.system.notes)
            };
            assert!(note.contains(&format!("ends at {ends:.3} s")), "{note}");
            assert_eq!(note.contains("not in the means of errors"), means, "{note}");
        }
        let told = |duration: f64| {
            let error = prepared(&request(duration), follows).err();
            error.unwrap().to_string()
        };
        assert!(told(0.001).contains("0.001 s is shorter than a sample of 0.002 s"));
        assert!(told(1e9).contains("needs 5e11 samples"));
        assert!(told(f64::INFINITY).contains("--duration"));
    }
}
