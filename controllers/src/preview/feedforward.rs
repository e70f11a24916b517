//! The command that a model needs to follow a motion known ahead: discrete optimal preview
//! (Tomizuka and Rosenthal, Journal of Dynamic Systems, Measurement, and Control 101, 1979).

use nalgebra::{DMatrix, DVector, RowSVector, SMatrix, SVector};
use plant::linear::discrete_riccati;

use super::model::{OUTPUTS, STATES, SampledRig};
use crate::ModelError;

/// Furthest sample ahead that counts.
pub const PREVIEW: usize = 20;
/// States with the command before.
const ALL: usize = STATES + 1;
/// Time in which the acceleration beyond the preview is taken to die away, s.
const FADE: f64 = 0.02;
/// Samples over which what lies beyond the preview is summed.
const BEYOND: usize = 2000;

/// Change of the model's command a sample: `-K [x, u-] + sum_j (R_j r[k+j] + F_j f[k+j])`.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedforward {
    state: RowSVector<f64, STATES>,
    before: f64,
    reference: [RowSVector<f64, OUTPUTS>; PREVIEW + 1],
    force: [f64; PREVIEW + 1],
}

impl Feedforward {
    /// Minimises the sum of `|W (y - r)|²` and `(move (u - u-))²` with the motion known `ahead`
    /// samples; beyond it the acceleration dies away and the force stays.
    ///
    /// # Errors
    /// No stabilising solution of the Riccati equation.
    pub fn new(
        rig: &SampledRig,
        weights: &SVector<f64, OUTPUTS>,
        move_weight: f64,
        ahead: usize,
        period: f64,
    ) -> Result<Self, ModelError> {
        let mut a = DMatrix::identity(ALL, ALL);
        a.view_mut((0, 0), (STATES, STATES)).copy_from(&rig.a);
        a.view_mut((0, STATES), (STATES, 1)).copy_from(&rig.b);
        let mut b = DMatrix::zeros(ALL, 1);
        b.rows_mut(0, STATES).copy_from(&rig.b);
        b[STATES] = 1.0;
        let mut c = DMatrix::zeros(OUTPUTS, ALL);
        c.view_mut((0, 0), (OUTPUTS, STATES)).copy_from(&rig.c);
        let square = DMatrix::from_diagonal(&DVector::from_fn(OUTPUTS, |i, _| weights[i].powi(2)));
        let q = c.transpose() * &square * &c;
        let r = DMatrix::from_element(1, 1, move_weight * move_weight);
        let p = discrete_riccati(&a, &b, &q, &r)?;
        let weighted = b.transpose() * &p;
        let scale = 1.0 / (r[(0, 0)] + (&weighted * &b)[(0, 0)]);
        let gain = &weighted * &a * scale;
        let closed = &a - &b * &gain;

        let column = |x: &SVector<f64, STATES>| {
            let mut long = DVector::zeros(ALL);
            long.rows_mut(0, STATES).copy_from(x);
            long
        };
        let (from, to) = (&p * column(&rig.from), &p * column(&rig.to));
        // The costate's sum: what the outputs' targets and the forces of each later step add to it.
        let outputs = c.transpose() * &square;
        let direct = &outputs * DVector::from_column_slice(rig.d.as_slice());
        let mut feedforward = Self {
            state: RowSVector::from_fn(|_, j| gain[(0, j)]),
            before: gain[(0, STATES)],
            reference: [RowSVector::zeros(); PREVIEW + 1],
            force: [0.0; PREVIEW + 1],
        };
        let ahead = ahead.min(PREVIEW);
        let mut row = b.transpose() * scale;
        let mut force = |j: usize, value: f64| feedforward.force[j.min(ahead)] += value;
        force(0, -(&row * &from)[0]);
        force(1, -(&row * &to)[0]);
        for j in 1..=ahead + BEYOND {
            let passed = &row * closed.transpose();
            force(j, -(&row * &direct)[0] - (&passed * &from)[0]);
            force(j + 1, -(&passed * &to)[0]);
            let target = &row * &outputs;
            let target = RowSVector::<f64, OUTPUTS>::from_fn(|_, i| target[(0, i)]);
            feedforward.reference[j.min(ahead)] += target * beyond(j.saturating_sub(ahead), period);
            row = passed;
        }
        Ok(feedforward)
    }

    /// The model's command after `before` (V) at its state `x`, with the wanted motions and the
    /// forces (N) from now on.
    pub fn command(
        &self,
        x: &SVector<f64, STATES>,
        before: f64,
        wanted: &[SVector<f64, OUTPUTS>; PREVIEW + 1],
        forces: &[f64; PREVIEW + 1],
    ) -> f64 {
        let mut change = -(self.state * x)[0] - self.before * before;
        for j in 0..=PREVIEW {
            change += (self.reference[j] * wanted[j])[0] + self.force[j] * forces[j];
        }
        before + change
    }
}

/// Motion `samples` after the last one known: its acceleration dies away.
fn beyond(samples: usize, period: f64) -> SMatrix<f64, OUTPUTS, OUTPUTS> {
    let t = samples as f64 * period;
    let left = (-t / FADE).exp();
    let velocity = FADE * (1.0 - left);
    SMatrix::<f64, OUTPUTS, OUTPUTS>::new(
        1.0,
        t,
        FADE * (t - velocity),
        0.0,
        1.0,
        velocity,
        0.0,
        0.0,
        left,
    )
}
