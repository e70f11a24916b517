//! From what was measured to recordings on an even time base: drop-outs, uneven stamps, gaps.

use std::cmp::Ordering;

use super::clipping::runs;
use super::{Finding, Recording, RoundedStamps, TimeBase};
use crate::IdentificationError;

/// Missing samples up to this many in a row are bridged by a straight line.
const LONGEST_BRIDGE: usize = 5;
/// Time stamps may stray from the even grid by this part of the period.
const JITTER: f64 = 0.02;

impl Recording {
    /// Puts a recording on a regular time base. Short drop-outs (NaN) are bridged, rounded stamps
    /// are restored, uneven ones are interpolated, and the recording is cut at longer gaps. Each
    /// piece is a recording of its own; every change is reported.
    ///
    /// # Errors
    /// No time, time that does not increase, fewer than two samples.
    pub fn on_even_base(self) -> Result<(Vec<Self>, Vec<Finding>), IdentificationError> {
        let Self {
            name,
            source,
            time,
            notes,
            left_alone,
            mut channels,
        } = self;
        let unreadable = |what: String, expected| IdentificationError::Unreadable {
            recording: name.clone(),
            what,
            expected,
        };
        let mut time = match time {
            TimeBase::Stamps(stamps) => stamps,
            even @ TimeBase::Even { .. } => {
                let whole = Self {
                    name,
                    source,
                    time: even,
                    notes,
                    left_alone,
                    channels,
                };
                let faults = whole.faults();
                return Ok((vec![whole], faults));
            }
            TimeBase::Unknown => {
                return Err(unreadable(
                    "no column `time`".into(),
                    "time stamps, for example `time [s]`",
                ));
            }
        };
        if time.len() < 2 {
            return Err(unreadable(
                format!("{} samples", time.len()),
                "at least two rows of numbers",
            ));
        }
        let mut findings = Vec::new();
        let mut tell = |what: String| {
            findings.push(Finding {
                recording: name.clone(),
                what,
            });
        };
        notes.into_iter().for_each(&mut tell);
        let increases = |pair: &[f64]| pair[1].partial_cmp(&pair[0]) == Some(Ordering::Greater);
        let turn = time.windows(2).position(|pair| !increases(pair));
        let mut period = even_period(&time);
        let mut uneven = strays(&time, period);
        if turn.is_some() || uneven > 0 {
            let rounded = RoundedStamps::of(&time, None);
            if let Some((step, even)) = rounded.and_then(|r| Some((r.step, r.period?))) {
                tell(format!(
                    "time stamps are rounded to {step} s; a sampling period of {even:.6} s ({:.3} \
                     Hz) explains them all and is used",
                    1.0 / even
                ));
                (period, uneven) = (even, 0);
                let start = time[0];
                for (k, t) in time.iter_mut().enumerate() {
                    *t = start + k as f64 * even;
                }
            } else if let Some(at) = turn {
                let rounded = rounded.filter(|_| time[at + 1] == time[at]).map_or(
                    String::new(),
                    |r| {
                        format!(
                            "; the stamps are rounded to {} s, and no constant rate explains them \
                             all",
                            r.step
                        )
                    },
                );
                return Err(unreadable(
                    format!(
                        "time does not increase at row {} ({} s){rounded}",
                        at + 2,
                        time[at + 1]
                    ),
                    "time stamps that increase",
                ));
            }
        }
        if uneven > 0 {
            tell(format!(
                "uneven time stamps: {uneven} of {} steps differ from {:.6} s by more than {:.0} \
                 %; interpolated to a regular time base",
                time.len() - 1,
                period,
                100.0 * JITTER
            ));
        }

        let mut missing = vec![false; time.len()];
        for (channel, values) in &mut channels {
            let runs = runs(values, |value| !value.is_finite());
            for &(first, end) in &runs {
                let inside = first > 0 && end < values.len();
                if inside && end - first <= LONGEST_BRIDGE {
                    bridge(values, first, end);
                } else {
                    missing[first..end].fill(true);
                }
            }
            if let Some(&(first, end)) = runs.first() {
                let count: usize = runs.iter().map(|run| run.1 - run.0).sum();
                tell(format!(
                    "drop-outs in `{}`: {count} samples in {} places, the first at \
                     {:.3} s ({} samples)",
                    channel.name(),
                    runs.len(),
                    time[first],
                    end - first
                ));
            }
        }

        let mut pieces = Vec::new();
        let mut first = 0;
        for at in 0..time.len() {
            let gap = at > first && time[at] - time[at - 1] > 1.5 * period;
            if gap {
                tell(format!(
                    "gap of {:.3} s at {:.3} s; the recording is cut there",
                    time[at] - time[at - 1],
                    time[at - 1]
                ));
            }
            if gap || missing[at] {
                pieces.push((first, at));
                first = if missing[at] { at + 1 } else { at };
            }
        }
        pieces.push((first, time.len()));
        pieces.retain(|piece| piece.1 > piece.0 + 1);
        let several = pieces.len() > 1;
        let recordings = pieces
            .iter()
            .enumerate()
            .map(|(index, &(first, end))| Self {
                name: if several {
                    format!("{name} (part {})", index + 1)
                } else {
                    name.clone()
                },
                source: source.clone(),
                time: TimeBase::Even {
                    start: time[first],
                    period,
                },
                notes: Vec::new(),
                left_alone: left_alone.clone(),
                channels: channels
                    .iter()
                    .map(|(channel, values)| {
                        let values = if uneven > 0 {
                            interpolate(&time[first..end], &values[first..end], period)
                        } else {
                            values[first..end].to_vec()
                        };
                        (*channel, values)
                    })
                    .collect(),
            })
            .collect::<Vec<_>>();
        for recording in &recordings {
            findings.extend(recording.faults());
        }
        Ok((recordings, findings))
    }
}

/// Steps that are not a multiple of the period.
fn strays(time: &[f64], period: f64) -> usize {
    let strays = |pair: &&[f64]| {
        let steps = (pair[1] - pair[0]) / period;
        (steps - steps.round().max(1.0)).abs() > JITTER
    };
    time.windows(2).filter(strays).count()
}

/// The step of the even base: the median step, refined over the whole recording where no gap
/// forbids it.
fn even_period(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let median = steps[steps.len() / 2];
    let whole = (time[time.len() - 1] - time[0]) / steps.len() as f64;
    let even = if (whole / median - 1.0).abs() < 0.01 {
        whole
    } else {
        median
    };
    // Stamps are decimal: 0.002 s must not become 0.0019999999.
    let rounded = (even * 1e9).round() / 1e9;
    if rounded > 0.0 { rounded } else { even }
}

fn bridge(values: &mut [f64], first: usize, end: usize) {
    let (from, to) = (values[first - 1], values[end]);
    let span = (end - first + 1) as f64;
    for at in first..end {
        values[at] = from + (to - from) * (at - first + 1) as f64 / span;
    }
}

fn interpolate(time: &[f64], values: &[f64], period: f64) -> Vec<f64> {
    let last = time.len() - 1;
    let count = ((time[last] - time[0]) / period + 1e-6).floor() as usize + 1;
    let mut at = 0;
    (0..count)
        .map(|k| {
            let t = time[0] + k as f64 * period;
            while at + 1 < last && time[at + 1] <= t {
                at += 1;
            }
            let part = ((t - time[at]) / (time[at + 1] - time[at])).clamp(0.0, 1.0);
            values[at] + part * (values[at + 1] - values[at])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::Channel;
    use super::*;

    fn wave(count: usize) -> Vec<f64> {
        (0..count).map(|k| (0.7 * k as f64).sin()).collect()
    }

    fn even(count: usize) -> Vec<f64> {
        (0..count).map(|k| k as f64 * 0.002).collect()
    }

    const FORCE: Channel = Channel::ActuatorForce;

    fn measured(time: &[f64], values: Vec<f64>) -> Recording {
        let time = TimeBase::Stamps(time.to_vec());
        Recording::measured("a.csv", time, vec![(FORCE, values)]).unwrap()
    }

    fn read(time: &[f64], values: Vec<f64>) -> (Vec<Recording>, String) {
        let (recordings, findings) = measured(time, values).on_even_base().unwrap();
        let text = findings.iter().map(ToString::to_string).collect::<Vec<_>>();
        (recordings, text.join("\n"))
    }

    #[test]
    fn a_clean_recording_has_no_findings() {
        let (recordings, findings) = read(&even(500), wave(500));
        assert_eq!(findings, "");
        assert_eq!(recordings[0].period(), 0.002);
        assert_eq!(recordings[0].channel(FORCE).unwrap(), wave(500));
    }

    #[test]
    fn faults_are_named_with_their_place() {
        let mut values = wave(500);
        values[100..102].fill(f64::NAN);
        let (recordings, findings) = read(&even(500), values);
        assert!(findings.contains(
            "drop-outs in `actuator_force`: 2 samples in 1 places, the first at 0.200 s"
        ));
        assert_eq!(recordings.len(), 1);

        let mut values = wave(500);
        values[100..150].fill(f64::NAN);
        let (recordings, _) = read(&even(500), values);
        assert_eq!((recordings.len(), recordings[1].len()), (2, 350));

        let mut time = even(500);
        time[200..].iter_mut().for_each(|t| *t += 0.5);
        let (recordings, findings) = read(&time, wave(500));
        assert!(findings.contains("gap of 0.502 s at 0.398 s"), "{findings}");
        assert_eq!((recordings[0].len(), recordings[1].len()), (200, 300));
        assert!((recordings[1].time_at(0) - 0.9).abs() < 1e-12);

        let clipped = wave(500).iter().map(|v| v.clamp(-0.2, 0.2)).collect();
        assert!(
            read(&even(500), clipped)
                .1
                .contains("`actuator_force` is clipped")
        );

        let mut stuck = wave(500);
        stuck[50..100].fill(0.25);
        assert!(
            read(&even(500), stuck)
                .1
                .contains("repeats for 0.100 s from 0.100 s")
        );
        assert!(
            read(&even(500), vec![3.0; 500])
                .1
                .contains("`actuator_force` is constant")
        );
    }

    #[test]
    fn a_part_has_its_number_in_its_name_where_there_are_several() {
        let mut values = wave(500);
        assert_eq!(read(&even(500), values.clone()).0[0].name, "a.csv");
        // A sample by itself is not a part.
        values[100..150].fill(f64::NAN);
        values[151..200].fill(f64::NAN);
        let (recordings, _) = read(&even(500), values);
        let parts: Vec<_> = recordings
            .iter()
            .map(|own| (&*own.name, own.len()))
            .collect();
        assert_eq!(parts, [("a.csv (part 1)", 100), ("a.csv (part 2)", 300)]);
    }

    #[test]
    fn uneven_stamps_are_put_on_an_even_base() {
        let time: Vec<f64> = (0..500)
            .map(|k| (k as f64 + 0.3 * (k as f64).sin()) * 0.002)
            .collect();
        let values = time.iter().map(|t| 3.0 * t).collect();
        let (recordings, findings) = read(&time, values);
        assert!(findings.contains("uneven time stamps"), "{findings}");
        let values = recordings[0].channel(FORCE).unwrap();
        let period = recordings[0].period();
        for (k, value) in values.iter().enumerate() {
            let line = 3.0 * (time[0] + k as f64 * period);
            assert!((value - line).abs() < 1e-9);
        }
    }

    #[test]
    fn rounded_stamps_get_back_their_even_base() {
        let time: Vec<f64> = (0..2000).map(|k| f64::from(k / 5) * 0.01).collect();
        let (recordings, findings) = read(&time, wave(2000));
        assert_eq!(recordings[0].period(), 0.002);
        assert_eq!(recordings[0].channel(FORCE).unwrap(), wave(2000));
        assert!(findings.contains("rounded to 0.01 s"), "{findings}");
        assert!(findings.contains("500.000 Hz"), "{findings}");

        let mut holed = time.clone();
        holed.drain(800..830);
        let error = measured(&holed, wave(1970))
            .on_even_base()
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("rounded to 0.01 s, and no constant rate explains them all"),
            "{error}"
        );
    }

    #[test]
    fn time_that_turns_back_is_refused_by_row() {
        let error = measured(&[0.0, 0.1, 0.05], vec![0.0; 3])
            .on_even_base()
            .unwrap_err();
        assert_eq!(
            error.to_string(),
            "a.csv: time does not increase at row 3 (0.05 s); expected time stamps that increase"
        );
    }
}
