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
    let (mut squares, mut largest, mut peak) = (0.0, 0.0f64, 0.0f64);
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
        x = rig.advance(&x, &dvector![valve]);
    }
    Run {
        error: 100.0 * (squares / reference.len() as f64).sqrt() / largest,
        peak_displacement: peak,
    }
}

fn controller(parameters: Parameters) -> ModelPredictiveControl {
    ModelPredictiveControl::new(parameters).unwrap()
}

#[test]
fn explore() {
    for seed in 1..5 {
        let reference = motion(seed, 20.0);
        for (name, rig) in [("bare", Rig::default()), ("specimen", with_specimen())] {
            let t0 = track(&rig, None, &reference, 0, 0).error;
            let t1 = track(&rig, None, &reference, 0, 1).error;
            let t2 = track(&rig, None, &reference, 1, 1).error;
            println!("{name} tvc {t0:.3} delayed {t1:.3} jacobi {t2:.3}");
            for (model, plant) in [("bare model", Rig::default()), ("full model", with_specimen())] {
                for outlook in [Outlook::Preview, Outlook::Hold, Outlook::Extrapolate] {
                    let make = |loop_delay_samples, command_delay_samples| controller(Parameters {
                            plant: prediction_plant(&plant),
                            outlook, loop_delay_samples, command_delay_samples,
                            ..Parameters::default()
                        });
                    let e0 = track(&rig, Some(&mut make(0,0)), &reference, 0, 0).error;
                    let un = track(&rig, Some(&mut make(0,0)), &reference, 0, 1).error;
                    let e1 = track(&rig, Some(&mut make(1,0)), &reference, 0, 1).error;
                    let e2 = track(&rig, Some(&mut make(1,1)), &reference, 1, 1).error;
                    println!("   {model} {outlook:?} {e0:.4}; one delay {e1:.4}, jacobi {e2:.4}, unmodelled {un:.3}");
                }
            }
        }
    }
    // large stroke
    for factor in [1.707/1.2] {
        let reference: Vec<Motion> = (0..4000).map(|k| { let t = k as f64*H; let w = TAU*0.5; let a = 1.2*INCH*factor; let e = (t/2.0).min(1.0); let e = e*e*e*(10.0-15.0*e+6.0*e*e);
            Motion{displacement: a*e*(w*t).sin(), velocity: a*e*w*(w*t).cos(), acceleration: -a*e*w*w*(w*t).sin()} }).collect();
        for scale in [[1.0;3],[1.5*INCH, 20.0*INCH, G], [1.5*INCH, 0.5, 10.0]] {
            for outlook in [Outlook::Preview, Outlook::Hold] {
            let mut c = controller(Parameters { weights: Weights{scale, ..Weights::TABLE_5_1}, outlook, ..Parameters::default()});
            let r = track(&Rig::default(), Some(&mut c), &reference, 0, 0);
            println!("{scale:?} {outlook:?} peak {} in error {} {:?} cond {}", r.peak_displacement/INCH, r.error, c.memory.counters, c.problem.condition());
            }
        }
    }
}
