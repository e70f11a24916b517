//! Faults injected into the physical rig: the interlock trips within the stated time and stops the table softly.

use acceptance::native_rig::{Injected, NativeRig, NativeRun, PERIOD};
use controllers::interlock::Trip;
use motion::{self, Motion, Options};
use plant::sensors::instrumentation::{CHANNELS, SensorFault};
use units::constants::{INCH, STROKE};

/// When the fault occurs, s.
const AT: f64 = 8.0;
/// Longest duration of a stop, s.
const STOP: f64 = 0.3;

fn motion() -> Motion {
    motion::built_in(1, &Options::default()).unwrap()
}

fn laboratory() -> NativeRig {
    NativeRig::laboratory(3)
}

/// Seconds from the fault to the sample from which on the valve stays at null.
fn time_to_null(run: &NativeRun) -> f64 {
    let last = run.valve_command.iter().rposition(|&u| u != 0.0).unwrap();
    PERIOD * (last + 1) as f64 - AT
}

fn check(name: &str, run: &NativeRun, causes: &[Trip], within: f64) {
    let m = run.interlock.memory;
    println!(
        "{name:36} {:?} {:.3} s after the fault, valve at null after {:.3} s, farthest {:.2} in",
        m.trip,
        m.trip_time - AT,
        time_to_null(run),
        run.peak_displacement() / INCH
    );
    assert!(causes.contains(&m.trip), "{name}: {:?}", m.trip);
    assert!(m.trip_time >= AT - 1e-9, "{name} tripped before the fault");
    assert!(m.trip_time - AT <= within, "{name}: {} s", m.trip_time - AT);
    let stopped = time_to_null(run) - (m.trip_time - AT);
    assert!(stopped <= STOP + PERIOD + 1e-9, "{name}: {stopped} s");
    // No harder than the motion shook the table before.
    let largest = |from: usize, to: usize| {
        let part = &run.acceleration[from..to];
        part.iter().fold(0.0, |m: f64, a| m.max(a.abs()))
    };
    let at = (m.trip_time / PERIOD).round() as usize;
    let (stop, motion) = (largest(at, run.acceleration.len()), largest(0, at));
    assert!(stop <= motion, "{name}: {stop} beyond {motion} m/s2");
    assert!(
        run.displacement.iter().all(|x| x.abs() < STROKE),
        "{name} hit the stop"
    );
    for pair in run.valve_command.windows(2) {
        assert!((pair[1] - pair[0]).abs() < 5.0, "{name}: the valve jumps");
    }
}

#[test]
fn without_a_fault_nothing_trips() {
    let run = laboratory().play(&motion());
    assert_eq!(run.interlock.memory.trip, Trip::None);
    assert!(time_to_null(&run) > 10.0);
}

#[test]
fn a_reading_that_is_no_number_trips_in_2_ms() {
    for (channel, name) in CHANNELS.iter().enumerate().take(3) {
        let mut rig = laboratory();
        rig.sensors.fault = SensorFault::NotANumber;
        rig.sensors.fault_channel = channel;
        rig.sensors.fault_time = AT;
        let run = rig.play(&motion());
        check(
            &format!("{name} is not a number"),
            &run,
            &[Trip::NotFinite],
            0.002,
        );
    }
}

#[test]
fn a_frozen_sensor_trips_in_80_ms_of_motion() {
    for (channel, name) in CHANNELS.iter().enumerate().take(3) {
        let mut rig = laboratory();
        rig.sensors.fault = SensorFault::Frozen;
        rig.sensors.fault_channel = channel;
        rig.sensors.fault_time = AT;
        let run = rig.play(&motion());
        check(&format!("{name} frozen"), &run, &[Trip::Stale], 0.08);
    }
}

#[test]
fn a_failed_controller_trips_in_10_ms() {
    let mut rig = laboratory();
    rig.injected = Injected::ControllerFails(AT);
    let run = rig.play(&motion());
    check("controller fails", &run, &[Trip::Heartbeat], 0.0101);
}

#[test]
fn a_lost_supply_trips_in_a_second_of_motion() {
    let mut rig = laboratory();
    rig.injected = Injected::SupplyLost(AT);
    let run = rig.play(&motion());
    let causes = [Trip::TrackingError, Trip::Saturation, Trip::Acceleration];
    check("supply lost", &run, &causes, 1.0);
}

#[test]
fn a_specimen_that_breaks_off_neither_trips_nor_upsets_the_table() {
    // Three-variable control holds the bare table: without a limit exceeded nothing need trip.
    let mut rig = laboratory();
    rig.injected = Injected::SpecimenOff(AT);
    let run = rig.play(&motion());
    assert_eq!(run.interlock.memory.trip, Trip::None);
    assert!(run.peak_displacement() < STROKE);
}
