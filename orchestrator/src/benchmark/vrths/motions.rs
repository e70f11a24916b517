//! The benchmark's ground motions, or others in their place.

use std::path::{Path, PathBuf};

use crate::error::Error;
use crate::motion::{CloughPenzien, DEFAULT_SEED, read_record};
use crate::units::nearest;

use super::simulation::Ground;

/// Names of the benchmark's records, also those of their files.
pub const RECORDS: [&str; 3] = ["el-centro", "kobe", "morgan-hill"];

/// Factor on all records.
pub const INTENSITY: f64 = 0.4;

/// A ground motion with its name.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Short name.
    pub name: String,
    /// The ground.
    pub ground: Ground,
}

/// The folder of the benchmark's data: `given`, or `vrths` in the folder that
/// `SHAKEBENCH_SHARED` names, or `../shared/vrths`; none where there is no such folder.
#[must_use]
pub fn data_folder(given: Option<&Path>) -> Option<PathBuf> {
    let usual = || match std::env::var_os("SHAKEBENCH_SHARED") {
        Some(shared) => PathBuf::from(shared).join("vrths"),
        None => PathBuf::from("../shared/vrths"),
    };
    let folder = given.map_or_else(usual, Path::to_path_buf);
    folder.is_dir().then_some(folder)
}

/// The motions of these names or files, scaled by `intensity`; without any, the benchmark's three
/// where `folder` has them, and the built-in motion otherwise.
///
/// # Errors
/// A name that is none of the benchmark's and no file, a benchmark's record without its folder,
/// and files that are no records.
pub fn motions(
    names: &[String],
    folder: Option<&Path>,
    intensity: f64,
) -> Result<Vec<Motion>, Error> {
    if names.is_empty() {
        return match folder {
            Some(folder) => RECORDS
                .iter()
                .map(|name| record(name, &folder.join(format!("{name}.csv")), intensity))
                .collect(),
            None => Ok(vec![built_in(intensity)]),
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
                            "`{name}` is a record of the benchmark, and its folder is not here; \
                             expected --data DIR with {name}.csv in it"
                        ),
                    });
                };
                return record(name, &folder.join(format!("{name}.csv")), intensity);
            }
            if name == "built-in" {
                return Ok(built_in(intensity));
            }
            let path = Path::new(name);
            if !path.exists() && path.extension().is_none() {
                let hint = nearest(name, RECORDS)
                    .map_or(String::new(), |near| format!(", did you mean `{near}`?"));
                return Err(Error::Option {
                    option: "--motion",
                    reason: format!(
                        "`{name}` is no motion{hint} Expected {}, built-in or a file",
                        RECORDS.join(", ")
                    ),
                });
            }
            let stem = path.file_stem().unwrap_or(path.as_os_str());
            record(&stem.to_string_lossy(), path, intensity)
        })
        .collect()
}

fn record(name: &str, path: &Path, intensity: f64) -> Result<Motion, Error> {
    let record = read_record(path)?;
    Ok(Motion {
        name: name.to_string(),
        ground: Ground::new(record.dt, &record.acceleration, intensity),
    })
}

fn built_in(intensity: f64) -> Motion {
    let record = CloughPenzien::default().record(DEFAULT_SEED);
    Motion {
        name: "built-in".to_string(),
        ground: Ground::new(record.dt, &record.acceleration, intensity),
    }
}
