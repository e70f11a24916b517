//! The specimen from the accelerations below and on it, by simulation.

use nalgebra::DMatrix;
use plant::integration::runge_kutta_4;

use super::velocity::noise_floor;
use sysid::nonlinear::{Coordinate, Residuals, minimise};

/// A specimen over its mass: `d'' = -a - f/m`, `f/m = c d' + k (r d + (1 - r) z)`,
/// `z' = d' (1 - |z/d_y|^n (1 + sign(z d'))/2)` (Bouc and Wen), elastic for an infinite `d_y`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpecimenOverMass {
    /// `c/m`, 1/s.
    pub damping: f64,
    /// `k/m`, 1/s².
    pub stiffness: f64,
    /// `d_y`, m; infinite without yielding.
    pub yield_displacement: f64,
    /// `r`.
    pub post_ratio: f64,
    /// `n`.
    pub exponent: f64,
}

/// What was found of a specimen.
#[derive(Debug, Clone)]
pub struct SpecimenFit {
    /// The specimen.
    pub specimen: SpecimenOverMass,
    /// Covariance of damping, stiffness, yield displacement, ratio and exponent.
    pub covariance: DMatrix<f64>,
    /// Error of the simulated acceleration over the measured one, root mean squares.
    pub misfit: f64,
}

impl SpecimenOverMass {
    /// Elastic.
    pub fn elastic(damping: f64, stiffness: f64) -> Self {
        Self {
            damping,
            stiffness,
            yield_displacement: f64::INFINITY,
            post_ratio: 0.1,
            exponent: 2.0,
        }
    }

    /// Force over mass (m/s²) at drift, drift velocity and hysteretic deformation.
    pub fn force(&self, [d, v, z]: [f64; 3]) -> f64 {
        let effective = if self.yield_displacement.is_finite() {
            self.post_ratio * d + (1.0 - self.post_ratio) * z
        } else {
            d
        };
        self.damping * v + self.stiffness * effective
    }

    /// Rate of the hysteretic deformation.
    pub fn hysteretic_rate(&self, v: f64, z: f64) -> f64 {
        if z * v <= 0.0 || self.yield_displacement.is_infinite() {
            return v;
        }
        v * (1.0 - (z / self.yield_displacement).abs().powf(self.exponent))
    }

    /// Acceleration of the mass (m/s²) on a base that moves with `acceleration` (m/s², a sample
    /// every `period` s, straight in between), from rest.
    pub fn carried(&self, acceleration: &[f64], period: f64) -> Vec<f64> {
        let mut state = [0.0; 3];
        let mut out = Vec::with_capacity(acceleration.len());
        for k in 0..acceleration.len() {
            out.push(-self.force(state));
            let mean = 0.5 * (acceleration[k] + acceleration[(k + 1).min(acceleration.len() - 1)]);
            state = runge_kutta_4(&state, period, |s| {
                [
                    s[1],
                    -mean - self.force(*s),
                    self.hysteretic_rate(s[1], s[2]),
                ]
            });
        }
        out
    }
}

/// Tests of one specimen: accelerations of base and mass.
struct Tests<'a> {
    base: Vec<&'a [f64]>,
    mass: Vec<&'a [f64]>,
    period: f64,
    noise: f64,
    yields: bool,
}

impl Tests<'_> {
    fn at(&self, p: &[f64]) -> SpecimenOverMass {
        SpecimenOverMass {
            damping: p[0],
            stiffness: p[1].exp(),
            yield_displacement: if self.yields {
                p[2].exp()
            } else {
                f64::INFINITY
            },
            post_ratio: p[3],
            exponent: p[4],
        }
    }
}

impl Residuals for Tests<'_> {
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        let specimen = self.at(values);
        let mut all = Vec::new();
        for (base, mass) in self.base.iter().zip(&self.mass) {
            let shown = specimen.carried(base, self.period);
            let offset = shown.iter().zip(*mass).map(|(a, b)| a - b).sum::<f64>()
                / shown.len().max(1) as f64;
            for (own, measured) in shown.iter().zip(*mass) {
                all.push((own - measured - offset) / self.noise);
            }
        }
        all.iter()
            .all(|v| v.is_finite() && v.abs() < 1e9)
            .then_some(all)
    }
}

/// Fits a specimen to the accelerations (m/s²) of `base` and `mass`, several tests sampled every
/// `period` s, from `damping` (1/s) and `stiffness` (1/s²); a yielding one where that halves the
/// error. `None` where no start can be simulated.
pub fn fit(
    base: &[&[f64]],
    mass: &[&[f64]],
    period: f64,
    damping: f64,
    stiffness: f64,
) -> Option<SpecimenFit> {
    let rms = |v: &[&[f64]]| {
        let count: usize = v.iter().map(|own| own.len()).sum();
        let square: f64 = v.iter().flat_map(|own| own.iter()).map(|a| a * a).sum();
        (square / count.max(1) as f64).sqrt()
    };
    let size = rms(mass);
    let floor = mass.iter().map(|own| noise_floor(own)).fold(0.0, f64::max);
    let mut tests = Tests {
        base: base.to_vec(),
        mass: mass.to_vec(),
        period,
        noise: floor.max(1e-3 * size).max(f64::MIN_POSITIVE),
        yields: false,
    };
    let coordinate = |start: f64, scale: f64, free, bounds| Coordinate {
        start,
        scale,
        free,
        bounds,
    };
    let everything = (f64::NEG_INFINITY, f64::INFINITY);
    let rate = stiffness.max(1.0).sqrt();
    let coordinates = |damping: f64, log_stiffness: f64, yields: Option<f64>| {
        let free = yields.is_some();
        vec![
            coordinate(damping.max(0.0), 0.01 * rate, true, (0.0, f64::INFINITY)),
            coordinate(log_stiffness, 0.05, true, everything),
            coordinate(yields.unwrap_or(1.0).ln(), 0.1, free, everything),
            coordinate(0.1, 0.05, free, (0.0, 1.0)),
            coordinate(2.0, 0.3, free, (1.0, 10.0)),
        ]
    };
    let mut best = minimise(&tests, &coordinates(damping, stiffness.max(1.0).ln(), None))?;
    let peak = size * 3.0 / stiffness.max(1.0);
    let elastic = best.clone();
    tests.yields = true;
    for part in [0.15, 0.5] {
        let start = coordinates(elastic.values[0], elastic.values[1], Some(part * peak));
        if let Some(found) = minimise(&tests, &start)
            && found.cost < best.cost.min(0.5 * elastic.cost)
        {
            best = found;
        }
    }
    tests.yields = best.cost < elastic.cost;
    let specimen = tests.at(&best.values);
    // The error is no white noise of the sensor's size: scale by what is left.
    let left = 2.0 * best.cost / best.residuals.max(1) as f64;
    let slope = [
        1.0,
        specimen.stiffness,
        specimen.yield_displacement.min(1e3),
        1.0,
        1.0,
    ];
    let covariance = DMatrix::from_fn(5, 5, |i, j| {
        best.covariance[(i, j)] * slope[i] * slope[j] * left
    });
    Some(SpecimenFit {
        specimen,
        covariance,
        misfit: left.sqrt() * tests.noise / size,
    })
}
