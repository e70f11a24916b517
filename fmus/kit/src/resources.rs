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

/// A file of an FMU's resources that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ResourceError {
    /// The file is there but cannot be read.
    #[error("{}: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's word.
        source: io::Error,
    },
    /// A line of the start values that cannot be used.
    #[error("{}:{line}: {problem}", file.display())]
    StartValue {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: StartValueError,
    },
}

/// What is wrong with a line of start values.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StartValueError {
    /// A line without a comma.
    #[error("`{0}`, expected `name,value`")]
    NoComma(String),
    /// A name that is not that of a parameter.
    #[error("`{name}` is not a parameter of {component}")]
    NotAParameter {
        /// The name.
        name: String,
        /// The component.
        component: &'static str,
    },
    /// A value that is not a finite number.
    #[error("`{0}` is not a number")]
    NotANumber(String),
    /// A number below the minimum or above the maximum.
    #[error("`{name}` = {value} is out of its range")]
    OutOfRange {
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
    },
    /// A number that is not an item of the enumeration.
    #[error("`{name}` = {value} is none of {choices}")]
    NotAChoice {
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
        /// Name of the enumeration.
        choices: &'static str,
    },
    /// A parameter of another type.
    #[error("`{0}` is neither Float64 nor an enumeration")]
    Type(String),
}

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
pub fn start_values(location: Location<'_>) -> Result<Option<(PathBuf, String)>, ResourceError> {
    let Some(file) = location.folder().map(|folder| folder.join(START_VALUES)) else {
        return Ok(None);
    };
    Ok(optional_text(&file)?.map(|text| (file, text)))
}

/// The text of a file; `None` if there is none.
///
/// # Errors
/// When the file is there but cannot be read.
pub fn optional_text(file: &Path) -> Result<Option<String>, ResourceError> {
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
        Err(source) => Err(ResourceError::Unreadable {
            file: file.into(),
            source,
        }),
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
) -> Result<(), ResourceError> {
    let lines = text.lines().enumerate();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        set(model, component, line).map_err(|problem| ResourceError::StartValue {
            file: file.into(),
            line: number + 1,
            problem,
        })?;
    }
    Ok(())
}

/// Changes a component as one line of its start values says.
fn set<C: Component>(
    model: &Model<C>,
    component: &mut C,
    line: &str,
) -> Result<(), StartValueError> {
    let (name, text) = line
        .split_once(',')
        .ok_or_else(|| StartValueError::NoComma(line.into()))?;
    let (name, text) = (name.trim().to_string(), text.trim());
    let Some((_, variable)) = model
        .find(&name)
        .filter(|(_, v)| v.causality == Causality::Parameter)
    else {
        let component = C::NAME;
        return Err(StartValueError::NotAParameter { name, component });
    };
    let value: f64 = text
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
        .ok_or_else(|| StartValueError::NotANumber(text.into()))?;
    let (min, max) = (variable.min, variable.max);
    if min.is_some_and(|min| value < min) || max.is_some_and(|max| value > max) {
        return Err(StartValueError::OutOfRange { name, value });
    }
    match &variable.access {
        access if access.is_real() => {
            if let Some(place) = access.real(component) {
                *place = value;
            }
        }
        Access::Choice(field, choices) => {
            let mut known = choices.items.iter().map(|item| item.value);
            let Some(chosen) = known.find(|item| f64::from(*item) == value) else {
                let choices = choices.name;
                return Err(StartValueError::NotAChoice {
                    name,
                    value,
                    choices,
                });
            };
            *field(component) = chosen;
        }
        _ => return Err(StartValueError::Type(name)),
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
            let refused = apply(model, &mut component, &text, file).unwrap_err();
            assert_eq!(refused.to_string(), expected);
        }
    }

    #[test]
    fn a_file_of_start_values_is_read_where_it_is() {
        let folder = std::env::temp_dir().join(format!("fmu-kit-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let location = Location::Path(folder.to_str().unwrap());
        assert_eq!(start_values(location).unwrap(), None);
        assert_eq!(start_values(Location::Unknown).unwrap(), None);
        let file = folder.join(START_VALUES);
        fs::write(&file, "mass,3").unwrap();
        let found = start_values(location).unwrap().unwrap();
        assert_eq!(found, (file.clone(), "mass,3".to_string()));
        // A file instead of the folder is none; one that is not text is a fault.
        assert_eq!(optional_text(&file.join("below")).unwrap(), None);
        fs::write(&file, [0xff, 0xfe]).unwrap();
        let error = start_values(location).unwrap_err().to_string();
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
