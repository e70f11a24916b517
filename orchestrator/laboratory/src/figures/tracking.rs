//! Figures of tables under control: 3-6, 4-4, 4-6, 5-5, 5-6.

use pack::Installation;
use std::path::Path;

use super::Figure;
use crate::error::Error;
use crate::run::experiment::{Request, prepare};
use fmi_master::Record;
use motion::Motion;
use motion::metrics::{HIGHEST_FREQUENCY, fourier_amplitudes};
use pages::report::{Abscissa, Axis, Panel, Series, Style, Units};

/// How a figure is drawn on a record.
type Draw = fn(Option<&Path>, &Installation) -> Result<Figure, Error>;

/// The figures with their numbers.
pub(super) const ALL: [(&str, Draw); 5] = [
    ("3-6", figure_3_6),
    ("4-4", figure_4_4),
    ("4-6", figure_4_6),
    ("5-5", figure_5_5),
    ("5-6", figure_5_6),
];

/// A run for a figure: the motion and what was recorded.
pub(super) struct Run {
    pub(super) motion: Motion,
    pub(super) record: Record,
}

/// Runs a system on its rig.
pub(super) fn run(
    system: &str,
    plant: &str,
    specimen: &str,
    record: Option<&Path>,
    installation: &Installation,
) -> Result<Run, Error> {
    let request = Request {
        plant: plant.into(),
        specimen: specimen.into(),
        record: record.map(Path::to_path_buf),
        installation: installation.clone(),
        ..Request::built_in(system)
    };
    let prepared = prepare(&request)?;
    let outcome = prepared.run(prepared.algorithm)?;
    Ok(Run {
        motion: prepared.motion,
        record: outcome.record,
    })
}

impl Run {
    /// The history of a signal; empty where there is none.
    pub(super) fn column(&self, name: &str) -> Vec<f64> {
        self.record.column(name).unwrap_or_default()
    }

    /// A signal over time.
    pub(super) fn history(&self, name: &str, signal: &str, colour: usize) -> Series {
        Series::history(name, self.motion.dt, &self.column(signal))
            .coloured(colour)
            .thinned(4_000)
    }
}

/// A plot over time.
pub(super) fn over_time(title: &str, label: &str, units: Units, series: Vec<Series>) -> Panel {
    Panel {
        title: title.into(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear(label, units),
        series,
    }
}

/// Reference and two tables: displacement, velocity, acceleration, Fourier amplitudes.
fn two(runs: [(&str, &Run); 2]) -> Vec<Panel> {
    let [(_, first), _] = runs;
    let quantities = [
        ("displacement", Units::DISPLACEMENT),
        ("velocity", Units::VELOCITY),
        ("acceleration", Units::ACCELERATION),
    ];
    let mut panels: Vec<Panel> =
        quantities
            .into_iter()
            .map(|(quantity, units)| {
                let wanted = format!("reference.{quantity}");
                let mut series = vec![first.history("reference", &wanted, 0)];
                series.extend(runs.iter().enumerate().map(|(n, (name, run))| {
                    run.history(name, &format!("table.{quantity}"), 2 - n)
                }));
                let title = format!("{}{}", quantity[..1].to_uppercase(), &quantity[1..]);
                over_time(&title, quantity, units, series)
            })
            .collect();
    let amplitudes = |name: &str, values: &[f64], colour| {
        let (frequency, amplitude) = fourier_amplitudes(values, first.motion.dt, HIGHEST_FREQUENCY);
        Series::line(name, Abscissa::At(frequency.into()), amplitude).coloured(colour)
    };
    let mut series = vec![amplitudes(
        "reference",
        &first.column("reference.acceleration"),
        0,
    )];
    series.extend(
        runs.iter()
            .enumerate()
            .map(|(n, (name, run))| amplitudes(name, &run.column("table.acceleration"), 2 - n)),
    );
    panels.push(Panel {
        title: "Fourier amplitude of acceleration".into(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY).between(0.1, HIGHEST_FREQUENCY),
        y: Axis::linear("amplitude", Units::ACCELERATION),
        series,
    });
    panels
}

fn figure_3_6(record: Option<&Path>, installation: &Installation) -> Result<Figure, Error> {
    let pid = run(
        "displacement-pid",
        "identified",
        "none",
        record,
        installation,
    )?;
    let three = run("three-variable", "identified", "none", record, installation)?;
    Ok(Figure {
        number: "3-6",
        text:
            "Time histories under PID (Eq 3-6) and three-variable control (Table 3-2) on the bare \
               identified table. The thesis plays Irpinia (1980)."
                .into(),
        panels: two([("PID", &pid), ("three-variable", &three)]),
    })
}

fn figure_4_4(record: Option<&Path>, installation: &Installation) -> Result<Figure, Error> {
    let shaping = run("loop-shaping", "identified", "linear", record, installation)?;
    let sliding = run("sliding-mode", "identified", "linear", record, installation)?;
    Ok(Figure {
        number: "4-4",
        text: "Displacement, velocity, acceleration and Fourier amplitudes under loop shaping and \
               sliding mode. The thesis measured them on its rig with a yielding specimen; these are \
               of the identified table with the linear one."
            .into(),
        panels: two([("loop shaping", &shaping), ("sliding mode", &sliding)]),
    })
}

fn figure_4_6(record: Option<&Path>, installation: &Installation) -> Result<Figure, Error> {
    let run = run(
        "sliding-mode",
        "servohydraulic",
        "yielding",
        record,
        installation,
    )?;
    let drift = run.column("specimen.drift");
    let force = run.column("specimen.force");
    Ok(Figure {
        number: "4-6",
        text: "Hysteresis of the yielding specimen on the physical rig under sliding mode.".into(),
        panels: vec![Panel {
            title: "Force of the specimen over its drift".into(),
            x: Axis::linear("drift", Units::DISPLACEMENT),
            y: Axis::linear("force", Units::FORCE),
            series: vec![
                Series::line("specimen", Abscissa::At(drift.into()), force).styled(Style::Path),
            ],
        }],
    })
}

fn predictive(
    number: &'static str,
    specimen: &str,
    text: &str,
    record: Option<&Path>,
    installation: &Installation,
) -> Result<Figure, Error> {
    let three = run(
        "three-variable",
        "identified",
        specimen,
        record,
        installation,
    )?;
    let predictive = run("mpc", "identified", specimen, record, installation)?;
    Ok(Figure {
        number,
        text: text.into(),
        panels: two([
            ("three-variable", &three),
            ("model predictive", &predictive),
        ]),
    })
}

fn figure_5_5(record: Option<&Path>, installation: &Installation) -> Result<Figure, Error> {
    let text = "Three-variable control alone and under model predictive control, bare table.";
    predictive("5-5", "none", text, record, installation)
}

fn figure_5_6(record: Option<&Path>, installation: &Installation) -> Result<Figure, Error> {
    let text = "The same with the linear specimen of Appendix A (100 lbf, 1 s, 5 %).";
    predictive("5-6", "linear", text, record, installation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    #[test]
    fn two_tables_are_drawn_over_their_reference() {
        let motion = made::wave("wave", 2000);
        let run = |part| Run {
            record: made::followed(&motion, part),
            motion: motion.clone(),
        };
        let (one, other) = (run(0.9), run(0.5));
        let panels = two([("PID", &one), ("three-variable", &other)]);
        let text: String = panels.iter().map(expected::plot).collect();
        expected::compare(env!("CARGO_MANIFEST_DIR"), "figure.txt", &text);
        assert!(one.column("none").is_empty());
    }
}
