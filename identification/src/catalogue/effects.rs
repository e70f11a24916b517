//! The catalogue of effects on the identified shake table: names, parameters, ranges.

use plant::effects::valve::MAX_DELAY_SAMPLES;
use plant::identified_rig::IdentifiedRig;
use plant::units::{INCH, LBF, LBF_S_PER_INCH, LBF_S2_PER_INCH};

use crate::diagnosis::{Candidate, EffectParameter, Role, Scale};

/// Turns an effect on: its parameters' values in SI, in the order of the catalogue.
pub type Apply = fn(&mut IdentifiedRig, &[f64]);

fn size(
    name: &'static str,
    unit: &'static str,
    scale: Scale,
    weak: f64,
    bounds: (f64, f64),
) -> EffectParameter {
    EffectParameter {
        name,
        unit,
        scale,
        role: Role::Size { weak },
        bounds,
    }
}

fn shape(
    name: &'static str,
    unit: &'static str,
    scale: Scale,
    typical: f64,
    spread: f64,
    bounds: (f64, f64),
) -> EffectParameter {
    EffectParameter {
        name,
        unit,
        scale,
        role: Role::Shape { typical, spread },
        bounds,
    }
}

/// A size that may have either sign, from zero; `weak` and `strong` in SI.
fn signed(name: &'static str, unit: &'static str, weak: f64, strong: f64) -> EffectParameter {
    let most = (4.0 * strong).min(if unit == "1" { 0.9 } else { f64::MAX });
    size(name, unit, Scale::Linear(weak), weak, (-most, most))
}

/// A size that has one sign, from zero.
fn positive(name: &'static str, unit: &'static str, weak: f64, strong: f64) -> EffectParameter {
    size(name, unit, Scale::Linear(weak), weak, (0.0, 4.0 * strong))
}

/// A size that is weak when large: frequencies, limits.
fn inverse(name: &'static str, unit: &'static str, weak: f64, strong: f64) -> EffectParameter {
    size(
        name,
        unit,
        Scale::Inverse(weak),
        weak,
        (0.3 * strong, 3.0 * weak),
    )
}

fn candidate(
    effect: &'static str,
    parameters: Vec<EffectParameter>,
    starts: &[&[f64]],
) -> Candidate {
    Candidate {
        effect,
        parameters,
        starts: starts.iter().map(|start| start.to_vec()).collect(),
        look_alikes: match effect {
            "coulomb_friction" => &["stribeck_friction"],
            "stribeck_friction" => &["coulomb_friction"],
            "valve_flow_gain" => &["supply_pressure_droop", "load_cell_scale"],
            "supply_pressure_droop" => &["valve_flow_gain"],
            _ => &[],
        },
        // Where the table sticks the constant gain is not the best one and leaves traces.
        tolerance: if effect.ends_with("friction") {
            1.6
        } else {
            1.0
        },
        contains: (effect == "stribeck_friction").then_some("coulomb_friction"),
    }
}

/// Every candidate with what it does to the rig. `peak_command` (V) is the largest command of the
/// records (spool limits are looked for below it), `period` the sampling period in s.
pub fn catalogue(peak_command: f64, period: f64) -> Vec<(Candidate, Apply)> {
    let late = (MAX_DELAY_SAMPLES - 1) as f64 * period;
    let delay = |name| size(name, "s", Scale::Linear(0.004), 0.004, (0.0, late));
    let transition = || {
        shape(
            "transition_velocity",
            "m/s",
            Scale::Logarithmic,
            0.1 * INCH,
            0.1,
            (0.01 * INCH, 1.0 * INCH),
        )
    };
    let per_in3 = LBF / INCH.powi(3);
    let all: Vec<(Candidate, Apply)> = vec![
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
            candidate(
                "valve_flow_gain",
                vec![signed("relative_change", "1", 0.05, 0.25)],
                &[&[0.0]],
            ),
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
                        0.1,
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
            candidate("command_delay", vec![delay("delay")], &[&[0.005], &[0.013]]),
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
                    shape("form", "1", Scale::Linear(1.0), -1.0, 1.0, (-3.0, 3.0)),
                ],
                &[&[0.15, 0.5, -1.0], &[0.4, 0.5, -1.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.hydraulics.droop_loss = p[0];
                rig.effects.hydraulics.droop_time = p[1];
                rig.effects.hydraulics.droop_form = if p[2].abs() < 1e-3 { 1e-3 } else { p[2] };
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
                    transition(),
                ],
                &[
                    &[1.0 * LBF, 1.0 * LBF, 0.3 * INCH, 0.1 * INCH],
                    &[1.0 * LBF, 2.0 * LBF, 1.0 * INCH, 0.1 * INCH],
                ],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.friction.coulomb_force = p[0];
                rig.effects.friction.stribeck_force = p[1];
                rig.effects.friction.stribeck_velocity = p[2];
                rig.effects.friction.transition_velocity = p[3];
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
                        0.1,
                        (0.01, 0.3),
                    ),
                ],
                &[&[7.0, 0.05], &[9.5, 0.05], &[13.0, 0.05], &[17.0, 0.05]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.foundation.frequency = p[0];
                rig.effects.foundation.damping_ratio = p[1];
            },
        ),
        (
            candidate(
                "accelerometer_bias",
                vec![signed("offset", "m/s^2", 1.5 * INCH, 15.0 * INCH)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_bias = p[0],
        ),
        (
            candidate(
                "accelerometer_scale",
                vec![signed("relative_change", "1", 0.03, 0.2)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_scale = p[0],
        ),
        (
            candidate(
                "accelerometer_tilt",
                vec![signed("tilt", "rad/m", 0.004 / INCH, 0.05 / INCH)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_tilt = p[0],
        ),
        (
            candidate(
                "accelerometer_delay",
                vec![delay("delay")],
                &[&[0.005], &[0.013]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_delay = p[0],
        ),
        (
            candidate(
                "displacement_scale",
                vec![signed("relative_change", "1", 0.03, 0.15)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.displacement_scale = p[0],
        ),
        (
            candidate(
                "displacement_lag",
                vec![inverse("frequency", "Hz", 40.0, 6.0)],
                &[&[25.0], &[10.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.displacement_lag = p[0],
        ),
        (
            candidate(
                "load_cell_scale",
                vec![signed("relative_change", "1", 0.03, 0.2)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.load_cell_scale = p[0],
        ),
        (
            candidate(
                "load_cell_bias",
                vec![signed("offset", "N", 0.3 * LBF, 4.0 * LBF)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.load_cell_bias = p[0],
        ),
        (
            candidate(
                "mains_hum",
                vec![
                    signed("in_phase", "m/s^2", 1.5 * INCH, 15.0 * INCH),
                    signed("quadrature", "m/s^2", 1.5 * INCH, 15.0 * INCH),
                ],
                &[&[0.0, 0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.sensors.hum_amplitude = p[0].hypot(p[1]);
                rig.sensors.hum_phase = p[1].atan2(p[0]);
            },
        ),
        (
            candidate(
                "specimen_yielding",
                vec![
                    size(
                        "yield_displacement",
                        "m",
                        Scale::Logarithmic,
                        1.2 * INCH,
                        (0.1 * INCH, 4.0 * INCH),
                    ),
                    shape(
                        "post_yield_ratio",
                        "1",
                        Scale::Linear(0.01),
                        0.05,
                        1.0,
                        (-0.1, 0.5),
                    ),
                    shape("exponent", "1", Scale::Logarithmic, 3.0, 0.07, (0.8, 8.0)),
                ],
                &[
                    &[0.4 * INCH, 0.05, 3.0],
                    &[0.65 * INCH, 0.05, 3.0],
                    &[1.05 * INCH, 0.05, 3.0],
                ],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.yield_displacement = p[0];
                rig.effects.specimen.yield_post_ratio = p[1];
                rig.effects.specimen.yield_exponent = p[2];
            },
        ),
        (
            candidate(
                "specimen_stiffness",
                vec![signed("relative_change", "1", 0.06, 0.35)],
                &[&[0.0], &[0.25], &[-0.25]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.specimen.stiffness_change = p[0],
        ),
        (
            candidate(
                "specimen_damping",
                vec![size(
                    "relative_change",
                    "1",
                    Scale::Linear(0.5),
                    0.5,
                    (-0.95, 12.0),
                )],
                &[&[0.0], &[1.0], &[2.5]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.specimen.damping_change = p[0],
        ),
        (
            candidate(
                "specimen_second_mode",
                vec![
                    size("frequency", "Hz", Scale::Logarithmic, 12.0, (2.0, 25.0)),
                    shape(
                        "damping_ratio",
                        "1",
                        Scale::Logarithmic,
                        0.03,
                        0.1,
                        (0.005, 0.2),
                    ),
                ],
                &[&[4.5, 0.03], &[6.0, 0.03], &[8.0, 0.03], &[11.0, 0.03]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.second_mode_frequency = p[0];
                rig.effects.specimen.second_mode_damping_ratio = p[1];
            },
        ),
        (
            candidate(
                "specimen_degradation",
                vec![
                    positive("loss", "1", 0.1, 0.24),
                    shape(
                        "degradation_drift",
                        "m",
                        Scale::Logarithmic,
                        1.0 * INCH,
                        1.0,
                        (0.05 * INCH, 20.0 * INCH),
                    ),
                ],
                &[&[0.15, 0.5 * INCH], &[0.3, 1.0 * INCH]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.degradation_loss = p[0];
                rig.effects.specimen.degradation_drift = p[1];
            },
        ),
        (
            candidate(
                "specimen_uplift",
                vec![
                    size(
                        "uplift_displacement",
                        "m",
                        Scale::Logarithmic,
                        1.0 * INCH,
                        (0.08 * INCH, 3.0 * INCH),
                    ),
                    shape(
                        "post_uplift_ratio",
                        "1",
                        Scale::Linear(1.0),
                        0.3,
                        0.3,
                        (-0.1, 0.95),
                    ),
                ],
                &[&[0.3 * INCH, 0.3], &[0.55 * INCH, 0.3], &[0.9 * INCH, 0.3]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.uplift_displacement = p[0];
                rig.effects.specimen.uplift_post_ratio = p[1];
            },
        ),
        (
            candidate(
                "specimen_absent",
                vec![shape(
                    "sensor_share",
                    "1",
                    Scale::Linear(1.0),
                    0.0,
                    2.0,
                    (-0.5, 1.5),
                )],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.absent = true;
                rig.effects.specimen.absent_sensor_share = p[0];
            },
        ),
    ];
    all
}
