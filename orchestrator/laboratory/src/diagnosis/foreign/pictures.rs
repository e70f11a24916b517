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

#[cfg(test)]
mod tests {
    use plant::signal_path::SignalEffects;

    use super::super::{simulator, written};
    use super::*;
    use pages::report::Abscissa;

    #[test]
    fn errors_are_shown_on_the_data_that_were_held_out() {
        let alone = simulator::tests::alone();
        let subject = written::tests::subject(&alone);
        let none = SignalEffects::NONE;
        let all = panels(&subject, &written::tests::found(none, none));
        let titles: Vec<&str> = all.iter().map(|own| &*own.title).collect();
        assert_eq!(
            titles,
            [
                "y of held out, measured and simulated",
                "error of y on the held-out data"
            ]
        );
        let values = |panel: usize| {
            let series = all[panel].series.iter();
            series
                .map(|own| (&*own.name, own.values.clone()))
                .collect::<Vec<_>>()
        };
        assert_eq!(
            values(0),
            [
                ("measured", vec![1.0, 2.0, 3.0, 4.0]),
                ("nominal", vec![0.5; 4]),
                ("extended", vec![1.0, 2.0, 3.0, 3.75])
            ]
        );
        for ((name, values), expected) in values(1).iter().zip([[2.5, 3.5], [0.0, 0.25]]) {
            assert!(values[..2].iter().all(|own| own.is_nan()), "{name}");
            assert_eq!(values[2..], expected, "{name}");
        }
        // Five steps of 0.01 s a sample.
        let Abscissa::Even { step, .. } = &all[0].series[0].abscissa else {
            panic!("evenly sampled")
        };
        assert!((step - 0.05).abs() < 1e-15);
        assert_eq!(all[0].y.label, "y [m]");
    }
}
