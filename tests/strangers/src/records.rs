//! Known effects added to a column of a real record.

use serde::{Deserialize, Serialize};

/// An effect that is added to an output, with its size in the column's unit, in seconds or as a share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Added {
    /// Late by this, s.
    Delay(f64),
    /// Larger by this share.
    Gain(f64),
    /// Higher by this.
    Zero(f64),
    /// Free travel to either side.
    Play(f64),
    /// `1 + q` above zero and `1 - q` below.
    Asymmetry(f64),
    /// Nothing within this of zero.
    DeadBand(f64),
}

impl Added {
    /// Parts of the names that say it.
    pub fn words(self) -> &'static [&'static str] {
        match self {
            Self::Delay(_) => &["delay", "late"],
            Self::Gain(_) => &["scale", "gain"],
            Self::Zero(_) => &["zero", "bias", "offset"],
            Self::Play(_) => &["play", "backlash", "lost_motion", "hysteresis"],
            Self::Asymmetry(_) => &["asymmetr", "direction"],
            Self::DeadBand(_) => &["dead_band", "slack", "gap"],
        }
    }

    /// Parts of the names that say something else with one of these words.
    pub fn others(self) -> &'static [&'static str] {
        match self {
            Self::Gain(_) => &["asymmetr", "null", "loop"],
            _ => &[],
        }
    }

    /// Its size and, for what has the column's unit, `None` as unit.
    pub fn size(self) -> (f64, Option<&'static str>) {
        match self {
            Self::Delay(s) => (s, Some("s")),
            Self::Gain(share) | Self::Asymmetry(share) => (share, Some("1")),
            Self::Zero(s) | Self::Play(s) | Self::DeadBand(s) => (s, None),
        }
    }

    /// The values of a channel with it, sampled every `step` seconds.
    pub fn to(self, values: &[f64], step: f64) -> Vec<f64> {
        let mut linkage = values.first().copied().unwrap_or_default();
        let at = |k: usize| {
            let Self::Delay(delay) = self else {
                return values[k];
            };
            let place = (k as f64 - delay / step).max(0.0);
            let (whole, share) = (place.floor() as usize, place.fract());
            values[whole] * (1.0 - share) + values[(whole + 1).min(values.len() - 1)] * share
        };
        let with = |y: f64, linkage: &mut f64| match self {
            Self::Delay(_) => y,
            Self::Gain(share) => y * (1.0 + share),
            Self::Zero(zero) => y + zero,
            Self::Play(width) => {
                *linkage = linkage.clamp(y - width, y + width);
                *linkage
            }
            Self::Asymmetry(q) => y * (1.0 + q * y.signum()),
            Self::DeadBand(width) => y - y.clamp(-width, width),
        };
        (0..values.len())
            .map(|k| with(at(k), &mut linkage))
            .collect()
    }
}

/// The text of a comma-separated file with one column changed.
pub fn changed(
    text: &str,
    column: &str,
    change: impl FnOnce(&[f64]) -> Vec<f64>,
) -> Option<String> {
    let mut lines = text.lines();
    let head = lines.next()?;
    let place = head.split(',').position(|cell| cell.trim() == column)?;
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let values: Option<Vec<f64>> = rows
        .iter()
        .map(|row| row.get(place)?.trim().parse().ok())
        .collect();
    let mut out = format!("{head}\n");
    for (row, value) in rows.iter().zip(change(&values?)) {
        let cell = format!("{value}");
        let cells = row
            .iter()
            .enumerate()
            .map(|(i, old)| if i == place { cell.as_str() } else { old });
        out.push_str(&cells.collect::<Vec<_>>().join(","));
        out.push('\n');
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_changed_and_the_others_are_left() {
        let text = "t,y\n0,1\n1,-2\n2,4\n";
        let with = |added: Added| changed(text, "y", |y| added.to(y, 1.0));
        assert_eq!(
            with(Added::Delay(0.5)).as_deref(),
            Some("t,y\n0,1\n1,-0.5\n2,1\n")
        );
        assert_eq!(
            with(Added::Asymmetry(0.5)).as_deref(),
            Some("t,y\n0,1.5\n1,-1\n2,6\n")
        );
        assert_eq!(
            with(Added::Play(1.0)).as_deref(),
            Some("t,y\n0,1\n1,-1\n2,3\n")
        );
        assert_eq!(changed(text, "z", <[f64]>::to_vec), None);
    }
}
