#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! What operators switch on between controller and valve, as an FMU.

use controllers::Controller;
use controllers::aids::{AidsInput as Input, OperatorAids as Law};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::ModelError;
use serde::{Deserialize, Serialize};

/// The aids from a controller's command to the valve's.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct OperatorAids {
    law: Law,
    loop_delay_samples: i32,
    input: Input,
    valve_command: f64,
    added: f64,
}

impl Component for OperatorAids {
    const NAME: &'static str = "OperatorAids";
    const DESCRIPTION: &'static str =
        "Friction and specimen compensation, observer, stabilisation, notch, harmonics";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::REFERENCE,
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", "measured_displacement"),
                ("velocity", "measured_velocity"),
                ("acceleration", "measured_acceleration"),
                ("force", "measured_force"),
            ],
        ),
        Terminal::CONTROLLER,
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        let mut inputs = fmu_kit::tracking_inputs!(Self, s: s.input.reference, s.input.measured);
        inputs.extend(fmu_kit::table! { Self, s:
            input("controller_command", s.input.command, "The controller's command", "V").nominal(10.0);
            input("measured_force", s.input.force, "Force of the actuator", "N" => "lbf").nominal(200.0);
        });
        let others = fmu_kit::table! { Self, s:
            output("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_all(&inputs, Dependent);
            output("added_command", s.added, "What the aids added to the controller's command", "V")
                .discrete().nominal(10.0).depends_on_all(&inputs, Dependent);
            output("distortion", s.law.harmonics.memory.measured.distortion, "Sines: harmonics 2 to 9 of the measured acceleration over the fundamental, of the latest epoch")
                .discrete().depends_on_all(&inputs, Dependent);
            output("amplitude_ratio", s.law.harmonics.memory.measured.amplitude_ratio, "Sines: fundamental of the measured acceleration over the wanted one")
                .discrete().depends_on_all(&inputs, Dependent);
            output("phase_lag", s.law.harmonics.memory.measured.phase_lag, "Sines: by which it is late", "rad" => "deg")
                .discrete().depends_on_all(&inputs, Dependent);
            parameter("friction_compensation", s.law.on.friction, "Whether dry friction along the wanted motion is compensated");
            parameter("specimen_compensation", s.law.on.specimen, "Whether the specimen's measured force is compensated");
            parameter("disturbance_observer", s.law.on.observer, "Whether what the model does not explain is opposed");
            parameter("pressure_stabilisation", s.law.on.pressure, "Whether the actuator's force makes the valve yield");
            parameter("notch_filter", s.law.on.notch, "Whether the notch is in the command");
            parameter("amplitude_phase_control", s.law.harmonics.fundamental, "Sines: whether the fundamental is brought to the wanted one");
            parameter("harmonic_cancellation", s.law.harmonics.cancellation, "Sines: whether the harmonics above it are cancelled");
            parameter("loop_delay_samples", s.loop_delay_samples, "Samples by which measurements are late").min(0.0).max(4.0);
            parameter("valve_limit", s.law.limit, "Largest magnitude of the valve command", "V");
            parameter("spool_lag", s.law.rig.hydraulics.spool_lag, "2 D/w of the spool", "s");
            parameter("spool_inertia", s.law.rig.hydraulics.spool_inertia, "1/w^2 of the spool", "s2");
            parameter("force_rate", s.law.rig.hydraulics.force_rate, "Rate of the force under a valve open by one volt", "N/(V.s)" => "lbf/(V.s)");
            parameter("oil_stiffness", s.law.rig.hydraulics.oil_stiffness, "Stiffness of the oil column", "N/m" => "lbf/in");
            parameter("leakage_rate", s.law.rig.hydraulics.leakage_rate, "Rate at which leakage empties it", "1/s");
            parameter("seal_damping", s.law.rig.hydraulics.seal_damping, "Viscous damping of the seals", "N.s/m" => "lbf.s/in");
            parameter("table_mass", s.law.rig.table.mass, "Mass of the table", "kg" => "lbf.s2/in");
            parameter("table_damping", s.law.rig.table.damping, "Viscous damping of the table", "N.s/m" => "lbf.s/in");
            parameter("table_stiffness", s.law.rig.table.stiffness, "Stiffness from table to ground", "N/m" => "lbf/in");
            parameter("seal_friction", s.law.friction.friction, "Coulomb friction of the seals", "N" => "lbf").min(0.0);
            parameter("seal_presliding", s.law.friction.shape.presliding, "Their deflection before they slide", "m" => "in");
            parameter("seal_excess", s.law.friction.shape.excess, "Breakaway force over the Coulomb force, less one");
            parameter("seal_stribeck_velocity", s.law.friction.shape.stribeck_velocity, "Stribeck velocity", "m/s" => "in/s");
            parameter("seal_sharpness", s.law.friction.shape.sharpness, "Exponent with which they begin to slide");
            parameter("seal_relaxation", s.law.friction.shape.relaxation, "Damping of their deflection over its stiffness", "s");
            parameter("specimen_corner", s.law.specimen.corner, "Specimen: corner of the lag on its force", "rad/s" => "Hz");
            parameter("observer_corner", s.law.observer.corner, "Observer: corner of its lag", "rad/s" => "Hz");
            parameter("pressure_gain", s.law.pressure.gain, "Stabilisation: command per force", "V/N" => "V/lbf").min(0.0);
            parameter("pressure_high_pass", s.law.pressure.high_pass, "Stabilisation: corner below which forces count for nothing", "rad/s" => "Hz").min(0.0);
            parameter("notch_frequency", s.law.notch.frequency, "Notch: frequency", "rad/s" => "Hz");
            parameter("notch_depth", s.law.notch.depth, "Notch: damping ratio that is cancelled").min(0.0);
            parameter("notch_width", s.law.notch.width, "Notch: damping ratio in its place");
            parameter("harmonic_gain", s.law.harmonics.gain, "Sines: part of an error that is taken off at once");
            parameter("settling_cycles", s.law.harmonics.settling_cycles, "Sines: cycles of an epoch that are not measured").min(0.0);
            parameter("measured_cycles", s.law.harmonics.measured_cycles, "Sines: cycles that are").min(1.0);
        };
        let mut variables = inputs;
        variables.extend(others);
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.rig.delay = ModelError::count("loop_delay_samples", self.loop_delay_samples)?;
        self.law.validate()?;
        self.law.reset();
        self.valve_command = 0.0;
        self.added = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        self.valve_command = self.law.step(&self.input, step_size);
        self.added = self.valve_command - self.input.command;
        Ok(())
    }
}

fmu_kit::export!(OperatorAids);

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::{allocations, number};

    #[test]
    fn inputs_arrive_where_they_belong() {
        let mut component = OperatorAids::default();
        let inputs = [
            "controller_command",
            "reference_displacement",
            "reference_velocity",
            "reference_acceleration",
            "measured_displacement",
            "measured_velocity",
            "measured_acceleration",
            "measured_force",
        ];
        number(&mut component, &inputs);
        let Input {
            command,
            reference,
            measured,
            force,
        } = component.input;
        let arrived = [
            command,
            reference.displacement,
            reference.velocity,
            reference.acceleration,
            measured.displacement,
            measured.velocity,
            measured.acceleration,
            force,
        ];
        assert_eq!(arrived, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    }

    #[test]
    fn steps_with_every_aid_on_do_not_allocate() {
        let mut component = OperatorAids::default();
        let law = &mut component.law;
        (law.on.friction, law.on.specimen, law.on.observer) = (true, true, true);
        (law.on.pressure, law.on.notch) = (true, true);
        (law.harmonics.fundamental, law.harmonics.cancellation) = (true, true);
        component.initialize().unwrap();
        let counted = allocations(|| {
            for k in 0..1000 {
                let time = OperatorAids::STEP_SIZE * f64::from(k);
                component.input.reference.acceleration = 3.0 * (12.0 * time).sin();
                component.input.measured = component.input.reference;
                component.input.force = 30.0 * (12.0 * time).sin();
                component.step(time, OperatorAids::STEP_SIZE).unwrap();
            }
        });
        assert_eq!(counted, 0);
        assert!(component.added.abs() > 1e-6);
    }

    #[test]
    fn what_no_aid_can_run_with_is_refused_by_name() {
        fmu_kit::conformance::refuses::<OperatorAids>(&[
            ("force_rate", 0.0),
            ("seal_friction", -1.0),
            ("specimen_corner", 0.0),
            ("observer_corner", f64::NAN),
            ("pressure_gain", -1.0),
            ("notch_width", 0.0),
            ("harmonic_gain", 2.0),
            ("loop_delay_samples", 9.0),
            ("loop_delay_samples", -1.0),
            ("measured_cycles", 0.0),
        ]);
    }
}
