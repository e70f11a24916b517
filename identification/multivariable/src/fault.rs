//! Faults of a rig of several actuators, each with how it changes the commands, strokes or joint.

use std::fmt;

use serde::Serialize;

/// A fault with the actuator, from 0, that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "fault", content = "actuator", rename_all = "snake_case")]
pub enum Fault {
    /// The actuator moves more or less than commanded.
    Gain(usize),
    /// Its command arrives later or earlier.
    Delay(usize),
    /// Its stroke sensor reads more or less.
    SensorGain(usize),
    /// It has play between valve and stroke sensor.
    Play(usize),
    /// Its pin at the coupler has play: the joint follows the stroke with play.
    PinPlay(usize),
    /// The lever arm of its pin is not what was stated.
    Lever(usize),
    /// The stroke sensors of two actuators are swapped.
    SensorsSwapped(usize, usize),
    /// The commands of two actuators are swapped.
    CommandsSwapped(usize, usize),
}

impl Fault {
    /// Its name in snake case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Gain(_) => "gain",
            Self::Delay(_) => "delay",
            Self::SensorGain(_) => "sensor_gain",
            Self::Play(_) => "play",
            Self::PinPlay(_) => "pin_play",
            Self::Lever(_) => "lever_arm",
            Self::SensorsSwapped(..) => "sensors_swapped",
            Self::CommandsSwapped(..) => "commands_swapped",
        }
    }

    /// Actuators that it concerns, from 0.
    #[must_use]
    pub fn actuators(self) -> Vec<usize> {
        match self {
            Self::SensorsSwapped(a, b) | Self::CommandsSwapped(a, b) => vec![a, b],
            Self::Gain(a)
            | Self::Delay(a)
            | Self::SensorGain(a)
            | Self::Play(a)
            | Self::PinPlay(a)
            | Self::Lever(a) => {
                vec![a]
            }
        }
    }

    /// SI unit of its parameter; empty without one.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gain(_) | Self::SensorGain(_) => "1",
            Self::Delay(_) => "s",
            Self::Play(_) | Self::PinPlay(_) | Self::Lever(_) => "m",
            Self::SensorsSwapped(..) | Self::CommandsSwapped(..) => "",
        }
    }

    /// The fault in words, its parameter being `value` and one standard error.
    #[must_use]
    pub fn words(self, value: f64, error: f64) -> String {
        let half = 1.96 * error;
        let more = if value > 0.0 { "more" } else { "less" };
        let percent = || format!("{:.1} ± {:.1} %", 100.0 * value.abs(), 100.0 * half);
        let millimetres = |value: f64| format!("{:.3} ± {:.3} mm", 1e3 * value, 1e3 * half);
        let number: Vec<String> = self
            .actuators()
            .iter()
            .map(|i| (i + 1).to_string())
            .collect();
        let own = number.join(" and ");
        match self {
            Self::Gain(_) => format!("actuator {own} moves {} {more} than its model", percent()),
            Self::Delay(_) => {
                let when = if value > 0.0 { "later" } else { "earlier" };
                format!(
                    "the command of actuator {own} arrives {:.2} ± {:.2} ms {when}",
                    1e3 * value.abs(),
                    1e3 * half
                )
            }
            Self::SensorGain(_) => format!(
                "the stroke sensor of actuator {own} reads {} {more}",
                percent()
            ),
            Self::Play(_) => format!("actuator {own} has a play of {}", millimetres(value)),
            Self::PinPlay(_) => format!(
                "the pin of actuator {own} has a play of {}",
                millimetres(value)
            ),
            Self::Lever(_) => format!(
                "the lever arm of actuator {own} is off by {}",
                millimetres(value)
            ),
            Self::SensorsSwapped(..) => {
                format!("the stroke sensors of actuators {own} are swapped")
            }
            Self::CommandsSwapped(..) => format!("the commands of actuators {own} are swapped"),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number: Vec<String> = self
            .actuators()
            .iter()
            .map(|i| (i + 1).to_string())
            .collect();
        write!(to, "{} of actuator {}", self.name(), number.join(" and "))
    }
}

/// What follows a signal with a play of `width` in all, begun in its middle.
pub(crate) fn played(signal: &[f64], width: f64) -> Vec<f64> {
    let half = 0.5 * width;
    let mut place = signal.first().copied().unwrap_or(0.0);
    signal
        .iter()
        .map(|leading| {
            place = place.clamp(leading - half, leading + half);
            place
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_play_follows_half_its_width_behind_and_rests_when_it_turns() {
        let signal = [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0, -1.0];
        let follows = [0.0, 0.0, 0.5, 1.5, 2.5, 2.5, 2.5, 2.5, 1.5, 0.5];
        assert_eq!(played(&signal, 3.0), follows);
        assert_eq!(played(&signal, 0.0), signal);
        // Begun in its middle, wherever that is.
        assert_eq!(played(&[5.0, 5.5, 6.5], 2.0), [5.0, 5.0, 5.5]);
        assert!(played(&[], 1.0).is_empty());
    }

    #[test]
    fn a_fault_is_told_with_its_interval_and_its_direction() {
        for (fault, value, told) in [
            (
                Fault::Gain(0),
                0.05,
                "actuator 1 moves 5.0 ± 0.2 % more than its model",
            ),
            (
                Fault::SensorGain(1),
                -0.04,
                "the stroke sensor of actuator 2 reads 4.0 ± 0.2 % less",
            ),
            (
                Fault::Delay(1),
                -3e-3,
                "the command of actuator 2 arrives 3.00 ± 1.96 ms earlier",
            ),
            (
                Fault::Play(0),
                2e-3,
                "actuator 1 has a play of 2.000 ± 1.960 mm",
            ),
            (
                Fault::SensorsSwapped(0, 1),
                0.0,
                "the stroke sensors of actuators 1 and 2 are swapped",
            ),
        ] {
            assert_eq!(fault.words(value, 1e-3), told);
        }
        assert_eq!(
            Fault::CommandsSwapped(0, 2).to_string(),
            "commands_swapped of actuator 1 and 3"
        );
    }
}
