//! The data that a description names, read as recordings.

use std::path::{Path, PathBuf};

use super::description::{Description, DescriptionError, LeftOut, listed};
use super::{Begin, KINDS, Rig, RigRecording};
use recordings::IdentificationError;
use recordings::{
    Channel, DataError, Pick, Recording, RoundedStamps, Sheet, TimeBase, Wanted, is_called,
    mean_and_deviation,
};

/// Samples that a file must have at least.
const SHORTEST: usize = 128;
/// Least number of samples in the fitted and in the held-out part.
const FEWEST: usize = 64;
/// Mean deviation of the steps from their mean, beyond which samples are not evenly spaced.
const UNEVEN: f64 = 0.5;

/// All data of a rig, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// One per file.
    pub recordings: Vec<RigRecording>,
}

impl Description {
    /// Reads the data: the description's own files, or `files` in their place.
    ///
    /// # Errors
    /// A file that cannot be read, by place; too little data in the fitted or the held-out part.
    pub fn measurement(&self, files: &[PathBuf]) -> Result<Measurement, DescriptionError> {
        let rig = self.rig()?;
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let own: Vec<PathBuf> = self.data.iter().map(|file| folder.join(file)).collect();
        let files = if files.is_empty() { &own } else { files };
        if files.is_empty() {
            return Err(self.wrong("`data` names no file".to_owned()));
        }
        let mut recordings = files
            .iter()
            .map(|file| Ok(self.recording(file, rig, false)?.0))
            .collect::<Result<Vec<_>, DescriptionError>>()?;
        self.leave_out(&mut recordings, files)?;
        compare_all(rig, &mut recordings);
        Ok(Measurement { recordings })
    }

    fn leave_out(
        &self,
        recordings: &mut [RigRecording],
        files: &[PathBuf],
    ) -> Result<(), DescriptionError> {
        match &self.left_out {
            LeftOut::EverySecondBlock(length) => {
                let (length, _) = self.si("left_out.every_second_block", length, "s")?;
                for one in recordings.iter_mut() {
                    let block = (length / one.period()).round().max(1.0) as usize;
                    for (k, out) in one.left_out.iter_mut().enumerate() {
                        *out = (k / block) % 2 == 1;
                    }
                }
            }
            LeftOut::SecondHalf(false) => {
                return Err(self.wrong(
                    "`left_out.second_half` = false holds out no data for the test: expected \
                     true, `every_second_block` or `files`"
                        .to_owned(),
                ));
            }
            LeftOut::SecondHalf(true) => {
                for one in recordings.iter_mut() {
                    let half = one.left_out.len() / 2;
                    one.left_out[half..].fill(true);
                }
            }
            LeftOut::Files(names) => {
                for name in names {
                    let place = files
                        .iter()
                        .position(|file| file.file_name() == name.file_name());
                    let Some(place) = place else {
                        let what = format!(
                            "`left_out.files` names {}, which is not a data file",
                            name.display()
                        );
                        return Err(self.wrong(what));
                    };
                    recordings[place].left_out.fill(true);
                }
            }
        }
        let count = |out: bool| -> usize {
            let all = recordings.iter().flat_map(|one| &one.left_out);
            all.filter(|o| **o == out).count()
        };
        if count(true) < FEWEST || count(false) < FEWEST {
            return Err(self.wrong(format!(
                "`left_out` leaves fewer than {FEWEST} samples on one side"
            )));
        }
        Ok(())
    }

    /// What the file columns of channels are called, each with the channel.
    fn picks(&self, rig: &dyn Rig) -> Result<Vec<Pick<'_>>, DescriptionError> {
        let optional = rig.optional().iter().map(|(channel, _)| *channel);
        let optional = optional.chain(rig.also().iter().copied());
        let mut wanted = rig.inputs().to_vec();
        wanted.push(rig.output());
        let known: Vec<Channel> = wanted
            .iter()
            .copied()
            .chain(optional.clone())
            .chain([Channel::Time])
            .collect();
        let names: Vec<&str> = known.iter().map(|channel| channel.name()).collect();
        if let Some(extra) = self
            .columns
            .keys()
            .find(|key| !names.contains(&key.as_str()))
        {
            return Err(self.wrong(format!(
                "`columns.{extra}` is unknown: expected {}{}",
                names.join(", "),
                units::hint(extra, names.iter().copied())
            )));
        }
        let given = |channel: &Channel| self.columns.contains_key(channel.name());
        wanted.extend(optional.chain([Channel::Time]).filter(given));
        // A velocity or an acceleration is derived from the displacement.
        let is_derived = |channel: &Channel| {
            DERIVED.contains(channel) && !given(channel) && given(&Channel::Displacement)
        };
        wanted
            .into_iter()
            .filter(|channel| !is_derived(channel))
            .map(|channel| {
                let (name, si) = (channel.name(), channel.unit());
                let column = self.columns.get(name).ok_or_else(|| {
                    let found: Vec<&str> = self.columns.keys().map(String::as_str).collect();
                    self.wrong(format!(
                        "`columns.{name}` is missing: a column in {si}; found {}",
                        listed(&found)
                    ))
                })?;
                units::convert(1.0, &column.unit, si)
                    .map_err(|why| self.wrong(format!("`columns.{name}`: {why}")))?;
                Ok(Pick {
                    channel,
                    head: &column.column,
                    unit: &column.unit,
                })
            })
            .collect()
    }

    /// Reads one file, and tells which sample each of its rows is. The output `may_lack` samples,
    /// which are then not a number.
    pub(super) fn recording(
        &self,
        path: &Path,
        rig: &dyn Rig,
        may_lack: bool,
    ) -> Result<(RigRecording, Vec<usize>), DescriptionError> {
        let is_timed = self.columns.contains_key(Channel::Time.name());
        let picks = self.picks(rig)?;
        let heads: Vec<&str> = picks.iter().map(|pick| pick.head).collect();
        let sheet = Sheet::read(
            path,
            Wanted {
                is_column: &|cell| heads.iter().any(|head| is_called(cell, head)),
                header: &heads.join(","),
            },
        )?;
        let name = path
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let mut read = Recording::pick(&sheet, &name, &picks)?;
        if !may_lack && is_timed {
            read = bridged(read);
        }
        let mut channels: Vec<(Channel, Vec<f64>)> = read
            .channels()
            .map(|(channel, values)| (channel, values.to_vec()))
            .collect();
        let all = channels
            .iter()
            .map(|(channel, values)| (*channel, &values[..]));
        for (channel, values) in all.chain(read.stamps().map(|t| (Channel::Time, t))) {
            if may_lack && (channel == rig.output() || rig.also().contains(&channel)) {
                continue;
            }
            if let Some(row) = values.iter().position(|value| !value.is_finite()) {
                let what = format!(
                    "`{}` has no number, expected one in every row",
                    channel.name()
                );
                return Err(DataError::line(path, sheet.line(row), what).into());
            }
        }
        let output = channels
            .iter()
            .find(|(channel, _)| *channel == rig.output());
        if let (false, Some((channel, values))) = (may_lack, output)
            && values.iter().all(|value| Some(value) == values.first())
        {
            let what = format!(
                "`{}` is constant: expected a motion to compare a model with",
                channel.name()
            );
            return Err(DataError::file(path, what).into());
        }
        let rows = if is_timed || !rig.is_path() {
            (0..sheet.len()).collect()
        } else {
            read_repeats_once(&mut channels)
        };
        let samples = channels.first().map_or(0, |(_, values)| values.len());
        let least = if may_lack { 2 } else { SHORTEST };
        if samples < least {
            let what = format!("{samples} samples: expected at least {least}");
            return Err(DataError::file(path, what).into());
        }
        let period = self.period(path, &sheet, &read)?;
        for (derived, from) in DERIVED.into_iter().zip([velocity, acceleration]) {
            if rig.inputs().contains(&derived)
                && channels.iter().all(|own| own.0 != derived)
                && let Some((_, way)) = channels.iter().find(|own| own.0 == Channel::Displacement)
            {
                channels.push((derived, from(way, period)));
            }
        }
        let recorded_period = period;
        let (period, channels) = match &self.reduced_to {
            Some(rate) if !may_lack => {
                let (rate, _) = self.si("reduced_to", rate, "1/s")?;
                reduced(period, channels, rate)
            }
            _ => (period, channels),
        };
        let at_fault = |error: IdentificationError| DataError::file(path, error.to_string());
        let recording = if may_lack {
            let even = TimeBase::Even { start: 0.0, period };
            Recording::measured(&name, even, channels).map_err(at_fault)?
        } else {
            Recording::new(&name, period, channels).map_err(at_fault)?
        };
        let mut recording = RigRecording::new(recording, rig.inputs(), rig.output());
        recording.recorded_period = recorded_period;
        self.begin(&mut recording, rig, may_lack)?;
        Ok((recording, rows))
    }

    /// Time between samples, s.
    fn period(
        &self,
        path: &Path,
        sheet: &Sheet,
        read: &Recording,
    ) -> Result<f64, DescriptionError> {
        match (read.stamps(), &self.time_step) {
            (Some(stamps), _) => even_period(stamps).map_err(|row| {
                DataError::line(path, sheet.line(row), "the times are not evenly spaced").into()
            }),
            (None, Some(step)) => match self.si("time_step", step, "s")?.0 {
                step if step > 0.0 => Ok(step),
                _ => Err(self.wrong("`time_step`: expected more than 0 s".to_owned())),
            },
            (None, None) => {
                Err(self.wrong("neither `columns.time` nor `time_step` is given".to_owned()))
            }
        }
    }

    /// A motion of the output alone, from rest, with inputs that are zero.
    ///
    /// # Errors
    /// A file without that column or with cells that are empty.
    pub(super) fn motion(
        &self,
        path: &Path,
        rig: &dyn Rig,
    ) -> Result<RigRecording, DescriptionError> {
        let mut picks = self.picks(rig)?;
        picks.retain(|pick| [rig.output(), Channel::Time].contains(&pick.channel));
        let heads: Vec<&str> = picks.iter().map(|pick| pick.head).collect();
        let wanted = Wanted {
            is_column: &|cell| heads.iter().any(|head| is_called(cell, head)),
            header: &heads.join(","),
        };
        let sheet = Sheet::read(path, wanted)?;
        let read = Recording::pick(&sheet, "wanted", &picks)?;
        let period = self.period(path, &sheet, &read)?;
        let values = read.samples(rig.output()).to_vec();
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let what = format!(
                "`{}` has no number, expected one in every row",
                rig.output().name()
            );
            return Err(DataError::line(path, sheet.line(row), what).into());
        }
        let rest = vec![0.0; values.len()];
        let inputs = rig.inputs().iter().map(|input| (*input, rest.clone()));
        let channels = inputs.chain([(rig.output(), values)]).collect();
        let recording = Recording::new("wanted", period, channels)
            .map_err(|error| DataError::file(path, error.to_string()))?;
        let mut recording = RigRecording::new(recording, rig.inputs(), rig.output());
        recording.begins = vec![Begin { at: 0, known: 1 }];
        Ok(recording)
    }

    /// Where the simulation of `recording` begins.
    fn begin(
        &self,
        recording: &mut RigRecording,
        rig: &dyn Rig,
        may_lack: bool,
    ) -> Result<(), DescriptionError> {
        if !rig.begins_anew() {
            return match self.windows {
                None => Ok(()),
                Some(_) => Err(self.wrong(format!(
                    "`windows` is for rigs without a restoring force, such as {}; leave it out for \
                     kind {}",
                    listed(&anew()),
                    rig.kind()
                ))),
            };
        }
        if may_lack {
            recording.begin_where_known();
            return Ok(());
        }
        let Some(windows) = &self.windows else {
            return Ok(());
        };
        let samples = |what: &str, quantity| {
            let (length, _) = self.si(what, quantity, "s")?;
            Ok::<_, DescriptionError>((length / recording.period()).round())
        };
        let length = samples("windows.length", &windows.length)?;
        let known = samples("windows.known", &windows.known)?;
        if known < 2.0 || length < 2.0 * known {
            return Err(self.wrong(format!(
                "`windows` of {length} samples, {known} of them known: expected at least 2 known \
                 ones and as many to compare"
            )));
        }
        recording.begin_every(length as usize, known as usize);
        Ok(())
    }
}

/// The recording with short drop-outs bridged, where nothing else has to be changed.
fn bridged(read: Recording) -> Recording {
    let lacks = |values: &[f64]| values.iter().any(|value| !value.is_finite());
    let lacking = read.channels().any(|(_, values)| lacks(values));
    if !lacking || read.stamps().is_none_or(lacks) {
        return read;
    }
    let stamps = read.stamps().map(<[f64]>::to_vec).unwrap_or_default();
    let Ok((mut pieces, _)) = read.clone().on_even_base() else {
        return read;
    };
    match (pieces.pop(), pieces.is_empty()) {
        (Some(mut whole), true) if whole.len() == stamps.len() => {
            whole.time = TimeBase::Stamps(stamps);
            whole
        }
        _ => read,
    }
}

/// What a displacement gives where there is no column of it.
const DERIVED: [Channel; 2] = [Channel::Velocity, Channel::Acceleration];

/// Compares what else a kind puts out wherever every recording has it. One of the output counts as much as the
/// geometric mean of the deviations in the file and in all: a device that rests in a file shows its friction there.
pub(super) fn compare_all(rig: &dyn Rig, recordings: &mut [RigRecording]) {
    let deviation = |channel: Channel, recordings: &[RigRecording]| {
        let values = recordings.iter().flat_map(|one| one.input(channel));
        let values: Vec<f64> = values.copied().filter(|value| value.is_finite()).collect();
        mean_and_deviation(&values).1
    };
    let has = |channel: &&Channel| {
        let mut all = recordings.iter();
        all.all(|one| !one.input(**channel).is_empty())
    };
    let also: Vec<Channel> = rig.also().iter().filter(has).copied().collect();
    if also.is_empty() {
        return;
    }
    let own = deviation(rig.output(), recordings);
    let whole: Vec<f64> = also.iter().map(|one| deviation(*one, recordings)).collect();
    for one in recordings {
        let sizes = also.iter().zip(&whole).map(|(channel, whole)| {
            let in_file = deviation(*channel, std::slice::from_ref(one));
            let size = (in_file * whole).sqrt() / own;
            (
                *channel,
                if size > 0.0 && size.is_finite() {
                    size
                } else {
                    1.0
                },
            )
        });
        let sizes = sizes.collect();
        one.compare_also(sizes);
    }
}

/// Time over which a velocity is the slope of the displacement, s.
const SLOPE: f64 = 0.01;

/// Velocity from samples of a displacement: differences over [`SLOPE`] about each sample.
fn velocity(way: &[f64], period: f64) -> Vec<f64> {
    let reach = ((0.5 * SLOPE / period).round() as usize).max(1);
    let last = way.len().saturating_sub(1);
    (0..way.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(reach), (k + reach).min(last));
            (way[to] - way[from]) / ((to - from).max(1) as f64 * period)
        })
        .collect()
}

/// Acceleration from samples of a displacement: second differences over as long.
fn acceleration(way: &[f64], period: f64) -> Vec<f64> {
    let reach = ((0.5 * SLOPE / period).round() as usize).max(1);
    let last = way.len().saturating_sub(1);
    let step = reach as f64 * period;
    (0..way.len())
        .map(|k| {
            // As it begins and ends.
            let k = k.clamp(
                reach.min(last),
                last.saturating_sub(reach).max(reach.min(last)),
            );
            let (from, to) = (k.saturating_sub(reach), (k + reach).min(last));
            (way[to] - 2.0 * way[k] + way[from]) / (step * step)
        })
        .collect()
}

/// Means of neighbouring samples, as many as bring the rate down towards `rate`.
fn reduced(
    period: f64,
    channels: Vec<(Channel, Vec<f64>)>,
    rate: f64,
) -> (f64, Vec<(Channel, Vec<f64>)>) {
    let count = (1.0 / (period * rate)).floor();
    if count.is_nan() || count < 2.0 {
        return (period, channels);
    }
    let means = |values: Vec<f64>| -> Vec<f64> {
        let own = values.chunks_exact(count as usize);
        own.map(|chunk| chunk.iter().sum::<f64>() / count).collect()
    };
    let channels = channels.into_iter();
    let channels = channels.map(|(channel, values)| (channel, means(values)));
    (period * count, channels.collect())
}

/// Kinds that can restart.
fn anew() -> Vec<&'static str> {
    let kinds = KINDS.into_iter().filter(|rig| rig.begins_anew());
    kinds.map(Rig::kind).collect()
}

/// Mean spacing of even time stamps, s, or that behind rounded ones.
///
/// # Errors
/// The row where they are uneven.
pub fn even_period(stamps: &[f64]) -> Result<f64, usize> {
    let last = stamps.len().saturating_sub(1);
    let ends = stamps.first().zip(stamps.last()).ok_or(0_usize)?;
    let mean = (ends.1 - ends.0) / last as f64;
    let stray = |t: &[f64]| ((t[1] - t[0]) / mean - 1.0).abs() > UNEVEN;
    let uneven = stamps.windows(2).position(stray);
    match uneven.or((mean.is_nan() || mean <= 0.0).then_some(0)) {
        None => Ok(mean),
        Some(row) => RoundedStamps::of(stamps, None)
            .and_then(|rounded| rounded.period)
            .ok_or(row + 1),
    }
}

/// Rows without a time are points of a path, where a row that repeats the one before to rounding
/// says nothing new. Tells which sample each row is.
fn read_repeats_once(channels: &mut [(Channel, Vec<f64>)]) -> Vec<usize> {
    let rows = channels.first().map_or(0, |(_, values)| values.len());
    let near: Vec<f64> = channels
        .iter()
        .map(|(_, values)| 1e-10 * values.iter().fold(0.0, |size: f64, c| size.max(c.abs())))
        .collect();
    let new: Vec<bool> = (0..rows)
        .map(|k| {
            let mut pairs = channels.iter().zip(&near);
            k == 0 || pairs.any(|((_, v), near)| (v[k] - v[k - 1]).abs() > *near)
        })
        .collect();
    for (_, values) in channels {
        let mut keep = new.iter();
        values.retain(|_| keep.next() == Some(&true));
    }
    let kept = new.iter().scan(0usize, |kept, is_new| {
        *kept += usize::from(*is_new);
        Some(kept.saturating_sub(1))
    });
    kept.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_repeat_are_read_once() {
        let mut channels = [
            (
                Channel::Displacement,
                vec![0.0, 1.0, 1.0, 1.0, 2.0, 2.0 + 1e-14],
            ),
            (Channel::Velocity, vec![0.0, 5.0, 5.0, 6.0, 7.0, 7.0]),
        ];
        let rows = read_repeats_once(&mut channels);
        assert_eq!(rows, [0, 1, 1, 2, 3, 3]);
        assert_eq!(channels[0].1, [0.0, 1.0, 1.0, 2.0]);
        assert_eq!(channels[1].1, [0.0, 5.0, 6.0, 7.0]);
    }

    #[test]
    fn a_few_empty_cells_are_bridged_and_a_fast_record_is_reduced_to_means() {
        let stamps: Vec<f64> = (0..100).map(|k| 0.001 * f64::from(k)).collect();
        let mut ramp: Vec<f64> = (0..100).map(f64::from).collect();
        ramp[40..43].fill(f64::NAN);
        let channels = vec![(Channel::Displacement, ramp)];
        let read = Recording::measured("ramp", TimeBase::Stamps(stamps), channels).unwrap();
        let whole = bridged(read);
        let values = whole.samples(Channel::Displacement).to_vec();
        assert!((values[41] - 41.0).abs() < 1e-9);
        let (period, channels) = reduced(0.001, vec![(Channel::Displacement, values)], 250.0);
        assert!((period - 0.004).abs() < 1e-12);
        assert_eq!(channels[0].1.len(), 25);
        assert!((channels[0].1[3] - 13.5).abs() < 1e-9);
    }

    #[test]
    fn stamps_that_were_rounded_tell_the_period_behind_them() {
        let exact: Vec<f64> = (0..400).map(|k| 0.004 * f64::from(k)).collect();
        assert!((even_period(&exact).unwrap() - 0.004).abs() < 1e-12);
        let rounded: Vec<f64> = exact.iter().map(|t| (t * 100.0).round() / 100.0).collect();
        assert!((even_period(&rounded).unwrap() - 0.004).abs() < 1e-9);
        let gap: Vec<f64> = exact
            .iter()
            .map(|t| if *t > 1.0 { t + 0.1 } else { *t })
            .collect();
        assert_eq!(even_period(&gap), Err(251));
    }

    #[test]
    fn a_velocity_is_derived_from_a_displacement() {
        let way: Vec<f64> = (0..1000).map(|k| (0.02 * f64::from(k)).sin()).collect();
        // 4 rad/s at 200 Hz: a difference over 10 ms is short by (0.02)^2/6.
        for (k, v) in velocity(&way, 0.005).iter().enumerate().take(999).skip(1) {
            let exact = 4.0 * (0.02 * k as f64).cos();
            assert!((v - exact).abs() < 1e-3, "{k}: {v}, {exact}");
        }
        assert_eq!(velocity(&[1.0], 0.1), [0.0]);
    }
}
