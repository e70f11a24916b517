//! What disturbs a rig and its sensors, as the predictor assumes it.

/// A coloured noise: `w(k+1) = phi w(k) + sigma sqrt(1 - phi²) e(k)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// Standard deviation: V for the unseen voltage, SI for a sensor.
    pub sigma: f64,
    /// Correlation from sample to sample.
    pub phi: f64,
}

impl Disturbance {
    /// What a servo valve adds to a command recorded with `command_noise` (V), as long as the
    /// records have not told: eight times that noise, with a corner at 30 Hz.
    pub fn beside_command(command_noise: f64, period: f64) -> Self {
        Self::below(8.0 * command_noise.max(1e-5), 30.0, period)
    }

    /// One of standard deviation `sigma` with a `corner` (Hz).
    pub fn below(sigma: f64, corner: f64, period: f64) -> Self {
        Self {
            sigma,
            phi: (-std::f64::consts::TAU * corner * period).exp(),
        }
    }

    /// Its corner, Hz.
    pub fn corner(&self, period: f64) -> f64 {
        -self.phi.ln() / (std::f64::consts::TAU * period)
    }

    /// Standard deviation of what is new in a sample.
    pub fn drive(&self) -> f64 {
        self.sigma * (1.0 - self.phi * self.phi).sqrt()
    }
}

/// Noises of a rig with four channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// White part of every channel's, one standard deviation, SI; infinite where it is missing.
    pub white: [f64; 4],
    /// Coloured part of every channel's, where it has one.
    pub slow: [Option<Disturbance>; 4],
    /// The unseen voltage beside the command.
    pub unseen: Disturbance,
}

impl Noise {
    /// White sensors of `white` (SI, infinite for a channel that is missing) and `unseen` beside the
    /// command.
    pub fn new(white: [f64; 4], unseen: Disturbance) -> Self {
        Self {
            white,
            slow: [None; 4],
            unseen,
        }
    }
}
