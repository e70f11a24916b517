//! Dwells at a channel's extreme: a clipped sensor's, or those of a converter with coarse steps where the
//! motion turns.

/// Samples to either side of a dwell that tell where the signal was going.
const FLANK: (usize, usize) = (3, 12);
/// Steps of the converter by which a signal must have been going beyond its extreme: rounding and the noise
/// that it rounds leave less.
const BEYOND: f64 = 2.0;

/// Largest distance from a dwell to the next reading, in steps of the converter, if the signal only
/// turned. A parabola that stays within a step for four samples falls by two and a quarter to the
/// next one.
const NEXT: f64 = 3.0;

/// Equal readings in a row that chance does not make.
pub const RUN: usize = 4;

/// Where a signal was cut off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clipped {
    /// Samples at either extreme, in dwells from which the signal went on beyond.
    pub samples: usize,
    /// The least and the largest reading.
    pub extremes: [f64; 2],
    /// See [`step`].
    pub step: f64,
}

impl Clipped {
    /// Of the readings `values` of a signal that itself ends at `limit` to either side.
    pub fn of(values: &[f64], limit: f64) -> Self {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let extremes = [least, largest];
        let step = step(values);
        let dwells = extremes.map(|extreme| runs(values, |value| value == extreme));
        let cut = dwells.iter().flatten().filter(|(start, end)| {
            let is_long = end - start >= RUN && least < largest;
            is_long && values[*start].abs() < limit && cuts_a_peak(values, *start, *end, step)
        });
        Self {
            samples: cut.map(|(start, end)| end - start).sum(),
            extremes,
            step,
        }
    }
}

/// Stretches `first..end` of values that are so.
pub(super) fn runs(values: &[f64], is: impl Fn(f64) -> bool) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut first = None;
    for (at, &value) in values.iter().enumerate() {
        match (is(value), first) {
            (true, None) => first = Some(at),
            (false, Some(start)) => {
                found.push((start, at));
                first = None;
            }
            _ => {}
        }
    }
    if let Some(start) = first {
        found.push((start, values.len()));
    }
    found
}

/// Usual distance between neighbouring levels of `values`: a converter's step where it is coarse.
pub fn step(values: &[f64]) -> f64 {
    let mut levels = values.to_vec();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut gaps: Vec<f64> = levels.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(0.0)
}

/// Whether the signal exceeded the level of `values[start..end]`. Either a parabola through the
/// samples to either side passes that level by more than two of the converter's steps, or the next
/// reading is farther away than after a turn. A dwell at the end of a record, of which nothing is
/// known on one side, counts as one.
fn cuts_a_peak(values: &[f64], start: usize, end: usize, step: f64) -> bool {
    let flank = ((end - start) / 2).clamp(FLANK.0, FLANK.1);
    let flank = flank.min(start).min(values.len().saturating_sub(end));
    if flank < 2 || end <= start {
        return true;
    }
    let level = values[start];
    let next = [values[start - 1], values[end]].map(|value| (value - level).abs());
    if next[0].max(next[1]) > NEXT * step {
        return true;
    }
    let middle = 0.5 * (start + end - 1) as f64;
    // The even part of the flanks about the middle, against the square of the distance from it.
    let pairs: Vec<(f64, f64)> = (0..flank)
        .map(|i| {
            let (left, right) = (start - 1 - i, end + i);
            let even = 0.5 * (values[left] + values[right]) - level;
            ((right as f64 - middle).powi(2), even)
        })
        .collect();
    let count = flank as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (square, even) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let spread: f64 = pairs.iter().map(|pair| (pair.0 - square).powi(2)).sum();
    let along: f64 = pairs.iter().map(|pair| (pair.0 - square) * pair.1).sum();
    let peak = even - along / spread * square;
    // Away from the flanks.
    -even.signum() * peak > BEYOND * step
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of `peak` steps in readings of whole steps, and where it dwells at its greatest.
    fn dwells(peak: f64, highest: f64) -> Vec<bool> {
        let wave = |k: usize| (peak * (0.03 * k as f64).sin()).min(highest).round();
        let values: Vec<f64> = (0..1000).map(wave).collect();
        assert_eq!(step(&values), 1.0);
        let top = values.iter().copied().fold(f64::MIN, f64::max);
        let mut found = Vec::new();
        let mut k = 0;
        while k < values.len() {
            let end = (k..values.len()).find(|j| values[*j] != values[k]);
            let end = end.unwrap_or(values.len());
            if values[k] == top {
                assert!(end - k >= 4);
                found.push(cuts_a_peak(&values, k, end, 1.0));
            }
            k = end;
        }
        found
    }

    #[test]
    fn a_dwell_is_cut_where_the_next_reading_is_far_or_nothing_is_known() {
        // Four steps below on one side alone; what is farther away hardly rises.
        let left = [96.0, 96.0, 96.0];
        let right = [99.0, 98.0, 98.0];
        let values = [&left[..], &[100.0; 4], &right].concat();
        assert!(cuts_a_peak(&values, 3, 7, 1.0));
        assert!(!cuts_a_peak(&values, 3, 7, 2.0));
        let turned: Vec<f64> = values.iter().rev().copied().collect();
        assert!(cuts_a_peak(&turned, 3, 7, 1.0));
        // Of one sample to a side nothing follows, nor of no dwell.
        let flat = [99.0, 100.0, 100.0, 100.0, 99.0, 99.0, 99.0];
        assert!(cuts_a_peak(&flat, 1, 4, 1.0));
        assert!(cuts_a_peak(&[99.0; 9], 4, 4, 1.0));
        // In the lowest readings as in the highest.
        let lowest: Vec<f64> = values.iter().map(|value| -value).collect();
        assert!(cuts_a_peak(&lowest, 3, 7, 1.0) && !cuts_a_peak(&lowest, 3, 7, 2.0));
    }

    #[test]
    fn what_is_cut_off_is_counted_but_at_the_end_of_the_signal_itself() {
        let wave = |k: usize| (0.05 * k as f64).sin().clamp(-0.5, 0.8);
        let values: Vec<f64> = (0..1000).map(wave).collect();
        let at = |level: f64| values.iter().filter(|value| **value == level).count();
        let clipped = Clipped::of(&values, f64::INFINITY);
        assert_eq!(clipped.extremes, [-0.5, 0.8]);
        assert_eq!(clipped.samples, at(-0.5) + at(0.8));
        assert_eq!(Clipped::of(&values, 0.8).samples, at(-0.5));
        assert_eq!(Clipped::of(&values, 0.5).samples, 0);
        // Neither a wave with all of its peaks nor a constant.
        let whole: Vec<f64> = (0..1000).map(|k| (0.05 * k as f64).sin()).collect();
        assert_eq!(Clipped::of(&whole, f64::INFINITY).samples, 0);
        assert_eq!(Clipped::of(&[1.0; 50], f64::INFINITY).samples, 0);
    }

    #[test]
    fn coarse_steps_are_not_taken_for_clipping() {
        for peak in [20.0, 60.3, 150.0] {
            let natural = dwells(peak, f64::INFINITY);
            assert!(
                !natural.is_empty() && natural.iter().all(|cut| !cut),
                "{peak}"
            );
            let clipped = dwells(peak, 0.8 * peak);
            assert!(
                !clipped.is_empty() && clipped.iter().all(|cut| *cut),
                "{peak}"
            );
        }
    }
}
