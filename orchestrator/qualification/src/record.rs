//! Whether a rule can be computed for a record, and what is doubtful about it.

use motion::metrics::spectrum;
use motion::{Record, peak};
use realfft::num_complex::Complex64;
use units::STANDARD_GRAVITY;

use crate::{QualificationError, Rule};

/// Periods of the lowest frequency that a record lasts at least.
const PERIODS: f64 = 3.0;
/// Equal neighbours at the extreme that make a clipped record.
const DWELL: usize = 3;
/// Part of the energy in the last tenth below half of the sampling rate that suggests aliases.
const ALIASED: f64 = 0.02;
/// Mean over peak that is an offset.
const OFFSET: f64 = 0.01;

/// What is doubtful about a record under a rule, a sentence each.
///
/// # Errors
/// A record for which the rule cannot be computed: too short, sampled too slowly, or at rest.
pub fn doubts(rule: &Rule, record: &Record) -> Result<Vec<String>, QualificationError> {
    let fault = |reason: String| {
        Err(QualificationError::Record {
            record: record.origin.clone(),
            reason,
        })
    };
    let a = &record.acceleration;
    let (duration, [low, high]) = (a.len() as f64 * record.dt, rule.band_hz);
    let needed = PERIODS / low;
    if duration < needed {
        return fault(format!(
            "lasts {duration:.2} s; expected at least {needed:.2} s, {PERIODS} periods of {low} Hz"
        ));
    }
    let nyquist = 0.5 / record.dt;
    if nyquist < high {
        return fault(format!(
            "sampled at {} Hz, which shows nothing above {} Hz; the rule is judged to {high} \
             Hz; expected a record with more than {:.0} samples per second",
            (1e4 / record.dt).round() / 1e4,
            (1e4 * nyquist).round() / 1e4,
            2.0 * high
        ));
    }
    let largest = peak(a);
    if largest <= 0.0 {
        return fault("the acceleration is zero throughout".into());
    }
    let mut all = Vec::new();
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    if mean.abs() > OFFSET * largest {
        all.push(format!(
            "the record has an offset of {:.4} g, {:.1} % of its peak, which raises the spectrum at high \
             frequencies; remove it before",
            mean / STANDARD_GRAVITY,
            100.0 * mean.abs() / largest
        ));
    }
    if duration < rule.duration_s - record.dt {
        all.push(format!(
            "the record lasts {duration:.2} s; the rule asks for {} s",
            rule.duration_s
        ));
    }
    if let Some(at) = clipped(a) {
        all.push(format!(
            "the record looks clipped at {:.4} g (first at {:.3} s): {DWELL} or more equal samples at its \
             extreme; the true spectrum is larger or of another shape",
            a[at] / STANDARD_GRAVITY,
            at as f64 * record.dt
        ));
    }
    let lines = spectrum(a, a.len());
    let energy = |lines: &[Complex64]| lines.iter().map(|l| l.norm_sqr()).sum::<f64>();
    let last = lines.len() - lines.len() / 10;
    let part = energy(&lines[last..]) / energy(&lines[1..]).max(f64::MIN_POSITIVE);
    if part > ALIASED {
        all.push(format!(
            "{:.1} % of the record's energy is in the last tenth below {nyquist:.0} Hz, half of the sampling \
             rate: frequencies above it may have been folded into the band; use an anti-aliasing filter",
            100.0 * part
        ));
    }
    Ok(all)
}

/// Where a history first stays at its largest or least value.
fn clipped(a: &[f64]) -> Option<usize> {
    let (low, high) = a
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
            (low.min(v), high.max(v))
        });
    a.windows(DWELL).position(|own| {
        own[0] != 0.0 && [low, high].iter().any(|edge| own.iter().all(|v| v == edge))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(dt: f64, a: impl Fn(f64) -> f64) -> Record {
        Record {
            name: "test".into(),
            dt,
            acceleration: (0..(30.0 / dt) as usize + 1)
                .map(|n| a(n as f64 * dt))
                .collect(),
            origin: "test.csv".into(),
            seed: None,
        }
    }

    #[test]
    fn doubtful_records_are_named() {
        let rule = Rule::ac156(1.0, 0.0, false);
        let sine = |t: f64| 3.0 * (20.0 * t).sin();
        assert_eq!(
            doubts(&rule, &record(0.005, sine)).unwrap(),
            Vec::<String>::new()
        );
        let all = doubts(&rule, &record(0.005, |t| sine(t).clamp(-2.0, 2.0) + 0.5)).unwrap();
        assert!(
            all[0].contains("offset") && all[1].contains("clipped"),
            "{all:?}"
        );
        let fold = |t: f64| sine(t) + (614.0 * t).sin();
        let all = doubts(&rule, &record(0.005, fold)).unwrap();
        assert!(
            all.len() == 1 && all[0].contains("anti-aliasing"),
            "{all:?}"
        );
        let slow = doubts(&rule, &record(0.02, sine)).unwrap_err().to_string();
        assert!(slow.contains("sampled at 50 Hz"), "{slow}");
        let mut short = record(0.005, sine);
        short.acceleration.truncate(200);
        assert!(
            doubts(&rule, &short)
                .unwrap_err()
                .to_string()
                .contains("lasts 1.00 s")
        );
        short.acceleration.resize(900, 0.0);
        assert!(doubts(&rule, &short).unwrap()[0].contains("lasts 4.50 s"));
    }
}
