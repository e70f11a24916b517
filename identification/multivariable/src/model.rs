//! The model: shared poles, residues, delays.

use std::path::Path;

use nalgebra::{Complex, DMatrix};
use serde::{Deserialize, Serialize};

use crate::Error;

/// From commands to strokes: `y_i = sum over j, p of Re(r_ijp x_jp)`, `x_jp' = p x_jp + u_j(t - d_j)`. A pair of complex
/// poles is one with a positive imaginary part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// `multivariable`.
    pub kind: String,
    /// Sampling period of the data, s.
    pub period_s: f64,
    /// Delay of each command, s.
    pub delay_s: Vec<f64>,
    /// Poles, rad/s: real and imaginary part.
    pub poles_rad_s: Vec<[f64; 2]>,
    /// Residues by stroke, command and pole, rad/s.
    pub residues: Vec<Vec<Vec<[f64; 2]>>>,
    /// Strokes over commands at rest, by stroke and command.
    pub static_gain: Vec<Vec<f64>>,
    /// One standard error of each static gain.
    pub static_gain_standard_error: Vec<Vec<f64>>,
    /// One standard error of each pole's parts, rad/s.
    pub poles_standard_error: Vec<[f64; 2]>,
    /// One standard error of each delay, s.
    pub delay_standard_error_s: Vec<f64>,
    /// Root mean square of each stroke's residual on data that were not fitted, m.
    pub residual_m: Vec<f64>,
    /// `100 (1 - |y - m|/|y - mean|)` there, for each stroke.
    pub fit_percent: Vec<f64>,
}

/// What [`Model::kind`] is.
pub const KIND: &str = "multivariable";

impl Model {
    /// Number of commands and strokes.
    #[must_use]
    pub fn actuators(&self) -> usize {
        self.residues.len()
    }

    pub(crate) fn poles(&self) -> Vec<Complex<f64>> {
        self.poles_rad_s
            .iter()
            .map(|[re, im]| Complex::new(*re, *im))
            .collect()
    }

    /// Response of strokes (rows) to commands (columns) at an angular frequency, rad/s.
    #[must_use]
    pub fn response(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let s = Complex::new(0.0, omega);
        let poles = self.poles();
        DMatrix::from_fn(self.actuators(), self.actuators(), |i, j| {
            let residues = self.residues[i][j]
                .iter()
                .map(|[re, im]| Complex::new(*re, *im));
            let sum: Complex<f64> = poles
                .iter()
                .zip(residues)
                .map(|(pole, residue)| {
                    0.5 * (residue / (s - pole) + residue.conj() / (s - pole.conj()))
                })
                .sum();
            sum * (-s * self.delay_s[j]).exp()
        })
    }

    /// Reads a model.
    ///
    /// # Errors
    /// A file that cannot be read or is not such a model.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let place = path.display().to_string();
        let text = recordings::read_written(path)
            .map_err(|error| Error::at(place.clone(), error.to_string()))?;
        let model: Self = toml::from_str(&text).map_err(|error| {
            Error::at(
                place.clone(),
                format!("{error}; expected a model that `shakebench identify` wrote from two commands and strokes"),
            )
        })?;
        model.check(&place)?;
        Ok(model)
    }

    /// Checks the numbers of the model in the file `place`.
    fn check(&self, place: &str) -> Result<(), Error> {
        let wrong = |what: &str| Err(Error::at(place, what));
        let n = self.residues.len();
        if self.kind != KIND {
            return wrong(&format!("`kind` is `{}`; expected `{KIND}`", self.kind));
        }
        let shapes = n >= 2
            && [
                self.delay_s.len(),
                self.residual_m.len(),
                self.static_gain.len(),
            ] == [n; 3]
            && self.residues.iter().all(|row| {
                row.len() == n
                    && row
                        .iter()
                        .all(|entry| entry.len() == self.poles_rad_s.len())
            });
        if !shapes {
            return wrong(
                "`delay_s`, `residues` and `residual_m` do not have one row per actuator",
            );
        }
        if let Some([re, _]) = self
            .poles_rad_s
            .iter()
            .find(|[re, im]| re.is_nan() || *re >= 0.0 || !im.is_finite())
        {
            return wrong(&format!(
                "`poles_rad_s`: a real part of {re} is not stable; expected negative ones"
            ));
        }
        if self.period_s > 0.0 && self.delay_s.iter().all(|delay| *delay >= 0.0) {
            return Ok(());
        }
        wrong("`period_s` and `delay_s` must be positive")
    }
}

/// Samples held and delayed by `delay` samples, whole or not.
pub(crate) fn delayed(input: &[f64], delay: f64) -> Vec<f64> {
    let whole = delay.floor();
    let part = delay - whole;
    let shift = whole as usize;
    let at = |k: usize, back: usize| {
        if k >= back {
            input[k - back]
        } else {
            input.first().copied().unwrap_or(0.0)
        }
    };
    (0..input.len())
        .map(|k| (1.0 - part) * at(k, shift) + part * at(k, shift + 1))
        .collect()
}

/// The state of one pole under a held input, from rest about the first sample.
pub(crate) fn filtered(input: &[f64], pole: Complex<f64>, period: f64) -> Vec<Complex<f64>> {
    let phi = (pole * period).exp();
    let gamma = (phi - 1.0) / pole;
    let mut state = Complex::new(0.0, 0.0);
    input
        .iter()
        .map(|u| {
            let now = state;
            state = phi * state + gamma * *u;
            now
        })
        .collect()
}
