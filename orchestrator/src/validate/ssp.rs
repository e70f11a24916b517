//! An SSP archive: whether it can be read, its components, and whether its system holds together.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Findings, Severity};
use crate::fmu::FmiVersion;
use crate::library::FmuLibrary;
use crate::ssp;
use crate::system::assemble;

/// Checks an archive.
pub(super) fn check(findings: &mut Findings, path: &Path) {
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
        super::fmu(&mut own, &folder.join(fmu));
        sound &= own.count(Severity::Error) == 0;
        for finding in own.findings {
            let place = format!("{fmu}: {}", finding.place);
            findings.add(finding.severity, &place, finding.message);
        }
        findings.check(format!("{fmu}: as an FMU"));
    }
    let mut library = FmuLibrary::of(FmiVersion::V2, &file);
    match assemble(&file, &[], &mut |name| library.find(name)) {
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
            "a component is at fault, so the system was not run",
        );
    }
}
