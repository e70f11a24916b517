//! Preview control on its own model.

use super::model::Hydraulics;
use super::*;
use plant::specimens::YieldingSpecimen;

fn hydraulic() -> Parameters {
    let mut parameters = Parameters {
        delay: 1,
        ..Parameters::default()
    };
    parameters.rig.hydraulics = Some(Hydraulics {
        spool_lag: 0.0048,
        spool_inertia: 7e-6,
        force_rate: 2e4,
        oil_stiffness: 1.87e5,
        leakage_rate: 2.7,
        seal_damping: 880.0,
    });
    parameters.load.friction = 13.0;
    parameters.load.specimen = Some(YieldingSpecimen::default());
    parameters
}

fn motion(t: f64) -> Motion {
    // A burst of 3 Hz that begins and ends at rest.
    let omega = std::f64::consts::TAU * 3.0;
    let (amplitude, t) = (0.004, t - 0.3);
    if !(0.0..2.0).contains(&t) {
        return Motion::default();
    }
    let envelope = std::f64::consts::PI / 2.0;
    let (s, c) = (envelope * t).sin_cos();
    let (a, b) = (omega * t).sin_cos();
    // x = A s² sin(wt)
    let (e, de, dde) = (
        s * s,
        2.0 * s * c * envelope,
        2.0 * envelope * envelope * (c * c - s * s),
    );
    Motion {
        displacement: amplitude * e * a,
        velocity: amplitude * (de * a + e * omega * b),
        acceleration: amplitude * (dde * a + 2.0 * de * omega * b - e * omega * omega * a),
    }
}

/// The controller on its own sampled model, with an unknown force and offset: rms of the error of
/// acceleration over its peak.
fn error(parameters: Parameters, force: f64, offset: f64) -> f64 {
    let mut control = PreviewControl::new(parameters).unwrap();
    let rig = *control.rig();
    let h = parameters.period;
    let mut x = SVector::<f64, STATES>::zeros();
    let mut load = LoadState::default();
    let mut late = vec![Motion::default(); parameters.delay + 1];
    let (mut sum, mut peak, mut f) = (0.0f64, 0.0f64, 0.0);
    let count = 1500;
    for k in 0..count {
        let at = |j: usize| motion((k + j) as f64 * h);
        let y = rig.c * x + rig.d * (f + force);
        late.rotate_right(1);
        late[0] = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        let wanted = at(0);
        peak = peak.max(wanted.acceleration.abs());
        sum += (wanted.acceleration - y[2]).powi(2);
        let input = PreviewInput {
            reference: std::array::from_fn(at),
            measured: late[parameters.delay],
            ..PreviewInput::default()
        };
        let u = control.step(&input, h) + offset;
        load = parameters.load.advance(&load, [&wanted, &at(1)], h);
        let next = parameters.load.force(&load, &at(1));
        x = rig.advance(&x, u, [f + force, next + force]);
        f = next;
    }
    100.0 * (sum / f64::from(count as u32)).sqrt() / peak
}

#[test]
fn on_its_own_model_the_motion_is_followed() {
    let known = error(hydraulic(), 0.0, 0.0);
    let extrapolated = error(
        Parameters {
            preview: false,
            ..hydraulic()
        },
        0.0,
        0.0,
    );
    println!("known ahead {known:.4} %, extrapolated {extrapolated:.3} %");
    assert!(known < 0.1, "{known}");
    assert!(extrapolated > 3.0 * known, "{extrapolated}");
}

/// Displacement (m) that is left after 20 s under a constant force and a valve off its null.
fn offset_left(parameters: Parameters) -> f64 {
    let mut control = PreviewControl::new(parameters).unwrap();
    let rig = *control.rig();
    let mut x = SVector::<f64, STATES>::zeros();
    let mut late = Motion::default();
    for _ in 0..10_000 {
        let y = rig.c * x + rig.d * 20.0;
        let input = PreviewInput {
            measured: late,
            ..PreviewInput::default()
        };
        late = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        let u = control.step(&input, parameters.period) + 0.3;
        x = rig.advance(&x, u, [20.0; 2]);
    }
    x[3].abs()
}

#[test]
fn a_constant_force_and_a_valve_off_its_null_leave_no_offset() {
    // What the filter takes to fade is what is left of the displacement.
    let left = offset_left(hydraulic());
    assert!(left < 2e-6, "{left}");
}

/// A controller with friction `law` on a rig whose friction is `seals`: rms of the error of
/// acceleration over its peak, %.
fn error_on_dry_seals(parameters: Parameters, seals: KnownLoad) -> f64 {
    let mut control = PreviewControl::new(parameters).unwrap();
    let rig = *control.rig();
    let h = parameters.period;
    let mut x = SVector::<f64, STATES>::zeros();
    let mut load = LoadState::default();
    let (mut late, mut before) = (Motion::default(), Motion::default());
    let (mut sum, mut peak, mut force) = (0.0f64, 0.0f64, 0.0f64);
    for k in 0..1500 {
        let wanted = motion(f64::from(k) * h);
        let y = rig.c * x + rig.d * force;
        sum += (wanted.acceleration - y[2]).powi(2);
        peak = peak.max(wanted.acceleration.abs());
        let reference = std::array::from_fn(|j| motion((f64::from(k) + j as f64) * h));
        let u = control.step(
            &PreviewInput {
                reference,
                measured: late,
                ..PreviewInput::default()
            },
            h,
        );
        late = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        // The friction follows the true velocity, a sample late.
        load = seals.advance(&load, [&before, &late], h);
        let next = seals.force(&load, &late);
        x = rig.advance(&x, u, [force, next]);
        force = next;
        before = late;
    }
    100.0 * (sum / 1500.0).sqrt() / peak
}

#[test]
fn dry_friction_is_the_floor_where_it_is_not_known() {
    let mut known = hydraulic();
    known.load.specimen = None;
    let seals = known.load;
    let mut unknown = known;
    unknown.load.friction = 0.0;
    let with = error_on_dry_seals(known, seals);
    let without = error_on_dry_seals(unknown, seals);
    println!("known {with:.2} %, unknown {without:.2} %");
    assert!(without > 3.0 * with, "{without} {with}");
}

#[test]
fn the_valve_limit_holds_and_the_model_knows_it() {
    let parameters = Parameters {
        limit: 1.0,
        ..hydraulic()
    };
    let mut control = PreviewControl::new(parameters).unwrap();
    let mut largest = 0.0f64;
    for k in 0..1500 {
        let at = |j: usize| {
            let one = motion((k + j) as f64 * parameters.period);
            Motion {
                displacement: 8.0 * one.displacement,
                velocity: 8.0 * one.velocity,
                acceleration: 8.0 * one.acceleration,
            }
        };
        let input = PreviewInput {
            reference: std::array::from_fn(at),
            measured: at(0),
            ..PreviewInput::default()
        };
        let u = control.step(&input, parameters.period);
        assert!(u.abs() <= 1.0);
        largest = largest.max(control.memory.command.abs());
    }
    assert_eq!(largest, 1.0);
}

#[test]
fn compensation_holds_a_table_still_under_the_loads_of_a_motion() {
    let loaded = hydraulic();
    let mut compensation = PreviewControl::new(Parameters {
        role: Role::Compensation,
        ..loaded
    })
    .unwrap();
    let rig = *compensation.rig();
    let h = loaded.period;
    // The rig under the loads, once left alone and once held; another's command passes through.
    let mut both = [SVector::<f64, STATES>::zeros(); 2];
    let (mut load, mut force) = (LoadState::default(), 0.0);
    let mut largest = [0.0f64; 2];
    for k in 0..1500 {
        let at = |j: usize| motion((k + j) as f64 * h);
        let u = compensation.step(
            &PreviewInput {
                reference: std::array::from_fn(at),
                command: 0.25,
                ..PreviewInput::default()
            },
            h,
        ) - 0.25;
        load = loaded.load.advance(&load, [&at(0), &at(1)], h);
        let next = loaded.load.force(&load, &at(1));
        for (i, command) in [0.0, u].into_iter().enumerate() {
            both[i] = rig.advance(&both[i], command, [force, next]);
            let a = (rig.c * both[i] + rig.d * next)[2];
            largest[i] = largest[i].max(a.abs());
        }
        force = next;
    }
    println!("left alone {:.3}, held {:.4} m/s2", largest[0], largest[1]);
    assert!(largest[1] < 0.2 * largest[0], "{largest:?}");
}

/// Multi-metric control on the rig of its model.
#[test]
fn multi_metric_control_brings_the_rig_to_the_motion_itself() {
    let mut parameters = hydraulic();
    parameters.load = Parameters::default().load;
    let rig = parameters
        .rig
        .sample(parameters.period)
        .driven(parameters.period);
    let fit = crate::tuning::acceleration_tracking::Shaping::fitted(parameters.period, |at| {
        let z = nalgebra::Complex::new(0.0, at * parameters.period).exp();
        let one = nalgebra::Complex::new(1.0, 0.0);
        (rig.evaluate(z).unwrap()[(0, 0)], one)
    })
    .unwrap();
    assert!(fit.left < 0.02, "{fit:?}");
    parameters.role = Role::MultiMetric;
    parameters.shaping = fit.gains;
    parameters.shaping_lead = fit.lead;
    let own = error(parameters, 0.0, 0.0);
    println!("{own:.3} %");
    assert!(own < 0.5, "{own}");
    // The inverse alone has nothing that brings the table back.
    let left = offset_left(parameters);
    assert!(left < 2e-6, "{left}");
}
