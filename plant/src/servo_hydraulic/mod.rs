//! The servo-hydraulic table from first principles: supply, valve, cylinder, seals, stops and the
//! table on its spring.
//!
//! The parameters are those of a plausible rig whose linearisation at the middle position comes
//! near the identified plant (Eq 2-13, 2-14, 2-28); what the source does not give is assumed and
//! says so where it stands.

mod cylinder;
mod energy;
mod extended;
mod friction;
mod linearisation;
mod rig;
mod stops;
mod supply;
mod valve;

pub use cylinder::Cylinder;
pub use energy::{Powers, StoredEnergy};
pub use extended::{ExtendedServoHydraulicState, ExtendedServoHydraulicTable};
pub use friction::SealFriction;
pub use rig::{ServoHydraulicRig, ServoHydraulicRigState};
pub use stops::Stops;
pub use supply::Supply;
use units::vocabulary;
pub use valve::{ServoValve, ValveFlows};

use crate::ModelError;
use crate::identified::table::Table;
use crate::integration::{self, Dynamics};

/// The physical rig without specimen. Inputs are the valve command (V) and the specimen's force
/// on the table (N).
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ServoHydraulicTable {
    /// Pump and accumulator.
    pub supply: Supply,
    /// Servo valve.
    pub valve: ServoValve,
    /// Cylinder and oil.
    pub cylinder: Cylinder,
    /// Seals of the piston.
    pub friction: SealFriction,
    /// Cushions and hard stops.
    pub stops: Stops,
    /// Table on its spring.
    pub table: Table,
    /// Mass on the table that a model does not know of, kg.
    pub added_payload: f64,
    /// `k3` of an additional spring force `k3 x³`, N/m³.
    pub cubic_stiffness: f64,
}

/// Number of continuous states.
pub const STATES: usize = 8;

/// State of [`ServoHydraulicTable`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ServoHydraulicState {
    /// Position of the spool, V.
    pub spool: f64,
    /// Velocity of the spool, V/s.
    pub spool_velocity: f64,
    /// Pressures of chambers A (extends the rod) and B above the tank's, Pa.
    pub pressures: [f64; 2],
    /// Displacement of the table, m.
    pub displacement: f64,
    /// Velocity of the table, m/s.
    pub velocity: f64,
    /// Deflection of the seals, m.
    pub seal_deflection: f64,
    /// Pressure of the supply, Pa.
    pub supply_pressure: f64,
}

impl From<[f64; STATES]> for ServoHydraulicState {
    fn from(x: [f64; STATES]) -> Self {
        Self {
            spool: x[0],
            spool_velocity: x[1],
            pressures: [x[2], x[3]],
            displacement: x[4],
            velocity: x[5],
            seal_deflection: x[6],
            supply_pressure: x[7],
        }
    }
}

impl From<ServoHydraulicState> for [f64; STATES] {
    fn from(s: ServoHydraulicState) -> Self {
        [
            s.spool,
            s.spool_velocity,
            s.pressures[0],
            s.pressures[1],
            s.displacement,
            s.velocity,
            s.seal_deflection,
            s.supply_pressure,
        ]
    }
}

/// What acts on the table from outside, held over a step.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ServoHydraulicInput {
    /// Command of the valve, V.
    pub valve_command: f64,
    /// Force of the specimen on the table, N.
    pub specimen_force: f64,
    /// The pump has stopped and the supply is opened to the tank.
    pub supply_lost: bool,
}

/// The longest inner step, s. With the default parameters a tenth of it changes the displacement by
/// less than 2e-4 of the way; [`ServoHydraulicTable::inner_step`] keeps to that bound for others.
pub const INNER_STEP: f64 = 2e-4;
/// An inner step times the quickest rate of the equations at most.
const STEP_BY_RATE: f64 = 0.35;
/// The shortest inner step, s: a rig that needs finer ones is refused.
const SHORTEST_STEP: f64 = 2e-6;
/// Acceleration at a reversal up to which the seals are followed, m/s²: from rest the table moves within an
/// inner step by no more than half of what they give before they slide.
const REVERSAL: f64 = 25.0;
/// The parameter that makes the seals quick at a reversal.
const FRICTION: &str = vocabulary::COULOMB_FRICTION;

impl ServoHydraulicTable {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.supply.validate()?;
        self.valve.validate()?;
        self.stops.validate()?;
        self.cylinder.validate(self.stops.stroke)?;
        self.friction.validate()?;
        self.table.validate()?;
        ModelError::require_non_negative(vocabulary::ADDED_PAYLOAD, self.added_payload)?;
        ModelError::require_finite(vocabulary::CUBIC_STIFFNESS, self.cubic_stiffness)?;
        let (name, value, rate) = self.quickest();
        if rate * SHORTEST_STEP <= STEP_BY_RATE {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name,
            value,
            expected: if name == FRICTION {
                "zero, or at least 1e-10 m times `seal_stiffness`, which inner steps of 2 µs still follow"
            } else {
                "a value whose equation is slower than 175,000 1/s (inner steps of 2 µs)"
            },
        })
    }

    /// The quickest rate of the equations (1/s) over the stroke, with the parameter that makes it
    /// and its value: cushions, stops, oil column and edge of the valve at the smallest chamber,
    /// spool, seals at a reversal.
    fn quickest(&self) -> (&'static str, f64, f64) {
        let (mass, stops, cylinder) = (self.mass(), &self.stops, &self.cylinder);
        let [large, small] = cylinder.volumes(stops.stroke);
        let column = cylinder.bulk_modulus * cylinder.area.powi(2) * (1.0 / large + 1.0 / small);
        let spool = std::f64::consts::TAU * self.valve.frequency;
        let candidates = [
            (
                "cushion_damping",
                stops.cushion_damping,
                stops.cushion_damping / mass,
            ),
            (
                "stop_stiffness",
                stops.stiffness,
                (stops.stiffness / mass).sqrt(),
            ),
            (
                vocabulary::OIL_VOLUME,
                cylinder.volume,
                (column / mass).sqrt(),
            ),
            (
                vocabulary::BULK_MODULUS,
                cylinder.bulk_modulus,
                cylinder.bulk_modulus / small * self.valve.steepest_edge(),
            ),
            (
                "make_up_flow",
                cylinder.make_up,
                cylinder.bulk_modulus / small * cylinder.make_up,
            ),
            (
                vocabulary::VALVE_FREQUENCY,
                self.valve.frequency,
                spool * self.valve.damping_ratio.max(0.5) * 2.0,
            ),
            (
                FRICTION,
                self.friction.coulomb,
                STEP_BY_RATE * self.friction.reversal_rate(REVERSAL),
            ),
        ];
        let mut quickest = candidates[0];
        for candidate in candidates {
            if candidate.2 > quickest.2 {
                quickest = candidate;
            }
        }
        quickest
    }

    /// The inner step that keeps to the bound of [`INNER_STEP`], s: finer where cushions, stops,
    /// oil, valve, faint friction or a light table are quicker than by default.
    pub fn inner_step(&self) -> f64 {
        (STEP_BY_RATE / self.quickest().2).min(INNER_STEP)
    }

    /// The rig at rest in the middle, under pressure, with zero command.
    pub fn rest(&self) -> ServoHydraulicState {
        let supply_pressure = self.supply.rest_pressure(self.valve.null_leakage);
        ServoHydraulicState {
            pressures: [0.5 * supply_pressure; 2],
            supply_pressure,
            ..ServoHydraulicState::default()
        }
    }

    /// Mass that the actuator moves without the specimen, kg.
    pub fn mass(&self) -> f64 {
        self.table.mass + self.added_payload
    }

    /// Force of the actuator on the table (N), as a load cell between rod and table reads it:
    /// pressure on the piston less the friction of its seals and the forces of its ends.
    pub fn actuator_force(&self, state: &ServoHydraulicState) -> f64 {
        let [a, b] = state.pressures;
        let (friction, _) = self
            .friction
            .force_and_rate(state.seal_deflection, state.velocity);
        let (elastic, lost) = self.stops.forces(state.displacement, state.velocity);
        self.cylinder.area * (a - b) - friction + elastic + lost
    }

    /// Flow that the valve draws from the supply, m³/s.
    pub fn supply_flow(&self, state: &ServoHydraulicState) -> f64 {
        self.valve
            .flows(state.spool, state.pressures, state.supply_pressure)
            .from_supply
    }

    /// Acceleration of the table (m/s²) under `actuator_force` and `specimen_force` (N).
    fn acceleration_under(
        &self,
        state: &ServoHydraulicState,
        actuator_force: f64,
        specimen_force: f64,
    ) -> f64 {
        let x = state.displacement;
        (actuator_force + specimen_force
            - self.table.damping * state.velocity
            - self.table.stiffness * x
            - self.cubic_stiffness * x * x * x)
            / self.mass()
    }

    /// Acceleration of the table in m/s² under `specimen_force` (N).
    pub fn acceleration(&self, state: &ServoHydraulicState, specimen_force: f64) -> f64 {
        self.acceleration_under(state, self.actuator_force(state), specimen_force)
    }

    /// Time derivative of the state.
    pub fn derivatives(
        &self,
        state: &ServoHydraulicState,
        input: &ServoHydraulicInput,
    ) -> ServoHydraulicState {
        let s = state;
        let flows = self.valve.flows(s.spool, s.pressures, s.supply_pressure);
        let (friction, seal_rate) = self.friction.force_and_rate(s.seal_deflection, s.velocity);
        let (elastic, lost) = self.stops.forces(s.displacement, s.velocity);
        let [a, b] = s.pressures;
        let force = self.cylinder.area * (a - b) - friction + elastic + lost;
        ServoHydraulicState {
            spool: s.spool_velocity,
            spool_velocity: self.valve.spool_acceleration(
                s.spool,
                s.spool_velocity,
                input.valve_command,
            ),
            pressures: self.cylinder.pressure_rates(
                s.pressures,
                [flows.into_a, flows.into_b],
                s.displacement,
                s.velocity,
            ),
            displacement: s.velocity,
            velocity: self.acceleration_under(s, force, input.specimen_force),
            seal_deflection: seal_rate,
            supply_pressure: self.supply.pressure_rate(
                s.supply_pressure,
                flows.from_supply,
                input.supply_lost,
            ),
        }
    }

    /// The state `duration` seconds later with `input` held.
    pub fn advance(
        &self,
        state: &ServoHydraulicState,
        input: &ServoHydraulicInput,
        duration: f64,
    ) -> ServoHydraulicState {
        let driven = Driven { table: self, input };
        integration::advance(&driven, &(*state).into(), duration, self.inner_step()).into()
    }

    /// As [`advance`](Self::advance), with inner steps no longer than `inner_step` seconds and an
    /// estimate of the error that this step made in each state.
    pub fn advance_with_error(
        &self,
        state: &ServoHydraulicState,
        input: &ServoHydraulicInput,
        duration: f64,
        inner_step: f64,
    ) -> (ServoHydraulicState, ServoHydraulicState) {
        let driven = Driven { table: self, input };
        let (next, error) =
            integration::advance_with_error(&driven, &(*state).into(), duration, inner_step);
        (next.into(), error.into())
    }
}

/// The table with its inputs held.
struct Driven<'a> {
    table: &'a ServoHydraulicTable,
    input: &'a ServoHydraulicInput,
}

impl Dynamics<STATES> for Driven<'_> {
    fn derivatives(&self, x: &[f64; STATES]) -> [f64; STATES] {
        self.table.derivatives(&(*x).into(), self.input).into()
    }

    fn stiff_diagonal(&self, x: &[f64; STATES]) -> [f64; STATES] {
        let mut diagonal = [0.0; STATES];
        diagonal[6] = self.table.friction.rate_slope(x[6], x[5]);
        diagonal
    }
}

#[cfg(test)]
mod tests;
