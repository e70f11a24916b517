//! Diagnosis: which fault, of which actuator, explains what a model of the healthy rig does not.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::fault::played;
use crate::fit::repeats;
use crate::identify::without_free_motion;
use crate::recording::Joint;
use crate::{Error, Fault, Model, Names, Recording};

/// A fault that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// The fault's name.
    pub effect: String,
    /// Its actuators, from 1.
    pub actuators: Vec<usize>,
    /// Its parameter; none for a swap.
    pub value: Option<f64>,
    /// SI unit of the parameter.
    pub unit: String,
    /// One standard error.
    pub standard_error: Option<f64>,
    /// In words.
    pub words: String,
}

/// Verdict of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The model explains the recording.
    Adequate,
    /// A fault is named.
    Named,
    /// Several faults explain the recording alike.
    Ambiguous,
    /// No fault of the catalogue explains it.
    Unexplained,
}

/// Result of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in words.
    pub sentence: String,
    /// The faults.
    pub effects: Vec<Found>,
    /// Faults that explain nearly as much as the first one.
    pub alternatives: Vec<Found>,
    /// What is compared: strokes, then strokes against the joint.
    pub channels: Vec<String>,
    /// Root mean square of each channel's residual over its noise, with the model.
    pub before: Vec<f64>,
    /// The same with the faults.
    pub after: Vec<f64>,
}

/// A rig's description: `kind = "two_actuators"`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// `two_actuators`.
    pub kind: String,
    /// File of the model, relative to the description.
    pub model: std::path::PathBuf,
    /// Recordings, relative to the description.
    #[serde(default)]
    pub data: Vec<std::path::PathBuf>,
    /// Pins of the coupler, one per actuator: along and across, with units.
    #[serde(default)]
    pub pins: Vec<[String; 2]>,
}

/// What [`Description::kind`] is.
pub const KIND: &str = "two_actuators";

/// A description to fill in.
pub const TEMPLATE: &str = "\
# Two or more actuators that hold one joint, to be compared with a model of the healthy rig.
kind = \"two_actuators\"
model = \"healthy.toml\"                 # written by `shakebench identify HEALTHY.csv --out healthy.toml`
data = [\"today.csv\"]                   # time, command_1, command_2, stroke_1, stroke_2; with pins also translation, rotation
# Pins of the coupler seen from the joint, along the actuators and across; needed where the joint's motion was measured
pins = [[\"266.7 mm\", \"-127 mm\"], [\"266.7 mm\", \"127 mm\"]]
";

/// Places of the pins, m.
pub type Pins = Vec<[f64; 2]>;

impl Description {
    /// Reads a description with everything that it names; `data`, if there are any, replace its recordings.
    ///
    /// # Errors
    /// A file at fault, with the key.
    pub fn read(
        path: &Path,
        data: &[std::path::PathBuf],
        names: &Names,
    ) -> Result<(Model, Pins, Vec<Recording>), Error> {
        let place = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|error| Error::at(place.clone(), error.to_string()))?;
        let own: Self =
            toml::from_str(&text).map_err(|error| Error::at(place.clone(), error.to_string()))?;
        if own.kind != KIND {
            return Err(Error::at(
                place,
                format!("`kind` is `{}`; expected `{KIND}`", own.kind),
            ));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let model = Model::read(&folder.join(&own.model))?;
        let files: Vec<_> = match data.is_empty() {
            true => own.data.iter().map(|file| folder.join(file)).collect(),
            false => data.to_vec(),
        };
        if files.is_empty() {
            return Err(Error::at(
                place,
                "`data` names no recording; add one, or pass --data FILE",
            ));
        }
        let length = |key: String, text: &str| {
            units::value_in(text, "m")
                .map_err(|error| Error::at(format!("{place}, `{key}`"), error.to_string()))
        };
        let mut pins = Pins::new();
        for (i, [along, across]) in own.pins.iter().enumerate() {
            pins.push([
                length(format!("pins[{i}]"), along)?,
                length(format!("pins[{i}]"), across)?,
            ]);
        }
        let recordings = files
            .iter()
            .map(|file| Recording::read_called(file, names))
            .collect::<Result<Vec<_>, _>>()?;
        check_pins(&place, &pins, &model)?;
        Ok((model, pins, recordings))
    }
}

fn check_pins(place: &str, pins: &Pins, model: &Model) -> Result<(), Error> {
    if pins.is_empty() {
        return Ok(());
    }
    let place = format!("{place}, `pins`");
    if pins.len() != model.actuators() {
        return Err(Error::at(
            place,
            format!(
                "{} pins, but the model has {} actuators; give one pin per actuator",
                pins.len(),
                model.actuators()
            ),
        ));
    }
    let across =
        |pick: fn(f64, f64) -> f64| pins.iter().map(|pin| pin[1]).reduce(pick).unwrap_or(0.0);
    let size = pins
        .iter()
        .map(|pin| pin[0].hypot(pin[1]))
        .fold(0.0, f64::max);
    if across(f64::max) - across(f64::min) > 1e-3 * size {
        return Ok(());
    }
    Err(Error::at(
        place,
        "the lever arms are alike, so that no stroke turns the joint; expected pins that differ across the actuators",
    ))
}

/// Mean square over noise of a channel above which the model does not explain it.
const EXPLAINED: f64 = 1.3;
/// Share that a fault must explain of the present excess, and of the excess of the model without faults.
const SHARE: f64 = 0.3;
const SHARE_AT_FIRST: f64 = 0.02;
/// Most faults.
const MOST: usize = 3;
/// Excess, over the best fault's, below which another fault explains as much.
const RIVAL: f64 = 1.5;
/// Standard errors beyond which a fault's parameter is not zero.
const CLEAR: f64 = 4.0;

struct Case<'a> {
    model: &'a Model,
    pins: &'a Pins,
    recordings: &'a [Recording],
    noise: Vec<f64>,
}

type Faults = Vec<(Fault, f64)>;

/// Diagnoses recordings of a rig whose healthy state is `model`. `pins` are used where the joint was measured.
///
/// # Errors
/// A recording whose actuators or sampling period are not those of the model.
pub fn diagnose(model: &Model, pins: &Pins, recordings: &[Recording]) -> Result<Diagnosis, Error> {
    for recording in recordings {
        let refused = |what: String| Err(Error::at(recording.name.clone(), what));
        if recording.commands.len() != model.actuators() {
            return refused(format!(
                "{} actuators, but the model has {}; expected recordings of the same rig",
                recording.commands.len(),
                model.actuators()
            ));
        }
        let off = (recording.period / model.period_s - 1.0).abs();
        if off > 1e-3 {
            return refused(format!(
                "a sample every {:.4e} s, but the model was identified at {:.4e} s; expected the same sampling",
                recording.period, model.period_s
            ));
        }
    }
    let mut case = Case {
        model,
        pins,
        recordings,
        noise: Vec::new(),
    };
    case.noise = case.noise();
    Ok(case.search())
}

impl Case<'_> {
    fn has_joint(&self) -> bool {
        !self.pins.is_empty() && self.recordings.iter().all(|own| own.joint.is_some())
    }

    fn channels(&self) -> Vec<String> {
        let n = self.model.actuators();
        let strokes = (1..=n).map(|i| format!("stroke {i}"));
        let joint = (1..=n)
            .filter(|_| self.has_joint())
            .map(|i| format!("stroke {i} against the joint"));
        strokes.chain(joint).collect()
    }

    /// Noise of each channel, m: the model's residual, and what changes from sample to sample of the joint's.
    fn noise(&self) -> Vec<f64> {
        let mut noise: Vec<f64> = self
            .model
            .residual_m
            .iter()
            .map(|own| own.max(1e-12))
            .collect();
        if self.has_joint() {
            let mut square = vec![0.0; self.model.actuators()];
            for recording in self.recordings {
                for (square, own) in square
                    .iter_mut()
                    .zip(self.joint_residuals(recording, &Faults::new()))
                {
                    // Third differences leave nothing of a slow signal and 20 times the variance of white noise.
                    let third = own
                        .windows(4)
                        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2));
                    let mean = third.sum::<f64>() / own.len().max(4) as f64 / 20.0;
                    *square += mean / self.recordings.len() as f64;
                }
            }
            noise.extend(square.iter().map(|square| square.sqrt().max(1e-12)));
        }
        noise
    }

    fn stroke_residuals(&self, recording: &Recording, faults: &Faults) -> Vec<Vec<f64>> {
        let mut commands = recording.commands.clone();
        let mut model = self.model.clone();
        for (fault, value) in faults {
            match *fault {
                Fault::CommandsSwapped(a, b) => commands.swap(a, b),
                Fault::Delay(i) => model.delay_s[i] = (model.delay_s[i] + value).max(0.0),
                _ => {}
            }
        }
        for (fault, value) in faults {
            if let Fault::Gain(i) = *fault {
                commands[i].iter_mut().for_each(|u| *u *= 1.0 + value);
            }
        }
        let mut strokes = model.strokes(&commands, recording.period);
        for (fault, value) in faults {
            if let Fault::Play(i) = *fault {
                strokes[i] = played(&strokes[i], *value);
            }
        }
        for (fault, value) in faults {
            if let Fault::SensorGain(i) = *fault {
                strokes[i].iter_mut().for_each(|y| *y *= 1.0 + value);
            }
        }
        for (fault, _) in faults {
            if let Fault::SensorsSwapped(a, b) = *fault {
                strokes.swap(a, b);
            }
        }
        let both = recording.strokes.iter().zip(&strokes);
        both.map(|(measured, own)| without_free_motion(self.model, measured, own))
            .collect()
    }

    fn joint_residuals(&self, recording: &Recording, faults: &Faults) -> Vec<Vec<f64>> {
        let Some(Joint {
            translation,
            rotation,
        }) = &recording.joint
        else {
            return Vec::new();
        };
        let mut strokes = recording.strokes.clone();
        let mut pins = self.pins.clone();
        for (fault, value) in faults {
            match *fault {
                Fault::SensorsSwapped(a, b) => strokes.swap(a, b),
                Fault::Lever(i) => pins[i][1] += value,
                _ => {}
            }
        }
        for (fault, value) in faults {
            match *fault {
                Fault::SensorGain(i) => strokes[i].iter_mut().for_each(|y| *y /= 1.0 + value),
                Fault::PinPlay(i) => strokes[i] = played(&strokes[i], *value),
                _ => {}
            }
        }
        let of = |(stroke, [along, across]): (&Vec<f64>, &[f64; 2])| {
            let motion = translation.iter().zip(rotation);
            let mut left: Vec<f64> = motion
                .zip(stroke)
                .map(|((x, turn), y)| x + along * (turn.cos() - 1.0) - across * turn.sin() - y)
                .collect();
            let mean = left.iter().sum::<f64>() / left.len().max(1) as f64;
            left.iter_mut().for_each(|value| *value -= mean);
            left
        };
        strokes.iter().zip(&pins).map(of).collect()
    }

    fn residuals(&self, recording: &Recording, faults: &Faults) -> Vec<Vec<f64>> {
        let mut all = self.stroke_residuals(recording, faults);
        if self.has_joint() {
            all.extend(self.joint_residuals(recording, faults));
        }
        all
    }

    /// Mean square over noise, by channel.
    fn squares(&self, faults: &Faults) -> Vec<f64> {
        let mut sums = vec![0.0; self.noise.len()];
        let samples: usize = self.recordings.iter().map(Recording::len).sum();
        for recording in self.recordings {
            for ((sum, own), noise) in sums
                .iter_mut()
                .zip(self.residuals(recording, faults))
                .zip(&self.noise)
            {
                *sum +=
                    own.iter().map(|e| (e / noise).powi(2)).sum::<f64>() / samples.max(1) as f64;
            }
        }
        sums
    }

    fn total(&self, faults: &Faults) -> f64 {
        let sum: f64 = self.squares(faults).iter().sum();
        if sum.is_finite() { sum } else { f64::MAX }
    }

    fn candidates(&self) -> Vec<Fault> {
        let n = self.model.actuators();
        let mut all = Vec::new();
        for i in 0..n {
            all.extend([
                Fault::Gain(i),
                Fault::Delay(i),
                Fault::SensorGain(i),
                Fault::Play(i),
            ]);
            if self.has_joint() {
                all.extend([Fault::PinPlay(i), Fault::Lever(i)]);
            }
            for j in 0..i {
                all.extend([Fault::SensorsSwapped(j, i), Fault::CommandsSwapped(j, i)]);
            }
        }
        all
    }

    /// Range of a fault's parameter and what is too small to be one; none for a swap.
    fn range(&self, fault: Fault) -> Option<([f64; 2], f64)> {
        let reach = |i: usize| {
            let of = self.recordings.iter().map(|own| {
                let (low, high) = own.strokes[i]
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(low, high), y| {
                        (low.min(*y), high.max(*y))
                    });
                high - low
            });
            of.fold(0.0, f64::max)
        };
        match fault {
            Fault::Gain(_) | Fault::SensorGain(_) => Some(([-0.6, 0.6], 3e-3)),
            Fault::Delay(i) => Some(([-self.model.delay_s[i], 0.05], 0.1 * self.model.period_s)),
            Fault::Play(i) | Fault::PinPlay(i) => Some(([0.0, 0.3 * reach(i)], self.noise[i])),
            Fault::Lever(i) => {
                let arm = self.pins[i][0].hypot(self.pins[i][1]);
                Some(([-0.4 * arm, 0.4 * arm], 3e-3 * arm))
            }
            Fault::SensorsSwapped(..) | Fault::CommandsSwapped(..) => None,
        }
    }

    /// The best value of a fault beside `others`, and the total there.
    fn best(&self, fault: Fault, others: &Faults) -> (f64, f64) {
        let total = |value: f64| {
            let mut all = others.clone();
            all.push((fault, value));
            self.total(&all)
        };
        let Some(([low, high], _)) = self.range(fault) else {
            return (0.0, total(0.0));
        };
        // More places near zero, where most faults are.
        let places: Vec<f64> = (-6i32..=6)
            .map(|i| {
                let part = f64::from(i) / 6.0;
                let end = if part < 0.0 { -low } else { high };
                end * part * part.abs()
            })
            .collect();
        let values: Vec<f64> = places.iter().map(|place| total(*place)).collect();
        let least = (0..places.len())
            .min_by(|a, b| values[*a].total_cmp(&values[*b]))
            .unwrap_or(0);
        let (mut a, mut b) = (
            places[least.saturating_sub(1)],
            places[(least + 1).min(places.len() - 1)],
        );
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let (mut c, mut d) = (b - golden * (b - a), a + golden * (b - a));
        let (mut at_c, mut at_d) = (total(c), total(d));
        for _ in 0..26 {
            if at_c < at_d {
                (b, d, at_d) = (d, c, at_c);
                c = b - golden * (b - a);
                at_c = total(c);
            } else {
                (a, c, at_c) = (c, d, at_d);
                d = a + golden * (b - a);
                at_d = total(d);
            }
        }
        let (value, best) = if at_c < at_d { (c, at_c) } else { (d, at_d) };
        if values[least] < best {
            (places[least], values[least])
        } else {
            (value, best)
        }
    }

    /// One standard error of the last fault's parameter, from the curvature; residuals that are correlated count as fewer.
    fn standard_error(&self, faults: &Faults, at: usize) -> f64 {
        let (fault, value) = faults[at];
        let Some(([low, high], small)) = self.range(fault) else {
            return 0.0;
        };
        let step = (1e-3 * (high - low)).min(0.5 * small).max(1e-12);
        let moved = |by: f64| {
            let mut all = faults.clone();
            all[at].1 = value + by;
            self.recordings
                .iter()
                .map(|own| self.residuals(own, &all))
                .collect::<Vec<_>>()
        };
        let (above, below) = (moved(step), moved(-step));
        let mut information = 0.0;
        for (above, below) in above.iter().zip(&below) {
            for ((above, below), noise) in above.iter().zip(below).zip(&self.noise) {
                let slope = above
                    .iter()
                    .zip(below)
                    .map(|(a, b)| ((a - b) / (2.0 * step)).powi(2))
                    .sum::<f64>();
                let left: Vec<f64> = above
                    .iter()
                    .zip(below)
                    .map(|(a, b)| 0.5 * (a + b))
                    .collect();
                let square = left.iter().map(|e| e * e).sum::<f64>() / left.len().max(1) as f64;
                information += slope / (square.max(noise * noise) * repeats(&left));
            }
        }
        if information > 0.0 {
            information.sqrt().recip()
        } else {
            f64::INFINITY
        }
    }

    fn found(&self, faults: &Faults, at: usize) -> Found {
        let (fault, value) = faults[at];
        let error = self.standard_error(faults, at);
        let has_value = self.range(fault).is_some();
        Found {
            effect: fault.name().into(),
            actuators: fault.actuators().iter().map(|i| i + 1).collect(),
            value: has_value.then_some(value),
            unit: fault.unit().into(),
            standard_error: has_value.then_some(error),
            words: fault.words(value, error),
        }
    }

    fn search(&self) -> Diagnosis {
        let at_first = self.squares(&Faults::new());
        let count = at_first.len() as f64;
        let is_explained = |squares: &[f64]| squares.iter().all(|square| *square <= EXPLAINED);
        let excess_at_first = at_first.iter().sum::<f64>() - count;
        let mut faults = Faults::new();
        let mut alternatives = Vec::new();
        while faults.len() < MOST && !is_explained(&self.squares(&faults)) {
            let before = self.total(&faults) - count;
            let mut tried: Vec<(f64, Fault, f64)> = self
                .candidates()
                .into_iter()
                .filter(|fault| faults.iter().all(|(known, _)| known != fault))
                .map(|fault| {
                    let (value, total) = self.best(fault, &faults);
                    (total - count, fault, value)
                })
                .collect();
            tried.sort_by(|a, b| a.0.total_cmp(&b.0));
            let Some(&(left, fault, value)) = tried.first() else {
                break;
            };
            let explains = before - left;
            if explains < SHARE * before || explains < SHARE_AT_FIRST * excess_at_first {
                break;
            }
            faults.push((fault, value));
            if let Some((_, small)) = self.range(fault) {
                let error = self.standard_error(&faults, faults.len() - 1);
                if value.abs() < small || value.abs() < CLEAR * error {
                    faults.pop();
                    break;
                }
            }
            if faults.len() == 1 {
                let rivals = tried[1..]
                    .iter()
                    .filter(|own| own.0 < RIVAL * left.max(0.1));
                alternatives = rivals
                    .map(|(_, fault, value)| self.found(&vec![(*fault, *value)], 0))
                    .collect();
            }
            self.settle(&mut faults);
        }
        let after = self.squares(&faults);
        let effects: Vec<Found> = (0..faults.len()).map(|i| self.found(&faults, i)).collect();
        let verdict = match (effects.is_empty(), is_explained(&at_first)) {
            (true, true) => Verdict::Adequate,
            (true, false) => Verdict::Unexplained,
            (false, _) if effects.len() == 1 && !alternatives.is_empty() => Verdict::Ambiguous,
            (false, _) => Verdict::Named,
        };
        let roots = |squares: &[f64]| {
            squares
                .iter()
                .map(|square| square.sqrt())
                .collect::<Vec<f64>>()
        };
        Diagnosis {
            sentence: sentence(verdict, &effects, &alternatives, &roots(&after)),
            verdict,
            effects,
            alternatives,
            channels: self.channels(),
            before: roots(&at_first),
            after: roots(&after),
        }
    }

    /// Finds each fault's value again beside the others.
    fn settle(&self, faults: &mut Faults) {
        for _ in 0..if faults.len() > 1 { 2 } else { 0 } {
            for i in 0..faults.len() {
                let (fault, _) = faults[i];
                let mut others = faults.clone();
                others.remove(i);
                faults[i].1 = self.best(fault, &others).0;
            }
        }
    }
}

fn sentence(verdict: Verdict, effects: &[Found], alternatives: &[Found], after: &[f64]) -> String {
    let words = |all: &[Found]| {
        all.iter()
            .map(|own| own.words.as_str())
            .collect::<Vec<_>>()
            .join(" and ")
    };
    let largest = after.iter().copied().fold(0.0, f64::max);
    match verdict {
        Verdict::Adequate => "The model explains the recordings; no fault is found.".into(),
        Verdict::Unexplained => format!(
            "No fault of the catalogue explains the recordings: the residual is up to {largest:.1} times the noise."
        ),
        Verdict::Ambiguous => {
            let mut others: Vec<&str> = alternatives.iter().map(|own| own.words.as_str()).collect();
            others.truncate(3);
            format!(
                "Several faults explain the recordings alike: {}, or {}.",
                words(effects),
                others.join(", or ")
            )
        }
        Verdict::Named => {
            let rest = match largest > EXPLAINED.sqrt() {
                true => format!(" A residual of up to {largest:.1} times the noise is left."),
                false => String::new(),
            };
            let mut text = words(effects);
            if let Some(first) = text.get(..1).map(str::to_uppercase) {
                text.replace_range(..1, &first);
            }
            format!("{text}.{rest}")
        }
    }
}
