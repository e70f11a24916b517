//! Start values: each equation of the rig is linear in most of its parameters.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector};

use super::bands::{self, Band, Bands};
use super::equations::{ACCELERATION, COMMAND, DISPLACEMENT, FORCE, HydraulicRig, SIGN, SPECIMEN};
use recordings::IdentificationError;

/// Projection of `weight(s)` times a channel, SI, on the reference.
fn projected(
    band: &Band,
    bands: &Bands,
    channel: usize,
    weight: impl Fn(Complex<f64>) -> Complex<f64>,
) -> Complex<f64> {
    let spectrum = band.spectra.get(channel);
    let scale = bands.scale.get(channel).copied().unwrap_or(0.0);
    spectrum.map_or(Complex::new(0.0, 0.0), |spectrum| {
        let lines = band.instruments[0].iter().zip(spectrum).zip(&band.omega);
        lines
            .map(|((q, z), &omega)| q.conj() * weight(Complex::new(0.0, omega)) * z * scale)
            .sum()
    })
}

/// A complex linear regression with real unknowns.
struct Regression {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

impl Regression {
    fn new(unknowns: usize) -> Self {
        Self {
            normal: DMatrix::zeros(unknowns, unknowns),
            right: DVector::zeros(unknowns),
            square: 0.0,
        }
    }

    fn add(&mut self, row: &[Complex<f64>], target: Complex<f64>, weight: f64) {
        for i in 0..row.len() {
            for j in 0..row.len() {
                self.normal[(i, j)] += weight * (row[i].conj() * row[j]).re;
            }
            self.right[i] += weight * (row[i].conj() * target).re;
        }
        self.square += weight * target.norm_sqr();
    }

    /// The unknowns, and the sum of squares that is left.
    fn solve(&self) -> Option<(DVector<f64>, f64)> {
        let count = self.right.len();
        let scale: Vec<f64> = (0..count).map(|i| self.normal[(i, i)].sqrt()).collect();
        if scale.iter().any(|s| s.is_nan() || *s <= 0.0) {
            return None;
        }
        let mut normal = DMatrix::from_fn(count, count, |i, j| {
            self.normal[(i, j)] / (scale[i] * scale[j])
        });
        for i in 0..count {
            normal[(i, i)] += 1e-10;
        }
        let right = DVector::from_fn(count, |i, _| self.right[i] / scale[i]);
        let solution = normal.cholesky()?.solve(&right);
        let left = self.square - solution.dot(&right);
        Some((
            DVector::from_fn(count, |i, _| solution[i] / scale[i]),
            left.max(0.0),
        ))
    }
}

/// Mass, damping, stiffness, specimen mass and further payloads from the table's equation.
///
/// # Errors
/// Signals that do not determine them, or a negative mass.
pub fn table(
    experiments: &[Bands],
    specimen: bool,
) -> Result<(HydraulicRig, Vec<f64>), IdentificationError> {
    let payloads = experiments.len() - 1;
    let mut regression = Regression::new(3 + usize::from(specimen) + payloads);
    for (index, bands) in experiments.iter().enumerate() {
        for band in &bands.bands {
            let x = |power: i32| projected(band, bands, DISPLACEMENT, |s| s.powi(power));
            let force = projected(band, bands, FORCE, |_| Complex::new(1.0, 0.0));
            let one = |_| Complex::new(1.0, 0.0);
            let a = projected(band, bands, ACCELERATION, one);
            let mut row = vec![a, x(1), x(0)];
            if specimen {
                row.push(projected(band, bands, SPECIMEN, one));
            }
            for payload in 0..payloads {
                row.push(if payload + 1 == index {
                    a
                } else {
                    Complex::new(0.0, 0.0)
                });
            }
            regression.add(&row, force, 1.0 / force.norm_sqr().max(f64::MIN_POSITIVE));
        }
    }
    let Some((solution, _)) = regression.solve() else {
        return Err(IdentificationError::RankDeficient {
            what: "force, acceleration and displacement do not determine mass, damping and \
                   stiffness of the table: they move in proportion"
                .into(),
            remedy: "excite the table below and above its natural frequency".into(),
        });
    };
    let mass = solution[0];
    if mass.is_nan() || mass <= 0.0 {
        return Err(IdentificationError::Unstable {
            what: format!("the estimated mass of the table is {mass:.4} kg"),
            remedy: "check the signs of actuator_force (positive towards positive displacement) \
                     and acceleration"
                .into(),
        });
    }
    if !(1e-3..1e6).contains(&mass) {
        return Err(IdentificationError::Unstable {
            what: format!("the estimated mass of the table is {mass:.3e} kg"),
            remedy: "check the units of actuator_force and acceleration in the header".into(),
        });
    }
    let mut rig = empty();
    rig.mass = mass;
    rig.damping = solution[1].max(0.0);
    rig.stiffness = solution[2];
    if specimen {
        rig.specimen_mass = solution[3].max(1e-3 * mass);
    }
    let first = 3 + usize::from(specimen);
    let masses = (0..payloads).map(|i| solution[first + i].max(-0.9 * mass));
    Ok((rig, masses.collect()))
}

pub(super) fn empty() -> HydraulicRig {
    HydraulicRig {
        spool_lag: 0.0,
        spool_inertia: 0.0,
        force_rate: 1.0,
        oil_stiffness: 1.0,
        leakage_rate: 1.0,
        seal_damping: 0.0,
        seal_friction: 0.0,
        mass: 1.0,
        damping: 0.0,
        stiffness: 0.0,
        specimen_mass: 0.0,
        command_delay: 0.0,
        accelerometer_delay: 0.0,
        load_cell_delay: 0.0,
        accelerometer_scale: 1.0,
    }
}

/// Damping and stiffness of the specimen over its mass (1/s, 1/s²): its acceleration is
/// `c' (s x - a_s/s) + k' (x - a_s/s²)`. `None` where the data do not determine them.
pub fn specimen(experiments: &[Bands]) -> Option<[f64; 2]> {
    let mut regression = Regression::new(2);
    for bands in experiments {
        for band in &bands.bands {
            let at = |channel, power: i32| projected(band, bands, channel, |s| s.powi(power));
            let target = at(SPECIMEN, 0);
            let row = [
                at(DISPLACEMENT, 1) - at(SPECIMEN, -1),
                at(DISPLACEMENT, 0) - at(SPECIMEN, -2),
            ];
            // Errors are about those of the acceleration, not relative ones.
            regression.add(&row, target, 1.0);
        }
    }
    let (solution, _) = regression.solve()?;
    Some([solution[0].max(0.0), solution[1]])
}

/// Ratio of acceleration to `s² x` over the bands, robustly: the median of its real part.
pub fn motion_ratio(experiments: &[Bands]) -> f64 {
    let mut ratios: Vec<f64> = experiments
        .iter()
        .flat_map(|bands| bands.bands.iter().map(move |band| (bands, band)))
        .map(|(bands, band)| {
            let a = projected(band, bands, ACCELERATION, |_| Complex::new(1.0, 0.0));
            let x = projected(band, bands, DISPLACEMENT, |s| s * s);
            (a / x).re
        })
        .filter(|ratio| ratio.is_finite())
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Leakages of the grid, 1/s.
const LEAKAGES: [f64; 4] = [0.1, 1.0, 5.0, 25.0];

/// The rig with each spool and delay of the grid.
fn spools(rig: &HydraulicRig) -> Vec<HydraulicRig> {
    let mut all = Vec::new();
    for frequency in [15.0, 30.0, 60.0, 120.0] {
        for damping in [0.3, 0.8] {
            for delay in [0.0, 0.002, 0.005, 0.01] {
                all.push(HydraulicRig {
                    spool_lag: 2.0 * damping / (TAU * frequency),
                    spool_inertia: f64::powi(TAU * frequency, -2),
                    command_delay: delay,
                    ..*rig
                });
            }
        }
    }
    all
}

/// The rig of a regression, if its oil pushes.
fn solved(spool: &HydraulicRig, leakage: f64, solution: &DVector<f64>) -> Option<HydraulicRig> {
    (solution[0] > 0.0 && solution[1] > 0.0).then(|| HydraulicRig {
        leakage_rate: leakage,
        force_rate: solution[0],
        oil_stiffness: solution[1],
        seal_damping: solution[2].max(0.0),
        seal_friction: solution[3].max(0.0),
        ..*spool
    })
}

/// The actuator of the grid that explains the force best behind a valve; `opened` gives the histories of its opening
/// (V) of each experiment for a spool.
pub fn behind(
    experiments: &[Bands],
    rig: &HydraulicRig,
    opened: impl Fn(&HydraulicRig) -> Option<Vec<Vec<f64>>>,
) -> Option<HydraulicRig> {
    let mut best: Option<(f64, HydraulicRig)> = None;
    for spool in spools(rig) {
        let spectra: Vec<_> = opened(&spool)?
            .iter()
            .map(|history| bands::spectrum(history).ok())
            .collect::<Option<_>>()?;
        let opening = |index: usize, band: &Band| {
            let lines = band.lines.clone();
            let own = band.instruments[0].iter().zip(&spectra[index][lines]);
            own.map(|(q, z)| q.conj() * z).sum()
        };
        // What a valve with overlap shuts off does not leak as the largest of them would have it.
        for leakage in &LEAKAGES[..3] {
            let Some((solution, left)) = actuator(experiments, *leakage, opening) else {
                continue;
            };
            if let Some(own) = solved(&spool, *leakage, &solution)
                && best.as_ref().is_none_or(|before| left < before.0)
            {
                best = Some((left, own));
            }
        }
    }
    best.map(|own| own.1)
}

/// The actuator's start values for spools and leakages on a grid, the best of each delay, best first;
/// `rig` gives the table. A spool's lag and a delay are alike at low frequencies: the best few of the
/// whole grid may all have taken the one for the other.
///
/// # Errors
/// No point of the grid on which a positive command pushes the table towards positive displacement.
pub fn actuators(
    experiments: &[Bands],
    rig: &HydraulicRig,
) -> Result<Vec<HydraulicRig>, IdentificationError> {
    let mut found: Vec<(f64, HydraulicRig)> = Vec::new();
    let (mut backwards, mut tried) = (0, 0);
    let period = experiments.first().map_or(1e-3, |e| e.period);
    for spool in spools(rig) {
        for leakage in LEAKAGES {
            tried += 1;
            let opening = |index: usize, band: &Band| {
                projected(band, &experiments[index], COMMAND, |s| {
                    spool.spool(s, period)
                })
            };
            let Some((solution, left)) = actuator(experiments, leakage, opening) else {
                continue;
            };
            backwards += u32::from(solution[0] < 0.0);
            found.extend(solved(&spool, leakage, &solution).map(|own| (left, own)));
        }
    }
    if found.is_empty() {
        let what = if 2 * backwards > tried {
            "a positive valve_command moves the table towards negative displacement"
        } else {
            "no actuator with oil between valve and piston reproduces the force"
        };
        return Err(IdentificationError::Unstable {
            what: what.into(),
            remedy: "check the signs of valve_command, actuator_force and displacement, and that \
                     no channels are swapped"
                .into(),
        });
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Vec<HydraulicRig> = Vec::new();
    for (_, own) in found {
        if best
            .iter()
            .all(|before| before.command_delay != own.command_delay)
        {
            best.push(own);
        }
    }
    Ok(best)
}

/// Unknowns `[g, K, c_p, F_c]` of `F (s + p) = g o - K s x - c_p (s + p) s x - F_c (s + p) S` with `p` given, and what
/// is left; `opening` is `o` in a band of an experiment.
fn actuator(
    experiments: &[Bands],
    leakage: f64,
    opening: impl Fn(usize, &Band) -> Complex<f64>,
) -> Option<(DVector<f64>, f64)> {
    let friction = experiments
        .iter()
        .all(|bands| bands.scale.get(SIGN).is_some_and(|scale| *scale > 1e-6));
    let mut regression = Regression::new(3 + usize::from(friction));
    let leak = |s: Complex<f64>| s + leakage;
    for (index, bands) in experiments.iter().enumerate() {
        for band in &bands.bands {
            let force = projected(band, bands, FORCE, leak);
            let mut row = vec![
                opening(index, band),
                -projected(band, bands, DISPLACEMENT, |s| s),
                -projected(band, bands, DISPLACEMENT, |s| s * leak(s)),
            ];
            if friction {
                row.push(-projected(band, bands, SIGN, leak));
            }
            regression.add(&row, force, 1.0 / force.norm_sqr().max(f64::MIN_POSITIVE));
        }
    }
    let (mut solution, left) = regression.solve()?;
    if !friction {
        solution = solution.insert_row(3, 0.0);
    }
    Some((solution, left))
}
