//! A mass on a spring read off its records as if displacement's derivatives were known (the restoring
//! force method, Masri and Caughey, J. Appl. Mech. 46, 1979): starts for a fit, where a simulation from wrong
//! values loses the motion after a few oscillations and says nothing of the way.

use nalgebra::{DMatrix, DVector, Dyn, OMatrix, U4};
use units::vocabulary;

use super::RigRecording;
use recordings::Channel;

/// Half-widths of the window in which displacement and force are smoothed, in the nominal model's period; the
/// first is as short as a window can be.
const HALF_WIDTHS: [f64; 3] = [0.0, 1.0 / 32.0, 1.0 / 12.0];
/// Shares of the largest displacement at which gaps and stops are tried.
const GAPS: [f64; 3] = [0.2, 0.5, 0.8];
/// Rounding of dry friction in the deviation of the velocity.
const ROUNDING: f64 = 0.05;
/// Damping ratio where the records ask for none.
const LEAST_RATIO: f64 = 1e-3;

/// What a mass's records say of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOff {
    /// Mass, kg.
    pub mass: f64,
    /// Damping, N s/m.
    pub damping: f64,
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Steady force, N.
    pub offset: f64,
    /// Displacement and velocity at the first sample of the record, m and m/s, where it was measured.
    pub start: (f64, f64),
    /// One effect with the values of its parameters.
    pub effect: Option<(&'static str, Vec<f64>)>,
}

/// Displacement, velocity, acceleration and force of a window.
struct Moment {
    y: f64,
    v: f64,
    a: f64,
    force: f64,
}

/// Models of the samples at `places` of `recording` whose first input is `force`, with one effect at most: those of
/// a mass as it comes out and of one that is `mass`. The nominal model's period is `period`, s.
pub fn read_off(
    recording: &RigRecording,
    force: Channel,
    places: &[usize],
    mass: f64,
    period: f64,
) -> Vec<ReadOff> {
    let (output, input) = (recording.output(), recording.input(force));
    let run = longest_run(places);
    let sample = recording.period();
    let mut found = Vec::new();
    for width in HALF_WIDTHS {
        let half = ((width * period / sample) as usize).max(2);
        let Some(filter) = Smoothing::new(half, sample) else {
            continue;
        };
        if run.len() < 50 * half {
            continue;
        }
        let start = filter.of(&output[..(2 * half + 1).min(output.len())]);
        let start = match start {
            Some(first) => (output[0], first[1] - half as f64 * sample * first[2]),
            None => (0.0, 0.0),
        };
        let moments: Vec<Moment> = (run.start + half..run.end - half)
            .filter_map(|k| {
                let window = k - half..=k + half;
                let [y, v, a] = filter.of(&output[window.clone()])?;
                let [force, ..] = filter.of(input.get(window)?)?;
                Some(Moment { y, v, a, force })
            })
            .collect();
        for own in [None, Some(mass)] {
            found.extend(models(&moments, own, start));
        }
    }
    found
}

fn longest_run(places: &[usize]) -> std::ops::Range<usize> {
    let mut best = 0..0;
    for run in places.chunk_by(|a, b| a + 1 == *b) {
        if run.len() > best.len() {
            best = run[0]..run[0] + run.len();
        }
    }
    best
}

/// A force beside the linear ones, as its parameters' values make of the coefficient that was found.
type Beside<'a> = (
    &'static str,
    Box<dyn Fn(&Moment) -> f64 + 'a>,
    Box<dyn Fn(f64, f64) -> Vec<f64> + 'a>,
);

/// The linear model and those with one effect.
fn models(moments: &[Moment], mass: Option<f64>, start: (f64, f64)) -> Vec<ReadOff> {
    let largest = moments.iter().map(|m| m.y.abs()).fold(0.0, f64::max);
    let squares: f64 = moments.iter().map(|m| m.v * m.v).sum();
    let rounding = ROUNDING * (squares / moments.len().max(1) as f64).sqrt();
    let alone = |value: f64, _: f64| vec![value];
    let mut beside: Vec<Beside<'_>> = vec![
        (
            vocabulary::CUBIC_STIFFNESS,
            Box::new(|m| m.y.powi(3)),
            Box::new(alone),
        ),
        (
            "quadratic_stiffness",
            Box::new(|m| m.y * m.y),
            Box::new(alone),
        ),
        (
            "asymmetric_stiffness",
            Box::new(|m| m.y.abs()),
            Box::new(|value, stiffness| vec![value / stiffness]),
        ),
        (
            vocabulary::COULOMB_FRICTION,
            Box::new(move |m| m.v / m.v.hypot(rounding)),
            Box::new(move |value, _| vec![value, rounding]),
        ),
        (
            "quadratic_damping",
            Box::new(|m| m.v * m.v.abs()),
            Box::new(alone),
        ),
        (
            "displacement_damping",
            Box::new(|m| m.y * m.y * m.v),
            Box::new(alone),
        ),
    ];
    let outside = |gap: f64| move |y: f64| (y.abs() - gap).max(0.0).copysign(y);
    for gap in GAPS.map(|share| share * largest) {
        beside.push((
            "stops",
            Box::new(move |m| outside(gap)(m.y)),
            Box::new(move |value, _| vec![value, gap]),
        ));
    }
    let mut found = Vec::new();
    let model = |spring: &dyn Fn(f64) -> f64, more: Option<&dyn Fn(&Moment) -> f64>| {
        solve(moments, mass, spring, more)
    };
    let linear = |y: f64| y;
    let read = |[m, c, k, offset, _]: [f64; 5], effect| ReadOff {
        mass: m,
        damping: c.max(2.0 * LEAST_RATIO * (k * m).sqrt()),
        stiffness: k,
        offset,
        start,
        effect,
    };
    if let Some(solved) = model(&linear, None) {
        found.push(read(solved, None));
    }
    for (name, force, values) in &beside {
        if let Some(solved) = model(&linear, Some(force.as_ref())) {
            found.push(read(solved, Some((*name, values(solved[4], solved[2])))));
        }
    }
    for gap in GAPS.map(|share| share * largest) {
        if let Some(solved) = model(&outside(gap), None) {
            found.push(read(solved, Some(("free_play", vec![2.0 * gap]))));
        }
    }
    found
}

/// Mass, damping, stiffness, steady force and the coefficient of what is beside them, by least squares; none
/// where mass or stiffness would not be positive.
fn solve(
    moments: &[Moment],
    mass: Option<f64>,
    spring: &dyn Fn(f64) -> f64,
    beside: Option<&dyn Fn(&Moment) -> f64>,
) -> Option<[f64; 5]> {
    let mut normal = DMatrix::<f64>::zeros(5, 5);
    let mut right = DVector::<f64>::zeros(5);
    for m in moments {
        let held = mass.map_or(0.0, |mass| mass * m.a);
        let free = if mass.is_some() { 0.0 } else { m.a };
        let more = beside.map_or(0.0, |force| force(m));
        let row = DVector::from_row_slice(&[free, m.v, spring(m.y), -1.0, more]);
        normal.ger(1.0, &row, &row, 1.0);
        right.axpy(m.force - held, &row, 1.0);
    }
    // What is not asked for is zero.
    for i in 0..5 {
        if normal[(i, i)] == 0.0 {
            normal[(i, i)] = 1.0;
        }
    }
    // The columns are of many sizes.
    let size = normal.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = DMatrix::from_fn(5, 5, |i, j| normal[(i, j)] * size[i] * size[j]);
    let solved = scaled.cholesky()?.solve(&right.component_mul(&size));
    let solved = solved.component_mul(&size);
    let mut found = [solved[0], solved[1], solved[2], solved[3], solved[4]];
    if let Some(mass) = mass {
        found[0] = mass;
    }
    let is_sound = found.iter().all(|own| own.is_finite()) && found[0] > 0.0 && found[2] > 0.0;
    is_sound.then_some(found)
}

/// A cubic through a window by least squares (Savitzky and Golay, Anal. Chem. 36, 1964).
struct Smoothing {
    /// Weights of value, first and second derivative in the middle.
    weights: [Vec<f64>; 3],
}

impl Smoothing {
    fn new(half: usize, sample: f64) -> Option<Self> {
        let powers = OMatrix::<f64, Dyn, U4>::from_fn(2 * half + 1, |row, power| {
            (row as f64 - half as f64).powi(power as i32)
        });
        let inverse = (powers.transpose() * &powers).try_inverse()?;
        let all = inverse * powers.transpose();
        let row = |i: usize, factor: f64| all.row(i).iter().map(|w| w * factor).collect();
        Some(Self {
            weights: [
                row(0, 1.0),
                row(1, 1.0 / sample),
                row(2, 2.0 / (sample * sample)),
            ],
        })
    }

    /// Value and derivatives in the middle of a window; none where a sample is missing.
    fn of(&self, window: &[f64]) -> Option<[f64; 3]> {
        let [value, first, second] = &self.weights;
        let sum = |weights: &[f64]| -> f64 { weights.iter().zip(window).map(|(w, x)| w * x).sum() };
        let found = [sum(value), sum(first), sum(second)];
        let is_whole = window.len() == value.len() && found.iter().all(|own| own.is_finite());
        is_whole.then_some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recordings::Recording;

    const FORCE: Channel = Channel::Other {
        name: "force",
        unit: "N",
    };

    /// Mass, damping, stiffness and cubic stiffness.
    const TRUTH: [f64; 4] = [2.0, 6.0, 800.0, 8e6];

    #[test]
    fn the_force_that_a_known_motion_asks_for_gives_back_what_it_acts_on() {
        let [m, c, k, cubic] = TRUTH;
        let sample = 1e-3;
        // Two sines, whose derivatives are known; 0.05 m, where the spring is 76 times as stiff as at rest.
        let sines = [(0.03, 20.0), (0.02, 33.0)];
        let motion = |t: f64| {
            let sum = |of: fn(f64, f64, f64) -> f64| -> f64 {
                sines.iter().map(|&(a, w)| of(a, w, t)).sum()
            };
            [
                sum(|a, w, t| a * (w * t).sin()),
                sum(|a, w, t| a * w * (w * t).cos()),
                sum(|a, w, t| -a * w * w * (w * t).sin()),
            ]
        };
        let times = (0..4000).map(|n| sample * f64::from(n));
        let (force, displacement) = times
            .map(|t| {
                let [y, v, a] = motion(t);
                (m * a + c * v + k * y + cubic * y.powi(3) - 1.0, y)
            })
            .unzip();
        let channels = vec![(FORCE, force), (Channel::Displacement, displacement)];
        let recording = Recording::new("sines", sample, channels).unwrap();
        let recording = RigRecording::new(recording, &[FORCE], Channel::Displacement);
        let places: Vec<usize> = (0..4000).collect();
        let all = read_off(&recording, FORCE, &places, m, 0.3);
        let best = all
            .iter()
            .find(|own| matches!(own.effect, Some(("cubic_stiffness", _))))
            .unwrap();
        let near = |value: f64, truth: f64, share: f64| (value / truth - 1.0).abs() < share;
        assert!(near(best.mass, m, 0.01), "{best:?}");
        assert!(near(best.damping, c, 0.02), "{best:?}");
        assert!(near(best.stiffness, k, 0.1), "{best:?}");
        let found = best.effect.as_ref().unwrap().1[0];
        assert!(near(found, cubic, 0.01), "{best:?}");
        assert!(near(best.offset, 1.0, 0.1), "{best:?}");
        let [y, v, _] = motion(0.0);
        assert!(
            (best.start.0 - y).abs() < 1e-9 && near(best.start.1, v, 0.01),
            "{best:?}"
        );
    }
}
