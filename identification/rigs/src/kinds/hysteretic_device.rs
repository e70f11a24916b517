//! Friction device: displacement to force.
//!
//! Nominal: elastic up to a Coulomb force, `f' = k v (1 - (f / F)^n sgn v)` with n → ∞ (Dahl 1968;
//! n = 1 is his curve, n between is Bouc and Wen's with no post-yield stiffness).
//!
//! Effects are counted in natural units: the standard deviation of the displacement, the Coulomb
//! force, and the time in which the displacement passes at its mean speed.

use std::f64::consts::FRAC_1_SQRT_2;

use realfft::RealFftPlanner;

use super::between::between;
use super::loose::zero_in_the_gap;
use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Cause, Equations, Natural, RigRecording};
use recordings::{Channel, mean_and_deviation};

/// The rig.
pub struct HystereticDevice;

const FORCE: Channel = Channel::Other {
    name: "force",
    unit: "N",
};

/// Forces measured inside the device, such as those of a band's two ends.
const FIRST_INNER_FORCE: Channel = Channel::Other {
    name: "inner_force_1",
    unit: "N",
};
const SECOND_INNER_FORCE: Channel = Channel::Other {
    name: "inner_force_2",
    unit: "N",
};

/// A device whose first force is less than this share of its friction is in its gap; from three times as much it is held.
const HELD: f64 = 0.05;

/// Greatest asymmetry: one side holds a twentieth.
const ONE_SIDED: f64 = 0.95;

nominal_parameters! {
    /// F: force at which it slides.
    coulomb_force: "N",
    /// k: of the device before it slides.
    stiffness: "N/m",
    /// What the load cell reads without a force.
    load_cell_zero: "N" = 0.0,
}

session_parameters! {
    /// Part of a gap that was travelled before the test, less one half.
    gap_travelled: "1" within 0.2 as Start,
}

effects! {
    /// F± = F (1 ± a).
    asymmetric_coulomb_friction: AsymmetricCoulombFriction {
        asymmetry: size("1", 0.03, (-0.9, 0.9)),
    } from [[0.1], [-0.1]], like ["load_cell_zero"];
    /// After the force has gone to zero, the device moves through a gap before it takes
    /// hold on the other side.
    free_play: FreePlay {
        gap: size("m", 0.01, (0.0, 3.0)),
    } from [[0.1], [0.3]];
    /// Stiffness while the force falls is (1 + s) k: a band that wraps on gives way more
    /// softly than it lets go.
    stiffer_unloading: StifferUnloading {
        excess: size("1", 0.05, (-0.9, 20.0)),
    } from [[0.5], [-0.3]], like ["rounded_transition"];
    /// k± = k (1 ± a).
    asymmetric_stiffness: AsymmetricStiffness {
        asymmetry: size("1", 0.03, (-0.9, 0.9)),
    } from [[0.1], [-0.1]];
    /// Asymmetry a e^{-c X}, X the greatest excursion so far: a surface, like the rubber of
    /// Mullins (Rubber Chem. Technol. 42, 1969), remembers how far it was driven.
    excursion_memory: ExcursionMemory {
        decay: size("1/m", 0.1, (-2.0, 10.0)),
    } from [[0.4], [-0.2]];
    /// k (1 + h |f| / F): contact that stiffens as more of it bears (Popov, Contact Mechanics
    /// and Friction, 2010, chapter 5).
    hardening_stiffness: HardeningStiffness {
        hardening: size("1", 0.05, (0.0, 20.0)),
    } from [[0.5], [2.0]];
    /// Rounded transition: k (1 - r |f / F|^n) with exponent n.
    rounded_transition: RoundedTransition {
        rounding: size("1", 0.05, (0.0, 1.0)),
        exponent: shape("1", 2.0, 0.7),
    } from [[0.5, 2.0], [0.9, 1.0]], like ["stiffer_unloading"];
    /// Soft begin of contact: k (1 - p e^{-|f| / (c F)}); p near one would be free play.
    progressive_contact: ProgressiveContact {
        softness: size("1", 0.05, (0.0, 0.8)),
        share: shape("1", 0.1, 0.7),
    } from [[0.6, 0.1], [0.6, 0.3]];
    /// F (1 + s e^{-|v| / v_s}) (Stribeck).
    stribeck: Stribeck {
        excess: size("1", 0.03, (-0.9, 2.0)),
        speed: shape("m/s", 0.25, 1.0),
    } from [[0.2, 0.25], [-0.2, 0.25]];
    /// F (1 + s |v| / (1 m/s)).
    rate_dependence: RateDependence {
        slope: size("s/m", 0.02, (-0.5, 2.0)),
    } from [[0.05], [-0.05]];
    /// c v beside the friction.
    viscous: Viscous {
        damping: size("N s/m", 2e-3, (-10.0, 10.0)),
    } from [[0.02], [-0.02]];
    /// y follows the force through ω² / (s² + 2 ζ ω s + ω²): mass and spring between device and
    /// load cell. With ζ from 1/√2 up nothing resonates, it only lags.
    load_path_resonance: LoadPathResonance {
        frequency: shape("rad/s", 50.0, 1.5).off_at(0.0),
        damping_ratio: size("1", 0.02, (0.0, FRAC_1_SQRT_2)),
    } from [[12.0, 0.1], [25.0, 0.1], [50.0, 0.1], [100.0, 0.1]];
    /// A force measured inside the device acts on its end, by a lever: the ends of a band around a drum
    /// pull against each other (Coble, Cao, Downey and Ricles, J. Mech. Des. 140, 2018).
    inner_force_1: InnerForce1 {
        lever: size("1", 0.01, (-30.0, 30.0)),
    } from [[0.5], [-0.5]];
    /// So does a second one.
    inner_force_2: InnerForce2 {
        lever: size("1", 0.01, (-30.0, 30.0)),
    } from [[0.5], [-0.5]];
    /// Displacement or force late.
    delay: Delay {
        delay: size("s", 6e-3, (0.0, 1.2)),
    } from [[0.03], [0.12]];
    /// The load cell reads that much without a force.
    load_cell_zero: LoadCellZero {
        zero: size("N", 0.01, (-1.0, 1.0)),
    } from [[0.05], [-0.05]], like ["asymmetric_coulomb_friction"];
}

impl Equations for HystereticDevice {
    const KIND: &'static str = "hysteretic_device";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[Channel::Displacement, Channel::Velocity];
    const OPTIONAL: &'static [(Channel, &'static [&'static str])] = &[
        (FIRST_INNER_FORCE, &["inner_force_1"]),
        (SECOND_INNER_FORCE, &["inner_force_2"]),
    ];
    const OUTPUT: Channel = FORCE;
    const IS_HYSTERETIC: bool = true;
    const IS_SCALED: bool = true;
    const SAID_BY: &'static [(&'static str, &'static str)] =
        &[("load_cell_zero", "load_cell_zero")];
    const CAUSES: &'static [&'static str] = &["load_cell_zero"];

    fn natural(nominal: &Nominal, channels: Natural) -> Natural {
        Natural {
            force: nominal.coulomb_force,
            ..channels
        }
    }

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let Nominal {
            coulomb_force: coulomb,
            stiffness,
            load_cell_zero: stated_zero,
        } = *nominal;
        let Effects {
            asymmetric_coulomb_friction: AsymmetricCoulombFriction { asymmetry },
            free_play: FreePlay { gap },
            stiffer_unloading: StifferUnloading { excess: unloading },
            asymmetric_stiffness:
                AsymmetricStiffness {
                    asymmetry: stiffness_asymmetry,
                },
            excursion_memory: ExcursionMemory { decay },
            hardening_stiffness: HardeningStiffness { hardening },
            rounded_transition: RoundedTransition { rounding, exponent },
            progressive_contact:
                ProgressiveContact {
                    softness,
                    share: contact,
                },
            stribeck: Stribeck {
                excess,
                speed: slow,
            },
            rate_dependence: RateDependence { slope: rate },
            viscous: Viscous { damping },
            load_path_resonance:
                LoadPathResonance {
                    frequency: resonance,
                    damping_ratio,
                },
            inner_force_1: InnerForce1 { lever: first_lever },
            inner_force_2: InnerForce2 {
                lever: second_lever,
            },
            delay: Delay { delay },
            load_cell_zero: LoadCellZero { zero },
        } = *effects;
        let zero = stated_zero + zero;
        let inner = [
            (first_lever, recording.input(FIRST_INNER_FORCE)),
            (second_lever, recording.input(SECOND_INNER_FORCE)),
        ];
        let (x, v) = (
            recording.input(Channel::Displacement),
            recording.input(Channel::Velocity),
        );
        // The device begins as it was left: under the first measured force, or somewhere in the gap. Between, it begins
        // nearer to the gap's end, then under a part of the force, so that no fit of a zero is stopped in between.
        let first = recording.output().first().copied().unwrap_or(f64::NAN) - zero;
        let beyond = first.abs() / (HELD * coulomb);
        let [at_end, held] = [1.0, 2.0].map(|from| (beyond.max(from) - from).min(1.0));
        let mut force = held * first.max(-coulomb).min(coulomb);
        // Travelled part of the gap, 0 at its negative end.
        let left = (0.5 + session.gap_travelled).clamp(0.0, 1.0);
        let end = if first > 0.0 { 1.0 } else { 0.0 };
        let mut travelled = gap * (at_end * end + (1.0 - at_end) * left);
        let (mut shown, mut shown_rate) = (force, 0.0);
        // Twelve steps a radian of the load path at least, sixty-four a sample at most.
        let radians = resonance * recording.period();
        let steps = (12.0 * radians).ceil().clamp(1.0, 64.0);
        let late = delay / recording.period();
        let at = |values: &[f64], k: usize| between(values, k as f64 - late);
        let rest = x.first().copied().unwrap_or(0.0);
        let mut position = rest;
        let mut greatest = 0.0f64;
        for (k, y) in out.iter_mut().enumerate() {
            let (now, speed) = (at(x, k), at(v, k));
            let mut move_left = now - position;
            position = now;
            greatest = greatest.max((now - rest).abs());
            // A memory that grows with the excursion ends where one side holds nothing.
            let asymmetry = (asymmetry * (-decay * greatest).exp()).clamp(-ONE_SIDED, ONE_SIDED);
            let mut level = 1.0 + rate * speed.abs();
            if excess != 0.0 {
                level += excess * (-speed.abs() / slow).exp();
            }
            let level = coulomb * level.max(0.05);
            // At most: let go, cross the gap, take hold.
            for _ in 0..3 {
                if move_left == 0.0 {
                    break;
                }
                let direction = move_left.signum();
                let loose = force == 0.0;
                if loose {
                    let room = if direction > 0.0 {
                        gap - travelled
                    } else {
                        travelled
                    };
                    if move_left.abs() < room {
                        travelled += move_left;
                        break;
                    }
                    move_left -= direction * room;
                    travelled = if direction > 0.0 { gap } else { 0.0 };
                }
                let side = if loose { direction } else { force.signum() };
                let limit = level * (1.0 + side * asymmetry).max(0.05);
                let bearing = (force.abs() / limit).min(1.0);
                let k_side =
                    stiffness * (1.0 + side * stiffness_asymmetry) * (1.0 + hardening * bearing);
                if side * direction > 0.0 {
                    let mut k_now = k_side;
                    if rounding > 0.0 {
                        k_now *= 1.0 - rounding * bearing.powf(exponent);
                    }
                    if softness > 0.0 {
                        k_now *= 1.0 - softness * (-bearing / contact).exp();
                    }
                    force += k_now * move_left;
                    if force.abs() > limit {
                        force = side * limit;
                    }
                    move_left = 0.0;
                } else {
                    let k_now = k_side * (1.0 + unloading);
                    let rest = force + k_now * move_left;
                    if rest * side > 0.0 {
                        force = rest;
                        move_left = 0.0;
                    } else {
                        move_left += force / k_now;
                        force = 0.0;
                        travelled = if side > 0.0 { gap } else { 0.0 };
                    }
                }
            }
            let mut total = force + damping * speed;
            for (lever, measured) in inner {
                if lever != 0.0 && !measured.is_empty() {
                    total += lever * at(measured, k);
                }
            }
            if resonance > 0.0 {
                let h = recording.period() / steps;
                for _ in 0..steps as usize {
                    let pull = resonance * (total - shown) - 2.0 * damping_ratio * shown_rate;
                    shown_rate += h * resonance * pull;
                    shown += h * shown_rate;
                }
                *y = shown + zero;
            } else {
                *y = total + zero;
            }
        }
    }

    fn starts(
        &self,
        recording: &RigRecording,
        _nominal: &Nominal,
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        let displacement = recording.input(Channel::Displacement);
        let found = ringing(displacement, errors, recording.period());
        let start = found.map(|omega| ("load_path_resonance", vec![omega, 0.1]));
        start.into_iter().collect()
    }

    fn contradictions(&self, recordings: &[RigRecording]) -> Vec<Cause> {
        let zero = zero_in_the_gap(recordings, Channel::Displacement);
        let cause = zero.map(|found| Cause { found, stated: 0.0 });
        cause.into_iter().collect()
    }
}

/// Angular frequency at which a record rings: where the spectrum of its errors, times the square of
/// the frequency, is highest above ten times the main frequency of the motion.
fn ringing(displacement: &[f64], errors: &[f64], period: f64) -> Option<f64> {
    let n = errors.len();
    let spectrum = |values: &[f64]| -> Option<Vec<f64>> {
        let (mean, _) = mean_and_deviation(values);
        let mut real: Vec<f64> = values.iter().map(|v| v - mean).collect();
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(n);
        let mut bins = plan.make_output_vec();
        plan.process(&mut real, &mut bins).ok()?;
        Some(bins.iter().map(|b| b.norm_sqr()).collect())
    };
    let motion = spectrum(displacement)?;
    let main = (1..motion.len()).max_by(|&a, &b| motion[a].total_cmp(&motion[b]))?;
    let known: Vec<f64> = errors
        .iter()
        .map(|e| if e.is_finite() { *e } else { 0.0 })
        .collect();
    let left = spectrum(&known)?;
    // A tenth of an octave is one look.
    let mut best: Option<(f64, f64)> = None;
    let mut low = 10.0 * main as f64;
    while low * 1.07 < 0.9 * left.len() as f64 {
        let band = low as usize..(low * 1.07) as usize + 1;
        let middle = 1.035 * low;
        let count = band.len() as f64;
        let power = left[band].iter().sum::<f64>() / count * middle * middle;
        if best.is_none_or(|(most, _)| power > most) {
            best = Some((power, middle));
        }
        low *= 1.07;
    }
    best.map(|(_, bin)| std::f64::consts::TAU * bin / (n as f64 * period))
}

#[cfg(test)]
mod tests {
    use super::super::EffectTable;
    use super::*;
    use recordings::Recording;

    /// What the load cell shows of a device with a gap of 10 mm that moves through 4 mm of it from its middle, takes
    /// hold and slides at 10 kN; its first force is `first`.
    fn shown(first: f64, stated: f64, found: f64) -> Vec<f64> {
        let displacement: Vec<f64> = (0..1000).map(|k| 1e-5 * f64::from(k)).collect();
        let n = displacement.len();
        let channels = vec![
            (Channel::Displacement, displacement),
            (Channel::Velocity, vec![0.01; n]),
            (FORCE, vec![first; n]),
        ];
        let recording = Recording::new("crosses", 1e-3, channels).unwrap();
        let recording = RigRecording::new(recording, HystereticDevice::INPUTS, FORCE);
        let effects = Effects {
            free_play: FreePlay { gap: 0.010 },
            load_cell_zero: LoadCellZero { zero: found },
            ..Effects::off().unwrap()
        };
        let nominal = Nominal {
            coulomb_force: 1e4,
            stiffness: 1e8,
            load_cell_zero: stated,
        };
        let mut out = vec![0.0; n];
        let session = Session::default();
        HystereticDevice.simulate(&recording, &nominal, &effects, &session, &mut out);
        out
    }

    #[test]
    fn a_device_in_its_gap_shows_the_load_cell_s_zero() {
        // Not the force of a device that is held: without a force the cell reads as much.
        for (stated, found) in [(0.0, 800.0), (800.0, 0.0), (500.0, 300.0)] {
            let out = shown(800.0, stated, found);
            assert!((out[400] - 800.0).abs() < 1e-9, "{}", out[400]);
            assert!((out[999] - 10_800.0).abs() < 1e-6, "{}", out[999]);
        }
    }

    #[test]
    fn a_device_begins_between_the_middle_of_its_gap_and_its_end_where_its_first_force_is_small() {
        let begins = |first: f64| {
            let out = shown(first, 0.0, 0.0);
            (out[0], out.iter().position(|force| *force > 5e3).unwrap())
        };
        let (force, middle) = begins(0.0);
        assert!(
            force == 0.0 && (500..510).contains(&middle),
            "{force} {middle}"
        );
        assert_eq!(begins(499.0), (force, middle));
        // Half way to the end of the gap, then at it, then under half of the force, then under all of it.
        for (first, begin, held) in [
            (750.0, 0.0, 255),
            (999.0, 0.0, 6),
            (1250.0, 625.0, 5),
            (1600.0, 1600.0, 4),
        ] {
            let (force, found) = begins(first);
            assert!((force - begin).abs() < 1e-9, "{force} {begin}");
            assert!(found.abs_diff(held) < 3, "{found} {held}");
        }
        // No jump anywhere, by which a fit of a zero would be stopped.
        for first in [500.0, 1000.0, 1500.0] {
            let [one, two] = [first - 0.01, first + 0.01].map(begins);
            assert!(
                (one.0 - two.0).abs() < 1.0 && one.1.abs_diff(two.1) < 2,
                "{one:?} {two:?}"
            );
        }
    }

    #[test]
    fn asymmetry_fades_with_the_greatest_excursion() {
        // Slides to 10 mm, back to -5 mm and again to 8 mm: the level keeps that of 10 mm.
        let path = [0.0, 0.010, -0.005, 0.008];
        let steps = 1000;
        let displacement: Vec<f64> = path
            .windows(2)
            .flat_map(|p| (0..steps).map(|k| p[0] + (p[1] - p[0]) * f64::from(k) / 1000.0))
            .chain([0.008])
            .collect();
        let n = displacement.len();
        let channels = vec![
            (Channel::Displacement, displacement),
            (Channel::Velocity, vec![0.0; n]),
            (FORCE, vec![0.0; n]),
        ];
        let recording = Recording::new("slides", 1e-3, channels).unwrap();
        let recording = RigRecording::new(recording, HystereticDevice::INPUTS, FORCE);
        let effects = Effects {
            asymmetric_coulomb_friction: AsymmetricCoulombFriction { asymmetry: -0.3 },
            excursion_memory: ExcursionMemory { decay: 50.0 },
            ..Effects::off().unwrap()
        };
        let nominal = Nominal {
            coulomb_force: 1e4,
            stiffness: 1e8,
            load_cell_zero: 0.0,
        };
        let mut out = vec![0.0; n];
        HystereticDevice.simulate(
            &recording,
            &nominal,
            &effects,
            &Session::default(),
            &mut out,
        );
        let fade = |excursion: f64| 0.3 * (-50.0 * excursion).exp();
        for (place, force) in [
            (500, 1e4 * (1.0 - fade(0.005))),
            (1000, 1e4 * (1.0 - fade(0.010))),
            (2000, -1e4 * (1.0 + fade(0.010))),
            (n - 1, 1e4 * (1.0 - fade(0.010))),
        ] {
            assert!(
                (out[place] - force).abs() < 30.0,
                "{place}: {} {force}",
                out[place]
            );
        }
    }
}
