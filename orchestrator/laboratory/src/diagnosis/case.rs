//! The extended model of a shake table: its file, its FMUs, and their simulation of the validation
//! record in closed loop.

use std::io::Write;
use std::path::{Path, PathBuf};

use identification::data::Channel;
use identification::diagnosis::case::Case;
use identification::diagnosis::rigs::shake_table::Diagnosis;
use identification::diagnosis::{DiagnosisReport, Evidence};

use super::co_simulation::{self, Comparison, PlayError, RigFmus};
use super::{EXTENDED_MODEL, SEPARATING_MOTION, file_fault};
use crate::error::Error;
use crate::results::Results;
use pack::extended_model::ExtendedModel;
use pack::parameter_sets::component_of;
use pack::{FmiVersion, Installation, PackError, PackedFmu};

/// What a case's diagnosis brings beside its report.
pub(super) struct Extended {
    /// The extended model.
    pub model: ExtendedModel,
    /// The validation record in closed loop, if available.
    pub comparison: Option<Comparison>,
}

/// Writes the extended model and its FMUs, plays them, and tells the report.
///
/// # Errors
/// Files that cannot be written.
pub(super) fn extend(
    case: &Case,
    found: &Diagnosis,
    report: &mut DiagnosisReport,
    results: &mut Results,
    (folder, installation): (&Path, &Installation),
) -> Result<Extended, Error> {
    let model = ExtendedModel::new(&found.extended_model, &found.modelled).beside(&case.nominal);
    if found.effects.is_empty() && !found.modelled.is_empty() {
        let names: Vec<&str> = found.modelled.iter().map(|e| e.effect).collect();
        report.notes.push(format!(
            "also in the extended model because they improve it, but not named as causes: {}",
            names.join(" and ")
        ));
    }
    let text = model
        .toml()
        .map_err(|error| file_fault(&folder.join(EXTENDED_MODEL), error))?;
    results.write_text(EXTENDED_MODEL, &text)?;
    if let Some(experiment) = &found.separating_experiment {
        let (x, period) = (&experiment.reference, experiment.period);
        results.write(SEPARATING_MOTION, |file| {
            writeln!(
                file,
                "time [s],displacement [m],velocity [m/s],acceleration [m/s^2]"
            )?;
            for k in 0..x.len() {
                let (before, after) = (x[k.saturating_sub(1)], x[(k + 1).min(x.len() - 1)]);
                let velocity = (after - before) / (2.0 * period);
                let acceleration = (after - 2.0 * x[k] + before) / (period * period);
                let time = k as f64 * period;
                writeln!(
                    file,
                    "{time:.6},{:.9e},{velocity:.9e},{acceleration:.9e}",
                    x[k]
                )?;
            }
            Ok(())
        })?;
        report.separating_motion = Some(folder.join(SEPARATING_MOTION));
    }
    let mut comparison = None;
    match fmus(&model, installation, results) {
        Ok(built) => {
            let first = found.modelled.first();
            let home = first.map_or("ShakeTable", |named| component_of(named.effect).name());
            let place = |fmu: &PackedFmu| folder.join(name(fmu));
            report.extended_fmu = find(&built, home).map(place);
            report.extended_fmus = built.iter().map(place).collect();
            match in_closed_loop(case, found, &built, installation) {
                Ok(played) => comparison = Some(played),
                Err(reason) => report
                    .notes
                    .push(format!("not co-simulated in closed loop: {reason}")),
            }
        }
        Err(error) => report
            .notes
            .push(format!("no FMUs of the extended model: {error}")),
    }
    if let Evidence::ShakeTable(evidence) = &mut report.evidence {
        evidence.co_simulation = comparison.as_ref().map(|played| played.gain.clone());
    }
    Ok(Extended { model, comparison })
}

/// Place of an FMU below the folder of the results.
fn name(fmu: &PackedFmu) -> String {
    format!("{}/{}.fmu", fmu.version.folder(), fmu.name)
}

fn find<'a>(fmus: &'a [PackedFmu], name: &str) -> Option<&'a PackedFmu> {
    let mut all = fmus.iter();
    all.find(|fmu| fmu.version == FmiVersion::V3 && fmu.name == name)
}

/// The FMUs of the extended model, where they lie until the results are complete.
fn fmus(
    model: &ExtendedModel,
    installation: &Installation,
    results: &mut Results,
) -> Result<Vec<PackedFmu>, Error> {
    let built = model.write_fmus(installation.fmus()?, results.staging())?;
    for fmu in &built {
        results.adopt(&name(fmu));
    }
    Ok(built)
}

/// Why a case is not co-simulated in closed loop.
#[derive(Debug, thiserror::Error)]
enum NotPlayed {
    /// No law to close the loop with.
    #[error("the case states no law")]
    NoLaw,
    /// Nothing to play.
    #[error("the validation record has no column `reference`")]
    NoReference,
    /// A channel that the law needs and the record does not have.
    #[error("without `{0}` it cannot be checked whether the stated law made the command (R5)")]
    Unchecked(&'static str),
    /// Another law than the stated one.
    #[error("the stated law did not make the recorded command (R5)")]
    OtherLaw,
    /// The components of the project cannot be built.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// The project has no component of that name.
    #[error("there is no component `{0}`")]
    NoComponent(String),
    /// The run fails.
    #[error(transparent)]
    Play(#[from] PlayError),
}

/// The validation record against both rigs in closed loop.
fn in_closed_loop(
    case: &Case,
    found: &Diagnosis,
    extended: &[PackedFmu],
    installation: &Installation,
) -> Result<Comparison, NotPlayed> {
    let recording = &case.validation;
    let law = case.nominal.controller.ok_or(NotPlayed::NoLaw)?;
    let is_missing = |channel: &Channel| recording.channel(*channel).is_none();
    if is_missing(&Channel::Reference) {
        return Err(NotPlayed::NoReference);
    }
    let needed = [Channel::Displacement, Channel::Acceleration];
    if let Some(missing) = needed.into_iter().find(is_missing) {
        return Err(NotPlayed::Unchecked(missing.name()));
    }
    if !found.validation.by_law {
        return Err(NotPlayed::OtherLaw);
    }
    let originals = installation.fmus()?;
    let original = |name: &str| {
        let found = find(originals, name).map(|fmu| fmu.path.clone());
        found.ok_or_else(|| NotPlayed::NoComponent(name.to_owned()))
    };
    let changed = |name: &str| {
        find(extended, name).map_or_else(|| original(name), |fmu| Ok(fmu.path.clone()))
    };
    let rig = |file: &dyn Fn(&str) -> Result<PathBuf, NotPlayed>| -> Result<RigFmus, NotPlayed> {
        Ok(RigFmus {
            table: file("ShakeTable")?,
            specimen: match case.nominal.specimen {
                Some(_) => Some(file("Specimen")?),
                None => None,
            },
            sensors: file("Instrumentation")?,
            control: file("ThreeVariableControl")?,
            ..RigFmus::default()
        })
    };
    let before = rig(&original)?.nominal(&case.nominal);
    let after = rig(&changed)?;
    Ok(co_simulation::compare(
        recording,
        &case.nominal,
        &law,
        &before,
        &after,
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_fmu_is_found_by_its_name_and_in_version_3() {
        let fmu = |name: &str, version: FmiVersion| PackedFmu {
            name: name.into(),
            version,
            path: format!("{name} {version:?}").into(),
        };
        let all = [
            fmu("Specimen", FmiVersion::V2),
            fmu("Instrumentation", FmiVersion::V3),
            fmu("Specimen", FmiVersion::V3),
            fmu("ShakeTable", FmiVersion::V2),
        ];
        assert_eq!(find(&all, "Specimen"), Some(&all[2]));
        assert_eq!(find(&all, "ShakeTable"), None);
        assert_eq!(find(&all, "ThreeVariableControl"), None);
    }

    #[test]
    fn an_fmu_of_the_results_is_in_the_folder_of_its_version() {
        let own = PackedFmu {
            name: "Specimen".into(),
            version: FmiVersion::V2,
            path: "elsewhere/one.fmu".into(),
        };
        assert_eq!(name(&own), "fmi2/Specimen.fmu");
    }
}
