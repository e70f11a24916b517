//! A rule as data: the required response spectrum and how a test response spectrum is held against it.

use motion::metrics::Measure;
use serde::Serialize;
use units::hint;

use crate::QualificationError;

/// How a spectrum runs from a point to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Straight in the logarithms of both.
    #[default]
    LogLog,
    /// Straight over the logarithm of frequency.
    SemiLog,
    /// Straight over frequency.
    Linear,
    /// Straight over the period, `a/f + b`.
    Reciprocal,
}

/// A point of a required spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Frequency, Hz.
    #[serde(rename = "frequency_hz")]
    pub frequency: f64,
    /// Required acceleration, g.
    #[serde(rename = "level_g")]
    pub level: f64,
    /// How it goes on to the next point.
    pub next: Interpolation,
}

/// How resonances are searched before and after.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Search {
    /// Peak acceleration, g.
    pub level_g: f64,
    /// Rate of a sine sweep.
    pub octaves_per_minute: f64,
    /// Lowest and highest frequency, Hz.
    pub band_hz: [f64; 2],
}

/// A rule.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rule {
    /// Its name with what was set.
    pub name: String,
    /// Where its numbers come from.
    pub source: String,
    /// Damping ratio of the oscillators.
    pub damping: f64,
    /// What the spectrum shows of them.
    pub measure: Measure,
    /// The required spectrum; constant beyond its last point, and as its first two go below the first.
    pub points: Vec<Point>,
    /// Band in which the test response spectrum is judged, Hz.
    pub band_hz: [f64; 2],
    /// Points of the grid per octave.
    pub points_per_octave: usize,
    /// Grids, evenly shifted, of which the best counts.
    pub grids: usize,
    /// Least ratio of test to required spectrum at any point.
    pub lowest_ratio: f64,
    /// Whether no two neighbouring points may be below 1.
    pub single_points_below_1: bool,
    /// Ratio above which points are reported.
    pub highest_ratio: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Strong motion within it, s.
    pub strong_s: f64,
    /// Axes that are shaken together.
    pub axes: usize,
    /// Largest correlation of two axes.
    pub correlation: f64,
    /// Largest coherence of two axes.
    pub coherence: f64,
    /// Resonance search.
    pub search: Search,
}

impl Rule {
    /// The required spectrum at a frequency (Hz), g.
    #[must_use]
    pub fn required(&self, frequency: f64) -> f64 {
        let after = self
            .points
            .partition_point(|own| own.frequency <= frequency);
        match after {
            0 => between(
                &self.points[0],
                &self.points[1.min(self.points.len() - 1)],
                frequency,
            ),
            n if n == self.points.len() => self.points[n - 1].level,
            n => between(&self.points[n - 1], &self.points[n], frequency),
        }
    }

    /// The largest required level within the band, g.
    #[must_use]
    pub fn peak_level(&self) -> f64 {
        let levels = grid(self.band_hz, 12, 0.0).into_iter();
        levels.map(|f| self.required(f)).fold(0.0, f64::max)
    }

    /// The same rule at a part of its level.
    #[must_use]
    pub fn at_level(&self, level: f64) -> Self {
        let mut own = self.clone();
        own.points.iter_mut().for_each(|point| point.level *= level);
        own
    }

    /// AC156 for `s_ds` (g) and height ratio `z_h`, horizontal or vertical.
    pub(crate) fn ac156(s_ds: f64, z_h: f64, vertical: bool) -> Self {
        let (flexible, rigid) = if vertical {
            (0.67 * s_ds, 0.27 * s_ds)
        } else {
            let height = 1.0 + 2.0 * z_h;
            (
                (s_ds * height).min(1.6 * s_ds),
                (0.4 * s_ds * height).min(1.2 * s_ds),
            )
        };
        let shown = if vertical {
            "vertical".to_string()
        } else {
            format!("z/h {z_h}")
        };
        let band_hz = [1.3, 33.3];
        Self {
            name: format!("AC156, S_DS {s_ds} g, {shown}"),
            source:
                "ICC-ES AC156, by a testing laboratory's public program and public summaries; the \
                     text itself was not used"
                    .into(),
            damping: 0.05,
            measure: Measure::PseudoAcceleration,
            points: points(&[
                (0.1, 0.1 * flexible),
                (1.3, flexible),
                (8.3, flexible),
                (33.3, rigid),
            ]),
            band_hz,
            points_per_octave: 6,
            grids: 12,
            lowest_ratio: 0.9,
            single_points_below_1: true,
            highest_ratio: 1.3,
            duration_s: 30.0,
            strong_s: 20.0,
            axes: 1,
            correlation: 0.3,
            coherence: 0.5,
            search: Search {
                level_g: 0.1,
                octaves_per_minute: 2.0,
                band_hz,
            },
        }
    }

    /// IEEE 693 at its high level times `part`, for a damping in percent.
    pub(crate) fn ieee693(level: &str, part: f64, damping_percent: f64) -> Self {
        let b = (3.21 - 0.68 * damping_percent.ln()) / 2.1156;
        let at = |frequency, level: f64, next| Point {
            frequency,
            level: part * level,
            next,
        };
        use Interpolation::{LogLog, Reciprocal};
        Self {
            name: format!("IEEE 693, {level} level, {damping_percent} % damping"),
            source:
                "IEEE 693, by its published formula; band, duration and tolerance are assumed: the \
                     text itself was not used"
                    .into(),
            damping: damping_percent / 100.0,
            points: vec![
                at(0.1, 1.144 * b * 0.1, LogLog),
                at(1.1, 1.144 * b * 1.1, LogLog),
                at(1.1, 1.25 * b, LogLog),
                at(8.0, 1.25 * b, Reciprocal),
                at(33.0, 0.5, LogLog),
            ],
            points_per_octave: 12,
            grids: 1,
            lowest_ratio: 1.0,
            single_points_below_1: false,
            ..Self::ac156(1.0, 0.0, false)
        }
    }

    /// Whether the numbers make a rule.
    pub(crate) fn check(self) -> Result<Self, QualificationError> {
        let fault = |reason: String| {
            Err(QualificationError::Rule {
                rule: self.name.clone(),
                reason,
            })
        };
        if self.points.len() < 2 {
            return fault("the required spectrum has fewer than two points".into());
        }
        if !(self.damping > 0.0 && self.damping < 0.5) {
            return fault(format!(
                "a damping of {} % is not above 0 and below 50 %",
                100.0 * self.damping
            ));
        }
        let [low, high] = self.band_hz;
        if !(low > 0.0 && high > low && high <= 100.0) {
            return fault(format!(
                "band_hz = [{low}, {high}]; expected 0 < LOW < HIGH <= 100"
            ));
        }
        if self.search.octaves_per_minute.is_nan() || self.search.octaves_per_minute <= 0.0 {
            return fault("search_octaves_per_minute is not positive".into());
        }
        if !(1..=48).contains(&self.points_per_octave) || !(1..=48).contains(&self.grids) {
            return fault("points_per_octave and grids go from 1 to 48".into());
        }
        if !(self.lowest_ratio > 0.0 && self.highest_ratio > self.lowest_ratio) {
            return fault("expected 0 < lowest_ratio < highest_ratio".into());
        }
        let periods = 8.0 / low;
        if !(self.duration_s >= periods && self.duration_s <= 300.0) {
            return fault(format!(
                "duration_s = {} is not between {periods:.1} s (8 periods of {low} Hz) and 300 s",
                self.duration_s
            ));
        }
        if !(self.strong_s > 0.0 && self.strong_s < self.duration_s) {
            return fault(format!(
                "strong_s = {} is not above 0 and below duration_s",
                self.strong_s
            ));
        }
        if !(1..=3).contains(&self.axes) {
            return fault(format!("axes = {}; expected 1, 2 or 3", self.axes));
        }
        if !matches!(
            self.measure,
            Measure::PseudoAcceleration | Measure::AbsoluteAcceleration
        ) {
            return fault(format!(
                "measure = \"{}\"; expected pseudo_acceleration or absolute_acceleration",
                self.measure.name()
            ));
        }
        let most = self.peak_level();
        if !(most > 0.0 && most <= MOST_G) {
            return fault(format!(
                "the required spectrum reaches {most:.3} g; expected at most {MOST_G} g, which no shake \
                 table reaches (is the unit right?)"
            ));
        }
        Ok(self)
    }
}

/// The largest level that is computed for, g.
const MOST_G: f64 = 50.0;

fn points(of: &[(f64, f64)]) -> Vec<Point> {
    of.iter()
        .map(|&(frequency, level)| Point {
            frequency,
            level,
            next: Interpolation::LogLog,
        })
        .collect()
}

fn between(from: &Point, to: &Point, frequency: f64) -> f64 {
    let straight = |at: fn(f64) -> f64| {
        let (a, b) = (at(from.frequency), at(to.frequency));
        if a == b {
            0.0
        } else {
            (at(frequency) - a) / (b - a)
        }
    };
    let level = |part: f64| from.level + part * (to.level - from.level);
    match from.next {
        Interpolation::LogLog => from.level * (to.level / from.level).powf(straight(f64::ln)),
        Interpolation::SemiLog => level(straight(f64::ln)).max(0.0),
        Interpolation::Linear => level(straight(|f| f)).max(0.0),
        Interpolation::Reciprocal => level(straight(|f| 1.0 / f)).max(0.0),
    }
}

/// Frequencies of a grid, `per_octave` from the lower end of a band times `2^shift` on; without a shift its
/// upper end, too.
#[must_use]
pub fn grid([low, high]: [f64; 2], per_octave: usize, shift: f64) -> Vec<f64> {
    let step = 1.0 / per_octave as f64;
    let places = (0..).map(|n| low * (shift + f64::from(n) * step).exp2());
    let mut all: Vec<f64> = places.take_while(|f| *f <= high * (1.0 - 1e-9)).collect();
    if shift == 0.0 {
        all.push(high);
    }
    all
}

/// An unknown key of a rule.
pub(crate) fn unknown_key(rule: &str, key: &str, known: &[&str]) -> QualificationError {
    QualificationError::Rule {
        rule: rule.into(),
        reason: format!(
            "unknown key `{key}`{}; expected one of {}",
            hint(key, known.iter().copied()),
            known.join(", ")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{found} is not {expected}"
        );
    }

    /// The laboratory's program: `0.79015395 A f^0.89771172` and the exponent `0.71978597 ln(A_FLX/A_RIG)`.
    #[test]
    fn ac156_is_that_of_the_public_program() {
        let rule = Rule::ac156(1.25, 0.0, false);
        for f in [0.1, 0.5, 1.0, 1.29] {
            close(
                rule.required(f),
                0.790_153_95 * 1.25 * f64::powf(f, 0.897_711_72),
            );
        }
        close(rule.required(5.0), 1.25);
        let exponent = 0.719_785_97 * (1.0_f64 / 0.4).ln();
        for f in [9.0, 20.0, 33.0] {
            close(rule.required(f), 1.25 * f64::powf(8.3 / f, exponent));
        }
        close(rule.required(60.0), 0.5);
        let roof = Rule::ac156(1.0, 1.0, false);
        close(roof.required(3.0), 1.6);
        close(roof.required(40.0), 1.2);
        let vertical = Rule::ac156(1.0, 1.0, true);
        close(vertical.required(3.0), 0.67);
        close(vertical.required(40.0), 0.27);
    }

    #[test]
    fn ieee_693_is_its_formula() {
        for (damping, part) in [(2.0, 1.0), (5.0, 0.5)] {
            let rule = Rule::ieee693("any", part, damping);
            close(rule.damping, 0.01 * damping);
            let b = (3.21 - 0.68 * f64::ln(damping)) / 2.1156;
            close(rule.required(0.7), part * 1.144 * b * 0.7);
            close(rule.required(3.0), part * 1.25 * b);
            for f in [8.5, 12.0, 32.0] {
                close(
                    rule.required(f),
                    part * ((13.2 * b - 5.28) / f - 0.4 * b + 0.66),
                );
            }
            close(rule.required(50.0), part * 0.5);
        }
    }

    #[test]
    fn a_grid_that_meets_the_upper_end_has_it_once() {
        let half_octaves = grid([1.0, 8.0], 2, 0.0);
        assert_eq!(half_octaves.len(), 7);
        for (n, frequency) in half_octaves.iter().enumerate() {
            close(*frequency, 2f64.powf(0.5 * n as f64));
        }
        assert_eq!(grid([1.0, 8.0], 1, 0.5).len(), 3);
    }

    #[test]
    fn a_grid_spans_the_band() {
        let all = grid([1.3, 33.3], 12, 0.0);
        assert_eq!((all[0], all[all.len() - 1]), (1.3, 33.3));
        assert_eq!(all.len(), 58);
        let shifted = grid([1.3, 33.3], 6, 1.0 / 12.0);
        assert!((shifted[0] / 1.3 - 2f64.powf(1.0 / 12.0)).abs() < 1e-12);
        assert!(shifted.iter().all(|f| *f < 33.3));
    }
}
