//! Plant parameters: what the laboratory believes and what the true rig has.

/// Plant parameters, in the order in which they are perturbed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plant {
    /// `s³ + a2 s² + a1 s + a0`.
    pub denominator: [f64; 3],
    /// Valve command to force.
    pub voltage_to_force: [f64; 3],
    /// Velocity to force, plus sign as in Eq 3-3.
    pub velocity_to_force: [f64; 3],
    /// Mass, damping, stiffness of the table.
    pub table: [f64; 3],
    /// Mass, damping, stiffness of the specimen.
    pub specimen: [f64; 3],
}

/// What the laboratory believes: Eq 2-13, 2-14 and Appendix A.
pub const NOMINAL: Plant = Plant {
    denominator: [56.18, 1.333e4, 178.2],
    voltage_to_force: [3430.0, 3.86e4, 403.3],
    velocity_to_force: [565.1, -1818.0, 3.12e5],
    table: [0.1212, 0.2465, 23.3189],
    specimen: [0.258799172, 0.162608315, 10.216981782],
};

impl Plant {
    /// Every parameter times `1 + factor()`.
    pub fn perturbed(mut self, mut factor: impl FnMut() -> f64) -> Self {
        let groups = [
            &mut self.denominator,
            &mut self.voltage_to_force,
            &mut self.velocity_to_force,
            &mut self.table,
            &mut self.specimen,
        ];
        for value in groups.into_iter().flatten() {
            *value *= 1.0 + factor();
        }
        self
    }
}
