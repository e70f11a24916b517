//! Where the project's own components come from: a folder of packed FMUs that is given or next to
//! the program, else the workspace, where they are built.

use std::{
    env,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use roxmltree::Document;
use serde::Serialize;
use zip::ZipArchive;

use super::archive::{PackedFmu, fmus_in};
use super::error::PackError;
use super::up_to_date::{self, Sources};
use super::workspace::Workspace;
use crate::program::{self, VERSION};
use fmi_import::{FmiVersion, Options};
use units::hint;

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

/// The project's components as a program has them, and the program that runs FMUs in processes of their own. Copies
/// share what was found.
#[derive(Debug, Clone, Default)]
pub struct Installation(Arc<Parts>);

#[derive(Debug, Default)]
struct Parts {
    named: Option<PathBuf>,
    guest: Option<PathBuf>,
    fmus: OnceLock<Result<Vec<PackedFmu>, String>>,
}

/// Two are equal if they name the same folder and the same program, whatever is found there.
impl PartialEq for Installation {
    fn eq(&self, other: &Self) -> bool {
        self.0.named == other.0.named && self.0.guest == other.0.guest
    }
}

impl Installation {
    /// Components of the folder `named`, FMUs in processes of the program `guest`; none: those that are found.
    #[must_use]
    pub fn new(named: Option<PathBuf>, guest: Option<PathBuf>) -> Self {
        Self(Arc::new(Parts {
            named,
            guest,
            fmus: OnceLock::new(),
        }))
    }

    /// The folder that components come from. In a workspace it may lack some until they are built.
    ///
    /// # Errors
    /// When there is none; the message says where it was looked for.
    pub fn folder(&self) -> Result<Folder, PackError> {
        let chosen = |path: PathBuf, origin| Ok(Folder { path, origin });
        if let Some(path) = &self.0.named {
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

    /// All FMUs of both versions, found or built at most once.
    ///
    /// # Errors
    /// No folder, one without FMUs, or components that do not build.
    pub fn fmus(&self) -> Result<&[PackedFmu], PackError> {
        let find = || self.find_all().map_err(|error| error.to_string());
        let fmus = self.0.fmus.get_or_init(find);
        fmus.as_deref().map_err(|e| PackError::Earlier(e.clone()))
    }

    /// The packed FMU of a component of this project, checked.
    ///
    /// # Errors
    /// An unknown name (with the nearest one), components that cannot be found or built, an FMU that is
    /// damaged or of another version.
    pub fn component(
        &self,
        name: &str,
        version: FmiVersion,
    ) -> Result<&PackedFmu, Box<dyn std::error::Error>> {
        let own = |fmu: &&PackedFmu| fmu.version == version;
        let packed: Vec<&PackedFmu> = self.fmus()?.iter().filter(own).collect();
        let Some(&found) = packed.iter().find(|fmu| fmu.name == name) else {
            let known = packed.iter().map(|fmu| fmu.name.as_str());
            let hint = hint(name, known);
            return Err(format!(
                "`{name}` is neither a path to an .fmu file nor a component in {}{hint}",
                self.folder()?.path.join(version.folder()).display()
            )
            .into());
        };
        check(found)?;
        Ok(found)
    }

    /// The program that carries out calls of FMUs in processes of their own.
    #[must_use]
    pub fn guest(&self) -> Option<PathBuf> {
        self.0.guest.clone().or_else(program::guest)
    }

    /// How FMUs run by default: in this process, and where one must be alone in one of [`Self::guest`].
    #[must_use]
    pub fn options(&self) -> Options {
        Options {
            guest: self.guest(),
            ..Options::default()
        }
    }

    fn find_all(&self) -> Result<Vec<PackedFmu>, PackError> {
        let Folder { path, origin } = self.folder()?;
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
}

/// All FMUs of both versions, as an [`Installation`] by default finds them.
///
/// # Errors
/// As [`Installation::fmus`].
pub fn all_fmus() -> Result<Vec<PackedFmu>, PackError> {
    Installation::default().find_all()
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn empty(folder: &Path, file: &str) {
        fs::create_dir_all(folder.join(file).parent().unwrap()).unwrap();
        fs::write(folder.join(file), "").unwrap();
    }

    #[test]
    fn two_installations_have_components_of_their_own() {
        let [one, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        empty(one.path(), "fmi3/One.fmu");
        empty(one.path(), "fmi2/One.fmu");
        empty(one.path(), "fmi3/notes.txt");
        empty(other.path(), "fmi3/Other.fmu");
        let [first, second] =
            [&one, &other].map(|own| Installation::new(Some(own.path().into()), None));
        let names = |own: &Installation| -> Vec<(String, FmiVersion)> {
            let fmus = own.fmus().unwrap().iter();
            fmus.map(|fmu| (fmu.name.clone(), fmu.version)).collect()
        };
        let both = FmiVersion::ALL.map(|version| ("One".to_string(), version));
        assert_eq!(names(&first), both);
        assert_eq!(names(&second), [("Other".to_string(), FmiVersion::V3)]);
        assert_eq!(first.folder().unwrap().origin, Origin::Option);
        // Copies share what was found; what appears later is not looked for.
        empty(one.path(), "fmi3/Late.fmu");
        assert_eq!(names(&first.clone()), both);
        let told = first.component("Ome", FmiVersion::V3).unwrap_err();
        let told = told.to_string();
        assert!(told.contains("`Ome`") && told.contains("One"), "{told}");
        // A file that is not an FMU is refused by its path.
        let told = first.component("One", FmiVersion::V3).unwrap_err();
        assert!(told.to_string().contains("One.fmu"), "{told}");
    }

    #[test]
    fn a_folder_holds_fmus_below_the_version_that_they_are_of() {
        let folder = tempfile::tempdir().unwrap();
        let holds = || holds_fmus(folder.path());
        assert!(!holds());
        empty(folder.path(), "fmi3/notes.txt");
        empty(folder.path(), "One.fmu");
        assert!(!holds());
        empty(folder.path(), "fmi2/One.fmu");
        assert!(holds());
    }

    #[test]
    fn an_empty_folder_is_refused_with_who_named_it() {
        let folder = tempfile::tempdir().unwrap();
        let own = Installation::new(Some(folder.path().into()), Some("guest".into()));
        let told = own.fmus().unwrap_err().to_string();
        assert!(told.contains("named by --fmus"), "{told}");
        assert_eq!(own.options().guest.as_deref(), Some(Path::new("guest")));
        assert_eq!(own, own.clone());
        assert_ne!(own, Installation::default());
    }

    fn sound(path: &Path, version: FmiVersion) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let text = format!(
            r#"<a generationTool="fmu-kit 1" version="{VERSION}" fmiVersion="{version}"/>"#
        );
        let entries = [("modelDescription.xml".to_string(), text.into_bytes())];
        crate::write_archive(path, &entries.into(), None).unwrap();
    }

    #[test]
    fn a_component_is_found_by_name_and_version() {
        let folder = tempfile::tempdir().unwrap();
        let place = |file: &str| folder.path().join(file);
        sound(&place("fmi2/One.fmu"), FmiVersion::V2);
        sound(&place("fmi3/One.fmu"), FmiVersion::V3);
        sound(&place("fmi2/Two.fmu"), FmiVersion::V2);
        let own = Installation::new(Some(folder.path().into()), None);
        for (name, version, file) in [
            ("One", FmiVersion::V2, "fmi2/One.fmu"),
            ("One", FmiVersion::V3, "fmi3/One.fmu"),
            ("Two", FmiVersion::V2, "fmi2/Two.fmu"),
        ] {
            let found = own.component(name, version).unwrap();
            assert_eq!((&*found.name, found.version), (name, version));
            assert_eq!(found.path, place(file));
        }
        // There is none of FMI 3.0, whose components alone are proposed.
        let told = own.component("Two", FmiVersion::V3).unwrap_err();
        let folder = place("fmi3").display().to_string();
        let expected =
            format!("`Two` is neither a path to an .fmu file nor a component in {folder}");
        assert!(told.to_string().starts_with(&expected), "{told}");
    }

    #[test]
    fn an_fmu_of_another_program_version_or_tool_is_unfit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("One.fmu");
        let told = |text: &str| {
            let entries = [("modelDescription.xml".to_string(), text.as_bytes().to_vec())];
            crate::write_archive(&path, &entries.into(), None).unwrap();
            let fmu = PackedFmu {
                name: "One".into(),
                version: FmiVersion::V3,
                path: path.clone(),
            };
            check(&fmu).map_err(|error| error.to_string())
        };
        let good =
            format!(r#"<a generationTool="fmu-kit 1" version="{VERSION}" fmiVersion="3.0"/>"#);
        assert_eq!(told(&good), Ok(()));
        for (text, expected) in [
            (good.replace("fmu-kit", "Other"), "made by `Other 1`"),
            (
                good.replace(VERSION, "0.0.0"),
                "is of version 0.0.0, this program of ",
            ),
            (good.replace("\"3.0\"", "\"2.0\""), "is for FMI 2.0"),
            ("no XML".to_string(), "has a damaged modelDescription.xml"),
        ] {
            let told = told(&text).unwrap_err();
            assert!(
                told.contains(expected) && told.contains("One.fmu"),
                "{told}"
            );
        }
    }

    #[test]
    fn messages_name_who_chose_a_folder_and_where_else_was_looked() {
        let words = [
            Origin::Option,
            Origin::Environment,
            Origin::BesideProgram,
            Origin::Workspace,
        ]
        .map(Origin::words);
        assert_eq!(
            words,
            [
                "named by --fmus",
                "named by SHAKEBENCH_FMUS",
                "beside the program",
                "of the workspace"
            ]
        );
        let none = |beside: Vec<PathBuf>| PackError::NoFmus { beside }.to_string();
        assert!(
            none(Vec::new())
                .starts_with("no FMUs of the components: none next to the program, none in --fmus")
        );
        let told = none(vec!["/a".into(), "/b/c".into()]);
        assert!(
            told.contains("none next to the program (/a, /b/c), none in"),
            "{told}"
        );
        let places = beside_program();
        assert!(
            places[0].ends_with("fmus") && places[1].ends_with("share/shakebench/fmus"),
            "{places:?}"
        );
    }
}
