//! Synthesis of the loop-shaping controller of Section 3.4 for a crossover that the user gives.
//!
//! The target is `L(s) = w_n / s` (Eq 3-8). The steps are those of McFarlane and Glover ("A loop
//! shaping design procedure using H-infinity synthesis", IEEE Trans. Automatic Control 37, 1992):
//!
//! 1. **Weight.** `W = kappa (s² + a s + b) / (s (s + p))` takes the plant's two slowest poles,
//!    mirrored into the left half plane where they are unstable, and its slowest zero out of the
//!    loop and puts an integrator in; `kappa` makes `s W G` tend to `w_n` at low frequency. So the
//!    shaped plant `G_s = W G` is `w_n / s` up to the phase of the unstable pair until the plant's
//!    faster dynamics set in.
//! 2. **Robust stabilisation** of `G_s` against uncertainty of its normalised coprime factors, with
//!    `gamma = 1.05 gamma_min` ([`coprime`]). A small `gamma_min` (below about 4) says that the
//!    target suits the plant.
//! 3. **Order.** `C = W K` holds the integrator, which is split off exactly, and a stable part,
//!    which is reduced to one state by balanced residualisation ([`balanced`]); together the form of
//!    Eq 3-10: `g (s² + n1 s + n0) / (s (s + p))`.
//!
//! Everything is computed in time measured in `1 / w_n`, where the numbers are of order one.

pub mod balanced;
pub mod coprime;
pub mod whole_plant;

use nalgebra::{Complex, DMatrix};
use plant::linear::{StateSpace, TransferFunction};

use crate::ModelError;
use crate::loop_shaping::LoopShapingCoefficients;
use coprime::RobustController;

/// The target crossover at which the synthesis comes nearest to Eq 3-10 on the identified bare
/// table, rad/s.
pub const EQUATION_3_10_CROSSOVER: f64 = 65.0;

/// `gamma` over its minimum: at the minimum itself the central controller is singular.
const GAMMA_FACTOR: f64 = 1.05;

const NAME: &str = "the loop-shaping synthesis";

/// A loop-shaping controller and how it came about.
#[derive(Debug, Clone)]
pub struct LoopShapingDesign {
    /// `w_n` of Eq 3-8, rad/s.
    pub crossover: f64,
    /// The shaping weight `W`, V/m.
    pub weight: TransferFunction,
    /// The robust controller `K` of `G_s`, its time in `1 / w_n`.
    pub robust: RobustController,
    /// Hankel singular values of the stable part of `C = W K`, V/m, descending.
    pub hankel_singular_values: Vec<f64>,
    /// The controller reduced to second order.
    pub coefficients: LoopShapingCoefficients,
}

impl LoopShapingDesign {
    /// `C = W K` before its order is reduced, V/m.
    pub fn full(&self, s: Complex<f64>) -> Option<Complex<f64>> {
        Some(self.weight.evaluate(s) * self.robust.controller.evaluate(s / self.crossover)?[(0, 0)])
    }

    /// The controller of second order, V/m.
    pub fn reduced(&self) -> TransferFunction {
        transfer_function(&self.coefficients)
    }
}

/// A controller of the form of Eq 3-10 as a transfer function.
pub fn transfer_function(coefficients: &LoopShapingCoefficients) -> TransferFunction {
    let LoopShapingCoefficients {
        gain,
        numerator_rate,
        numerator_constant,
        pole,
    } = *coefficients;
    TransferFunction {
        numerator: vec![gain, gain * numerator_rate, gain * numerator_constant],
        denominator: vec![1.0, pole, 0.0],
    }
}

/// Designs the displacement controller of `plant` (V to m) for the target `crossover / s`.
///
/// # Errors
/// A crossover that is not positive, a plant without three poles and a real slowest zero
/// in the left half plane, and a target at which the reduced controller does not stabilise the
/// plant.
pub fn loop_shaping(
    plant: &TransferFunction,
    crossover: f64,
) -> Result<LoopShapingDesign, ModelError> {
    ModelError::require_positive("crossover", crossover)?;
    let mut poles = plant.poles();
    let mut zeros = plant.zeros();
    if poles.len() < 3 || zeros.is_empty() || zeros.len() + 2 > poles.len() {
        return Err(ModelError::Shape {
            what: "plant of the loop-shaping synthesis",
            expected: "three poles or more, at least one zero, at least two more poles than \
                zeros"
                .into(),
            got: format!("{} poles and {} zeros", poles.len(), zeros.len()),
        });
    }
    poles.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    zeros.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    let slow_zero = zeros[0];
    let slow_pair = [poles[0], poles[1]].map(|pole| Complex::new(-pole.re.abs(), pole.im));
    if slow_zero.re >= 0.0 || slow_zero.im != 0.0 {
        return Err(no_solution(format!(
            "the plant's slowest zero ({slow_zero:.4} 1/s) is not a real one in the left half plane"
        )));
    }
    let pair_sum = slow_pair[0] + slow_pair[1];
    if pair_sum.im.abs() > 1e-9 * pair_sum.norm() || slow_pair[0].norm() == 0.0 {
        return Err(no_solution(
            "the plant's two slowest poles are neither a pair nor real, or are at zero".into(),
        ));
    }
    let (a, b) = (-pair_sum.re, (slow_pair[0] * slow_pair[1]).re);
    let p = -slow_zero.re;
    let static_gain = plant.evaluate(Complex::new(0.0, 0.0)).re;
    let kappa = crossover * p / (b * static_gain);
    let weight = TransferFunction::new(&[kappa, kappa * a, kappa * b], &[1.0, p, 0.0])?;

    // G_s in time of 1 / w_n, with the slow zero taken out exactly and s G_s = 1 at s = 0.
    let scaled =
        |roots: &[Complex<f64>]| -> Vec<_> { roots.iter().map(|root| root / crossover).collect() };
    let mut shaped_zeros = scaled(&zeros[1..]);
    shaped_zeros.extend(scaled(&slow_pair));
    let numerator = polynomial(&shaped_zeros);
    let mut denominator = polynomial(&scaled(&poles));
    let at_zero = |coefficients: &[f64]| coefficients.last().copied().unwrap_or(1.0);
    let gain = at_zero(&denominator) / at_zero(&numerator);
    denominator.push(0.0);
    let numerator: Vec<f64> = numerator.iter().map(|value| value * gain).collect();
    let shaped = TransferFunction::new(&numerator, &denominator)?.to_state_space()?;

    let robust = coprime::stabilise(&shaped, GAMMA_FACTOR)?;
    let parts = [a / crossover, b / (crossover * crossover), p / crossover];
    let (coefficients, hankel_singular_values) =
        reduce(&robust.controller, kappa, parts, crossover)?;
    let design = LoopShapingDesign {
        crossover,
        weight,
        robust,
        hankel_singular_values,
        coefficients,
    };
    let closed = design.reduced().series(plant).closed_loop();
    if closed.poles().iter().any(|pole| pole.re >= 0.0) {
        return Err(no_solution(format!(
            "reduced to second order the controller does not stabilise the plant at a crossover \
             of {crossover} rad/s"
        )));
    }
    Ok(design)
}

/// `C = W K` to the form of Eq 3-10. `[a, b, p]` are those of the weight in time of
/// `1 / crossover`.
fn reduce(
    k: &StateSpace,
    kappa: f64,
    [a, b, p]: [f64; 3],
    crossover: f64,
) -> Result<(LoopShapingCoefficients, Vec<f64>), ModelError> {
    // W = kappa (1 + r0 / s + r1 / (s + p)).
    let r0 = b / p;
    let r1 = a - p - r0;
    let n = k.order();
    let Some(inverse) = k.a.clone().try_inverse() else {
        return Err(no_solution("the robust controller integrates".into()));
    };
    let to_rate = &k.c * inverse;
    // (K(s) - K(0)) / s = C A^-1 (s - A)^-1 B.
    let integral = -kappa * r0 * (&to_rate * &k.b)[(0, 0)];
    let mut stable_a = DMatrix::zeros(n + 1, n + 1);
    stable_a.view_mut((0, 0), (n, n)).copy_from(&k.a);
    stable_a.view_mut((n, 0), (1, n)).copy_from(&k.c);
    stable_a[(n, n)] = -p;
    let mut stable_b = DMatrix::zeros(n + 1, 1);
    stable_b.rows_mut(0, n).copy_from(&k.b);
    let mut stable_c = DMatrix::zeros(1, n + 1);
    stable_c
        .view_mut((0, 0), (1, n))
        .copy_from(&((&k.c + to_rate * r0) * kappa));
    stable_c[(0, n)] = kappa * r1;
    let stable = StateSpace::new(stable_a, stable_b, stable_c, DMatrix::zeros(1, 1))?;
    let (small, hankel_singular_values) = balanced::residualise(&stable, 1)?;

    let gain = small.d[(0, 0)];
    let pole = -small.a[(0, 0)] * crossover;
    let residue = small.c[(0, 0)] * small.b[(0, 0)] * crossover;
    let integral = integral * crossover;
    Ok((
        LoopShapingCoefficients {
            gain,
            numerator_rate: pole + (integral + residue) / gain,
            numerator_constant: integral * pole / gain,
            pole,
        },
        hankel_singular_values,
    ))
}

/// The monic real polynomial with these roots (complex ones in pairs), highest power first.
fn polynomial(roots: &[Complex<f64>]) -> Vec<f64> {
    let mut coefficients = vec![Complex::new(1.0, 0.0)];
    for root in roots {
        coefficients.push(Complex::new(0.0, 0.0));
        for i in (1..coefficients.len()).rev() {
            let before = coefficients[i - 1];
            coefficients[i] -= root * before;
        }
    }
    coefficients.iter().map(|value| value.re).collect()
}

pub(crate) fn no_solution(reason: String) -> ModelError {
    ModelError::NoSolution {
        equation: NAME,
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::identified::shake_table::ShakeTable;
    use plant::linear::{continuous_riccati_residual, log_space};
    use units::constants::INCH;

    fn design(crossover: f64) -> LoopShapingDesign {
        loop_shaping(&ShakeTable::default().voltage_to_displacement(), crossover).unwrap()
    }

    #[test]
    fn near_65_rad_per_s_the_synthesis_gives_equation_3_10() {
        let printed = transfer_function(&LoopShapingCoefficients::equation_3_10());
        let rms_db = |crossover: f64| {
            let reduced = design(crossover).reduced();
            let omega = log_space(0.01, 100.0, 200);
            let sum: f64 = omega
                .iter()
                .map(|&w| {
                    let s = Complex::new(0.0, w);
                    let ratio = reduced.evaluate(s).norm() / printed.evaluate(s).norm();
                    (20.0 * ratio.log10()).powi(2)
                })
                .sum();
            (sum / 200.0).sqrt()
        };
        let at_best = rms_db(EQUATION_3_10_CROSSOVER);
        assert!(at_best < 0.35, "{at_best} dB");
        assert!(rms_db(0.9 * EQUATION_3_10_CROSSOVER) > at_best);
        assert!(rms_db(1.1 * EQUATION_3_10_CROSSOVER) > at_best);
        let c = design(EQUATION_3_10_CROSSOVER).coefficients;
        println!("{c:?}, {} V/in", c.gain * INCH);
        assert!((c.gain * INCH / 6.986 - 1.0).abs() < 0.02, "{c:?}");
        assert!((c.numerator_constant / 0.5892 - 1.0).abs() < 0.04, "{c:?}");
        assert!((c.pole / 0.01046 - 1.0).abs() < 1e-3, "{c:?}");
    }

    #[test]
    fn gamma_min_is_that_of_the_hankel_norm_of_the_coprime_factors() {
        let shaped = TransferFunction::new(&[0.3, 1.0], &[1.0, 0.4, 1.3, 0.0])
            .unwrap()
            .to_state_space()
            .unwrap();
        let (x, z) = coprime::riccati_pair(&shaped).unwrap();
        let one = DMatrix::identity(1, 1);
        let (a, b, c) = (&shaped.a, &shaped.b, &shaped.c);
        let residual = continuous_riccati_residual(a, b, &(c.transpose() * c), &one, &x).unwrap();
        assert!(residual.amax() < 1e-10 * x.amax());
        // [N M] = (A + H C, [B H], C, [0 1]) with H = -Z C'; gamma_min = (1 - |[N M]|_H^2)^(-1/2).
        let h = -(&z * c.transpose());
        let stable = a + &h * c;
        let into = b * b.transpose() + &h * h.transpose();
        let controllability = balanced::lyapunov(&stable, &into).unwrap();
        let observability = balanced::lyapunov(&stable.transpose(), &(c.transpose() * c)).unwrap();
        let hankel_squared = (controllability * observability)
            .complex_eigenvalues()
            .iter()
            .map(|value| value.re)
            .fold(0.0, f64::max);
        let expected = 1.0 / (1.0 - hankel_squared).sqrt();
        let got = coprime::stabilise(&shaped, 1.05).unwrap().gamma_min;
        assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
    }

    #[test]
    fn an_integrator_alone_has_the_gamma_of_its_closed_form() {
        // G = 1 / s: X = Z = 1, gamma_min = sqrt 2, K = 1 in the limit.
        let integrator = TransferFunction::new(&[1.0], &[1.0, 0.0])
            .unwrap()
            .to_state_space()
            .unwrap();
        let robust = coprime::stabilise(&integrator, 1.05).unwrap();
        assert!((robust.gamma_min - 2f64.sqrt()).abs() < 1e-12);
        let near_optimal = coprime::stabilise(&integrator, 1.0 + 1e-7)
            .unwrap()
            .controller;
        let k = near_optimal.evaluate(Complex::new(0.0, 1.0)).unwrap()[(0, 0)];
        assert!((k - 1.0).norm() < 1e-5, "{k}");
    }

    #[test]
    fn the_robust_loop_keeps_the_norm_promised() {
        let design = design(EQUATION_3_10_CROSSOVER);
        let plant = ShakeTable::default().voltage_to_displacement();
        println!("gamma_min {:.4}", design.robust.gamma_min);
        let mut largest: f64 = 0.0;
        for omega in log_space(1e-3, 1e4, 2000) {
            let s = Complex::new(0.0, omega);
            let g = plant.evaluate(s) * design.weight.evaluate(s);
            let k = design.full(s).unwrap() / design.weight.evaluate(s);
            let size = ((1.0 + k.norm_sqr()) * (1.0 + g.norm_sqr())).sqrt();
            largest = largest.max(size / (1.0 + g * k).norm());
        }
        assert!(largest <= design.robust.gamma * (1.0 + 1e-6), "{largest}");
        assert!(
            largest >= design.robust.gamma_min * (1.0 - 1e-6),
            "{largest}"
        );
    }

    #[test]
    fn what_cannot_be_designed_is_refused() {
        let plant = ShakeTable::default().voltage_to_displacement();
        let error = loop_shaping(&plant, 0.0).unwrap_err().to_string();
        assert!(error.contains("`crossover` is 0"), "{error}");
        let error = loop_shaping(&plant, 1e4).unwrap_err().to_string();
        assert!(error.contains("does not stabilise"), "{error}");
        let integrator = TransferFunction::new(&[1.0], &[1.0, 0.0]).unwrap();
        let error = loop_shaping(&integrator, 10.0).unwrap_err().to_string();
        assert!(error.contains("1 poles and 0 zeros"), "{error}");
    }
}
