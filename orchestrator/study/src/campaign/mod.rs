//! Studies of many runs: factors, a design, runs on all cores, a table, and what it says.

pub mod analysis;
mod bench;
mod carry_out;
mod command;
mod design;
mod factor;
mod files;
mod journal;
pub mod page;
mod row;
mod runs;
mod setting;
mod study;
pub mod table;

use std::path::{Path, PathBuf};

pub use bench::Bench;
#[cfg(test)]
pub(crate) use bench::made_study;
pub use carry_out::{Carried, Left, Plan, Progress, Shard, Summary, carry_out, rows};
pub use design::{Design, Points};
pub(crate) use factor::with_unit;
pub use factor::{Distribution, Drawn, Values};
pub use journal::Head;
pub(crate) use journal::IDENTITY;
pub use runs::Runs;
pub use setting::Key;
pub use study::{Factor, Limit, Study};
pub use table::Row;

use analysis::Findings;
use laboratory::error::Error;
use laboratory::results::{Out, Results};
use pages::report::identity::{entry, version};
use pages::report::{self, Cell, UnitSystem};

/// The table as text.
pub const CSV: &str = "runs.csv";
/// The table as Parquet.
pub const PARQUET: &str = "runs.parquet";
/// The study as it was carried out.
pub const STUDY: &str = "study.toml";
/// What the table says, in figures.
pub const FINDINGS: &str = "findings.json";

/// What the runs of a study say.
///
/// # Errors
/// A limit that fits no system; the check before the first run has found it.
pub fn findings(study: &Study, bench: &Bench, carried: &Carried) -> Result<Findings, Error> {
    let (valid, invalid) = analysis::without_invalid(&carried.table);
    let limits = study.limits.iter().zip(bench.limits()?);
    let settings = analysis::Settings {
        intensity: study.intensity.clone(),
        limits: limits
            .map(|(limit, (column, above))| analysis::Limit {
                name: limit.signal.clone().unwrap_or_else(|| column.clone()),
                column,
                above,
            })
            .collect(),
        design: study.analysed(&valid),
        ranked: study.ranked(),
        seed: study.seed,
    };
    let command = |number: usize| bench.command(number as u64);
    Ok(Findings {
        invalid,
        ..analysis::analyse(&valid, &settings, &command)
    })
}

/// Writes what came of a study into its folder. The files follow the journals there, so that those of
/// the study before it was extended are replaced.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(
    study: &Study,
    carried: &Carried,
    findings: &Findings,
    folder: &Out,
) -> Result<Vec<PathBuf>, Error> {
    let page = page::report(&carried.table, findings, about(study, folder.units()));
    let mut results = Results::begin(folder)?;
    if journal::is_there(folder) {
        results.supersede();
    }
    results.write_page(report::FILE, &page)?;
    results.write(CSV, |file| files::csv(&carried.table, file))?;
    results.write(PARQUET, |file| files::parquet(&carried.table, file))?;
    results.write_json(FINDINGS, findings)?;
    results.write_text(STUDY, &study.text)?;
    Ok(results.finish()?)
}

/// What the page says of the study.
fn about(study: &Study, units: UnitSystem) -> page::About {
    let name = |path: &Path| {
        path.file_name()
            .map(|name| name.to_string_lossy().into_owned())
    };
    let file = name(&study.path).unwrap_or_default();
    let title = study
        .path
        .file_stem()
        .map(|name| name.to_string_lossy().into_owned());
    page::About {
        title: title.unwrap_or_else(|| file.clone()),
        identity: identity(study),
        footer: format!("shakebench campaign {file}; seed {}", study.seed),
        units,
    }
}

/// What a study is, in few words for a page.
pub(crate) fn identity(study: &Study) -> Vec<(String, Cell)> {
    let factors: Vec<&str> = study
        .factors
        .iter()
        .map(|factor| factor.name.as_str())
        .collect();
    let fixed: Vec<String> = study
        .fixed
        .iter()
        .map(|(name, _, value)| format!("{name} = {value}"))
        .collect();
    let design = clap::ValueEnum::to_possible_value(&study.design);
    let design = design.map_or(String::new(), |design| design.get_name().to_string());
    let mut entries = vec![
        entry("Runs", study.runs().to_string()),
        entry("Design", design),
        entry("Varied", factors.join(", ")),
    ];
    if !fixed.is_empty() {
        entries.push(entry("Fixed", fixed.join(", ")));
    }
    entries.push(version());
    entries
}
