//! The folder `resources` of an unpacked FMU, where a file may replace start values.
//!
//! `start_values.csv` has one line `name,value` for each parameter that starts differently from
//! the component's own defaults. An FMU made from identified data is the same library with such a
//! file and its own model description.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use percent_encoding::percent_decode_str;

use crate::{
    component::Component,
    model::Model,
    variable::{Access, Causality},
};

/// The file in `resources` that replaces start values.
pub const START_VALUES: &str = "start_values.csv";

/// Where the importer says that the resources lie.
#[derive(Debug, Clone, Copy)]
pub enum Location<'a> {
    /// Nowhere.
    Unknown,
    /// A URI, as in FMI 2.0.
    Uri(&'a str),
    /// A path, as in FMI 3.0.
    Path(&'a str),
}

impl Location<'_> {
    /// The folder as a path; `None` if there is none or it is not on this file system.
    pub fn folder(&self) -> Option<PathBuf> {
        match self {
            Self::Unknown => None,
            Self::Path(path) => (!path.is_empty()).then(|| PathBuf::from(path)),
            Self::Uri(uri) => {
                let rest = uri.strip_prefix("file:")?;
                let path = match rest.strip_prefix("//") {
                    Some(after) => &after[after.find('/')?..],
                    None => rest,
                };
                let path = percent_decode_str(path).decode_utf8().ok()?;
                // On Windows the path behind `file:///C:/...` has no slash in front.
                let drive = path.as_bytes().get(2) == Some(&b':');
                Some(PathBuf::from(if drive { &path[1..] } else { &path[..] }))
            }
        }
    }
}

/// The component's defaults, changed as the file in its resources says.
///
/// # Errors
/// Names the file and line that cannot be used.
pub fn start_values<C: Component>(model: &Model<C>, location: Location<'_>) -> Result<C, String> {
    let mut component = C::default();
    if let Some(folder) = location.folder() {
        let file = folder.join(START_VALUES);
        match fs::read_to_string(&file) {
            Ok(text) => apply(model, &mut component, &text, &file)?,
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
                ) => {}
            Err(e) => return Err(format!("{}: {e}", file.display())),
        }
    }
    Ok(component)
}

fn apply<C: Component>(
    model: &Model<C>,
    component: &mut C,
    text: &str,
    file: &Path,
) -> Result<(), String> {
    for (number, line) in text
        .lines()
        .enumerate()
        .filter(|(_, l)| !l.trim().is_empty())
    {
        let fail = |problem: String| format!("{}:{}: {problem}", file.display(), number + 1);
        let (name, value) = line
            .split_once(',')
            .ok_or_else(|| fail(format!("`{line}`, expected `name,value`")))?;
        let (name, value) = (name.trim(), value.trim());
        let (_, variable) = model
            .find(name)
            .filter(|(_, v)| v.causality == Causality::Parameter)
            .ok_or_else(|| fail(format!("`{name}` is no parameter of {}", C::NAME)))?;
        let number: f64 = value
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .ok_or_else(|| fail(format!("`{value}` is no number")))?;
        let (min, max) = (variable.min, variable.max);
        if min.is_some_and(|min| number < min) || max.is_some_and(|max| number > max) {
            return Err(fail(format!("`{name}` = {number} is out of its range")));
        }
        match &variable.access {
            Access::Real(field) => *field(component) = number,
            Access::Element(field, index) => field(component)[*index] = number,
            _ => return Err(fail(format!("`{name}` is no Float64"))),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(uri: &str) -> Option<PathBuf> {
        Location::Uri(uri).folder()
    }

    #[test]
    fn resource_uris_become_paths() {
        let unix = Some(PathBuf::from("/tmp/a b/resources"));
        assert_eq!(folder("file:///tmp/a%20b/resources"), unix);
        assert_eq!(folder("file:/tmp/a%20b/resources"), unix);
        assert_eq!(folder("file://localhost/tmp/a%20b/resources"), unix);
        let windows = Some(PathBuf::from("C:/Temp/resources"));
        assert_eq!(folder("file:///C:/Temp/resources"), windows);
        assert_eq!(folder("https://example.org/resources"), None);
        assert_eq!(folder("file:é"), Some(PathBuf::from("é")));
        assert_eq!(
            Location::Path("/tmp/a%20b").folder(),
            Some(PathBuf::from("/tmp/a%20b"))
        );
        assert_eq!(Location::Path("").folder(), None);
    }
}
