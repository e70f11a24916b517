//! The thesis's figures, drawn with what this program computes.

mod identified;
mod tracking;

use pack::Installation;
use std::path::{Path, PathBuf};

use crate::design;
use crate::error::Error;
use crate::results::{Out, Results};
use pages::report::{self, Panel, Report, Section, identity};

/// A figure of the thesis, as this program draws it.
#[derive(Debug)]
pub struct Figure {
    /// Its number, such as `3-7`.
    pub number: &'static str,
    /// What the thesis shows there, and what differs here.
    pub text: String,
    /// The plots.
    pub panels: Vec<Panel>,
}

/// Numbers of all figures that are drawn.
pub const NUMBERS: [&str; 14] = [
    "2-6", "2-7", "2-9", "2-10", "3-3", "3-4", "3-6", "3-7", "3-9", "3-10", "4-4", "4-6", "5-5",
    "5-6",
];

/// Numbers of the figures of models and loops.
pub fn of_loops() -> impl Iterator<Item = &'static str> {
    NUMBERS.into_iter().filter(|number| !is_of_runs(number))
}

/// Numbers of the figures of tables under control.
pub fn of_runs() -> impl Iterator<Item = &'static str> {
    NUMBERS.into_iter().filter(|number| is_of_runs(number))
}

fn is_of_runs(number: &str) -> bool {
    tracking::ALL.iter().any(|(own, _)| *own == number)
}

/// Draws the figures with these numbers (all for none) on a record, the built-in motion where none
/// is given; `progress` receives each number before it is drawn.
///
/// # Errors
/// A number that is none of [`NUMBERS`], a record at fault, a run that cannot begin.
pub fn figures(
    only: &[String],
    record: Option<&Path>,
    installation: &Installation,
    progress: &dyn Fn(&str),
) -> Result<Vec<Figure>, Error> {
    if let Some(wrong) = only.iter().find(|own| !NUMBERS.contains(&own.as_str())) {
        return Err(Error::Option {
            option: "--figures",
            reason: format!(
                "there is no figure `{wrong}`; expected some of {}",
                NUMBERS.join(", ")
            ),
        });
    }
    let is_wanted = |number: &str| only.is_empty() || only.iter().any(|own| own == number);
    let mut found = Vec::new();
    let mut add = |figures: Vec<Figure>| {
        found.extend(figures.into_iter().filter(|own| is_wanted(own.number)));
    };
    if ["2-6", "2-7", "2-9", "2-10"].into_iter().any(is_wanted) {
        progress("2-6 to 2-10");
        add(identified::figures(installation)?);
    }
    if ["3-3", "3-4", "3-7", "3-9", "3-10"]
        .into_iter()
        .any(is_wanted)
    {
        progress("3-3 to 3-10");
        let fault = |error: controllers::ModelError| Error::Option {
            option: "--figures",
            reason: error.to_string(),
        };
        let design = design::design(&design::Options::default()).map_err(fault)?;
        add(design::thesis_figures(&design));
    }
    for (number, draw) in tracking::ALL {
        if is_wanted(number) {
            progress(number);
            add(vec![draw(record, installation)?]);
        }
    }
    found.sort_by_key(|figure| NUMBERS.iter().position(|own| *own == figure.number));
    Ok(found)
}

/// Writes `report.html` and a picture of each plot; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(figures: &[Figure], motion: &str, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let sections = figures.iter().map(|figure| Section {
        heading: format!("Figure {}", figure.number),
        text: vec![figure.text.clone()],
        panels: figure.panels.clone(),
        ..Section::default()
    });
    let page = Report {
        title: "Figures of the thesis".into(),
        summary: format!(
            "{} figures of Lin (2017) as computed by this program, on {motion}, for comparison \
             with the printed ones.",
            figures.len()
        ),
        identity: vec![identity::entry("Motion", motion), identity::version()],
        sections: sections.collect(),
        ..Report::default()
    };
    let mut results = Results::begin(folder)?;
    results.write_page(report::FILE, &page)?;
    for figure in figures {
        for (n, panel) in figure.panels.iter().enumerate() {
            let name = format!("figure-{}-{}.svg", figure.number, n + 1);
            results.write_picture(&name, panel)?;
        }
    }
    Ok(results.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pages::report::{Axis, Series, Units};

    #[test]
    fn figures_are_of_loops_or_of_runs() {
        let (loops, runs): (Vec<_>, Vec<_>) = (of_loops().collect(), of_runs().collect());
        assert_eq!(runs, ["3-6", "4-4", "4-6", "5-5", "5-6"]);
        assert_eq!(loops.len() + runs.len(), NUMBERS.len());
        assert!(loops.contains(&"2-6") && loops.contains(&"3-10"));
    }

    #[test]
    fn figures_of_loops_are_drawn_without_a_run() {
        let asked = std::cell::RefCell::new(Vec::new());
        let draw = |numbers: &[&str]| {
            let numbers: Vec<String> = numbers.iter().map(ToString::to_string).collect();
            let tell = |number: &str| asked.borrow_mut().push(number.to_string());
            figures(&numbers, None, &Installation::default(), &tell)
        };
        let found = draw(&["3-9", "3-3"]).unwrap();
        assert_eq!(asked.take(), ["3-3 to 3-10"]);
        let numbers: Vec<&str> = found.iter().map(|own| own.number).collect();
        assert_eq!(numbers, ["3-3", "3-9"]);
        let told = draw(&["3-3", "9-9"]).unwrap_err().to_string();
        assert!(
            told.contains("there is no figure `9-9`; expected some of 2-6, 2-7"),
            "{told}"
        );
    }

    #[test]
    fn each_plot_of_a_figure_is_a_picture() {
        let panel = || Panel {
            title: "loop".into(),
            x: Axis::linear("time", Units::TIME),
            y: Axis::linear("x", Units::NONE),
            series: vec![Series::history("a", 1.0, &[0.0, 1.0])],
        };
        let figure = Figure {
            number: "3-3",
            text: "The loop.".into(),
            panels: vec![panel(), panel()],
        };
        let folder = tempfile::tempdir().unwrap();
        let written = write(&[figure], "wave", &Out::new(folder.path().join("out"))).unwrap();
        let names: Vec<_> = written
            .iter()
            .filter_map(|path| path.file_name()?.to_str())
            .collect();
        assert_eq!(
            names,
            ["report.html", "figure-3-3-1.svg", "figure-3-3-2.svg"]
        );
        let page = std::fs::read_to_string(&written[0]).unwrap();
        assert!(page.contains("1 figures of Lin (2017) as computed by this program, on wave"));
    }
}
