//! Faults injected into the physical rig: the valve is brought to null within the stated time.

use acceptance::native_rig::{Injected, NativeRig, NativeRun, PERIOD};
use controllers::interlock::Trip;
use motion::{self, Motion, Options};
use plant::sensors::instrumentation::{CHANNELS, SensorFault};
use units::constants::{INCH, STROKE};

/// When the fault occurs, s.
const AT: f64 = 8.0;

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
    assert!(
        time_to_null(run) <= within,
        "{name}: {} s",
        time_to_null(run)
    );
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
fn a_reading_that_is_no_number_brings_the_valve_to_null_in_22_ms() {
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
            0.022,
        );
    }
}

#[test]
fn a_frozen_sensor_brings_the_valve_to_null_in_100_ms_of_motion() {
    for (channel, name) in CHANNELS.iter().enumerate().take(3) {
        let mut rig = laboratory();
        rig.sensors.fault = SensorFault::Frozen;
        rig.sensors.fault_channel = channel;
        rig.sensors.fault_time = AT;
        let run = rig.play(&motion());
        check(&format!("{name} frozen"), &run, &[Trip::Stale], 0.1);
    }
}

#[test]
fn a_failed_controller_brings_the_valve_to_null_in_32_ms() {
    let mut rig = laboratory();
    rig.injected = Injected::ControllerFails(AT);
    let run = rig.play(&motion());
    check("controller fails", &run, &[Trip::Heartbeat], 0.032);
}

#[test]
fn a_lost_supply_brings_the_valve_to_null_in_a_second_of_motion() {
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
