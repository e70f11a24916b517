use std::f64::consts::TAU;

use nalgebra::dvector;
use plant::rig::Rig;
use plant::shake_table::ShakeTable;
use plant::specimen::LinearSpecimen;
use plant::units::{G, INCH};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const H: f64 = 0.002;

/// Smooth band-limited motion: `lines` sines of random frequency and phase between 0.25 and
/// 20 Hz under a rise and fall of two seconds, displacement, velocity and acceleration consistent
/// to rounding, peaks the smaller of 1.2 in and 0.3 g.
fn motion(seed: u64, duration: f64) -> Vec<Motion> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let lines: Vec<(f64, f64, f64)> = (0..60)
        .map(|_| {
            let hertz = 0.25 * 80f64.powf(random.random_range(0.0..1.0));
            // Acceleration of equal size over the band's middle, as in ground motions.
            let size = 1.0 / (1.0 + (0.8 / hertz).powi(4)) / (1.0 + (hertz / 8.0).powi(4));
            (TAU * hertz, random.random_range(0.0..TAU), size)
        })
        .collect();
    let samples = (duration / H) as usize;
    let ramp = 2.0;
    let mut motion: Vec<Motion> = (0..samples)
        .map(|k| {
            let t = k as f64 * H;
            let mut sum = Motion::default();
            for &(omega, phase, size) in &lines {
                let (sine, cosine) = (omega * t + phase).sin_cos();
                sum.displacement -= size * sine / (omega * omega);
                sum.velocity -= size * cosine / omega;
                sum.acceleration += size * sine;
            }
            // Rise and fall: a smooth step of degree seven with its derivatives.
            let window = |s: f64, sign: f64| {
                let s = s.clamp(0.0, 1.0);
                let e = s.powi(4) * (35.0 - 84.0 * s + 70.0 * s * s - 20.0 * s.powi(3));
                let e1 = 140.0 * s.powi(3) * (1.0 - s).powi(3) * sign / ramp;
                let e2 = 420.0 * (s * (1.0 - s)).powi(2) * (1.0 - 2.0 * s) / (ramp * ramp);
                (e, e1, e2)
            };
            let (e, e1, e2) = if t < duration / 2.0 {
                window(t / ramp, 1.0)
            } else {
                window((duration - t) / ramp, -1.0)
            };
            Motion {
                displacement: e * sum.displacement,
                velocity: e1 * sum.displacement + e * sum.velocity,
                acceleration: e2 * sum.displacement
                    + 2.0 * e1 * sum.velocity
                    + e * sum.acceleration,
            }
        })
        .collect();
    let peak = |f: fn(&Motion) -> f64| motion.iter().fold(0.0f64, |m, y| m.max(f(y).abs()));
    let factor = (1.2 * INCH / peak(|y| y.displacement)).min(0.3 * G / peak(|y| y.acceleration));
    for y in &mut motion {
        y.displacement *= factor;
        y.velocity *= factor;
        y.acceleration *= factor;
    }
    motion
}

fn with_specimen() -> Rig {
    Rig {
        specimen: Some(LinearSpecimen::appendix_a()),
        ..Rig::default()
    }
}

struct Run {
    /// `100 rms(a_ref - a) / max |a_ref|`.
    error: f64,
    peak_displacement: f64,
    peak_valve: f64,
}

/// Runs the rig sampled at 2 ms: at each sample commands are computed from the outputs there and
/// act until the next, `valve_delay` samples late.
fn track(
    rig: &Rig,
    mut high_level: Option<&mut ModelPredictiveControl>,
    reference: &[Motion],
    command_delay: usize,
    valve_delay: usize,
) -> Run {
    let rig = rig.state_space().sample(H);
    let mut low_level = ThreeVariableControl::table_3_2();
    let mut x = DVector::zeros(7);
    let mut valve_line = vec![0.0; valve_delay];
    let mut command_line = vec![Motion::default(); command_delay];
    let (mut squares, mut largest, mut peak, mut peak_valve) = (0.0, 0.0f64, 0.0f64, 0.0f64);
    for (k, wanted) in reference.iter().enumerate() {
        let y = &rig.c * &x;
        let measured = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        squares += (wanted.acceleration - y[2]).powi(2);
        largest = largest.max(wanted.acceleration.abs());
        peak = peak.max(y[0].abs());
        let command = match &mut high_level {
            Some(control) => {
                let input = ModelPredictiveInput::window(reference, k, measured).unwrap();
                control.step(&input, H)
            }
            None => *wanted,
        };
        let input = ThreeVariableInput {
            reference: push(&mut command_line, command),
            measured,
        };
        let valve = push(&mut valve_line, low_level.step(&input, H));
        peak_valve = valve.abs().max(peak_valve);
        x = rig.advance(&x, &dvector![valve]);
    }
    Run {
        error: 100.0 * (squares / reference.len() as f64).sqrt() / largest,
        peak_displacement: peak,
        peak_valve,
    }
}

fn controller(parameters: Parameters) -> ModelPredictiveControl {
    ModelPredictiveControl::new(parameters).unwrap()
}

#[test]
fn explore() {
    for seed in 1..8 {
        let reference = motion(seed, 20.0);
        let rig = with_specimen();
        for plant in [Rig::default(), rig] {
        for (scale, rate) in [([1.0;3], 0.1), ([0.2, 0.5, 1.0], 0.1), ([0.1, 0.3, 1.0], 0.1), ([0.1, 0.1, 1.0], 0.1), ([0.03, 0.1, 1.0], 0.1), ([1.5*INCH, 20.0*INCH, G], 0.1), ([1.5*INCH, 20.0*INCH, G], 0.001)] {
        let mut c = controller(Parameters { plant: prediction_plant(&plant), weights: Weights{scale, rate: [rate;3], ..Weights::TABLE_5_1}, ..Parameters::default() });
        let e = track(&rig, Some(&mut c), &reference, 0, 0);
        println!("{seed} {} scale {scale:?} {rate} mpc {:.4} {:.4} valve {:.2} {}", plant.specimen.is_some(), e.error, e.peak_displacement/INCH, e.peak_valve, c.memory.counters.solved);
        }}
    }
}
