use super::*;

const H: f64 = SAMPLING_PERIOD;

/// A healthy sample of a slow motion.
fn healthy(k: u32) -> InterlockInput {
    let t = H * f64::from(k);
    let (s, c) = (6.0 * t).sin_cos();
    let measured = Motion {
        displacement: 0.02 * s,
        velocity: 0.12 * c,
        acceleration: -0.72 * s,
    };
    InterlockInput {
        valve_command: 3.0 * c,
        reference_displacement: 0.02 * (6.0 * t + 0.02).sin(),
        measured,
        measured_force: 40.0 * c,
        heartbeat: k as i32,
        ..InterlockInput::default()
    }
}

/// Runs `count` samples with `disturb` applied; returns the interlock and the commands.
fn run(
    mut interlock: Interlock,
    count: u32,
    disturb: impl Fn(u32, &mut InterlockInput),
) -> (Interlock, Vec<f64>) {
    interlock.validate().unwrap();
    let commands = (0..count)
        .map(|k| {
            let mut input = healthy(k);
            disturb(k, &mut input);
            interlock.step(&input, H)
        })
        .collect();
    (interlock, commands)
}

#[test]
fn a_healthy_run_passes_through_untouched() {
    let (interlock, commands) = run(Interlock::laboratory(), 2000, |_, _| ());
    assert_eq!(interlock.memory.trip, Trip::None);
    for (k, command) in commands.into_iter().enumerate() {
        assert_eq!(command, healthy(k as u32).valve_command);
    }
}

#[test]
fn every_cause_trips_at_its_sample_ramps_without_a_jump_and_stays() {
    type Disturb = fn(&mut InterlockInput);
    let cases: [(Trip, u32, Disturb); 11] = [
        (Trip::NotFinite, 0, |i| i.valve_command = f64::NAN),
        (Trip::NotFinite, 0, |i| {
            i.measured.acceleration = f64::INFINITY
        }),
        (Trip::Stop, 0, |i| i.stop = true),
        (Trip::Displacement, 0, |i| {
            i.measured.displacement = 1.46 * INCH;
            i.reference_displacement = i.measured.displacement;
        }),
        (Trip::StoppingDistance, 0, |i| {
            i.measured.displacement = -1.2 * INCH;
            i.measured.velocity = -16.0 * INCH;
            i.reference_displacement = i.measured.displacement;
        }),
        (Trip::Velocity, 0, |i| i.measured.velocity = 41.0 * INCH),
        (Trip::Acceleration, 0, |i| {
            i.measured.acceleration = -4.0 * G
        }),
        (Trip::Force, 0, |i| i.measured_force = 1001.0 * LBF),
        (Trip::TrackingError, 0, |i| {
            i.reference_displacement += 1.05 * INCH
        }),
        // 0.1 s of saturation are allowed: 50 samples, the next one trips.
        (Trip::Saturation, 50, |i| i.valve_command = 10.0),
        // The first repeat is the second equal sample.
        (Trip::Stale, 10, |i| i.measured_force = 12.3),
    ];
    for (cause, later, disturb) in cases {
        let from = 30;
        let (interlock, commands) = run(Interlock::laboratory(), 300, |k, input| {
            if k >= from {
                disturb(input);
            }
        });
        let m = interlock.memory;
        let trip = (from + later) as usize;
        assert_eq!(m.trip, cause);
        assert!(
            (m.trip_time - H * trip as f64).abs() < 1e-12,
            "{cause:?} at {} s",
            m.trip_time
        );
        // At null within the time that the documentation states, and for good.
        let null = trip + (TIME_TO_NULL / H).ceil() as usize;
        assert!(commands[null - 1..].iter().all(|&u| u == 0.0), "{cause:?}");
        assert!(commands.iter().all(|u| u.is_finite()));
        // No jump: each step of the ramp is a tenth of the command before the trip.
        let before = commands[trip - 1];
        for k in trip..null {
            let jump = (commands[k] - commands[k - 1]).abs();
            assert!(
                jump <= 0.1 * before.abs() * (1.0 + 1e-6),
                "{cause:?}: {jump}"
            );
        }
    }
}

#[test]
fn a_heartbeat_that_stands_still_trips_after_its_samples() {
    let interlock = Interlock {
        heartbeat_samples: 5,
        ..Interlock::laboratory()
    };
    let (interlock, _) = run(interlock, 200, |k, input| {
        input.heartbeat = k.min(100) as i32;
    });
    assert_eq!(interlock.memory.trip, Trip::Heartbeat);
    assert!((interlock.memory.trip_time - 105.0 * H).abs() < 1e-12);
}

#[test]
fn a_standing_reference_does_not_make_channels_stale() {
    let (interlock, _) = run(Interlock::laboratory(), 1000, |_, input| {
        *input = InterlockInput {
            measured_force: 5.0,
            ..InterlockInput::default()
        };
    });
    assert_eq!(interlock.memory.trip, Trip::None);
}

#[test]
fn a_reset_needs_an_edge_and_a_cause_that_is_gone_and_fades_in() {
    let faulty = 100..400;
    let (interlock, commands) = run(Interlock::laboratory(), 700, |k, input| {
        if faulty.contains(&k) {
            input.measured.velocity = 50.0 * INCH;
        }
        // Held from before the fault ended: no edge. An edge during the fault: refused.
        input.reset = (200..450).contains(&k) || k >= 500;
    });
    assert!(commands[120..500].iter().all(|&u| u == 0.0));
    assert_eq!(interlock.memory.trip, Trip::None);
    for k in 501..510 {
        assert!(
            (commands[k] - commands[k - 1]).abs() < 0.11 * 3.0,
            "fades in"
        );
    }
    assert_eq!(commands[600], healthy(600).valve_command);
}

#[test]
fn causes_have_numbers_and_words_of_their_own() {
    for (number, trip) in Trip::ALL.into_iter().enumerate() {
        assert_eq!(trip as usize, number);
        let same = Trip::ALL
            .iter()
            .filter(|other| other.words() == trip.words());
        assert_eq!(same.count(), 1);
    }
}
