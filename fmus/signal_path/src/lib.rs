#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! What stands between a signal and whoever takes it, as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::signal_path::{SignalEffects, SignalPath as Path};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// A signal on its way.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SignalPath {
    effects: SignalEffects,
    period: f64,
    path: Path,
    u: f64,
    y: f64,
}

impl Default for SignalPath {
    fn default() -> Self {
        Self {
            effects: SignalEffects::NONE,
            period: Self::STEP_SIZE,
            path: Path::default(),
            u: 0.0,
            y: 0.0,
        }
    }
}

impl Component for SignalPath {
    const NAME: &'static str = "SignalPath";
    const DESCRIPTION: &'static str =
        "Delay, lag, rate limit, play, dead band, gain, offset and saturation of a signal";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::plug("input", "signal", &[("signal", "u")]),
        Terminal::plug("output", "signal", &[("signal", "y")]),
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("u", s.u, "Signal");
            output("y", s.y, "What arrives").discrete().depends_on(&["u"], Dependent);
            parameter("period", s.period, "Sampling period", "s" => "ms").min(1e-9);
            parameter("delay", s.effects.delay, "Delay", "s" => "ms").min(0.0);
            parameter("lag", s.effects.lag, "Time constant of the lag", "s" => "ms").min(0.0);
            parameter(vocabulary::RATE_LIMIT, s.effects.rate_limit, "Largest rate, 0 for none").min(0.0);
            parameter("play", s.effects.play, "Width of the play").min(0.0);
            parameter(vocabulary::DEAD_BAND, s.effects.dead_band, "Half width of the dead band").min(0.0);
            parameter("asymmetry", s.effects.asymmetry, "Share by which the gain is larger above zero and smaller below");
            parameter("gain", s.effects.gain, "Factor");
            parameter("offset", s.effects.offset, "What is added");
            parameter("saturation", s.effects.saturation, "Size at which the signal stays, 0 for none").min(0.0);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.path = Path::new(self.effects, self.period)?;
        Ok(())
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        self.y = self.path.step(self.u);
        Ok(())
    }
}

fmu_kit::export!(SignalPath);
