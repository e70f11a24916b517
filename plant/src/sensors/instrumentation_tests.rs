use super::*;
use std::f64::consts::TAU;
use units::constants::SAMPLING_PERIOD as PERIOD;

/// Runs a sine of 0.5 in at 2 Hz through the instrumentation; returns truth and reading.
fn shake(sensors: &Instrumentation, samples: usize) -> Vec<(TrueMotion, Measured)> {
    sensors.validate(PERIOD).unwrap();
    let filter = sensors.velocity_filter(PERIOD).unwrap();
    let mut state = InstrumentationState::default();
    let omega = TAU * 2.0;
    (0..samples)
        .map(|k| {
            let (s, c) = (omega * PERIOD * k as f64).sin_cos();
            let amplitude = 0.5 * INCH;
            let motion = TrueMotion {
                displacement: amplitude * s,
                velocity: amplitude * omega * c,
                acceleration: -amplitude * omega * omega * s,
                actuator_force: 100.0 * s,
                specimen_acceleration: -2.0 * s,
            };
            (motion, sensors.sample(&mut state, &filter, &motion, PERIOD))
        })
        .collect()
}

fn velocity_error(sensors: &Instrumentation) -> f64 {
    let run = shake(sensors, 5000);
    let squares = run[500..]
        .iter()
        .map(|(t, m)| (t.velocity - m.velocity).powi(2));
    (squares.sum::<f64>() / (run.len() - 500) as f64).sqrt()
}

#[test]
fn ideal_sensors_show_the_truth() {
    for (t, m) in shake(&Instrumentation::default(), 100) {
        assert_eq!(
            [
                t.displacement,
                t.acceleration,
                t.actuator_force,
                t.specimen_acceleration
            ],
            [
                m.displacement,
                m.acceleration,
                m.actuator_force,
                m.specimen_acceleration
            ]
        );
    }
}

#[test]
fn a_common_delay_of_one_sample_shows_the_previous_one() {
    let sensors = Instrumentation {
        delay: PERIOD,
        velocity_estimate: VelocityEstimate::True,
        ..Instrumentation::default()
    };
    let run = shake(&sensors, 200);
    for pair in run.windows(2).skip(2) {
        let (before, now) = (pair[0].0, pair[1].1);
        assert!((before.displacement - now.displacement).abs() < 1e-15);
        assert!((before.velocity - now.velocity).abs() < 1e-14);
        assert!((before.actuator_force - now.actuator_force).abs() < 1e-12);
    }
}

#[test]
fn tilt_lets_gravity_in() {
    let sensors = Instrumentation {
        accelerometer_tilt: 0.02 / INCH,
        ..Instrumentation::default()
    };
    for (t, m) in shake(&sensors, 300) {
        let expected = t.acceleration + 0.02 / INCH * t.displacement * G;
        assert!((m.acceleration - expected).abs() < 1e-12);
    }
}

#[test]
fn sensor_effects_show_what_they_show_on_the_identified_rig() {
    let mut sensors = Instrumentation {
        accelerometer_tilt: 0.9,
        ..Instrumentation::default()
    };
    sensors.acceleration = Channel {
        bias: 0.3,
        scale_error: 0.1,
        delay: 2.5 * PERIOD,
        hum_amplitude: 0.2,
        ..Channel::default()
    };
    sensors.displacement.scale_error = -0.05;
    sensors.actuator_force.scale_error = 0.08;
    sensors.actuator_force.bias = 4.0;
    let rig = crate::identified::rig::IdentifiedRig {
        sensors,
        ..Default::default()
    };
    let sampled = rig.sample(PERIOD, 4).unwrap();
    let filter = sensors.velocity_filter(PERIOD).unwrap();
    let mut of_rig = crate::identified::rig::IdentifiedRigState::default();
    let mut state = InstrumentationState::default();
    let mut largest: f64 = 0.0;
    for k in 0..500 {
        let now = sampled.motion(&of_rig);
        let truth = TrueMotion {
            displacement: now.displacement,
            acceleration: now.acceleration,
            actuator_force: now.actuator_force,
            ..TrueMotion::default()
        };
        let got = sensors.sample(&mut state, &filter, &truth, PERIOD);
        let time = PERIOD * f64::from(k);
        let expected = sampled.measure(&mut of_rig, time);
        assert!((got.displacement - expected[0]).abs() < 1e-15);
        assert!((got.acceleration - expected[1]).abs() < 1e-12, "at {k}");
        assert!((got.actuator_force - expected[2]).abs() < 1e-10);
        largest = largest.max(now.displacement.abs());
        sampled.step(&mut of_rig, (TAU * 2.0 * time).sin());
    }
    assert!(largest > 1e-3);
}

#[test]
fn the_kalman_velocity_is_far_better_than_the_differentiated_one() {
    let kalman = Instrumentation::laboratory(3);
    let differentiated = |velocity_lag: f64| Instrumentation {
        velocity_estimate: VelocityEstimate::Differentiated,
        velocity_lag,
        ..kalman
    };
    let errors = [
        velocity_error(&kalman),
        velocity_error(&differentiated(0.0)),
        velocity_error(&differentiated(3.0 * PERIOD)),
    ];
    println!("velocity errors {:?} in/s rms", errors.map(|e| e / INCH));
    assert!(errors[0] < 0.25 * errors[1].min(errors[2]), "{errors:?}");
    // Plain differences of white noise: sqrt(2) sigma / h.
    let plain = 2.0_f64.sqrt() * 5e-4 * INCH / PERIOD;
    assert!(
        (errors[1] / plain - 1.0).abs() < 0.15,
        "{} {plain}",
        errors[1]
    );
}

#[test]
fn the_kalman_filter_finds_the_bias_of_the_accelerometer() {
    let mut sensors = Instrumentation::laboratory(5);
    sensors.acceleration.bias = 0.05 * G;
    let error = velocity_error(&sensors);
    assert!(error < 0.15 * INCH, "{} in/s", error / INCH);
}

#[test]
fn faults_strike_one_channel_at_their_time() {
    for fault in [SensorFault::Frozen, SensorFault::NotANumber] {
        let sensors = Instrumentation {
            fault,
            fault_channel: 1,
            fault_time: 0.1,
            ..Instrumentation::laboratory(1)
        };
        let run = shake(&sensors, 100);
        let healthy = shake(&Instrumentation::laboratory(1), 100);
        for k in 0..100 {
            let (got, expected) = (run[k].1, healthy[k].1);
            assert_eq!(got.displacement, expected.displacement);
            if k < 50 {
                assert_eq!(got.acceleration, expected.acceleration);
            } else if fault == SensorFault::Frozen {
                assert_eq!(got.acceleration, run[49].1.acceleration);
            } else {
                assert!(got.acceleration.is_nan());
            }
        }
    }
}

#[test]
fn a_fault_may_end_and_has_a_size() {
    let healthy = shake(&Instrumentation::laboratory(1), 200);
    let with = |fault: SensorFault, size: f64, duration: f64| {
        let sensors = Instrumentation {
            fault,
            fault_channel: 1,
            fault_time: 0.1,
            fault_duration: duration,
            fault_size: size,
            ..Instrumentation::laboratory(1)
        };
        shake(&sensors, 200)
    };
    let spike = with(SensorFault::Offset, 3.0, PERIOD);
    let reversed = with(SensorFault::Reversed, 0.0, 0.1);
    let dropped = with(SensorFault::Dropped, 0.3, 0.0);
    let mut repeats = 0;
    for k in 0..200 {
        let expected = healthy[k].1.acceleration;
        let off = if k == 50 { 3.0 } else { 0.0 };
        assert!((spike[k].1.acceleration - expected - off).abs() < 1e-12);
        let sign = if (50..100).contains(&k) { -1.0 } else { 1.0 };
        assert_eq!(reversed[k].1.acceleration, sign * expected, "{k}");
        let lost = k > 50 && dropped[k].1.acceleration == dropped[k - 1].1.acceleration;
        repeats += usize::from(lost);
        if !lost {
            assert_eq!(dropped[k].1.displacement, healthy[k].1.displacement);
        }
    }
    // 45 of 150 in the mean, with a standard deviation of 5.6.
    assert!((28..62).contains(&repeats), "{repeats}");
    // A reading that is not a number does not stay in the velocity.
    let lost = with(SensorFault::NotANumber, 0.0, PERIOD);
    assert!(lost[50].1.acceleration.is_nan());
    let off = |k: usize| (lost[k].1.velocity - healthy[k].1.velocity).abs();
    assert!((0..200).all(|k| off(k) < 1e-3));
}
