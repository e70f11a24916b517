//! The benchmark's ground motions, or others in their place.

use std::path::{Path, PathBuf};

use laboratory::error::Error;
use motion::{CloughPenzien, DEFAULT_SEED, read_record};
use units::nearest;

use super::simulation::Ground;

/// Names of the benchmark's records, also those of their files.
pub const RECORDS: [&str; 3] = ["el-centro", "kobe", "morgan-hill"];

/// Factor on all records.
pub const INTENSITY: f64 = 0.4;

/// A record with its name.
#[derive(Debug, Clone)]
pub struct Named {
    /// Short name.
    pub name: String,
    /// Time between samples, s.
    pub spacing: f64,
    /// Ground acceleration, m/s^2.
    pub acceleration: Vec<f64>,
}

/// A ground motion with its name.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Short name.
    pub name: String,
    /// The ground.
    pub ground: Ground,
}

/// The folder of a benchmark's data: `given`, or its own in the folder that `SHAKEBENCH_SHARED`
/// names, or in `../shared`; none where there is no such folder.
#[must_use]
pub fn data_folder(benchmark: &str, given: Option<&Path>) -> Option<PathBuf> {
    let usual = || match std::env::var_os("SHAKEBENCH_SHARED") {
        Some(shared) => PathBuf::from(shared).join(benchmark),
        None => Path::new("../shared").join(benchmark),
    };
    let folder = given.map_or_else(usual, Path::to_path_buf);
    folder.is_dir().then_some(folder)
}

/// The motions of [`records`], scaled by `intensity`.
///
/// # Errors
/// As [`records`].
pub fn motions(
    names: &[String],
    folder: Option<&Path>,
    intensity: f64,
) -> Result<Vec<Motion>, Error> {
    let records = records(names, folder)?.into_iter();
    let motion = |record: Named| Motion {
        name: record.name,
        ground: Ground::new(record.spacing, &record.acceleration, intensity),
    };
    Ok(records.map(motion).collect())
}

/// The records of these names or files; without any, the benchmark's three
/// where `folder` has them, and the built-in motion otherwise.
///
/// # Errors
/// A name that is none of the benchmark's and no file, a benchmark's record without its folder,
/// and files that are not records.
pub fn records(names: &[String], folder: Option<&Path>) -> Result<Vec<Named>, Error> {
    if names.is_empty() {
        return match folder {
            Some(folder) => RECORDS
                .iter()
                .map(|name| record(name, &folder.join(format!("{name}.csv"))))
                .collect(),
            None => Ok(vec![built_in()]),
        };
    }
    names
        .iter()
        .map(|name| {
            if RECORDS.contains(&name.as_str()) {
                let Some(folder) = folder else {
                    return Err(Error::Option {
                        option: "--motion",
                        reason: format!(
                            "`{name}` is a record of the benchmark, and its folder was not found; \
                             expected --data DIR with {name}.csv in it"
                        ),
                    });
                };
                return record(name, &folder.join(format!("{name}.csv")));
            }
            if name == "built-in" {
                return Ok(built_in());
            }
            let path = Path::new(name);
            if !path.exists() && path.extension().is_none() {
                let hint = nearest(name, RECORDS)
                    .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
                return Err(Error::Option {
                    option: "--motion",
                    reason: format!(
                        "`{name}` is not a motion; expected {}, built-in or a file{hint}",
                        RECORDS.join(", ")
                    ),
                });
            }
            let stem = path.file_stem().unwrap_or(path.as_os_str());
            record(&stem.to_string_lossy(), path)
        })
        .collect()
}

fn record(name: &str, path: &Path) -> Result<Named, Error> {
    let record = read_record(path)?;
    Ok(Named {
        name: name.to_string(),
        spacing: record.dt,
        acceleration: record.acceleration,
    })
}

fn built_in() -> Named {
    let record = CloughPenzien::default().record(DEFAULT_SEED);
    Named {
        name: "built-in".to_string(),
        spacing: record.dt,
        acceleration: record.acceleration,
    }
}
