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
const TIME_TO_NULL: f64 = 0.3 + H;

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
        // No jump: a step is a tenth of what the command was beyond the velocity's 3 V, which 60 ms teach within a
        // third.
        let before = commands[trip - 1];
        for k in trip..null {
            let jump = (commands[k] - commands[k - 1]).abs();
            assert!(jump <= 0.1 * (before.abs() + 4.0), "{cause:?}: {jump}");
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
    // A mean over twice the time takes twice as long.
    let slower = Interlock {
        flow_time: 2.0,
        ..watched
    };
    let (slower, _) = run(slower, 3000, |_, input| {
        input.supply_flow = 40.0 * INCH.powi(3);
    });
    let late = slower.memory.trip_time;
    assert!((late - 2.0 * f64::ln(4.0 / 3.0)).abs() < 2.0 * H, "{late}");
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
    let interlock = Interlock {
        stop_time: 0.02,
        ..Interlock::laboratory()
    };
    let (interlock, commands) = run(interlock, 700, |k, input| {
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

/// A table whose velocity follows the valve behind 5 ms, 5 in/s for 1 V, under a feedforward of a sine of `frequency`
/// (Hz, whole) with a velocity of `speed` (in/s) around `middle` (m); the operator stops it at 2.04 s, near the largest
/// velocity. Returns velocities and displacements.
fn stopped(
    mut interlock: Interlock,
    frequency: f64,
    speed: f64,
    middle: f64,
) -> (Vec<f64>, Vec<f64>) {
    interlock.tracking_limit = 1.0;
    let (mut x, mut v, w) = (middle, 0.0, std::f64::consts::TAU * frequency);
    let gain = 5.0 * INCH;
    let (mut velocities, mut displacements) = (Vec::new(), Vec::new());
    for k in 0..1500_u32 {
        let t = H * f64::from(k);
        let size = speed * INCH * (t / 0.5).min(1.0);
        let input = InterlockInput {
            valve_command: size * (w * t).cos() / gain,
            reference_displacement: middle + size / w * (w * t).sin(),
            measured: Motion {
                displacement: x,
                velocity: v,
                acceleration: 0.0,
            },
            stop: t >= 2.04,
            ..InterlockInput::default()
        };
        let u = interlock.step(&input, H);
        let next = v + (1.0 - (-H / 0.005_f64).exp()) * (gain * u - v);
        x += 0.5 * H * (v + next);
        v = next;
        velocities.push(v);
        displacements.push(x);
    }
    assert_eq!(interlock.memory.trip, Trip::Stop);
    (velocities, displacements)
}

#[test]
fn a_soft_stop_decelerates_no_harder_than_the_motion() {
    let hard = Interlock {
        stop_time: 0.02,
        ..Interlock::laboratory()
    };
    let soft = Interlock::laboratory();
    let largest = |velocities: &[f64]| {
        let steps = velocities.windows(2);
        steps.fold(0.0_f64, |most, pair| {
            most.max((pair[1] - pair[0]).abs() / H)
        })
    };
    // 10 in/s at 2 Hz ask for 126 in/s2 = 0.325 g, more than the stop's own 0.25 g.
    let (velocities, displacements) = stopped(soft, 2.0, 10.0, 0.0);
    let motion = largest(&velocities[500..1019]);
    let stop = largest(&velocities[1022..]);
    println!("motion {:.3} g, stop {:.3} g", motion / G, stop / G);
    assert!((motion / G - 0.325).abs() < 0.01);
    assert!(stop < 1.05 * 0.25 * G, "{} g", stop / G);
    assert!(velocities[1022 + 150].abs() < 1e-6 * INCH);
    assert!(displacements.iter().all(|x| x.abs() < STROKE));
    // The ramp alone shakes three times as hard as the motion.
    let (velocities, _) = stopped(hard, 2.0, 10.0, 0.0);
    assert!(largest(&velocities[1022..]) > 3.0 * motion);
    // A motion that asks for less is stopped with less: 4 in/s at 1 Hz are 0.065 g.
    let (velocities, _) = stopped(soft, 1.0, 4.0, 0.0);
    assert!(largest(&velocities[1022..]) < 1.05 * 0.0651 * G);
    // Where the stroke does not allow it, the stop is harder.
    let (velocities, displacements) = stopped(soft, 2.0, 10.0, 0.45 * INCH);
    let farthest = displacements.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!(farthest < STROKE - 0.1 * INCH, "{} in", farthest / INCH);
    assert!(largest(&velocities[1022..]) > 0.3 * G);
}

#[test]
fn a_warning_comes_before_the_trip_and_does_not_stop() {
    let (interlock, commands) = run(Interlock::laboratory(), 200, |k, input| {
        if k >= 100 {
            // It does not repeat itself.
            input.measured.acceleration = (0.95 + 1e-4 * f64::from(k % 7)) * 3.5 * G;
        }
    });
    assert_eq!(interlock.memory.trip, Trip::None);
    assert_eq!(interlock.memory.warning, Trip::Acceleration);
    assert_eq!(commands[150], healthy(150).valve_command);
    let (interlock, _) = run(Interlock::laboratory(), 200, |_, _| ());
    assert_eq!(interlock.memory.warning, Trip::None);
}

/// When a table of `mass` (kg) with friction, a spring and perhaps a specimen of 45 kg at 2 Hz trips, under a growing
/// motion of 3 Hz, for a stated mass of 21.2 kg; and the largest acceleration until then, g.
fn weighed(mass: f64, specimen: f64) -> (Option<f64>, f64) {
    let mut interlock = Interlock {
        moving_mass: 21.2,
        ..Interlock::laboratory()
    };
    let (mut y, mut dy) = (0.0, 0.0);
    let mut largest = 0.0_f64;
    for k in 0..3000_u32 {
        let t = H * f64::from(k);
        let grain = |n: f64| (f64::from(k) * f64::from(k) * n).sin() * 2.0_f64.sqrt();
        let w = [18.8, 31.0];
        let size = 0.3 * G * (t / 6.0);
        let sum = |of: fn(f64, f64) -> f64| 0.5 * (of(w[0], w[0] * t) + of(w[1], w[1] * t));
        let a = size * sum(|_, p| p.sin());
        let v = size * sum(|w, p| -p.cos() / w);
        let x = size * sum(|w, p| -p.sin() / (w * w));
        // The specimen's drift and its force.
        let own = -(158.0 * y + 1.26 * dy);
        dy += H * (own - a);
        y += H * dy;
        let force = mass * a + 40.0 * v + 4000.0 * x + 13.0 * (v / 0.002).tanh() + specimen * own;
        let input = InterlockInput {
            reference_displacement: x,
            measured: Motion {
                displacement: x + 5e-4 * INCH * grain(0.7391),
                velocity: v + 0.02 * INCH * grain(0.3137),
                acceleration: a + 1.5 * INCH * grain(1.3173),
            },
            measured_force: force + 1.3 * grain(0.1931),
            specimen_acceleration: if specimen > 0.0 { own } else { 0.0 },
            ..InterlockInput::default()
        };
        interlock.step(&input, H);
        if interlock.memory.trip != Trip::None {
            assert_eq!(interlock.memory.trip, Trip::Mass);
            return (Some(t), largest / G);
        }
        largest = largest.max(a.abs());
    }
    (None, largest / G)
}

#[test]
fn a_mass_far_above_the_stated_one_stops_the_table_at_a_third_of_the_motion() {
    for specimen in [0.0, 45.0] {
        for mass in [21.2, 26.0, 16.0, 40.0] {
            assert_eq!(weighed(mass, specimen).0, None, "{mass} kg");
        }
        let (time, largest) = weighed(63.6, specimen);
        println!("{specimen} kg: {time:?} s, {largest:.4} g");
        assert!(time.is_some() && largest < 0.11, "{time:?}, {largest} g");
    }
}
