use super::*;
use crate::preview::model::STATES;

fn law(variant: Variant) -> SurfaceControl {
    SurfaceControl::new(Parameters {
        variant,
        ..Parameters::default()
    })
    .unwrap()
}

/// Follows a sine on the rig that it knows under a constant force and an offset of the valve; error of the
/// displacement over its amplitude after a second.
fn error(mut law: SurfaceControl, hertz: f64, force: f64, offset: f64) -> f64 {
    let p = *law.parameters();
    let rig = p.rig.model().sample(p.period);
    let omega = std::f64::consts::TAU * hertz;
    let size = 0.1 / omega;
    let wanted = |k: usize| {
        // Begins at rest.
        let t = p.period * k as f64;
        let begin = 1.0 - (-t / 0.3).exp() * (1.0 + t / 0.3);
        let (s, c) = (omega * t).sin_cos();
        let slope = (-t / 0.3).exp() * t / 0.09;
        let bend = (-t / 0.3).exp() * (1.0 - t / 0.3) / 0.09;
        Motion {
            displacement: size * begin * s,
            velocity: size * (slope * s + begin * omega * c),
            acceleration: size * (bend * s + 2.0 * slope * omega * c - begin * omega * omega * s),
        }
    };
    let mut x = SVector::<f64, STATES>::zeros();
    let mut late = [Motion::default(); 5];
    let mut worst = 0.0_f64;
    for k in 0..4000 {
        let y = rig.c * x + rig.d * force;
        late.rotate_right(1);
        late[0] = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        let input = SurfaceInput {
            reference: std::array::from_fn(|j| wanted(k + j)),
            measured: late[p.rig.delay],
        };
        let command = law.step(&input, p.period);
        if k > 2500 {
            worst = worst.max((y[0] - wanted(k).displacement).abs());
        }
        x = rig.advance(&x, command + offset, [force, force]);
    }
    worst / size
}

#[test]
fn every_variant_follows_a_slow_sine_against_a_force_and_an_offset() {
    for (variant, bound) in [
        (Variant::MultipleSurface, 0.08),
        (Variant::DynamicSurface, 0.1),
        (Variant::RecedingHorizon, 0.01),
    ] {
        let mut own = law(variant).parameters().with_rate(40.0);
        if variant == Variant::RecedingHorizon {
            own = *law(variant).parameters();
        }
        if variant != Variant::RecedingHorizon {
            own.lead = (own.lateness().unwrap() / own.period).round() as usize;
        }
        let law = SurfaceControl::new(own).unwrap();
        let plain = error(law.clone(), 1.0, 0.0, 0.0);
        let loaded = error(law, 1.0, 20.0, 0.1);
        println!("{variant:?}: {plain} {loaded}");
        assert!(plain < bound && loaded < 1.2 * bound, "{plain} {loaded}");
    }
}

/// A step of the reference in `S` alone: the surface is left as `exp(-K1 t)`, the closed form of all three, on the
/// model without delay.
#[test]
fn the_surface_dies_away_at_the_reaching_rate() {
    let mut law = law(Variant::RecedingHorizon);
    let p = *law.parameters();
    let rig = p.rig.model().sample(p.period);
    // Displaced, at rest under its springs: the filter knows.
    let mut x = SVector::<f64, STATES>::zeros();
    let place = 0.005;
    x[2] = p.rig.table.stiffness * place;
    x[3] = place;
    law.memory.feedback = FeedbackState::default();
    let held = p.rig.opening(x[2], 0.0);
    x[0] = held;
    let still = Motion {
        displacement: place,
        ..Motion::default()
    };
    // The filter settles while the place is wanted.
    let wanted = SurfaceInput {
        reference: [still; PREVIEW + 1],
        measured: still,
    };
    for _ in 0..3000 {
        let y = rig.c * x;
        let measured = Motion {
            displacement: y[0],
            velocity: y[1],
            acceleration: y[2],
        };
        let u = law.step(&SurfaceInput { measured, ..wanted }, p.period);
        x = rig.advance(&x, u, [0.0; 2]);
    }
    let mut found = Vec::new();
    for _ in 0..100 {
        let y = rig.c * x;
        found.push(y[1] + p.surface_rate * y[0]);
        let input = SurfaceInput {
            measured: Motion {
                displacement: y[0],
                velocity: y[1],
                acceleration: y[2],
            },
            ..SurfaceInput::default()
        };
        let u = law.step(&input, p.period);
        x = rig.advance(&x, u, [0.0; 2]);
    }
    let first = found[0];
    assert!((first / (p.surface_rate * place) - 1.0).abs() < 0.05);
    for k in [30, 60, 99] {
        let expected = first * (-p.reaching_rates[0] * p.period * k as f64).exp();
        println!("{k}: {} {expected}", found[k]);
        assert!((found[k] - expected).abs() < 0.1 * first, "{k}");
    }
}

#[test]
fn parameters_that_make_no_law_are_refused_by_name() {
    let refused = |change: fn(&mut Parameters)| {
        let mut parameters = Parameters::default();
        change(&mut parameters);
        SurfaceControl::new(parameters).unwrap_err().to_string()
    };
    assert!(refused(|p| p.surface_rate = 0.0).contains("`surface_rate`"));
    assert!(refused(|p| p.reaching_rates[1] = f64::NAN).contains("`oil_reaching_rate`"));
    assert!(refused(|p| p.filter_times[1] = -1.0).contains("`spool_filter_time`"));
    assert!(refused(|p| p.rig.delay = 9).contains("`loop_delay_samples`"));
}
