//! Every output as measured and as both models have it, and what they miss.

use identification::diagnosis::rigs::foreign::{ForeignDiagnosis, ForeignModel, Signal};

use super::written::shown;
use pages::report::{Axis, Panel, Series, Units};

/// Points of a curve that are drawn.
const DRAWN: usize = 6000;

fn axis(label: &str, signal: &Signal) -> Axis {
    let unit = match signal.unit.as_str() {
        "" => String::new(),
        unit => format!(" [{unit}]"),
    };
    Axis::linear(&format!("{label}{unit}"), Units::NONE)
}

/// Two panels an output, of the first record that contains held-out data.
pub(super) fn panels(subject: &ForeignModel<'_>, found: &ForeignDiagnosis) -> Vec<Panel> {
    let at = shown(subject);
    let trial = &subject.trials[at];
    let period = trial.step * trial.stride as f64;
    let line = |name: &str, values: &[f64], colour| {
        let line = Series::history(name, period, values).coloured(colour);
        line.thinned(DRAWN)
    };
    let mut panels = Vec::new();
    for (j, output) in subject.outputs.iter().enumerate() {
        let (measured, nominal, extended) = (
            &trial.outputs[j],
            &found.nominal[at][j],
            &found.extended[at][j],
        );
        panels.push(Panel {
            title: format!("{} of {}, measured and simulated", output.name, trial.name),
            x: Axis::linear("time", Units::TIME),
            y: axis(&output.name, output),
            series: vec![
                line("measured", measured, 0),
                line("nominal", nominal, 2),
                line("extended", extended, 1),
            ],
        });
        let errors = |model: &[f64]| -> Vec<f64> {
            let pairs = measured.iter().zip(model).zip(&trial.left_out);
            pairs
                .map(|((y, own), out)| if *out { y - own } else { f64::NAN })
                .collect()
        };
        panels.push(Panel {
            title: format!("error of {} on the held-out data", output.name),
            x: Axis::linear("time", Units::TIME),
            y: axis("measured - simulated", output),
            series: vec![
                line("nominal", &errors(nominal), 2),
                line("extended", &errors(extended), 1),
            ],
        });
    }
    panels
}
