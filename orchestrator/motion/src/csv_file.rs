//! CSV files of motions: the columns of a record or a reference, evenly sampled and whole.
//!
//! The header is `t_s,a_g`, or cells with units: `time [s], acceleration [in/s^2]`.

use std::path::Path;

use recordings::{Channel, DataError, Recording, RoundedStamps, Sheet, Text, Wanted, known_column};

use super::MotionError;
use units::{nearest, split_header};

/// What the file is read as, which says what columns it may have.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Time and acceleration.
    Record,
    /// Time, displacement, velocity and acceleration.
    Reference,
}

impl Kind {
    fn channels(self) -> &'static [Channel] {
        const ALL: &[Channel] = &[
            Channel::Time,
            Channel::Acceleration,
            Channel::Displacement,
            Channel::Velocity,
        ];
        match self {
            Kind::Record => &ALL[..2],
            Kind::Reference => ALL,
        }
    }

    fn header(self) -> &'static str {
        match self {
            Kind::Record => "`t_s,a_g` or `time [s],acceleration [g]`",
            Kind::Reference => {
                "`time [s],displacement [in],velocity [in/s],acceleration [g]` (any units)"
            }
        }
    }
}

/// The columns of a motion in SI units, with their sheet.
pub(super) struct CsvFile {
    kind: Kind,
    sheet: Sheet,
    columns: Recording,
}

impl CsvFile {
    /// Reads the text of a file.
    pub(super) fn parse(path: &Path, text: Text, kind: Kind) -> Result<Self, MotionError> {
        let wanted = Wanted {
            is_column: &|cell| known_column(cell).is_some(),
            header: kind.header(),
        };
        let sheet = Sheet::parse(path, text, wanted)?;
        check_header(&sheet, kind)?;
        // No cell of a motion may be empty, so this is asked first.
        for (place, head) in sheet.heads().iter().enumerate() {
            sheet.full_column(place, head)?;
        }
        let columns = Recording::from_sheet(&sheet, "motion")?;
        if let Some(announced) = announced_points(sheet.comments())
            && sheet.len() < announced
        {
            return Err(MotionError::Truncated {
                path: path.to_path_buf(),
                found: sheet.len(),
                announced,
            });
        }
        Ok(Self {
            kind,
            sheet,
            columns,
        })
    }

    /// The values of a column, SI.
    pub(super) fn column(&self, channel: Channel) -> Result<Vec<f64>, MotionError> {
        let found = self.columns.channel(channel).map(<[f64]>::to_vec);
        found.ok_or_else(|| {
            let name = channel.name();
            self.in_header(format!(
                "no column `{name}`; expected {}",
                self.kind.header()
            ))
        })
    }

    fn in_header(&self, reason: String) -> MotionError {
        DataError::line(self.sheet.file(), self.sheet.header_line(), reason).into()
    }

    /// The time step, s, of evenly spaced time stamps.
    pub(super) fn sample_time(&self) -> Result<f64, MotionError> {
        let Some(time) = self.columns.stamps() else {
            return Err(self.in_header(format!(
                "dt is missing: no column of time; expected {}",
                self.kind.header()
            )));
        };
        let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let Some(&usual) = steps.get(steps.len() / 2) else {
            let reason = "only one point; the time step is unknown";
            return Err(DataError::file(self.sheet.file(), reason).into());
        };
        // Printed times are rounded: a twentieth of a step is not yet uneven.
        let is_even = |pair: &[f64]| {
            let step = pair[1] - pair[0];
            usual > 0.0 && (step - usual).abs() <= 0.05 * usual
        };
        if let Some(index) = time.windows(2).position(|pair| !is_even(pair)) {
            if let Some(period) = RoundedStamps::of(time, None).and_then(|rounded| rounded.period) {
                return Ok(rounded(period));
            }
            let step = rounded(time[index + 1] - time[index]);
            let reason = match usual > 0.0 {
                true => format!(
                    "uneven time stamps: a step of {step} s, expected {} s",
                    rounded(usual)
                ),
                false => format!(
                    "the time does not grow: a step of {step} s; expected rising, even time stamps"
                ),
            };
            let line = self.sheet.line(index + 1);
            return Err(DataError::line(self.sheet.file(), line, reason).into());
        }
        let mean = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
        Ok(if (mean - usual).abs() < 1e-6 * usual {
            rounded(usual)
        } else {
            mean
        })
    }
}

/// Nine significant digits: 0.005, not 0.0049999999999954525.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

/// Refuses columns that the kind of file has not.
fn check_header(sheet: &Sheet, kind: Kind) -> Result<(), MotionError> {
    for (index, head) in sheet.heads().iter().enumerate() {
        let channel = known_column(head);
        if channel.is_some_and(|channel| kind.channels().contains(&channel)) {
            continue;
        }
        let (name, _) = split_header(head);
        let known = kind.channels().iter().map(|channel| channel.name());
        let hint = match (kind, channel, nearest(name, known.chain(["t_s", "a_g"]))) {
            (Kind::Record, Some(Channel::Displacement | Channel::Velocity), _) => {
                "a file with it is a reference (--reference)".to_string()
            }
            (_, _, Some(near)) => format!("did you mean `{near}`? Expected {}", kind.header()),
            (_, _, None) => format!("expected {}", kind.header()),
        };
        let reason = format!("unknown column `{name}` (column {}); {hint}", index + 1);
        return Err(DataError::line(sheet.file(), sheet.header_line(), reason).into());
    }
    Ok(())
}

/// The number after `npts=` in a comment line, when one says it.
fn announced_points(comments: &[String]) -> Option<usize> {
    comments.iter().find_map(|line| {
        let (_, rest) = line.split_once("npts=")?;
        let digits: String = rest
            .trim_start()
            .chars()
            .take_while(char::is_ascii_digit)
            .collect();
        digits.parse().ok()
    })
}
