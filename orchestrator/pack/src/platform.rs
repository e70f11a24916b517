//! Machines that libraries are built for, and how the two versions of FMI name them.

use std::fmt;
use std::str::FromStr;

use fmi_import::FmiVersion;

/// A processor and an operating system, written as in `x86_64-linux`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Platform {
    processor: String,
    system: System,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum System {
    Linux,
    Windows,
    Darwin,
}

impl System {
    const ALL: [Self; 3] = [Self::Linux, Self::Windows, Self::Darwin];

    /// Its name in FMI 3.0.
    fn name(self) -> &'static str {
        match self {
            Self::Linux => "linux",
            Self::Windows => "windows",
            Self::Darwin => "darwin",
        }
    }
}

impl Platform {
    /// The platform that this program runs on; `None` if FMI has no name for it.
    pub fn here() -> Option<Self> {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            other => other,
        };
        format!("{}-{system}", std::env::consts::ARCH).parse().ok()
    }

    /// The folder inside an FMU that holds its library.
    pub fn binaries(&self, version: FmiVersion) -> String {
        let folder = match (version, self.system, self.processor.as_str()) {
            (FmiVersion::V2, System::Linux, "x86_64") => "linux64",
            (FmiVersion::V2, System::Windows, "x86_64") => "win64",
            (FmiVersion::V2, System::Darwin, "x86_64") => "darwin64",
            _ => return format!("binaries/{self}"),
        };
        format!("binaries/{folder}")
    }

    /// The library of a component inside an FMU.
    pub fn library_in_fmu(&self, version: FmiVersion, name: &str) -> String {
        format!("{}/{name}{}", self.binaries(version), self.suffix())
    }

    /// The file that cargo builds a library as.
    pub fn library_file(&self, name: &str) -> String {
        match self.system {
            System::Windows => format!("{name}.dll"),
            _ => format!("lib{name}{}", self.suffix()),
        }
    }

    fn suffix(&self) -> &'static str {
        match self.system {
            System::Linux => ".so",
            System::Windows => ".dll",
            System::Darwin => ".dylib",
        }
    }
}

impl fmt::Display for Platform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.processor, self.system.name())
    }
}

/// A text that is not a platform.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a platform; expected x86_64 or aarch64, a dash, and linux, windows or darwin, as in x86_64-windows"
)]
pub struct UnknownPlatform(pub String);

impl FromStr for Platform {
    type Err = UnknownPlatform;

    fn from_str(text: &str) -> Result<Self, UnknownPlatform> {
        let known = text.split_once('-').and_then(|(processor, name)| {
            let mut systems = System::ALL.into_iter();
            let system = systems.find(|system| system.name() == name)?;
            let is_known = ["x86_64", "aarch64"].contains(&processor);
            is_known.then(|| Self {
                processor: processor.to_string(),
                system,
            })
        });
        known.ok_or_else(|| UnknownPlatform(text.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_versions_have_their_own_names() {
        let folders = |text: &str| {
            let platform: Platform = text.parse().unwrap();
            FmiVersion::ALL.map(|version| platform.library_in_fmu(version, "A"))
        };
        for (platform, expected) in [
            ("x86_64-linux", ["linux64/A.so", "x86_64-linux/A.so"]),
            ("x86_64-windows", ["win64/A.dll", "x86_64-windows/A.dll"]),
            (
                "aarch64-linux",
                ["aarch64-linux/A.so", "aarch64-linux/A.so"],
            ),
            (
                "x86_64-darwin",
                ["darwin64/A.dylib", "x86_64-darwin/A.dylib"],
            ),
        ] {
            assert_eq!(
                folders(platform),
                expected.map(|path| format!("binaries/{path}"))
            );
        }
        assert!("x86_64-windwos".parse::<Platform>().is_err());
        assert!(Platform::here().is_some());
    }

    #[test]
    fn cargo_names_libraries_as_each_system_does() {
        for (platform, file) in [
            ("x86_64-linux", "libA.so"),
            ("aarch64-darwin", "libA.dylib"),
            ("x86_64-windows", "A.dll"),
        ] {
            let platform: Platform = platform.parse().unwrap();
            assert_eq!(platform.library_file("A"), file);
        }
    }
}
