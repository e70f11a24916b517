//! The physical rig in a loop without FMI: plant, specimen, sensors, controller, interlock.

use controllers::interlock::{Interlock, InterlockInput};
use controllers::three_variable::{ThreeVariableControl, ThreeVariableGains, ThreeVariableInput};
use controllers::{Controller, Motion as Sample};
use motion::Motion;
use plant::sensors::instrumentation::{Instrumentation, InstrumentationState, TrueMotion};
use plant::servo_hydraulic::{ServoHydraulicInput, ServoHydraulicTable};
use plant::specimens::{YieldingSpecimen, YieldingState};

/// Sampling period, s.
pub const PERIOD: f64 = 0.002;

/// What goes wrong in a run, and from when on, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Injected {
    /// Nothing.
    #[default]
    Nothing,
    /// The supply is lost.
    SupplyLost(f64),
    /// The specimen breaks off.
    SpecimenOff(f64),
    /// The controller fails: its last command stays and its heartbeat stands still.
    ControllerFails(f64),
}

/// The parts of a run.
#[derive(Debug, Clone, Copy)]
pub struct NativeRig {
    /// The table.
    pub table: ServoHydraulicTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<YieldingSpecimen>,
    /// The sensors.
    pub sensors: Instrumentation,
    /// Three-variable control's gains.
    pub gains: ThreeVariableGains,
    /// The interlock.
    pub interlock: Interlock,
    /// What goes wrong.
    pub injected: Injected,
}

/// The histories of a run, SI.
#[derive(Debug, Clone, Default)]
pub struct NativeRun {
    /// Displacement of the table.
    pub displacement: Vec<f64>,
    /// Velocity of the table.
    pub velocity: Vec<f64>,
    /// Acceleration of the table.
    pub acceleration: Vec<f64>,
    /// Command to the valve, behind the interlock.
    pub valve_command: Vec<f64>,
    /// Drift of the specimen.
    pub drift: Vec<f64>,
    /// Force of the specimen on the table.
    pub specimen_force: Vec<f64>,
    /// The interlock at the end.
    pub interlock: Interlock,
}

impl NativeRig {
    /// The default rig with laboratory sensors, one sample late, and the printed gains.
    pub fn laboratory(seed: u64) -> Self {
        Self {
            table: ServoHydraulicTable::default(),
            specimen: Some(YieldingSpecimen::default()),
            sensors: Instrumentation {
                delay: PERIOD,
                ..Instrumentation::laboratory(seed)
            },
            gains: ThreeVariableGains::table_3_2(),
            interlock: Interlock {
                heartbeat_samples: 5,
                ..Interlock::laboratory()
            },
            injected: Injected::Nothing,
        }
    }

    /// Plays a motion.
    ///
    /// # Panics
    /// With parameters that cannot be simulated.
    pub fn play(&self, motion: &Motion) -> NativeRun {
        self.table.validate().expect("the table can be simulated");
        self.sensors
            .validate(PERIOD)
            .expect("the sensors can be simulated");
        let filter = self
            .sensors
            .velocity_filter(PERIOD)
            .expect("the filter exists");
        let mut law = ThreeVariableControl {
            gains: self.gains,
            ..ThreeVariableControl::table_3_2()
        };
        let mut interlock = self.interlock;
        let mut sensed = InstrumentationState::default();
        let (mut s, mut d) = (self.table.rest(), YieldingState::default());
        let (mut command, mut heartbeat) = (0.0, 0);
        let mut run = NativeRun::default();
        for k in 0..motion.len() {
            let time = PERIOD * k as f64;
            let off = |at: f64| time >= at - 1e-9;
            let specimen = match self.injected {
                Injected::SpecimenOff(at) if off(at) => None,
                _ => self.specimen,
            };
            let force = specimen.map_or(0.0, |specimen| specimen.force(&d));
            let acceleration = self.table.acceleration(&s, force);
            let truth = TrueMotion {
                displacement: s.displacement,
                velocity: s.velocity,
                acceleration,
                actuator_force: self.table.actuator_force(&s),
                specimen_acceleration: specimen.map_or(0.0, |specimen| specimen.acceleration(&d)),
            };
            let m = self.sensors.sample(&mut sensed, &filter, &truth, PERIOD);
            let measured = Sample {
                displacement: m.displacement,
                velocity: m.velocity,
                acceleration: m.acceleration,
            };
            let reference = Sample {
                displacement: motion.displacement[k],
                velocity: motion.velocity[k],
                acceleration: motion.acceleration[k],
            };
            if !matches!(self.injected, Injected::ControllerFails(at) if off(at)) {
                command = law.step(
                    &ThreeVariableInput {
                        reference,
                        measured,
                    },
                    PERIOD,
                );
                heartbeat += 1;
            }
            let valve_command = interlock.step(
                &InterlockInput {
                    valve_command: command,
                    reference_displacement: reference.displacement,
                    measured,
                    measured_force: m.actuator_force,
                    heartbeat,
                    ..InterlockInput::default()
                },
                PERIOD,
            );
            run.displacement.push(s.displacement);
            run.velocity.push(s.velocity);
            run.acceleration.push(acceleration);
            run.valve_command.push(valve_command);
            run.drift.push(d.drift);
            run.specimen_force.push(force);
            let input = ServoHydraulicInput {
                valve_command,
                specimen_force: force,
                supply_lost: matches!(self.injected, Injected::SupplyLost(at) if off(at)),
            };
            s = self.table.advance(&s, &input, PERIOD);
            if let Some(specimen) = specimen {
                d = specimen.advance(&d, acceleration, PERIOD);
            }
        }
        run.interlock = interlock;
        run
    }
}

impl NativeRun {
    /// Largest magnitude of the displacement, m.
    pub fn peak_displacement(&self) -> f64 {
        self.displacement
            .iter()
            .fold(0.0, |m: f64, x| m.max(x.abs()))
    }
}
