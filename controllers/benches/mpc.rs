//! One step of model predictive control, timed step by step over closed-loop runs, and the same
//! optimisations given to OSQP and DAQP.
//!
//! ```text
//! cargo bench -p controllers --bench mpc
//! ```
//!
//! The peers run where `SHAKEBENCH_PYTHON` (default `python3`) has the packages `osqp`, `daqp`,
//! `numpy` and `scipy`. Ours is the whole step: measurement update, optimisation, command, time
//! update; and of it the optimisation alone, from reference and state to the optimum. Theirs is
//! the optimisation from linear term and bounds to the optimum, after a set-up done once; those
//! two are made for them.

use std::error::Error;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use controllers::mpc::{
    ModelPredictiveControl, ModelPredictiveInput, Parameters, SolverChoice, Weights,
    prediction_plant,
    solver::{Clarabel, Kwik, Solver},
};
use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion};
use nalgebra::{DVector, dvector};
use plant::identified::coupled::Rig;
use units::constants::{G, INCH};

const H: f64 = 0.002;
const STEPS: usize = 4000;
/// Each step is repeated from the same memory; the fastest is what the step takes, the rest is
/// what else the machine does.
const REPEATS: usize = 9;

/// Sines with a smooth start: peaks in m at frequencies in Hz.
fn motion(lines: &[(f64, f64)]) -> Vec<Motion> {
    (0..STEPS)
        .map(|k| {
            let t = k as f64 * H;
            let s = (t / 2.0).min(1.0);
            let e = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let e1 = 30.0 * (s * (1.0 - s)).powi(2) / 2.0;
            let e2 = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / 4.0;
            let mut sum = Motion::default();
            for &(peak, hertz) in lines {
                let omega = TAU * hertz;
                let (sine, cosine) = (omega * t + hertz).sin_cos();
                sum.displacement += peak * e * sine;
                sum.velocity += peak * (e1 * sine + e * omega * cosine);
                sum.acceleration +=
                    peak * (e2 * sine + 2.0 * e1 * omega * cosine - e * omega * omega * sine);
            }
            sum
        })
        .collect()
}

/// One step's optimisation and how long the step took.
struct Step {
    constrained: bool,
    nanoseconds: f64,
    optimisation: f64,
    target: DVector<f64>,
    bound: DVector<f64>,
    solution: DVector<f64>,
}

fn run(
    control: &mut ModelPredictiveControl,
    solver: &mut dyn Solver,
    reference: &[Motion],
) -> Result<Vec<Step>, Box<dyn Error>> {
    let rig = Rig::default().state_space().sample(H);
    let mut low_level = ThreeVariableControl::table_3_2();
    let mut x = DVector::zeros(rig.order());
    let mut steps = Vec::with_capacity(reference.len());
    for k in 0..reference.len() {
        let y = &rig.c * &x;
        let measured = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        let input = ModelPredictiveInput::window(reference, k, measured)?;
        let before = control.memory;
        let mut fastest = f64::INFINITY;
        let mut command = Motion::default();
        for _ in 0..REPEATS {
            control.memory = before;
            let start = Instant::now();
            command = control.step(std::hint::black_box(&input), H);
            fastest = fastest.min(start.elapsed().as_nanos() as f64);
        }
        let mut work = control.workspace().clone();
        let solution = work.solution.clone();
        let mut optimisation = f64::INFINITY;
        for _ in 0..REPEATS {
            let start = Instant::now();
            std::hint::black_box(control.problem().optimise(&mut work, solver));
            optimisation = optimisation.min(start.elapsed().as_nanos() as f64);
        }
        let (target, bound) = control.problem().instance(&mut work);
        steps.push(Step {
            constrained: control.memory.counters.shortcuts == before.counters.shortcuts,
            nanoseconds: fastest,
            optimisation,
            target: target.clone(),
            bound: bound.clone(),
            solution,
        });
        let valve = low_level.step(
            &ThreeVariableInput {
                reference: command,
                measured,
            },
            H,
        );
        x = rig.advance(&x, &dvector![valve]);
    }
    Ok(steps)
}

fn row(name: &str, steps: &[&Step], time: fn(&Step) -> f64) {
    if steps.is_empty() {
        return;
    }
    let mut times: Vec<f64> = steps.iter().map(|step| time(step)).collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize] / 1e3;
    println!(
        "{name:<64} {:>6} {:>9.2} {:>9.2} {:>9.2}",
        steps.len(),
        at(0.5),
        at(0.999),
        at(1.0)
    );
}

/// Writes what the peers need, all as little-endian f64: sizes, Hessian and constraints (both row
/// by row), then each step's kind, target, bound and solution.
fn write(path: &Path, control: &ModelPredictiveControl, steps: &[Step]) -> std::io::Result<()> {
    let (h, a) = (&control.problem().hessian, &control.problem().constraints);
    let mut numbers = vec![a.ncols() as f64, a.nrows() as f64, steps.len() as f64];
    numbers.extend(h.transpose().iter());
    numbers.extend(a.transpose().iter());
    for step in steps {
        numbers.push(f64::from(u8::from(step.constrained)));
        numbers.extend(step.target.iter().chain(&step.bound).chain(&step.solution));
    }
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    fs::write(path, bytes)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let smooth = motion(&[(0.7 * INCH, 0.5), (0.06 * INCH, 2.3), (0.01 * INCH, 6.1)]);
    let long = motion(&[(1.707 * INCH, 0.5)]);
    let scaled = Weights {
        scale: [1.5 * INCH, 20.0 * INCH, G],
        ..Weights::TABLE_5_1
    };
    println!(
        "{:<64}  steps    median    99.9 %   longest",
        format!("microseconds (fastest of {REPEATS})")
    );
    for (name, weights, reference) in [
        ("smooth motion", Weights::TABLE_5_1, &smooth),
        ("beyond the stroke", Weights::TABLE_5_1, &long),
        ("beyond the stroke, scaled weights", scaled, &long),
    ] {
        let mut files = Vec::new();
        for (label, solver) in [
            ("kwik", SolverChoice::Kwik),
            ("clarabel", SolverChoice::Clarabel),
        ] {
            let mut control = ModelPredictiveControl::new(Parameters {
                plant: prediction_plant(&Rig::default()),
                weights,
                solver,
                ..Parameters::default()
            })?;
            let (hessian, constraints) = {
                let problem = control.problem();
                (problem.hessian.clone(), problem.constraints.clone())
            };
            let mut alone: Box<dyn Solver> = match solver {
                SolverChoice::Kwik => {
                    Box::new(Kwik::new(&hessian, &constraints, 200, f64::INFINITY)?)
                }
                SolverChoice::Clarabel => {
                    Box::new(Clarabel::new(&hessian, &constraints, 200, f64::INFINITY)?)
                }
            };
            let steps = run(&mut control, &mut *alone, reference)?;
            let (constrained, free): (Vec<&Step>, _) = steps.iter().partition(|s| s.constrained);
            if solver == SolverChoice::Kwik {
                row(
                    &format!("{name}: no limit active, whole step"),
                    &free,
                    |s| s.nanoseconds,
                );
                row(
                    &format!("{name}: no limit active, optimisation"),
                    &free,
                    |s| s.optimisation,
                );
                let path = folder.join(format!("{}.f64", name.replace([' ', ','], "-")));
                write(&path, &control, &steps)?;
                files.push(path);
            }
            row(
                &format!("{name}: constrained, whole step, {label}"),
                &constrained,
                |s| s.nanoseconds,
            );
            row(
                &format!("{name}: constrained, optimisation, {label}"),
                &constrained,
                |s| s.optimisation,
            );
        }
        peers(name, &files);
    }
    Ok(())
}

fn peers(name: &str, files: &[std::path::PathBuf]) {
    let python = std::env::var("SHAKEBENCH_PYTHON").unwrap_or_else(|_| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/mpc_peers.py");
    let done = Command::new(&python)
        .arg(script)
        .arg(name)
        .args(files)
        .status();
    if !done.is_ok_and(|status| status.success()) {
        println!("{name}: OSQP and DAQP skipped, `{python}` lacks osqp, daqp, numpy or scipy");
    }
}
