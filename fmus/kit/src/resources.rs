//! The folder `resources` of an unpacked FMU, where a file may replace start values.
//!
//! `start_values.csv` has one line `name,value` for each parameter that starts differently from
//! the component's own defaults. A variant of an FMU, made from identified data for instance, is
//! the same library with such a file and its own model description; its token tells it from the
//! original and from other variants.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use percent_encoding::percent_decode_str;

use crate::{
    checksum::fingerprint,
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

/// The file that replaces start values, with its text; `None` if there is none.
///
/// # Errors
/// When the file is there but cannot be read.
pub fn start_values(location: Location<'_>) -> Result<Option<(PathBuf, String)>, String> {
    let Some(file) = location.folder().map(|folder| folder.join(START_VALUES)) else {
        return Ok(None);
    };
    Ok(optional_text(&file)?.map(|text| (file, text)))
}

/// The text of a file; `None` if there is none.
///
/// # Errors
/// When the file is there but cannot be read.
pub fn optional_text(file: &Path) -> Result<Option<String>, String> {
    match fs::read_to_string(file) {
        Ok(text) => Ok(Some(text)),
        Err(e)
            if matches!(
                e.kind(),
                io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
            ) =>
        {
            Ok(None)
        }
        Err(e) => Err(format!("{}: {e}", file.display())),
    }
}

/// The token of the variant that a file of start values makes of the FMU with `token`.
pub fn variant_token(token: &str, start_values: &str) -> String {
    fingerprint(&format!("{token}\n{start_values}"))
}

/// Changes a component as the text of its file of start values says.
///
/// # Errors
/// Names the file and line that cannot be used.
pub fn apply<C: Component>(
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
            .ok_or_else(|| fail(format!("`{name}` is not a parameter of {}", C::NAME)))?;
        let number: f64 = value
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .ok_or_else(|| fail(format!("`{value}` is not a number")))?;
        let (min, max) = (variable.min, variable.max);
        if min.is_some_and(|min| number < min) || max.is_some_and(|max| number > max) {
            return Err(fail(format!("`{name}` = {number} is out of its range")));
        }
        match &variable.access {
            access if access.is_real() => {
                if let Some(place) = access.real(component) {
                    *place = number;
                }
            }
            Access::Choice(field, choices) => {
                let mut known = choices.items.iter().map(|item| item.value);
                let chosen = known.find(|value| f64::from(*value) == number);
                *field(component) = chosen.ok_or_else(|| {
                    fail(format!("`{name}` = {number} is none of {}", choices.name))
                })?;
            }
            _ => {
                return Err(fail(format!(
                    "`{name}` is neither Float64 nor an enumeration"
                )));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oscillator::Oscillator;

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

    #[test]
    fn start_values_are_applied_or_refused_by_line() {
        let model = Model::<Oscillator>::get().unwrap();
        let file = Path::new("start_values.csv");
        let mut component = Oscillator::default();
        apply(model, &mut component, "mass, 3.5\n\nstiffness,7e2\n", file).unwrap();
        assert_eq!(component.mass, 3.5);
        for (line, expected) in [
            ("mass", "start_values.csv:2: `mass`, expected `name,value`"),
            (
                "force,1",
                "start_values.csv:2: `force` is not a parameter of Oscillator",
            ),
            ("mass,two", "start_values.csv:2: `two` is not a number"),
            ("mass,NaN", "start_values.csv:2: `NaN` is not a number"),
            (
                "mass,0.01",
                "start_values.csv:2: `mass` = 0.01 is out of its range",
            ),
            (
                "note,1",
                "start_values.csv:2: `note` is neither Float64 nor an enumeration",
            ),
        ] {
            let text = format!("stiffness,1\n{line}\n");
            assert_eq!(
                apply(model, &mut component, &text, file),
                Err(expected.to_string())
            );
        }
    }

    #[test]
    fn a_file_of_start_values_is_read_where_it_is() {
        let folder = std::env::temp_dir().join(format!("fmu-kit-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let location = Location::Path(folder.to_str().unwrap());
        assert_eq!(start_values(location), Ok(None));
        assert_eq!(start_values(Location::Unknown), Ok(None));
        let file = folder.join(START_VALUES);
        fs::write(&file, "mass,3").unwrap();
        let found = start_values(location).unwrap().unwrap();
        assert_eq!(found, (file.clone(), "mass,3".to_string()));
        // A file instead of the folder is none; one that is not text is a fault.
        assert_eq!(optional_text(&file.join("below")), Ok(None));
        fs::write(&file, [0xff, 0xfe]).unwrap();
        let error = start_values(location).unwrap_err();
        assert!(error.contains(START_VALUES), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_variant_has_a_token_of_its_own() {
        let [one, same, other, foreign] = [
            ("t", "mass,1"),
            ("t", "mass,1"),
            ("t", "mass,2"),
            ("u", "mass,1"),
        ]
        .map(|(token, values)| variant_token(token, values));
        assert_eq!(one, same);
        assert!(one != other && one != foreign && one != "t");
    }
}
