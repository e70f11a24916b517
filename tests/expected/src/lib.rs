//! Texts of tests compared with files, and reports as such texts.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use pages::report::columns::aligned;
use pages::report::number::significant;
use pages::report::{Axis, Bars, Panel, Report, Series, Style, Table, UnitSystem};

/// Compares a text with the file `name` in the folder `expected/` next to the manifest of a crate, such as
/// `env!("CARGO_MANIFEST_DIR")`. With `SHAKEBENCH_REGENERATE=1` it writes the file.
///
/// # Panics
/// The text differs from the file, or the file is missing; the message names the first line that differs.
pub fn compare(manifest: &str, name: &str, text: &str) {
    let path = Path::new(manifest).join("expected").join(name);
    let text = text.trim_end();
    if std::env::var("SHAKEBENCH_REGENERATE").is_ok_and(|value| value == "1") {
        let folder = path.parent().unwrap_or(&path);
        let written =
            fs::create_dir_all(folder).and_then(|()| fs::write(&path, format!("{text}\n")));
        assert!(written.is_ok(), "{}: {written:?}", path.display());
    }
    let before = fs::read_to_string(&path);
    assert!(before.is_ok(), "{}: {before:?}", path.display());
    let before = before.unwrap_or_default();
    let pairs = text.lines().zip(before.lines()).enumerate();
    for (n, (now, before)) in pairs {
        assert_eq!(now, before, "{name}, line {}", n + 1);
    }
    let (now, before) = (text.lines().count(), before.lines().count());
    assert_eq!(now, before, "lines of {name}");
}

/// A report in a system of units: its sentences and tables in full, its plots as names, ranges and means.
#[must_use]
pub fn text_of(report: &Report, units: UnitSystem) -> String {
    let mut text = format!("{}\n{}\n", report.title, report.summary);
    for (name, value) in &report.identity {
        // Version and machine are those of the build.
        if name != "Version" {
            let _ = writeln!(text, "{name}: {}", value.text(units));
        }
    }
    for fact in &report.facts {
        let value = fact.value.text(units);
        let _ = writeln!(text, "{} = {value} ({})", fact.label, fact.note);
    }
    for section in &report.sections {
        let _ = writeln!(text, "\n== {}", section.heading);
        for line in &section.text {
            let _ = writeln!(text, "{line}");
        }
        for note in &section.notes {
            let _ = writeln!(text, "- {note}");
        }
        section.bars.iter().for_each(|own| text += &bars(own));
        section.panels.iter().for_each(|own| text += &plot(own));
        section
            .tables
            .iter()
            .for_each(|own| text += &table(own, units));
    }
    let _ = writeln!(text, "\n{}", report.footer);
    text
}

fn bars(bars: &Bars) -> String {
    let mut text = format!("bars: {}", bars.title);
    if let Some((at, name)) = &bars.mark {
        let _ = write!(text, ", {name} at {}", significant(*at, 3));
    }
    text.push('\n');
    for group in &bars.groups {
        for bar in &group.bars {
            let value = significant(bar.value, 3);
            let _ = write!(
                text,
                "  {}, {} ({}): {value}",
                group.label, bar.name, bar.colour
            );
            if let Some(ends) = bar.interval {
                let [low, high] = ends.map(|end| significant(end, 3));
                let _ = write!(text, " ({low} to {high})");
            }
            text.push('\n');
        }
    }
    text
}

/// A table with aligned columns.
#[must_use]
pub fn table(table: &Table, units: UnitSystem) -> String {
    let mut rows = vec![table.columns.clone()];
    rows.extend(table.rows.iter().map(|row| {
        let cells = row.iter().map(|cell| cell.text(units));
        cells.collect::<Vec<_>>()
    }));
    format!("table: {}\n{}", table.caption, aligned(&rows))
}

/// A plot as names, ranges and means of its series.
#[must_use]
pub fn plot(panel: &Panel) -> String {
    let axis = |axis: &Axis| {
        let kind = if axis.logarithmic { "log " } else { "" };
        let limits = axis.limits.map_or(String::new(), |ends| {
            let [low, high] = ends.map(|end| significant(end, 4));
            format!(" from {low} to {high}")
        });
        format!("{kind}{} [{}]{limits}", axis.label, axis.units.si)
    };
    let mut text = format!(
        "plot: {}: {} over {}\n",
        panel.title,
        axis(&panel.y),
        axis(&panel.x)
    );
    for series in &panel.series {
        let style = match &series.style {
            Style::Band(upper) => format!("band up to {}", spread(upper.iter().copied())),
            style => format!("{style:?}").to_lowercase(),
        };
        let _ = writeln!(
            text,
            "  {} ({style}, {:?}): {} at {}",
            series.name,
            series.colour,
            spread(series.values.iter().copied()),
            spread(places(series).into_iter())
        );
    }
    text
}

/// Places of a series as far as it has any.
fn places(series: &Series) -> Vec<f64> {
    use pages::report::Abscissa;
    match &series.abscissa {
        Abscissa::Even { start, step } => (0..series.values.len())
            .map(|n| start + n as f64 * step)
            .collect(),
        Abscissa::At(places) => places.to_vec(),
    }
}

/// Number, range and mean of what is finite.
fn spread(values: impl Iterator<Item = f64>) -> String {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    // What rounding leaves of a zero differs between machines.
    let size = least.abs().max(largest.abs());
    let shown = |value: f64| match value.abs() < 1e-9 * size {
        true => "0".to_string(),
        false => significant(value, 4),
    };
    let [least, largest, mean] = [least, largest, mean].map(shown);
    format!("{} from {least} to {largest}, mean {mean}", values.len())
}
