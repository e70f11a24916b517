//! A plant with something that its model lacks: recorded, diagnosed, and the tracking laws designed
//! again on what was found.

use std::fmt::Write as _;
use std::io;

use hybrid::vrths::{
    BenchmarkCase, InteractionForm, PERIOD, TransferSystemEffects, TransferSystemParameters,
};
use identification::diagnosis::engine::Observer;
use identification::diagnosis::rigs::{
    DescriptionError, ExtendedRig, Measurement, RigDiagnosis, TransferSystemRig, diagnose,
};
use plant::ModelError;
use rayon::prelude::*;
use serde::Serialize;

use pages::report::columns::aligned;

use super::motions::Motion;
use super::roster::{Entry, SAMPLE, entry};
use super::simulation::{Setting, run};
use super::study::{ControllerScore, Scene};

/// Samples of the recording that are diagnosed: 14 s, from a second before the benchmark's motions
/// begin to move.
const RECORDED: std::ops::Range<usize> = 4 * 4096..18 * 4096;

/// What is studied.
pub struct HiddenStudy {
    /// The rig's effects by name, with their values (SI).
    pub hidden: Vec<(String, f64)>,
    /// Cases that are scored; the first is recorded.
    pub cases: Vec<BenchmarkCase>,
    /// Motions that are scored; the first is recorded.
    pub motions: Vec<Motion>,
    /// Laws that are designed on a model.
    pub controllers: Vec<Entry>,
    /// Seed of the noise.
    pub seed: u64,
}

/// What is diagnosed, a sample every [`PERIOD`].
#[derive(Debug, Clone, Default)]
pub struct Recorded {
    /// Number of the case.
    pub case: u8,
    /// The motion.
    pub motion: String,
    /// Command of the controller, m.
    pub command: Vec<f64>,
    /// Displacement as its sensor shows it, m; may be empty.
    pub measured: Vec<f64>,
    /// Force as its sensor shows it, N.
    pub force: Vec<f64>,
}

/// Why a study cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum HiddenError {
    /// A plant or law that cannot be simulated.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The record cannot be diagnosed.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The record is too short.
    #[error(transparent)]
    Record(#[from] identification::IdentificationError),
}

/// A `--hidden` that is not understood.
#[derive(Debug, thiserror::Error)]
pub enum ReadHiddenError {
    /// The benchmark's rig is not described.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// No `=`.
    #[error("`{text}`: expected EFFECT=VALUE, such as delay=1 ms; effects are {}", effects.join(", "))]
    Form {
        /// What was given.
        text: String,
        /// Names of the effects.
        effects: Vec<String>,
    },
    /// An effect that the rig does not have.
    #[error("`{name}` is not an effect of the transfer system{hint}")]
    Unknown {
        /// The name.
        name: String,
        /// What may have been meant.
        hint: String,
    },
    /// A value in a unit of another quantity, or none.
    #[error("`{text}`: {source}")]
    Value {
        /// What was given.
        text: String,
        /// What is wrong with the value.
        source: units::UnitError,
    },
}

/// An effect and its value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HiddenEffect {
    /// The effect.
    pub effect: String,
    /// What was hidden, SI.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// What the diagnosis says of it, SI; none where it does not name it.
    pub found: Option<f64>,
    /// Its standard error.
    pub standard_error: Option<f64>,
}

/// Scores of a law on the plant, by what it was designed on.
#[derive(Debug, Clone, Serialize)]
pub struct Designs {
    /// The benchmark's nominal plant.
    pub nominal: ControllerScore,
    /// What the diagnosis found.
    pub extended: ControllerScore,
    /// The plant as it is.
    pub informed: ControllerScore,
}

/// What came of it.
#[derive(Debug, Clone, Serialize)]
pub struct HiddenOutcome {
    /// What was hidden, and what of it was found.
    pub hidden: Vec<HiddenEffect>,
    /// Effects that were named.
    pub named: Vec<String>,
    /// The diagnosis.
    pub diagnosis: RigDiagnosis,
    /// Scores by controller.
    pub controllers: std::collections::BTreeMap<&'static str, Designs>,
    /// The recorded run: case and motion.
    pub recorded: (u8, String),
    /// Seed of the noise.
    pub seed: u64,
    /// Time on the clock, s.
    pub wall_s: f64,
    #[serde(skip)]
    model: ExtendedRig,
}

impl Recorded {
    /// As CSV.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, file: impl io::Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(file);
        csv.write_record([
            "time [s]",
            "command [m]",
            "measured displacement [m]",
            "measured force [N]",
        ])?;
        let signals = self.command.iter().zip(&self.measured).zip(&self.force);
        for (k, ((command, measured), force)) in signals.enumerate() {
            let time = k as f64 * PERIOD;
            csv.write_record([time, *command, *measured, *force].map(|v| v.to_string()))?;
        }
        csv.flush()
    }
}

type Plant = (TransferSystemParameters, TransferSystemEffects);

impl HiddenStudy {
    /// Diagnoses a record, of [`HiddenStudy::record`] or of another plant, designs again and scores on
    /// the plant with what is hidden; `observer` receives each attempt of the diagnosis.
    ///
    /// # Errors
    /// A plant that cannot be, a record that cannot be diagnosed.
    pub fn run(
        &self,
        record: &Recorded,
        observer: Observer<'_>,
    ) -> Result<HiddenOutcome, HiddenError> {
        let start = std::time::Instant::now();
        let rig = TransferSystemRig::benchmark()?;
        let plant = rig.plant(&self.hidden);
        let scenes = Scene::all(&self.cases, &self.motions)?;
        let recording = rig.recording("record", record.command.clone(), record.force.clone())?;
        let measurement = Measurement {
            recordings: vec![recording],
        };
        let diagnosis = diagnose(&rig.description, &measurement, observer)?;
        let model = ExtendedRig::new(&rig.description, &measurement, &diagnosis)?;
        let (found, nominal) = (rig.found(&diagnosis), rig.plant(&[]));
        let designed = self.controllers.iter().filter(|entry| entry.is_designed());
        let controllers: Result<_, ModelError> = designed
            .map(|entry| {
                let score = |model: &Plant| self.score(&scenes, &plant, entry, model);
                let designs = Designs {
                    nominal: score(&nominal)?,
                    extended: score(&found)?,
                    informed: score(&plant)?,
                };
                Ok((entry.name, designs))
            })
            .collect();
        Ok(HiddenOutcome {
            hidden: self.compared(&rig, &diagnosis),
            named: diagnosis.named.clone(),
            diagnosis,
            controllers: controllers?,
            recorded: (record.case, record.motion.clone()),
            seed: self.seed,
            wall_s: start.elapsed().as_secs_f64(),
            model,
        })
    }

    /// Records the plant, in the first case and motion, under the benchmark's own controller, which knows
    /// least.
    ///
    /// # Errors
    /// A plant that cannot be.
    pub fn record(&self) -> Result<Recorded, HiddenError> {
        let plant = TransferSystemRig::benchmark()?.plant(&self.hidden);
        let scenes = Scene::all(&self.cases, &self.motions)?;
        let (Some(scene), Some(sample)) = (scenes.first(), entry(SAMPLE)) else {
            return Ok(Recorded::default());
        };
        let frame = scene.case.frame();
        // Other draws than those of the scored runs.
        let noise = scene.noise(self.seed, RECORDING);
        let setting = setting(scene, &frame, &plant, &noise, &sample);
        let histories = run(&setting, sample.make()?.as_mut())?;
        let cut = |signal: &[f64]| {
            let end = RECORDED.end.min(signal.len());
            signal[RECORDED.start.min(end)..end].to_vec()
        };
        Ok(Recorded {
            case: scene.case.number(),
            motion: scene.motion.name.clone(),
            command: cut(&histories.command),
            measured: cut(&histories.measured),
            force: cut(&histories.force),
        })
    }

    fn score(
        &self,
        scenes: &[Scene<'_>],
        plant: &Plant,
        entry: &Entry,
        model: &Plant,
    ) -> Result<ControllerScore, ModelError> {
        let runs: Result<Vec<_>, ModelError> = scenes
            .par_iter()
            .map(|scene| {
                let frame = scene.case.frame();
                let noise = scene.noise(self.seed, 0);
                let setting = setting(scene, &frame, plant, &noise, entry);
                scene.score(0, &setting, entry.design(&model.0, &model.1)?.as_mut())
            })
            .collect();
        Ok(ControllerScore::of(runs?))
    }

    fn compared(&self, rig: &TransferSystemRig, found: &RigDiagnosis) -> Vec<HiddenEffect> {
        let one = |(effect, value): &(String, f64)| {
            let named = found.named.contains(effect);
            let mut effects = found.as_described.effects.iter();
            let estimate = effects.find(|one| named && one.effect == *effect);
            let estimate = estimate.and_then(|one| one.parameters.first());
            HiddenEffect {
                effect: effect.clone(),
                value: *value,
                unit: rig.unit(effect).unwrap_or_default(),
                found: estimate.map(|estimate| estimate.value),
                standard_error: estimate.map(|estimate| estimate.standard_error),
            }
        };
        self.hidden.iter().map(one).collect()
    }
}

/// Number of the recorded run's draws of noise.
const RECORDING: usize = 0xFFFF;

fn setting<'a>(
    scene: &'a Scene<'_>,
    frame: &'a hybrid::vrths::Frame,
    plant: &'a Plant,
    noise: &'a [Vec<f64>; 2],
    entry: &Entry,
) -> Setting<'a> {
    Setting {
        frame,
        plant: &plant.0,
        effects: &plant.1,
        form: InteractionForm::TransferFunction,
        ground: &scene.motion.ground,
        noise,
        own_converters: entry.own_converters,
    }
}

impl HiddenOutcome {
    /// The scores, one row per controller and design.
    #[must_use]
    pub fn score_rows(&self) -> Vec<Vec<String>> {
        let heads = ["controller", "designed on", "runs", "unstable", "J2", "J4"];
        let heads = heads.into_iter().chain(["J6", "true tracking"]);
        let mut rows = vec![heads.map(String::from).collect::<Vec<_>>()];
        for (name, designs) in &self.controllers {
            for (on, score) in [
                ("the nominal plant", &designs.nominal),
                ("what was found", &designs.extended),
                ("the true plant", &designs.informed),
            ] {
                let cell = |mean: f64, max: f64| {
                    if mean.is_nan() {
                        "-".to_string()
                    } else {
                        format!("{mean:.2}/{max:.2}")
                    }
                };
                let tracking = score.true_tracking_percent;
                let mut row = vec![(*name).to_string(), on.to_string()];
                row.extend([score.runs.to_string(), score.unstable.to_string()]);
                row.extend([1, 3, 5].map(|i| cell(score.mean[i], score.max[i])));
                row.push(cell(tracking.mean, tracking.max));
                rows.push(row);
            }
        }
        rows
    }

    /// The outcome for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        let (case, motion) = &self.recorded;
        let _ = writeln!(
            text,
            "recorded: case {case}, {motion}, the sample controller (seed {})",
            self.seed
        );
        for one in &self.hidden {
            let HiddenEffect {
                effect,
                value,
                unit,
                ..
            } = one;
            let _ = match (one.found, one.standard_error) {
                (Some(found), Some(error)) => writeln!(
                    text,
                    "hidden: {effect} {value} {unit}; found {found:.6} ± {error:.6} {unit}"
                ),
                _ => writeln!(text, "hidden: {effect} {value} {unit}; not named"),
            };
        }
        let _ = writeln!(
            text,
            "{}: {}",
            self.diagnosis.verdict,
            self.diagnosis.sentence()
        );
        text += "\nOn the true plant, mean/largest over the runs, %\n";
        text += &aligned(&self.score_rows());
        text
    }

    /// What was found, as the file of an extended model.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn extended_model(&self) -> Result<String, toml::ser::Error> {
        self.model.to_toml()
    }
}

/// What `--hidden` asks for: `EFFECT=VALUE`, the value with a unit where it has one.
///
/// # Errors
/// No `=`, an unknown effect, a value in a unit of another quantity.
pub fn read_hidden(text: &str) -> Result<(String, f64), ReadHiddenError> {
    let rig = TransferSystemRig::benchmark()?;
    let names: Vec<&str> = rig.effects().collect();
    let Some((name, value)) = text.split_once('=') else {
        return Err(ReadHiddenError::Form {
            text: text.to_string(),
            effects: names.iter().map(ToString::to_string).collect(),
        });
    };
    let name = name.trim();
    let Some(unit) = rig.unit(name) else {
        let hint = units::hint(name, names.iter().copied());
        return Err(ReadHiddenError::Unknown {
            name: name.to_string(),
            hint,
        });
    };
    let value = units::value_in(value.trim(), unit).map_err(|source| ReadHiddenError::Value {
        text: text.to_string(),
        source,
    })?;
    Ok((name.to_string(), value))
}
