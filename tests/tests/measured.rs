//! The diagnosis on four real rigs: figures on data not fitted, parts swapped, and effects put on
//! top of the measurements by the test.

use std::path::{Path, PathBuf};

use acceptance::shared;
use identification::rigs::{Description, Measurement, PartReport, Report, Series, diagnose};

/// Description and data of a rig; none where the data are missing.
fn rig(name: &str) -> Option<(Description, Measurement)> {
    let measured = shared::folder()?.join("measured");
    let file = format!("../identification/rigs/{name}.toml");
    let description = Description::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap();
    let files: Vec<PathBuf> = description
        .data
        .iter()
        .map(|file| {
            let inside: PathBuf = file
                .iter()
                .skip_while(|part| *part != "measured")
                .skip(1)
                .collect();
            measured.join(inside)
        })
        .collect();
    let measurement = description.measurement(&files).unwrap();
    Some((description, measurement))
}

fn report(name: &str) -> Option<Report> {
    let (description, measurement) = rig(name)?;
    let report = diagnose(&description, &measurement, false).unwrap();
    print(&report);
    Some(report)
}

fn print(report: &Report) {
    println!(
        "{}: {} {:?}, on one part only {:?}",
        report.name, report.verdict, report.named, report.not_confirmed
    );
    for part in [&report.as_described, &report.swapped] {
        println!(
            "  nominal {:.2} %, refitted {:.2} %, extended {:.2} %",
            100.0 * part.nominal_error,
            100.0 * part.refitted_error,
            100.0 * part.extended_error
        );
    }
}

fn names(report: &Report, effects: &[&str]) {
    for effect in effects {
        assert!(
            report.named.iter().any(|name| name == effect),
            "{effect}: {:?}",
            report.named
        );
    }
}

fn value(part: &PartReport, effect: &str, parameter: &str) -> f64 {
    let effect = part.effects.iter().find(|e| e.effect == effect);
    let parameter = effect
        .and_then(|e| e.parameters.iter().find(|p| p.name == parameter))
        .map(|p| p.value);
    parameter.unwrap_or(f64::NAN)
}

/// The same measurements with a changed output.
fn changed(measurement: &Measurement, change: impl Fn(&Series, usize) -> f64) -> Measurement {
    let mut changed = measurement.clone();
    for (series, original) in changed.series.iter_mut().zip(&measurement.series) {
        for (k, y) in series.output.iter_mut().enumerate() {
            *y = change(original, k);
        }
    }
    changed
}

#[test]
fn the_drive_has_asymmetric_friction() {
    let Some(report) = report("positioning_drive") else {
        return;
    };
    names(
        &report,
        &[
            "asymmetric_friction",
            "speed_dependent_coulomb",
            "force_ripple",
        ],
    );
    assert_eq!(report.verdict, "named");
    assert!(report.as_described.nominal_error > 0.045);
    assert!(
        report.as_described.extended_error < 0.03,
        "{}",
        report.as_described.extended_error
    );
    assert!(
        report.swapped.extended_error < 0.035,
        "{}",
        report.swapped.extended_error
    );
    assert!(report.as_described.gain_interval.0 > 0.5);
    // The ripple is that of the screw: a period of 2.5 mm that nobody told.
    let period = value(&report.as_described, "force_ripple", "period");
    assert!((period - 2.5e-3).abs() < 5e-6, "{period}");
}

#[test]
fn the_press_has_delay_and_unequal_areas() {
    let Some(report) = report("servohydraulic_press") else {
        return;
    };
    names(&report, &["delay", "asymmetric_gain", "shared_disturbance"]);
    assert_eq!(report.verdict, "named");
    assert!(
        report.as_described.extended_error < 0.034,
        "{}",
        report.as_described.extended_error
    );
    assert!(
        report.swapped.extended_error < 0.034,
        "{}",
        report.swapped.extended_error
    );
    let a = value(&report.as_described, "asymmetric_gain", "asymmetry");
    let b = value(&report.swapped, "asymmetric_gain", "asymmetry");
    assert!((a - b).abs() < 0.005, "{a} {b}");
}

#[test]
fn the_damper_has_asymmetric_friction_and_free_play() {
    let Some(three) = report("friction_damper") else {
        return;
    };
    names(&three, &["asymmetric_coulomb_friction", "free_play"]);
    assert!(
        three.as_described.extended_error < 0.125,
        "{}",
        three.as_described.extended_error
    );
    let Some(two) = report("friction_damper_one_inch") else {
        return;
    };
    names(&two, &["asymmetric_coulomb_friction", "free_play"]);
    assert!(
        two.as_described.extended_error < 0.12,
        "{}",
        two.as_described.extended_error
    );
}

#[test]
fn the_coupon_is_not_the_same_in_both_halves_and_the_report_says_so() {
    let Some(report) = report("steel_coupon") else {
        return;
    };
    assert!(!report.not_confirmed.is_empty());
    assert_ne!(report.verdict, "named");
    assert!(report.as_described.extended_error < report.as_described.refitted_error);
    assert!(
        report.as_described.fitted_error < 0.06,
        "{}",
        report.as_described.fitted_error
    );
}

#[test]
fn four_more_milliseconds_of_delay_are_found_on_the_press() {
    let Some((description, measurement)) = rig("servohydraulic_press") else {
        return;
    };
    let before = diagnose(&description, &measurement, false).unwrap();
    let late = changed(&measurement, |series, k| series.output[k.saturating_sub(4)]);
    let after = diagnose(&description, &late, false).unwrap();
    print(&after);
    names(&after, &["delay", "asymmetric_gain"]);
    // The nominal lag of the command shares what it can with the delay.
    let time = |report: &Report| {
        let lag = report
            .as_described
            .parameters
            .iter()
            .find(|p| p.name == "command_lag");
        value(&report.as_described, "delay", "delay") + lag.map_or(f64::NAN, |lag| lag.value)
    };
    let more = time(&after) - time(&before);
    assert!((more - 4e-3).abs() < 5e-4, "{more}");
}

#[test]
fn a_bent_transducer_is_found_on_the_press() {
    let Some((description, measurement)) = rig("servohydraulic_press") else {
        return;
    };
    let bent = changed(&measurement, |s, k| {
        s.output[k] * (1.0 + 40.0 * s.output[k])
    });
    let after = diagnose(&description, &bent, false).unwrap();
    print(&after);
    names(&after, &["delay", "asymmetric_gain", "sensor_curvature"]);
    let curvature = value(&after.as_described, "sensor_curvature", "curvature");
    assert!((30.0..50.0).contains(&curvature), "{curvature}");
}

#[test]
fn viscous_friction_put_on_the_damper_is_found() {
    let Some((description, measurement)) = rig("friction_damper_one_inch") else {
        return;
    };
    let thick = changed(&measurement, |s, k| s.output[k] + 4e4 * s.inputs[1][k]);
    let after = diagnose(&description, &thick, false).unwrap();
    print(&after);
    names(&after, &["asymmetric_coulomb_friction", "free_play"]);
    let damping = value(&after.as_described, "viscous", "damping");
    let rate = value(&after.as_described, "rate_dependence", "slope");
    assert!(
        (2.5e4..5.5e4).contains(&damping),
        "viscous {damping}, rate {rate}"
    );
}

#[test]
fn a_delay_put_on_the_damper_is_found() {
    let Some((description, measurement)) = rig("friction_damper_one_inch") else {
        return;
    };
    // The force by itself seems to lead a little, so that two delays are compared: what is added
    // must come out.
    let [less, more] = [31, 62].map(|samples| {
        let late = changed(&measurement, |s, k| s.output[k.saturating_sub(samples)]);
        let after = diagnose(&description, &late, false).unwrap();
        print(&after);
        names(
            &after,
            &["asymmetric_coulomb_friction", "free_play", "delay"],
        );
        value(&after.as_described, "delay", "delay")
    });
    println!("  {less} s, {more} s");
    assert!((more - less - 31.0 / 1024.0).abs() < 0.004, "{less} {more}");
}
