//! The errors of a comparison over time, on the first motion, as a file.

use std::path::Path;

use identification::data::{Sheet, Wanted};

use super::result::{History, Row};
use crate::error::Error;

/// Name of the file.
pub(super) const FILE: &str = "errors.csv";
/// Its columns, after the controller's name.
const COLUMNS: [&str; 2] = ["displacement_error", "acceleration_error"];

/// Errors over time on the first motion as CSV: `time`, then two columns a controller; a run that
/// ended early leaves cells empty.
pub(super) fn written(rows: &[Row]) -> String {
    let kept: Vec<(&str, &History)> = rows
        .iter()
        .filter_map(|row| Some((row.controller.as_str(), row.history.as_ref()?)))
        .collect();
    let mut text = "time".to_string();
    for (controller, _) in &kept {
        text += &format!(",{controller}.{},{controller}.{}", COLUMNS[0], COLUMNS[1]);
    }
    text += "\n";
    let dt = kept.first().map_or(0.0, |(_, history)| history.dt);
    let lengths = kept
        .iter()
        .map(|(_, history)| history.displacement_error.len());
    for sample in 0..lengths.max().unwrap_or(0) {
        text += &(sample as f64 * dt).to_string();
        for (_, history) in &kept {
            for values in [&history.displacement_error, &history.acceleration_error] {
                text += ",";
                if let Some(value) = values.get(sample) {
                    text += &value.to_string();
                }
            }
        }
        text += "\n";
    }
    text
}

/// The columns of a controller in the file at `path`; none where they are missing.
///
/// # Errors
/// A file that cannot be read or a cell that is not a number, with its line.
pub(super) fn read(path: &Path, controller: &str) -> Result<Option<History>, Error> {
    let wanted = Wanted {
        is_column: &|cell| cell == "time",
        header: "`time`, then two columns of errors a controller",
    };
    let sheet = Sheet::read(path, wanted)?;
    let numbers = |head: &str| -> Result<Option<Vec<f64>>, Error> {
        let Ok(place) = sheet.place(head) else {
            return Ok(None);
        };
        let mut values = sheet.column(place, head)?;
        // A run that ended early leaves cells empty.
        values.retain(|value| !value.is_nan());
        Ok(Some(values))
    };
    let heads = COLUMNS.map(|column| format!("{controller}.{column}"));
    let (Some(time), Some(displacement_error), Some(acceleration_error)) =
        (numbers("time")?, numbers(&heads[0])?, numbers(&heads[1])?)
    else {
        return Ok(None);
    };
    Ok(time.get(1).map(|dt| History {
        dt: *dt,
        displacement_error,
        acceleration_error,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_master::Ending;

    pub(super) fn row(controller: &str, history: Option<History>) -> Row {
        Row {
            record: "wave".into(),
            controller: controller.into(),
            time_domain_percent: None,
            frequency_domain_percent: None,
            response_spectrum_percent: None,
            significant_duration_percent: None,
            peak_displacement_m: None,
            along_y: None,
            ended: Ending::Complete,
            ended_because: None,
            ended_s: None,
            history,
        }
    }

    #[test]
    fn errors_over_time_are_a_table_that_is_read_again() {
        let history = |displacement: &[f64], acceleration: &[f64]| History {
            dt: 0.25,
            displacement_error: displacement.to_vec(),
            acceleration_error: acceleration.to_vec(),
        };
        let rows = [
            row("mpc", Some(history(&[0.5, -1.0], &[2.0, 4.0]))),
            row("lqg", None),
            row("preview", Some(history(&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0]))),
        ];
        let text = written(&rows);
        assert_eq!(
            text,
            "time,mpc.displacement_error,mpc.acceleration_error,preview.displacement_error,\
             preview.acceleration_error\n0,0.5,2,1,4\n0.25,-1,4,2,5\n0.5,,,3,6\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        std::fs::write(&path, text).unwrap();
        for own in [&rows[0], &rows[2]] {
            let found = read(&path, &own.controller).unwrap().unwrap();
            let before = own.history.as_ref().unwrap();
            assert_eq!(found.dt, before.dt);
            assert_eq!(found.displacement_error, before.displacement_error);
            assert_eq!(found.acceleration_error, before.acceleration_error);
        }
        assert!(read(&path, "lqg").unwrap().is_none());
        assert_eq!(written(&rows[1..2]), "time\n");
    }
}
