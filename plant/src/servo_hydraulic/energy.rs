//! Where the energy of the rig goes.

use super::{ServoHydraulicInput, ServoHydraulicState, ServoHydraulicTable};

/// Energy held by the parts, J.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StoredEnergy {
    /// Compression of the oil in both chambers.
    pub oil: f64,
    /// Motion of the table.
    pub kinetic: f64,
    /// Springs of the table, seals and stops.
    pub springs: f64,
}

/// Rates of energy, W.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Powers {
    /// Brought by the oil that the valve draws from the supply and the check valves from the tank.
    pub supplied: f64,
    /// Turned to heat in the edges of the valve and the check valves.
    pub throttled: f64,
    /// Turned to heat by the leak past the piston.
    pub leaked: f64,
    /// Done by the pressures on the piston.
    pub piston: f64,
    /// Turned to heat by seals, cushions and stops.
    pub rubbed: f64,
    /// Turned to heat by the damping of the table.
    pub damped: f64,
    /// Done by the specimen on the table.
    pub specimen: f64,
}

impl ServoHydraulicTable {
    /// Energy stored in `state`.
    pub fn stored_energy(&self, state: &ServoHydraulicState) -> StoredEnergy {
        let [volume_a, volume_b] = self.cylinder.volumes(state.displacement);
        let [a, b] = state.pressures.map(|p| self.cylinder.energy_density(p));
        let x = state.displacement;
        let beyond = (x.abs() - self.stops.stroke).max(0.0);
        StoredEnergy {
            oil: volume_a * a + volume_b * b,
            kinetic: 0.5 * self.mass() * state.velocity * state.velocity,
            springs: 0.5 * self.table.stiffness * x * x
                + 0.25 * self.cubic_stiffness * x.powi(4)
                + 0.5 * self.friction.stiffness * state.seal_deflection.powi(2)
                + 0.5 * self.stops.stiffness * beyond * beyond,
        }
    }

    /// Where energy flows in `state` under `input`. On the hydraulic side
    /// `supplied = throttled + leaked + piston + d(oil)/dt`, on the mechanical side
    /// `piston + specimen = rubbed + damped + d(kinetic + springs)/dt`.
    ///
    /// Oil that passes a restriction brings its work `p` and its compression to the other side,
    /// both per volume; what is missing there is heat.
    pub fn powers(&self, state: &ServoHydraulicState, input: &ServoHydraulicInput) -> Powers {
        let s = state;
        let flows = self.valve.flows(s.spool, s.pressures, s.supply_pressure);
        let worth = |pressure: f64| pressure + self.cylinder.energy_density(pressure);
        let [a, b] = s.pressures;
        let make_up = [a, b].map(|p| self.cylinder.make_up_flow(p));
        let supplied = flows.from_supply * worth(s.supply_pressure);
        let arriving =
            (flows.into_a + make_up[0]) * worth(a) + (flows.into_b + make_up[1]) * worth(b);
        let (friction, seal_rate) = self.friction.force_and_rate(s.seal_deflection, s.velocity);
        let (_, lost) = self.stops.forces(s.displacement, s.velocity);
        Powers {
            supplied,
            throttled: supplied - arriving,
            leaked: self.cylinder.leak([a, b]) * (worth(a) - worth(b)),
            piston: self.cylinder.area * (a - b) * s.velocity,
            rubbed: friction * s.velocity
                - self.friction.stiffness * s.seal_deflection * seal_rate
                - lost * s.velocity,
            damped: self.table.damping * s.velocity * s.velocity,
            specimen: input.specimen_force * s.velocity,
        }
    }
}
