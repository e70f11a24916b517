//! Units that a rig brings along: what is large or small on it.

use super::RigRecording;
use recordings::{Channel, mean_and_deviation};

/// Typical sizes on a rig, SI. Effects and nuisance of a kind may be counted in them, so that a
/// kind fits a drive of micrometres and one of metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Natural {
    /// m.
    pub length: f64,
    /// N.
    pub force: f64,
    /// s.
    pub time: f64,
    /// V.
    pub voltage: f64,
    /// Pa.
    pub stress: f64,
}

impl Natural {
    /// Deviations of the channels of `recordings`, 1 where there is none; time is how long
    /// the first length takes at its mean speed.
    pub fn of(recordings: &[RigRecording], channels: &[Channel]) -> Self {
        let mut natural = Self {
            length: 1.0,
            force: 1.0,
            time: 1.0,
            voltage: 1.0,
            stress: 1.0,
        };
        for channel in channels.iter().rev() {
            let values: Vec<f64> = recordings
                .iter()
                .flat_map(|one| one.input(*channel))
                .copied()
                .filter(|value| value.is_finite())
                .collect();
            let (_, size) = mean_and_deviation(&values);
            if !(size.is_finite() && size > 0.0) {
                continue;
            }
            match channel.unit() {
                "m" => {
                    natural.length = size;
                    let period = recordings.first().map_or(1.0, RigRecording::period);
                    let steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
                    let (_, step) = mean_and_deviation(&steps);
                    if step > 0.0 {
                        natural.time = size / step * period;
                    }
                }
                "N" => natural.force = size,
                "V" => natural.voltage = size,
                "Pa" => natural.stress = size,
                _ => {}
            }
        }
        natural
    }

    /// The size of an SI unit such as `N s2/m2` in these.
    pub fn unit(&self, unit: &str) -> f64 {
        let mut size = 1.0;
        for (i, part) in unit.split('/').enumerate() {
            for token in part.split_whitespace() {
                let end = token.trim_end_matches(|c: char| c.is_ascii_digit()).len();
                let power: i32 = token[end..].parse().unwrap_or(1);
                let base = match &token[..end] {
                    "m" => self.length,
                    "N" => self.force,
                    "s" => self.time,
                    "kg" => self.force * self.time * self.time / self.length,
                    "V" => self.voltage,
                    "Pa" => self.stress,
                    _ => 1.0,
                };
                size *= base.powi(if i == 0 { power } else { -power });
            }
        }
        size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_products_of_powers() {
        let natural = Natural {
            length: 2.0,
            force: 3.0,
            time: 5.0,
            voltage: 7.0,
            stress: 11.0,
        };
        for (unit, size) in [
            ("1", 1.0),
            ("N/m3", 3.0 / 8.0),
            ("N s2/m2", 3.0 * 25.0 / 4.0),
            ("1/m", 0.5),
            ("rad/s", 0.2),
            ("kg", 3.0 * 25.0 / 2.0),
            ("N s/m/V", 3.0 * 5.0 / 2.0 / 7.0),
            ("1/Pa", 1.0 / 11.0),
        ] {
            assert!((natural.unit(unit) / size - 1.0).abs() < 1e-12, "{unit}");
        }
    }
}
