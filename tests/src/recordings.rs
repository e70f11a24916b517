//! Recordings of the identified rig under three-variable control, with seeded noise.

use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion};
use identification::data::{Channel, Recording, mean_and_deviation};
use nalgebra::dvector;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A test on the rig.
#[derive(Clone, Copy)]
pub struct Test {
    /// Table and actuator.
    pub shake_table: ShakeTable,
    /// Mass bolted to the table, kg.
    pub payload: f64,
    /// The specimen.
    pub specimen: Option<LinearSpecimen>,
    /// Length, s.
    pub duration: f64,
    /// Noise of each channel over its root mean square.
    pub noise: f64,
    /// Band of the reference, Hz.
    pub band: (f64, f64),
    /// Seed of reference and noise.
    pub seed: u64,
    /// Time by which the command acts late, s.
    pub delay: f64,
}

impl Default for Test {
    fn default() -> Self {
        Self {
            shake_table: ShakeTable::default(),
            payload: 0.0,
            specimen: Some(LinearSpecimen::appendix_a()),
            duration: 60.0,
            noise: 0.01,
            band: (0.02, 30.0),
            seed: 1,
            delay: 0.0,
        }
    }
}

/// Between samples, s.
pub const PERIOD: f64 = 0.002;
/// Rows of the rig's outputs: displacement, velocity, acceleration, force, specimen acceleration.
const ROWS: [usize; 5] = [0, 1, 2, 3, 6];

impl Test {
    /// Plays the test: once without noise to learn the size of each channel, then with it. The
    /// law is fed the noisy measurements.
    pub fn record(&self) -> Recording {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let reference = reference(self.duration, self.band, &mut random);
        let clean = self.play(&reference, [0.0; 5], &mut random);
        let size: Vec<f64> = clean.iter().map(|c| mean_and_deviation(c).1).collect();
        let noise = [1, 2, 3, 4, 5].map(|i| self.noise * size[i]);
        let mut channels = self.play(&reference, noise, &mut random);
        let names = [
            Channel::ValveCommand,
            Channel::Displacement,
            Channel::Velocity,
            Channel::Acceleration,
            Channel::ActuatorForce,
            Channel::SpecimenAcceleration,
        ];
        let sensed = |channel: Channel| match channel {
            Channel::Velocity => false,
            Channel::SpecimenAcceleration => self.specimen.is_some(),
            _ => true,
        };
        let mut columns: Vec<(Channel, Vec<f64>)> = names
            .into_iter()
            .zip(channels.drain(..))
            .filter(|(channel, _)| sensed(*channel))
            .collect();
        let wanted = reference.iter().map(|r| r.displacement).collect();
        columns.push((Channel::Reference, wanted));
        Recording::new(&format!("test {}", self.seed), PERIOD, columns).unwrap()
    }

    fn play(
        &self,
        reference: &[Motion],
        noise: [f64; 5],
        random: &mut ChaCha8Rng,
    ) -> Vec<Vec<f64>> {
        let mut shake_table = self.shake_table;
        shake_table.table.mass += self.payload;
        let rig = Rig {
            shake_table,
            specimen: self.specimen,
        };
        // Of each sample the first part is still under the command before.
        let whole = (self.delay / PERIOD + 1e-9).floor();
        let part = (self.delay - whole * PERIOD).max(0.0);
        let early = rig.state_space().sample(part);
        let system = rig.state_space().sample(PERIOD - part);
        let mut state = nalgebra::DVector::zeros(7);
        let mut law = ThreeVariableControl::table_3_2();
        let mut recorded = vec![Vec::new(); 6];
        let (mut velocity, mut before) = (0.0, 0.0);
        for wanted in reference {
            let outputs = &system.c * &state;
            let draw: [f64; 5] = std::array::from_fn(|_| StandardNormal.sample(random));
            let mut measured = [0.0; 5];
            for i in 0..5 {
                measured[i] = outputs[ROWS[i]] + noise[i] * draw[i];
            }
            velocity += 0.25 * ((measured[0] - before) / PERIOD - velocity);
            before = measured[0];
            let input = ThreeVariableInput {
                reference: *wanted,
                measured: Motion {
                    displacement: measured[0],
                    velocity,
                    acceleration: measured[2],
                },
            };
            let command = law.step(&input, PERIOD);
            recorded[0].push(command);
            for i in 0..5 {
                recorded[i + 1].push(measured[i]);
            }
            let latest = recorded[0].len() - 1;
            let acting = |late: usize| dvector![recorded[0][latest.saturating_sub(late)]];
            if part > 0.0 {
                state = early.advance(&state, &acting(whole as usize + 1));
            }
            state = system.advance(&state, &acting(whole as usize));
        }
        recorded
    }
}

/// A multisine of random phases: displacement flat to 0.5 Hz, falling with the square above, of
/// 0.3 in root mean square.
fn reference(duration: f64, band: (f64, f64), random: &mut ChaCha8Rng) -> Vec<Motion> {
    let count = (duration / PERIOD).round() as usize;
    let mut motion = vec![Motion::default(); count];
    let lines = 150;
    let ratio = (band.1 / band.0).powf(1.0 / f64::from(lines - 1));
    let shape = |f: f64| 1.0 / (1.0 + (f / 0.5).powi(2));
    let frequencies: Vec<f64> = (0..lines).map(|i| band.0 * ratio.powi(i)).collect();
    let power: f64 = frequencies.iter().map(|f| 0.5 * shape(*f).powi(2)).sum();
    let scale = 0.3 * 0.0254 / power.sqrt();
    for f in frequencies {
        let (omega, amplitude) = (std::f64::consts::TAU * f, scale * shape(f));
        let phase = random.random_range(0.0..std::f64::consts::TAU);
        for (k, motion) in motion.iter_mut().enumerate() {
            let (sin, cos) = (omega * k as f64 * PERIOD + phase).sin_cos();
            motion.displacement += amplitude * sin;
            motion.velocity += amplitude * omega * cos;
            motion.acceleration -= amplitude * omega * omega * sin;
        }
    }
    // The table starts at rest: fade in over a second.
    for k in 0..count.min(500) {
        let t = k as f64 / 500.0;
        let fade = t * t * (3.0 - 2.0 * t);
        motion[k].displacement *= fade;
        motion[k].velocity *= fade;
        motion[k].acceleration *= fade;
    }
    motion
}

/// A recording as the file that `shakebench identify` reads.
pub fn csv(recording: &Recording) -> String {
    let mut text = String::from("time [s]");
    for (channel, _) in recording.channels() {
        text += &format!(",{} [{}]", channel.name(), channel.unit());
    }
    for k in 0..recording.len() {
        text += &format!("\n{:.3}", recording.time_at(k));
        for (_, values) in recording.channels() {
            text += &format!(",{:.8e}", values[k]);
        }
    }
    text + "\n"
}
