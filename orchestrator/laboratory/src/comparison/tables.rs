//! The errors of a comparison as tables, beside those that the thesis prints.

use super::result::{Comparison, Measure, column, deviation, median};
use super::thesis::{CONTROLLERS, PRINTED, PRINTED_FREQUENCY, PRINTED_TIME, Printed, known};
use pages::report;
use pages::report::columns::aligned;

/// A table of errors: a row for each motion, a column for each controller.
pub struct ErrorTable {
    caption: String,
    rows: Vec<Vec<String>>,
}

/// Errors in time and in frequency, as laboratories measure, a row for each motion, then median and
/// standard deviation; of tables with two axes the second axis too.
pub fn tables(comparison: &Comparison) -> Vec<ErrorTable> {
    if comparison.is_biaxial() {
        return along_both_axes(comparison);
    }
    vec![
        table(
            "Normalised RMS acceleration error, % (printed values of Table 4-1 and 5-2 in brackets)",
            comparison,
            |row| row.time_domain_percent,
            Some((|printed| printed.time, PRINTED_TIME)),
        ),
        table(
            "Fourier amplitude error, % (printed values in brackets; their scaling is not given, and the \
             printed median 0.65 should be 0.63)",
            comparison,
            |row| row.frequency_domain_percent,
            Some((|printed| printed.frequency, PRINTED_FREQUENCY)),
        ),
        table(
            "Response spectrum at 5 % damping, largest deviation from 0.5 to 15 Hz, %",
            comparison,
            |row| row.response_spectrum_percent,
            None,
        ),
        table(
            "Normalised RMS acceleration error over the significant duration (5 to 95 % of the Arias intensity), %",
            comparison,
            |row| row.significant_duration_percent,
            None,
        ),
    ]
}

fn along_both_axes(comparison: &Comparison) -> Vec<ErrorTable> {
    let errors: [(&str, [Measure; 2]); 4] = [
        (
            "Normalised RMS acceleration error",
            [
                |row| row.time_domain_percent,
                |row| row.along_y?.time_domain_percent,
            ],
        ),
        (
            "Fourier amplitude error",
            [
                |row| row.frequency_domain_percent,
                |row| row.along_y?.frequency_domain_percent,
            ],
        ),
        (
            "Response spectrum at 5 % damping, largest deviation from 0.5 to 15 Hz",
            [
                |row| row.response_spectrum_percent,
                |row| row.along_y?.response_spectrum_percent,
            ],
        ),
        (
            "Normalised RMS acceleration error over the significant duration (5 to 95 % of the Arias intensity)",
            [
                |row| row.significant_duration_percent,
                |row| row.along_y?.significant_duration_percent,
            ],
        ),
    ];
    let has = |measure: Measure| comparison.rows.iter().any(|row| measure(row).is_some());
    let mut all = Vec::new();
    for (name, measures) in errors {
        for (axis, measure) in ["x", "y"].into_iter().zip(measures) {
            if has(measure) {
                let caption = format!("{name} along {axis}, %");
                all.push(table(&caption, comparison, measure, None));
            }
        }
    }
    let at_rest: Measure = |row| row.along_y?.at_rest_percent;
    if has(at_rest) {
        let caption =
            "RMS acceleration of y, which was to rest, over the peak of the reference along x, %";
        all.push(table(caption, comparison, at_rest, None));
    }
    all
}

/// The printed values of a motion, and their medians and deviations.
type PrintedColumn = (fn(&Printed) -> [f64; 3], [[f64; 3]; 2]);

fn table(
    caption: &str,
    comparison: &Comparison,
    measure: Measure,
    printed: Option<PrintedColumn>,
) -> ErrorTable {
    let (rows, controllers) = (&comparison.rows, comparison.controllers());
    let place = |controller: &str| CONTROLLERS.iter().position(|known| *known == controller);
    let cell = |ours: Option<f64>, theirs: Option<f64>| {
        let ours = ours.map_or("-".to_string(), |value| format!("{value:.3}"));
        theirs.map_or(ours.clone(), |value| format!("{ours} [{value:.2}]"))
    };
    let mut records: Vec<&str> = Vec::new();
    for row in rows {
        if !records.contains(&row.record.as_str()) {
            records.push(&row.record);
        }
    }
    let mut head = vec!["motion".to_string()];
    head.extend(controllers.iter().map(ToString::to_string));
    let mut lines = vec![head];
    for record in &records {
        let known = known(record).filter(|_| !comparison.is_biaxial());
        let mut line = vec![known.map_or(*record, |printed| printed.title).to_string()];
        for &controller in &controllers {
            let mut ours = rows
                .iter()
                .filter(|r| r.record == *record && r.controller == controller);
            let theirs = known.zip(place(controller)).zip(printed);
            let theirs = theirs.map(|((known, at), (values, _))| values(known)[at]);
            let ours = ours.next();
            line.push(match ours {
                Some(row) if !row.is_complete() => match row.ended_s {
                    Some(time) => format!("stopped at {time:.1} s"),
                    None => "failed".to_string(),
                },
                _ => cell(ours.and_then(measure), theirs),
            });
        }
        lines.push(line);
    }
    // The printed statistics are those of the eight printed values.
    let all = PRINTED.iter().all(|printed| {
        records
            .iter()
            .any(|record| known(record).is_some_and(|found| found.title == printed.title))
    });
    for (index, (name, statistic)) in [
        ("Median", median as fn(&[f64]) -> Option<f64>),
        ("Standard deviation", deviation),
    ]
    .into_iter()
    .enumerate()
    {
        let mut line = vec![name.to_string()];
        for &controller in &controllers {
            let theirs = place(controller).filter(|_| all).zip(printed);
            let theirs = theirs.map(|(at, (_, statistics))| statistics[index][at]);
            line.push(cell(statistic(&column(rows, controller, measure)), theirs));
        }
        lines.push(line);
    }
    ErrorTable {
        caption: caption.to_string(),
        rows: lines,
    }
}

impl ErrorTable {
    /// For the terminal.
    pub fn text(&self) -> String {
        format!("{}\n{}", self.caption, aligned(&self.rows))
    }

    pub(super) fn report_table(&self) -> report::Table {
        report::Table::headed(&self.caption, self.rows.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Row;
    use fmi_master::Ending;

    #[test]
    fn runs_that_ended_early_count_as_worse_than_any_other() {
        let row = |percent: f64, ended: Ending| Row {
            record: "any".into(),
            controller: "mpc".into(),
            time_domain_percent: Some(percent),
            frequency_domain_percent: Some(percent),
            response_spectrum_percent: None,
            significant_duration_percent: None,
            peak_displacement_m: None,
            along_y: None,
            ended,
            ended_because: None,
            ended_s: Some(3.21),
            history: None,
        };
        let mut rows = vec![
            row(0.1, Ending::Interlock),
            row(2.0, Ending::Complete),
            row(3.0, Ending::Complete),
        ];
        let of = |rows: &[Row]| Comparison::new("identified", "none", rows.to_vec());
        let comparison = of(&rows);
        assert_eq!(comparison.medians["mpc"].time_domain_percent, Some(3.0));
        assert!(tables(&comparison)[0].text().contains("stopped at 3.2 s"));
        rows[1].ended = Ending::Failed;
        let comparison = of(&rows);
        assert_eq!(comparison.medians["mpc"].time_domain_percent, None);
        assert_eq!(comparison.medians["mpc"].ended_early, 2);
    }
}
