//! The command that repeats a run.

use std::path::Path;

use fmi_import::FmiVersion;
use laboratory::run::experiment::{Request, is_file};
use motion::Scaling;

/// The command that carries a request out.
pub(super) fn command(request: &Request) -> String {
    let mut words = vec!["shakebench run".to_string(), quoted(&request.system)];
    let mut option = |name: &str, value: String| words.push(format!("--{name} {}", quoted(&value)));
    let path = |path: &Path| path.display().to_string();
    if !is_file(&request.system) {
        option("plant", request.plant.clone());
        option("specimen", request.specimen.clone());
        if let Some(structure) = &request.structure {
            option("structure", structure.clone());
        }
        if let Some(tuning) = request
            .tuning
            .and_then(|tuning| clap::ValueEnum::to_possible_value(&tuning))
        {
            option("tuning", tuning.get_name().to_string());
        }
        if let Some(model) = &request.control_model {
            option("control-model", path(model));
        }
    }
    match (&request.record, &request.reference) {
        (_, Some(reference)) => option("reference", path(reference)),
        (Some(record), None) => option("record", path(record)),
        (None, None) => option("seed", request.seed.to_string()),
    }
    match request.scaling {
        Some(Scaling::Factor(factor)) => option("scale", format!("{factor:?}")),
        Some(Scaling::PeakAcceleration(peak)) => option("pga", format!("{:?} m/s2", peak)),
        Some(Scaling::PeakDisplacement(peak)) => option("peak", format!("{peak:?} m")),
        Some(Scaling::Within { .. }) | None => {}
    }
    if request.fmi == FmiVersion::V2 {
        option("fmi", "2".to_string());
    }
    if let Some(algorithm) = request.algorithm {
        option("algorithm", algorithm.to_string());
    }
    if let Some(step) = request.step_s {
        option("step", format!("{step:?} s"));
    }
    if let Some(duration) = request.duration_s {
        option("duration", format!("{duration:?} s"));
    }
    for set in &request.set {
        option("set", set.clone());
    }
    words.join(" ")
}

/// A word as a shell takes it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_string(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}
