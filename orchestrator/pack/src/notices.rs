//! Licences of what is linked into a library: each crate with the notices in its own files.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::error::PackError;

/// What cargo tells of the workspace and everything it is built on.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Package {
    id: String,
    targets: Vec<Target>,
    dependencies: Vec<Dependency>,
    features: HashMap<String, Vec<String>>,
    name: String,
    version: String,
    license: Option<String>,
    repository: Option<String>,
    source: Option<String>,
    manifest_path: PathBuf,
}

#[derive(Deserialize)]
struct Target {
    kind: Vec<String>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    rename: Option<String>,
    optional: bool,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Link>,
    features: Vec<String>,
}

#[derive(Deserialize)]
struct Link {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
    target: Option<String>,
}

impl Kind {
    /// Whether it is linked on a platform that FMI knows.
    fn is_linked(&self) -> bool {
        let is_foreign = self.target.as_ref().is_some_and(|on| on.contains("wasm"));
        self.kind.is_none() && !is_foreign
    }
}

/// The crates that a workspace's packages are linked with.
pub(super) struct Notices {
    packages: HashMap<String, Package>,
    links: HashMap<String, Vec<String>>,
}

/// How the standard library, which every program of Rust holds, is licensed.
const STANDARD_LIBRARY: &str = "Rust's standard library\n    licence: MIT OR Apache-2.0; \
    https://github.com/rust-lang/rust\n    Copyright (c) The Rust Project Contributors\n";

impl Notices {
    /// Reads the answer of `cargo metadata --format-version 1`.
    ///
    /// # Errors
    /// Another form than expected.
    pub(super) fn read(metadata: &str) -> Result<Self, PackError> {
        let metadata: Metadata =
            serde_json::from_str(metadata).map_err(|error| PackError::Answer {
                command: "metadata",
                problem: error.to_string(),
            })?;
        let packages: HashMap<String, Package> = metadata
            .packages
            .into_iter()
            .map(|package| (package.id.clone(), package))
            .collect();
        let linked = |node: Node| {
            let links = node.deps.iter().filter(|link| {
                let is_normal = link.dep_kinds.iter().any(Kind::is_linked);
                is_normal && is_linked(&packages, &node, link)
            });
            let links = links.map(|link| link.pkg.clone()).collect();
            (node.id.clone(), links)
        };
        Ok(Self {
            links: metadata.resolve.nodes.into_iter().map(linked).collect(),
            packages,
        })
    }

    /// The notices of everything that the package in `folder` is linked with, as one text.
    ///
    /// # Errors
    /// There is no such package.
    pub(super) fn of(&self, folder: &Path) -> Result<String, PackError> {
        let root = self
            .packages
            .values()
            .find(|package| package.manifest_path.parent() == Some(folder))
            .ok_or_else(|| PackError::Answer {
                command: "metadata",
                problem: format!("no package in {}", folder.display()),
            })?;
        let mut reached = BTreeSet::new();
        let mut open = vec![&root.id];
        while let Some(id) = open.pop() {
            if reached.insert(id) {
                open.extend(self.links.get(id).into_iter().flatten());
            }
        }
        let mut foreign: Vec<&Package> = reached
            .into_iter()
            .filter_map(|id| self.packages.get(id))
            .filter(|package| package.source.is_some())
            .collect();
        foreign.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
        Ok(text(&foreign))
    }
}

/// Whether a dependency gets into the library: macros run in the compiler alone, and cargo also
/// lists optional dependencies of which no feature is on.
fn is_linked(packages: &HashMap<String, Package>, node: &Node, link: &Link) -> bool {
    let (Some(package), Some(other)) = (packages.get(&node.id), packages.get(&link.pkg)) else {
        return true;
    };
    let mut kinds = other.targets.iter().flat_map(|target| &target.kind);
    if kinds.any(|kind| kind == "proc-macro") {
        return false;
    }
    let mut named = package.dependencies.iter().filter(|d| d.name == other.name);
    named.any(|dependency| {
        let name = dependency.rename.as_ref().unwrap_or(&dependency.name);
        let turned_on = |feature: &String| {
            let mut values = package.features.get(feature).into_iter().flatten();
            values.any(|value| {
                let value = value.strip_prefix("dep:").unwrap_or(value);
                value == name
                    || value
                        .strip_prefix(name.as_str())
                        .is_some_and(|rest| rest.starts_with('/'))
            })
        };
        !dependency.optional || node.features.contains(name) || node.features.iter().any(turned_on)
    })
}

fn text(packages: &[&Package]) -> String {
    let mut text = format!(
        "Linked into this library or program, under the MIT licence where there is a choice with it:\n\n\
         {STANDARD_LIBRARY}"
    );
    // Many crates carry the same text: it stands once, under a number.
    let mut texts: BTreeMap<String, usize> = BTreeMap::new();
    let mut ordered: Vec<String> = Vec::new();
    for package in packages {
        let numbers: Vec<String> = licence_files(package)
            .into_iter()
            .map(|content| {
                let next = texts.len() + 1;
                // Texts that differ in their line breaks and capitals alone are the same.
                let words: Vec<&str> = content.split_whitespace().collect();
                let key = words.join(" ").to_lowercase();
                let number = *texts.entry(key).or_insert(next);
                if number == next {
                    ordered.push(content);
                }
                format!("[{number}]")
            })
            .collect();
        text += &format!(
            "\n{} {}\n    licence: {}; {}\n",
            package.name,
            package.version,
            package.license.as_deref().unwrap_or("see its files"),
            package.repository.as_deref().unwrap_or("crates.io"),
        );
        text += &match numbers.is_empty() {
            true => "    no file of its own with a notice\n".to_string(),
            false => format!("    notices: {}\n", numbers.join(" ")),
        };
    }
    for (index, content) in ordered.iter().enumerate() {
        text += &format!("\n{:=<78}\n[{}]\n\n{content}", "", index + 1);
    }
    text
}

/// Whether a crate may be taken under the MIT licence, at the user's choice.
fn offers_mit(package: &Package) -> bool {
    let licence = package.license.as_deref().unwrap_or("");
    let is_choice = !licence.contains("AND") && !licence.contains('(');
    let mut choices = licence.split(" OR ").flat_map(|one| one.split('/'));
    is_choice && choices.any(|one| one.trim() == "MIT")
}

/// The texts of a crate's licence files, tidied so that equal ones are equal; of several licences to
/// choose from the MIT licence, where its text is there.
fn licence_files(package: &Package) -> Vec<String> {
    let folder = package.manifest_path.parent().unwrap_or(Path::new(""));
    let is_notice = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.to_uppercase();
        let begins = ["LICEN", "COPYING", "NOTICE", "COPYRIGHT", "UNLICENSE"];
        begins.iter().any(|begin| name.starts_with(begin)) && path.is_file()
    };
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(is_notice)
        .collect();
    files.sort();
    let named = |file: &Path, words: &[&str]| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let name = name.to_uppercase();
        words.iter().any(|word| name.contains(word))
    };
    if offers_mit(package) && files.iter().any(|file| named(file, &["MIT"])) {
        files.retain(|file| !named(file, &["APACHE", "ZLIB", "UNLICENSE", "BSL", "BOOST"]));
    }
    files
        .iter()
        .filter_map(|file| fs::read(file).ok())
        .map(|bytes| {
            let text = String::from_utf8_lossy(&bytes);
            let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
            format!("{}\n", lines.join("\n").trim_matches('\n'))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expressions of SPDX, and the slash that older crates write.
    #[test]
    fn a_crate_offers_mit_where_it_is_one_of_its_choices() {
        let package = |licence: Option<&str>| Package {
            id: String::new(),
            targets: Vec::new(),
            dependencies: Vec::new(),
            features: HashMap::new(),
            name: String::new(),
            version: String::new(),
            license: licence.map(str::to_string),
            repository: None,
            source: None,
            manifest_path: PathBuf::new(),
        };
        for (licence, offers) in [
            ("MIT", true),
            ("Apache-2.0 OR MIT", true),
            ("MIT OR Apache-2.0 OR Zlib", true),
            ("MIT/Apache-2.0", true),
            ("Unlicense / MIT", true),
            ("Apache-2.0", false),
            ("MITNFA", false),
            ("MIT AND Zlib", false),
            ("MIT AND Zlib OR MIT", false),
            ("(MIT OR Apache-2.0) AND Unicode-3.0", false),
            ("MIT OR (Apache-2.0)", false),
        ] {
            assert_eq!(offers_mit(&package(Some(licence))), offers, "{licence}");
        }
        assert!(!offers_mit(&package(None)));
    }

    #[test]
    fn equal_texts_stand_once_and_what_is_not_linked_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let package = |name: &str, licence: Option<&str>| {
            let place = folder.path().join(name);
            fs::create_dir(&place).unwrap();
            if let Some(text) = licence {
                fs::write(place.join("LICENSE-MIT"), text).unwrap();
            }
            let named = ["a", "b", "builder", "bare", "macros", "idle"].map(|other| {
                let is_optional = ["b", "idle"].contains(&other);
                serde_json::json!({"name": other, "rename": null, "optional": is_optional})
            });
            serde_json::json!({
                "id": name, "name": name, "version": "1.0.0", "license": "MIT",
                "repository": null, "manifest_path": place.join("Cargo.toml"),
                "source": if name == "own" { None } else { Some("registry") },
                "targets": [{"kind": [if name == "macros" { "proc-macro" } else { "lib" }]}],
                "features": {"with": ["dep:b"], "fast": ["idle?/fast"]},
                "dependencies": named,
            })
        };
        let dependency = |name: &str, kind: Option<&str>| serde_json::json!({"pkg": name, "dep_kinds": [{"kind": kind}]});
        let direct = [dependency("a", None), dependency("builder", Some("build"))];
        let indirect = ["b", "bare", "macros", "idle"].map(|name| dependency(name, None));
        let metadata = serde_json::json!({
            "packages": [
                package("own", Some("ours")), package("a", Some("free\r\n")),
                package("b", Some("free\n\n")), package("builder", Some("no")),
                package("bare", None), package("macros", None), package("idle", None),
            ],
            "resolve": {"nodes": [
                {"id": "own", "features": [], "deps": direct},
                {"id": "a", "features": ["with", "fast"], "deps": indirect},
            ]},
        });
        let notices = Notices::read(&metadata.to_string()).unwrap();
        let text = notices.of(&folder.path().join("own")).unwrap();
        assert_eq!(text.matches("free").count(), 1, "{text}");
        assert_eq!(text.matches("notices: [1]").count(), 2, "{text}");
        assert!(
            text.contains("bare 1.0.0") && !text.contains("builder"),
            "{text}"
        );
        for absent in ["ours", "macros", "idle"] {
            assert!(!text.contains(absent), "{text}");
        }
        assert!(notices.of(folder.path()).is_err());
    }

    fn package(folder: &Path, licence: Option<&str>) -> Package {
        Package {
            id: "one".into(),
            targets: Vec::new(),
            dependencies: Vec::new(),
            features: HashMap::new(),
            name: "one".into(),
            version: "1.2.3".into(),
            license: licence.map(str::to_string),
            repository: Some("https://example.org/one".into()),
            source: Some("registry".into()),
            manifest_path: folder.join("Cargo.toml"),
        }
    }

    #[test]
    fn a_crate_offers_the_mit_licence_only_by_a_plain_choice() {
        let offers = |licence| offers_mit(&package(Path::new(""), licence));
        for licence in [
            "MIT",
            "Apache-2.0 OR MIT",
            "MIT/Apache-2.0",
            "Zlib OR MIT OR BSL-1.0",
        ] {
            assert!(offers(Some(licence)), "{licence}");
        }
        for licence in [
            "MIT AND Zlib",
            "(MIT OR Zlib) AND Unicode-3.0",
            "MIT-0",
            "Apache-2.0",
        ] {
            assert!(!offers(Some(licence)), "{licence}");
        }
        assert!(!offers(None));
    }

    #[test]
    fn of_several_licences_to_choose_from_the_notice_of_mit_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        for (name, content) in [
            ("LICENSE-MIT", "\n\nthe MIT text  \r\nwith its lines\n\n"),
            ("LICENSE-APACHE", "the Apache text"),
            ("COPYRIGHT", "who made it"),
            ("README.md", "no notice"),
        ] {
            fs::write(folder.path().join(name), content).unwrap();
        }
        let files = |licence| licence_files(&package(folder.path(), Some(licence)));
        let (whose, mit) = ("who made it\n", "the MIT text\nwith its lines\n");
        assert_eq!(files("MIT OR Apache-2.0"), [whose, mit]);
        assert_eq!(
            files("MIT AND Apache-2.0"),
            [whose, "the Apache text\n", mit]
        );
        let told = text(&[&package(folder.path(), Some("MIT OR Apache-2.0"))]);
        let line = "=".repeat(78);
        let expected = format!(
            "\none 1.2.3\n    licence: MIT OR Apache-2.0; https://example.org/one\n    notices: [1] [2]\n\
             \n{line}\n[1]\n\n{whose}\n{line}\n[2]\n\n{mit}"
        );
        assert!(told.ends_with(&expected), "{told}");
        let none = Package {
            repository: None,
            ..package(Path::new("/no/such/folder"), None)
        };
        let told = text(&[&none]);
        assert!(
            told.ends_with("\none 1.2.3\n    licence: see its files; crates.io\n    no file of its own with a notice\n"),
            "{told}"
        );
    }

    #[test]
    fn what_is_built_for_the_web_or_to_build_is_not_linked() {
        let kind = |kind: Option<&str>, target: Option<&str>| Kind {
            kind: kind.map(str::to_string),
            target: target.map(str::to_string),
        };
        assert!(kind(None, None).is_linked());
        assert!(kind(None, Some("cfg(windows)")).is_linked());
        assert!(!kind(None, Some("cfg(target_arch = \"wasm32\")")).is_linked());
        assert!(!kind(Some("build"), None).is_linked());
    }
}
