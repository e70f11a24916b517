//! The surface over a receding horizon.

use nalgebra::{DMatrix, SVector};

use crate::preview::feedback::{ALL, Feedback};
use crate::preview::feedforward::PREVIEW;
use crate::preview::model::{STATES, SampledRig};
use crate::{ModelError, Motion};

/// First row of `(GᵀG + w²)⁻¹ Gᵀ`: `G` is what unit moves of the command do to `S` at the samples of the
/// horizon.
///
/// # Errors
/// A rig whose valve does not move it.
pub(super) fn first_move(
    rig: &SampledRig,
    surface_rate: f64,
    move_weight: f64,
) -> Result<[f64; PREVIEW], ModelError> {
    let mut x = SVector::<f64, STATES>::zeros();
    let step: Vec<f64> = (0..PREVIEW)
        .map(|_| {
            x = rig.a * x + rig.b;
            x[4] + surface_rate * x[3]
        })
        .collect();
    let g = DMatrix::from_fn(PREVIEW, PREVIEW, |j, i| {
        j.checked_sub(i).map_or(0.0, |age| step[age])
    });
    let normal = g.transpose() * &g + DMatrix::identity(PREVIEW, PREVIEW) * move_weight.powi(2);
    let solved = normal.cholesky().ok_or(ModelError::NoSolution {
        equation: "the least squares of the receding horizon",
        reason: "the valve does not move the table".into(),
    })?;
    let gain = solved.solve(&g.transpose());
    Ok(std::array::from_fn(|j| gain[(0, j)]))
}

/// What a step over the horizon needs.
pub(super) struct Plan<'a> {
    pub feedback: &'a Feedback,
    pub rig: &'a SampledRig,
    pub moves: &'a [f64; PREVIEW],
    /// `lambda`, 1/s.
    pub surface_rate: f64,
    /// Part of `S` that is to be left after a sample.
    pub left: f64,
}

/// Command (V) after the one `before`.
pub(super) fn command(
    plan: &Plan<'_>,
    found: &SVector<f64, ALL>,
    reference: &[Motion; PREVIEW + 1],
    before: f64,
) -> f64 {
    let surface = |own: &SVector<f64, ALL>, wanted: &Motion| {
        own[4] - wanted.velocity + plan.surface_rate * (own[3] - wanted.displacement)
    };
    let mut target = surface(found, &reference[0]);
    let mut ahead = *found;
    let mut change = 0.0;
    for (wanted, gain) in reference[1..].iter().zip(plan.moves) {
        ahead = plan.feedback.advance(plan.rig, &ahead, before, [0.0; 2]);
        target *= plan.left;
        change += gain * (target - surface(&ahead, wanted));
    }
    before + change
}
