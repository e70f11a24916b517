//! The figures and the report of a rig of which command and displacement alone were recorded.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use identification::IdentificationError;
use identification::data::{Named, Recording};
use identification::one_input::{self, OneInput};

use super::poles;
use super::summary::Summary;
use pages::report::identity::{entry, version};
use pages::report::number::significant;
use pages::report::{Abscissa, Axis, Cell, Panel, Report, Section, Series, Style, Table, Units};

/// What was found, with what its file needs.
pub struct OneInputIdentification {
    /// What was found.
    pub found: OneInput,
    /// The text of its file.
    pub text: String,
}

/// Columns of [`OneInputIdentification::parameters`].
pub const ONE_INPUT_COLUMNS: [&str; 4] = ["parameter", "value", "standard error", "unit"];

impl OneInputIdentification {
    /// Fits the first `part` of `recordings`, which lie in files `data` with these `columns`, and
    /// checks the rest.
    ///
    /// # Errors
    /// Every way in which data give no model, see [`IdentificationError`].
    pub fn new(
        recordings: &[Recording],
        part: f64,
        data: &[std::path::PathBuf],
        columns: &[Named],
    ) -> Result<Self, IdentificationError> {
        let found = one_input::identify(recordings, part)?;
        let name = data
            .first()
            .and_then(|path| path.file_stem())
            .map_or("rig".into(), |stem| stem.to_string_lossy());
        let text = found.to_toml(&name, data, columns)?;
        Ok(Self { found, text })
    }

    /// Rows of name, value, standard error and unit, SI.
    pub fn parameters(&self) -> Vec<[String; 4]> {
        let OneInput {
            model, structure, ..
        } = &self.found;
        let errors = &self.found.standard_error;
        let row = |name: String, value: f64, error: f64, unit: String| {
            [name, significant(value, 6), significant(error, 2), unit]
        };
        let order = model.denominator.len() - 1;
        let mut rows = Vec::new();
        let input = self.found.input.unit();
        for (i, value) in model.numerator.iter().enumerate() {
            let power = structure.zeros - i;
            let error = errors[structure.poles + i];
            let unit = format!("m/{input} 1/s^{}", order - power);
            rows.push(row(format!("numerator, s^{power}"), *value, error, unit));
        }
        for (i, error) in errors[..structure.poles].iter().enumerate() {
            let value = model.denominator[i + 1];
            let name = format!("denominator, s^{}", order - 1 - i);
            rows.push(row(name, value, *error, format!("1/s^{}", i + 1)));
        }
        if structure.integrates {
            let held = ["denominator, s^0", "0", "held", "-"];
            rows.push(held.map(String::from));
        }
        let error = errors.last().copied().unwrap_or(f64::NAN);
        rows.push(row("delay".into(), model.delay, error, "s".into()));
        rows
    }

    /// Columns of [`Self::candidates`].
    pub fn candidate_columns(&self) -> [&'static str; 4] {
        let last = if self.found.evenly {
            "error of what was not fitted, %"
        } else {
            "residual over noise, not fitted"
        };
        ["poles", "zeros", "at zero", last]
    }

    /// Rows of structure and how it predicts bands that it was not fitted to.
    pub fn candidates(&self) -> Vec<[String; 4]> {
        let predicted = |square: f64| {
            if self.found.evenly {
                square.sqrt()
            } else {
                square
            }
        };
        let rows = self.found.candidates.iter().map(|own| {
            let chosen = if own.structure == self.found.structure {
                " (chosen)"
            } else {
                ""
            };
            [
                own.structure.poles.to_string(),
                own.structure.zeros.to_string(),
                if own.structure.integrates {
                    "yes"
                } else {
                    "no"
                }
                .to_string(),
                format!("{}{chosen}", significant(predicted(own.predicted), 3)),
            ]
        });
        rows.collect()
    }

    /// How the model does on what was not fitted, in a line.
    pub fn checked(&self) -> String {
        let found = &self.found;
        format!(
            "on the part that was not fitted: {:.2} % of the displacement is explained from the \
             command alone, {:.2} % of the part that the instrument explains remains; residual \
             over noise {:.2} (fitted: {:.2})",
            found.simulated_percent,
            100.0 * found.relative_error,
            found.check,
            found.mean_square
        )
    }

    /// The figures; `model` is the file that holds the rig.
    pub(super) fn summary(&self, model: &Path, mut warnings: Vec<String>, wall_s: f64) -> Summary {
        warnings.extend(self.found.warnings.iter().cloned());
        let fit = self.found.simulated_percent;
        let poles = self.found.model.poles();
        Summary {
            model: model.to_path_buf(),
            actuator_poles_rad_s: poles.iter().map(|p| [p.re, p.im]).collect(),
            table_poles_rad_s: Vec::new(),
            fit_percent: BTreeMap::from([(
                "displacement".to_string(),
                fit.is_finite().then_some(fit),
            )]),
            identifiable: true,
            warnings,
            wall_s,
        }
    }

    /// The report.
    pub(super) fn report(&self, summary: &Summary) -> Report {
        let found = &self.found;
        let mut panels = vec![poles::panel(summary)];
        panels.extend(self.response());
        Report {
            title: "Identified command to displacement".into(),
            summary: self.checked(),
            identity: vec![
                entry(
                    "Form",
                    "transfer function with delay, command to displacement",
                ),
                entry("Command", found.input.name()),
                entry(
                    "Sampled at",
                    Cell::Quantity(1.0 / found.period, Units::FREQUENCY, 4),
                ),
                entry("Model file", summary.model.display().to_string()),
                version(),
            ],
            sections: vec![
                Section {
                    heading: "Model".into(),
                    notes: summary.warnings.clone(),
                    panels,
                    tables: vec![
                        Table::of("Parameters", ONE_INPUT_COLUMNS, self.parameters()),
                        Table::of(
                            "Structures tried",
                            self.candidate_columns(),
                            self.candidates(),
                        ),
                    ],
                    ..Section::default()
                },
                Section {
                    heading: "Validation".into(),
                    text: vec![
                        "Simulated from the command alone on the part of each recording that was \
                         not fitted. A rig driven by a valve drifts without its loop, so it is \
                         simulated in windows of 2 s. The free motion from each first sample is \
                         fitted."
                            .into(),
                    ],
                    panels: found.rest.iter().map(validation).collect(),
                    ..Section::default()
                },
            ],
            footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
            ..Report::default()
        }
    }

    /// Gain and phase as measured, with their 95 % intervals, beside the model's.
    fn response(&self) -> [Panel; 2] {
        let found = &self.found;
        let at = || Abscissa::At(found.response.iter().map(|own| own.omega / TAU).collect());
        let decibel = |value: f64| 20.0 * value.max(f64::MIN_POSITIVE).log10();
        let model: Vec<_> = found
            .response
            .iter()
            .map(|own| found.model.response(own.omega, found.period))
            .collect();
        let measured = &found.response;
        let band = |sign: f64| -> Vec<f64> {
            let own = measured.iter();
            own.map(|m| decibel(m.value.norm() + sign * 2.0 * m.deviation))
                .collect()
        };
        let gain = Panel {
            title: format!("{} to displacement, gain", found.input.name()),
            x: Axis::logarithmic("frequency", Units::FREQUENCY),
            y: Axis::linear("gain (SI)", Units::DECIBEL),
            series: vec![
                Series::line("measured, 95 %", at(), band(-1.0))
                    .styled(Style::Band(band(1.0)))
                    .coloured(0),
                Series::line(
                    "measured",
                    at(),
                    measured.iter().map(|m| decibel(m.value.norm())).collect(),
                )
                .styled(Style::Points)
                .coloured(0),
                Series::line(
                    "model",
                    at(),
                    model.iter().map(|g| decibel(g.norm())).collect(),
                )
                .coloured(2),
            ],
        };
        let degrees = |g: &nalgebra::Complex<f64>| g.arg().to_degrees();
        let phase = Panel {
            title: format!("{} to displacement, phase", found.input.name()),
            x: Axis::logarithmic("frequency", Units::FREQUENCY),
            y: Axis::linear("phase", Units::DEGREE).between(-185.0, 185.0),
            series: vec![
                Series::line(
                    "measured",
                    at(),
                    measured.iter().map(|m| degrees(&m.value)).collect(),
                )
                .styled(Style::Points)
                .coloured(0),
                Series::line("model", at(), model.iter().map(degrees).collect())
                    .styled(Style::Points)
                    .coloured(2),
            ],
        };
        [gain, phase]
    }
}

fn validation(rest: &one_input::Rest) -> Panel {
    let at = || Abscissa::Even {
        start: rest.start,
        step: rest.period,
    };
    Panel {
        title: rest.recording.clone(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("displacement", Units::DISPLACEMENT),
        series: vec![
            Series::line("measured", at(), rest.measured.clone()).coloured(0),
            Series::line("simulated", at(), rest.simulated.clone()).styled(Style::Dashed),
        ],
    }
}
