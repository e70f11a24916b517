//! What happens where the valve, the stroke or the solver comes to its limit.

use super::*;

#[test]
fn what_the_valve_cannot_do_does_not_mislead_the_estimate() {
    let reference = motion(3, 20.0, 1.0);
    let low_level = ThreeVariableControl {
        limit: 2.0,
        ..ThreeVariableControl::table_3_2()
    };
    // With its own plan inside the limit, and with commands that three-variable control cuts off.
    for iteration_limit in [200, 0] {
        let mut control = controller(Parameters {
            low_level,
            iteration_limit,
            ..Parameters::default()
        });
        let run = track_with(
            &Rig::default(),
            low_level,
            Some(&mut control),
            &reference,
            0,
            0,
        );
        let counters = control.memory.counters;
        let constrained = counters.solved + counters.shifted_plans + counters.low_level_alone;
        assert!(constrained > 20, "{counters:?}");
        assert!((run.peak_valve - 2.0).abs() < 1e-12, "{} V", run.peak_valve);
        assert!(run.innovation < 1e-6, "{:e}", run.innovation);
    }
}

/// 1.707 in at 0.5 Hz for eight seconds, with a smooth start.
fn long_stroke() -> Vec<Motion> {
    let (omega, peak) = (TAU * 0.5, 1.707 * INCH);
    (0..4000)
        .map(|k| {
            let t = k as f64 * H;
            let s = (t / 2.0).min(1.0);
            let e = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let e1 = 30.0 * (s * (1.0 - s)).powi(2) / 2.0;
            let e2 = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / 4.0;
            let (sine, cosine) = (omega * t).sin_cos();
            Motion {
                displacement: peak * e * sine,
                velocity: peak * (e1 * sine + e * omega * cosine),
                acceleration: peak
                    * (e2 * sine + 2.0 * e1 * omega * cosine - e * omega * omega * sine),
            }
        })
        .collect()
}

#[test]
fn soft_limits_in_raw_units_do_not_protect_the_stroke_and_scaled_ones_do() {
    let run = |scale| {
        let mut control = controller(Parameters {
            weights: Weights {
                scale,
                ..Weights::TABLE_5_1
            },
            ..Parameters::default()
        });
        let run = track(&Rig::default(), Some(&mut control), &long_stroke(), 0, 0);
        let counters = control.memory.counters;
        assert!(counters.solved > 100, "{counters:?}");
        assert_eq!(counters.solved + counters.shortcuts, 4000);
        run.peak_displacement / INCH
    };
    let (raw, scaled) = (run([1.0; 3]), run([1.5 * INCH, 20.0 * INCH, G]));
    println!("peak {raw:.3} in with raw, {scaled:.3} in with scaled outputs");
    assert!(raw > 1.6, "{raw} in");
    assert!(scaled < 1.52, "{scaled} in");
}

#[test]
fn both_solvers_make_the_same_run() {
    let peak = |solver| {
        let mut control = controller(Parameters {
            solver,
            ..Parameters::default()
        });
        let run = track(&Rig::default(), Some(&mut control), &long_stroke(), 0, 0);
        assert!(control.memory.counters.solved > 100);
        (run.error, run.peak_displacement)
    };
    let (kwik, clarabel) = (peak(SolverChoice::Kwik), peak(SolverChoice::Clarabel));
    assert!((kwik.0 - clarabel.0).abs() < 1e-5, "{kwik:?} {clarabel:?}");
    assert!((kwik.1 - clarabel.1).abs() < 1e-8, "{kwik:?} {clarabel:?}");
}

#[test]
fn a_solver_that_gives_up_leaves_the_previous_plan_then_three_variable_control() {
    let reference = long_stroke();
    let mut control = controller(Parameters {
        iteration_limit: 0,
        ..Parameters::default()
    });
    let mut last_good = None;
    let mut planned = Vec::new();
    for k in 0..reference.len() {
        // A table that stands where the reference is.
        let input = ModelPredictiveInput::window(&reference, k, reference[k]).unwrap();
        let command = control.step(&input, H);
        let counters = control.memory.counters;
        if counters.shifted_plans == 0 {
            last_good = Some(control.clone_plan());
            continue;
        }
        if counters.low_level_alone > 0 {
            assert_eq!(command, reference[k]);
            break;
        }
        planned.push(command);
    }
    let counters = control.memory.counters;
    assert_eq!(counters.shifted_plans, 14, "{counters:?}");
    assert_eq!(planned[..], last_good.unwrap()[1..]);
    assert_eq!(counters.solved, 0);
}

impl ModelPredictiveControl {
    fn clone_plan(&self) -> Vec<Motion> {
        (0..self.parameters.horizon)
            .map(|i| {
                let [displacement, velocity, acceleration] = self.problem.command(&self.work, i);
                Motion {
                    displacement,
                    velocity,
                    acceleration,
                }
            })
            .collect()
    }
}

#[test]
fn a_restored_memory_goes_on_the_same_way() {
    let reference = long_stroke();
    let mut control = controller(Parameters {
        command_delay_samples: 1,
        loop_delay_samples: 1,
        ..Parameters::default()
    });
    let run = |control: &mut ModelPredictiveControl, range: std::ops::Range<usize>| {
        range
            .map(|k| {
                let input = ModelPredictiveInput::window(&reference, k, reference[k]).unwrap();
                control.step(&input, H)
            })
            .collect::<Vec<_>>()
    };
    run(&mut control, 0..900);
    let saved = control.memory;
    let once = run(&mut control, 900..1200);
    let mut other = controller(control.parameters().clone());
    other.memory = saved;
    assert_eq!(run(&mut other, 900..1200), once);
    other.reset();
    assert_eq!(other.memory, Memory::default());
}
