//! The figures of an identification.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use identification::identify::identified::RigIdentification;
use serde::Serialize;

/// What `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// The model file.
    pub model: PathBuf,
    /// Poles of G1 and G2, `[re, im]` in 1/s; empty where the data do not determine them.
    pub actuator_poles_rad_s: Vec<[f64; 2]>,
    /// Poles of the table.
    pub table_poles_rad_s: Vec<[f64; 2]>,
    /// Fit of each channel on the validation part; the worst of several recordings.
    pub fit_percent: BTreeMap<String, Option<f64>>,
    /// Whether the data determine the actuator.
    pub identifiable: bool,
    /// Everything the reader should know.
    pub warnings: Vec<String>,
    /// Time taken, s.
    pub wall_s: f64,
}

impl Summary {
    /// Of what was found; `model` is the file that holds it.
    pub(super) fn new(
        model: &Path,
        found: &RigIdentification,
        warnings: Vec<String>,
        wall_s: f64,
    ) -> Self {
        let pairs =
            |poles: Vec<nalgebra::Complex<f64>>| poles.iter().map(|p| [p.re, p.im]).collect();
        let mut fit_percent = BTreeMap::new();
        for fit in &found.fits {
            let own = fit.simulated.is_finite().then_some(fit.simulated);
            let slot = fit_percent.entry(fit.channel.to_string()).or_insert(own);
            if let (Some(before), Some(own)) = (*slot, own) {
                *slot = Some(before.min(own));
            }
        }
        Self {
            model: model.to_path_buf(),
            actuator_poles_rad_s: if found.identifiable {
                pairs(found.actuator_poles())
            } else {
                Vec::new()
            },
            table_poles_rad_s: pairs(found.table_poles()),
            fit_percent,
            identifiable: found.identifiable,
            warnings,
            wall_s,
        }
    }
}
