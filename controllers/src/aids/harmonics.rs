//! Amplitude and phase control and adaptive harmonic cancellation for sines, as laboratory controllers have
//! them; methods for electrohydraulic tables are reviewed in doi:10.1177/1729881416662537 (2016).

use std::f64::consts::TAU;

use nalgebra::Complex;
use units::Parameters;

use super::rig::KnownRig;
use crate::{ModelError, Motion};

/// Most harmonics, the fundamental among them.
pub const HARMONICS: usize = 9;
/// Highest frequency at which one is added, rad/s.
const HIGHEST: f64 = 60.0 * TAU;
/// Smallest wanted acceleration, m/s².
const SMALLEST: f64 = 0.02;
/// Part of the wanted motion that has to be its fundamental.
const SINE: f64 = 0.95;
/// Part of the fundamental that a change must have made for what it did to be believed.
const BELIEVED: f64 = 0.005;

type Phasor = [f64; 2];

/// `u = Re sum_k w_k exp(i k phi)`, `phi` the phase of the wanted sine. From epoch to epoch of whole cycles
/// `w_k -= gain E_k/H_k`: `E_k` is the harmonic of the measured acceleration less the wanted one, `H_k` what
/// the acceleration does of the valve command at that frequency, from the model at first and then from
/// what the changes did, so that it is that of the loop which the controller closes.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct HarmonicControl {
    /// Whether the fundamental's amplitude and phase are controlled.
    pub fundamental: bool,
    /// Whether the harmonics above it are cancelled.
    pub cancellation: bool,
    /// Sines: part of an error that is taken off at once.
    #[parameter(name = "harmonic_gain", finite)]
    pub gain: f64,
    /// Sines: cycles of an epoch that are not measured.
    #[parameter(min = 0.0)]
    pub settling_cycles: i32,
    /// Sines: cycles that are.
    #[parameter(min = 1.0)]
    pub measured_cycles: i32,
    /// What the law remembers.
    pub memory: HarmonicMemory,
}

/// What was measured over the latest epoch.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Harmonics {
    /// Total harmonic distortion of the measured acceleration, harmonics 2 to 9 over the fundamental.
    pub distortion: f64,
    /// Amplitude of its fundamental over the wanted one.
    pub amplitude_ratio: f64,
    /// By which it is late, rad.
    pub phase_lag: f64,
}

/// Memory of [`HarmonicControl`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct HarmonicMemory {
    /// What was measured over the latest epoch.
    pub measured: Harmonics,
    /// `w_k`, V.
    weights: [Phasor; HARMONICS],
    /// `H_k`, m/s² per V; zero where the model's counts.
    responses: [Phasor; HARMONICS],
    /// Errors of the epoch before, m/s².
    errors: [Phasor; HARMONICS],
    /// Changes of the weights since, V.
    changes: [Phasor; HARMONICS],
    /// Sums over the epoch: the measured acceleration's harmonics.
    sums: [Phasor; HARMONICS],
    /// The wanted acceleration's fundamental.
    wanted: Phasor,
    /// Squares of wanted acceleration and velocity over the epoch.
    squares: [f64; 2],
    /// Samples in the sums.
    samples: f64,
    cycles: i32,
    /// Wanted velocity at the sample before, m/s.
    velocity: f64,
    /// Angular frequency, rad/s; zero before it is known.
    omega: f64,
    saturated: bool,
}

impl Default for HarmonicControl {
    /// Off.
    fn default() -> Self {
        Self {
            fundamental: false,
            cancellation: false,
            gain: 0.7,
            settling_cycles: 2,
            measured_cycles: 4,
            memory: HarmonicMemory::default(),
        }
    }
}

fn complex([re, im]: Phasor) -> Complex<f64> {
    Complex::new(re, im)
}

fn phasor(value: Complex<f64>) -> Phasor {
    [value.re, value.im]
}

fn add(to: &mut Phasor, value: Complex<f64>) {
    to[0] += value.re;
    to[1] += value.im;
}

/// `exp(i phi)` of the wanted sine of angular frequency `omega` (rad/s), `d = D cos phi`; none before that is
/// known or at rest.
fn phase(reference: &Motion, omega: f64) -> Option<Complex<f64>> {
    let turn = Complex::new(-reference.acceleration, -omega * reference.velocity);
    let size = turn.norm();
    (omega > 0.0 && size > 1e-9).then(|| turn / size)
}

impl HarmonicControl {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first with which nothing would converge.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("harmonic_gain", self.gain)?;
        let cycles = [
            ("settling_cycles", self.settling_cycles, 0),
            ("measured_cycles", self.measured_cycles, 1),
        ];
        for (name, value, least) in cycles {
            if value < least {
                return Err(ModelError::Parameter {
                    name,
                    value: f64::from(value),
                    expected: "a number from 0 up, and at least one measured cycle",
                });
            }
        }
        if self.gain >= 2.0 {
            return Err(ModelError::Parameter {
                name: "harmonic_gain",
                value: self.gain,
                expected: "less than 2, above which the errors diverge",
            });
        }
        Ok(())
    }

    /// Whether it does anything.
    pub fn is_on(&self) -> bool {
        self.fundamental || self.cancellation
    }

    /// What is added to the valve command of this sample, V; `saturated` says whether the command before met
    /// its limit: nothing is learnt then.
    pub fn step(
        &mut self,
        reference: &Motion,
        measured: f64,
        saturated: bool,
        rig: &KnownRig,
        period: f64,
    ) -> f64 {
        self.memory.saturated |= saturated;
        let (before, now) = (self.memory.velocity, reference.velocity);
        self.memory.velocity = now;
        if before < 0.0 && now >= 0.0 {
            // A cycle ends between two samples: each side gets its part.
            let part = now / (now - before);
            self.take(reference, measured, 1.0 - part);
            self.end_cycle(rig, period);
            self.take(reference, measured, part);
        } else {
            self.take(reference, measured, 1.0);
        }
        let memory = &self.memory;
        let Some(turn) = phase(reference, memory.omega) else {
            return 0.0;
        };
        let mut power = turn;
        let mut command = 0.0;
        for weight in &memory.weights {
            command += (complex(*weight) * power).re;
            power *= turn;
        }
        command
    }

    /// Adds a sample, or a part of one, to the sums of the epoch.
    fn take(&mut self, reference: &Motion, measured: f64, part: f64) {
        let memory = &mut self.memory;
        memory.squares[0] += part * reference.acceleration.powi(2);
        memory.squares[1] += part * reference.velocity.powi(2);
        let Some(turn) = phase(reference, memory.omega) else {
            return;
        };
        memory.samples += part;
        let back = turn.conj();
        add(&mut memory.wanted, back * (part * reference.acceleration));
        let mut power = back * part;
        for sum in &mut memory.sums {
            add(sum, power * measured);
            power *= back;
        }
    }

    /// At the end of a cycle: of the first, of those that settle, of an epoch.
    fn end_cycle(&mut self, rig: &KnownRig, period: f64) {
        let all = self.settling_cycles + self.measured_cycles;
        let memory = &mut self.memory;
        memory.cycles += 1;
        let is_first = memory.omega == 0.0;
        let is_last = memory.cycles >= all;
        if !is_first && !is_last && memory.cycles != self.settling_cycles {
            return;
        }
        let [acceleration, velocity] = memory.squares;
        if velocity > 0.0 {
            memory.omega = (acceleration / velocity).sqrt();
        }
        if is_last && !is_first {
            self.learn(rig, period);
        }
        let memory = &mut self.memory;
        if is_last || is_first {
            memory.cycles = 0;
            memory.saturated = false;
        }
        memory.sums = Default::default();
        memory.wanted = Phasor::default();
        memory.squares = [0.0; 2];
        memory.samples = 0.0;
    }

    /// Takes the errors of an epoch off.
    fn learn(&mut self, rig: &KnownRig, period: f64) {
        let memory = &mut self.memory;
        let scale = 2.0 / memory.samples.max(1.0);
        let wanted = complex(memory.wanted) * scale;
        // Mean square of a sine is half the square of its amplitude.
        let mean = 0.5 * scale * memory.squares[0];
        if wanted.norm() < SMALLEST || 0.5 * wanted.norm_sqr() < SINE * mean {
            return;
        }
        let late = rig.delay as f64 * period;
        // Harmonics at the time at which the table moved.
        let found: [Complex<f64>; HARMONICS] = std::array::from_fn(|k| {
            let omega = (k + 1) as f64 * memory.omega;
            complex(memory.sums[k]) * scale * Complex::new(0.0, omega * late).exp()
        });
        let upper: f64 = found[1..].iter().map(|own| own.norm_sqr()).sum();
        let ratio = found[0] / wanted;
        memory.measured = Harmonics {
            distortion: upper.sqrt() / found[0].norm(),
            amplitude_ratio: ratio.norm(),
            phase_lag: -ratio.arg(),
        };
        if memory.saturated {
            memory.changes = Default::default();
            return;
        }
        for (k, own) in found.into_iter().enumerate() {
            let omega = (k + 1) as f64 * memory.omega;
            let is_controlled = if k == 0 {
                self.fundamental
            } else {
                self.cancellation
            };
            if !is_controlled || omega > HIGHEST {
                continue;
            }
            let error = if k == 0 { own - wanted } else { own };
            let mut response = complex(memory.responses[k]);
            if response.norm() == 0.0 {
                response = rig.acceleration_response(omega, 0.5 * period);
            }
            let change = complex(memory.changes[k]);
            if (change * response).norm() > BELIEVED * wanted.norm() {
                let shown = (error - complex(memory.errors[k])) / change;
                if (0.1..10.0).contains(&(shown / response).norm()) {
                    response = shown;
                }
            }
            let change = -self.gain * error / response;
            add(&mut memory.weights[k], change);
            memory.responses[k] = phasor(response);
            memory.errors[k] = phasor(error);
            memory.changes[k] = phasor(change);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table that answers with a known complex gain a harmonic and adds harmonics of its own: the law
    /// has to find weights of closed form, though the model that it starts from is not the table's.
    #[test]
    fn the_weights_become_those_that_cancel() {
        let (omega, period) = (2.0 * TAU, 0.002);
        let rig = KnownRig::default();
        let wanted = 2.0;
        let gains = [(0.4, -1.0), (0.7, -1.4), (1.8, 0.6)]
            .map(|(size, turn): (f64, f64)| Complex::from_polar(size, turn));
        let model = |k: usize| rig.acceleration_response((k + 1) as f64 * omega, 0.5 * period);
        let own = [
            Complex::new(1.5, 0.7),
            Complex::new(0.1, -0.2),
            Complex::new(-0.15, 0.05),
        ];
        let mut law = HarmonicControl {
            fundamental: true,
            cancellation: true,
            ..HarmonicControl::default()
        };
        let mut first = 0.0;
        for n in 0..40_000 {
            let phase = omega * period * f64::from(n);
            let reference = Motion {
                displacement: -wanted / omega.powi(2) * phase.cos(),
                velocity: wanted / omega * phase.sin(),
                acceleration: wanted * phase.cos(),
            };
            // phi, for which d = D cos phi.
            let phi = phase + 0.5 * TAU;
            let measured: f64 = (0..3)
                .map(|k| {
                    let answer = own[k] + gains[k] * model(k) * complex(law.memory.weights[k]);
                    (answer * Complex::new(0.0, (k + 1) as f64 * phi).exp()).re
                })
                .sum();
            law.step(&reference, measured, false, &rig, period);
            if first == 0.0 {
                first = law.memory.measured.distortion;
            }
        }
        let last = law.memory.measured;
        println!("{first} to {last:?}");
        assert!(first > 0.1 && last.distortion < 1e-5);
        assert!((last.amplitude_ratio - 1.0).abs() < 1e-5 && last.phase_lag.abs() < 1e-5);
        for k in 0..3 {
            let target = if k == 0 {
                Complex::new(-wanted, 0.0)
            } else {
                Complex::new(0.0, 0.0)
            };
            // The wanted acceleration is opposite to the displacement.
            let expected = (target - own[k]) / (gains[k] * model(k));
            let got = complex(law.memory.weights[k]);
            assert!(
                (got - expected).norm() < 1e-3 * expected.norm(),
                "{k}: {got} {expected}"
            );
        }
    }

    #[test]
    fn an_earthquake_is_let_be() {
        let rig = KnownRig::default();
        let mut law = HarmonicControl {
            fundamental: true,
            cancellation: true,
            ..HarmonicControl::default()
        };
        for n in 0..20_000 {
            let t = 0.002 * f64::from(n);
            let parts = [(3.0, 1.0), (7.7, 1.3), (17.1, 0.9), (29.3, 1.1)];
            let sum = |by: i32, shift: f64| -> f64 {
                parts
                    .iter()
                    .map(|(w, a): &(f64, f64)| a * w.powi(by) * (w * t + shift).sin())
                    .sum()
            };
            let reference = Motion {
                displacement: -sum(-2, 0.0),
                velocity: -sum(-1, 0.25 * TAU),
                acceleration: sum(0, 0.0),
            };
            let command = law.step(&reference, 1.2 * reference.acceleration, false, &rig, 0.002);
            assert_eq!(command, 0.0);
        }
    }
}
