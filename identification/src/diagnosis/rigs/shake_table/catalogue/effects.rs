//! The catalogue of effects on the identified shake table: names, parameters, ranges. Here
//! valve, oil, friction, table and foundation.

use plant::identified::rig::IdentifiedRig;
use units::constants::{INCH, LBF, LBF_S_PER_INCH, LBF_S2_PER_INCH};

use super::entry::{Apply, candidate, delay, inverse, positive, relative, shape, signed, size};
use crate::diagnosis::engine::{Candidate, Scale};

/// Every candidate with what it does to the rig. `peak_command` (V) is the largest command of the
/// records (spool limits are looked for below it), `period` the sampling period in s.
pub fn catalogue(peak_command: f64, period: f64) -> Vec<(Candidate, Apply)> {
    let transition = || {
        shape(
            "transition_velocity",
            "m/s",
            Scale::Logarithmic,
            0.1 * INCH,
            0.5,
            (0.005 * INCH, 1.0 * INCH),
        )
    };
    let per_in3 = LBF / INCH.powi(3);
    let mut all: Vec<(Candidate, Apply)> = vec![
        (
            candidate(
                "valve_null_bias",
                vec![signed("offset", "V", 0.03, 0.3)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.null_bias = p[0],
        ),
        (
            candidate(
                "valve_dead_band",
                vec![positive("half_width", "V", 0.03, 0.25)],
                &[&[0.04], &[0.15]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.dead_band = p[0],
        ),
        (
            candidate("valve_flow_gain", vec![relative(0.05, 0.25)], &[&[0.0]]),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.flow_gain = p[0],
        ),
        (
            candidate(
                "valve_asymmetric_gain",
                vec![signed("asymmetry", "1", 0.05, 0.25)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.asymmetry = p[0],
        ),
        (
            candidate(
                "valve_spool_lag",
                vec![
                    size("frequency", "Hz", Scale::Inverse(60.0), 60.0, (4.0, 110.0)),
                    shape(
                        "damping_ratio",
                        "1",
                        Scale::Logarithmic,
                        0.7,
                        0.15,
                        (0.3, 1.5),
                    ),
                ],
                &[&[40.0, 0.7], &[18.0, 0.7]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.valve.spool_frequency = p[0];
                rig.effects.valve.spool_damping = p[1];
            },
        ),
        (
            candidate("command_delay", vec![delay(period)], &[&[0.005], &[0.013]]),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.command_delay = p[0],
        ),
        (
            candidate(
                "valve_flow_saturation",
                vec![inverse("stall_force", "N", 90.0 * LBF, 28.0 * LBF)],
                &[&[60.0 * LBF]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.hydraulics.stall_force = p[0],
        ),
        (
            candidate(
                "valve_spool_saturation",
                vec![size(
                    "limit",
                    "V",
                    Scale::Logarithmic,
                    0.9 * peak_command,
                    (0.05 * peak_command, peak_command),
                )],
                &[0.85, 0.72, 0.6, 0.5, 0.42, 0.35, 0.28, 0.2]
                    .map(|share| share * peak_command)
                    .each_ref()
                    .map(std::slice::from_ref),
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.spool_limit = p[0],
        ),
        (
            candidate(
                "valve_hysteresis",
                vec![positive("half_width", "V", 0.03, 0.25)],
                &[&[0.04], &[0.15]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.valve.hysteresis = p[0],
        ),
        (
            candidate(
                "supply_pressure_droop",
                vec![
                    positive("loss_per_volt", "1/V", 0.15, 0.6),
                    shape(
                        "accumulator_time",
                        "s",
                        Scale::Logarithmic,
                        0.5,
                        0.2,
                        (0.1, 2.0),
                    ),
                    shape("form", "1", Scale::Linear(1.0), 0.0, 1.0, (-3.0, 2.5)),
                    shape("floor", "1", Scale::Linear(1.0), 0.15, 0.1, (0.0, 0.4)),
                ],
                &[
                    &[0.15, 0.5, 0.0, 0.1],
                    &[0.4, 0.5, -1.0, 0.1],
                    &[0.4, 0.5, 1.0, 0.1],
                ],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.hydraulics.droop_loss = p[0];
                rig.effects.hydraulics.droop_time = p[1];
                rig.effects.hydraulics.droop_form = if p[2].abs() < 1e-6 { 1e-6 } else { p[2] };
                rig.effects.hydraulics.droop_floor = p[3];
            },
        ),
        (
            candidate(
                "coulomb_friction",
                vec![
                    positive("coulomb_force", "N", 0.4 * LBF, 4.0 * LBF),
                    transition(),
                ],
                &[&[0.8 * LBF, 0.1 * INCH], &[2.5 * LBF, 0.1 * INCH]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.friction.coulomb_force = p[0];
                rig.effects.friction.transition_velocity = p[1];
            },
        ),
        (
            candidate(
                "stribeck_friction",
                vec![
                    positive("coulomb_force", "N", 0.4 * LBF, 4.0 * LBF),
                    positive("stribeck_force", "N", 0.8 * LBF, 3.0 * LBF),
                    shape(
                        "stribeck_velocity",
                        "m/s",
                        Scale::Logarithmic,
                        0.5 * INCH,
                        0.7,
                        (0.1 * INCH, 3.0 * INCH),
                    ),
                    shape(
                        "stribeck_exponent",
                        "1",
                        Scale::Logarithmic,
                        2.0,
                        0.4,
                        (0.4, 5.0),
                    ),
                    transition(),
                ],
                &[
                    &[1.0 * LBF, 1.0 * LBF, 0.3 * INCH, 2.0, 0.1 * INCH],
                    &[1.0 * LBF, 2.0 * LBF, 1.0 * INCH, 2.0, 0.1 * INCH],
                ],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.friction.coulomb_force = p[0];
                rig.effects.friction.stribeck_force = p[1];
                rig.effects.friction.stribeck_velocity = p[2];
                rig.effects.friction.stribeck_exponent = p[3];
                rig.effects.friction.transition_velocity = p[4];
            },
        ),
        (
            candidate(
                "internal_leakage",
                vec![positive("leakage", "V/N", 0.01 / LBF, 0.1 / LBF)],
                &[&[0.02 / LBF], &[0.06 / LBF]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.hydraulics.leakage = p[0],
        ),
        (
            candidate(
                "oil_column_compliance",
                vec![positive("compliance", "V s/N", 5e-5 / LBF, 4e-4 / LBF)],
                &[&[1e-4 / LBF], &[3e-4 / LBF]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.hydraulics.compliance = p[0],
        ),
        (
            candidate(
                "added_payload",
                vec![positive(
                    "mass",
                    "kg",
                    0.006 * LBF_S2_PER_INCH,
                    0.06 * LBF_S2_PER_INCH,
                )],
                &[&[0.01 * LBF_S2_PER_INCH], &[0.035 * LBF_S2_PER_INCH]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.table.added_mass = p[0],
        ),
        (
            candidate(
                "viscous_damping",
                vec![positive(
                    "damping",
                    "N s/m",
                    0.05 * LBF_S_PER_INCH,
                    0.8 * LBF_S_PER_INCH,
                )],
                &[&[0.1 * LBF_S_PER_INCH], &[0.4 * LBF_S_PER_INCH]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.table.viscous_damping = p[0],
        ),
        (
            candidate(
                "cubic_stiffness",
                vec![positive(
                    "stiffness",
                    "N/m^3",
                    2.0 * per_in3,
                    30.0 * per_in3,
                )],
                &[&[4.0 * per_in3], &[15.0 * per_in3]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.table.cubic_stiffness = p[0],
        ),
        (
            candidate(
                "foundation_compliance",
                vec![
                    size("frequency", "Hz", Scale::Logarithmic, 18.0, (3.0, 30.0)),
                    shape(
                        "damping_ratio",
                        "1",
                        Scale::Logarithmic,
                        0.05,
                        0.25,
                        (0.01, 0.3),
                    ),
                    shape(
                        "mass_ratio",
                        "1",
                        Scale::Logarithmic,
                        12.0,
                        0.1,
                        (4.0, 40.0),
                    ),
                ],
                // A lightly damped mode is found from nearby only.
                &[6.3, 7.3, 8.5, 9.8, 11.4, 13.2, 15.3, 17.7]
                    .map(|frequency| [frequency, 0.05, 12.0])
                    .each_ref()
                    .map(<[f64; 3]>::as_slice),
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.foundation.frequency = p[0];
                rig.effects.foundation.damping_ratio = p[1];
                rig.effects.foundation.mass_ratio = p[2];
            },
        ),
    ];
    all.extend(super::sensors_and_specimen::entries(period));
    all
}
