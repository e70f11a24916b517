//! The identified rig in place of the one that was recorded: what its controllers will do on the motion that is
//! going to be played.

use std::f64::consts::TAU;
use units::vocabulary;

use identification::closed_loop::Found;
use identification::closed_loop::equations::HydraulicRig;
use identification::closed_loop::friction::SealShape;
use plant::identified::valve_curve::ValveCurve;
use plant::servo_hydraulic::ServoHydraulicTable;

use super::Request;
use super::missed::Missed;
use crate::error::Error;
use crate::run::experiment::{self, prepare_file};
use crate::systems::built_in;
use crate::systems::tuning::{Rules, Wanted};
use fmi_system::{ComponentFile, SystemFile, VariableName};
use motion::metrics;

/// Component that a plant's table is.
const TABLE: &str = "table";
/// Component that stands on it.
const SPECIMEN: &str = "specimen";
/// The built-in one whose numbers recordings tell.
const LINEAR: &str = "linear";

/// Parameters of the physical table's component with the identified rig's numbers, SI. Area, volume and supply
/// are those of the built-in one: only what follows from them shows in recordings.
fn parameters(
    rig: &HydraulicRig,
    shape: &SealShape,
    curve: &ValveCurve,
    sensor_delay: f64,
) -> Vec<(&'static str, f64)> {
    let usual = ServoHydraulicTable::default();
    let (valve, cylinder) = (&usual.valve, &usual.cylinder);
    let supply = usual.supply.rest_pressure(valve.null_leakage);
    let bulk = rig.oil_stiffness * cylinder.volume / (4.0 * cylinder.area * cylinder.area);
    let compliance = cylinder.volume / (4.0 * bulk);
    let speed = rig.force_rate / rig.oil_stiffness;
    let inertia = rig.spool_inertia.sqrt();
    let friction = rig.seal_friction;
    let delay = (rig.command_delay - sensor_delay).max(0.0);
    vec![
        (vocabulary::VALVE_FREQUENCY, 1.0 / (TAU * inertia)),
        (
            "valve_damping_ratio",
            (0.5 * rig.spool_lag / inertia).max(0.05),
        ),
        ("valve_overlap", curve.overlap.max(0.0)),
        ("valve_null_loss", curve.null_loss),
        ("valve_null_width", curve.null_width),
        ("valve_asymmetry", curve.asymmetry),
        (vocabulary::VALVE_NULL_BIAS, curve.null_bias),
        (
            "flow_coefficient",
            speed * cylinder.area / (0.5 * supply).sqrt(),
        ),
        (vocabulary::BULK_MODULUS, bulk),
        (
            vocabulary::PISTON_LEAKAGE,
            (rig.leakage_rate * compliance - valve.null_leakage).max(0.0),
        ),
        (vocabulary::COULOMB_FRICTION, friction),
        ("static_friction", friction * (1.0 + shape.excess)),
        (vocabulary::STRIBECK_VELOCITY, shape.stribeck_velocity),
        ("seal_viscous_friction", rig.seal_damping),
        ("seal_stiffness", (friction / shape.presliding).max(1.0)),
        (
            "presliding_damping",
            friction / shape.presliding * shape.relaxation,
        ),
        (vocabulary::TABLE_MASS, rig.mass),
        (vocabulary::TABLE_DAMPING, rig.damping.max(0.0)),
        (vocabulary::TABLE_STIFFNESS, rig.stiffness.max(0.0)),
        // A delay of less than a hundredth of a sample is none.
        (
            "command_delay.delay",
            if delay < 2e-5 { 0.0 } else { delay },
        ),
    ]
}

/// `time_domain_percent` of `controller` on the identified rig; none where it is stopped. What the model misses on
/// other motions is `missed` on this one, too, and independent of the rest.
///
/// # Errors
/// A motion at fault.
pub(super) fn predicted(
    request: &Request,
    found: &Found,
    missed: &Missed,
    rules: &Rules,
    controller: &str,
) -> Result<Option<f64>, Error> {
    // A specimen inside of the plant gets a component of its own.
    let is_inside = found.rig.specimen_mass > 0.0 && request.specimen == built_in::NONE;
    let specimen = if is_inside { LINEAR } else { &request.specimen };
    let wanted = Wanted {
        rules: Some(rules),
        inside: is_inside,
        ..Wanted::default()
    };
    let mut file = built_in::system(controller, &request.plant, specimen, wanted)?;
    if is_inside {
        let own = VariableName::new(SPECIMEN, "acceleration");
        file.redirect(
            &[(
                VariableName::new(TABLE, vocabulary::SPECIMEN_ACCELERATION),
                own,
            )]
            .into(),
        );
    }
    let settings = request.set.iter();
    let others = settings.filter(|own| own.split('.').next().map(str::trim) != Some(TABLE));
    for setting in others {
        super::systems::set(&mut file, setting);
    }
    replace(&mut file, found, request.sensor_delay);
    let asked = experiment::Request {
        plant: request.plant.clone(),
        specimen: specimen.to_string(),
        record: request.record.clone(),
        reference: request.reference.clone(),
        duration_s: Some(request.played),
        fmi: request.fmi,
        installation: request.installation.clone(),
        ..experiment::Request::built_in(controller)
    };
    let prepared = prepare_file(&asked, &file)?;
    let outcome = prepared.run(prepared.algorithm)?;
    if !outcome.ended.is_regular() {
        return Ok(None);
    }
    let column = |name: &str| outcome.record.column(&format!("{TABLE}.{name}"));
    let histories = column("displacement").zip(column("acceleration"));
    let error = histories.and_then(|(x, a)| {
        let tracking = metrics::tracking(&prepared.motion, &x, &a).ok()?;
        let wanted = &prepared.motion.acceleration;
        let (rms, peak) = rms_and_peak(&wanted[..a.len().min(wanted.len())]);
        let missed = if peak > 0.0 {
            missed.tracked(rms) / peak
        } else {
            0.0
        };
        Some(tracking.time_domain_percent.hypot(100.0 * missed))
    });
    Ok(error)
}

/// Root mean square, and peak.
fn rms_and_peak(values: &[f64]) -> (f64, f64) {
    let square = values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64;
    let peak = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    (square.sqrt(), peak)
}

fn replace(file: &mut SystemFile, found: &Found, sensor_delay: f64) {
    if let Some(table) = file.components.get_mut(TABLE) {
        let inputs = std::mem::take(&mut table.inputs);
        *table = ComponentFile {
            fmu: "ServoHydraulicTable".into(),
            inputs,
            ..ComponentFile::default()
        };
        let own = parameters(&found.rig, &found.shape, &found.curve(), sensor_delay);
        for (name, value) in own {
            table.set(name, value);
        }
    }
    if let (Some(own), Some(specimen)) = (&found.specimen, file.components.get_mut(SPECIMEN))
        && specimen.fmu == "Specimen"
    {
        let mass = found.rig.specimen_mass;
        for (name, value) in [
            ("mass", mass),
            ("damping", own.specimen.damping * mass),
            ("stiffness", own.specimen.stiffness * mass),
        ] {
            specimen.set(name, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::control_model::ControlModel;

    #[test]
    fn a_sine_has_an_rms_of_seven_tenths_of_its_peak() {
        let sine: Vec<f64> = (0..1000)
            .map(|k| 3.0 * (TAU * 0.01 * f64::from(k)).sin())
            .collect();
        let (rms, peak) = rms_and_peak(&sine);
        assert!((rms / peak - 0.5_f64.sqrt()).abs() < 1e-3);
        assert_eq!(rms_and_peak(&[0.0; 4]), (0.0, 0.0));
    }

    /// What recordings say of the physical rig leads back to the numbers of its valve, oil and seals.
    #[test]
    fn the_commissioned_rig_has_the_numbers_of_the_physical_one() {
        let model = ControlModel::commissioned().unwrap();
        let (rig, shape) = model.hydraulics.unwrap();
        let own = parameters(&rig, &shape, &ValveCurve::default(), 0.002);
        let usual = ServoHydraulicTable::default();
        let find = |name: &str| own.iter().find(|own| own.0 == name).unwrap().1;
        for (name, truth, within) in [
            ("bulk_modulus", usual.cylinder.bulk_modulus, 0.02),
            ("flow_coefficient", usual.valve.flow_coefficient, 0.02),
            ("valve_frequency", usual.valve.frequency, 0.15),
            ("coulomb_friction", usual.friction.coulomb, 0.05),
            ("seal_viscous_friction", usual.friction.viscous, 0.05),
            ("table_mass", usual.table.mass, 0.005),
        ] {
            let value = find(name);
            assert!(
                (value / truth - 1.0).abs() < within,
                "{name}: {value} {truth}"
            );
        }
        // Its 2.03 ms are the sensors' sample, and a thirtieth of one more.
        assert!(find("command_delay.delay") < 5e-5);
    }

    #[test]
    fn what_follows_from_other_numbers_follows_them_and_keeps_its_bounds() {
        let model = ControlModel::commissioned().unwrap();
        let (mut rig, mut shape) = model.hydraulics.unwrap();
        let usual = ServoHydraulicTable::default();
        (rig.command_delay, rig.seal_friction) = (0.005, 120.0);
        (rig.spool_lag, rig.spool_inertia) = (3e-4, 4e-8);
        (rig.mass, rig.damping, rig.stiffness) = (900.0, -3.0, 50.0);
        (shape.excess, shape.presliding, shape.relaxation) = (0.25, 1e-5, 0.5);
        let curve = ValveCurve {
            overlap: -0.1,
            ..ValveCurve::default()
        };
        let find = |own: &[(&str, f64)], name: &str| {
            let found = own.iter().find(|own| own.0 == name).unwrap();
            found.1
        };
        let own = parameters(&rig, &shape, &curve, 0.002);
        for (name, expected) in [
            // 1/(2 pi 0.2 ms), and half of 0.3 ms over 0.2 ms.
            ("valve_frequency", 795.774_715_459_477),
            ("valve_damping_ratio", 0.75),
            ("valve_overlap", 0.0),
            ("coulomb_friction", 120.0),
            ("static_friction", 150.0),
            ("seal_stiffness", 1.2e7),
            ("presliding_damping", 6e6),
            ("table_mass", 900.0),
            ("table_damping", 0.0),
            ("table_stiffness", 50.0),
            ("command_delay.delay", 0.003),
        ] {
            let value = find(&own, name);
            assert!(
                (value - expected).abs() <= 1e-12 * expected.abs(),
                "{name}: {value}"
            );
        }
        // The oil's stiffness is four times its modulus times the area squared over the volume.
        let (area, volume) = (usual.cylinder.area, usual.cylinder.volume);
        let bulk = find(&own, "bulk_modulus");
        let stiffness = 4.0 * bulk * area * area / volume;
        assert!((stiffness / rig.oil_stiffness - 1.0).abs() < 1e-12);
        // Leakage over the compliance of half of the oil, less what the valve leaks.
        let leaks = find(&own, "piston_leakage") + usual.valve.null_leakage;
        let rate = leaks * 4.0 * bulk / volume;
        assert!((rate / rig.leakage_rate - 1.0).abs() < 1e-9, "{rate}");
        // The flow at full opening through half of the supply moves the table at the speed that was found.
        let supply = usual.supply.rest_pressure(usual.valve.null_leakage);
        let speed = find(&own, "flow_coefficient") * (supply / 2.0).sqrt() / area;
        let expected = rig.force_rate / rig.oil_stiffness;
        assert!((speed / expected - 1.0).abs() < 1e-12, "{speed}");
        // A damping ratio below 0.05 and a delay below the sensors' are not believed.
        (rig.spool_lag, rig.command_delay) = (1e-9, 0.001);
        rig.leakage_rate = 0.0;
        let own = parameters(&rig, &shape, &curve, 0.002);
        assert_eq!(find(&own, "valve_damping_ratio"), 0.05);
        assert_eq!(find(&own, "command_delay.delay"), 0.0);
        assert_eq!(find(&own, "piston_leakage"), 0.0);
    }
}
