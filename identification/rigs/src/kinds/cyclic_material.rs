//! Cyclically strained metal: strain to stress.
//!
//! Nominal: `σ' = E (ε' - ε_p')`, yield at `|σ - Σα| = σ_y + R`, `α_i' = C_i ε_p' - γ_i α_i |ε_p'|`
//! with one backstress (Armstrong and Frederick 1966; Chaboche, Int. J. Plasticity 2, 1986).
//!
//! The strain may be sampled so coarsely that turns lie between two samples. It then ran on, either to
//! the `strain_amplitude` of the whole test where that is known, or as far as the share `turn_speed`
//! of the steps between neighbouring samples leaves room: a strain that keeps its speed (1) covers
//! between two samples what it covers before and behind, there and back. With both at zero the samples
//! are all there is.

use super::between::between;
use super::table::{effects, nominal_parameters, shape, size};
use super::{Equations, RigRecording};
use recordings::Channel;

/// The rig.
pub struct CyclicMaterial;

const STRAIN: Channel = Channel::Other {
    name: "strain",
    unit: "1",
};
const STRESS: Channel = Channel::Other {
    name: "stress",
    unit: "Pa",
};

/// Strain of one substep.
const SUBSTEP: f64 = 5e-5;

nominal_parameters! {
    /// E: Young's.
    modulus: "Pa",
    /// σ_y: at first yield.
    yield_stress: "Pa",
    /// C: of the backstress.
    hardening: "Pa",
    /// γ: of the backstress.
    recovery: "1",
    /// Of the test where turns lie between samples; 0 where the samples are all there is.
    strain_amplitude: "1" = 0.0,
    /// Share of its speed that the strain keeps where it turns; 0 where no turn lies between samples.
    turn_speed: "1" = 0.0,
    /// What the load cell reads without a force, as a stress.
    load_cell_zero: "Pa" = 0.0,
}

effects! {
    /// Another backstress.
    second_backstress: SecondBackstress {
        hardening: size("Pa", 1e8, (0.0, 1e12)),
        recovery: shape("1", 200.0, 1.2),
    } from [[1e9, 20.0], [1e10, 200.0], [5e10, 1000.0]];
    /// A third one that hardly recovers.
    lasting_backstress: LastingBackstress {
        hardening: size("Pa", 1e8, (0.0, 1e12)),
        recovery: shape("1", 5.0, 0.5),
    } from [[1e9, 5.0]];
    /// R = Q (1 - e^{-b p}), p the plastic path (Voce 1948).
    isotropic_hardening: IsotropicHardening {
        saturation: size("Pa", 5e6, (-3e8, 1e9)),
        rate: shape("1", 10.0, 1.0),
    } from [[5e7, 10.0], [-3e7, 10.0]], like ["lasting_hardening"];
    /// R goes on with the plastic path, H p, where the first term is full (Voce 1948 as
    /// extended by Palm, Trans. ASME 71, 1949).
    lasting_hardening: LastingHardening {
        slope: size("Pa", 3e6, (-1e9, 1e9)),
    } from [[1e7], [-1e7]], like ["isotropic_hardening"];
    /// Yield plateau: a further R that falls within the first strain (Q < 0).
    initial_softening: InitialSoftening {
        drop: size("Pa", 5e6, (0.0, 4e8)),
        rate: shape("1", 200.0, 0.7),
    } from [[5e7, 200.0], [1e8, 300.0]];
    /// E = E_0 (1 - s (1 - e^{-ξ p})) (Yoshida, Uemori and Fujiwara, Int. J. Plasticity 18,
    /// 2002).
    modulus_degradation: ModulusDegradation {
        share: size("1", 0.02, (-1.0, 0.9)),
        rate: shape("1", 20.0, 1.0),
    } from [[0.1, 20.0], [-0.1, 20.0]];
    /// The load cell reads that much without a stress.
    load_cell_zero: LoadCellZero {
        zero: size("Pa", 2e6, (-2e8, 2e8)),
    } from [[1e7], [-1e7]], like ["strength_differential"];
    /// Compression yields at (1 + a) of tension.
    strength_differential: StrengthDifferential {
        asymmetry: size("1", 0.01, (-0.5, 0.5)),
    } from [[0.02], [-0.02]], like ["load_cell_zero"];
    /// A frame of compliance C between grips and drive: it is ε + C σ that runs evenly between
    /// two readings, not the strain (Lemaitre and Chaboche, Mechanics of Solid Materials,
    /// 1990, section 3.2). It tells where interpolated samples of the strain were.
    frame_compliance: FrameCompliance {
        compliance: size("1/Pa", 5e-13, (0.0, 1e-10)),
    } from [[2e-12], [8e-12]];
    /// Stress recorded late by a part of a sample, or strain.
    stress_late: StressLate {
        samples: size("1", 0.05, (-2.0, 2.0)),
    } from [[0.3], [-0.3]];
}

impl Equations for CyclicMaterial {
    const KIND: &'static str = "cyclic_material";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = ();
    const INPUTS: &'static [Channel] = &[STRAIN];
    const OUTPUT: Channel = STRESS;
    const IS_HYSTERETIC: bool = true;
    const IS_PATH: bool = true;
    const SAID_BY: &'static [(&'static str, &'static str)] =
        &[("load_cell_zero", "load_cell_zero")];
    const CAUSES: &'static [&'static str] = &["load_cell_zero"];

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        (): &(),
        out: &mut [f64],
    ) {
        let Nominal {
            modulus,
            yield_stress,
            hardening,
            recovery,
            strain_amplitude: amplitude,
            turn_speed,
            load_cell_zero: stated_zero,
        } = *nominal;
        let Effects {
            second_backstress: second,
            lasting_backstress: third,
            isotropic_hardening: IsotropicHardening { saturation, rate },
            lasting_hardening: LastingHardening { slope: lasting },
            initial_softening:
                InitialSoftening {
                    drop,
                    rate: drop_rate,
                },
            modulus_degradation:
                ModulusDegradation {
                    share: degradation,
                    rate: degradation_rate,
                },
            strength_differential:
                StrengthDifferential {
                    asymmetry: differential,
                },
            frame_compliance: FrameCompliance { compliance },
            stress_late: StressLate { samples: late },
            load_cell_zero: LoadCellZero { zero },
        } = *effects;
        let strain = recording.input(STRAIN);
        let Some(&first) = strain.first() else { return };
        let mut state = Steel {
            modulus,
            yield_stress,
            backstresses: [
                (hardening, recovery),
                (second.hardening, second.recovery),
                (third.hardening, third.recovery),
            ],
            isotropic: [(saturation, rate), (-drop, drop_rate)],
            lasting,
            degradation: (degradation, degradation_rate),
            differential,
            stress: 0.0,
            back: [0.0; 3],
            path: 0.0,
        };
        let last = strain.len().min(out.len()).saturating_sub(1);
        let mut now = first;
        let mut direction = 0.0f64;
        let mut stride = 0.0;
        let mut k = 0;
        while k <= last {
            // Where the strain was interpolated, only the reading behind it is known.
            let interpolated = recording.between.get(k) == Some(&true) && k < last;
            let reading = if interpolated { k + 1 } else { k };
            let next = strain[reading];
            if next != now {
                let turn = (next - now).signum();
                let peak = if amplitude > 0.0 {
                    direction * amplitude
                } else {
                    // There and back is the path of neighbouring steps, if less of it.
                    let behind = strain.get(reading + 1).map_or(0.0, |s| (s - next).abs());
                    let behind = if interpolated {
                        strain.get(reading + 2).map_or(behind, |s| (s - next).abs())
                    } else {
                        behind
                    };
                    let path = turn_speed * 0.5 * (stride + behind);
                    now + direction * 0.5 * (path - (next - now).abs()).max(0.0)
                };
                // Only a sample near the amplitude is a turn of the test.
                let missed = turn * direction < 0.0
                    && (peak - now) * direction > 0.0
                    && now * direction > 0.5 * amplitude;
                stride = (next - now).abs();
                let legs = [if missed { peak } else { now }, next];
                if interpolated {
                    let path = if compliance == 0.0 {
                        (legs[0] - now).abs() + (legs[1] - legs[0]).abs()
                    } else {
                        let mut ahead = state;
                        ahead.walk(now, legs, compliance, f64::INFINITY).0
                    };
                    out[k] = state.walk(now, legs, compliance, 0.5 * path).1;
                } else {
                    for leg in legs {
                        state.strain_by(leg - now);
                        now = leg;
                    }
                }
                direction = turn;
                now = next;
            }
            out[reading] = state.stress;
            k = reading + 1;
        }
        if late != 0.0 {
            let shown = out.to_vec();
            for (k, stress) in out.iter_mut().enumerate() {
                *stress = between(&shown, k as f64 - late);
            }
        }
        for stress in out.iter_mut() {
            *stress += stated_zero + zero;
        }
    }
}

#[derive(Clone, Copy)]
struct Steel {
    modulus: f64,
    yield_stress: f64,
    backstresses: [(f64, f64); 3],
    isotropic: [(f64, f64); 2],
    lasting: f64,
    degradation: (f64, f64),
    differential: f64,
    stress: f64,
    back: [f64; 3],
    path: f64,
}

impl Steel {
    fn strain_by(&mut self, total: f64) {
        let count = (total.abs() / SUBSTEP).ceil().clamp(1.0, 1e5);
        let step = total / count;
        for _ in 0..count as usize {
            self.step(step);
        }
    }

    /// Strains along `legs` from `now`: length of the path of `ε + C σ`, and the stress at `place`
    /// on it.
    fn walk(&mut self, now: f64, legs: [f64; 2], compliance: f64, place: f64) -> (f64, f64) {
        let (mut path, mut from, mut shown) = (0.0, now, None);
        for leg in legs {
            let count = ((leg - from).abs() / SUBSTEP).ceil().min(1e4);
            let strain = (leg - from) / count.max(1.0);
            for _ in 0..count as usize {
                let before = self.stress;
                self.step(strain);
                let moved = (strain + compliance * (self.stress - before)).abs();
                if shown.is_none() && path + moved >= place {
                    shown = Some(before + (place - path) / moved * (self.stress - before));
                }
                path += moved;
            }
            from = leg;
        }
        (path, shown.unwrap_or(self.stress))
    }

    fn step(&mut self, strain: f64) {
        let (share, share_rate) = self.degradation;
        let mut modulus = self.modulus;
        if share != 0.0 {
            modulus *= 1.0 - share * (1.0 - (-share_rate * self.path).exp());
        }
        let back: f64 = self.back.iter().sum();
        let trial = self.stress + modulus * strain;
        let side = (trial - back).signum();
        let mut radius = self.yield_stress + self.lasting * self.path;
        let mut slope = self.lasting;
        // What is off costs nothing.
        for (limit, rate) in self
            .isotropic
            .into_iter()
            .filter(|(limit, _)| *limit != 0.0)
        {
            let left = (-rate * self.path).exp();
            radius += limit * (1.0 - left);
            slope += limit * rate * left;
        }
        if side < 0.0 {
            radius *= 1.0 + self.differential;
        }
        let over = side * (trial - back) - radius.max(0.02 * self.yield_stress);
        if over <= 0.0 {
            self.stress = trial;
            return;
        }
        for ((c, g), a) in self.backstresses.iter().zip(&self.back) {
            slope += c - g * a * side;
        }
        let plastic = over / (modulus + slope.max(-0.5 * modulus));
        let parts = self.backstresses.iter().zip(&mut self.back);
        for ((c, g), a) in parts.filter(|((c, _), _)| *c != 0.0) {
            // Exact for a constant direction of flow.
            let left = (-g * plastic).exp();
            *a = *a * left + side * c / g * (1.0 - left);
        }
        self.path += plastic;
        self.stress = trial - side * modulus * plastic;
    }
}

#[cfg(test)]
mod tests {
    use super::super::EffectTable;
    use super::*;
    use recordings::Recording;

    fn stress(strain: &[f64], amplitude: f64, compliance: f64) -> Vec<f64> {
        let effects = Effects {
            frame_compliance: FrameCompliance { compliance },
            ..Effects::off().unwrap()
        };
        stress_with(strain, amplitude, effects, 0.0)
    }

    fn stress_with(strain: &[f64], amplitude: f64, effects: Effects, zero: f64) -> Vec<f64> {
        let channels = vec![(STRAIN, strain.to_vec()), (STRESS, vec![0.0; strain.len()])];
        let recording = Recording::new("path", 1.0, channels).unwrap();
        let recording = RigRecording::new(recording, CyclicMaterial::INPUTS, STRESS);
        // Perfectly plastic at 400 MPa.
        let nominal = Nominal {
            modulus: 2e11,
            yield_stress: 4e8,
            hardening: 0.0,
            recovery: 1.0,
            strain_amplitude: amplitude,
            turn_speed: 0.0,
            load_cell_zero: zero,
        };
        let mut out = vec![0.0; strain.len()];
        CyclicMaterial.simulate(&recording, &nominal, &effects, &(), &mut out);
        out
    }

    #[test]
    fn a_turn_between_readings_reaches_the_amplitude_and_its_sample_lies_half_way() {
        // From 1.95 % on to 2 % and back to 1.8 %: half of that path is 0.075 % behind the turn.
        let strain = [0.0, 0.0195, 0.01875, 0.018];
        let out = stress(&strain, 0.02, 0.0);
        assert!((out[1] - 4e8).abs() < 1.0);
        assert!((out[2] - (4e8 - 2e11 * 7.5e-4)).abs() < 1e6, "{}", out[2]);
        assert!(out[3].abs() < 1e6, "{}", out[3]);
        // Without a known amplitude the readings are all there is.
        let plain = stress(&strain, 0.0, 0.0);
        assert!((plain[3] - 1e8).abs() < 1e6, "{}", plain[3]);
    }

    #[test]
    fn a_load_cell_s_zero_is_in_every_reading_and_yields_nothing() {
        for stated in [0.0, -3e7, 1e7] {
            let effects = Effects {
                load_cell_zero: LoadCellZero {
                    zero: -3e7 - stated,
                },
                ..Effects::off().unwrap()
            };
            // Elastic, at yield, and back without a strain.
            let out = stress_with(&[0.0, 0.001, 0.01, 0.0], 0.0, effects, stated);
            for (found, expected) in out.into_iter().zip([-3e7, 1.7e8, 3.7e8, -4.3e8]) {
                assert!((found - expected).abs() < 1.0, "{found} {expected}");
            }
        }
    }

    #[test]
    fn a_compliant_frame_moves_the_sample_that_was_interpolated() {
        // Back from 4e8 Pa by 0.4 % strain to -4e8 Pa at 0.4 %, then 0.2 % of plastic strain. With
        // compliance C the path is 0.004 + C 8e8 Pa, then 0.002; its half lies in the elastic leg.
        let strain = [0.0, 0.018, 0.015, 0.012];
        let [stiff, soft] = [0.0, 5e-12].map(|c| stress(&strain, 0.0, c)[2]);
        let expected = |c: f64| 4e8 - 2e11 * 0.5 * (0.006 + 8e8 * c) / (1.0 + 2e11 * c);
        assert!((stiff - expected(0.0)).abs() < 1e6, "{stiff}");
        assert!((soft - expected(5e-12)).abs() < 1e6, "{soft}");
    }
}
