//! Dormand and Prince's method of order 5(4) with its continuous output of order 4 and a test for
//! stiffness (Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.4 and II.6; Hairer,
//! Wanner, *II*, IV.2).

use super::model::{Done, Model};
use super::step::{Start, Taken, Trial};

/// Beyond this product of step and eigenvalue the method is unstable.
const STABLE: f64 = 3.25;

/// The slopes of a step.
pub(super) struct Slopes([Vec<f64>; 7]);

/// Tries a step. `stiffness` estimates the product of the step and the largest eigenvalue.
pub(super) fn attempt(model: &mut Model, start: &Start, size: f64) -> Done<Trial> {
    let n = start.states.len();
    let mut slopes: [Vec<f64>; 7] = std::array::from_fn(|_| vec![0.0; n]);
    slopes[0].copy_from_slice(start.slope);
    let mut next = start.states.to_vec();
    let mut sixth = Vec::new();
    for stage in 1..7 {
        for i in 0..n {
            let sum: f64 = (0..stage).map(|j| A[stage][j] * slopes[j][i]).sum();
            next[i] = start.states[i] + size * sum;
        }
        if stage == 5 {
            sixth.clone_from(&next);
        }
        model.derivatives(start.time + C[stage] * size, &next, &mut slopes[stage])?;
    }
    let (mut error, mut bend, mut apart) = (0.0_f64, 0.0_f64, 0.0_f64);
    for i in 0..n {
        let e: f64 = size * (0..7).map(|j| E[j] * slopes[j][i]).sum::<f64>();
        let scale = model.size(i, start.states[i], next[i]);
        let share = e.abs() / (model.tolerance * scale);
        // `max` would pass over what is not a number.
        error = if share.is_finite() {
            error.max(share)
        } else {
            f64::INFINITY
        };
        bend = bend.max((size * (slopes[6][i] - slopes[5][i]) / scale).abs());
        apart = apart.max(((next[i] - sixth[i]) / scale).abs());
    }
    if !error.is_finite() || error > 1.0 {
        let shrink = match error.is_finite() {
            true => 0.9 * error.powf(-0.2),
            false => 0.1,
        };
        return Ok(Trial::Refused(size * shrink.clamp(0.1, 0.9)));
    }
    let grow = (0.9 * error.max(1e-10).powf(-0.2)).clamp(0.2, 5.0);
    Ok(Trial::Taken(Taken {
        slope: Some(slopes[6].clone()),
        next,
        proposed: size * grow,
        is_limited: bend > STABLE * apart && apart > 0.0,
        way: super::step::Way::Explicit(Slopes(slopes)),
    }))
}

impl Slopes {
    /// States at the share `theta` of a step.
    pub(super) fn between(&self, state: &[f64], size: f64, theta: f64) -> Vec<f64> {
        let slopes = &self.0;
        let (t, rest) = (theta, 1.0 - theta);
        (0..state.len())
            .map(|i| {
                let whole: f64 = size * (0..6).map(|j| A[6][j] * slopes[j][i]).sum::<f64>();
                let r2 = size * slopes[0][i] - whole;
                let r3 = whole - size * slopes[6][i] - r2;
                let r4: f64 = size * (0..7).map(|j| D[j] * slopes[j][i]).sum::<f64>();
                state[i] + t * (whole + rest * (r2 + t * (r3 + rest * r4)))
            })
            .collect()
    }
}

/// Places of the stages.
const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];

/// Weights of the slopes at the stages; the last row is the step itself.
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
        0.0,
        0.0,
    ],
    [
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
        0.0,
    ],
    [
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];

/// Weights of the error.
const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Weights of the continuous output.
const D: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

#[cfg(test)]
mod tests {
    use super::*;

    /// `x' = -2 x + t`, `y' = x - y` from 1 and 0, whose solution has a closed form.
    fn slope(t: f64, [x, y]: [f64; 2]) -> [f64; 2] {
        [-2.0 * x + t, x - y]
    }

    fn solution(t: f64) -> [f64; 2] {
        let x = 1.25 * (-2.0 * t).exp() + 0.5 * t - 0.25;
        // y' + y = x, with y(0) = 0.
        let y = -1.25 * (-2.0 * t).exp() + 0.5 * t - 0.75 + 2.0 * (-t).exp();
        [x, y]
    }

    #[test]
    fn the_continuous_output_is_the_solution_within_a_step_to_the_fourth_order() {
        let error = |size: f64| {
            let state = [1.0, 0.0];
            let mut slopes: [Vec<f64>; 7] = std::array::from_fn(|_| vec![0.0; 2]);
            for stage in 0..7 {
                let at = [0, 1].map(|i| {
                    let sum: f64 = (0..stage.min(6)).map(|j| A[stage][j] * slopes[j][i]).sum();
                    state[i] + size * sum
                });
                slopes[stage] = slope(C[stage] * size, at).to_vec();
            }
            let slopes = Slopes(slopes);
            let mut most = 0.0_f64;
            for k in 0..=20 {
                let theta = f64::from(k) / 20.0;
                let found = slopes.between(&state, size, theta);
                for (own, truth) in found.iter().zip(solution(theta * size)) {
                    most = most.max((own - truth).abs());
                }
            }
            most
        };
        let [whole, half] = [0.2, 0.1].map(error);
        assert!(whole < 1e-5, "{whole:e}");
        // An error of order five within the step: a half of it has a thirty-second.
        let ratio = whole / half;
        assert!((20.0..50.0).contains(&ratio), "{ratio}");
    }
}
