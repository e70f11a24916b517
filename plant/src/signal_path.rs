//! What may stand between a signal and whoever takes it: transport, a filter, gears, an amplifier.
//!
//! A sampled signal passes, in this order, a delay, a lag, a limit to its rate, play, a dead band,
//! another gain for positive values than for negative ones, a gain, an offset, and saturation. At
//! its first sample everything is in the steady state of that sample.

use crate::ModelError;
use units::vocabulary;

/// The effects; SI or whatever unit the signal has.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SignalEffects {
    /// T of `u(t - T)`, straight between samples, s.
    pub delay: f64,
    /// T of `T y' + y = u`, the signal straight between samples, s.
    pub lag: f64,
    /// Largest rate, a unit of the signal per s; 0 for none.
    pub rate_limit: f64,
    /// Width of the play (backlash).
    pub play: f64,
    /// Half width of the dead band: nothing follows below it, and what is above is less by it.
    pub dead_band: f64,
    /// a of `(1 + a) u` above zero and `(1 - a) u` below.
    pub asymmetry: f64,
    /// Factor.
    pub gain: f64,
    /// What is added.
    pub offset: f64,
    /// Size at which the signal stays; 0 for none.
    pub saturation: f64,
}

impl SignalEffects {
    /// None of them.
    pub const NONE: Self = Self {
        delay: 0.0,
        lag: 0.0,
        rate_limit: 0.0,
        play: 0.0,
        dead_band: 0.0,
        asymmetry: 0.0,
        gain: 1.0,
        offset: 0.0,
        saturation: 0.0,
    };

    fn check(&self, period: f64) -> Result<(), ModelError> {
        let sizes = [
            ("delay", self.delay),
            ("lag", self.lag),
            (vocabulary::RATE_LIMIT, self.rate_limit),
            ("play", self.play),
            (vocabulary::DEAD_BAND, self.dead_band),
            ("saturation", self.saturation),
        ];
        for (name, value) in sizes {
            if !(value.is_finite() && value >= 0.0) {
                let expected = "a number, not negative";
                return Err(ModelError::Parameter {
                    name,
                    value,
                    expected,
                });
            }
        }
        for (name, value) in [
            ("asymmetry", self.asymmetry),
            ("gain", self.gain),
            ("offset", self.offset),
        ] {
            if !value.is_finite() {
                let expected = "a finite number";
                return Err(ModelError::Parameter {
                    name,
                    value,
                    expected,
                });
            }
        }
        if self.delay > MOST_DELAY * period {
            return Err(ModelError::Parameter {
                name: "delay",
                value: self.delay,
                expected: "at most a million sampling periods",
            });
        }
        Ok(())
    }
}

impl Default for SignalEffects {
    fn default() -> Self {
        Self::NONE
    }
}

/// Sampling periods of delay beyond which the memory of a path would be a mistake.
const MOST_DELAY: f64 = 1e6;

/// A signal on its way.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct SignalPath {
    effects: SignalEffects,
    period: f64,
    /// The newest samples, a ring.
    past: Vec<f64>,
    at: usize,
    has_begun: bool,
    delayed: f64,
    lagged: f64,
    limited: f64,
    played: f64,
}

impl SignalPath {
    /// A path of a signal that is sampled every `period` seconds.
    ///
    /// # Errors
    /// A period that is not positive, sizes that are negative or not finite.
    pub fn new(effects: SignalEffects, period: f64) -> Result<Self, ModelError> {
        if !(period.is_finite() && period > 0.0) {
            return Err(ModelError::Parameter {
                name: "period",
                value: period,
                expected: "a positive sampling period",
            });
        }
        effects.check(period)?;
        let whole = (effects.delay / period) as usize;
        Ok(Self {
            effects,
            period,
            past: vec![0.0; whole + 2],
            ..Self::default()
        })
    }

    /// What comes of the next sample.
    pub fn step(&mut self, sample: f64) -> f64 {
        let (of, period) = (&self.effects, self.period);
        let begins = !std::mem::replace(&mut self.has_begun, true);
        if begins {
            self.past.fill(sample);
        }
        let length = self.past.len().max(1);
        self.at = (self.at + 1) % length;
        if let Some(newest) = self.past.get_mut(self.at) {
            *newest = sample;
        }
        let ago = |age: usize| {
            let place = (self.at + length - age.min(length - 1)) % length;
            self.past.get(place).copied().unwrap_or(sample)
        };
        let samples = of.delay / period;
        let (whole, part) = (samples as usize, samples.fract());
        let delayed = ago(whole) + part * (ago(whole + 1) - ago(whole));
        if begins {
            self.delayed = delayed;
            self.lagged = delayed;
            self.limited = delayed;
            self.played = delayed;
        }
        let before = std::mem::replace(&mut self.delayed, delayed);
        self.lagged = if of.lag > 0.0 {
            let stays = (-period / of.lag).exp();
            let slope = (delayed - before) / period;
            let settles = stays * self.lagged + (1.0 - stays) * before;
            settles + slope * (period - of.lag * (1.0 - stays))
        } else {
            delayed
        };
        self.limited = if of.rate_limit > 0.0 {
            let most = of.rate_limit * period;
            self.limited + (self.lagged - self.limited).clamp(-most, most)
        } else {
            self.lagged
        };
        let half = 0.5 * of.play;
        self.played = self
            .played
            .max(self.limited - half)
            .min(self.limited + half);
        let beyond = self.played - self.played.clamp(-of.dead_band, of.dead_band);
        let side = if beyond < 0.0 { -1.0 } else { 1.0 };
        let signal = of.gain * (1.0 + side * of.asymmetry) * beyond + of.offset;
        if of.saturation > 0.0 {
            signal.clamp(-of.saturation, of.saturation)
        } else {
            signal
        }
    }

    /// What comes of a whole signal.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn pass(
        effects: SignalEffects,
        period: f64,
        signal: &[f64],
    ) -> Result<Vec<f64>, ModelError> {
        let mut path = Self::new(effects, period)?;
        Ok(signal.iter().map(|sample| path.step(*sample)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 0.01;

    fn sine() -> Vec<f64> {
        (0..400).map(|k| (0.1 * f64::from(k)).sin()).collect()
    }

    fn passed(effects: SignalEffects, signal: &[f64]) -> Vec<f64> {
        SignalPath::pass(effects, PERIOD, signal).unwrap()
    }

    #[test]
    fn without_effects_the_signal_stays_as_it_is() {
        assert_eq!(passed(SignalEffects::NONE, &sine()), sine());
    }

    #[test]
    fn a_ramp_is_late_by_delay_and_lag() {
        // T y' + y = r t has y -> r (t - T).
        let ramp: Vec<f64> = (0..400).map(f64::from).collect();
        let of = SignalEffects {
            delay: 0.034,
            lag: 0.02,
            ..SignalEffects::NONE
        };
        let found = passed(of, &ramp);
        assert!((found[399] - (399.0 - 5.4)).abs() < 1e-9, "{}", found[399]);
        assert_eq!(found[0], 0.0);
    }

    #[test]
    fn a_lag_of_a_sine_has_the_gain_and_phase_of_its_transfer_function() {
        let (omega, lag) = (10.0_f64, 0.05_f64);
        let of = SignalEffects {
            lag,
            ..SignalEffects::NONE
        };
        let fine = 1e-4;
        let sine: Vec<f64> = (0..40_000)
            .map(|k| (omega * fine * f64::from(k)).sin())
            .collect();
        let found = SignalPath::pass(of, fine, &sine).unwrap();
        let (gain, phase) = (1.0 / (omega * lag).hypot(1.0), -(omega * lag).atan());
        for k in 30_000..40_000 {
            let exact = gain * (omega * fine * k as f64 + phase).sin();
            assert!((found[k] - exact).abs() < 1e-6);
        }
    }

    #[test]
    fn what_is_not_linear_is_what_its_words_say() {
        let signal = [0.0, 1.0, 2.0, 1.5, -1.0, -3.0, 0.0];
        let none = SignalEffects::NONE;
        let dead_band = SignalEffects {
            dead_band: 1.0,
            ..none
        };
        assert_eq!(
            passed(dead_band, &signal),
            [0.0, 0.0, 1.0, 0.5, 0.0, -2.0, 0.0]
        );
        let play = SignalEffects { play: 1.0, ..none };
        assert_eq!(
            passed(play, &signal),
            [0.0, 0.5, 1.5, 1.5, -0.5, -2.5, -0.5]
        );
        let asymmetry = SignalEffects {
            asymmetry: 0.5,
            ..none
        };
        assert_eq!(
            passed(asymmetry, &signal),
            [0.0, 1.5, 3.0, 2.25, -0.5, -1.5, 0.0]
        );
        let rate_limit = SignalEffects {
            rate_limit: 100.0,
            ..none
        };
        assert_eq!(
            passed(rate_limit, &signal),
            [0.0, 1.0, 2.0, 1.5, 0.5, -0.5, 0.0]
        );
        let last = SignalEffects {
            gain: 2.0,
            offset: 1.0,
            saturation: 2.5,
            ..none
        };
        assert_eq!(passed(last, &signal), [1.0, 2.5, 2.5, 2.5, -1.0, -2.5, 1.0]);
    }

    #[test]
    fn sizes_that_mean_nothing_are_refused() {
        for of in [
            SignalEffects {
                delay: -1.0,
                ..SignalEffects::NONE
            },
            SignalEffects {
                delay: 1e9,
                ..SignalEffects::NONE
            },
            SignalEffects {
                gain: f64::NAN,
                ..SignalEffects::NONE
            },
        ] {
            assert!(SignalPath::new(of, PERIOD).is_err());
        }
        assert!(SignalPath::new(SignalEffects::NONE, 0.0).is_err());
    }
}
