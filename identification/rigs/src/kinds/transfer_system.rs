//! Servo-hydraulic actuator of hybrid simulation with its specimen: command to measured force.
//!
//! Nominal: the transfer system of [`plant::transfer_system`] (servo valve, actuator with its own
//! displacement loop, control-structure interaction, specimen), the command held over each sample.
//! The force is compared and not the displacement, for it tells a stiffer specimen from a faster
//! valve, and its noise is a tenth of the other's.

use plant::transfer_system::{
    ExtendedTransferSystem, PERIOD, TransferSystemEffects, TransferSystemParameters,
};

use super::table::{EffectTable, NominalTable, effects, nominal_parameters, size};
use super::{Description, DescriptionError, Effect, Equations, RigDiagnosis, RigRecording};
use recordings::IdentificationError;
use recordings::{Channel, Recording};

/// The rig.
pub struct TransferSystemKind;

const COMMAND: Channel = Channel::Other {
    name: "command",
    unit: "m",
};

nominal_parameters! {
    /// a1b0: rate of the flow over the drive.
    valve_gain: "N/(m s3)",
    /// beta1: damping of the spool.
    valve_beta1: "1/s",
    /// beta2: stiffness of the spool.
    valve_beta2: "1/s2",
    /// a2: force that the velocity takes.
    actuator_a2: "N/m",
    /// a3: leakage past the piston.
    actuator_a3: "1/s",
    /// Gain on the command.
    command_gain: "1",
    /// m_e: mass of the specimen.
    specimen_mass: "kg",
    /// k_e: stiffness of the specimen.
    specimen_stiffness: "N/m",
    /// Damping ratio of the specimen.
    specimen_damping_ratio: "1",
    /// Zero of the load cell.
    force_offset: "N",
}

effects! {
    /// k_e (1 + r): another specimen, or columns that are stiffer than their drawing.
    specimen_stiffness: SpecimenStiffness {
        relative_change: size("1", 0.02, (-0.9, 9.0)),
    } from [[0.1], [-0.1]];
    /// beta1 (1 + r): damping of the valve's spool.
    valve_damping: ValveDamping {
        relative_change: size("1", 0.01, (-0.9, 9.0)),
    } from [[0.05], [-0.05]];
    /// beta2 (1 + r): stiffness of the valve's spool.
    valve_stiffness: ValveStiffness {
        relative_change: size("1", 0.02, (-0.9, 9.0)),
    } from [[0.05], [-0.05]];
    /// a3 + l: leakage past the piston.
    piston_leakage: PistonLeakage {
        added_rate: size("1/s", 0.5, (-4.0, 50.0)),
    } from [[2.0], [-1.0]];
    /// u(t - T): conversion, computation, transport.
    delay: Delay {
        delay: size("s", 2e-4, (0.0, 0.05)),
    } from [[5e-4], [3e-3]];
    /// Play between the drive and the spool.
    valve_play: ValvePlay {
        width: size("m", 1e-5, (0.0, 5e-3)),
    } from [[5e-5], [3e-4]];
    /// Overlap within which the valve stays shut.
    valve_dead_band: ValveDeadBand {
        half_width: size("m", 5e-6, (0.0, 5e-3)),
    } from [[3e-5], [2e-4]];
    /// e / (1 + c |e|): the flow saturates as the valve's drive e grows.
    valve_saturation: ValveSaturation {
        compression: size("1/m", 5.0, (0.0, 5000.0)),
    } from [[30.0], [200.0]];
    /// Coulomb friction of the specimen's guide.
    specimen_friction: SpecimenFriction {
        force: size("N", 5.0, (0.0, 1500.0)),
    } from [[20.0], [150.0]];
    /// k x (1 + a x²): a specimen that stiffens as it deflects, or softens.
    specimen_hardening: SpecimenHardening {
        coefficient: size("1/m2", 500.0, (-2e4, 1e6)),
    } from [[3e3], [-3e3]];
}

/// The plant with these effects.
fn plant_of(
    nominal: &Nominal,
    effects: &Effects,
) -> (TransferSystemParameters, TransferSystemEffects) {
    let changed = |value: f64, relative: f64| value * (1.0 + relative);
    let stiffness = nominal.specimen_stiffness;
    let specimen_stiffness = changed(stiffness, effects.specimen_stiffness.relative_change);
    let parameters = TransferSystemParameters {
        valve_gain: nominal.valve_gain,
        valve_beta1: changed(nominal.valve_beta1, effects.valve_damping.relative_change),
        valve_beta2: changed(nominal.valve_beta2, effects.valve_stiffness.relative_change),
        actuator_a2: nominal.actuator_a2,
        actuator_a3: nominal.actuator_a3 + effects.piston_leakage.added_rate,
        command_gain: nominal.command_gain,
        specimen_mass: nominal.specimen_mass,
        specimen_stiffness,
        specimen_damping_ratio: nominal.specimen_damping_ratio,
    };
    let beyond = TransferSystemEffects {
        delay: effects.delay.delay,
        valve_play: effects.valve_play.width,
        valve_dead_band: effects.valve_dead_band.half_width,
        valve_compression: effects.valve_saturation.compression,
        specimen_friction: effects.specimen_friction.force,
        specimen_hardening: effects.specimen_hardening.coefficient,
    };
    (parameters, beyond)
}

impl Equations for TransferSystemKind {
    const KIND: &'static str = "transfer_system";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = ();
    const INPUTS: &'static [Channel] = &[COMMAND];
    const OUTPUT: Channel = Channel::ActuatorForce;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        (): &(),
        out: &mut [f64],
    ) {
        let (parameters, beyond) = plant_of(nominal, effects);
        let Ok(mut plant) = ExtendedTransferSystem::new(parameters, beyond, recording.period())
        else {
            out.fill(f64::NAN);
            return;
        };
        for (y, command) in out.iter_mut().zip(recording.input(COMMAND)) {
            *y = plant.force() + nominal.force_offset;
            plant.step(*command);
        }
    }
}

/// The benchmark's transfer system, to be diagnosed on data that are given by themselves.
pub struct TransferSystemRig {
    /// As `identification/rigs` has it.
    pub description: Description,
    nominal: Vec<f64>,
    effects: Vec<Effect>,
}

impl TransferSystemRig {
    /// With the description that comes with the library.
    ///
    /// # Errors
    /// None.
    pub fn benchmark() -> Result<Self, DescriptionError> {
        let text = include_str!("../../../rigs/transfer_system.toml");
        let description = Description::parse("transfer_system.toml".as_ref(), text)?;
        let nominal = description.nominal(&TransferSystemKind)?;
        Ok(Self {
            description,
            nominal: nominal.into_iter().map(|(value, _)| value).collect(),
            effects: Effects::table(),
        })
    }

    /// Names of its effects.
    pub fn effects(&self) -> impl Iterator<Item = &'static str> {
        self.effects.iter().map(|effect| effect.candidate.effect)
    }

    /// SI unit of an effect's parameter, for each has one; none where unknown effect.
    pub fn unit(&self, effect: &str) -> Option<&'static str> {
        let mut effects = self.effects.iter();
        let found = effects.find(|one| one.candidate.effect == effect)?;
        Some(found.candidate.parameters.first()?.unit)
    }

    /// A recording of commands (m) and measured forces (N), one each [`PERIOD`], beginning at rest;
    /// its second half is left out.
    ///
    /// # Errors
    /// Commands and forces of another number.
    pub fn recording(
        &self,
        name: &str,
        command: Vec<f64>,
        force: Vec<f64>,
    ) -> Result<RigRecording, IdentificationError> {
        let channels = vec![(COMMAND, command), (TransferSystemKind::OUTPUT, force)];
        let recording = Recording::new(name, PERIOD, channels)?;
        let (inputs, output) = (TransferSystemKind::INPUTS, TransferSystemKind::OUTPUT);
        let mut recording = RigRecording::new(recording, inputs, output);
        let half = recording.len() / 2;
        recording.left_out[half..].fill(true);
        Ok(recording)
    }

    /// The benchmark's plant with effects by name, each at a value (SI); names that are none of its
    /// effects change nothing.
    pub fn plant(
        &self,
        effects: &[(String, f64)],
    ) -> (TransferSystemParameters, TransferSystemEffects) {
        self.plant_of(&self.nominal, |effect, _| {
            let given = effects.iter().find(|(name, _)| name == effect);
            given.map(|(_, value)| *value)
        })
    }

    /// The plant that a diagnosis found: nominal values as refitted and every effect that both
    /// parts of the data name.
    pub fn found(&self, found: &RigDiagnosis) -> (TransferSystemParameters, TransferSystemEffects) {
        let part = &found.as_described;
        let names = Nominal::TABLE.iter().map(|(name, _)| name);
        let nominal: Vec<f64> = names
            .zip(&self.nominal)
            .map(|(name, value)| {
                let refitted = part.parameters.iter().find(|one| one.name == *name);
                refitted.map_or(*value, |one| one.value)
            })
            .collect();
        self.plant_of(&nominal, |effect, parameter| {
            let mut named = found.named.iter().flat_map(|name| name.split(" or "));
            let is_named = named.any(|name| name == effect);
            let mut effects = part.effects.iter();
            let one = effects.find(|one| is_named && one.effect == effect)?;
            let mut parameters = one.parameters.iter();
            Some(parameters.find(|one| one.name == parameter)?.value)
        })
    }

    /// The plant with the values that `given` has for an effect's parameter.
    fn plant_of(
        &self,
        nominal: &[f64],
        given: impl Fn(&str, &str) -> Option<f64>,
    ) -> (TransferSystemParameters, TransferSystemEffects) {
        let values = self.effects.iter().flat_map(|effect| {
            let parameters = effect.candidate.parameters.iter().zip(&effect.off);
            let name = effect.candidate.effect;
            parameters
                .map(|(parameter, off)| given(name, parameter.name).unwrap_or(*off))
                .collect::<Vec<f64>>()
        });
        let effects: Vec<f64> = values.collect();
        match Nominal::from_values(nominal).zip(Effects::from_values(&effects)) {
            Some((nominal, effects)) => plant_of(&nominal, &effects),
            // The lists are those of the structs.
            None => Default::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_description_is_the_benchmarks_nominal_plant() {
        let rig = TransferSystemRig::benchmark().unwrap();
        let (parameters, effects) = rig.plant(&[]);
        assert_eq!(parameters, TransferSystemParameters::default());
        assert!(!effects.is_active());
        let hidden = [("delay", 1e-3), ("specimen_stiffness", 0.5)];
        let hidden = hidden.map(|(name, value)| (name.to_owned(), value));
        let (parameters, effects) = rig.plant(&hidden);
        assert_eq!(parameters.specimen_stiffness, 1.5 * 1.19e6);
        assert_eq!(effects.delay, 1e-3);
        assert!(rig.effects().all(|effect| rig.unit(effect).is_some()));
        assert_eq!(rig.unit("dealy"), None);
    }
}
