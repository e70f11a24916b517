//! How strongly the actuators interact, and what margins a decoupling loop has.

use nalgebra::{Complex, DMatrix};
use serde::Serialize;

use crate::Model;

/// The plant at a frequency.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// Hz.
    pub frequency_hz: f64,
    /// Singular values, largest first.
    pub singular_values: Vec<f64>,
    /// Largest over smallest.
    pub condition: f64,
    /// Magnitudes of the diagonal of the relative gain array (E. H. Bristol, IEEE Transactions on Automatic Control 11,
    /// 1966): 1 where an actuator does not notice whether the others are controlled.
    pub relative_gain: Vec<f64>,
}

/// Margins of the loop of integrators behind the inverse of the static gain.
#[derive(Debug, Clone, Serialize)]
pub struct Loop {
    /// Crossover of each actuator's loop, Hz.
    pub crossover_hz: f64,
    /// Phase margin at each actuator's command with the others closed, degrees.
    pub phase_margin_deg: Vec<f64>,
    /// Gain margin there, dB.
    pub gain_margin_db: Vec<f64>,
    /// Relative change of all commands at once, each by its own complex factor, that the loop bears: the inverse of an upper
    /// bound of the structured singular value of the complementary sensitivity.
    pub simultaneous: f64,
}

/// Interaction of a rig.
#[derive(Debug, Clone, Serialize)]
pub struct Interaction {
    /// Static relative gain array.
    pub relative_gain_at_rest: Vec<Vec<f64>>,
    /// Actuators, from 1, whose strokes follow the command of another one: stroke and that command.
    pub swapped: Vec<[usize; 2]>,
    /// Over frequency.
    pub points: Vec<Point>,
    /// The loop, at the highest crossover of those tried that keeps 0.5 of simultaneous margin; none if no one does.
    pub decoupled: Option<Loop>,
}

/// A static gain that cannot be inverted: some motion is out of reach of every command.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "the static gain cannot be inverted (singular values {largest:.3e} and {least:.3e}): the commands move the strokes \
     alike; check whether two sensors or two commands are the same"
)]
pub struct SingularGain {
    /// Largest singular value.
    pub largest: f64,
    /// Smallest singular value.
    pub least: f64,
}

/// Frequencies at which margins are sought.
const FREQUENCIES: usize = 600;
/// Relative gain from which a stroke belongs to a command.
const OWN: f64 = 0.5;
/// Simultaneous margin that a loop must keep.
const KEPT: f64 = 0.5;

/// Judges a model.
///
/// # Errors
/// A static gain that cannot be inverted: some motion is out of reach of every command.
pub fn interaction(model: &Model) -> Result<Interaction, SingularGain> {
    let n = model.actuators();
    let gain = DMatrix::from_fn(n, n, |i, j| model.static_gain[i][j]);
    let singular = gain.clone().svd(false, false).singular_values;
    let (least, largest) = (singular.min(), singular.max());
    if least.is_nan() || largest.is_nan() || least <= 1e-3 * largest {
        return Err(SingularGain { largest, least });
    }
    let inverse = gain
        .clone()
        .try_inverse()
        .unwrap_or_else(|| DMatrix::zeros(n, n));
    let nyquist = 0.5 / model.period_s;
    let grid = |count: usize, low: f64, high: f64| {
        (0..count).map(move |k| low * (high / low).powf(k as f64 / (count - 1) as f64))
    };
    let points = grid(13, 0.1, 0.8 * nyquist)
        .map(|frequency| point(model, frequency))
        .collect();
    let fastest = model
        .poles_rad_s
        .iter()
        .map(|[re, im]| re.hypot(*im))
        .fold(1.0, f64::max);
    let frequencies: Vec<f64> = grid(FREQUENCIES, 1e-3 * fastest, 20.0 * fastest).collect();
    let decoupled = grid(24, 0.05, nyquist / 4.0)
        .filter_map(|crossover| closed(model, &inverse, &frequencies, crossover))
        .rfind(|own| own.simultaneous >= KEPT);
    let relative_gain_at_rest = rows(&gain.component_mul(&inverse.transpose()));
    Ok(Interaction {
        swapped: swapped(&relative_gain_at_rest),
        relative_gain_at_rest,
        points,
        decoupled,
    })
}

/// Strokes that another command than their own has more influence on, with that command. Rows and columns of the
/// array sum to 1.
fn swapped(relative_gain: &[Vec<f64>]) -> Vec<[usize; 2]> {
    let of = |(i, row): (usize, &Vec<f64>)| {
        let follows = (0..row.len()).max_by(|a, b| row[*a].total_cmp(&row[*b]))?;
        (follows != i && row[follows] > OWN).then_some([i + 1, follows + 1])
    };
    relative_gain.iter().enumerate().filter_map(of).collect()
}

impl Interaction {
    /// What to know of actuators whose cables may be swapped.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let of = |[stroke, command]: &[usize; 2]| {
            format!(
                "stroke {stroke} follows command {command} and not its own: check whether the cables of these actuators \
                 or their sensors are swapped, or rename the columns"
            )
        };
        self.swapped.iter().map(of).collect()
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

fn point(model: &Model, frequency: f64) -> Point {
    let response = model.response(std::f64::consts::TAU * frequency);
    let mut singular: Vec<f64> = response
        .clone()
        .svd(false, false)
        .singular_values
        .iter()
        .copied()
        .collect();
    singular.sort_by(|a, b| b.total_cmp(a));
    let (largest, smallest) = (
        singular.first().copied().unwrap_or(0.0),
        singular.last().copied().unwrap_or(0.0),
    );
    let inverse = response.clone().try_inverse();
    let relative_gain = (0..model.actuators()).map(|i| {
        inverse.as_ref().map_or(f64::INFINITY, |inverse| {
            (response[(i, i)] * inverse[(i, i)]).norm()
        })
    });
    Point {
        frequency_hz: frequency,
        relative_gain: relative_gain.collect(),
        condition: largest / smallest.max(f64::MIN_POSITIVE),
        singular_values: singular,
    }
}

/// The loop `w/s G(s) G(0)^-1`, opened at the commands; none where it is not stable by the generalised Nyquist criterion.
fn closed(
    model: &Model,
    inverse: &DMatrix<f64>,
    frequencies: &[f64],
    crossover_hz: f64,
) -> Option<Loop> {
    let n = model.actuators();
    let omega = std::f64::consts::TAU * crossover_hz;
    let inverse = inverse.map(|value| Complex::new(value, 0.0));
    let identity = DMatrix::<Complex<f64>>::identity(n, n);
    let (mut turned, mut last) = (0.0, None::<Complex<f64>>);
    let mut simultaneous = f64::INFINITY;
    let mut curves = vec![Vec::with_capacity(frequencies.len()); n];
    for w in frequencies {
        let integrator = Complex::new(omega, 0.0) / Complex::new(0.0, *w);
        let open = (&inverse * model.response(*w)) * integrator;
        let sum = &identity + &open;
        let determinant = sum.determinant();
        if let Some(before) = last {
            turned += (determinant / before).arg();
        }
        last = Some(determinant);
        let sensitivity = sum.try_inverse()?;
        simultaneous = simultaneous.min(1.0 / structured(&(&identity - &sensitivity)).max(1e-12));
        for (i, curve) in curves.iter_mut().enumerate() {
            // What the loop at command i is, with all the others closed.
            curve.push(Complex::new(1.0, 0.0) / sensitivity[(i, i)] - 1.0);
        }
    }
    // n integrators turn the determinant by a quarter each on the way from 0 to infinity.
    if (turned - n as f64 * std::f64::consts::FRAC_PI_2).abs() > 0.5 {
        return None;
    }
    let margins: Vec<[f64; 2]> = curves.iter().map(|curve| margins(curve)).collect();
    Some(Loop {
        crossover_hz,
        phase_margin_deg: margins.iter().map(|own| own[0]).collect(),
        gain_margin_db: margins.iter().map(|own| own[1]).collect(),
        simultaneous,
    })
}

/// Least phase margin, degrees, and gain margin, dB, of a curve over frequency.
fn margins(curve: &[Complex<f64>]) -> [f64; 2] {
    let (mut phase, mut gain) = (180.0f64, f64::INFINITY);
    for pair in curve.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        if (a.norm() - 1.0) * (b.norm() - 1.0) < 0.0 {
            phase = phase.min((180.0 - a.arg().to_degrees().abs()).abs());
        }
        if a.im * b.im < 0.0 && a.re < 0.0 && a.norm() < 1.0 {
            gain = gain.min(-20.0 * a.norm().log10());
        }
    }
    [phase, gain]
}

/// Upper bound of the structured singular value for independent complex factors at the rows: the least largest singular value
/// under diagonal scaling, found by balancing rows and columns (E. E. Osborne, Journal of the ACM 7, 1960). For up to three
/// factors the best scaling gives the value itself (A. Packard and J. Doyle, Automatica 29, 1993).
fn structured(matrix: &DMatrix<Complex<f64>>) -> f64 {
    let n = matrix.nrows();
    let mut scaled = matrix.clone();
    for _ in 0..6 {
        for i in 0..n {
            let sum = |of: &dyn Fn(usize) -> Complex<f64>| -> f64 {
                (0..n)
                    .filter(|j| *j != i)
                    .map(|j| of(j).norm_sqr())
                    .sum::<f64>()
                    .sqrt()
            };
            let (row, column) = (sum(&|j| scaled[(i, j)]), sum(&|j| scaled[(j, i)]));
            if row > 0.0 && column > 0.0 {
                let by = (column / row).sqrt();
                for j in (0..n).filter(|j| *j != i) {
                    scaled[(i, j)] *= by;
                    scaled[(j, i)] /= by;
                }
            }
        }
    }
    scaled.svd(false, false).singular_values.max()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two equal lags of static gain G: the relative gain is 1/(1 - g12 g21/(g11 g22)); an integrator before a lag of time T has
    /// the phase margin 90 degrees - atan(w T), and with exact decoupling both loops are alike.
    #[test]
    fn interaction_and_margins_are_those_of_the_closed_form() {
        let pole = -20.0;
        let gain = [[1.0, 0.4], [0.2, 0.8]];
        let residues = gain
            .map(|row| row.map(|g| vec![[-pole * g, 0.0]]).to_vec())
            .to_vec();
        let model = Model {
            kind: crate::model::KIND.into(),
            period_s: 1e-3,
            delay_s: vec![0.0; 2],
            poles_rad_s: vec![[pole, 0.0]],
            residues,
            static_gain: gain.map(|row| row.to_vec()).to_vec(),
            static_gain_standard_error: vec![vec![0.0; 2]; 2],
            poles_standard_error: vec![[0.0; 2]],
            delay_standard_error_s: vec![0.0; 2],
            residual_m: vec![0.0; 2],
            fit_percent: vec![100.0; 2],
        };
        let found = interaction(&model).unwrap();
        let relative = 1.0 / (1.0 - 0.4 * 0.2 / 0.8);
        assert!((found.relative_gain_at_rest[0][0] - relative).abs() < 1e-12);
        assert!((found.points[3].relative_gain[1] - relative).abs() < 1e-9);
        let own = found.decoupled.unwrap();
        let (omega, decay) = (std::f64::consts::TAU * own.crossover_hz, -pole);
        // |L| = 1: (w/x)^2 = 1 + (x/decay)^2.
        let square = 0.5 * decay * decay * ((1.0 + 4.0 * (omega / decay).powi(2)).sqrt() - 1.0);
        let margin = 90.0 - (square.sqrt() / decay).atan().to_degrees();
        for phase in &own.phase_margin_deg {
            assert!((phase - margin).abs() < 1.0, "{phase} {margin}");
        }
        // Second order of damping ratio z: the peak of T is 1/(2 z sqrt(1 - z^2)).
        let z = 0.5 * (decay / omega).sqrt();
        let peak = if z < std::f64::consts::FRAC_1_SQRT_2 {
            1.0 / (2.0 * z * (1.0 - z * z).sqrt())
        } else {
            1.0
        };
        assert!(
            (own.simultaneous - 1.0 / peak).abs() < 0.01,
            "{} {peak}",
            own.simultaneous
        );
    }

    /// For two actuators of gain [[a, b], [c, d]] the relative gain is a d/(a d - b c), and one less it with the columns
    /// swapped.
    #[test]
    fn swapped_actuators_are_named() {
        let relative = |own: f64| vec![vec![own, 1.0 - own], vec![1.0 - own, own]];
        assert!(swapped(&relative(1.11)).is_empty() && swapped(&relative(0.6)).is_empty());
        assert_eq!(swapped(&relative(-0.11)), [[1, 2], [2, 1]]);
        assert_eq!(swapped(&relative(0.3)), [[1, 2], [2, 1]]);
    }

    #[test]
    fn balancing_gives_the_structured_value_of_a_triangular_matrix() {
        let matrix =
            DMatrix::from_row_slice(2, 2, &[0.5, 40.0, 0.01, 0.5].map(|v| Complex::new(v, 0.0)));
        // Balanced: 0.5 + sqrt(40 * 0.01).
        assert!((structured(&matrix) - (0.5 + 0.4f64.sqrt())).abs() < 1e-9);
    }
}
