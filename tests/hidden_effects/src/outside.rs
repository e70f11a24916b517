//! Effects that the catalogue does not hold, among them a wrong functional form of every
//! nonlinear family.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Something outside the catalogue; each strength runs from 0 (weak) to 1 (strong).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Outside {
    /// Drag on the table in proportion to `v |v|` (a wrong form of friction).
    QuadraticDrag,
    /// Friction that grows away from the middle of the stroke (a wrong form of friction).
    PositionDependentFriction,
    /// Flow gain that falls smoothly with the command's size (a wrong form of saturation).
    SoftValve,
    /// Spool with underlap: twice the gain near null (a wrong form of the dead band). A dead band
    /// on one side only would be no outsider: it is an overlap with an offset.
    UnderlappedSpool,
    /// Spring that acts beyond a gap on one side (a wrong form of stiffness).
    OneSidedStop,
    /// Free play between piston and table spring.
    SpringPlay,
    /// A small mass on a lightly damped spring on the table.
    ParasiticOscillator,
    /// Flow gain that drifts by the clock as the oil warms.
    WarmingOil,
    /// Displacement sensor with a cubic error (a wrong form of its scale).
    CurvedDisplacementSensor,
    /// Load cell that reads acceleration as well.
    LoadCellCrosstalk,
    /// Specimen with slack about the origin (a wrong form of uplift).
    SpecimenSlack,
    /// Specimen with a friction device (a wrong form of yielding).
    SpecimenFriction,
    /// Specimen with drag in proportion to the drift's squared velocity.
    SpecimenQuadraticDamping,
    /// A converter that resolves the command coarsely (a wrong form of valve hysteresis).
    CoarseConverter,
}

/// All of them.
pub const OUTSIDE: [Outside; 14] = [
    Outside::QuadraticDrag,
    Outside::PositionDependentFriction,
    Outside::SoftValve,
    Outside::UnderlappedSpool,
    Outside::OneSidedStop,
    Outside::SpringPlay,
    Outside::ParasiticOscillator,
    Outside::WarmingOil,
    Outside::CurvedDisplacementSensor,
    Outside::LoadCellCrosstalk,
    Outside::SpecimenSlack,
    Outside::SpecimenFriction,
    Outside::SpecimenQuadraticDamping,
    Outside::CoarseConverter,
];

impl Outside {
    /// Size in the effect's own unit (inch, pound-force, second, volt) at `strength` in 0..1.
    pub fn size(self, strength: f64) -> f64 {
        let (weak, strong): (f64, f64) = match self {
            Self::QuadraticDrag => (0.01, 0.1),
            Self::PositionDependentFriction => (1.0, 8.0),
            Self::SoftValve => (0.02, 0.15),
            Self::UnderlappedSpool => (0.04, 0.2),
            Self::OneSidedStop => (8.0, 60.0),
            Self::SpringPlay => (0.02, 0.12),
            Self::ParasiticOscillator => (0.04, 0.2),
            Self::WarmingOil => (0.08, 0.4),
            Self::CurvedDisplacementSensor => (0.05, 0.25),
            Self::LoadCellCrosstalk => (0.01, 0.06),
            Self::SpecimenSlack => (0.05, 0.4),
            Self::SpecimenFriction => (0.4, 3.0),
            Self::SpecimenQuadraticDamping => (0.02, 0.2),
            Self::CoarseConverter => (0.1, 0.5),
        };
        weak * (strong / weak).powf(strength)
    }

    /// Draws one of them.
    pub fn draw(rng: &mut ChaCha8Rng) -> Self {
        OUTSIDE[rng.random_range(0..OUTSIDE.len())]
    }
}
