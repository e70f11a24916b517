//! Where the project's own components come from: a folder of packed FMUs that is given or next to
//! the program, else the workspace, where they are built.

use std::{
    env,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::OnceLock,
};

use roxmltree::Document;
use serde::Serialize;
use zip::ZipArchive;

use super::archive::{PackedFmu, fmus_in};
use super::error::PackError;
use super::up_to_date::{self, Sources};
use super::workspace::Workspace;
use crate::program::{self, VERSION};
use fmi_import::FmiVersion;

/// The environment variable that names a folder of packed FMUs.
pub const VARIABLE: &str = "SHAKEBENCH_FMUS";

/// Why a folder was chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// `--fmus` named it.
    Option,
    /// `SHAKEBENCH_FMUS` named it.
    Environment,
    /// It is next to the program.
    BesideProgram,
    /// The workspace builds into it.
    Workspace,
}

/// A folder with `fmi2/NAME.fmu` and `fmi3/NAME.fmu`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder {
    /// The folder.
    pub path: PathBuf,
    /// Why it was chosen.
    pub origin: Origin,
}

static NAMED: OnceLock<PathBuf> = OnceLock::new();

/// Takes components from a folder for the rest of this process. The first call counts.
pub fn take_from(folder: &Path) {
    let _ = NAMED.set(folder.to_path_buf());
}

/// The folder that components come from. In a workspace it may lack some until they are built.
///
/// # Errors
/// When there is none; the message says where it was looked for.
pub fn folder() -> Result<Folder, PackError> {
    let chosen = |path: PathBuf, origin| Ok(Folder { path, origin });
    if let Some(path) = NAMED.get() {
        return chosen(path.clone(), Origin::Option);
    }
    if let Some(path) = env::var_os(VARIABLE).filter(|path| !path.is_empty()) {
        return chosen(path.into(), Origin::Environment);
    }
    let beside = beside_program();
    if let Some(path) = beside.iter().find(|path| holds_fmus(path)) {
        return chosen(path.clone(), Origin::BesideProgram);
    }
    match Workspace::find() {
        Ok(workspace) => chosen(workspace.fmus(), Origin::Workspace),
        Err(_) => Err(PackError::NoFmus { beside }),
    }
}

/// All FMUs of both versions, found or built at most once in a process.
///
/// # Errors
/// No folder, one without FMUs, or components that do not build.
pub fn all_fmus() -> Result<&'static [PackedFmu], PackError> {
    static FMUS: OnceLock<Result<Vec<PackedFmu>, String>> = OnceLock::new();
    let fmus = FMUS.get_or_init(|| find_all().map_err(|error| error.to_string()));
    fmus.as_deref().map_err(|e| PackError::Earlier(e.clone()))
}

fn find_all() -> Result<Vec<PackedFmu>, PackError> {
    let Folder { path, origin } = folder()?;
    if origin == Origin::Workspace {
        let workspace = Workspace::find()?;
        if let Some(fmus) = up_to_date::packed(&workspace, &path) {
            return Ok(fmus);
        }
        let sources = Sources::read(&workspace);
        match super::build_fmus(&path, &FmiVersion::ALL) {
            // Without cargo those that are there have to do.
            Err(PackError::NoCargo { .. }) if holds_fmus(&path) => {}
            Err(error) => return Err(error),
            Ok(fmus) => {
                if let Some(sources) = sources {
                    sources.note(&path, &fmus);
                }
                return Ok(fmus);
            }
        }
    }
    let found = fmus_in(&path)?;
    if found.is_empty() {
        return Err(PackError::EmptyFolder {
            by: origin.words(),
            folder: path,
        });
    }
    Ok(found)
}

/// Checks that an FMU of the project is whole and of this program's version.
///
/// # Errors
/// What is wrong with it, and what to do.
pub fn check(fmu: &PackedFmu) -> Result<(), PackError> {
    let unfit = |problem: String| PackError::Unfit {
        path: fmu.path.clone(),
        problem,
    };
    let text = description(&fmu.path).map_err(|e| unfit(format!("is damaged ({e})")))?;
    let document = Document::parse(&text)
        .map_err(|e| unfit(format!("has a damaged modelDescription.xml ({e})")))?;
    let root = document.root_element();
    let stated = |name| root.attribute(name).unwrap_or_default();
    if !stated("generationTool").starts_with("fmu-kit ") {
        return Err(unfit(format!(
            "is not a component of this program, but made by `{}`; refer to such an FMU by its \
             path in a system file",
            stated("generationTool")
        )));
    }
    if stated("version") != VERSION {
        return Err(unfit(format!(
            "is of version {}, this program of {VERSION}",
            stated("version")
        )));
    }
    if stated("fmiVersion") != fmu.version.to_string() {
        return Err(unfit(format!("is for FMI {}", stated("fmiVersion"))));
    }
    Ok(())
}

fn description(path: &Path) -> io::Result<String> {
    let mut archive = ZipArchive::new(File::open(path)?)?;
    let mut file = archive.by_name("modelDescription.xml")?;
    let mut text = String::new();
    file.read_to_string(&mut text)?;
    Ok(text)
}

/// Where an installation may keep them: the program's own folder, or `share` beside its `bin`.
fn beside_program() -> Vec<PathBuf> {
    let program = program::file().ok();
    let Some(folder) = program.as_deref().and_then(Path::parent) else {
        return Vec::new();
    };
    let mut places = vec![folder.join("fmus")];
    places.extend(folder.parent().map(|up| up.join("share/shakebench/fmus")));
    places
}

fn holds_fmus(folder: &Path) -> bool {
    fmus_in(folder).is_ok_and(|fmus| !fmus.is_empty())
}

impl Origin {
    /// Who chose the folder, as a message names it.
    pub fn words(self) -> &'static str {
        match self {
            Self::Option => "named by --fmus",
            Self::Environment => "named by SHAKEBENCH_FMUS",
            Self::BesideProgram => "beside the program",
            Self::Workspace => "of the workspace",
        }
    }
}
