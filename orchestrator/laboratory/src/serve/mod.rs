//! A system behind another program: an experimental element for what speaks OpenFresco's protocol.

mod bench;
mod channels;
mod journal;
mod watched;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use bridges::element::{Element, Ideal, Interval, Matrices, Moves, Shape, Stepwise};
use bridges::{Admission, Bin, Ending, Event, RoundTrips, Scale, Server, SessionError};
use serde::Serialize;

pub use bench::Bench;
pub use channels::{Channel, Channels, Command};
pub use journal::{EXCHANGES, Journal};
pub use watched::Watched;

use crate::error::Error;
use crate::run::experiment::{Motions, Prepared, Request, prepare_shared, system_file};
use fmi_master::{Column, Ended, MasterError, OUTSIDE, Outcome, Plan, Samples, Simulation};
use fmi_system::{Between, ElementFile, InputTable, Origin, Quantity, VariableName};
use motion::Motion;
use pack::library::FmuLibrary;

/// What is answered to a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Any trial, from the state at the last commit.
    Ideal,
    /// What a rig can do: one move a step, none taken back.
    Rig,
}

/// What is asked of a service.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// The system.
    pub request: Request,
    /// Its signals and the client's units, where the options say them.
    pub element: ElementFile,
    /// Where it listens.
    pub address: SocketAddr,
    /// Who may come.
    pub admission: Admission,
    /// What a trial is answered.
    pub mode: Mode,
    /// How a step is gone through.
    pub shape: Shape,
    /// How long a step lasts.
    pub interval: Interval,
    /// When a rig moves.
    pub moves: Moves,
}

/// The longest service, s.
const LONGEST: f64 = 1e6;

/// A service that is ready: everything is checked, nobody listens yet.
pub struct Service {
    wanted: Wanted,
    prepared: Prepared,
    channels: Channels,
    scale: Scale,
    matrices: Matrices,
}

/// How long exchanges took.
#[derive(Debug, Clone, Serialize)]
pub struct Times {
    /// How many.
    pub count: u64,
    /// Half of them took less.
    pub median_s: f64,
    /// 99.9 per cent took less.
    pub p999_s: f64,
    /// The longest.
    pub longest_s: f64,
    /// How many took so long.
    pub histogram: Vec<Bin>,
}

impl Times {
    fn of(trips: &RoundTrips) -> Self {
        Self {
            count: trips.count(),
            median_s: trips.below(0.5),
            p999_s: trips.below(0.999),
            longest_s: trips.longest_s,
            histogram: trips.histogram(),
        }
    }
}

/// What came of a service; what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Name of the system.
    pub system: String,
    /// What a trial was answered.
    pub mode: Mode,
    /// The client's units.
    pub units: String,
    /// What a trial moved.
    pub command: String,
    /// What was measured.
    pub measured: BTreeMap<&'static str, Vec<String>>,
    /// The client.
    pub client: Option<String>,
    /// Steps that it committed.
    pub steps: usize,
    /// Its trials.
    pub trials: usize,
    /// Trials whose force was answered, a second.
    pub exchanges_per_s: f64,
    /// From a trial to its answer.
    pub answers: Times,
    /// From an answer to the client's next question.
    pub pauses: Times,
    /// Time that the client was served.
    pub wall_s: f64,
    /// `complete`, `interrupted` or `failed`.
    pub ended: &'static str,
    /// Why it ended early.
    pub reason: Option<String>,
}

/// A service that is over.
pub struct Over {
    /// Its figures.
    pub summary: Summary,
    /// What the system did.
    pub outcome: Outcome,
    /// What it was, with the trials as its motion.
    pub prepared: Prepared,
}

/// Reads and checks everything that is asked for.
///
/// # Errors
/// Whatever is at fault.
pub fn prepare(wanted: Wanted) -> Result<Service, Error> {
    let mut file = system_file(&wanted.request, None)?;
    let element = joined(&file.openfresco, &wanted.element);
    let Some(units) = &element.units else {
        return Err(Error::Option {
            option: "--units",
            reason: "the protocol does not tell the client's units, and they are never guessed; \
                     say its length and its force, such as --units in,kip"
                .to_string(),
        });
    };
    let scale = Scale::read(units).map_err(|error| Error::Option {
        option: "--units",
        reason: error.to_string(),
    })?;
    let command = channels::command(&file, &element)?;
    if let Command::Inputs(inputs) = &command {
        let columns: Vec<String> = (1..=inputs.len()).map(|i| format!("trial_{i}")).collect();
        for (column, input) in columns.iter().zip(inputs) {
            let Some((component, variable)) = input.split_once('.') else {
                return Err(Error::Option {
                    option: "--command",
                    reason: format!("`{input}`: expected `component.input` or `reference`"),
                });
            };
            let to = VariableName::new(component, variable);
            file.connections.retain(|link| link.to != to);
            file.connect(Origin::output(OUTSIDE, column), to);
        }
        file.own_tables.push(InputTable {
            name: OUTSIDE.to_string(),
            units: vec![Some("m".to_string()); columns.len()],
            values: vec![vec![0.0]; columns.len()],
            columns,
            times: vec![0.0],
            between: Between::Hold,
        });
    }
    let library = std::sync::Mutex::new(
        FmuLibrary::of(wanted.request.fmi, &file).from(&wanted.request.installation),
    );
    let request = Request {
        // A system that follows no motion has no end of its own.
        duration_s: Some(wanted.request.duration_s.unwrap_or(1.0)),
        ..wanted.request.clone()
    };
    let prepared = prepare_shared(&request, &file, &library, &Motions::default())?;
    let channels = Channels::find(&prepared.system, command, &element)?;
    let matrices = matrices(&element, &scale, channels.degrees_of_freedom())?;
    Ok(Service {
        wanted,
        prepared,
        channels,
        scale,
        matrices,
    })
}

/// What the options say before what the file says.
fn joined(file: &ElementFile, options: &ElementFile) -> ElementFile {
    fn first<T: Clone>(own: &[T], other: &[T]) -> Vec<T> {
        match own.is_empty() {
            true => other.to_vec(),
            false => own.to_vec(),
        }
    }
    ElementFile {
        units: options.units.clone().or(file.units.clone()),
        command: first(&options.command, &file.command),
        displacement: first(&options.displacement, &file.displacement),
        force: first(&options.force, &file.force),
        stiffness: first(&options.stiffness, &file.stiffness),
    }
}

fn matrices(element: &ElementFile, scale: &Scale, n: usize) -> Result<Matrices, Error> {
    let given = &element.stiffness;
    if given.is_empty() {
        return Ok(Matrices::default());
    }
    if given.len() != n * n || given.iter().any(|value| !value.is_finite()) {
        return Err(Error::Option {
            option: "--stiffness",
            reason: format!(
                "{} numbers for {n} degrees of freedom; expected {} finite ones, row by row",
                given.len(),
                n * n
            ),
        });
    }
    let factor = scale.stiffness();
    Ok(Matrices {
        stiffness: Some(given.iter().map(|value| value * factor).collect()),
        ..Matrices::default()
    })
}

impl Service {
    /// What moves and what is measured.
    pub fn channels(&self) -> &Channels {
        &self.channels
    }

    /// Listens, so that a port that is taken is known before anything else happens.
    ///
    /// # Errors
    /// The port is taken, or open to strangers.
    pub fn listen(&self) -> Result<Server, Error> {
        let wanted = &self.wanted;
        Server::bind(wanted.address, wanted.admission.clone()).map_err(|error| Error::Option {
            option: "--openfresco",
            reason: error.to_string(),
        })
    }

    fn simulation(&self) -> Result<Simulation, MasterError> {
        let prepared = &self.prepared;
        let period = prepared.motion.dt;
        // Histories that are never looked at: what is asked for comes from outside.
        let samples = match prepared.motion.is_empty() {
            true => Samples::none(period),
            false => Samples {
                period,
                columns: vec![
                    Column {
                        values: vec![0.0],
                        after: 0.0,
                    };
                    Quantity::FIRST_AXIS.len()
                ],
            },
        };
        let plan = Plan {
            algorithm: prepared.algorithm,
            step: prepared.step,
            stop: LONGEST,
            variable: prepared.variable,
        };
        Simulation::planned(&prepared.system, &samples, &plan, &prepared.options)
    }

    /// Serves one client; the rows of `exchanges.csv` are written to `folder` meanwhile.
    ///
    /// # Errors
    /// A system that cannot begin, or a folder that cannot be written.
    pub fn serve(
        mut self,
        server: &Server,
        folder: &Path,
        interrupt: &'static AtomicBool,
        tell: &mut dyn FnMut(&Event<'_>),
    ) -> Result<Over, Error> {
        let bench = Bench::new(self.simulation()?, &self.channels)?;
        let n = self.channels.degrees_of_freedom();
        let unwritten = |error: std::io::Error| Error::File {
            path: folder.join(EXCHANGES),
            reason: error.to_string(),
        };
        let mut journal = Journal::create(folder, n).map_err(unwritten)?;
        let mut lost = None;
        let mut note = |event: Event<'_>| {
            if let Event::Step(step) = &event
                && let Err(error) = journal.add(step)
            {
                lost.get_or_insert(error);
            }
            tell(&event);
        };
        let wanted = &self.wanted;
        let (interval, shape, matrices) = (wanted.interval, wanted.shape, self.matrices.clone());
        let mut host = |element: &mut dyn Element| {
            server.serve(element, &self.scale, Some(interrupt), &mut note)
        };
        let (ending, bench) = match wanted.mode {
            Mode::Ideal => {
                let mut element =
                    Ideal::new(bench, interval, shape, matrices).map_err(|error| {
                        Error::Option {
                            option: "--mode",
                            reason: error.to_string(),
                        }
                    })?;
                (host(&mut element), element.into_rig())
            }
            Mode::Rig => {
                let mut element = Stepwise::new(bench, interval, shape, wanted.moves, matrices);
                (host(&mut element), element.into_rig())
            }
        };
        if let Some(error) = lost {
            return Err(unwritten(error));
        }
        let summary = self.summary(&ending);
        let ended = ended(ending.error);
        let outcome = bench.finish(ended);
        self.take_trials_as_motion(&outcome);
        Ok(Over {
            summary,
            outcome,
            prepared: self.prepared,
        })
    }

    fn summary(&self, ending: &Ending) -> Summary {
        let names = |channels: &[Channel]| -> Vec<String> {
            let signed = channels.iter().map(|channel| {
                let sign = if channel.factor < 0.0 { "-" } else { "" };
                format!("{sign}{}", channel.name)
            });
            signed.collect()
        };
        let served = &ending.served;
        let wall_s = served.wall.as_secs_f64();
        Summary {
            system: self.prepared.system.name.clone(),
            mode: self.wanted.mode,
            units: self.scale.text.clone(),
            command: match &self.channels.command {
                Command::Reference => "reference".to_string(),
                Command::Inputs(inputs) => inputs.join(","),
            },
            measured: [
                ("displacement", names(&self.channels.displacement)),
                ("force", names(&self.channels.force)),
            ]
            .into(),
            client: ending.peer.map(|peer| peer.to_string()),
            steps: served.steps,
            trials: served.trials,
            exchanges_per_s: served.answers.count() as f64 / wall_s.max(1e-9),
            answers: Times::of(&served.answers),
            pauses: Times::of(&served.pauses),
            wall_s,
            ended: match &ending.error {
                None => "complete",
                Some(SessionError::Link(bridges::LinkError::Interrupted)) => "interrupted",
                Some(_) => "failed",
            },
            reason: ending.error.as_ref().map(ToString::to_string),
        }
    }

    /// What was asked for is the motion that the record is compared with.
    fn take_trials_as_motion(&mut self, outcome: &Outcome) {
        let record = &outcome.record;
        let column = |quantity: &str| record.column(&format!("reference.{quantity}"));
        let motion = &mut self.prepared.motion;
        let (Some(displacement), Some(velocity), Some(acceleration)) = (
            column("displacement"),
            column("velocity"),
            column("acceleration"),
        ) else {
            return;
        };
        *motion = Motion {
            name: "trials".to_string(),
            dt: motion.dt,
            displacement,
            velocity,
            acceleration,
            notes: vec!["what a client asked for over OpenFresco's protocol".to_string()],
            seed: None,
            across: None,
        };
        self.prepared.samples = record.len();
    }
}

fn ended(error: Option<SessionError>) -> Ended {
    match error {
        None => Ended::Complete,
        Some(error) => Ended::Failed(MasterError::Client(error.to_string())),
    }
}

/// The default folder of the results.
pub fn usual_folder(system: &str) -> PathBuf {
    Path::new("shakebench-results").join(format!("{system}-served"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(units: Option<&str>, force: &[&str], stiffness: &[f64]) -> ElementFile {
        ElementFile {
            units: units.map(Into::into),
            force: force.iter().map(ToString::to_string).collect(),
            stiffness: stiffness.to_vec(),
            ..ElementFile::default()
        }
    }

    #[test]
    fn options_come_before_the_file_one_by_one() {
        let file = element(Some("m,N"), &["table.force"], &[1.0]);
        let options = element(Some("in,kip"), &[], &[2.0]);
        assert_eq!(
            joined(&file, &options),
            element(Some("in,kip"), &["table.force"], &[2.0])
        );
        assert_eq!(joined(&file, &ElementFile::default()), file);
    }

    #[test]
    fn a_stiffness_is_in_the_units_of_the_client_and_square() {
        let scale = Scale::read("mm,kN").unwrap();
        let of = |values: &[f64], n| matrices(&element(None, &[], values), &scale, n);
        // A kN/mm is a MN/m.
        let found = of(&[2.0, -1.0, -1.0, 3.0], 2).unwrap().stiffness.unwrap();
        for (found, expected) in found.iter().zip([2e6, -1e6, -1e6, 3e6]) {
            assert!((found / expected - 1.0).abs() < 1e-12, "{found}");
        }
        assert_eq!(of(&[], 2).unwrap(), Matrices::default());
        for values in [&[1.0][..], &[1.0, 0.0, 0.0, f64::NAN]] {
            let told = of(values, 2).unwrap_err().to_string();
            assert!(
                told.contains("--stiffness") && told.contains("expected 4 finite ones"),
                "{told}"
            );
        }
    }

    #[test]
    fn a_client_that_fails_fails_the_run() {
        assert!(matches!(ended(None), Ended::Complete));
        let closed = SessionError::Link(bridges::LinkError::Closed);
        let told = closed.to_string();
        let Ended::Failed(MasterError::Client(reason)) = ended(Some(closed)) else {
            panic!("a failure expected")
        };
        assert_eq!(reason, told);
        assert!(usual_folder("mpc").ends_with("mpc-served"));
    }

    #[test]
    fn the_times_of_exchanges_are_those_of_their_histogram() {
        let mut trips = RoundTrips::default();
        for k in 1..=1000 {
            trips.add(std::time::Duration::from_micros(k));
        }
        let own = Times::of(&trips);
        assert_eq!((own.count, own.longest_s), (1000, 1e-3));
        assert!((500e-6..570e-6).contains(&own.median_s), "{}", own.median_s);
        assert!((990e-6..=1e-3).contains(&own.p999_s), "{}", own.p999_s);
    }
}
