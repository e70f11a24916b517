//! The process of a model: started, moved, and ended with its owner.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::{OpenSeesError, Printed, find_python};
use crate::client::Client;
use crate::link::LinkError;
use crate::protocol::{Action, Quantities, Sizes};
use crate::scale::Scale;

/// The script that both processes run.
const DRIVER: &str = include_str!("driver.py");
/// Lines that a message quotes.
const QUOTED: usize = 6;
/// Float64 in every vector.
const LENGTH: usize = 64;
/// How often a wait looks whether the process is still there.
const LOOK: Duration = Duration::from_millis(5);
/// Displacements settle to this in an iteration, m.
const TOLERANCE: f64 = 1e-12;

/// What a structure is in the experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// It stands on the table: its base is moved, the force that it needs is answered.
    Table,
    /// It is the part of a hybrid simulation that is computed: the force measured at the specimen is
    /// applied, the displacement there is answered.
    Substructure,
}

/// What is started.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The model's script.
    pub model: PathBuf,
    /// What it is.
    pub role: Role,
    /// Direction of motion, from 1; none for what the model says, or 1.
    pub direction: Option<u32>,
    /// Its units, `LENGTH,FORCE`; none for what the model says.
    pub units: Option<String>,
    /// The Python; none to look for one.
    pub python: Option<String>,
    /// How long it may be silent.
    pub limit: Duration,
}

/// What a step comes to, SI.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reply {
    /// Where the adapter's node is, m.
    pub displacement: f64,
    /// What the adapter pushes it with, N.
    pub force: f64,
}

/// A structure that runs in OpenSees.
pub struct Structure {
    settings: Settings,
    scale: Scale,
    /// Moving mass, kg.
    mass: f64,
    /// Stiffness of the adapter, N/m.
    stiffness: f64,
    notes: Vec<String>,
    child: Child,
    /// Ends the process when it is dropped.
    orders: Option<ChildStdin>,
    events: Receiver<Event>,
    printed: Arc<Mutex<VecDeque<String>>>,
    client: Option<Client>,
    /// Step of the analysis, s; 0 until it begins.
    step: f64,
}

/// What the process says.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "event", rename_all = "lowercase")]
enum Event {
    Ready {
        port: u16,
        mass: f64,
        stiffness: f64,
        notes: Vec<String>,
        units: Option<serde_json::Value>,
    },
    Joined,
    Failed {
        kind: Fault,
        #[serde(default)]
        message: String,
        #[serde(default)]
        step: usize,
        #[serde(default)]
        status: i64,
        #[serde(default)]
        time: f64,
    },
    Ended {
        by: Option<String>,
        status: Option<i64>,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Fault {
    Missing,
    Refused,
    Python,
    Convergence,
}

impl Structure {
    /// Starts the process and waits until the model is made.
    ///
    /// # Errors
    /// No Python with OpenSees, a model that fails, or one that does not say its units.
    pub fn start(settings: Settings) -> Result<Self, OpenSeesError> {
        if let Err(error) = std::fs::File::open(&settings.model) {
            return Err(OpenSeesError::NoModel {
                path: settings.model,
                reason: error.to_string(),
            });
        }
        let scale = settings.units.as_deref().map(Scale::read).transpose()?;
        let python = find_python(settings.python.as_deref())?.program;
        let mut child = Command::new(&python)
            .args(["-u", "-c", DRIVER, "supervise"])
            .env("SHAKEBENCH_OPENSEES_DRIVER", DRIVER)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|source| OpenSeesError::Start {
                program: python,
                source,
            })?;
        let printed = Arc::default();
        if let Some(stderr) = child.stderr.take() {
            let kept = Arc::clone(&printed);
            std::thread::spawn(move || keep_lines(stderr, &kept));
        }
        let (tell, events) = channel();
        if let Some(stdout) = child.stdout.take() {
            std::thread::spawn(move || {
                for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                    if let Ok(event) = serde_json::from_str::<Event>(&line)
                        && tell.send(event).is_err()
                    {
                        break;
                    }
                }
            });
        }
        let orders = child.stdin.take();
        let mut structure = Self {
            scale: scale.clone().unwrap_or_else(si),
            settings,
            mass: 0.0,
            stiffness: 0.0,
            notes: Vec::new(),
            child,
            orders,
            events,
            printed,
            client: None,
            step: 0.0,
        };
        structure.order(&structure.wanted(scale.as_ref()));
        structure.be_ready(scale)?;
        Ok(structure)
    }

    fn wanted(&self, scale: Option<&Scale>) -> String {
        let settings = &self.settings;
        let path = std::path::absolute(&settings.model);
        let path = path.unwrap_or_else(|_| settings.model.clone());
        // In the model's own units, where they are known beforehand; inches and millimetres need no
        // other tolerance than metres.
        let length = scale.map_or(1.0, |scale| scale.length);
        serde_json::json!({
            "model": path,
            "role": settings.role,
            "direction": settings.direction,
            "tolerance": TOLERANCE / length,
        })
        .to_string()
    }

    /// The next event while the model is made.
    fn hear(&mut self) -> Result<Event, OpenSeesError> {
        match self.events.recv_timeout(self.settings.limit) {
            Ok(event) => Ok(event),
            Err(RecvTimeoutError::Disconnected) => Err(self.gone()),
            Err(RecvTimeoutError::Timeout) => Err(self.silent("making the model")),
        }
    }

    fn be_ready(&mut self, scale: Option<Scale>) -> Result<(), OpenSeesError> {
        let event = self.hear()?;
        let Event::Ready {
            port,
            mass,
            stiffness,
            notes,
            units,
        } = event
        else {
            return Err(self.fault(event));
        };
        let scale = match (scale, units) {
            (Some(scale), _) => scale,
            (None, Some(serde_json::Value::String(own))) => {
                Scale::read(&own).map_err(|error| OpenSeesError::Units {
                    path: self.settings.model.clone(),
                    reason: format!("units = {error}"),
                })?
            }
            (None, _) => {
                return Err(OpenSeesError::Units {
                    path: self.settings.model.clone(),
                    reason:
                        "the model does not say its units, which are never guessed; add a line \
                             to it, such as units = \"in,kip\", or set the component's `units`"
                            .to_string(),
                });
            }
        };
        self.mass = mass * scale.stiffness();
        self.stiffness = stiffness * scale.stiffness();
        self.notes = notes;
        self.scale = scale;
        self.connect(port)?;
        match self.hear()? {
            Event::Joined => Ok(()),
            event => Err(self.fault(event)),
        }
    }

    /// Connects to the adapter, which listens a moment later.
    fn connect(&mut self, port: u16) -> Result<(), OpenSeesError> {
        let one = Quantities {
            displacement: 1,
            ..Quantities::default()
        };
        let sizes = Sizes {
            trial: one,
            wanted: Quantities { force: 1, ..one },
            length: LENGTH,
        };
        let address = ([127, 0, 0, 1], port).into();
        let begun = Instant::now();
        while begun.elapsed() < self.settings.limit {
            if let Ok(client) = Client::connect(address, sizes, self.settings.limit) {
                self.client = Some(client);
                return Ok(());
            }
            match self.events.recv_timeout(LOOK) {
                Ok(event) => return Err(self.fault(event)),
                Err(RecvTimeoutError::Disconnected) => return Err(self.gone()),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        Err(self.silent("listening"))
    }

    /// Moving mass in the direction of motion, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Its units.
    #[must_use]
    pub fn scale(&self) -> &Scale {
        &self.scale
    }

    /// Notes for the user on how the model is set up.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Moves the adapter to `displacement`, m, over a step of `step` seconds.
    ///
    /// # Errors
    /// A step without a solution, or a process that is no more.
    pub fn advance(&mut self, displacement: f64, step: f64) -> Result<Reply, OpenSeesError> {
        if self.step == 0.0 {
            self.order(&format!("{step:?}"));
            self.step = step;
        }
        if (step - self.step).abs() > 1e-9 * self.step {
            return Err(OpenSeesError::Step {
                begun: self.step,
                asked: step,
            });
        }
        self.exchange(displacement).map_err(|error| match error {
            // The process says why, a moment later.
            OpenSeesError::Link(error) => self.reason(error),
            other => other,
        })
    }

    /// Pushes the adapter's node with `force`, N, over a step of `step` seconds: its spring is so soft
    /// that where the node is makes no difference. `near`, m, is about where it will be.
    ///
    /// # Errors
    /// As [`Structure::advance`].
    pub fn push(&mut self, force: f64, near: f64, step: f64) -> Result<Reply, OpenSeesError> {
        self.advance(near + force / self.stiffness, step)
    }

    fn exchange(&mut self, displacement: f64) -> Result<Reply, OpenSeesError> {
        let length = self.scale.length;
        let force = self.scale.force;
        let Some(client) = &mut self.client else {
            return Err(LinkError::Closed.into());
        };
        client.send(Action::SetTrial, &[displacement / length])?;
        client.send(Action::GetForce, &[])?;
        let reply = client.receive()?;
        Ok(Reply {
            displacement: reply[0] * length,
            force: reply[1] * force,
        })
    }

    /// Why the connection ended.
    fn reason(&mut self, error: LinkError) -> OpenSeesError {
        let is_silent = matches!(error, LinkError::Silent { .. });
        let wait = match is_silent {
            true => Duration::ZERO,
            false => Duration::from_secs(5),
        };
        match self.events.recv_timeout(wait) {
            Ok(event) => self.fault(event),
            Err(RecvTimeoutError::Disconnected) => self.gone(),
            Err(RecvTimeoutError::Timeout) if is_silent => self.silent("in a step"),
            Err(RecvTimeoutError::Timeout) => error.into(),
        }
    }

    fn order(&mut self, line: &str) {
        // A process that is gone says so by its end.
        if let Some(orders) = &mut self.orders {
            let _ = writeln!(orders, "{line}").and_then(|()| orders.flush());
        }
    }

    fn printed(&self) -> Printed {
        // What comes last may still be on its way.
        std::thread::sleep(Duration::from_millis(50));
        let lines = self.printed.lock().unwrap_or_else(PoisonError::into_inner);
        Printed(lines.iter().cloned().collect())
    }

    fn silent(&self, what: &'static str) -> OpenSeesError {
        OpenSeesError::Silent {
            path: self.settings.model.clone(),
            limit_s: self.settings.limit.as_secs_f64(),
            what,
        }
    }

    fn gone(&mut self) -> OpenSeesError {
        let how = match self.child.wait() {
            Ok(status) => format!("ended ({status})"),
            Err(error) => format!("is lost ({error})"),
        };
        OpenSeesError::Ended {
            path: self.settings.model.clone(),
            how,
            printed: self.printed(),
        }
    }

    fn fault(&mut self, event: Event) -> OpenSeesError {
        let path = self.settings.model.clone();
        match event {
            Event::Failed {
                kind,
                message,
                step,
                status,
                time,
            } => match kind {
                Fault::Missing => OpenSeesError::Missing { reason: message },
                Fault::Refused => OpenSeesError::Refused { path, message },
                Fault::Python => OpenSeesError::Python {
                    path,
                    message,
                    printed: self.printed(),
                },
                Fault::Convergence => OpenSeesError::Convergence {
                    path,
                    step,
                    time,
                    status,
                    printed: self.printed(),
                },
            },
            Event::Ended { by, status } => OpenSeesError::Ended {
                path,
                how: match (by, status) {
                    (Some(signal), _) => format!("was killed by {signal}"),
                    (None, Some(status)) => format!("ended with status {status}"),
                    (None, None) => "ended".to_string(),
                },
                printed: self.printed(),
            },
            Event::Ready { .. } | Event::Joined => OpenSeesError::Ended {
                path,
                how: "started again".to_string(),
                printed: Printed::default(),
            },
        }
    }
}

impl Drop for Structure {
    fn drop(&mut self) {
        self.client = None;
        // The end of its orders ends it, and what it has started.
        self.orders = None;
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(2) {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn si() -> Scale {
    Scale {
        text: "m,N".to_string(),
        length: 1.0,
        force: 1.0,
    }
}

/// Keeps the last lines of what a process prints, without what OpenSees prints of itself.
fn keep_lines(from: impl std::io::Read, kept: &Mutex<VecDeque<String>>) {
    let of_itself = [
        "Adapter::revertToLastCommit",
        "Can't revert to last commit",
        "Channel successfully created",
        "now running",
        "Process 0 Terminating",
    ];
    for line in BufReader::new(from).lines().map_while(Result::ok) {
        let line = line.trim();
        if line.is_empty() || of_itself.iter().any(|known| line.contains(known)) {
            continue;
        }
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() == QUOTED {
            kept.pop_front();
        }
        kept.push_back(line.to_string());
    }
}

/// What is before the path of a model in systems and options: `opensees:MODEL.py`.
pub const PREFIX: &str = "opensees:";

/// The file in the resources of an FMU that carries its model.
pub const CARRIED: &str = "model.py";

/// The path of a model, where a name is one.
#[must_use]
pub fn model_of(name: &str) -> Option<&Path> {
    name.strip_prefix(PREFIX).map(Path::new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_lines_of_a_process_are_kept_without_its_greetings() {
        let kept = Mutex::default();
        let said = "now running\n\n  first  \nWARNING Can't revert to last commit - x\nsecond\n";
        keep_lines(said.as_bytes(), &kept);
        assert_eq!(*kept.lock().unwrap(), ["first", "second"]);
        let more: String = (0..QUOTED).map(|n| format!("{n}\n")).collect();
        keep_lines(more.as_bytes(), &kept);
        let expected: Vec<String> = (0..QUOTED).map(|n| n.to_string()).collect();
        assert_eq!(*kept.lock().unwrap(), expected);
    }

    #[test]
    fn a_model_is_named_behind_its_prefix() {
        assert_eq!(
            model_of("opensees:frames/one.py"),
            Some(Path::new("frames/one.py"))
        );
        assert_eq!(model_of("one.py"), None);
    }
}
