#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! What operators switch on between controller and valve, as an FMU.

use controllers::Controller;
use controllers::aids::delta_pressure::DeltaPressure;
use controllers::aids::friction::FrictionCompensation;
use controllers::aids::{AidsInput as Input, OperatorAids as Law};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;
use units::vocabulary::{
    CONTROLLER_COMMAND, LOOP_DELAY_SAMPLES, MEASURED_FORCE, VALVE_COMMAND, VALVE_LIMIT,
};

/// The aids from a controller's command to the valve's.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct OperatorAids {
    law: Law,
    input: Input,
    valve_command: f64,
    added: f64,
}

impl Component for OperatorAids {
    const NAME: &'static str = "OperatorAids";
    const DESCRIPTION: &'static str =
        "Friction, specimen and valve compensation, stabilisation, harmonics";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::REFERENCE,
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", vocabulary::MEASURED_DISPLACEMENT),
                ("velocity", vocabulary::MEASURED_VELOCITY),
                ("acceleration", vocabulary::MEASURED_ACCELERATION),
                ("force", vocabulary::MEASURED_FORCE),
            ],
        ),
        Terminal::CONTROLLER,
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            include(fmu_kit::tracking_inputs!(Self, s: s.input.reference, s.input.measured));
            input(CONTROLLER_COMMAND, s.input.command, "The controller's command", "V").nominal(10.0);
            input(MEASURED_FORCE, s.input.force, "Force of the actuator", "N" => "lbf").nominal(200.0);
            output(VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            output("added_command", s.added, "What the aids added to the controller's command", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            output("distortion", s.law.harmonics.memory.measured.distortion, "Sines: harmonics 2 to 9 of the measured acceleration over the fundamental, of the latest epoch")
                .discrete().depends_on_inputs(Dependent);
            output("amplitude_ratio", s.law.harmonics.memory.measured.amplitude_ratio, "Sines: fundamental of the measured acceleration over the wanted one")
                .discrete().depends_on_inputs(Dependent);
            output("phase_lag", s.law.harmonics.memory.measured.phase_lag, "Sines: by which it is late", "rad" => "deg")
                .discrete().depends_on_inputs(Dependent);
            group(s.law.on);
            parameter(vocabulary::AMPLITUDE_PHASE_CONTROL, s.law.harmonics.fundamental, "Sines: whether the fundamental is brought to the wanted one");
            parameter(vocabulary::HARMONIC_CANCELLATION, s.law.harmonics.cancellation, "Sines: whether the harmonics above it are cancelled");
            parameter(LOOP_DELAY_SAMPLES, s.law.rig.delay, "Samples by which measurements are late").min(0.0).max(4.0);
            parameter(VALVE_LIMIT, s.law.limit, "Largest magnitude of the valve command", "V");
            group(s.law.rig);
            group(s.law.friction).tunable(&[FrictionCompensation::SEAL_FRICTION]);
            group(s.law.specimen);
            group(s.law.pressure).tunable(&[DeltaPressure::PRESSURE_GAIN]);
            group(s.law.valve);
            group(s.law.harmonics);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
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
    use controllers::aids::harmonics::HarmonicControl;
    use controllers::aids::specimen_force::SpecimenForceCompensation;
    use controllers::aids::valve::ValveCompensation;
    use controllers::preview::model::Hydraulics;
    use fmu_kit::conformance::allocations;
    use plant::identified::valve_curve::ValveCurve;

    #[test]
    fn steps_with_every_aid_on_do_not_allocate() {
        let mut component = OperatorAids::default();
        let law = &mut component.law;
        (law.on.friction, law.on.specimen, law.on.pressure) = (true, true, true);
        law.on.valve = true;
        (law.valve.curve.overlap, law.valve.curve.null_loss) = (0.05, 0.3);
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
            (Hydraulics::FORCE_RATE, 0.0),
            (FrictionCompensation::SEAL_FRICTION, -1.0),
            (SpecimenForceCompensation::SPECIMEN_CORNER, 0.0),
            (DeltaPressure::PRESSURE_GAIN, -1.0),
            (ValveCurve::VALVE_CURVE_NULL_LOSS, 1.0),
            (ValveCompensation::VALVE_SLOPE_LIMIT, 0.5),
            (HarmonicControl::HARMONIC_GAIN, 2.0),
            (LOOP_DELAY_SAMPLES, 9.0),
            (LOOP_DELAY_SAMPLES, -1.0),
            (HarmonicControl::MEASURED_CYCLES, 0.0),
        ]);
    }
}
