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

#[cfg(test)]
mod tests {
    use super::super::made::noise;
    use super::*;

    const PERIOD: f64 = 0.004;
    /// 5 % of critical damping at 2 Hz.
    const DAMPING: f64 = 1.2566;
    const STIFFNESS: f64 = 157.91;

    #[test]
    fn an_elastic_specimen_on_a_base_that_starts_at_once_swings_about_its_new_place() {
        let own = SpecimenOverMass::elastic(DAMPING, STIFFNESS);
        let size = 3.0;
        let shown = own.carried(&[size; 500], PERIOD);
        let (decay, omega) = (0.5 * DAMPING, (STIFFNESS - 0.25 * DAMPING * DAMPING).sqrt());
        for (k, value) in shown.iter().enumerate() {
            let t = k as f64 * PERIOD;
            let (s, c) = (omega * t).sin_cos();
            let fade = (-decay * t).exp();
            let expected = size * (1.0 - fade * (c - decay / omega * s));
            assert!(
                (value - expected).abs() < 1e-6 * size,
                "{t} s: {value} {expected}"
            );
        }
        // Half a period later it is nearly twice as far.
        let peak = shown.iter().copied().fold(0.0, f64::max);
        assert!((1.8..2.0).contains(&(peak / size)), "{peak}");
    }

    #[test]
    fn a_yielding_specimen_bears_little_more_than_its_yield_force() {
        let yielding = SpecimenOverMass {
            yield_displacement: 0.01,
            post_ratio: 0.1,
            exponent: 2.0,
            ..SpecimenOverMass::elastic(0.0, STIFFNESS)
        };
        let elastic = SpecimenOverMass::elastic(0.0, STIFFNESS);
        // Small drifts are elastic; on large ones only the hardening grows.
        assert_eq!(
            yielding.force([1e-3, 0.0, 1e-3]),
            elastic.force([1e-3, 0.0, 1e-3])
        );
        let beyond = yielding.force([0.05, 0.0, 0.01]);
        assert!((beyond / (STIFFNESS * (0.1 * 0.05 + 0.9 * 0.01)) - 1.0).abs() < 1e-12);
        assert_eq!(yielding.hysteretic_rate(0.3, 0.01), 0.0);
        assert!((yielding.hysteretic_rate(0.3, 0.005) / 0.225 - 1.0).abs() < 1e-12);
        // Unloading is elastic again.
        assert_eq!(yielding.hysteretic_rate(-0.3, 0.005), -0.3);
    }

    /// Accelerations of a base under random motion and of the mass on it, in a hundred steps a sample.
    fn test(own: &SpecimenOverMass, size: f64, seed: u32) -> [Vec<f64>; 2] {
        const STEPS: usize = 100;
        let (mut slow, mut base) = (0.0, Vec::new());
        for value in noise(3000, seed) {
            slow += 0.1 * (value - slow);
            base.push(size * slow);
        }
        let (mut d, mut v, mut z) = (0.0_f64, 0.0_f64, 0.0_f64);
        let step = PERIOD / STEPS as f64;
        let mut mass = Vec::new();
        let force = |d: f64, v: f64, z: f64| {
            let inner = own.post_ratio * d + (1.0 - own.post_ratio) * z;
            own.damping * v + own.stiffness * inner
        };
        for k in 0..base.len() {
            mass.push(-force(d, v, z));
            let next = base[(k + 1).min(base.len() - 1)];
            for i in 0..STEPS {
                let part = (i as f64 + 0.5) / STEPS as f64;
                v -= step * (base[k] + part * (next - base[k]) + force(d, v, z));
                d += step * v;
                let loads = if z * v > 0.0 { 1.0 } else { 0.0 };
                z += step
                    * v
                    * (1.0 - loads * (z.abs() / own.yield_displacement).powf(own.exponent));
            }
        }
        for (value, noise) in mass.iter_mut().zip(noise(3000, seed + 1)) {
            *value += 0.02 * noise + 0.05;
        }
        [base, mass]
    }

    fn fitted(own: &SpecimenOverMass, size: f64) -> SpecimenFit {
        let all = [1, 77].map(|seed| test(own, size, seed));
        let [base, mass] = [0, 1].map(|n| all.each_ref().map(|own| &own[n][..]));
        fit(&base, &mass, PERIOD, 2.0 * DAMPING, 0.8 * STIFFNESS).unwrap()
    }

    /// The sensor's zero, 0.05 m/s², is not the specimen's.
    #[test]
    fn an_elastic_specimen_is_found_with_errors_that_hold() {
        let truth = SpecimenOverMass {
            yield_displacement: 1e9,
            ..SpecimenOverMass::elastic(DAMPING, STIFFNESS)
        };
        let found = fitted(&truth, 4.0);
        let own = found.specimen;
        assert!(own.yield_displacement.is_infinite(), "{own:?}");
        let error = |n: usize| found.covariance[(n, n)].sqrt();
        for (value, truth, error) in [
            (own.damping, DAMPING, error(0)),
            (own.stiffness, STIFFNESS, error(1)),
        ] {
            assert!(error > 0.0 && error < 0.02 * truth, "{value} ± {error}");
            assert!(
                (value - truth).abs() < 4.0 * error + 1e-3 * truth,
                "{value} ± {error}"
            );
        }
        // The rest is the sensor's noise: 0.02 times even values from -1 to 1, of the power 1/3.
        let mass: Vec<f64> = [1, 77]
            .iter()
            .flat_map(|seed| test(&truth, 4.0, *seed)[1].clone())
            .collect();
        let power = mass.iter().map(|a| a * a).sum::<f64>() / mass.len() as f64;
        let expected = 0.02 / (3.0 * power).sqrt();
        assert!(
            (found.misfit / expected - 1.0).abs() < 0.05,
            "{} {expected}",
            found.misfit
        );
    }

    #[test]
    fn a_yielding_specimen_is_found_where_it_yields() {
        let truth = SpecimenOverMass {
            yield_displacement: 5e-3,
            post_ratio: 0.2,
            exponent: 2.0,
            ..SpecimenOverMass::elastic(DAMPING, STIFFNESS)
        };
        let own = fitted(&truth, 12.0).specimen;
        println!("{own:?}");
        for (found, truth) in [
            (own.stiffness, truth.stiffness),
            (own.yield_displacement, truth.yield_displacement),
            (own.post_ratio, truth.post_ratio),
        ] {
            assert!((found / truth - 1.0).abs() < 0.1, "{own:?}");
        }
    }
}
