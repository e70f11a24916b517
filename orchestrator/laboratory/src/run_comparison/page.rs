//! The page of a comparison of runs.

use super::{ComparedRun, RunComparison};
use crate::run::table::Table as ShakeTable;
use pages::report::{
    Axis, Bar, BarGroup, Bars, Cell, Panel, Report, Section, Series, Table, Units, identity,
};

/// Values that a page holds in all, and those of one series.
const MOST_VALUES: usize = 400_000;
const MOST_OF_ONE: usize = 60_000;
/// Motions that are drawn; the figures are those of all.
const MOTIONS_DRAWN: usize = 4;

pub(super) fn report(comparison: &RunComparison) -> Report {
    let motions = motions(comparison);
    let mut sections = vec![Section {
        heading: "Errors".into(),
        bars: bars(comparison, &motions),
        tables: vec![table(comparison)],
        ..Section::default()
    }];
    let drawn = motions.len().min(MOTIONS_DRAWN);
    let series = 4 * comparison.runs.len();
    let most = (MOST_VALUES / series.max(1)).min(MOST_OF_ONE);
    sections.extend(motions.iter().take(drawn).map(|motion| Section {
        heading: format!("On {motion}"),
        panels: overlays(comparison, motion, most),
        ..Section::default()
    }));
    sections.push(differences(comparison));
    Report {
        title: format!("{} runs compared", comparison.runs.len()),
        summary: summary(comparison),
        identity: vec![
            identity::entry("Runs", join(comparison.runs.iter().map(|run| &*run.label))),
            identity::entry("Motions", motions.join(", ")),
            identity::version(),
        ],
        sections,
        footer: join(
            comparison
                .runs
                .iter()
                .map(|run| run.folder.display().to_string()),
        ),
        ..Report::default()
    }
}

fn join(words: impl Iterator<Item = impl Into<String>>) -> String {
    words.map(Into::into).collect::<Vec<_>>().join(", ")
}

fn motions(comparison: &RunComparison) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for run in &comparison.runs {
        if !names.contains(&run.motion) {
            names.push(run.motion.clone());
        }
    }
    names
}

fn summary(comparison: &RunComparison) -> String {
    let whats: Vec<&str> = comparison
        .differences
        .iter()
        .map(|difference| difference.what.as_str())
        .collect();
    let differ = match whats.as_slice() {
        [] => "Their manifests are identical.".to_string(),
        few @ ([_] | [_, _] | [_, _, _]) => format!("They differ in {}.", few.join(", ")),
        [a, b, c, rest @ ..] => format!("They differ in {a}, {b}, {c} and {} more.", rest.len()),
    };
    let errors = comparison.runs.iter().filter_map(|run| {
        let tracking = run.tracking.as_ref()?;
        Some((tracking.time_domain_percent, &run.label))
    });
    let least = errors.min_by(|a, b| a.0.total_cmp(&b.0));
    least.map_or(differ.clone(), |(error, label)| {
        format!("Smallest normalised RMS acceleration error: {error:.2} %, of {label}. {differ}")
    })
}

fn bars(comparison: &RunComparison, motions: &[String]) -> Vec<Bars> {
    let of = |title: &str, value: fn(&ComparedRun) -> Option<f64>| {
        let groups = motions.iter().map(|motion| BarGroup {
            label: motion.clone(),
            bars: comparison
                .runs
                .iter()
                .enumerate()
                .filter(|(_, run)| run.motion == *motion)
                .filter_map(|(n, run)| {
                    Some(Bar {
                        name: run.label.clone(),
                        value: value(run)?,
                        interval: None,
                        colour: 1 + n % 8,
                    })
                })
                .collect(),
        });
        Bars {
            title: title.into(),
            groups: groups.collect(),
            mark: None,
        }
    };
    vec![
        of("Normalised RMS acceleration error, %", |run| {
            Some(run.tracking.as_ref()?.time_domain_percent)
        }),
        of("Fourier amplitude error, %", |run| {
            Some(run.tracking.as_ref()?.frequency_domain_percent)
        }),
    ]
}

/// The figures, one row per run with a line of headings.
pub(super) fn figures(comparison: &RunComparison) -> Vec<Vec<Cell>> {
    let heads = [
        "run",
        "motion",
        "acceleration error",
        "Fourier amplitude error",
        "displacement error",
        "delay",
        "peak displacement",
        "ended",
    ];
    let mut rows = vec![heads.map(Cell::from).to_vec()];
    rows.extend(comparison.runs.iter().map(|run| {
        let tracking = run.tracking.as_ref();
        let cell = |value: Option<f64>, units| match value {
            Some(value) => Cell::Quantity(value, units, 3),
            None => "-".into(),
        };
        vec![
            run.label.as_str().into(),
            run.motion.as_str().into(),
            cell(tracking.map(|t| t.time_domain_percent), Units::PERCENT),
            cell(tracking.map(|t| t.frequency_domain_percent), Units::PERCENT),
            cell(tracking.map(|t| t.displacement_percent), Units::PERCENT),
            cell(tracking.map(|t| 1e3 * t.delay), Units::same("ms")),
            cell(tracking.map(|t| t.peak_displacement), Units::DISPLACEMENT),
            run.ended.word().into(),
        ]
    }));
    rows
}

fn table(comparison: &RunComparison) -> Table {
    Table::headed(
        "Errors are RMS over the peak of the reference.",
        figures(comparison),
    )
}

/// The runs on a motion over each other, with the reference of the first.
fn overlays(comparison: &RunComparison, motion: &str, most: usize) -> Vec<Panel> {
    let runs = comparison.runs.iter().enumerate();
    let runs: Vec<(usize, &ComparedRun)> = runs.filter(|(_, run)| run.motion == motion).collect();
    let table = |run: &ComparedRun, output: &str| -> Option<Vec<f64>> {
        let files = &run.files;
        let table = ShakeTable::find(&files.manifest, &files.record)?;
        files.record.column(&table.name(output))
    };
    let reference =
        |run: &ComparedRun, quantity| run.files.record.column(&format!("reference.{quantity}"));
    let history = |name: &str, run: &ComparedRun, values: &[f64]| {
        Series::history(name, run.files.manifest.motion.dt_s, values).thinned(most)
    };
    let panel = |title: &str, units: Units, series: Vec<Series>| Panel {
        title: format!("{title} on {motion}"),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear(&title.to_lowercase(), units),
        series,
    };
    let mut panels = Vec::new();
    for (title, quantity, units) in [
        ("Acceleration", "acceleration", Units::ACCELERATION),
        ("Displacement", "displacement", Units::DISPLACEMENT),
    ] {
        let wanted = runs.first().and_then(|(_, run)| {
            Some(history("reference", run, &reference(run, quantity)?).coloured(0))
        });
        let found = runs.iter().filter_map(|(n, run)| {
            Some(history(&run.label, run, &table(run, quantity)?).coloured(1 + n % 8))
        });
        panels.push(panel(
            title,
            units.clone(),
            wanted.into_iter().chain(found).collect(),
        ));
        let errors = runs.iter().filter_map(|(n, run)| {
            let (wanted, found) = (reference(run, quantity)?, table(run, quantity)?);
            let error: Vec<f64> = wanted.iter().zip(&found).map(|(r, y)| r - y).collect();
            Some(history(&run.label, run, &error).coloured(1 + n % 8))
        });
        panels.push(panel(&format!("{title} error"), units, errors.collect()));
    }
    panels
}

fn differences(comparison: &RunComparison) -> Section {
    let mut columns = vec!["".to_string()];
    columns.extend(comparison.runs.iter().map(|run| run.label.clone()));
    let rows = comparison.differences.iter().map(|difference| {
        let mut row = vec![Cell::from(difference.what.as_str())];
        row.extend(
            difference
                .values
                .iter()
                .map(|value| Cell::from(value.as_str())),
        );
        row
    });
    Section {
        heading: "What differs".into(),
        tables: vec![Table {
            columns,
            rows: rows.collect(),
            ..Table::default()
        }],
        ..Section::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::write_run;
    use crate::results::Out;
    use crate::run::experiment::Request;
    use crate::run_comparison::{find, read};
    use pages::report::UnitSystem;
    use pages::report::columns::aligned;

    #[test]
    fn runs_in_folders_are_compared_with_what_differs() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        let request = Request::built_in("mpc");
        let other = Request {
            specimen: "none".into(),
            system: "three-variable".into(),
            ..request.clone()
        };
        write_run(&place("runs/first"), &request, 0.9);
        write_run(&place("runs/second"), &other, 0.75);
        std::fs::create_dir_all(place("runs/empty")).unwrap();
        let found = find(&[place("runs")]).unwrap();
        assert_eq!(found, [place("runs/first"), place("runs/second")]);
        let comparison = read(&found, UnitSystem::Us).unwrap();
        let page = report(&comparison);
        let text = expected::text_of(&page, UnitSystem::Us)
            + &aligned(&comparison.figures(UnitSystem::Si));
        let text = text.replace(&folder.path().display().to_string(), "FOLDER");
        expected::compare(env!("CARGO_MANIFEST_DIR"), "run-comparison.txt", &text);
        let out = Out::new(place("out"));
        assert_eq!(comparison.write(&out).unwrap().len(), 3);
        let csv = std::fs::read_to_string(out.join("runs.csv")).unwrap();
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[1].starts_with("first,mpc,wave,complete,"), "{csv}");
        // Two folders of one name are told apart by their paths.
        write_run(&place("again/first"), &request, 0.9);
        let twice = read(&[place("runs/first"), place("again/first")], UnitSystem::Us).unwrap();
        assert_eq!(
            twice.runs[1].label,
            place("again/first").display().to_string()
        );
        assert!(twice.differences.is_empty());
        assert!(summary(&twice).ends_with("Their manifests are identical."));
    }

    #[test]
    fn folders_without_two_runs_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        write_run(&place("one"), &Request::built_in("mpc"), 0.9);
        let told = |name: &str| {
            read(&[place(name)], UnitSystem::Us)
                .unwrap_err()
                .to_string()
        };
        assert!(
            told("one").contains("this is one run; expected two or more"),
            "{}",
            told("one")
        );
        assert!(told("none").contains("is not a folder"), "{}", told("none"));
        std::fs::create_dir(place("empty")).unwrap();
        assert!(
            told("empty").contains("contains no run"),
            "{}",
            told("empty")
        );
    }
}
