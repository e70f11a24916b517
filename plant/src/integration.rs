//! Fixed-step integration of smooth equations with a few stiff ones among them.
//!
//! The method is ROS34PW2 of Rang and Angermann (BIT Numerical Mathematics 45, 2005): four stages,
//! order 3, L-stable, with an embedded result of order 2. It is a W-method: its order holds with
//! any approximation of the Jacobian. Here that is a diagonal which is non-zero only for the stiff
//! equations, so nothing is factorised, and without stiff equations it is an explicit Runge-Kutta
//! method.

/// `dx/dt = f(x)` with `N` states; inputs are held by whoever implements it.
pub trait Dynamics<const N: usize> {
    /// `f(x)`.
    fn derivatives(&self, x: &[f64; N]) -> [f64; N];

    /// `df_i/dx_i` of the equations that are stiff by themselves, zero for the others.
    fn stiff_diagonal(&self, x: &[f64; N]) -> [f64; N] {
        let _ = x;
        [0.0; N]
    }
}

const GAMMA: f64 = 0.435_866_521_508_459;
const ALPHA: [[f64; 3]; 3] = [
    [0.871_733_043_016_918, 0.0, 0.0],
    [0.844_570_600_153_694_2, -0.112_990_642_364_841_85, 0.0],
    [0.0, 0.0, 1.0],
];
const COUPLING: [[f64; 3]; 3] = [
    [-0.871_733_043_016_918, 0.0, 0.0],
    [-0.903_380_570_130_440_8, 0.054_180_672_388_095_33, 0.0],
    [
        0.242_123_807_060_953_46,
        -1.223_250_583_904_514_7,
        0.545_260_255_335_102_1,
    ],
];
const WEIGHTS: [f64; 4] = [
    0.242_123_807_060_953_46,
    -1.223_250_583_904_514_7,
    1.545_260_255_335_102,
    GAMMA,
];
const EMBEDDED_WEIGHTS: [f64; 4] = [
    0.378_109_031_458_193_7,
    -0.096_042_292_212_423_18,
    0.5,
    0.217_933_260_754_229_5,
];

/// The four increments of a step.
fn stages<const N: usize>(model: &impl Dynamics<N>, x: &[f64; N], step: f64) -> [[f64; N]; 4] {
    let stiff = model.stiff_diagonal(x);
    let mut k = [[0.0; N]; 4];
    for stage in 0..4 {
        let mut at = *x;
        let mut coupled = [0.0; N];
        for earlier in 0..stage {
            let (a, c) = (ALPHA[stage - 1][earlier], COUPLING[stage - 1][earlier]);
            for i in 0..N {
                at[i] += a * k[earlier][i];
                coupled[i] += c * k[earlier][i];
            }
        }
        let slope = model.derivatives(&at);
        for i in 0..N {
            let stiffness = step * stiff[i];
            k[stage][i] = (step * slope[i] + stiffness * coupled[i]) / (1.0 - GAMMA * stiffness);
        }
    }
    k
}

fn combine<const N: usize>(x: &[f64; N], k: &[[f64; N]; 4], weights: &[f64; 4]) -> [f64; N] {
    let mut next = *x;
    for (increment, weight) in k.iter().zip(weights) {
        for i in 0..N {
            next[i] += weight * increment[i];
        }
    }
    next
}

/// The state one inner step of `step` seconds later.
pub fn inner_step<const N: usize>(model: &impl Dynamics<N>, x: &[f64; N], step: f64) -> [f64; N] {
    combine(x, &stages(model, x, step), &WEIGHTS)
}

/// The state `step` seconds later by the classical Runge-Kutta method of fourth order, for
/// equations without stiff ones among them.
#[inline]
pub fn runge_kutta_4<const N: usize>(
    x: &[f64; N],
    step: f64,
    derivatives: impl Fn(&[f64; N]) -> [f64; N],
) -> [f64; N] {
    let along = |k: &[f64; N], h: f64| {
        let mut to = *x;
        for i in 0..N {
            to[i] += h * k[i];
        }
        to
    };
    let k1 = derivatives(x);
    let k2 = derivatives(&along(&k1, 0.5 * step));
    let k3 = derivatives(&along(&k2, 0.5 * step));
    let k4 = derivatives(&along(&k3, step));
    let mut next = *x;
    for i in 0..N {
        next[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
    next
}

/// The number of equal inner steps, none longer than `longest`, that make up `duration` seconds.
pub fn inner_steps(duration: f64, longest: f64) -> u32 {
    // The tolerance keeps a duration of exactly n steps from being cut into n + 1.
    (duration / longest - 1e-9).ceil().clamp(1.0, 1e9) as u32
}

/// The state `duration` seconds later, in equal inner steps none longer than `longest`.
pub fn advance<const N: usize>(
    model: &impl Dynamics<N>,
    x: &[f64; N],
    duration: f64,
    longest: f64,
) -> [f64; N] {
    let count = inner_steps(duration, longest);
    let step = duration / f64::from(count);
    (0..count).fold(*x, |x, _| inner_step(model, &x, step))
}

/// As [`advance`], with an estimate of the error of each state at the end: the difference from the
/// embedded method, added up over the inner steps. Being that of the method of order 2, it is
/// cautious.
pub fn advance_with_error<const N: usize>(
    model: &impl Dynamics<N>,
    x: &[f64; N],
    duration: f64,
    longest: f64,
) -> ([f64; N], [f64; N]) {
    let count = inner_steps(duration, longest);
    let step = duration / f64::from(count);
    let (mut x, mut error) = (*x, [0.0; N]);
    for _ in 0..count {
        let k = stages(model, &x, step);
        let embedded = combine(&x, &k, &EMBEDDED_WEIGHTS);
        x = combine(&x, &k, &WEIGHTS);
        for i in 0..N {
            error[i] += (x[i] - embedded[i]).abs();
        }
    }
    (x, error)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pendulum that pulls a stiff follower: `y' = -rate (y - cos x) - sin(x) v`, whose exact
    /// solution from `y = cos x` is `y = cos x`.
    struct Follower {
        rate: f64,
        implicit: bool,
    }

    impl Dynamics<3> for Follower {
        fn derivatives(&self, &[x, v, y]: &[f64; 3]) -> [f64; 3] {
            [v, -x.sin(), -self.rate * (y - x.cos()) - x.sin() * v]
        }

        fn stiff_diagonal(&self, _: &[f64; 3]) -> [f64; 3] {
            [0.0, 0.0, if self.implicit { -self.rate } else { 0.0 }]
        }
    }

    /// Errors after 2 s against a run with steps 16 times smaller.
    fn error(model: &Follower, step: f64) -> (f64, f64) {
        let start = [1.0, 0.3, 1.0_f64.cos()];
        let fine = advance(model, &start, 2.0, step / 16.0);
        let coarse = advance(model, &start, 2.0, step);
        (
            (coarse[0] - fine[0]).abs(),
            (coarse[2] - coarse[0].cos()).abs(),
        )
    }

    #[test]
    fn order_is_three_with_and_without_the_diagonal() {
        for implicit in [false, true] {
            let model = Follower {
                rate: 5.0,
                implicit,
            };
            let (coarse, fine) = (error(&model, 0.02), error(&model, 0.01));
            for ratio in [coarse.0 / fine.0, coarse.1 / fine.1] {
                assert!((6.5..10.5).contains(&ratio), "{implicit}: {ratio}");
            }
        }
    }

    #[test]
    fn a_stiff_equation_follows_at_steps_far_beyond_its_time_constant() {
        let model = Follower {
            rate: 1e6,
            implicit: true,
        };
        let (_, off) = error(&model, 0.01);
        assert!(off < 1e-6, "{off:e}");
    }

    #[test]
    fn error_estimate_bounds_the_true_error_without_exaggeration() {
        let model = Follower {
            rate: 5.0,
            implicit: true,
        };
        let start = [1.0, 0.3, 1.0_f64.cos()];
        let exact = advance(&model, &start, 2.0, 1e-4);
        let (got, estimate) = advance_with_error(&model, &start, 2.0, 0.01);
        for i in 0..3 {
            let error = (got[i] - exact[i]).abs();
            assert!(error <= estimate[i] && estimate[i] < 1e-3, "{i}: {error:e}");
        }
    }

    #[test]
    fn the_inner_steps_divide_the_communication_step() {
        assert_eq!(inner_steps(0.002, 0.0002), 10);
        assert_eq!(inner_steps(0.002, 0.0003), 7);
        assert_eq!(inner_steps(0.0001, 0.0002), 1);
    }
}
