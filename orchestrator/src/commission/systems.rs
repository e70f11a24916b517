//! A system file for a controller on its rig: everything that was chosen stands in it, so that
//! `shakebench run FILE` needs nothing else.

use std::path::Path;

use super::Request;
use crate::error::Error;
use crate::system::built_in;
use crate::system::tuning::Wanted;
use crate::system::{Setting, SystemFile};

/// The system of `controller`, designed on the file `model`, as TOML.
pub(super) fn system(request: &Request, controller: &str, model: &Path) -> Result<String, Error> {
    let wanted = Wanted {
        model: Some(model),
        ..Wanted::default()
    };
    let mut file = built_in::system(controller, &request.plant, &request.specimen, wanted)?;
    for setting in &request.set {
        set(&mut file, setting);
    }
    file.description = format!("{controller}, designed on model.toml");
    Ok(file.to_toml())
}

/// A parameter of the command line; the rig has been run with it already.
fn set(file: &mut SystemFile, setting: &str) {
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
