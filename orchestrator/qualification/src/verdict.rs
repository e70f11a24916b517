//! A record's response spectrum against a required one.

use motion::metrics::{Measure, response_spectrum};
use serde::Serialize;
use units::STANDARD_GRAVITY;

use crate::rule::{Rule, grid};

/// A point of the test response spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, serde::Deserialize)]
pub struct Ratio {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Required, g.
    pub rrs_g: f64,
    /// By the rule's measure, g.
    pub trs_g: f64,
    /// Pseudo-acceleration, g.
    pub pseudo_g: f64,
    /// Acceleration of the oscillator's mass, g.
    pub absolute_g: f64,
}

impl Ratio {
    /// Test over required.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.trs_g / self.rrs_g
    }
}

/// What a record shows against a rule: what `trs --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The rule.
    pub rule: String,
    /// Damping of the oscillators, %.
    pub damping_percent: f64,
    /// What `trs_g` is.
    pub measure: Measure,
    /// Points of the rule's grid; of several, those of the best.
    pub points: Vec<Ratio>,
    /// Lowest ratio at these.
    pub lowest_ratio: f64,
    /// Highest ratio at these.
    pub highest_ratio: f64,
    /// Points below 1.
    pub below_1: usize,
    /// Points above the rule's highest ratio.
    pub above: usize,
    /// `envelops` or `falls short`: by the rule's lowest ratio, and single points where it asks for them.
    pub verdict: &'static str,
    /// Lowest and highest ratio on 1/12 octaves over the rule's band, both ends with it.
    pub twelfth_octaves: [f64; 2],
    /// Ratio of the record's peak to the last required level.
    pub peak_over_rigid: f64,
    /// What is doubtful about the record.
    pub warnings: Vec<String>,
}

/// Test and required spectrum at `frequencies`; `acceleration` in m/s², a sample every `dt` s.
#[must_use]
pub fn ratios(rule: &Rule, acceleration: &[f64], dt: f64, frequencies: &[f64]) -> Vec<Ratio> {
    let spectrum =
        |measure| response_spectrum(acceleration, dt, frequencies, rule.damping, measure);
    let pseudo = spectrum(Measure::PseudoAcceleration);
    let absolute = spectrum(Measure::AbsoluteAcceleration);
    let both = frequencies.iter().zip(pseudo.iter().zip(&absolute));
    both.map(|(&frequency_hz, (pseudo, absolute))| {
        let trs = match rule.measure {
            Measure::AbsoluteAcceleration => absolute,
            _ => pseudo,
        };
        Ratio {
            frequency_hz,
            rrs_g: rule.required(frequency_hz),
            trs_g: trs / STANDARD_GRAVITY,
            pseudo_g: pseudo / STANDARD_GRAVITY,
            absolute_g: absolute / STANDARD_GRAVITY,
        }
    })
    .collect()
}

/// Lowest and highest of ratios.
#[must_use]
pub fn extremes(points: &[Ratio]) -> [f64; 2] {
    points
        .iter()
        .map(Ratio::ratio)
        .fold([f64::INFINITY, 0.0], |[low, high], ratio| {
            [low.min(ratio), high.max(ratio)]
        })
}

impl Verdict {
    /// Of a record, whose doubts are `warnings`.
    #[must_use]
    pub fn new(rule: &Rule, acceleration: &[f64], dt: f64, warnings: Vec<String>) -> Self {
        let candidates = (0..rule.grids).map(|n| {
            let shift = n as f64 / (rule.grids * rule.points_per_octave) as f64;
            let frequencies = grid(rule.band_hz, rule.points_per_octave, shift);
            let points = ratios(rule, acceleration, dt, &frequencies);
            (fits(rule, &points), extremes(&points)[0], points)
        });
        let best =
            candidates.max_by(|one, other| one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)));
        let (envelops, _, points) = best.unwrap_or_default();
        let fine = ratios(rule, acceleration, dt, &grid(rule.band_hz, 12, 0.0));
        let [lowest_ratio, highest_ratio] = extremes(&points);
        let count = |is: &dyn Fn(f64) -> bool| points.iter().filter(|own| is(own.ratio())).count();
        Self {
            rule: rule.name.clone(),
            damping_percent: 100.0 * rule.damping,
            measure: rule.measure,
            below_1: count(&|ratio| ratio < 1.0),
            above: count(&|ratio| ratio > rule.highest_ratio),
            lowest_ratio,
            highest_ratio,
            verdict: if envelops { "envelops" } else { "falls short" },
            twelfth_octaves: extremes(&fine),
            peak_over_rigid: motion::peak(acceleration)
                / STANDARD_GRAVITY
                / rule.required(rule.band_hz[1]),
            points,
            warnings,
        }
    }

    /// Whether the record's spectrum is within the rule's bounds.
    #[must_use]
    pub fn envelops(&self) -> bool {
        self.verdict == "envelops"
    }
}

fn fits(rule: &Rule, points: &[Ratio]) -> bool {
    let below = |own: &Ratio| own.ratio() < 1.0;
    let pairs = points
        .windows(2)
        .any(|pair| below(&pair[0]) && below(&pair[1]));
    let lowest = points.iter().all(|own| own.ratio() >= rule.lowest_ratio);
    lowest && !(rule.single_points_below_1 && pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(ratio: f64) -> Ratio {
        Ratio {
            frequency_hz: 1.0,
            rrs_g: 2.0,
            trs_g: 2.0 * ratio,
            pseudo_g: 0.0,
            absolute_g: 0.0,
        }
    }

    #[test]
    fn points_below_one_must_stand_alone_and_above_nine_tenths() {
        let rule = Rule::ac156(1.0, 0.0, false);
        let of = |all: &[f64]| {
            fits(
                &rule,
                &all.iter().map(|own| point(*own)).collect::<Vec<_>>(),
            )
        };
        assert!(of(&[1.0, 1.2, 1.4]));
        assert!(of(&[0.95, 1.0, 0.91, 1.1]));
        assert!(!of(&[1.1, 0.95, 0.99, 1.1]));
        assert!(!of(&[1.1, 0.89, 1.1]));
        let strict = Rule {
            lowest_ratio: 1.0,
            ..rule
        };
        assert!(!fits(&strict, &[point(0.99)]));
    }

    /// A sine of 4 Hz: an oscillator that is much stiffer moves with it, one in resonance much more.
    #[test]
    fn a_verdict_has_the_extremes_of_the_ratios_and_scales_with_the_record() {
        let rule = Rule::ac156(1.0, 0.0, false);
        let (dt, peak) = (0.001, 3.0);
        let at = |n: u32| peak * (8.0 * std::f64::consts::PI * f64::from(n) * dt).sin();
        let sine: Vec<f64> = (0..5000).map(at).collect();
        let of = |factor: f64| {
            let scaled: Vec<f64> = sine.iter().map(|a| factor * a).collect();
            Verdict::new(&rule, &scaled, dt, vec!["doubt".into()])
        };
        let own = of(1.0);
        let all: Vec<f64> = own.points.iter().map(Ratio::ratio).collect();
        let resonance = (0..all.len())
            .max_by(|a, b| all[*a].total_cmp(&all[*b]))
            .unwrap();
        assert!((own.points[resonance].frequency_hz - 4.0).abs() < 0.3);
        assert_eq!(own.highest_ratio, all[resonance]);
        assert!(
            all.iter().all(|ratio| *ratio >= own.lowest_ratio) && all.contains(&own.lowest_ratio)
        );
        assert_eq!(own.warnings, ["doubt"]);
        let stiff = own.points.last().unwrap().trs_g * STANDARD_GRAVITY;
        assert!((stiff / peak - 1.0).abs() < 0.1, "{stiff}");
        let rigid = peak / STANDARD_GRAVITY / rule.required(rule.band_hz[1]);
        assert!((own.peak_over_rigid / rigid - 1.0).abs() < 1e-3);
        let [low, high] = own.twelfth_octaves;
        assert!(low <= own.lowest_ratio && high >= 0.9 * own.highest_ratio);
        // As large as the weakest point needs, and half of that.
        let enough = of(1.000_001 / own.lowest_ratio);
        assert!((enough.lowest_ratio - 1.0).abs() < 1e-5);
        assert_eq!((enough.below_1, enough.envelops()), (0, true));
        let little = of(0.5 / own.lowest_ratio);
        assert_eq!(little.verdict, "falls short");
        let below = all
            .iter()
            .filter(|ratio| **ratio < 2.0 * own.lowest_ratio)
            .count();
        assert_eq!(little.below_1, below);
        assert_eq!(extremes(&[]), [f64::INFINITY, 0.0]);
    }
}
