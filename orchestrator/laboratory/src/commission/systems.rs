//! A system file for a controller on its rig: it contains every choice, so that `shakebench run
//! FILE` needs nothing else.

use std::path::Path;

use super::Request;
use crate::error::Error;
use crate::systems::built_in;
use crate::systems::tuning::{Tuning, Wanted};
use fmi_system::{Setting, SystemFile};

/// The system of `controller`, designed on the file `model`, as TOML.
pub(super) fn system(request: &Request, controller: &str, model: &Path) -> Result<String, Error> {
    let wanted = Wanted {
        model: Some(model),
        ..Wanted::default()
    };
    written(request, controller, wanted, "designed on model.toml")
}

/// The system of `controller` with the gains under which the rig was recorded.
pub(super) fn recorded(request: &Request, controller: &str) -> Result<String, Error> {
    let wanted = Wanted {
        tuning: Some(Tuning::Printed),
        ..Wanted::default()
    };
    written(
        request,
        controller,
        wanted,
        "with the gains of the recordings",
    )
}

fn written(
    request: &Request,
    controller: &str,
    wanted: Wanted<'_>,
    how: &str,
) -> Result<String, Error> {
    let mut file = built_in::system(controller, &request.plant, &request.specimen, wanted)?;
    for setting in &request.set {
        set(&mut file, setting);
    }
    file.description = format!("{controller}, {how}");
    Ok(file.to_toml())
}

/// A parameter of the command line; the rig has been run with it already.
pub(super) fn set(file: &mut SystemFile, setting: &str) {
    let parts = setting
        .split_once('=')
        .and_then(|(name, value)| Some((name.split_once('.')?, value)));
    let Some(((component, variable), value)) = parts else {
        return;
    };
    if let Some(component) = file.components.get_mut(component.trim()) {
        component.set(variable.trim(), Setting::read(value.trim()));
    }
}
