//! The assembled rig: energy, convergence, stiction, ends of the stroke, loss of the supply.

use super::*;
use crate::specimens::{YieldingSpecimen, YieldingState};
use units::constants::{INCH, LBF, PSI};

/// A chirp with pauses that holds and slides: V at time t.
fn command(t: f64) -> f64 {
    let pause = if t % 1.0 < 0.8 { 1.0 } else { 0.0 };
    pause * 1.2 * (std::f64::consts::TAU * (1.5 + 1.5 * t) * t).sin()
}

#[test]
fn energy_put_in_is_stored_or_dissipated() {
    let table = ServoHydraulicTable::default();
    let specimen = YieldingSpecimen::default();
    let (mut s, mut d) = (table.rest(), YieldingState::default());
    let input = |t: f64, d: &YieldingState| ServoHydraulicInput {
        valve_command: command(t),
        specimen_force: specimen.force(d),
        supply_lost: false,
    };
    let start = table.stored_energy(&s);
    // Simpson's rule over pairs of short steps with the inputs held over each pair.
    let h = INNER_STEP;
    let mut sum = [0.0_f64; 7];
    let mut moved: f64 = 0.0;
    for pair in 0..7_500 {
        let input = input(2.0 * h * f64::from(pair), &d);
        let half = table.advance(&s, &input, h);
        let full = table.advance(&half, &input, h);
        for (state, weight) in [(&s, 1.0), (&half, 4.0), (&full, 1.0)] {
            let p = table.powers(state, &input);
            let all = [
                p.supplied,
                p.throttled,
                p.leaked,
                p.piston,
                p.rubbed,
                p.damped,
                p.specimen,
            ];
            assert!(p.throttled >= 0.0 && p.leaked >= 0.0 && p.damped >= 0.0);
            for (total, power) in sum.iter_mut().zip(all) {
                *total += power * weight * h / 3.0;
            }
            moved += p.piston.abs() * weight * h / 3.0;
        }
        d = specimen.advance(&d, table.acceleration(&s, input.specimen_force), 2.0 * h);
        s = full;
    }
    let [
        supplied,
        throttled,
        leaked,
        piston,
        rubbed,
        damped,
        done_by_specimen,
    ] = sum;
    let end = table.stored_energy(&s);
    let hydraulic = supplied - throttled - leaked - piston - (end.oil - start.oil);
    let mechanical = piston + done_by_specimen
        - rubbed
        - damped
        - (end.kinetic + end.springs - start.kinetic - start.springs);
    println!(
        "supplied {supplied:.2} J = throttled {throttled:.2} + leaked {leaked:.2} + piston \
         {piston:.3} + oil {:.3}; off by {:.1e} of the piston's turnover of {moved:.2} J \
         (hydraulic) and {:.1e} (mechanical)",
        end.oil - start.oil,
        hydraulic / moved,
        mechanical / moved
    );
    assert!(rubbed > 0.05 * moved, "friction took part");
    // Measured by what the piston turned over: the supply's energy is a hundred times more.
    assert!(hydraulic.abs() < 1e-3 * moved);
    assert!(mechanical.abs() < 1e-3 * moved);
}

#[test]
fn the_inner_step_is_fine_enough_and_the_estimate_says_so() {
    let table = ServoHydraulicTable::default();
    let (mut coarse, mut fine) = (table.rest(), table.rest());
    let (mut worst, mut travel): (f64, f64) = (0.0, 0.0);
    for k in 0..1000 {
        let input = ServoHydraulicInput {
            valve_command: command(0.002 * f64::from(k)),
            ..ServoHydraulicInput::default()
        };
        let (estimated, error) = table.advance_with_error(&coarse, &input, 0.002, INNER_STEP);
        coarse = table.advance(&coarse, &input, 0.002);
        assert_eq!(coarse, estimated);
        assert!(error.displacement < 2e-6 && error.displacement >= 0.0);
        fine = table
            .advance_with_error(&fine, &input, 0.002, INNER_STEP / 20.0)
            .0;
        worst = worst.max((coarse.displacement - fine.displacement).abs());
        travel = travel.max(fine.displacement.abs());
    }
    println!("displacement off by {worst:.1e} m of {travel:.1e} m");
    assert!(worst < 2e-4 * travel);
}

#[test]
fn quicker_rigs_take_finer_steps_to_the_same_bound_and_the_quickest_are_refused() {
    use units::constants::{LBF_S_PER_INCH, PSI};
    let default = ServoHydraulicTable::default();
    assert_eq!(default.inner_step(), INNER_STEP);
    let mut braked = default;
    braked.stops.cushion_damping = 5000.0 * LBF_S_PER_INCH;
    let mut stiff = default;
    stiff.cylinder.volume = 2.5 * INCH.powi(3);
    stiff.cylinder.bulk_modulus = 1.5e5 * PSI;
    for table in [braked, stiff] {
        table.validate().unwrap();
        let (mut own, mut fine) = (table.rest(), table.rest());
        let (mut worst, mut peak, mut worst_pressure): (f64, f64, f64) = (0.0, 0.0, 0.0);
        for k in 0..500 {
            // Into the cushion and back.
            let input = ServoHydraulicInput {
                valve_command: if k < 250 { 4.0 } else { -4.0 },
                ..ServoHydraulicInput::default()
            };
            own = table.advance(&own, &input, 0.002);
            fine = table
                .advance_with_error(&fine, &input, 0.002, table.inner_step() / 8.0)
                .0;
            let [a, b] = [&own, &fine].map(|state| table.acceleration(state, 0.0));
            worst = worst.max((a - b).abs());
            peak = peak.max(b.abs());
            worst_pressure = worst_pressure.max((own.pressures[0] - fine.pressures[0]).abs());
        }
        println!(
            "{:.1} µs: acceleration off by {:.1e} of its peak, pressure by {:.1} psi",
            1e6 * table.inner_step(),
            worst / peak,
            worst_pressure / PSI
        );
        assert!(worst < 0.01 * peak);
    }
    let mut wild = default;
    wild.stops.cushion_damping = 1e8 * LBF_S_PER_INCH;
    let error = wild.validate().unwrap_err().to_string();
    assert!(error.contains("cushion_damping"), "{error}");
}

#[test]
fn stiction_holds_the_table_where_it_was_left() {
    let table = ServoHydraulicTable::default();
    let mut s = ServoHydraulicState {
        displacement: 0.05 * INCH,
        ..table.rest()
    };
    let settle = |mut s: ServoHydraulicState, force: f64, seconds: u32| {
        let input = ServoHydraulicInput {
            specimen_force: force,
            ..ServoHydraulicInput::default()
        };
        for _ in 0..500 * seconds {
            s = table.advance(&s, &input, 0.002);
        }
        s
    };
    // The spring pulls with 1.2 lbf, the seals hold 3.
    s = settle(s, 0.0, 8);
    let first = s.displacement;
    s = settle(s, 0.0, 10);
    assert!((s.displacement - first).abs() < 1e-8, "crept");
    assert!(first > 0.045 * INCH, "held at {} in", first / INCH);
    // A push of 12 lbf breaks it away and it stays somewhere else.
    s = settle(s, 12.0 * LBF, 3);
    let moved = settle(s, 0.0, 3).displacement;
    assert!((moved - first).abs() > 0.01 * INCH);
}

#[test]
fn the_ends_of_the_stroke_hold_the_piston_at_full_valve() {
    let table = ServoHydraulicTable::default();
    let mut s = table.rest();
    let mut deepest: f64 = 0.0;
    for sign in [1.0, -1.0] {
        let input = ServoHydraulicInput {
            valve_command: 10.0 * sign,
            ..ServoHydraulicInput::default()
        };
        for _ in 0..1000 {
            s = table.advance(&s, &input, 0.002);
            deepest = deepest.max(s.displacement.abs());
            assert!(s.pressures.iter().all(|p| p.is_finite()));
        }
        assert!(
            table.stops.is_hit(s.displacement),
            "{}",
            s.displacement / INCH
        );
        assert!(s.velocity.abs() < 1e-6, "at rest on the stop");
    }
    // Stall force of 1200 lbf on 5e4 lbf/in is 0.024 in.
    assert!(
        deepest < table.stops.stroke + 0.06 * INCH,
        "{} in",
        deepest / INCH
    );
}

#[test]
fn a_lost_supply_leaves_the_table_without_force() {
    let table = ServoHydraulicTable::default();
    let mut s = table.rest();
    for k in 0..2000 {
        let input = ServoHydraulicInput {
            valve_command: command(0.002 * f64::from(k)),
            specimen_force: 0.0,
            supply_lost: k >= 500,
        };
        s = table.advance(&s, &input, 0.002);
        assert!(
            s.pressures.iter().all(|&p| p > -30.0 * PSI),
            "{:?}",
            s.pressures
        );
    }
    assert!(s.supply_pressure < 1.0 * PSI);
    assert!(s.velocity.abs() < 0.5 * INCH);
}

#[test]
fn droop_follows_the_mean_demand() {
    let table = ServoHydraulicTable::default();
    let mut s = table.rest();
    let mut lowest = s.supply_pressure;
    for k in 0..2000 {
        let input = ServoHydraulicInput {
            valve_command: 5.0 * (std::f64::consts::TAU * 2.0 * 0.002 * f64::from(k)).sin(),
            ..ServoHydraulicInput::default()
        };
        s = table.advance(&s, &input, 0.002);
        lowest = lowest.min(s.supply_pressure);
    }
    let droop = (3000.0 * PSI - lowest) / PSI;
    // Mean |flow| near 2/π · 5 V · 1.62 in³/s/V = 5.2 in³/s over 0.05 in³/s/psi is 103 psi.
    assert!((60.0..150.0).contains(&droop), "{droop} psi");
}

#[test]
fn co_simulation_with_the_specimen_approaches_the_whole_rig() {
    let rig = ServoHydraulicRig::default();
    let truth_at = |t: f64| {
        let mut s = rig.rest();
        for k in 0..(t / 0.002).round() as u32 {
            s = rig.advance(&s, command(0.002 * f64::from(k)), 0.002, 5e-5);
        }
        s
    };
    let truth = truth_at(0.6);
    let error = |parts: u32| {
        let (mut s, mut d) = (rig.table.rest(), YieldingState::default());
        for k in 0..300 * parts {
            let held = k / parts;
            let input = ServoHydraulicInput {
                valve_command: command(0.002 * f64::from(held)),
                specimen_force: rig.specimen.force(&d),
                supply_lost: false,
            };
            let h = 0.002 / f64::from(parts);
            let a = rig.table.acceleration(&s, input.specimen_force);
            s = rig.table.advance(&s, &input, h);
            d = rig.specimen.advance(&d, a, h);
        }
        (d.drift - truth.specimen.drift).abs()
    };
    let errors = [error(1), error(2), error(4)];
    println!("drift off by {errors:?} of {} m", truth.specimen.drift);
    assert!(errors[0] < 0.05 * truth.specimen.drift.abs());
    for pair in errors.windows(2) {
        assert!(
            (1.6..2.5).contains(&(pair[0] / pair[1])),
            "first order: {errors:?}"
        );
    }
}

#[test]
fn faint_friction_moves_the_table_as_none_does_or_is_refused_by_name() {
    let swept = |coulomb: f64| {
        let mut table = ServoHydraulicTable::default();
        table.friction.coulomb = coulomb;
        table.friction.static_force = coulomb * 4.0 / 3.0;
        table.validate()?;
        let mut state = table.rest();
        let run = |k: i32| {
            let t = 0.002 * f64::from(k);
            let input = ServoHydraulicInput {
                valve_command: 8.0 * (12.0 * t).cos() + (60.0 * t).sin(),
                ..ServoHydraulicInput::default()
            };
            state = table.advance(&state, &input, 0.002);
            state.displacement.powi(2)
        };
        Ok::<f64, ModelError>(((0..1000).map(run).sum::<f64>() / 1000.0).sqrt())
    };
    let none = swept(0.0).unwrap();
    for coulomb in [0.1, 0.01, 1e-3, 1e-4] {
        let faint = swept(coulomb).unwrap();
        assert!(
            (faint / none - 1.0).abs() < 1e-5,
            "{coulomb} N: {faint} m, without {none} m"
        );
    }
    let refused = swept(1e-5).unwrap_err().to_string();
    assert!(
        refused.contains("`coulomb_friction`") && refused.contains("zero"),
        "{refused}"
    );
}

#[test]
fn cushion_and_stop_take_energy_and_the_load_cell_reads_what_moves_the_table() {
    let table = ServoHydraulicTable::default();
    let Stops {
        stroke,
        cushion_length,
        ..
    } = table.stops;
    let input = ServoHydraulicInput::default();
    let h = 1e-5;
    // Into the cushion, and out of its last part into the stop.
    for (way, hits) in [(cushion_length, false), (0.05 * cushion_length, true)] {
        let mut s = ServoHydraulicState {
            displacement: stroke - way,
            velocity: 0.8,
            ..table.rest()
        };
        let start = table.stored_energy(&s);
        let (mut put_in, mut largest, mut deepest) = (0.0, 0.0_f64, 0.0_f64);
        let mut last = None;
        for _ in 0..2000 {
            let p = table.powers(&s, &input);
            assert!(p.rubbed >= 0.0);
            let net = p.piston - p.rubbed - p.damped;
            if let Some(before) = last {
                put_in += 0.5 * h * (net + before);
            }
            last = Some(net);
            // Newton: the reading of the load cell, spring and damper are all that acts.
            let expected = (table.actuator_force(&s)
                - table.table.damping * s.velocity
                - table.table.stiffness * s.displacement)
                / table.mass();
            let got = table.derivatives(&s, &input).velocity;
            assert!((got - expected).abs() < 1e-9 * expected.abs().max(1.0));
            let now = table.stored_energy(&s);
            let change = now.kinetic + now.springs - start.kinetic - start.springs;
            largest = largest.max((put_in - change).abs());
            deepest = deepest.max(s.displacement);
            s = table.advance_with_error(&s, &input, h, h).0;
        }
        assert_eq!(deepest > stroke, hits);
        assert!(
            largest < 1e-3 * start.kinetic,
            "{largest} J of {} J",
            start.kinetic
        );
    }
}

#[test]
fn a_payload_and_a_cubic_spring_act_as_mass_and_force() {
    let plain = ServoHydraulicTable::default();
    let table = ServoHydraulicTable {
        added_payload: 15.0,
        cubic_stiffness: 3e7,
        ..plain
    };
    assert!((table.mass() - plain.table.mass - 15.0).abs() < 1e-12);
    let s = ServoHydraulicState {
        displacement: 0.02,
        ..table.rest()
    };
    let without = plain.acceleration(&s, 0.0) * plain.mass();
    let with = table.acceleration(&s, 0.0) * table.mass();
    // k3 x³ = 3e7 * 8e-6 N against the motion.
    assert!((with - without + 240.0).abs() < 1e-9, "{with} {without}");
}
