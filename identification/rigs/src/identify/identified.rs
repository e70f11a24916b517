//! What an identification finds: the rig, and how sure its numbers are.

use nalgebra::{Complex, DMatrix, DVector};
use plant::identified::coupled::Rig;

use crate::identify::model::RigModel;
use crate::identify::parameters::{NoiseOn, Own, Physical, PhysicalValues};
use crate::identify::validation::ChannelFit;
use crate::kinds::shake_table::predictor::Disturbance;
use sysid::gauss_newton::GaussNewtonEstimate;
use sysid::prediction::Parameter;
use sysid::residuals::ResidualTest;

/// The identified rig, SI.
#[derive(Debug, Clone)]
pub struct RigIdentification {
    /// The physical parameters.
    pub physical: PhysicalValues,
    /// Their standard errors.
    pub standard_error: PhysicalValues,
    /// Their covariance, in the order of [`Physical::ALL`].
    pub covariance: DMatrix<f64>,
    /// Whether a specimen stood on the table in any recording.
    pub specimen: bool,
    /// Payload of each recording over the first one's, kg, with its standard error.
    pub payload: Vec<(f64, f64)>,
    /// Whether the data determine the actuator.
    pub identifiable: bool,
    /// Part of the actuator that is not determined, in words.
    pub warnings: Vec<String>,
    /// Relative noise by channel and recording is in here, with offsets and initial states.
    pub parameters: Vec<f64>,
    /// The model that predicts.
    pub model: RigModel,
    /// Fit per recording and channel on the validation part.
    pub fits: Vec<ChannelFit>,
    /// Tests of the one-step errors on the validation part, per recording and channel.
    pub residuals: Vec<(String, &'static str, ResidualTest)>,
    /// Singular values of the subspace method.
    pub singular_values: DVector<f64>,
    /// Iterations of the refinement.
    pub iterations: usize,
}

impl RigIdentification {
    /// The rig with a recording's payload; `specimen` says whether one stands on it.
    pub fn rig(&self) -> Rig {
        self.physical.rig(0.0, self.specimen)
    }

    /// Poles of G1 and G2, 1/s.
    pub fn actuator_poles(&self) -> Vec<Complex<f64>> {
        self.rig().shake_table.actuator.g1().poles()
    }

    /// Poles of the bare table, 1/s.
    pub fn table_poles(&self) -> Vec<Complex<f64>> {
        self.rig().shake_table.table.transfer_function().poles()
    }

    /// Standard deviation of the white noise of an output of a recording, SI.
    pub fn noise(&self, recording: usize, output: usize) -> f64 {
        let log_noise = Own::LogNoise(NoiseOn::Output(output));
        let relative = self.parameters[log_noise.of(recording)].exp();
        relative * self.model.experiments[recording].scale[output]
    }

    /// Noise of a recording's command in V, as [`Nominal::command_noise`] has it: the white voltage
    /// that was identified beside the command, as slow as an unseen voltage of a servo valve.
    ///
    /// [`Nominal::command_noise`]: crate::case::Nominal::command_noise
    pub fn command_noise(&self, recording: usize) -> f64 {
        let log_noise = Own::LogNoise(NoiseOn::Command);
        let own = &self.model.experiments[recording];
        let white = self.parameters[log_noise.of(recording)].exp() * own.command_scale;
        let unseen = Disturbance::beside_command(1.0, own.period);
        // Of one spectral density at low frequencies.
        white / unseen.density(0.0).sqrt()
    }

    /// Takes over the numbers of an estimate.
    pub(crate) fn take(&mut self, parameters: &[Parameter], estimate: GaussNewtonEstimate) {
        self.physical = PhysicalValues::of(&estimate.parameters);
        let count = Physical::ALL.len();
        self.covariance = estimate
            .covariance
            .view((0, 0), (count, count))
            .into_owned();
        self.standard_error = PhysicalValues::from_fn(|name| {
            if parameters[name.place()].free {
                estimate.standard_error(name.place())
            } else {
                0.0
            }
        });
        self.payload = (0..self.model.experiments.len())
            .map(|index| {
                let at = Own::Payload.of(index);
                (estimate.parameters[at], estimate.standard_error(at))
            })
            .collect();
        self.parameters = estimate.parameters;
    }

    /// Largest relative standard error of the responses of G1 and G2 over `frequencies` (Hz).
    pub fn response_error(&self, frequencies: &[f64]) -> [f64; 2] {
        response_error(&self.physical, &self.covariance, frequencies)
    }
}

/// Responses of G1 and G2 at a frequency (Hz).
fn responses(physical: &PhysicalValues, frequency: f64) -> [Complex<f64>; 2] {
    let s = Complex::new(0.0, std::f64::consts::TAU * frequency);
    let actuator = physical.rig(0.0, false).shake_table.actuator;
    [actuator.g1().evaluate(s), actuator.g2().evaluate(s)]
}

/// Largest relative standard error of the responses of G1 and G2 over `frequencies` (Hz).
fn response_error(
    physical: &PhysicalValues,
    covariance: &DMatrix<f64>,
    frequencies: &[f64],
) -> [f64; 2] {
    let mut largest = [0.0f64; 2];
    for &frequency in frequencies {
        let at = responses(physical, frequency);
        for (path, largest) in largest.iter_mut().enumerate() {
            let mut slope = [(); 2].map(|()| DVector::zeros(Physical::ALL.len()));
            for name in Physical::ACTUATOR {
                let mut moved = *physical;
                let change = 1e-6 * physical[name].abs().max(1e-6);
                moved[name] += change;
                let relative = (responses(&moved, frequency)[path] / at[path] - 1.0) / change;
                slope[0][name.place()] = relative.re;
                slope[1][name.place()] = relative.im;
            }
            let variance: f64 = slope.iter().map(|s| (covariance * s).dot(s)).sum();
            *largest = largest.max(variance.max(0.0).sqrt());
        }
    }
    largest
}
