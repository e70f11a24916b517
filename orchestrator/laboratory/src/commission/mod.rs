//! A rig commissioned as a laboratory would: moved gently at first and then further, recorded,
//! identified, compared with what it does on other motions, and given controllers that rest on its
//! recordings alone.

mod experiment;
mod missed;
pub mod motions;
mod page;
mod rig_model;
mod systems;

use pack::Installation;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use controllers::Controller;
use controllers::pid::PidInput;
use identification::closed_loop::simulation::Simulation;
use identification::closed_loop::{Settings, identify};
use identification::data::{Channel, Recording};
use serde::Serialize;

use self::experiment::{Bench, Played};
use self::missed::Missed;

use self::motions::{Sines, motion, triangle};
use crate::design::model::{self, ModelDesign};
use crate::error::Error;
use crate::identify::{Form, Identified, from_recordings};
use crate::results::{Out, Results};
use crate::systems::built_in;
use crate::systems::control_model::ControlModel;
use crate::systems::tuning::Rules;
use fmi_import::FmiVersion;
use pages::report;
use pages::report::number::significant;
use units::STANDARD_GRAVITY;
use units::constants::{SAMPLING_PERIOD, STROKE};

pub use self::experiment::CONTROLLER;

/// What is commissioned how.
#[derive(Debug, Clone)]
pub struct Request {
    /// Built-in plant, or a file of one.
    pub plant: String,
    /// Specimen.
    pub specimen: String,
    /// Parameters of the rig's components.
    pub set: Vec<String>,
    /// Peak of the table's acceleration that the excitation grows to, m/s².
    pub level: f64,
    /// Half of the stroke, m: the excitation stays within four tenths of it.
    pub stroke: f64,
    /// Length of the recording for the identification, s.
    pub duration: f64,
    /// Seed of the motions.
    pub seed: u64,
    /// By how much of the loop's delay the sensors are late, s.
    pub sensor_delay: f64,
    /// Record that is going to be played; none: the built-in motion.
    pub record: Option<PathBuf>,
    /// Reference that is going to be played, in place of a record.
    pub reference: Option<PathBuf>,
    /// How much of it the tracking error is predicted on, s.
    pub played: f64,
    /// Version of FMI of the project's own components.
    pub fmi: FmiVersion,
    /// Where these come from.
    pub installation: Installation,
}

/// A step of the growth of the excitation.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// Largest reference, m.
    pub reference_m: f64,
    /// Largest displacement, m.
    pub displacement_m: f64,
    /// Largest acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Why it ended early.
    pub ended: Option<String>,
}

/// How far the model's acceleration is from the rig's on a motion that was not fitted, both under
/// the same controller.
#[derive(Debug, Clone, Serialize)]
pub struct Prediction {
    /// The motion.
    pub motion: String,
    /// Peak of what was measured, m/s².
    pub peak_m_s2: f64,
    /// Largest error over that peak, percent; the sensors' noise is part of it.
    pub largest_percent: f64,
    /// Root mean square of the error over that peak, percent.
    pub rms_percent: f64,
    /// Root mean square of the error of the displacement over its own, percent.
    pub displacement_percent: f64,
    /// Root mean square of the error of the command over its own, percent.
    pub command_percent: f64,
    /// The recorded command replayed on the model: root mean square of the error of the acceleration over the
    /// acceleration's own, both without the sensor's noise, percent.
    pub replayed_percent: Option<f64>,
    /// Root mean square of what was measured, without the sensor's noise, m/s².
    pub rms_m_s2: Option<f64>,
}

/// What the validation says of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The first form that was tried predicts the rig.
    Used,
    /// The model predicts the rig with what was found in its valve.
    Extended,
    /// No model predicts the rig: it has the gains under which it was recorded.
    Robust,
}

/// Largest validation error of a model that is used, percent.
pub const BOUND: f64 = 5.0;

/// Controllers besides those of the design that a model gives; their feedback has a margin of 6 dB by rule.
const LEADING: [&str; 3] = ["preview", "adaptive-preview", "adaptive-mpc"];

/// A commissioned rig: what `--json` prints.
#[derive(Serialize)]
pub struct Commissioned {
    /// The plant.
    pub plant: String,
    /// Its specimen.
    pub specimen: String,
    /// Seed of the motions.
    pub seed: u64,
    /// How the excitation grew.
    pub growth: Vec<Trial>,
    /// Motions that were not fitted.
    pub predictions: Vec<Prediction>,
    /// Error of the replayed acceleration on the lively motions that were not fitted, over their size, percent.
    pub validation_percent: Option<f64>,
    /// What that says of the model.
    pub verdict: Verdict,
    /// What the rig has that an ideal one lacks, or why no model predicts it.
    pub causes: Vec<String>,
    /// Predicted tracking error of each controller on the motion to be played, percent; none where it is
    /// stopped.
    pub predicted_percent: BTreeMap<String, Option<f64>>,
    /// Time that it took, s.
    pub wall_s: f64,
    /// The controllers.
    pub design: ModelDesign,
    /// What the reader should know, the gravest first.
    pub warnings: Vec<String>,
    /// Files that were written, relative to the folder.
    pub files: Vec<PathBuf>,
    #[serde(skip)]
    request: Request,
    #[serde(skip)]
    recordings: Vec<Recording>,
    #[serde(skip)]
    identified: Identified,
    #[serde(skip)]
    model_text: String,
}

/// Where recordings, model and systems go in the folder.
const MODEL: &str = "model.toml";
const RECORDINGS: &str = "recordings";
const EXCITATION: &str = "excitation";
const TRIANGLE: &str = "triangle";
/// Part of the stroke that the excitation uses at most.
const STROKE_PART: f64 = 0.4;
/// Band of the excitation, Hz.
const BAND: (f64, f64) = (0.05, 30.0);

/// Reads the motion that will be played at the end, so that its faults are reported at the start.
fn check_motion(request: &Request) -> Result<(), Error> {
    if let Some(path) = &request.record {
        ::motion::read_record(path)?;
    }
    if let Some(path) = &request.reference
        && let Err(error @ ::motion::MotionError::Data(_)) =
            ::motion::load_reference(path, &::motion::Options::default())
    {
        return Err(error.into());
    }
    Ok(())
}

/// Commissions a rig; `tell` hears of each step.
///
/// # Errors
/// A rig at fault, one that trips at the least motion, recordings that give no model, a rule that
/// finds no controller.
pub fn commission(request: &Request, tell: &dyn Fn(&str)) -> Result<Commissioned, Error> {
    let started = Instant::now();
    check_motion(request)?;
    let mut bench = Bench::new(request)?;
    let dt = bench.dt();
    let excitation = excitation(request, dt);
    tell("growing the excitation");
    let shape = excitation.shape();
    let (scale, growth) = grow(&mut bench, request, &shape)?;
    let noise = Sines {
        duration: 20.0,
        seed: request.seed + 100,
        ..excitation
    };
    let sines = Sines {
        band: (2.0, 20.0),
        lines: Some(60),
        seed: request.seed + 200,
        ..noise
    };
    let mut recordings = Vec::new();
    let mut warnings = Vec::new();
    let slow = (0.2 * request.stroke, triangle(2.0, 30.0, dt));
    let plays = [
        (EXCITATION, shape, scale),
        ("noise", noise.shape(), scale),
        ("sines", sines.shape(), scale),
        (TRIANGLE, slow.1, slow.0),
    ];
    for (name, shape, mut scale) in plays {
        tell(&format!("recording: {name}"));
        // Another motion may have a larger peak than the one that was grown.
        let mut played = bench.play(motion(name, &shape, scale, dt, Some(request.seed)))?;
        for _ in 0..3 {
            if played.ended.is_none() {
                break;
            }
            scale *= 0.7;
            played = bench.play(motion(name, &shape, scale, dt, Some(request.seed)))?;
        }
        match played.ended {
            None => recordings.push(played.recording),
            Some(reason) if name == EXCITATION => return Err(does_not_run(&reason)),
            Some(reason) => warnings.push(format!("{name}: not recorded: {reason}")),
        }
    }
    tell("identifying");
    let identified = from_recordings(
        vec![recordings[0].clone()],
        &crate::identify::Request {
            data: vec![Path::new(RECORDINGS).join(format!("{EXCITATION}.csv"))],
            model: MODEL.into(),
            fit_part: 0.75,
            specimen: None,
            hydraulic_first: true,
            columns: None,
            one_input: false,
        },
    )?;
    warnings.splice(0..0, identified.summary.warnings.iter().cloned());
    let mut file = identified.model_file()?;
    let late = file.command_delay.unwrap_or(0.0);
    file.sensor_delay = Some(request.sensor_delay.min(late));
    let model_text = file.to_toml()?;
    tell("predicting other motions");
    let predictions: Vec<Prediction> = match &identified.form {
        Form::Hydraulic(own) => {
            let others = recordings[1..].iter();
            others
                .map(|other| predict(&own.found, &bench, other))
                .collect()
        }
        Form::General(_) => Vec::new(),
    };
    let validation_percent = validation(&identified, &predictions);
    let (verdict, causes) = judge(&identified, validation_percent);
    let mut predicted_percent = BTreeMap::new();
    let design = if verdict == Verdict::Robust {
        warnings.insert(0, refused(validation_percent, &causes));
        ModelDesign::without(MODEL.into(), request.seed)
    } else {
        let model = ControlModel::new(&file, MODEL).map_err(|error| Error::Option {
            option: "--plant",
            reason: error.to_string(),
        })?;
        tell("designing controllers");
        let design = model::on_model(
            &model,
            &model::Options {
                model: MODEL.into(),
                only: None,
                crossover: None,
                draws: model::DRAWS,
                seed: request.seed,
            },
        )?;
        if let Form::Hydraulic(own) = &identified.form {
            tell("predicting the tracking error");
            let rules = Rules::new(model);
            let missed = Missed::of(&predictions);
            for name in names(&design) {
                match rig_model::predicted(request, &own.found, &missed, &rules, name) {
                    Ok(found) => {
                        predicted_percent.insert(name.to_string(), found);
                    }
                    Err(error) => warnings.push(format!("{name}: not predicted: {error}")),
                }
            }
        }
        design
    };
    for own in design.loops.iter().filter(|own| !own.robust) {
        warnings.push(format!(
            "{} {}: no system is written for it",
            own.name, own.note
        ));
    }
    Ok(Commissioned {
        plant: request.plant.clone(),
        specimen: request.specimen.clone(),
        seed: request.seed,
        growth,
        predictions,
        validation_percent,
        verdict,
        causes,
        predicted_percent,
        wall_s: started.elapsed().as_secs_f64(),
        design,
        warnings,
        files: Vec::new(),
        request: request.clone(),
        recordings,
        identified,
        model_text,
    })
}

/// The controllers that the model gives: those of the design that are robust, and those that lead.
fn names(design: &ModelDesign) -> impl Iterator<Item = &str> {
    let robust = design.loops.iter().filter(|own| own.robust);
    robust.map(|own| own.name.as_str()).chain(LEADING)
}

/// Root mean square of the model's error on the lively motions that were not fitted, over that of the motions,
/// percent. The acceleration of a slow triangle is friction and noise.
fn validation(identified: &Identified, predictions: &[Prediction]) -> Option<f64> {
    match &identified.form {
        Form::Hydraulic(_) => {
            let (mut errors, mut sizes) = (0.0, 0.0);
            for own in predictions.iter().filter(|own| own.motion != TRIANGLE) {
                let square = own.rms_m_s2?.powi(2);
                errors += own.replayed_percent?.powi(2) * square;
                sizes += square;
            }
            (sizes > 0.0).then(|| (errors / sizes).sqrt())
        }
        Form::General(_) => {
            let fit = identified
                .summary
                .fit_percent
                .get(Channel::Acceleration.name());
            fit.copied().flatten().map(|fit| 100.0 - fit)
        }
    }
}

/// Whether the model is used, and what it has or lacks.
fn judge(identified: &Identified, validation: Option<f64>) -> (Verdict, Vec<String>) {
    let valve = match &identified.form {
        Form::Hydraulic(own) => own.found.valve.as_ref(),
        Form::General(_) => None,
    };
    let mut causes: Vec<String> = valve
        .into_iter()
        .flat_map(|own| own.causes())
        .map(String::from)
        .collect();
    let verdict = match (validation.is_some_and(|own| own <= BOUND), valve) {
        (true, None) => Verdict::Used,
        (true, Some(_)) => Verdict::Extended,
        (false, _) => {
            causes.push("unexplained".into());
            Verdict::Robust
        }
    };
    (verdict, causes)
}

/// Why no controller is designed on the model.
fn refused(validation: Option<f64>, causes: &[String]) -> String {
    let error = validation.map_or("no prediction at all".to_string(), |own| {
        format!("an error of {} %", significant(own, 2))
    });
    format!(
        "the model predicts other motions with {error}, more than {BOUND} % ({}): no controller is \
         designed on it; {CONTROLLER}.toml has the gains of the recordings",
        causes.join(", ")
    )
}

/// What is played for the recording that is identified.
fn excitation(request: &Request, dt: f64) -> Sines {
    Sines {
        band: BAND,
        lines: None,
        duration: request.duration,
        dt,
        seed: request.seed,
    }
}

/// The recording that is identified, alone.
///
/// # Errors
/// A rig at fault, or one that trips at the least motion.
pub fn record_excitation(request: &Request) -> Result<Recording, Error> {
    let mut bench = Bench::new(request)?;
    let dt = bench.dt();
    let shape = excitation(request, dt).shape();
    let (scale, _) = grow(&mut bench, request, &shape)?;
    let played = bench.play(motion(EXCITATION, &shape, scale, dt, Some(request.seed)))?;
    match played.ended {
        None => Ok(played.recording),
        Some(reason) => Err(does_not_run(&reason)),
    }
}

/// The rules of the controllers on the recording of a bare rig whose components have these parameters; a
/// sentence says why there are none.
///
/// # Errors
/// A rig that does not run or is not identified, a model that a rule refuses.
pub fn rules_on_recordings(
    plant: &str,
    set: Vec<String>,
    duration: f64,
    seed: u64,
    installation: &Installation,
) -> Result<Rules, Error> {
    let asked = Request {
        plant: plant.to_string(),
        specimen: built_in::NONE.to_string(),
        set,
        level: 0.3 * STANDARD_GRAVITY,
        stroke: STROKE,
        duration,
        seed,
        sensor_delay: SAMPLING_PERIOD,
        record: None,
        reference: None,
        played: 10.0,
        fmi: FmiVersion::V3,
        installation: installation.clone(),
    };
    let recording = record_excitation(&asked)?;
    let found = identify(&[recording], Settings::default())?;
    let mut file = found.model_file()?;
    file.sensor_delay = file.command_delay.map(|late| late.min(SAMPLING_PERIOD));
    Ok(Rules::new(ControlModel::new(&file, "the rig's model")?))
}

fn does_not_run(reason: &str) -> Error {
    Error::Option {
        option: "--plant",
        reason: format!(
            "the rig does not run under displacement control at the smallest motion: {reason}; \
             expected a rig that `shakebench run displacement-pid` moves"
        ),
    }
}

/// Grows the first 20 s of the excitation until the table's acceleration peaks at the level asked
/// for, or its displacement at its part of the stroke, at most twofold a trial. What trips is halved,
/// and nothing grows beyond it again. Gives the scale of the shape.
fn grow(bench: &mut Bench, request: &Request, shape: &[f64]) -> Result<(f64, Vec<Trial>), Error> {
    const TRIALS: usize = 14;
    let dt = bench.dt();
    let part = &shape[..shape.len().min((20.0 / dt) as usize)];
    let top = part.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let most = STROKE_PART * request.stroke;
    let mut scale = 0.02 * request.stroke / top.max(f64::MIN_POSITIVE);
    let mut ceiling = f64::INFINITY;
    let mut trials = Vec::new();
    for _ in 0..TRIALS {
        let played: Played = bench.play(motion("growth", part, scale, dt, Some(request.seed)))?;
        let (x, a) = (
            played.peak(Channel::Displacement),
            played.peak(Channel::Acceleration),
        );
        trials.push(Trial {
            reference_m: scale * top,
            displacement_m: x,
            acceleration_m_s2: a,
            ended: played.ended.clone(),
        });
        if let Some(reason) = played.ended {
            if trials.len() > 3 && trials.iter().all(|trial| trial.ended.is_some()) {
                return Err(does_not_run(&reason));
            }
            ceiling = 0.5 * scale;
            scale = ceiling;
            continue;
        }
        let wanted = (request.level / a.max(1e-9)).min(most / (scale * top).max(x));
        let next = (scale * wanted.clamp(0.2, 2.0)).min(ceiling);
        if (next / scale - 1.0).abs() < 0.05 {
            break;
        }
        scale = next;
    }
    if trials.last().is_some_and(|trial| trial.ended.is_some()) {
        let reason = trials.last().and_then(|trial| trial.ended.clone());
        return Err(does_not_run(&reason.unwrap_or_default()));
    }
    Ok((scale, trials))
}

/// Plays the reference of `other` on the model under the bench's controller.
fn predict(
    found: &identification::closed_loop::Found,
    bench: &Bench,
    other: &Recording,
) -> Prediction {
    let specimen = found.specimen.as_ref().map(|own| own.specimen);
    let period = other.period();
    let mut model =
        Simulation::new(found.rig, found.shape, 0.0, specimen, period).through(found.curve());
    let mut law = bench.law();
    let (mut largest, mut square, mut peak) = (0.0_f64, 0.0, 0.0_f64);
    let (mut command_square, mut command_size) = (0.0, 0.0);
    let (mut way_square, mut way_size) = (0.0, 0.0);
    let ways = other.samples(Channel::Displacement);
    let wanted = other.samples(Channel::Reference);
    let measured = other.samples(Channel::Acceleration);
    let commands = other.samples(Channel::ValveCommand);
    for (((reference, measured), recorded), way) in
        wanted.iter().zip(measured).zip(commands).zip(ways)
    {
        let shown = model.shown();
        let input = PidInput {
            reference: *reference,
            measured: shown.displacement,
        };
        let command = law.step(&input, period);
        model.step(command);
        let error = shown.acceleration - measured;
        largest = largest.max(error.abs());
        square += error * error;
        peak = peak.max(measured.abs());
        command_square += (command - recorded).powi(2);
        command_size += recorded * recorded;
        way_square += (shown.displacement - way).powi(2);
        way_size += way * way;
    }
    let count = wanted.len().max(1) as f64;
    let replayed = found.replication(other);
    Prediction {
        motion: other.name.clone(),
        peak_m_s2: peak,
        largest_percent: 100.0 * largest / peak,
        rms_percent: 100.0 * (square / count).sqrt() / peak,
        displacement_percent: 100.0 * (way_square / way_size).sqrt(),
        command_percent: 100.0 * (command_square / command_size).sqrt(),
        replayed_percent: replayed.map(|own| 100.0 * own.relative_error),
        rms_m_s2: replayed.map(|own| own.rms),
    }
}

impl Commissioned {
    /// The model file's text.
    pub fn model(&self) -> &str {
        &self.model_text
    }

    /// Writes recordings, model, a system for each robust controller and the report, all or none.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&mut self, folder: &Out) -> Result<(), Error> {
        let mut results = Results::begin(folder)?;
        for recording in &self.recordings {
            let name = format!("{RECORDINGS}/{}.csv", recording.name);
            results.write(&name, |file| write_recording(recording, file))?;
        }
        results.write_text(MODEL, &self.model_text)?;
        // Systems are designed on the file itself, as `run --control-model` would.
        let model = results.staging().join(MODEL);
        let mut files = vec![PathBuf::from(MODEL), report::FILE.into()];
        let mut systems = Vec::new();
        if self.verdict == Verdict::Robust {
            systems.push((CONTROLLER, systems::recorded(&self.request, CONTROLLER)?));
        } else {
            for name in names(&self.design) {
                match systems::system(&self.request, name, &model) {
                    Ok(text) => systems.push((name, text)),
                    Err(error) if LEADING.contains(&name) => {
                        self.warnings
                            .push(format!("{name}: no system is written: {error}"));
                    }
                    Err(error) => return Err(error),
                }
            }
        }
        for (name, text) in systems {
            let name = format!("{name}.toml");
            results.write_text(&name, &text)?;
            files.push(name.into());
        }
        let recordings = self.recordings.iter();
        files.extend(recordings.map(|own| format!("{RECORDINGS}/{}.csv", own.name).into()));
        self.files = files;
        results.write_page(report::FILE, &page::report(self))?;
        results.write_json("commission.json", self)?;
        results.finish()?;
        Ok(())
    }

    /// One line a figure, for people.
    pub fn words(&self) -> String {
        let mut text = String::new();
        let verdict = match self.verdict {
            Verdict::Used => "used".to_string(),
            Verdict::Extended => format!("extended by {}", self.causes.join(", ")),
            Verdict::Robust => "not used".to_string(),
        };
        let error = self
            .validation_percent
            .map_or("-".to_string(), |own| significant(own, 2));
        text += &format!("model: {verdict}; error on other motions {error} % (bound {BOUND} %)\n");
        if let Some(first) = self.warnings.first() {
            text += &format!("{first}\n\n");
        }
        if let Some(last) = self.growth.last() {
            text += &format!(
                "excitation: {} trials, {} g at {} mm\n",
                self.growth.len(),
                significant(last.acceleration_m_s2 / STANDARD_GRAVITY, 2),
                significant(1e3 * last.displacement_m, 3),
            );
        }
        for own in &self.predictions {
            text += &format!(
                "model on {}: error of the acceleration {} % of its peak at most, {} % rms; of the \
                 command {} % rms\n",
                own.motion,
                significant(own.largest_percent, 2),
                significant(own.rms_percent, 2),
                significant(own.command_percent, 2),
            );
        }
        for (name, value) in &self.predicted_percent {
            let value = value.map_or("is stopped".to_string(), |own| {
                format!("{} %", significant(own, 2))
            });
            text += &format!("predicted tracking error of {name}: {value}\n");
        }
        text
    }
}

/// A recording as `shakebench identify` reads it.
fn write_recording(recording: &Recording, file: &mut dyn std::io::Write) -> std::io::Result<()> {
    let channels: Vec<(Channel, &[f64])> = recording.channels().collect();
    let heads: Vec<String> = channels
        .iter()
        .map(|(channel, _)| format!("{} [{}]", channel.name(), channel.unit()))
        .collect();
    writeln!(file, "time [s],{}", heads.join(","))?;
    for k in 0..recording.len() {
        let cells: Vec<String> = channels
            .iter()
            .map(|(_, values)| format!("{}", values[k]))
            .collect();
        // Stamps to the microsecond: their rounding is far below a sample.
        writeln!(file, "{:.6},{}", recording.time_at(k), cells.join(","))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_names_the_error_its_bound_and_the_causes() {
        let causes = ["valve dead band".to_string(), "unexplained".to_string()];
        let told = refused(Some(12.345), &causes);
        assert!(
            told.starts_with(
                "the model predicts other motions with an error of 12 %, more than 5 % (valve dead band, unexplained): \
                 no controller"
            ),
            "{told}"
        );
        assert!(
            told.ends_with(&format!(
                "{CONTROLLER}.toml has the gains of the recordings"
            )),
            "{told}"
        );
        let none = refused(None, &causes[1..]);
        assert!(
            none.starts_with("the model predicts other motions with no prediction at all, more"),
            "{none}"
        );
        let told = does_not_run("the stroke").to_string();
        assert!(
            told.contains("at the smallest motion: the stroke; expected a rig"),
            "{told}"
        );
    }

    #[test]
    fn a_recording_is_written_with_units_and_times_to_the_microsecond() {
        let channels = vec![
            (Channel::Reference, vec![0.0, 0.5]),
            (Channel::ValveCommand, vec![1.25, -2.0]),
        ];
        let recording = Recording::new("one", 0.002, channels).unwrap();
        let mut text = Vec::new();
        write_recording(&recording, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let mut lines = text.lines();
        let mut heads: Vec<&str> = lines.next().unwrap().split(',').collect();
        assert_eq!(heads.remove(0), "time [s]");
        heads.sort_unstable();
        assert_eq!(heads, ["reference [m]", "valve_command [V]"]);
        let rows: Vec<&str> = lines.collect();
        assert_eq!(rows.len(), 2);
        assert!(
            rows[0].starts_with("0.000000,") && rows[1].starts_with("0.002000,"),
            "{text}"
        );
        assert!(rows[1].contains("0.5") && rows[1].contains("-2"), "{text}");
    }

    #[test]
    fn a_motion_that_cannot_be_read_is_refused_at_once() {
        assert!(check_motion(&request(None, None)).is_ok());
        assert!(check_motion(&request(Some("/no/such/record.AT2"), None)).is_err());
        assert!(check_motion(&request(None, Some("/no/such/reference.csv"))).is_err());
        let own = excitation(&request(None, None), 0.004);
        assert_eq!(
            (own.band, own.duration, own.dt, own.seed),
            (BAND, 60.0, 0.004, 1)
        );
    }

    fn request(record: Option<&str>, reference: Option<&str>) -> Request {
        Request {
            plant: "servohydraulic".into(),
            specimen: "none".into(),
            set: Vec::new(),
            level: 3.0,
            stroke: 0.1,
            duration: 60.0,
            seed: 1,
            sensor_delay: 0.002,
            record: record.map(PathBuf::from),
            reference: reference.map(PathBuf::from),
            played: 10.0,
            fmi: FmiVersion::V3,
            installation: Installation::default(),
        }
    }

    #[test]
    fn an_excitation_grows_twofold_a_trial_up_to_its_level_or_part_of_the_stroke() {
        let dt = 0.002;
        let shape = crate::made::wave("wave", 1500).displacement;
        let wave = crate::made::wave("wave", 1500);
        let own = request(None, None);
        let mut bench = Bench::made();
        let (scale, trials) = grow(&mut bench, &own, &shape).unwrap();
        // From two hundredths of the stroke, twofold each time.
        let references: Vec<f64> = trials.iter().map(|trial| trial.reference_m).collect();
        assert!(
            (references[0] - 0.02 * own.stroke).abs() < 1e-12,
            "{references:?}"
        );
        assert!(
            (references[1] / references[0] - 2.0).abs() < 1e-9,
            "{references:?}"
        );
        // An acceleration of 3 m/s2 needs less travel than four tenths of the stroke.
        let last = trials.last().unwrap();
        assert!(
            (last.acceleration_m_s2 / own.level - 1.0).abs() < 0.06,
            "{last:?}"
        );
        let omega = (wave.peak_acceleration() / wave.peak_displacement()).sqrt();
        assert!(
            (last.reference_m * 0.9 * omega * omega / own.level - 1.0).abs() < 0.1,
            "{last:?}"
        );
        assert!(
            (scale * wave.peak_displacement() / last.reference_m - 1.0).abs() < 0.06,
            "{scale}"
        );
        assert!(trials.iter().all(|trial| trial.ended.is_none()) && dt > 0.0);
        // With much to spare in acceleration the stroke limits.
        let far = Request {
            level: 1000.0,
            ..own
        };
        let (_, trials) = grow(&mut bench, &far, &shape).unwrap();
        let last = trials.last().unwrap();
        assert!(
            (last.reference_m / (STROKE_PART * far.stroke) - 1.0).abs() < 0.06,
            "{last:?}"
        );
    }

    /// A table that follows a sine of 3 Hz with nine tenths.
    #[test]
    fn an_excitation_grows_at_most_twofold_to_its_level_or_its_part_of_the_stroke() {
        let omega = 6.0 * std::f64::consts::PI;
        let shape: Vec<f64> = (0..2000)
            .map(|k| (omega * 0.002 * f64::from(k)).sin())
            .collect();
        let grown = |level: f64| {
            let request = Request {
                plant: "made".into(),
                specimen: "none".into(),
                set: Vec::new(),
                level,
                stroke: 0.1,
                duration: 4.0,
                seed: 1,
                sensor_delay: 0.0,
                record: None,
                reference: None,
                played: 1.0,
                fmi: FmiVersion::V3,
                installation: Installation::default(),
            };
            let (scale, trials) = grow(&mut Bench::made(), &request, &shape).unwrap();
            let references = trials.iter().map(|own| own.reference_m).collect::<Vec<_>>();
            assert!(trials.iter().all(|own| own.ended.is_none()));
            (scale, references)
        };
        let close = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len(), "{found:?}");
            for (found, expected) in found.iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
            }
        };
        // 2 m/s² are so many m.
        let (scale, references) = grown(2.0);
        let enough = 2.0 / (0.9 * omega * omega);
        close(&references, &[0.002, 0.004, enough]);
        close(&[scale], &[enough]);
        // Four tenths of the stroke come first.
        let (scale, references) = grown(1e3);
        close(&references, &[0.002, 0.004, 0.008, 0.016, 0.032, 0.04]);
        close(&[scale], &[0.04]);
    }
}
