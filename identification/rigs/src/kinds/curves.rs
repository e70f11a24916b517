//! Measured and simulated output over a record, for pictures and for those who draw their own.

use std::io::{Read, Write};

use super::diagnosis::RigDiagnosis;
use super::measured::Measured;
use super::parts::{EVERYTHING, InParts};
use super::{Description, DescriptionError, Measurement, RigRecording};
use diagnosis::completed;
use recordings::Channel;

/// Curves of one record, one sample per row, SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curves {
    /// The record.
    pub record: String,
    /// Whether the data have a time.
    pub is_timed: bool,
    /// s; samples where the data have no time.
    pub time: Vec<f64>,
    /// The rig's first input.
    pub input: Vec<f64>,
    /// The measured output.
    pub measured: Vec<f64>,
    /// That of the nominal model.
    pub nominal: Vec<f64>,
    /// That of the extended model.
    pub extended: Vec<f64>,
    /// True where the sample was left out of the fit.
    pub left_out: Vec<bool>,
}

const TIME: &str = "time [s]";
/// Columns of the file of [`write`].
const COLUMNS: [&str; 7] = [
    "record", "time", "input", "measured", "nominal", "extended", "left_out",
];

/// Curves of every record.
///
/// # Errors
/// When the description does not fit the rig.
pub fn curves(
    description: &Description,
    measurement: &Measurement,
    found: &RigDiagnosis,
) -> Result<Vec<Curves>, DescriptionError> {
    let rig = description.rig()?;
    let nominal = description.nominal(rig)?;
    let measured = Measured::new(rig, measurement, nominal);
    let origin = completed(&measured, &measured.origin(), None, EVERYTHING);
    let is_timed = description.columns.contains_key("time");
    let step = |one: &RigRecording| if is_timed { one.period() } else { 1.0 };
    let input = description.rig()?.inputs().first().copied();
    let all = measurement
        .recordings
        .iter()
        .enumerate()
        .map(|(s, one)| Curves {
            record: one.name().to_owned(),
            is_timed,
            time: (0..one.len()).map(|k| k as f64 * step(one)).collect(),
            input: input.map_or_else(Vec::new, |input| one.input(input).to_vec()),
            measured: one.output()[..one.len()].to_vec(),
            nominal: measured.simulate_to(&origin, s, one.len()),
            extended: measured.simulate_to(&found.confirmed.point, s, one.len()),
            left_out: one.left_out[..one.len()].to_vec(),
        });
    Ok(all.collect())
}

/// Writes `curves` as CSV, SI; every number reads back to the same bits. `input` and `output` are
/// the rig's.
///
/// # Errors
/// A disk that is full, and the like.
pub fn write(
    curves: &[Curves],
    input: Channel,
    output: Channel,
    file: impl Write,
) -> Result<(), csv::Error> {
    let mut csv = csv::Writer::from_writer(file);
    let is_timed = curves.iter().all(|one| one.is_timed);
    csv.write_record(COLUMNS.map(|column| match column {
        "time" if is_timed => TIME.to_string(),
        "time" => "sample".to_string(),
        "input" => format!("{} [{}]", input.name(), input.unit()),
        "measured" => format!("measured {} [{}]", output.name(), output.unit()),
        other => other.to_string(),
    }))?;
    for one in curves {
        for k in 0..one.time.len() {
            csv.serialize((
                &one.record,
                one.time[k],
                one.input[k],
                one.measured[k],
                one.nominal[k],
                one.extended[k],
                u8::from(one.left_out[k]),
            ))?;
        }
    }
    csv.flush()?;
    Ok(())
}

/// Reads what [`write()`] wrote.
///
/// # Errors
/// Anything else, by line.
pub fn read(file: impl Read) -> Result<Vec<Curves>, csv::Error> {
    let mut csv = csv::Reader::from_reader(file);
    let is_timed = csv.headers()?.get(1) == Some(TIME);
    let mut curves: Vec<Curves> = Vec::new();
    for row in csv.deserialize() {
        let (record, time, input, measured, nominal, extended, left_out): Row = row?;
        if curves.last().is_none_or(|last| last.record != record) {
            curves.push(Curves {
                record,
                is_timed,
                ..Curves::default()
            });
        }
        if let Some(last) = curves.last_mut() {
            last.time.push(time);
            last.input.push(input);
            last.measured.push(measured);
            last.nominal.push(nominal);
            last.extended.push(extended);
            last.left_out.push(left_out != 0);
        }
    }
    Ok(curves)
}

type Row = (String, f64, f64, f64, f64, f64, u8);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_read_back_as_written() {
        let one = |record: &str, shift: f64| Curves {
            record: record.into(),
            is_timed: true,
            time: vec![0.0, 0.1, 0.2],
            input: vec![shift, 1.0 / 3.0, -1e-17],
            measured: vec![0.1, 0.2, 0.3],
            nominal: vec![1.0, 2.0, 3.0],
            extended: vec![4.0, 5.0, 6.0 + shift],
            left_out: vec![false, true, true],
        };
        let curves = vec![one("first", 0.0), one("second", 0.7)];
        let mut file = Vec::new();
        let [strain, stress] =
            [("strain", "1"), ("stress", "Pa")].map(|(name, unit)| Channel::Other { name, unit });
        write(&curves, strain, stress, &mut file).unwrap();
        let header = "record,time [s],strain [1],measured stress [Pa],nominal,extended,left_out\n";
        assert!(file.starts_with(header.as_bytes()));
        assert_eq!(read(file.as_slice()).unwrap(), curves);
    }
}
