//! The equations between the channels of a hydraulic rig, whatever its controller and specimen do.
//!
//! With the displacement as the truth, `F̂ = F exp(s τ_F)` and so on, and `S` the friction over its
//! Coulomb force ([`super::friction`]):
//!
//! - motion: `â/γ = s² x`;
//! - table (Eq 2-5 with the specimen's inertia): `F̂ = (m s² + c s + k) x + m_s â_s`;
//! - actuator (Eq 2-4 with the structure of valve and oil):
//!   `F̂ = g/(s + p) (W(s) H(s) exp(-s T) u + d) - (K/(s + p) + c_p) s x - F_c S`,
//!   `W = 1/(s²/w² + 2 D s/w + 1)`, `H` the hold, `d` what the valve's opening differs from its spool by
//!   ([`super::valve`]).
//!
//! Each is linear in the channels, so each holds between the projections on the reference too, and
//! for the stochastic distortions that friction and a yielding specimen cause.

use std::sync::Arc;

use nalgebra::{Complex, DMatrix};

use super::bands::{Band, Bands};
use super::friction::{SHAPE, SealShape, Searched};
use sysid::nonlinear::Residuals;

/// Channels of an experiment, in the order of [`Bands::new`].
pub const CHANNELS: usize = 7 + SHAPE;
/// Valve command.
pub const COMMAND: usize = 0;
/// Displacement.
pub const DISPLACEMENT: usize = 1;
/// Acceleration.
pub const ACCELERATION: usize = 2;
/// Actuator force.
pub const FORCE: usize = 3;
/// Friction over its Coulomb force, by the velocity and the present shape.
pub const SIGN: usize = 4;
/// Specimen acceleration, zero without one.
pub const SPECIMEN: usize = 5;
/// The first of the derivatives of the friction by its shape.
pub const SLOPES: usize = 6;
/// What the valve's opening differs from its spool's position by, V.
pub const OPENING: usize = SLOPES + SHAPE;

/// Parameters of the equations, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HydraulicRig {
    /// `2 D/w`, lag of the spool, s.
    pub spool_lag: f64,
    /// `1/w²`, its inertia, s².
    pub spool_inertia: f64,
    /// `g`, rate of the force under a valve open by one volt, N/(V s).
    pub force_rate: f64,
    /// `K`, stiffness of the oil column, N/m.
    pub oil_stiffness: f64,
    /// `p`, rate at which leakage empties it, 1/s.
    pub leakage_rate: f64,
    /// `c_p`, damping of the piston's seals, N s/m.
    pub seal_damping: f64,
    /// `F_c`, their dry friction, N.
    pub seal_friction: f64,
    /// `m`, kg.
    pub mass: f64,
    /// `c`, N s/m.
    pub damping: f64,
    /// `k`, N/m.
    pub stiffness: f64,
    /// `m_s`, kg.
    pub specimen_mass: f64,
    /// `T`, delay from the command to the force, including that of the displacement sensor, s.
    pub command_delay: f64,
    /// `τ_a`, delay of the accelerometers relative to the displacement, s.
    pub accelerometer_delay: f64,
    /// `τ_F`, the load cell's, s.
    pub load_cell_delay: f64,
    /// `γ`, what the accelerometer shows over `s² x`.
    pub accelerometer_scale: f64,
}

/// Number of [`HydraulicRig`]'s parameters.
pub const PARAMETERS: usize = 15;

/// Names of the parameters, in order.
pub const NAMES: [&str; PARAMETERS] = [
    "spool lag",
    "spool inertia",
    "force rate",
    "oil stiffness",
    "leakage rate",
    "seal damping",
    "seal friction",
    "table mass",
    "table damping",
    "table stiffness",
    "specimen mass",
    "command delay",
    "accelerometer delay",
    "load cell delay",
    "accelerometer scale",
];

impl From<[f64; PARAMETERS]> for HydraulicRig {
    fn from(p: [f64; PARAMETERS]) -> Self {
        Self {
            spool_lag: p[0],
            spool_inertia: p[1],
            force_rate: p[2],
            oil_stiffness: p[3],
            leakage_rate: p[4],
            seal_damping: p[5],
            seal_friction: p[6],
            mass: p[7],
            damping: p[8],
            stiffness: p[9],
            specimen_mass: p[10],
            command_delay: p[11],
            accelerometer_delay: p[12],
            load_cell_delay: p[13],
            accelerometer_scale: p[14],
        }
    }
}

impl From<HydraulicRig> for [f64; PARAMETERS] {
    fn from(r: HydraulicRig) -> Self {
        [
            r.spool_lag,
            r.spool_inertia,
            r.force_rate,
            r.oil_stiffness,
            r.leakage_rate,
            r.seal_damping,
            r.seal_friction,
            r.mass,
            r.damping,
            r.stiffness,
            r.specimen_mass,
            r.command_delay,
            r.accelerometer_delay,
            r.load_cell_delay,
            r.accelerometer_scale,
        ]
    }
}

/// Parameters that are fitted by their logarithms.
const POSITIVE: [usize; 4] = [2, 3, 4, 7];

impl HydraulicRig {
    /// The rig at coordinates of the fit: logarithms of what is positive.
    pub fn at(coordinates: &[f64]) -> Option<Self> {
        let mut own: [f64; PARAMETERS] = coordinates.get(..PARAMETERS)?.try_into().ok()?;
        for i in POSITIVE {
            own[i] = own[i].exp();
        }
        Some(own.into())
    }

    /// Its coordinates.
    pub fn coordinates(&self) -> [f64; PARAMETERS] {
        let mut own: [f64; PARAMETERS] = (*self).into();
        for i in POSITIVE {
            own[i] = own[i].ln();
        }
        own
    }

    /// Derivative of each parameter by its coordinate.
    pub fn slopes(&self) -> [f64; PARAMETERS] {
        let own: [f64; PARAMETERS] = (*self).into();
        std::array::from_fn(|i| if POSITIVE.contains(&i) { own[i] } else { 1.0 })
    }

    /// Whether the numbers are a rig.
    pub fn is_sound(&self) -> bool {
        let positive = [
            self.force_rate,
            self.oil_stiffness,
            self.leakage_rate,
            self.mass,
            self.accelerometer_scale,
        ];
        positive.iter().all(|v| v.is_finite() && *v > 0.0)
    }

    /// Response of the spool to the sampled command that is held over `period` s, delay included.
    pub fn spool(&self, s: Complex<f64>, period: f64) -> Complex<f64> {
        let hold = (1.0 - (-s * period).exp()) / (s * period);
        let lag = (s * self.spool_inertia + self.spool_lag) * s + 1.0;
        hold / lag * (-s * self.command_delay).exp()
    }

    /// Force that the actuator gives way by per displacement, N/m.
    pub fn compliance_path(&self, s: Complex<f64>) -> Complex<f64> {
        s * (self.oil_stiffness / (s + self.leakage_rate) + self.seal_damping)
    }

    /// Force that table and a payload (kg) need per displacement, N/m.
    pub fn table(&self, s: Complex<f64>, payload: f64) -> Complex<f64> {
        ((self.mass + payload) * s + self.damping) * s + self.stiffness
    }
}

/// Number of `coefficients`' rows.
pub const EQUATIONS: usize = 3;

/// Coefficients of the three equations at `s`, `[equation][channel]`.
fn coefficients(
    rig: &HydraulicRig,
    shape: &[f64],
    payload: f64,
    s: Complex<f64>,
    period: f64,
) -> [[Complex<f64>; CHANNELS]; EQUATIONS] {
    let zero = Complex::new(0.0, 0.0);
    let one = Complex::new(1.0, 0.0);
    let early = |delay: f64| (s * delay).exp();
    let acceleration = early(rig.accelerometer_delay) / rig.accelerometer_scale;
    let force = early(rig.load_cell_delay);
    let oil = rig.force_rate / (s + rig.leakage_rate);
    let drive = oil * rig.spool(s, period);
    let mut rows = [[zero; CHANNELS]; EQUATIONS];
    rows[0][DISPLACEMENT] = -s * s;
    rows[0][ACCELERATION] = acceleration;
    rows[1][DISPLACEMENT] = -rig.table(s, payload);
    rows[1][FORCE] = force;
    rows[1][SPECIMEN] = -acceleration * rig.specimen_mass;
    rows[2][COMMAND] = -drive;
    rows[2][OPENING] = -oil;
    rows[2][DISPLACEMENT] = rig.compliance_path(s);
    rows[2][FORCE] = force;
    rows[2][SIGN] = one * rig.seal_friction;
    for (slot, change) in rows[2][SLOPES..OPENING].iter_mut().zip(shape) {
        *slot = one * rig.seal_friction * change;
    }
    rows
}

/// The experiments of one rig, to be fitted.
#[derive(Debug, Clone)]
pub struct Equations {
    /// Their bands.
    pub experiments: Vec<Bands>,
    /// The residuals' covariance, band by band, where it is held; by default it goes with the rig, as
    /// maximum likelihood with errors in all channels has it.
    held: Option<Arc<[Whitener]>>,
    /// The friction's shape from which changes are counted, where there is friction.
    pub shape: Option<SealShape>,
}

impl Equations {
    /// Residuals of unit variance of each equation of each band, real and imaginary; `values` are
    /// the rig's coordinates, the changes of the friction's shape and then each further
    /// experiment's payload (kg).
    fn whitened(&self, values: &[f64]) -> Option<Vec<[Complex<f64>; EQUATIONS]>> {
        let rig = HydraulicRig::at(values)?;
        if !rig.is_sound() {
            return None;
        }
        let own;
        let mut whiteners = match &self.held {
            Some(held) => held.iter(),
            None => {
                own = self.whiteners(values)?;
                own.iter()
            }
        };
        let shape = values.get(PARAMETERS..PARAMETERS + SHAPE)?;
        let mut all = Vec::new();
        for (index, experiment) in self.experiments.iter().enumerate() {
            let payload = payload(values, index)?;
            for band in &experiment.bands {
                let whitener = whiteners.next()?;
                for sums in sums(&rig, shape, payload, experiment, band) {
                    all.push(whitener.apply(sums)?);
                }
            }
        }
        Some(all)
    }

    /// What whitens the residuals of each band of a rig.
    fn whiteners(&self, values: &[f64]) -> Option<Vec<Whitener>> {
        let rig = HydraulicRig::at(values)?;
        let shape = values.get(PARAMETERS..PARAMETERS + SHAPE)?;
        let mut all = Vec::new();
        for (index, experiment) in self.experiments.iter().enumerate() {
            let payload = payload(values, index)?;
            for band in &experiment.bands {
                let rows = rows(&rig, shape, payload, experiment, band);
                all.push(Whitener::new(&rows, &band.noise)?);
            }
        }
        Some(all)
    }

    /// Equations of `experiments` about a friction's `shape`.
    pub fn new(experiments: Vec<Bands>, shape: Option<SealShape>) -> Self {
        Self {
            experiments,
            held: None,
            shape,
        }
    }

    /// The same with the covariance of the residuals held where it is at `values`.
    pub fn holding(&self, values: &[f64]) -> Option<Self> {
        Some(Self {
            held: Some(self.whiteners(values)?.into()),
            ..self.clone()
        })
    }

    /// What is left of each equation over its largest term, root mean squares over the bands'
    /// projections on the reference.
    pub fn relative_errors(&self, values: &[f64]) -> Option<[f64; EQUATIONS]> {
        const LARGEST: [usize; EQUATIONS] = [ACCELERATION, FORCE, COMMAND];
        let rig = HydraulicRig::at(values)?;
        let shape = values.get(PARAMETERS..PARAMETERS + SHAPE)?;
        let (mut left, mut size) = ([0.0; EQUATIONS], [0.0; EQUATIONS]);
        for (index, experiment) in self.experiments.iter().enumerate() {
            let payload = payload(values, index)?;
            for band in &experiment.bands {
                let rows = rows(&rig, shape, payload, experiment, band);
                let sums = sums(&rig, shape, payload, experiment, band);
                for equation in 0..EQUATIONS {
                    let channel = LARGEST[equation];
                    let term = rows[(equation, channel)] * band.projected(channel);
                    size[equation] += term.norm_sqr();
                    left[equation] += sums.first()?[equation].norm_sqr();
                }
            }
        }
        Some(std::array::from_fn(|i| (left[i] / size[i]).sqrt()))
    }

    /// Mean square of each equation's whitened residuals, near one for a rig that obeys it. The
    /// equations are whitened one after the other: the motion's first.
    pub fn mean_squares(&self, values: &[f64]) -> Option<[f64; EQUATIONS]> {
        let all = self.whitened(values)?;
        let mut sums = [0.0; EQUATIONS];
        for band in &all {
            for (sum, value) in sums.iter_mut().zip(band) {
                *sum += value.norm_sqr();
            }
        }
        Some(sums.map(|sum| sum / (2 * all.len().max(1)) as f64))
    }
}

/// The payload of an experiment over the first's, kg.
fn payload(values: &[f64], index: usize) -> Option<f64> {
    match index {
        0 => Some(0.0),
        _ => values.get(PARAMETERS + SHAPE + index - 1).copied(),
    }
}

/// The equations of a band, projected on each of its instruments.
fn sums(
    rig: &HydraulicRig,
    shape: &[f64],
    payload: f64,
    experiment: &Bands,
    band: &Band,
) -> Vec<[Complex<f64>; EQUATIONS]> {
    let mut sums = vec![[Complex::new(0.0, 0.0); EQUATIONS]; band.instruments.len()];
    for (line, &omega) in band.omega.iter().enumerate() {
        let s = Complex::new(0.0, omega);
        let rows = coefficients(rig, shape, payload, s, experiment.period);
        for (equation, row) in rows.iter().enumerate() {
            // Most of the channels are not in an equation.
            let channels = band.spectra.iter().zip(row).zip(&experiment.scale);
            let value: Complex<f64> = channels
                .filter(|((_, c), _)| **c != Complex::ZERO)
                .map(|((z, c), scale)| c * *scale * z[line])
                .sum();
            for (sum, instrument) in sums.iter_mut().zip(&band.instruments) {
                sum[equation] += instrument[line].conj() * value;
            }
        }
    }
    sums
}

/// Coefficients of the scaled channels in the middle of a band.
fn rows(
    rig: &HydraulicRig,
    shape: &[f64],
    payload: f64,
    experiment: &Bands,
    band: &Band,
) -> DMatrix<Complex<f64>> {
    let s = Complex::new(0.0, band.middle());
    let rows = coefficients(rig, shape, payload, s, experiment.period);
    DMatrix::from_fn(EQUATIONS, band.spectra.len(), |i, j| {
        rows[i][j] * experiment.scale[j]
    })
}

/// Whitens complex residuals to unit variance of each real part.
#[derive(Debug)]
struct Whitener {
    size: [f64; EQUATIONS],
    factor: nalgebra::Cholesky<Complex<f64>, nalgebra::Const<EQUATIONS>>,
}

impl Whitener {
    /// For residuals `rows` of channels with a covariance of `noise`.
    fn new(rows: &DMatrix<Complex<f64>>, noise: &DMatrix<Complex<f64>>) -> Option<Self> {
        let part = |i: usize, j: usize| -> Complex<f64> {
            let present =
                |i: usize| (0..rows.ncols()).filter(move |k| rows[(i, *k)] != Complex::ZERO);
            let along = |a: usize| {
                let over = present(j).map(|b| noise[(a, b)] * rows[(j, b)].conj());
                rows[(i, a)] * over.sum::<Complex<f64>>()
            };
            present(i).map(along).sum()
        };
        let mut covariance = nalgebra::SMatrix::<Complex<f64>, EQUATIONS, EQUATIONS>::from_fn(part);
        // Equations are of different units: scale before factoring.
        let size: [f64; EQUATIONS] = std::array::from_fn(|i| covariance[(i, i)].re.sqrt());
        if size.iter().any(|own| own.is_nan() || *own <= 0.0) {
            return None;
        }
        for i in 0..EQUATIONS {
            for j in 0..EQUATIONS {
                covariance[(i, j)] /= size[i] * size[j];
            }
            covariance[(i, i)] += Complex::new(1e-9, 0.0);
        }
        Some(Self {
            size,
            factor: covariance.cholesky()?,
        })
    }

    fn apply(&self, residuals: [Complex<f64>; EQUATIONS]) -> Option<[Complex<f64>; EQUATIONS]> {
        let mut own = nalgebra::SVector::<Complex<f64>, EQUATIONS>::from_fn(|i, _| {
            residuals[i] / self.size[i]
        });
        if !self.factor.l_dirty().solve_lower_triangular_mut(&mut own) {
            return None;
        }
        Some(std::array::from_fn(|i| own[i] * std::f64::consts::SQRT_2))
    }
}

impl Residuals for Equations {
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        let all = self.whitened(values)?;
        Some(all.iter().flatten().flat_map(|v| [v.re, v.im]).collect())
    }

    fn priors(&self, values: &[f64]) -> Vec<f64> {
        let own = |shape: &SealShape| shape.changed(&values[PARAMETERS..PARAMETERS + SHAPE]);
        let own = self.shape.as_ref().map(own);
        own.map_or_else(Vec::new, |shape| shape.surprise().to_vec())
    }

    fn ignores_bounds(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: HydraulicRig = HydraulicRig {
        spool_lag: 5e-3,
        spool_inertia: 7e-6,
        force_rate: 2e4,
        oil_stiffness: 2e5,
        leakage_rate: 4.0,
        seal_damping: 900.0,
        seal_friction: 13.0,
        mass: 20.0,
        damping: 40.0,
        stiffness: 4000.0,
        specimen_mass: 6.0,
        command_delay: 3e-3,
        accelerometer_delay: 1e-3,
        load_cell_delay: 5e-4,
        accelerometer_scale: 1.02,
    };

    fn close(found: Complex<f64>, expected: Complex<f64>) {
        let off = (found - expected).norm();
        assert!(off < 1e-9 * expected.norm(), "{found} {expected}");
    }

    #[test]
    fn responses_are_those_of_valve_oil_and_table() {
        let (omega, period) = (5.0, 0.02);
        let s = Complex::new(0.0, omega);
        // 23 kg.
        close(
            RIG.table(s, 3.0),
            Complex::new(4000.0 - 23.0 * 25.0, 40.0 * omega),
        );
        // K / (4 + 5 i) = K (4 - 5 i) / 41.
        let (real, imaginary) = (2e5 * 4.0 / 41.0 + 900.0, -2e5 * 5.0 / 41.0);
        close(
            RIG.compliance_path(s),
            Complex::new(-omega * imaginary, omega * real),
        );
        // A hold is late by half of a sample and lets sin(x) / x through.
        let half = 0.5 * omega * period;
        let hold = Complex::from_polar(half.sin() / half, -half - omega * 3e-3);
        close(
            RIG.spool(s, period),
            hold / Complex::new(1.0 - 7e-6 * 25.0, 5e-3 * omega),
        );
    }

    /// The channels of a motion, as sensors show them.
    #[test]
    fn the_channels_of_a_motion_satisfy_all_equations() {
        let (s, period, payload) = (Complex::new(0.0, 30.0), 2e-3, 3.0);
        let x = Complex::new(1e-3, 2e-4);
        let specimen = Complex::new(-0.7, 0.4);
        let force = x * (23.0 * s * s + 40.0 * s + 4000.0) + specimen * 6.0;
        let opening = Complex::new(0.02, -0.01);
        // The friction is off by what its shape changes.
        let shape = [0.1, -0.2, 0.3, 0.05, -0.4];
        let slopes: [Complex<f64>; SHAPE] =
            std::array::from_fn(|i| Complex::new(0.3 * i as f64, 0.1));
        let sign = Complex::new(0.8, 0.5);
        let changes = slopes.iter().zip(&shape).map(|(slope, by)| slope * *by);
        let friction = 13.0 * (sign + changes.sum::<Complex<f64>>());
        let oil = 2e4 / (s + 4.0);
        let pushed = force + x * s * (2e5 / (s + 4.0) + 900.0) + friction;
        let mut channels = [Complex::ZERO; CHANNELS];
        channels[COMMAND] = (pushed / oil - opening) / RIG.spool(s, period);
        channels[DISPLACEMENT] = x;
        channels[ACCELERATION] = 1.02 * s * s * x * (-s * 1e-3).exp();
        channels[SPECIMEN] = 1.02 * specimen * (-s * 1e-3).exp();
        channels[FORCE] = force * (-s * 5e-4).exp();
        channels[SIGN] = sign;
        channels[SLOPES..OPENING].copy_from_slice(&slopes);
        channels[OPENING] = opening;
        let rows = coefficients(&RIG, &shape, payload, s, period);
        let largest = [s * s * x, force, force];
        for (row, largest) in rows.iter().zip(largest) {
            let sum: Complex<f64> = row.iter().zip(&channels).map(|(c, z)| c * z).sum();
            assert!(sum.norm() < 1e-9 * largest.norm(), "{sum} of {largest}");
        }
        close(rows[0][ACCELERATION] * channels[ACCELERATION], s * s * x);
        close(rows[1][FORCE] * channels[FORCE], force);
        close(rows[2][FORCE] * channels[FORCE], force);
    }

    #[test]
    fn coordinates_are_logarithms_of_what_is_positive() {
        let here = RIG.coordinates();
        let names: Vec<&str> = (0..PARAMETERS)
            .filter(|i| here[*i] != <[f64; PARAMETERS]>::from(RIG)[*i])
            .map(|i| NAMES[i])
            .collect();
        assert_eq!(
            names,
            ["force rate", "oil stiffness", "leakage rate", "table mass"]
        );
        let values = |at: &[f64]| <[f64; PARAMETERS]>::from(HydraulicRig::at(at).unwrap());
        let (back, slopes) = (values(&here), RIG.slopes());
        for i in 0..PARAMETERS {
            assert!((back[i] / <[f64; PARAMETERS]>::from(RIG)[i] - 1.0).abs() < 1e-12);
            let beside = |by: f64| {
                let mut moved = here;
                moved[i] += by;
                values(&moved)[i]
            };
            let slope = (beside(1e-4) - beside(-1e-4)) / 2e-4;
            assert!((slope / slopes[i] - 1.0).abs() < 1e-6, "{}", NAMES[i]);
        }
        assert!(RIG.is_sound() && HydraulicRig::at(&here[1..]).is_none());
        for i in [2, 3, 4, 7, 14] {
            for broken in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let mut values = <[f64; PARAMETERS]>::from(RIG);
                values[i] = broken;
                assert!(!HydraulicRig::from(values).is_sound(), "{}", NAMES[i]);
            }
        }
    }

    #[test]
    fn the_first_experiment_has_no_payload_and_each_other_its_own() {
        let mut values = vec![0.0; PARAMETERS + SHAPE];
        values.extend([5.0, 7.0]);
        let all = [0, 1, 2, 3].map(|index| payload(&values, index));
        assert_eq!(all, [Some(0.0), Some(5.0), Some(7.0), None]);
    }

    /// Two equations that share a channel: the second less the first is its own.
    #[test]
    fn residuals_are_whitened_one_after_the_other() {
        let real = |values: [f64; 9]| {
            DMatrix::from_row_slice(3, 3, &values.map(|value| Complex::new(value, 0.0)))
        };
        let rows = real([2.0, 0.0, 0.0, 2.0, 3.0, 0.0, 0.0, 0.0, 4.0]);
        let noise = real([0.25, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0]);
        let whitener = Whitener::new(&rows, &noise).unwrap();
        let own = [(1.0, 0.5), (4.0, -2.5), (16.0, 8.0)];
        let found = whitener.apply(own.map(|(re, im)| Complex::new(re, im)));
        // Deviations of 1, 3 and 8, of which each part has the root of a half.
        for (found, (re, im)) in found
            .unwrap()
            .iter()
            .zip([(1.0, 0.5), (1.0, -1.0), (2.0, 1.0)])
        {
            let expected = Complex::new(re, im) * std::f64::consts::SQRT_2;
            assert!((found - expected).norm() < 1e-6, "{found} {expected}");
        }
        let silent = real([0.0; 9]);
        assert!(Whitener::new(&rows, &silent).is_none());
    }
}
