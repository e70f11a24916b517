//! Recordings of the physical rig under a displacement controller, as a laboratory would take them
//! before it has a model: seeded, native, SI.

use controllers::pid::{Pid, PidInput};
use controllers::{Controller, ModelError};
use identification::closed_loop::Found;
use identification::closed_loop::simulation::Simulation;
use identification::data::{Channel, Recording};
use laboratory::commission::motions::Sines;
use plant::sensors::channel::Noise;
use plant::sensors::instrumentation::{Instrumentation, InstrumentationState, TrueMotion};
use plant::servo_hydraulic::{SealFriction, ServoHydraulicRig, ServoHydraulicTable};
use plant::specimens::YieldingSpecimen;
use plant::specimens::linear::LinearSpecimen;
use units::constants::{G, SAMPLING_PERIOD};

/// What stands on the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnTable {
    /// Nothing but the payload.
    Nothing,
    /// The linear specimen of Appendix A.
    Linear,
    /// The yielding specimen.
    Yielding,
}

/// One recording of the physical rig.
#[derive(Debug, Clone)]
pub struct PhysicalTest {
    /// What it is called.
    pub name: String,
    /// The table; its friction and payload are set from the fields below.
    pub table: ServoHydraulicTable,
    /// Dry friction of the seals, over that of the default rig.
    pub friction: f64,
    /// Mass bolted to the table, kg.
    pub payload: f64,
    /// What stands on it.
    pub specimen: OnTable,
    /// Peak of the table's acceleration that the motion is scaled to, g.
    pub level: f64,
    /// Whether the sensors have their lags.
    pub lags: bool,
    /// Lateness of all channels, s.
    pub delay: f64,
    /// Noise of the recorded command over its root mean square.
    pub command_noise: f64,
    /// Noise of the sensors over the laboratory's.
    pub noise: f64,
    /// Sampling period, s.
    pub period: f64,
    /// Length, s.
    pub duration: f64,
    /// Band of the motion, Hz.
    pub band: (f64, f64),
    /// Sines in the motion: all of the band's grid, or so many spaced evenly in their logarithm.
    pub lines: Option<usize>,
    /// Seed of motion and noise.
    pub seed: u64,
}

impl Default for PhysicalTest {
    fn default() -> Self {
        Self {
            name: "test".into(),
            table: ServoHydraulicTable::default(),
            friction: 1.0,
            payload: 0.0,
            specimen: OnTable::Nothing,
            level: 0.2,
            lags: true,
            delay: 0.0,
            command_noise: 0.0,
            noise: 1.0,
            period: SAMPLING_PERIOD,
            duration: 60.0,
            band: (0.05, 30.0),
            lines: None,
            seed: 1,
        }
    }
}

/// Signals of a test, a sample each: what was wanted, commanded, and truly done.
#[derive(Debug, Clone, Default)]
pub struct Played {
    /// Wanted displacement, m.
    pub reference: Vec<f64>,
    /// Command, V.
    pub command: Vec<f64>,
    /// Displacement, acceleration, actuator force, specimen acceleration as measured, SI.
    pub measured: [Vec<f64>; 4],
    /// True acceleration of the table, m/s².
    pub acceleration: Vec<f64>,
}

/// The displacement controller of every test: Eq 3-6.
pub fn controller() -> Pid {
    Pid::equation_3_6()
}

impl PhysicalTest {
    /// The rig that is recorded.
    pub fn rig(&self) -> ServoHydraulicRig {
        let mut table = self.table;
        table.added_payload += self.payload;
        let seals = table.friction;
        table.friction = SealFriction {
            coulomb: seals.coulomb * self.friction,
            static_force: seals.static_force * self.friction,
            ..seals
        };
        let mut specimen = YieldingSpecimen::default();
        if self.specimen == OnTable::Linear {
            let linear = LinearSpecimen::appendix_a();
            specimen.mass = linear.mass;
            specimen.damping = linear.damping;
            // A spring that would yield at ten metres.
            specimen.columns.yield_displacement = 10.0;
            specimen.columns.yield_force = 10.0 * linear.stiffness;
            specimen.columns.post_yield_ratio = 1.0;
        }
        ServoHydraulicRig { table, specimen }
    }

    /// The sensors.
    pub fn instruments(&self) -> Instrumentation {
        let mut instruments = Instrumentation::laboratory(self.seed);
        instruments.delay = self.delay;
        for channel in [
            &mut instruments.displacement,
            &mut instruments.acceleration,
            &mut instruments.actuator_force,
            &mut instruments.specimen_acceleration,
        ] {
            channel.noise *= self.noise;
            if !self.lags {
                channel.corner = 0.0;
            }
        }
        instruments
    }

    /// The motion of unit root mean square, as a rig is commissioned with.
    pub fn shape(&self) -> Vec<f64> {
        Sines {
            band: self.band,
            lines: self.lines,
            duration: self.duration,
            dt: self.period,
            seed: self.seed,
        }
        .shape()
    }

    /// Plays `reference` (m) on the rig.
    ///
    /// # Errors
    /// Sensors that cannot be simulated.
    pub fn play(&self, reference: &[f64]) -> Result<Played, ModelError> {
        let rig = self.rig();
        let instruments = self.instruments();
        let filter = instruments.velocity_filter(self.period)?;
        let mut sensed = InstrumentationState::default();
        let mut law = controller();
        let mut state = rig.rest();
        let mut played = Played::default();
        for &wanted in reference {
            let carried = self.specimen != OnTable::Nothing;
            let force = if carried {
                rig.specimen.force(&state.specimen)
            } else {
                0.0
            };
            let truth = TrueMotion {
                displacement: state.table.displacement,
                velocity: state.table.velocity,
                acceleration: rig.table.acceleration(&state.table, force),
                actuator_force: rig.table.actuator_force(&state.table),
                specimen_acceleration: rig.specimen.acceleration(&state.specimen),
            };
            let m = instruments.sample(&mut sensed, &filter, &truth, self.period);
            let command = law.step(
                &PidInput {
                    reference: wanted,
                    measured: m.displacement,
                },
                self.period,
            );
            played.reference.push(wanted);
            played.command.push(command);
            played.acceleration.push(truth.acceleration);
            let values = [
                m.displacement,
                m.acceleration,
                m.actuator_force,
                m.specimen_acceleration,
            ];
            for (column, value) in played.measured.iter_mut().zip(values) {
                column.push(value);
            }
            state = if carried {
                rig.advance(&state, command, self.period, 2e-4)
            } else {
                let input = plant::servo_hydraulic::ServoHydraulicInput {
                    valve_command: command,
                    ..Default::default()
                };
                let mut next = state;
                next.table = rig.table.advance(&state.table, &input, self.period);
                next
            };
        }
        Ok(played)
    }

    /// The motion (m), scaled so that the table's true acceleration peaks at the level asked for
    /// to a few per cent.
    ///
    /// # Errors
    /// As [`Self::play`].
    pub fn reference(&self) -> Result<Vec<f64>, ModelError> {
        let shape = self.shape();
        let part = &shape[..shape.len().min((20.0 / self.period) as usize)];
        let mut scale = 2e-3;
        for _ in 0..4 {
            let trial: Vec<f64> = part.iter().map(|v| v * scale).collect();
            let played = self.play(&trial)?;
            let peak = played
                .acceleration
                .iter()
                .fold(0.0f64, |p, a| p.max(a.abs()));
            scale *= (self.level * G / peak).clamp(0.2, 5.0);
        }
        Ok(shape.iter().map(|v| v * scale).collect())
    }

    /// Plays and records the test.
    ///
    /// # Errors
    /// As [`Self::play`], or channels that make no recording.
    pub fn record(&self) -> Result<Recording, Box<dyn std::error::Error>> {
        let mut played = self.play(&self.reference()?)?;
        let count = played.command.len().max(1) as f64;
        let rms = (played.command.iter().map(|u| u * u).sum::<f64>() / count).sqrt();
        for (k, u) in played.command.iter_mut().enumerate() {
            let noise = Noise {
                seed: self.seed,
                channel: 7,
                sample: k as u64,
            };
            *u += self.command_noise * rms * noise.gaussian();
        }
        let [x, a, f, s] = played.measured;
        let mut columns = vec![
            (Channel::Reference, played.reference),
            (Channel::ValveCommand, played.command),
            (Channel::Displacement, x),
            (Channel::Acceleration, a),
            (Channel::ActuatorForce, f),
        ];
        if self.specimen != OnTable::Nothing {
            columns.push((Channel::SpecimenAcceleration, s));
        }
        Ok(Recording::new(&self.name, self.period, columns)?)
    }
}

/// How far a model's acceleration is from the rig's, both in the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Peak of the rig's, m/s².
    pub peak: f64,
    /// Largest error over the peak.
    pub largest: f64,
    /// Root mean square of the error over the peak.
    pub root_mean_square: f64,
}

/// Plays `test`, without noise, on the rig and on what was `found` of it under `payload` (kg).
///
/// # Errors
/// As [`PhysicalTest::play`].
pub fn prediction(
    found: &Found,
    payload: f64,
    test: &PhysicalTest,
) -> Result<Prediction, ModelError> {
    let test = PhysicalTest {
        noise: 0.0,
        ..test.clone()
    };
    let wanted = test.reference()?;
    let played = test.play(&wanted)?;
    let specimen = found.specimen.as_ref().map(|own| own.specimen);
    let mut model = Simulation::new(found.rig, found.shape, payload, specimen, test.period);
    let mut law = controller();
    let (mut largest, mut square, mut peak) = (0.0f64, 0.0, 0.0f64);
    for (reference, measured) in wanted.iter().zip(&played.measured[1]) {
        let shown = model.shown();
        let input = PidInput {
            reference: *reference,
            measured: shown.displacement,
        };
        model.step(law.step(&input, test.period));
        let error = shown.acceleration - measured;
        largest = largest.max(error.abs());
        square += error * error;
        peak = peak.max(measured.abs());
    }
    Ok(Prediction {
        peak,
        largest: largest / peak,
        root_mean_square: (square / wanted.len().max(1) as f64).sqrt() / peak,
    })
}

/// Plays `test` twice on the rig itself, with sensors whose noise differs: how far the rig is from
/// repeating itself, which no model can be asked to beat in a laboratory.
///
/// # Errors
/// As [`PhysicalTest::play`].
pub fn repetition(test: &PhysicalTest) -> Result<Prediction, ModelError> {
    let wanted = test.reference()?;
    let again = PhysicalTest {
        seed: test.seed + 1000,
        ..test.clone()
    };
    let (first, second) = (test.play(&wanted)?, again.play(&wanted)?);
    let size = |values: &[f64]| values.iter().fold(0.0f64, |peak, a| peak.max(a.abs()));
    let peak = size(&first.acceleration);
    let errors: Vec<f64> = first
        .acceleration
        .iter()
        .zip(&second.acceleration)
        .map(|(a, b)| a - b)
        .collect();
    let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64;
    Ok(Prediction {
        peak,
        largest: size(&errors) / peak,
        root_mean_square: square.sqrt() / peak,
    })
}

/// Two other motions for `test`: noise of its band, and sines of 2 to 20 Hz.
pub fn other_motions(test: &PhysicalTest) -> [PhysicalTest; 2] {
    let noise = PhysicalTest {
        seed: test.seed + 100,
        duration: 20.0,
        ..test.clone()
    };
    let sines = PhysicalTest {
        seed: test.seed + 200,
        lines: Some(60),
        band: (2.0, 20.0),
        ..noise.clone()
    };
    [noise, sines]
}

/// The nine kinds of recordings: each a set of tests of one rig.
pub fn nine_kinds() -> Vec<(&'static str, Vec<PhysicalTest>)> {
    use OnTable::{Linear, Nothing, Yielding};
    let test = |friction: f64, specimen, level, lags, delay, seed| PhysicalTest {
        friction,
        specimen,
        level,
        lags,
        delay,
        seed,
        name: format!("seed {seed}"),
        ..PhysicalTest::default()
    };
    let pair = |friction: f64, level, lags, delay, seed| {
        vec![
            test(friction, Nothing, level, lags, delay, seed),
            PhysicalTest {
                payload: 25.0,
                ..test(friction, Nothing, level, lags, delay, seed + 1)
            },
        ]
    };
    vec![
        (
            "friction, linear specimen, 0.07 g",
            vec![test(1.0, Linear, 0.07, true, 0.0, 11)],
        ),
        (
            "friction, linear specimen, 0.2 g",
            vec![test(1.0, Linear, 0.2, true, 0.0, 12)],
        ),
        (
            "friction, linear specimen, 0.41 g",
            vec![test(1.0, Linear, 0.41, true, 0.0, 13)],
        ),
        (
            "no friction, linear specimen, 0.2 g",
            vec![test(0.0, Linear, 0.2, true, 0.0, 14)],
        ),
        (
            "no friction, no lags, linear specimen, 0.41 g",
            vec![test(0.0, Linear, 0.41, false, 0.0, 15)],
        ),
        (
            "friction, two payloads, 0.2 g",
            pair(1.0, 0.2, true, 0.0, 16),
        ),
        (
            "no friction, two payloads, 0.1 g, no lags",
            pair(0.0, 0.1, false, 0.0, 18),
        ),
        (
            "friction, yielding specimen, 0.41 g",
            vec![test(1.0, Yielding, 0.41, true, 0.0, 20)],
        ),
        (
            "friction, yielding specimen, 0.2 g, one sample late",
            vec![test(1.0, Yielding, 0.2, true, 0.002, 21)],
        ),
    ]
}
