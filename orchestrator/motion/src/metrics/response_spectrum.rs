//! Response spectra: the largest responses of linear oscillators to a ground acceleration.
//!
//! `x'' + 2 zeta omega x' + omega² x = -a`, at rest before the first sample, `a` linear between samples. The
//! recurrence is exact for that (Nigam and Jennings 1969). An oscillator with fewer than [`PER_PERIOD`]
//! samples per period takes several steps per sample. A largest value between two steps is that of the
//! cubic through both with their rates: within 1 part in 20,000 of the exact one.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// Damping ratio of the usual spectra.
pub const USUAL_DAMPING: f64 = 0.05;
/// Steps per period of an oscillator at least.
const PER_PERIOD: f64 = 20.0;
/// A value between two steps exceeds the larger of the two by less than this share.
const BETWEEN: f64 = 0.96;
/// Oscillators that take their steps together.
const LANES: usize = 8;

/// What a spectrum shows of its oscillators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Largest displacement relative to the ground, `max|x|`.
    RelativeDisplacement,
    /// Largest velocity relative to the ground, `max|x'|`.
    RelativeVelocity,
    /// Pseudo-velocity, `omega max|x|`.
    PseudoVelocity,
    /// Pseudo-acceleration, `omega² max|x|`.
    #[default]
    PseudoAcceleration,
    /// Largest acceleration of the mass, `max|x'' + a|`: what an accelerometer on it measures.
    AbsoluteAcceleration,
}

impl Measure {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::RelativeDisplacement,
        Self::RelativeVelocity,
        Self::PseudoVelocity,
        Self::PseudoAcceleration,
        Self::AbsoluteAcceleration,
    ];

    /// As files and options name it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::RelativeDisplacement => "relative_displacement",
            Self::RelativeVelocity => "relative_velocity",
            Self::PseudoVelocity => "pseudo_velocity",
            Self::PseudoAcceleration => "pseudo_acceleration",
            Self::AbsoluteAcceleration => "absolute_acceleration",
        }
    }

    /// Factor from the response that is followed to the measure.
    fn factor(self, omega: f64) -> f64 {
        match self {
            Self::PseudoVelocity => omega,
            Self::PseudoAcceleration => omega * omega,
            _ => 1.0,
        }
    }
}

/// The largest response of an oscillator.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Peak {
    /// The response with its sign; its size is the spectrum.
    pub value: f64,
    /// When, s after the first sample.
    pub time: f64,
}

/// The largest responses, by `measure`, of oscillators with the natural `frequencies` (Hz) and the damping
/// ratio `damping` (0 to below 1) to a ground `acceleration` sampled every `dt` seconds. The unit is that of
/// `acceleration`, times seconds for velocities and seconds squared for displacements.
#[must_use]
pub fn response_peaks(
    acceleration: &[f64],
    dt: f64,
    frequencies: &[f64],
    damping: f64,
    measure: Measure,
) -> Vec<Peak> {
    let groups = frequencies.chunks(LANES);
    groups
        .flat_map(|group| {
            let quickest = group.iter().copied().fold(0.0, f64::max);
            let steps = (PER_PERIOD * quickest * dt).ceil().max(1.0) as usize;
            let mut lanes = Lanes::new(group, damping, dt / steps as f64, measure);
            lanes.follow(acceleration, steps);
            let factor = |n: usize| measure.factor(TAU * group[n]);
            (0..group.len())
                .map(|n| Peak {
                    value: factor(n) * lanes.largest[n],
                    time: lanes.at[n],
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// As [`response_peaks`], the sizes alone: a response spectrum.
#[must_use]
pub fn response_spectrum(
    acceleration: &[f64],
    dt: f64,
    frequencies: &[f64],
    damping: f64,
    measure: Measure,
) -> Vec<f64> {
    let peaks = response_peaks(acceleration, dt, frequencies, damping, measure);
    peaks.iter().map(|peak| peak.value.abs()).collect()
}

/// The spectrum of pseudo-acceleration, in the unit of `acceleration`.
#[must_use]
pub fn pseudo_acceleration(
    acceleration: &[f64],
    dt: f64,
    frequencies: &[f64],
    damping: f64,
) -> Vec<f64> {
    let measure = Measure::PseudoAcceleration;
    response_spectrum(acceleration, dt, frequencies, damping, measure)
}

/// Coefficients of a value, by lane.
type Row = [[f64; LANES]; 4];

/// Oscillators side by side: displacement and velocity after a step are rows times displacement,
/// velocity, and the load at either end. Value and rate of what is followed are rows times displacement,
/// velocity and the load.
struct Lanes {
    step: f64,
    /// The displacement itself is followed.
    is_displacement: bool,
    displacement: Row,
    velocity: Row,
    value: Row,
    rate: Row,
    largest: [f64; LANES],
    at: [f64; LANES],
}

impl Lanes {
    fn new(frequencies: &[f64], damping: f64, step: f64, measure: Measure) -> Self {
        let mut lanes = Self {
            step,
            is_displacement: !matches!(
                measure,
                Measure::RelativeVelocity | Measure::AbsoluteAcceleration
            ),
            displacement: Row::default(),
            velocity: Row::default(),
            value: Row::default(),
            rate: Row::default(),
            largest: [0.0; LANES],
            at: [0.0; LANES],
        };
        for (lane, frequency) in frequencies.iter().enumerate() {
            let (omega, two) = (TAU * frequency, 2.0 * damping * TAU * frequency);
            for column in 0..4 {
                let mut state = [0.0; 4];
                state[column] = 1.0;
                let [x, v] = closed_form(omega, damping, step, state);
                lanes.displacement[column][lane] = x;
                lanes.velocity[column][lane] = v;
            }
            // Relative acceleration and that of the mass in terms of x, x' and a.
            let relative = [-omega * omega, -two, -1.0];
            let absolute = [-omega * omega, -two, 0.0];
            let (value, rate) = match measure {
                Measure::RelativeVelocity => ([0.0, 1.0, 0.0], relative),
                // The rate of -(omega² x + two x').
                Measure::AbsoluteAcceleration => (
                    absolute,
                    [two * omega * omega, two * two - omega * omega, two],
                ),
                _ => ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            };
            for column in 0..3 {
                lanes.value[column][lane] = value[column];
                lanes.rate[column][lane] = rate[column];
            }
        }
        lanes
    }

    /// Follows the load, `steps` from a sample to the next.
    fn follow(&mut self, acceleration: &[f64], steps: usize) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has what the function is compiled for.
            #[allow(unsafe_code, reason = "whether the processor has it was asked")]
            return unsafe { self.follow_by_eight(acceleration, steps) };
        }
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function is compiled for.
            #[allow(unsafe_code, reason = "whether the processor has it was asked")]
            return unsafe { self.follow_by_four(acceleration, steps) };
        }
        self.follow_plainly(acceleration, steps);
    }

    /// The same operations in the same order, eight lanes in an instruction.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f")]
    fn follow_by_eight(&mut self, acceleration: &[f64], steps: usize) {
        self.follow_plainly(acceleration, steps);
    }

    /// The same operations in the same order, four lanes in an instruction.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn follow_by_four(&mut self, acceleration: &[f64], steps: usize) {
        self.follow_plainly(acceleration, steps);
    }

    #[inline(always)]
    fn follow_plainly(&mut self, acceleration: &[f64], steps: usize) {
        match self.is_displacement {
            true => self.follow_as::<true>(acceleration, steps),
            false => self.follow_as::<false>(acceleration, steps),
        }
    }

    #[inline(always)]
    fn follow_as<const DISPLACEMENT: bool>(&mut self, acceleration: &[f64], steps: usize) {
        let zero = [0.0; LANES];
        let (mut x, mut v) = (zero, zero);
        let (mut value, mut rate) = (zero, zero);
        // What a value must exceed to matter.
        let mut floor = zero;
        if let Some(first) = acceleration.first() {
            for lane in 0..LANES {
                value[lane] = self.value[2][lane] * first;
                rate[lane] = self.rate[2][lane] * first;
            }
        }
        let (displacement, velocity) = (self.displacement, self.velocity);
        let (of_value, of_rate) = (self.value, self.rate);
        let mut count = 0usize;
        for pair in acceleration.windows(2) {
            let slope = (pair[1] - pair[0]) / steps as f64;
            for part in 0..steps {
                let from = pair[0] + slope * part as f64;
                let to = from + slope;
                let (mut next, mut next_rate) = (zero, zero);
                let mut matters = false;
                for lane in 0..LANES {
                    let times = |row: &Row| {
                        (row[0][lane] * x[lane] + row[1][lane] * v[lane])
                            + (row[2][lane] * from + row[3][lane] * to)
                    };
                    let (new_x, new_v) = (times(&displacement), times(&velocity));
                    let after =
                        |row: &Row| row[0][lane] * new_x + row[1][lane] * new_v + row[2][lane] * to;
                    (next[lane], next_rate[lane]) = match DISPLACEMENT {
                        true => (new_x, new_v),
                        false => (after(&of_value), after(&of_rate)),
                    };
                    (x[lane], v[lane]) = (new_x, new_v);
                    // A largest value is where the rate changes its sign, or at the end.
                    let turns = (rate[lane] > 0.0) != (next_rate[lane] > 0.0);
                    let sizes = [value[lane].abs(), next[lane].abs()];
                    matters |= turns & ((sizes[0] > floor[lane]) | (sizes[1] > floor[lane]));
                }
                if matters {
                    self.note([&value, &next], [&rate, &next_rate], count);
                    for lane in 0..LANES {
                        floor[lane] = BETWEEN * self.largest[lane].abs();
                    }
                }
                (value, rate) = (next, next_rate);
                count += 1;
            }
        }
        self.note([&value, &value], [&zero, &zero], count);
    }

    /// Notes larger values between the ends of a step.
    #[inline(never)]
    fn note(
        &mut self,
        [value, next]: [&[f64; LANES]; 2],
        [rate, next_rate]: [&[f64; LANES]; 2],
        count: usize,
    ) {
        for lane in 0..LANES {
            let size = value[lane].abs().max(next[lane].abs());
            if size <= BETWEEN * self.largest[lane].abs() {
                continue;
            }
            let mut found = [(value[lane], 0.0), (next[lane], 1.0), (0.0, 0.0)];
            if rate[lane] * next_rate[lane] < 0.0 {
                let rates = [rate[lane] * self.step, next_rate[lane] * self.step];
                found[2] = extremum([value[lane], next[lane]], rates);
            }
            for (value, place) in found {
                if value.abs() > self.largest[lane].abs() {
                    self.largest[lane] = value;
                    self.at[lane] = (count as f64 + place) * self.step;
                }
            }
        }
    }
}

/// The extremum inside 0 to 1 of the cubic with these values and rates, of different sign, at both ends, and
/// its place.
fn extremum([from, to]: [f64; 2], [rate, last]: [f64; 2]) -> (f64, f64) {
    // from + rate s + b s² + c s³.
    let b = 3.0 * (to - from) - 2.0 * rate - last;
    let c = rate + last - 2.0 * (to - from);
    // The root of rate + 2 b s + 3 c s² between 0 and 1, in the form that does not cancel.
    let root = (b * b - 3.0 * c * rate).max(0.0).sqrt();
    let [one, other] = [-b - b.signum() * root, -b + b.signum() * root];
    let candidates = [rate / one, one / (3.0 * c), rate / other];
    let inside = |s: &&f64| (0.0..=1.0).contains(*s);
    let place = candidates.iter().find(inside).copied().unwrap_or(1.0);
    (from + place * (rate + place * (b + place * c)), place)
}

/// Displacement and velocity after a step from displacement, velocity and the load at either end.
fn closed_form(omega: f64, zeta: f64, dt: f64, [x, v, from, to]: [f64; 4]) -> [f64; 2] {
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let (sine, cosine) = (damped * dt).sin_cos();
    let decay = (-zeta * omega * dt).exp();
    // Particular solution p + q t of the linear load, then the free decay of the rest.
    let slope = (to - from) / dt;
    let q = -slope / (omega * omega);
    let p = -from / (omega * omega) + 2.0 * zeta * slope / omega.powi(3);
    let (a, b) = (x - p, (v - q + zeta * omega * (x - p)) / damped);
    let free = decay * (a * cosine + b * sine);
    let turned = decay * (b * cosine - a * sine);
    [
        free + p + q * dt,
        -zeta * omega * free + damped * turned + q,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extremum_of_a_cubic_is_where_its_rate_is_zero() {
        // The rate (s - inside) (s - outside).
        for inside in [0.1, 0.5, 0.9] {
            for outside in [-3.0, -0.5, 1.5, 4.0] {
                let rate = |s: f64| (s - inside) * (s - outside);
                let value = |s: f64| {
                    s.powi(3) / 3.0 - 0.5 * (inside + outside) * s * s + inside * outside * s
                };
                let (found, place) = extremum([value(0.0), value(1.0)], [rate(0.0), rate(1.0)]);
                assert!(
                    (place - inside).abs() < 1e-12,
                    "{inside} {outside}: {place}"
                );
                assert!((found - value(inside)).abs() < 1e-12);
            }
        }
    }

    /// Resonance of a steady sine: amplification 1/(2 zeta); far above, the ground's own peak.
    #[test]
    fn a_long_sine_is_amplified_as_in_the_closed_form() {
        let dt = 0.002;
        let ground: Vec<f64> = (0..40_000)
            .map(|n| 3.0 * (TAU * 2.0 * f64::from(n) * dt).sin())
            .collect();
        let found = pseudo_acceleration(&ground, dt, &[2.0, 100.0, 1.0], 0.05);
        assert!((found[0] - 30.0).abs() < 0.05, "{}", found[0]);
        assert!((found[1] - 3.0).abs() < 0.02, "{}", found[1]);
        // Ratio of frequencies 2: 1/sqrt((1 - 4)² + (2 0.05 2)²), the transient beside it.
        let steady = 3.0 / (9.0_f64 + 0.04).sqrt();
        assert!(found[2] > steady && found[2] < 2.5 * steady, "{}", found[2]);
    }

    /// Against the largest or smallest of ten thousand values of the cubic.
    #[test]
    fn the_extremum_of_a_cubic_is_that_of_its_values() {
        for (values, rates) in [
            ([0.0, 0.0], [1.0, -1.0]),
            ([0.2, 0.3], [2.0, -0.5]),
            ([-0.4, 0.1], [-3.0, 4.0]),
            ([1.0, 1.1], [0.01, -5.0]),
            ([0.5, -0.5], [0.3, -0.2]),
            ([0.0, 1.0], [-1.0, 1.0]),
        ] {
            let ([from, to], [rate, last]) = (values, rates);
            // Hermite's form, in place of powers.
            let at = |s: f64| {
                let (s2, s3) = (s * s, s * s * s);
                from * (2.0 * s3 - 3.0 * s2 + 1.0)
                    + rate * (s3 - 2.0 * s2 + s)
                    + to * (3.0 * s2 - 2.0 * s3)
                    + last * (s3 - s2)
            };
            let all = (0..=10_000).map(|k| at(f64::from(k) * 1e-4));
            let expected = match rate > 0.0 {
                true => all.fold(f64::NEG_INFINITY, f64::max),
                false => all.fold(f64::INFINITY, f64::min),
            };
            let (found, place) = extremum(values, rates);
            assert!(
                (found - expected).abs() < 1e-7,
                "{values:?} {rates:?}: {found} {expected}"
            );
            assert!((at(place) - found).abs() < 1e-12, "{place}");
        }
    }

    /// A step of the ground's acceleration: `1 + exp(-zeta pi / sqrt(1 - zeta²))`.
    #[test]
    fn a_step_overshoots_as_in_the_closed_form() {
        let ground = vec![1.0; 5000];
        let zeta = 0.1_f64;
        let found = pseudo_acceleration(&ground, 0.001, &[1.0], zeta)[0];
        let expected = 1.0 + (-zeta * std::f64::consts::PI / (1.0 - zeta * zeta).sqrt()).exp();
        assert!((found - expected).abs() < 1e-4, "{found}");
    }

    /// Piecewise linear noise, integrated by 200 steps of Runge and Kutta from a sample to the next, all
    /// measures, also of oscillators with two samples per period.
    #[test]
    fn all_measures_agree_with_an_independent_fine_integration() {
        let dt = 0.01;
        let mut seed = 1u64;
        let mut ground: Vec<f64> = (0..400)
            .map(|_| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (seed >> 33) as f64 / f64::from(u32::MAX) - 0.25
            })
            .collect();
        ground[0] = 0.3;
        for frequency in [0.7, 3.0, 9.0, 33.3, 49.0] {
            for zeta in [0.005, 0.02, 0.05, 0.3] {
                let expected = fine(&ground, dt, TAU * frequency, zeta);
                for (measure, expected) in Measure::ALL.into_iter().zip(expected) {
                    let found = response_spectrum(&ground, dt, &[frequency], zeta, measure)[0];
                    assert!(
                        (found / expected - 1.0).abs() < 2e-4,
                        "{measure:?} at {frequency} Hz, {zeta}: {found}, {expected}"
                    );
                }
            }
        }
    }

    fn fine(ground: &[f64], dt: f64, omega: f64, zeta: f64) -> [f64; 5] {
        const STEPS: usize = 200;
        let h = dt / STEPS as f64;
        let (mut x, mut v, mut most) = (0.0f64, 0.0f64, [0.0f64; 3]);
        let rate = |x: f64, v: f64, a: f64| [v, -a - 2.0 * zeta * omega * v - omega * omega * x];
        for pair in ground.windows(2) {
            for part in 0..STEPS {
                let at = |s: f64| pair[0] + (pair[1] - pair[0]) * (part as f64 + s) / STEPS as f64;
                let a = rate(x, v, at(0.0));
                let b = rate(x + 0.5 * h * a[0], v + 0.5 * h * a[1], at(0.5));
                let c = rate(x + 0.5 * h * b[0], v + 0.5 * h * b[1], at(0.5));
                let d = rate(x + h * c[0], v + h * c[1], at(1.0));
                x += h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]);
                v += h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]);
                let absolute = 2.0 * zeta * omega * v + omega * omega * x;
                for (most, now) in most.iter_mut().zip([x, v, absolute]) {
                    *most = most.max(now.abs());
                }
            }
        }
        let [x, v, a] = most;
        [x, v, omega * x, omega * omega * x, a]
    }

    #[test]
    fn a_peak_has_its_time_and_sign() {
        // An impulse downwards: the mass stays behind, upwards, a quarter of a period later.
        let mut ground = vec![0.0; 1000];
        ground[100] = -1.0;
        let peak = response_peaks(&ground, 0.001, &[2.0], 0.0, Measure::PseudoAcceleration)[0];
        let expected = TAU * 2.0 * 0.001;
        assert!((peak.value / expected - 1.0).abs() < 1e-4, "{peak:?}");
        assert!((peak.time - 0.225).abs() < 1e-4, "{peak:?}");
    }
}
