//! An SSP archive: whether it can be read, its components, and whether its system holds together.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Findings, Severity};
use fmi_ssp as ssp;
use fmi_system::{Files, assemble};

/// Checks an archive.
pub(super) fn check(findings: &mut Findings, path: &Path, guest: Option<&Path>) {
    let name = path.display().to_string();
    let front = format!("{name}: ");
    let plain = |message: &str| message.replace(&front, "");
    let file = match ssp::read(&name) {
        Ok(file) => file,
        Err(error) => {
            findings.error("archive", plain(&error.to_string()));
            return;
        }
    };
    findings.check(format!(
        "{}: {} components, {} connections",
        ssp::STRUCTURE,
        file.components.len(),
        file.connections.len()
    ));
    if file.components.is_empty() {
        findings.warning(ssp::STRUCTURE, "the system has no component");
        return;
    }
    let folder = file.directory.clone().unwrap_or_default();
    let used: BTreeSet<&String> = file.components.values().map(|part| &part.fmu).collect();
    let mut sound = true;
    for fmu in used {
        let mut own = Findings::default();
        super::fmu(&mut own, &folder.join(fmu), guest);
        sound &= own.count(Severity::Error) == 0;
        for finding in own.findings {
            let place = format!("{fmu}: {}", finding.place);
            findings.add(finding.severity, &place, finding.message);
        }
        findings.check(format!("{fmu}: as an FMU"));
    }
    match assemble(&file, &[], &mut Files::of(&file)) {
        Err(error) => findings.error(ssp::STRUCTURE, plain(&error.to_string())),
        Ok(system) => {
            for note in &system.notes {
                findings.note(ssp::STRUCTURE, note.clone());
            }
            if let Err(error) = system.schedule(true) {
                findings.error(ssp::STRUCTURE, error.to_string());
            } else if let Err(error) = system.schedule(false) {
                findings.note(ssp::STRUCTURE, error.to_string());
            }
            findings.check("the system: names, types, units, order of calls");
        }
    }
    if !sound {
        findings.note(
            ssp::STRUCTURE,
            "a component is faulty, so the system was not run",
        );
    }
}
