use units::constants::SAMPLING_PERIOD;

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

/// Longest time from a trip to the valve at null with the default settings, s.
const TIME_TO_NULL: f64 = 0.02 + H;

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
    let cases: [(Trip, u32, Disturb); 12] = [
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
        // The reference rises: the upper end of its range is its present value.
        (Trip::TrackingError, 0, |i| {
            i.measured.displacement = i.reference_displacement + 0.16 * INCH
        }),
        // Each change of 14 V adds 14 V / 0.102 s = 137 V/s to the mean, which fades by 2 % a sample; the
        // first one is smaller. The command itself may go four times 250 V/s.
        (Trip::Activity, 8, |i| {
            i.valve_command = if i.heartbeat % 2 == 0 { 7.0 } else { -7.0 };
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

/// The first sample at which a command of 20 Hz with `amplitude` (V) trips, if any.
fn trip_under_a_sine(amplitude: f64) -> Option<f64> {
    let (interlock, _) = run(Interlock::laboratory(), 2000, |k, input| {
        let phase = std::f64::consts::TAU * 20.0 * H * f64::from(k);
        input.valve_command = amplitude * phase.sin();
    });
    let m = interlock.memory;
    assert!(matches!(m.trip, Trip::None | Trip::Activity));
    (m.trip == Trip::Activity).then_some(m.trip_time)
}

#[test]
fn activity_is_the_way_of_the_command_per_second() {
    // A sine of 20 Hz with 3.125 V goes 4 * 20 * 3.125 = 250 V in a second; the mean over 0.1 s
    // swings by 3 %.
    assert_eq!(trip_under_a_sine(2.9), None);
    assert!(trip_under_a_sine(3.3).is_some());
}

#[test]
fn noise_is_no_oscillation_and_a_weak_supply_trips() {
    // White noise of 0.9 V goes 0.9 * 2/sqrt(pi) / 2 ms = 508 V in a second, its mean of four samples
    // a quarter of it.
    let noisy = |size: f64| {
        run(Interlock::laboratory(), 4000, move |k, input| {
            let noise = plant::sensors::channel::Noise {
                seed: 5,
                channel: 0,
                sample: u64::from(k),
            };
            input.valve_command = size * noise.gaussian();
        })
        .0
        .memory
        .trip
    };
    assert_eq!(noisy(0.9), Trip::None);
    assert_eq!(noisy(3.0), Trip::Activity);
    let watched = Interlock {
        pressure_limit: 1e7,
        ..Interlock::laboratory()
    };
    let supply = |pressure: f64| {
        run(watched, 100, move |_, input| {
            input.supply_pressure = pressure
        })
        .0
        .memory
        .trip
    };
    assert_eq!(supply(2e7), Trip::None);
    assert_eq!(supply(3.4e6), Trip::Pressure);
}

#[test]
fn the_accumulator_gives_a_peak_and_the_pump_no_more_than_it_can_for_long() {
    let cubic_inch = INCH.powi(3);
    let watched = Interlock {
        flow_limit: 10.0 * cubic_inch,
        ..Interlock::laboratory()
    };
    let drawn = |flow: f64, until: u32| {
        let (interlock, _) = run(watched, 3000, move |k, input| {
            input.supply_flow = if k < until { flow } else { 0.0 };
        });
        (interlock.memory.trip, interlock.memory.trip_time)
    };
    assert_eq!(drawn(9.9 * cubic_inch, 3000).0, Trip::None);
    // The mean of a step is 1 - exp(-t): a fifth of a second of 40 in³/s passes, ln(4/3) s do not.
    assert_eq!(drawn(40.0 * cubic_inch, 100).0, Trip::None);
    let (trip, time) = drawn(40.0 * cubic_inch, 3000);
    assert_eq!(trip, Trip::Flow);
    assert!((time - f64::ln(4.0 / 3.0)).abs() < 2.0 * H, "{time}");
    let off = Interlock {
        flow_limit: 0.0,
        ..watched
    };
    let (interlock, _) = run(off, 3000, |_, input| input.supply_flow = cubic_inch * 1e3);
    assert_eq!(interlock.memory.trip, Trip::None);
}

#[test]
fn a_table_that_lags_is_not_lost_and_one_that_stands_is() {
    let motion = |t: f64| 1.2 * INCH * (6.0 * t).sin();
    let follow = |x: fn(f64) -> f64| {
        run(Interlock::laboratory(), 2000, move |k, input| {
            let t = H * f64::from(k);
            input.reference_displacement = motion(t);
            input.measured = Motion {
                displacement: 1.2 * INCH * x(t),
                ..input.measured
            };
        })
        .0
        .memory
    };
    // 50 ms late at 7.2 in/s: 0.36 in behind.
    assert_eq!(follow(|t| (6.0 * t - 0.3).max(0.0).sin()).trip, Trip::None);
    // A table that stands trips while the reference goes out for the first time.
    let stands = follow(|t| 1e-3 * (50.0 * t).sin());
    assert_eq!(stands.trip, Trip::TrackingError);
    assert!(stands.trip_time < 0.2, "{} s", stands.trip_time);
}

#[test]
fn a_chattering_table_does_not_make_its_specimen_lost() {
    let interlock = Interlock {
        specimen_silence: 0.012 * G,
        activity_limit: 1e9,
        ..Interlock::laboratory()
    };
    let chatter = |speed: f64| {
        move |k: u32, input: &mut InterlockInput| {
            let sign = if k % 4 < 2 { 1.0 } else { -1.0 };
            input.measured.acceleration = sign * 2.0 * G;
            input.measured.velocity = sign * speed;
            // It answers at first and is quiet from 0.2 s on.
            let noise = 1e-3 * G * (1.7 * f64::from(k)).sin();
            input.specimen_acceleration = if k < 100 { 0.1 * sign * G } else { noise };
        }
    };
    assert_eq!(run(interlock, 400, chatter(0.02)).0.memory.trip, Trip::None);
    let lost = run(interlock, 400, chatter(0.1)).0.memory;
    assert_eq!(lost.trip, Trip::SpecimenLost);
    assert!((lost.trip_time - 0.298).abs() < 1e-9, "{}", lost.trip_time);
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

#[test]
fn noise_above_the_silence_is_not_yet_an_answer_of_the_specimen() {
    let silence = 0.012 * G;
    let interlock = Interlock {
        specimen_silence: silence,
        ..Interlock::laboratory()
    };
    // A channel that shows something until 1 s and nothing afterwards, while the table moves.
    let until_one_second = |height: f64| {
        run(interlock, 1500, move |k, input| {
            let wave = (1.7 * f64::from(k)).sin();
            input.measured.acceleration = 0.5 * G * (0.1 * f64::from(k)).cos();
            let shown = if k < 500 { height } else { 0.3 };
            input.specimen_acceleration = shown * silence * wave;
        })
        .0
        .memory
        .trip
    };
    // An accelerometer without a specimen: its noise comes over the threshold now and then.
    assert_eq!(until_one_second(2.5), Trip::None);
    // A specimen that answers well above the noise is missed when it falls silent.
    assert_eq!(until_one_second(6.0), Trip::SpecimenLost);
}
