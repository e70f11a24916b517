//! One run of the loop, natively: plant, sensors, numerical substructure and a tracking law.

use hybrid::laws::TrackingInput;
use hybrid::laws::compensation::AnyTrackingLaw;
use hybrid::vrths::{
    Converter, ExtendedTransferSystem, Frame, InteractionForm, NumericalSubstructure, PERIOD, RATE,
    ReferenceFrame, SensorNoise, TransferSystem, TransferSystemEffects, TransferSystemParameters,
};
use plant::ModelError;
use plant::sensors::channel::Noise;

use super::criteria::{Histories, Reference};

/// A tracking law of any kind.
pub type TrackingLaw = AnyTrackingLaw;

/// A ground acceleration at every half step of the benchmark, linear between a record's samples.
#[derive(Debug, Clone)]
pub struct Ground {
    /// m/s²; value 2 k belongs to sample k.
    halves: Vec<f64>,
}

impl Ground {
    /// A record of spacing `dt` (s), scaled by `intensity`; the run lasts to the last sample of
    /// the benchmark's rate within it.
    #[must_use]
    pub fn new(dt: f64, acceleration: &[f64], intensity: f64) -> Self {
        let end = dt * acceleration.len().saturating_sub(1) as f64;
        // A record that ends at a sample must not lose it by rounding.
        let steps = (end * RATE + 1e-6).floor() as usize;
        let halves = (0..=2 * steps)
            .map(|k| {
                let place = k as f64 * 0.5 * PERIOD / dt;
                let i = (place.floor() as usize).min(acceleration.len().saturating_sub(2));
                let part = place - i as f64;
                let at = |i: usize| acceleration.get(i).copied().unwrap_or(0.0);
                intensity * (at(i) * (1.0 - part) + at(i + 1) * part)
            })
            .collect();
        Self { halves }
    }

    /// Number of samples of a run.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.halves.len() / 2 + 1
    }

    /// Ground acceleration at sample `k`, m/s².
    #[must_use]
    pub fn at(&self, k: usize) -> f64 {
        self.halves[2 * k]
    }

    fn over_step(&self, k: usize) -> [f64; 3] {
        [
            self.halves[2 * k],
            self.halves[2 * k + 1],
            self.halves[2 * k + 2],
        ]
    }
}

/// Displacements of the whole frame under `ground`.
///
/// # Errors
/// A frame that cannot be simulated.
pub fn reference(frame: &Frame, ground: &Ground) -> Result<Reference, ModelError> {
    let mut whole = ReferenceFrame::new(frame, PERIOD)?;
    let n = ground.samples();
    let mut floors: Reference = std::array::from_fn(|_| Vec::with_capacity(n));
    for k in 0..n {
        for (i, floor) in floors.iter_mut().enumerate() {
            floor.push(whole.displacement(i));
        }
        if k + 1 < n {
            whole.step(ground.at(k), ground.at(k + 1));
        }
    }
    Ok(floors)
}

/// Noise of displacement (m) and force (N), one value per sample: independent draws, others for
/// every `stream` of a seed.
#[must_use]
pub fn independent_noise(seed: u64, stream: u64, samples: usize) -> [Vec<f64>; 2] {
    let size = SensorNoise::default();
    [(0, size.displacement), (1, size.force)].map(|(sensor, deviation)| {
        (0..samples as u64)
            .map(|sample| {
                let draw = Noise {
                    seed,
                    channel: stream << 1 | sensor,
                    sample,
                };
                deviation * draw.gaussian()
            })
            .collect()
    })
}

/// Noise of a fresh session of the published program: the same draws in both sensors.
#[must_use]
pub fn published_noise(samples: usize) -> [Vec<f64>; 2] {
    let size = SensorNoise::default();
    let draws: Vec<f64> = hybrid::vrths::PublishedNoise::default()
        .take(samples)
        .collect();
    [size.displacement, size.force].map(|deviation| draws.iter().map(|z| deviation * z).collect())
}

/// Of a plant that is as its linear equations say.
pub const NO_EFFECTS: TransferSystemEffects = TransferSystemEffects::NONE;

/// What a run takes place on.
#[derive(Debug, Clone, Copy)]
pub struct Setting<'a> {
    /// The whole structure.
    pub frame: &'a Frame,
    /// The transfer system with its specimen.
    pub plant: &'a TransferSystemParameters,
    /// Its effects; if any is on, its derivatives follow its equations.
    pub effects: &'a TransferSystemEffects,
    /// How its derivatives are formed.
    pub form: InteractionForm,
    /// The ground.
    pub ground: &'a Ground,
    /// Noise of displacement (m) and force (N).
    pub noise: &'a [Vec<f64>; 2],
    /// Whether the law has converters of its own.
    pub own_converters: bool,
}

/// A plant with or without effects.
enum AnyPlant {
    Linear(Box<TransferSystem>),
    Extended(Box<ExtendedTransferSystem>),
}

impl AnyPlant {
    fn new(setting: &Setting<'_>) -> Result<Self, ModelError> {
        let (parameters, effects) = (*setting.plant, *setting.effects);
        Ok(if effects.is_active() {
            Self::Extended(Box::new(ExtendedTransferSystem::new(
                parameters, effects, PERIOD,
            )?))
        } else {
            Self::Linear(Box::new(TransferSystem::new(
                parameters,
                setting.form,
                PERIOD,
            )?))
        })
    }

    /// Displacement (m) and force (N).
    fn outputs(&self) -> (f64, f64) {
        match self {
            Self::Linear(plant) => (plant.state.displacement, plant.force()),
            Self::Extended(plant) => (plant.state.displacement, plant.force()),
        }
    }

    fn step(&mut self, command: f64) {
        match self {
            Self::Linear(plant) => plant.step(command),
            Self::Extended(plant) => plant.step(command),
        }
    }
}

/// Displacement beyond which a run counts as unstable and ends, m: ten times the stroke.
const RUNAWAY: f64 = 0.07;

/// Runs the loop with `law`, which is reset. A run that runs away is cut short; its histories are
/// then shorter than the ground.
///
/// # Errors
/// A plant, frame or law that cannot be simulated.
pub fn run(setting: &Setting<'_>, law: &mut TrackingLaw) -> Result<Histories, ModelError> {
    law.validate()?;
    law.reset();
    let p = setting.plant;
    let specimen = [p.specimen_mass, p.specimen_damping(), p.specimen_stiffness];
    let mut substructure = NumericalSubstructure::new(setting.frame, specimen, 0, 1, PERIOD)?;
    let mut plant = AnyPlant::new(setting)?;
    let converter = Converter::default();
    let n = setting.ground.samples();
    let mut histories = Histories {
        measured: Vec::with_capacity(n),
        displacement: Vec::with_capacity(n),
        command: Vec::with_capacity(n),
        force: Vec::with_capacity(n),
        numerical: std::array::from_fn(|_| Vec::with_capacity(n)),
        peak_force: 0.0,
    };
    for k in 0..n {
        let floors = substructure.displacements();
        for (history, floor) in histories.numerical.iter_mut().zip(floors) {
            history.push(*floor);
        }
        let (x, force) = plant.outputs();
        histories.peak_force = histories.peak_force.max(force.abs());
        let measured = x + setting.noise[0][k];
        let measured_force = force + setting.noise[1][k];
        histories.displacement.push(x);
        histories.measured.push(measured);
        let mut input = TrackingInput {
            desired: floors[0],
            measured,
            force: measured_force,
        };
        if !setting.own_converters {
            input.measured = converter.read(measured);
        }
        let mut command = law.step(&input, PERIOD);
        if !setting.own_converters {
            command = converter.write(command);
        }
        if !(command.is_finite() && x.abs() < RUNAWAY && floors[0].abs() < RUNAWAY) {
            break;
        }
        histories.command.push(command);
        histories.force.push(measured_force);
        if k + 1 < n {
            plant.step(command);
            substructure.step(measured_force, setting.ground.over_step(k));
        }
    }
    Ok(histories)
}
