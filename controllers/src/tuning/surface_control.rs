//! Sliding mode down to the valve from a model of the rig, by a stated rule.

use std::f64::consts::TAU;

use nalgebra::{Complex, SVector};
use plant::linear::log_space;
use plant::specimens::linear::LinearSpecimen;

use crate::aids::rig::MAXIMUM_DELAY;
use crate::preview::feedforward::PREVIEW;
use crate::preview::model::STATES;
use crate::robustness::{Heard, LateRig, Pushed};
use crate::surface_control::{Parameters, SurfaceControl, SurfaceInput, Variant};
use crate::{Controller, ModelError, Motion};

/// Largest sensitivity over a receding horizon.
const PEAK_SENSITIVITY: f64 = 2.0;
/// Stiffness that a specimen may have, over that which is known: a fifth either way.
const STIFFNESSES: [f64; 2] = [0.8, 1.25];
/// `lambda` and `K1` that are tried, 1/s.
const RATES: (f64, f64) = (15.0, 90.0);
/// The same over a receding horizon, 1/s.
const HORIZON_RATE: f64 = 20.0;
/// Weights of a move that are tried, m/s per V.
const WEIGHTS: (f64, f64) = (1e-3, 1.0);
/// How long a push is followed, s.
const FOLLOWED: f64 = 4.0;
/// How many of either.
const TRIED: usize = 13;

impl Parameters {
    /// With surfaces of rate `r`: `lambda = K1 = r`, `K2 = 2 r`, `K3 = 4 r`, lags a fifth of what their surface
    /// takes, no shorter than a period.
    #[must_use]
    pub fn with_rate(mut self, rate: f64) -> Self {
        self.surface_rate = rate;
        self.reaching_rates = [rate, 2.0 * rate, 4.0 * rate];
        let [_, oil, spool] = self.reaching_rates;
        self.filter_times = [oil, spool].map(|rate| (0.2 / rate).max(self.period));
        self
    }

    /// By how much (s) the table is late on the rig that the law knows, along a sine of 2 Hz.
    ///
    /// # Errors
    /// What [`SurfaceControl::new`] refuses.
    pub fn lateness(&self) -> Result<f64, ModelError> {
        const OMEGA: f64 = 2.0 * TAU;
        let mut law = SurfaceControl::new(*self)?;
        let mut x = SVector::<f64, STATES>::zeros();
        let rig = self.rig.model().sample(self.period);
        let mut heard = [Motion::default(); MAXIMUM_DELAY + 1];
        let (cycles, last) = (6.0, 2.0);
        let count = (cycles * TAU / OMEGA / self.period).round() as usize;
        let from = (last * TAU / OMEGA / self.period).round() as usize;
        // Displacements too small for any limit.
        let size = 1e-6;
        let mut sum = Complex::new(0.0, 0.0);
        for k in 0..count {
            let y = rig.c * x;
            heard.rotate_right(1);
            heard[0] = Motion {
                displacement: y[0],
                velocity: y[1],
                acceleration: y[2],
            };
            let wanted = |j: usize| {
                let (sin, cos) = (OMEGA * self.period * (k + j) as f64).sin_cos();
                Motion {
                    displacement: size * sin,
                    velocity: size * OMEGA * cos,
                    acceleration: -size * OMEGA * OMEGA * sin,
                }
            };
            let input = SurfaceInput {
                reference: std::array::from_fn(wanted),
                measured: heard[self.rig.delay.min(MAXIMUM_DELAY)],
            };
            let command = law.step(&input, self.period);
            if k >= count - from {
                let phase = OMEGA * self.period * k as f64;
                sum += y[0] * Complex::new(0.0, -phase).exp();
            }
            x = rig.advance(&x, command, [0.0; 2]);
        }
        // A sine is -i exp(i phase) in the mean.
        Ok(-(sum * Complex::i()).arg() / OMEGA)
    }

    /// Largest sensitivity of the law as it runs, bare and under the specimen, its stiffness a fifth off;
    /// infinite where it does not hold the rig.
    ///
    /// # Errors
    /// What [`SurfaceControl::new`] refuses.
    pub fn peak_sensitivity(
        &self,
        late: f64,
        specimen: Option<&LinearSpecimen>,
    ) -> Result<f64, ModelError> {
        let mut law = SurfaceControl::new(*self)?;
        let mut loads = vec![None];
        loads.extend(specimen.iter().flat_map(|specimen| {
            STIFFNESSES.map(|factor| {
                Some(LinearSpecimen {
                    stiffness: factor * specimen.stiffness,
                    ..**specimen
                })
            })
        }));
        let mut most = 0.0_f64;
        for load in loads {
            law.reset();
            let rig = LateRig::new(&self.rig.state_space(load.as_ref()), late, self.period)?;
            let mut command = |heard: &Heard| {
                let input = SurfaceInput {
                    reference: [Motion::default(); PREVIEW + 1],
                    measured: heard.motion,
                };
                law.step(&input, self.period)
            };
            let run = Pushed::new(&rig, &mut command, FOLLOWED);
            if !run.is_stable() {
                return Ok(f64::INFINITY);
            }
            most = most.max(run.open_loop(1.0).peak_sensitivity());
        }
        Ok(most)
    }

    /// Tuned for measurements `late` (s), bare and under the specimen, on the sensitivity of the law as it runs:
    ///
    /// - surfaces: of 13 rates from 15 to 90 1/s the one with the smallest; the motion that they follow is
    ///   ahead by what they are late;
    /// - receding horizon: rate 20 1/s, of 13 weights of a move from 0.001 to 1 the lightest that keeps it below 2.
    ///
    /// # Errors
    /// What [`SurfaceControl::new`] refuses; a rig that no such law holds.
    pub fn tuned(self, late: f64, specimen: Option<&LinearSpecimen>) -> Result<Self, ModelError> {
        let none = |reason: &str| ModelError::NoSolution {
            equation: "the rule for sliding mode down to the valve",
            reason: reason.into(),
        };
        if self.variant == Variant::RecedingHorizon {
            for weight in log_space(WEIGHTS.0, WEIGHTS.1, TRIED) {
                let mut own = self.with_rate(HORIZON_RATE);
                own.move_weight = weight;
                if own.peak_sensitivity(late, specimen)? <= PEAK_SENSITIVITY {
                    return Ok(own);
                }
            }
            return Err(none("no move weight keeps the sensitivity below 2"));
        }
        let mut best: Option<(f64, Self)> = None;
        for rate in log_space(RATES.0, RATES.1, TRIED) {
            let own = self.with_rate(rate);
            let peak = own.peak_sensitivity(late, specimen)?;
            if peak.is_finite() && best.as_ref().is_none_or(|(least, _)| peak < *least) {
                best = Some((peak, own));
            }
        }
        let Some((_, mut tuned)) = best else {
            return Err(none("no surface rate from 15 to 90 1/s stabilises the rig"));
        };
        let samples = (tuned.lateness()? / tuned.period).round();
        tuned.lead = samples.clamp(0.0, PREVIEW as f64) as usize;
        Ok(tuned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aids::rig::KnownRig;
    use plant::servo_hydraulic::ServoHydraulicTable;

    #[test]
    fn the_rule_is_met_and_a_law_twice_as_quick_misses_it() {
        let specimen = LinearSpecimen {
            mass: 45.0,
            damping: 57.0,
            stiffness: 7100.0,
        };
        for variant in [
            Variant::MultipleSurface,
            Variant::DynamicSurface,
            Variant::RecedingHorizon,
        ] {
            let own = Parameters {
                variant,
                rig: KnownRig {
                    table: ServoHydraulicTable::default().table,
                    delay: 1,
                    ..KnownRig::default()
                },
                ..Parameters::default()
            };
            let tuned = own.tuned(0.002, Some(&specimen)).unwrap();
            let peak = |own: &Parameters| own.peak_sensitivity(0.002, Some(&specimen)).unwrap();
            let quick = peak(&tuned.with_rate(2.0 * tuned.surface_rate));
            let got = peak(&tuned);
            println!(
                "{variant:?}: {} 1/s, weight {}, {} samples ahead: {got}, {quick}",
                tuned.surface_rate, tuned.move_weight, tuned.lead
            );
            assert!(got <= 2.0 && quick > got);
            // The lead takes the lateness off to half a sample.
            if variant != Variant::RecedingHorizon {
                assert!(tuned.lateness().unwrap().abs() <= 0.51 * tuned.period);
            }
        }
    }
}
