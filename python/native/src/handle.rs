//! A simulation from its description to its results.

use std::ffi::c_int;
use std::time::{Duration, Instant};

use fmi_master::{Outcome, Stepwise};
use laboratory::results::Out;
use laboratory::run::experiment::{Prepared, Request};
use laboratory::run::manifest::Manifest;
use laboratory::run::page;
use laboratory::run::summary::Summary;
use serde_json::json;

use super::Status;
use super::callback::Callbacks;
use super::spec::{FunctionInterface, Spec};

/// Why a call failed.
pub struct Fault {
    pub status: Status,
    pub reason: String,
}

impl Fault {
    /// The input is at fault.
    pub fn input(reason: &str) -> Self {
        Self {
            status: Status::Input,
            reason: reason.to_string(),
        }
    }

    fn failed(reason: &str) -> Self {
        Self {
            status: Status::Failed,
            ..Self::input(reason)
        }
    }
}

type Outcome_<T = Status> = Result<T, Fault>;

/// How far it is.
enum Stage {
    Empty,
    Prepared,
    Running(Box<Stepwise>),
    Finished(Box<Finished>),
}

struct Finished {
    outcome: Outcome,
    summary: Summary,
    manifest: Manifest,
}

/// A simulation.
pub struct Handle {
    callbacks: Callbacks,
    stage: Stage,
    prepared: Option<(Request, Prepared)>,
    functions: Vec<FunctionInterface>,
    /// The present values, where nothing moves them.
    signals: Vec<f64>,
}

/// Steps between two looks at the clock.
const LOOK: u64 = 64;
/// Time between two calls of `progress`.
const PAUSE: Duration = Duration::from_millis(50);

impl Handle {
    pub fn new(callbacks: Callbacks) -> Self {
        Self {
            callbacks,
            stage: Stage::Empty,
            prepared: None,
            functions: Vec::new(),
            signals: Vec::new(),
        }
    }

    pub fn prepare(&mut self, spec: &str) -> Outcome_ {
        let spec: Spec =
            serde_json::from_str(spec).map_err(|error| Fault::input(&error.to_string()))?;
        let made = spec.prepare(self.callbacks);
        let made = made.map_err(|error| Fault::input(&error.to_string()))?;
        self.functions = made.functions;
        self.prepared = Some((made.request, made.prepared));
        self.stage = Stage::Prepared;
        Ok(Status::Done)
    }

    pub fn begin(&mut self) -> Outcome_ {
        let Some((_, prepared)) = &self.prepared else {
            return Err(Fault::failed("nothing has been prepared"));
        };
        let simulation = prepared.simulation(prepared.algorithm);
        let simulation = simulation.and_then(|s| Stepwise::new(s, prepared.samples));
        let simulation = simulation.map_err(|error| Fault::input(&error.to_string()))?;
        self.signals = simulation.simulation().signals().to_vec();
        self.stage = Stage::Running(Box::new(simulation));
        Ok(Status::Done)
    }

    fn running(&mut self) -> Outcome_<&mut Stepwise> {
        match &mut self.stage {
            Stage::Running(stepwise) => Ok(stepwise),
            Stage::Finished(_) => Err(Fault::input(
                "the simulation has been finished; make a new one",
            )),
            Stage::Empty | Stage::Prepared => Err(Fault::failed("nothing has begun")),
        }
    }

    fn show(&mut self) {
        if let Stage::Running(stepwise) = &self.stage {
            self.signals
                .copy_from_slice(stepwise.simulation().signals());
        }
    }

    #[inline]
    pub fn step(&mut self, steps: u64) -> Outcome_ {
        let stepwise = self.running()?;
        let mut more = !stepwise.is_over();
        for _ in 0..steps {
            more = stepwise.step();
            if !more {
                break;
            }
        }
        self.show();
        Ok(if more { Status::More } else { Status::Done })
    }

    pub fn play(&mut self, progress: Option<extern "C" fn(f64) -> c_int>) -> Outcome_ {
        let stepwise = self.running()?;
        let (mut looked, mut count) = (Instant::now(), 0);
        let mut status = Status::Done;
        while stepwise.step() {
            count += 1;
            if count % LOOK == 0 && looked.elapsed() > PAUSE {
                let time = stepwise.simulation().time();
                if progress.is_some_and(|progress| progress(time) != 0) {
                    status = Status::Callback;
                    break;
                }
                looked = Instant::now();
            }
        }
        self.show();
        match status {
            Status::Callback => Err(Fault {
                status,
                reason: "interrupted".to_string(),
            }),
            status => Ok(status),
        }
    }

    pub fn finish(&mut self) -> Outcome_ {
        self.running()?;
        let stage = std::mem::replace(&mut self.stage, Stage::Prepared);
        let (Stage::Running(stepwise), Some((request, prepared))) = (stage, &self.prepared) else {
            return Err(Fault::failed("nothing has begun"));
        };
        let mut outcome = stepwise.finish();
        prepared.judge(&mut outcome);
        let plan = (prepared.algorithm, prepared.step, prepared.samples);
        let manifest = Manifest::new(request, &prepared.system, &prepared.motion, plan);
        self.stage = Stage::Finished(Box::new(Finished {
            summary: Summary::new(prepared, &outcome, &manifest),
            manifest,
            outcome,
        }));
        Ok(Status::Done)
    }

    pub fn write(&mut self, folder: &str) -> Outcome_ {
        let (Stage::Finished(finished), Some((_, prepared))) = (&mut self.stage, &self.prepared)
        else {
            return Err(Fault::failed("the simulation has not been finished"));
        };
        let Finished {
            outcome,
            summary,
            manifest,
        } = finished.as_mut();
        let written = page::write(
            &Out::new(folder),
            prepared,
            outcome,
            summary,
            manifest,
            false,
        );
        written.map_err(|error| Fault::input(&error.to_string()))?;
        Ok(Status::Done)
    }

    pub fn time(&self) -> Option<f64> {
        match &self.stage {
            Stage::Running(stepwise) => Some(stepwise.simulation().time()),
            _ => None,
        }
    }

    pub fn signals(&self) -> &[f64] {
        &self.signals
    }

    pub fn record(&self) -> Option<&[f64]> {
        match &self.stage {
            Stage::Finished(finished) => Some(finished.outcome.record.rows_from(0).0),
            _ => None,
        }
    }

    pub fn save(&mut self) -> Outcome_<Vec<u8>> {
        let saved = self.running()?.save();
        let saved = saved.map_err(|error| Fault::failed(&error.to_string()))?;
        serde_json::to_vec(&saved).map_err(|error| Fault::failed(&error.to_string()))
    }

    pub fn restore(&mut self, bytes: &[u8]) -> Outcome_ {
        let saved = serde_json::from_slice(bytes)
            .map_err(|error| Fault::input(&format!("not a saved state: {error}")))?;
        let restored = self.running()?.restore(&saved);
        restored.map_err(|error| Fault::input(&error.to_string()))?;
        self.show();
        Ok(Status::Done)
    }

    pub fn describe(&mut self, what: &str) -> Outcome_<String> {
        let value = match (what, &self.stage) {
            ("functions", _) => json!(self.functions),
            ("signals", Stage::Running(stepwise)) => {
                let duration = self.prepared.as_ref().map_or(0.0, |(_, prepared)| {
                    prepared.samples as f64 * prepared.motion.dt
                });
                let simulation = stepwise.simulation();
                json!({"names": simulation.names(), "step": simulation.step(), "duration": duration})
            }
            ("ending", Stage::Running(stepwise)) => {
                json!(stepwise.ended().map(|ended| {
                    json!({"ended": ended.kind().word(), "because": ended.reason()})
                }))
            }
            ("columns", Stage::Finished(finished)) => json!(finished.outcome.record.columns),
            ("summary", Stage::Finished(finished)) => json!(finished.summary),
            ("signals" | "ending", Stage::Finished(_)) => {
                let reason = "the simulation has been finished; make a new one";
                return Err(Fault::input(reason));
            }
            _ => return Err(Fault::failed("there is nothing to describe yet")),
        };
        Ok(value.to_string())
    }
}
