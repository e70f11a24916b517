//! Extensions of a model: effects on the path of a signal, and parameters that drifted.

use plant::signal_path::SignalEffects;
use units::vocabulary;

use super::{ForeignModel, Parameter};
use diagnosis::{Candidate, EffectParameter, Role, Scale};
use recordings::mean_and_deviation;

/// Smallest share of a signal's peak, or of its largest rate, that a limit may be.
const LEAST_LIMIT: f64 = 0.02;
/// Share of a record that a delay or a lag may last.
const LONGEST: f64 = 0.25;
/// A signal's rate is beyond this in one of so many steps only.
const RARE: usize = 100;

/// An effect on the way of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// It arrives later.
    Delay,
    /// It passes a filter of first order.
    Lag,
    /// It changes at most so fast.
    RateLimit,
    /// It passes gears with play.
    Play,
    /// Nothing follows while it is small.
    DeadBand,
    /// It counts more on one side of zero than on the other.
    Asymmetry,
    /// It has another factor.
    Gain,
    /// Something is added.
    Offset,
    /// It stays at a limit.
    Saturation,
}

impl Border {
    /// All of them, in the order in which a signal passes them.
    pub const ALL: [Self; 9] = [
        Self::Delay,
        Self::Lag,
        Self::RateLimit,
        Self::Play,
        Self::DeadBand,
        Self::Asymmetry,
        Self::Gain,
        Self::Offset,
        Self::Saturation,
    ];

    /// Its name and that of its parameter.
    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Delay => ("delay", "time"),
            Self::Lag => ("lag", "time_constant"),
            Self::RateLimit => (vocabulary::RATE_LIMIT, "limit"),
            Self::Play => ("play", "width"),
            Self::DeadBand => (vocabulary::DEAD_BAND, "half_width"),
            Self::Asymmetry => ("asymmetry", "share"),
            Self::Gain => ("gain", "relative_change"),
            Self::Offset => ("offset", "offset"),
            Self::Saturation => ("saturation", "limit"),
        }
    }

    /// Its name.
    pub const fn name(self) -> &'static str {
        self.names().0
    }

    /// The unit of its parameter, for a signal in `unit`.
    pub(super) fn unit(self, unit: &str) -> String {
        match self {
            Self::Delay | Self::Lag => "s".to_owned(),
            Self::Asymmetry | Self::Gain => "1".to_owned(),
            Self::RateLimit if unit.contains('/') => format!("({unit})/s"),
            Self::RateLimit if unit.is_empty() => "1/s".to_owned(),
            Self::RateLimit => format!("{unit}/s"),
            Self::Play | Self::DeadBand | Self::Offset | Self::Saturation => unit.to_owned(),
        }
    }

    /// Puts it into `effects` with this value of its parameter.
    pub(super) fn put(self, value: f64, effects: &mut SignalEffects) {
        // A limit that is off is at infinity here.
        let limit = if value.is_finite() { value } else { 0.0 };
        match self {
            Self::Delay => effects.delay = value,
            Self::Lag => effects.lag = value,
            Self::RateLimit => effects.rate_limit = limit,
            Self::Play => effects.play = value,
            Self::DeadBand => effects.dead_band = value,
            Self::Asymmetry => effects.asymmetry = value,
            Self::Gain => effects.gain = 1.0 + value,
            Self::Offset => effects.offset = value,
            Self::Saturation => effects.saturation = limit,
        }
    }

    /// As a candidate on a signal of this extent.
    fn candidate(self, of: &Extent) -> Candidate {
        let Extent {
            deviation,
            peak,
            rate,
            step,
            sample,
            duration,
        } = *of;
        let longest = LONGEST * duration;
        let some = |shares: &[f64], unit: f64| -> Vec<Vec<f64>> {
            shares.iter().map(|share| vec![share * unit]).collect()
        };
        let off = f64::INFINITY;
        let (scale, bounds, starts) = match self {
            Self::Delay => (
                Scale::Linear(sample),
                (0.0, longest.min(1e5 * step)),
                some(&[1.0, 5.0], sample),
            ),
            Self::Lag => (
                Scale::Linear(sample),
                (0.0, longest),
                some(&[2.0, 10.0], sample),
            ),
            Self::RateLimit => (
                Scale::Inverse(rate),
                (LEAST_LIMIT * rate, off),
                some(&[0.7, 0.3], rate),
            ),
            Self::Play => (
                Scale::Linear(0.1 * deviation),
                (0.0, 2.0 * peak),
                some(&[0.1, 0.5], deviation),
            ),
            Self::DeadBand => (
                Scale::Linear(0.1 * deviation),
                (0.0, peak),
                some(&[0.1, 0.4], deviation),
            ),
            Self::Asymmetry => (Scale::Linear(0.1), (-0.9, 0.9), some(&[0.1, -0.1], 1.0)),
            Self::Gain => (
                Scale::Factor(0.1),
                (-0.9, 9.0),
                some(&[0.1, -0.1, 0.5], 1.0),
            ),
            Self::Offset => (
                Scale::Linear(0.1 * deviation),
                (-10.0 * peak, 10.0 * peak),
                some(&[0.1, -0.1], deviation),
            ),
            Self::Saturation => (
                Scale::Inverse(peak),
                (LEAST_LIMIT * peak, off),
                some(&[0.9, 0.6], peak),
            ),
        };
        let (effect, name) = self.names();
        // A signal that never changes shows nothing.
        let shows = deviation > 0.0 && (self != Self::RateLimit || rate > 0.0);
        candidate(
            effect,
            name,
            scale,
            bounds,
            if shows { starts } else { Vec::new() },
        )
    }
}

fn candidate(
    effect: &'static str,
    name: &'static str,
    scale: Scale,
    bounds: (f64, f64),
    starts: Vec<Vec<f64>>,
) -> Candidate {
    Candidate::new(
        effect,
        vec![EffectParameter {
            name,
            unit: "",
            scale,
            role: Role::Size { weak: 0.0 },
            bounds,
        }],
        starts,
    )
}

/// How far a signal goes in the records.
#[derive(Debug, Clone, Copy, Default)]
struct Extent {
    deviation: f64,
    peak: f64,
    /// Rate beyond which it is in one of a hundred steps, units per second.
    rate: f64,
    /// Shortest step, s.
    step: f64,
    /// Shortest sampling period, s.
    sample: f64,
    /// Longest record, s.
    duration: f64,
}

/// The extent of a signal over all records; `of` gives what it is in each and the step there.
fn extent<'a>(model: &'a ForeignModel<'_>, of: impl Fn(usize) -> (&'a [f64], f64)) -> Extent {
    let mut all = Extent {
        step: f64::INFINITY,
        sample: f64::INFINITY,
        ..Extent::default()
    };
    for (i, trial) in model.trials.iter().enumerate() {
        let (values, step) = of(i);
        let mut rates: Vec<f64> = values
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs() / step)
            .filter(|rate| rate.is_finite())
            .collect();
        rates.sort_by(f64::total_cmp);
        let most = rates.last().copied().unwrap_or(0.0);
        let usual = rates.get(rates.len() - rates.len() / RARE - usize::from(!rates.is_empty()));
        let usual = usual.copied().filter(|rate| *rate > 0.0).unwrap_or(most);
        let deviation = mean_and_deviation(values).1;
        let peak = values.iter().fold(0.0, |peak: f64, v| peak.max(v.abs()));
        all.deviation = all.deviation.max(deviation);
        all.peak = all.peak.max(peak);
        all.rate = all.rate.max(usual);
        all.step = all.step.min(trial.step);
        all.sample = all.sample.min(trial.step * trial.stride as f64);
        all.duration = all
            .duration
            .max(trial.step * trial.steps(trial.samples()) as f64);
    }
    all
}

/// Where a candidate acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Site {
    Input(usize, Border),
    Output(usize, Border),
    Parameter(usize),
}

/// The name of a parameter's drift.
pub(super) fn drift(parameter: &Parameter) -> String {
    format!("{}.drift", parameter.name)
}

/// What the drift of a parameter is counted in: its value, or its stated deviation where that is zero.
pub(super) fn drift_unit(parameter: &Parameter) -> f64 {
    if parameter.value == 0.0 {
        1.0
    } else {
        parameter.value.abs()
    }
}

/// Every candidate with its place, for a model with these `nominal` outputs by record.
pub(super) fn catalogue(
    model: &ForeignModel<'_>,
    nominal: &[Vec<Vec<f64>>],
) -> Vec<(Site, Candidate)> {
    let mut all = Vec::new();
    for i in 0..model.inputs.len() {
        let extent = extent(model, |t| {
            let trial = &model.trials[t];
            (&trial.inputs[i], trial.step)
        });
        all.extend(Border::ALL.map(|border| (Site::Input(i, border), border.candidate(&extent))));
    }
    for j in 0..model.outputs.len() {
        let of = |t: usize| {
            let trial = &model.trials[t];
            (nominal[t][j].as_slice(), trial.step * trial.stride as f64)
        };
        let extent = extent(model, of);
        all.extend(Border::ALL.map(|border| (Site::Output(j, border), border.candidate(&extent))));
    }
    for (k, parameter) in model.parameters.iter().enumerate() {
        let candidate = if parameter.value == 0.0 {
            let unit = parameter.plus_minus;
            let starts = [1.0, -1.0, 5.0, -5.0]
                .map(|share| vec![share * unit])
                .to_vec();
            let bounds = (-100.0 * unit, 100.0 * unit);
            candidate("drift", "change", Scale::Linear(unit), bounds, starts)
        } else {
            let starts = [0.1, -0.1, 0.5, -0.4].map(|share| vec![share]).to_vec();
            candidate(
                "drift",
                "relative_change",
                Scale::Factor(0.1),
                (-0.9, 9.0),
                starts,
            )
        };
        all.push((Site::Parameter(k), candidate));
    }
    all
}
