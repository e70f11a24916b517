//! What differs between runs.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::run::experiment::is_file;
use crate::run::identity::{cell, tuning};
use crate::run::manifest::Manifest;
use pages::report::{UnitSystem, Units};

/// Something that is not the same in all runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// What: a setting, or `component.parameter`.
    pub what: String,
    /// Its value in each run.
    pub values: Vec<String>,
}

/// All differences: settings first, then parameters of components that are of the same model in every run; those of
/// others have nothing to be compared with.
pub(super) fn of(manifests: &[&Manifest], units: UnitSystem) -> Vec<Difference> {
    let mut found = Vec::new();
    let mut compare = |what: &str, value: &dyn Fn(&Manifest) -> String| {
        let values: Vec<String> = manifests.iter().map(|one| value(one)).collect();
        if values.iter().any(|value| *value != values[0]) {
            found.push(Difference {
                what: what.to_string(),
                values,
            });
        }
    };
    let of_rig = |manifest: &Manifest, text: &str| match is_file(&manifest.request.system) {
        true => "-".to_string(),
        false => text.to_string(),
    };
    compare("system", &|m| m.request.system.clone());
    compare("plant", &|m| of_rig(m, &m.request.plant));
    compare("specimen", &|m| of_rig(m, &m.request.specimen));
    compare("tuning", &|m| of_rig(m, &tuning(&m.request)));
    compare("motion", &|m| m.motion.name.clone());
    compare("motion as played (SHA-256)", &|m| short(&m.motion.sha256));
    compare("samples played", &|m| m.samples.to_string());
    compare("algorithm", &|m| m.algorithm.to_string());
    compare("coupling step", &|m| format!("{} ms", 1e3 * m.step_s));
    compare("version", &|m| m.shakebench.clone());
    compare("platform", &|m| m.platform.clone());
    let names: BTreeSet<&String> = manifests.iter().flat_map(|m| m.components.keys()).collect();
    for name in names {
        compare(name, &|m| {
            let component = m.components.get(name);
            component.map_or("-".into(), |c| {
                format!("{}, FMI {}, {}", c.model, c.fmi, short(&c.sha256))
            })
        });
        let all: Vec<_> = manifests
            .iter()
            .filter_map(|m| m.components.get(name))
            .collect();
        if all.len() < manifests.len() || all.iter().any(|c| c.model != all[0].model) {
            continue;
        }
        let all = all.into_iter();
        let parameters: BTreeSet<&String> = all.flat_map(|c| c.parameters.keys()).collect();
        for parameter in parameters {
            compare(&format!("{name}.{parameter}"), &|m| {
                let component = m.components.get(name);
                let value = component.and_then(|c| c.parameters.get(parameter));
                value.map_or("-".into(), |(value, unit)| {
                    let both = Units::of(unit.as_deref().unwrap_or_default());
                    cell(value, &both).text(units)
                })
            });
        }
    }
    found
}

fn short(sum: &str) -> String {
    sum.get(..12).unwrap_or(sum).to_string()
}
