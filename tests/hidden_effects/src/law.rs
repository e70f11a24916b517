//! The controller that made the recorded voltage (relation R5).

use crate::rig::RATE;

/// The laboratory's own three-variable tuning (relation R5), V and in.
#[derive(Debug, Clone, Copy, Default)]
pub struct Law {
    rate: f64,
    previous: Option<f64>,
    integral: f64,
}

impl Law {
    /// Command from the reference and its derivatives and the measured motion.
    pub fn command(&mut self, r: [f64; 3], x: f64, a: f64) -> f64 {
        let before = self.previous.unwrap_or(x);
        self.rate += 0.25 * ((x - before) * RATE - self.rate);
        self.previous = Some(x);
        self.integral += 0.161 * (r[0] - x) / RATE;
        let command = 6.15 * (r[0] - x) + self.integral + 0.125 * r[1] + 1e-4 * r[2]
            - 0.005 * self.rate
            - 1e-4 * a;
        command.clamp(-10.0, 10.0)
    }
}
