//! Diagnosis of a model that came as an FMU, ours or not: `shakebench diagnose --fmu`.

mod data;
mod further;
mod map;
mod pictures;
mod simulator;
mod written;

use pack::Installation;
use std::path::{Path, PathBuf};
use std::time::Instant;

use identification::diagnosis::DiagnosisReport;
use identification::diagnosis::engine::{Observer, Verdict};
use identification::diagnosis::rigs::foreign::{self, ForeignDiagnosis, ForeignModel};

use super::{DIAGNOSIS, EXTENDED_MODEL, file_fault, page};
use crate::error::Error;
use crate::results::{Out, Results};
use fmi_import::Isolation;
pub(super) use further::{Extended, is_one};
use map::Map;
use pages::report;
use simulator::{Alone, Mapped, mapped, open};
pub(super) use written::head;

/// Files beside those of every diagnosis.
pub(super) const FILES: [&str; 3] = [written::TRACES, written::INPUTS, MAP];
/// The map of the data, kept beside the extended model, which is read back with it.
const MAP: &str = "map.toml";

/// Diagnoses the FMU `model` on the records `files`, whose columns are those of the `map`, and writes the
/// extended model, its map, curves, the JSON object and the report into `folder`, all or nothing. The nominal
/// model is run once in a process of its own, so that a crash is an error, then in this one, unless `isolate` says
/// otherwise; `observer` receives each attempt.
///
/// # Errors
/// What cannot be read, names that the model has not, a model whose simulation of a record ends
/// early, a folder that cannot be written.
pub fn diagnose(
    model: &Path,
    map: &Path,
    files: &[PathBuf],
    folder: &Out,
    (isolate, installation): (Option<Isolation>, &Installation),
    observer: Observer<'_>,
) -> Result<DiagnosisReport, Error> {
    let begun = Instant::now();
    Results::check(folder)?;
    let place = map;
    let map = Map::read(place)?;
    let written_map =
        identification::data::read_written(place).map_err(|error| file_fault(place, error))?;
    let Mapped {
        alone,
        inputs,
        outputs,
        parameters,
    } = mapped(
        model,
        &map,
        place,
        (isolate.unwrap_or(Isolation::None), installation),
    )?;
    let trials = data::trials(&map, place, files, &inputs, &outputs)?;
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    let subject = ForeignModel {
        name: map.name.clone().unwrap_or_else(|| stem.into_owned()),
        simulator: &alone,
        inputs,
        outputs,
        parameters,
        trials,
    };
    let first = alone.isolated(isolate.unwrap_or(Isolation::Foreign));
    let told = nominal(&first, model, &subject)?;
    let found = foreign::diagnose(&subject, observer)
        .ok_or_else(|| file_fault(model, "its output on these data is not finite"))?;
    let mut report = DiagnosisReport::from(&found.found);
    report.sentence = sentence(&subject, &found);
    for (name, others) in &found.equivalents {
        for other in others {
            let rival = vec![other.clone()];
            if name != other && !report.alternatives.contains(&rival) {
                report.alternatives.push(rival);
            }
        }
    }
    let alike = found
        .equivalents
        .iter()
        .filter(|(_, others)| !others.is_empty());
    report.notes.extend(alike.map(|(name, others)| {
        format!(
            "`{name}` and `{}` have the same effect on these records: only a measurement between \
             the two can distinguish them",
            others.join("`, `")
        )
    }));
    report.notes.extend(found.notes.iter().cloned());
    report.notes.extend(told);
    report.extended_model = Some(folder.join(EXTENDED_MODEL));
    let mut results = Results::begin(folder)?;
    results.write_text(
        EXTENDED_MODEL,
        &written::system(&alone, model, &subject, &found)?,
    )?;
    results.write_text(MAP, &written_map)?;
    if !subject.inputs.is_empty() {
        results.write(written::INPUTS, |file| written::inputs(&subject, file))?;
    }
    results.write(written::TRACES, |file| {
        written::traces(&subject, &found, file)
    })?;
    report.wall_s = begun.elapsed().as_secs_f64();
    let panels = pictures::panels(&subject, &found);
    let page = page::of_foreign(&subject.name, model, &report, panels, folder.units());
    results.write_page(report::FILE, &page)?;
    results.write_text(DIAGNOSIS, &format!("{:#}\n", serde_json::json!(report)))?;
    results.finish()?;
    Ok(report)
}

/// A commented map of the FMU `model`.
///
/// # Errors
/// An FMU that cannot be read.
pub fn template(model: &Path, installation: &Installation) -> Result<String, Error> {
    Ok(map::template(&*open(model, installation)?))
}

/// Simulates the nominal model on every record; returns messages of the runs.
fn nominal(alone: &Alone, model: &Path, subject: &ForeignModel<'_>) -> Result<Vec<String>, Error> {
    let mut notes = alone.notes().to_vec();
    for trial in &subject.trials {
        let inputs: Vec<&[f64]> = trial.inputs.iter().map(Vec::as_slice).collect();
        let steps = trial.samples().saturating_sub(1) * trial.stride + 1;
        let outcome = alone.run(&inputs, &[], trial.step, steps)?;
        if !outcome.ended.is_regular() || outcome.record.len() < steps {
            let why = outcome.ended.message();
            return Err(file_fault(
                model,
                format!(
                    "the simulation of the record {} ends early: {why}",
                    trial.name
                ),
            ));
        }
        for note in outcome.notes {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
    }
    Ok(notes)
}

/// What was found, in a sentence.
fn sentence(subject: &ForeignModel<'_>, found: &ForeignDiagnosis) -> String {
    let of = &found.found;
    let name = &subject.name;
    let falls = format!(
        "the error of {} on the held-out data falls from {:.1} to {:.1} %",
        of.output,
        100.0 * of.as_described.nominal_error,
        100.0 * of.confirmed.error
    );
    let named = of.named.join(", ");
    match of.verdict {
        Verdict::Adequate => format!(
            "{name}: the model is adequate; its error of {} on the held-out data is \
             {:.1} %.",
            of.output,
            100.0 * of.as_described.nominal_error
        ),
        Verdict::Named => format!("{name}: every part of the data shows {named}; {falls}."),
        Verdict::Ambiguous => {
            let rivals = of.as_described.rivals.iter();
            let rivals: Vec<String> = rivals
                .map(|(rival, against)| format!("{rival} instead of {against}"))
                .collect();
            format!(
                "{name}: every part of the data shows {named}, and {} explains it nearly as well; \
                 {falls}.",
                rivals.join(", ")
            )
        }
        Verdict::Unexplained if named.is_empty() => format!(
            "{name}: no effect on its signals and no drift of its parameters explains an error of \
             {:.1} % of {} on the held-out data; causes inside the model are beyond this \
             diagnosis.",
            100.0 * of.confirmed.error,
            of.output
        ),
        Verdict::TooSmall | Verdict::Unexplained => format!(
            "{name}: the effects on its signals and in its parameters ({named}) do not explain \
             all of the error; {falls}; causes inside the model are beyond this diagnosis."
        ),
    }
}
