//! FMI import: an FMU is unpacked, checked and described before any of its code is loaded, and its
//! instances look the same whether they are FMI 2.0 or 3.0.

pub mod archive;
mod call;
mod convert;
mod datum;
mod description;
mod error;
pub mod folder;
mod instance;
pub mod isolation;
mod messages;
mod native;
mod options;
mod processes;
mod stand_in;
mod trace;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

pub use call::{Linear, Wire};
pub use datum::Datum;
pub use description::{
    BaseUnit, Causality, Description, Flow, FmiVersion, InputClock, Interface, Item, Kind,
    MatchingRule, Member, NotANumber, Terminal, Ticks, Variability, Variable,
};
pub use error::{CallError, FmuError};
pub use instance::{Instance, Progress, State};
pub use messages::Message;
pub use native::printing::Diverted;
pub use options::{Isolation, Options};
pub use processes::Processes;
pub use stand_in::{Begin, Behaviour, BehaviourError};
pub use trace::Trace;

/// What helps where a component of this project is not whole, or of another machine.
pub const CURE: &str = "install again, or pass the folder of this platform's FMUs with --fmus";

/// An FMU file: described and unpacked, not yet loaded.
#[derive(Debug, Clone)]
pub struct Fmu {
    /// The file.
    pub path: PathBuf,
    /// What its `modelDescription.xml` says.
    pub description: Description,
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
    /// Whether it is a component of this project, packed by this program; others are foreign.
    pub is_own: bool,
    /// Platforms it has binaries for, as its folders are named.
    pub platforms: Vec<String>,
    /// Relative error that it is asked to keep, where one is asked for: by its own solver, or by the one
    /// that steps it in model exchange.
    pub tolerance: Option<f64>,
    /// Structural parameters that were given, by value reference.
    sizes: HashMap<u32, u64>,
    /// Where the file is, which may be called by another path.
    file: PathBuf,
    unpacked: Arc<folder::Folder>,
    /// What computes its instances in place of its library, where something does.
    stand_in: Option<stand_in::StandIn>,
}

/// A library that stays loaded as long as this lives.
pub struct Held(#[allow(dead_code, reason = "it is there to be dropped")] libloading::Library);

impl Fmu {
    /// Opens an FMU: unpacks it into a temporary directory and reads its description.
    ///
    /// # Errors
    /// A file that cannot be read, an archive that is broken or would write outside its directory,
    /// a description that cannot be used. Nothing of the FMU has been executed by then.
    pub fn open(path: &Path) -> Result<Arc<Self>, FmuError> {
        Ok(Arc::new(Self::read(path)?))
    }

    /// As [`Fmu::open`], of a file that messages and manifests call by another path: one that lies
    /// in an archive.
    ///
    /// # Errors
    /// As [`Fmu::open`].
    pub fn open_within(path: &Path, shown: &Path) -> Result<Arc<Self>, FmuError> {
        Ok(Arc::new(Self::read_as(path, shown)?))
    }

    /// Opens a component of this project that this program has packed itself.
    ///
    /// # Errors
    /// As [`Fmu::open`].
    pub fn open_own(path: &Path) -> Result<Arc<Self>, FmuError> {
        Ok(Arc::new(Self {
            is_own: true,
            ..Self::read(path)?
        }))
    }

    fn read(path: &Path) -> Result<Self, FmuError> {
        Self::read_as(path, path)
    }

    fn read_as(file: &Path, path: &Path) -> Result<Self, FmuError> {
        let bytes = std::fs::read(file).map_err(|source| FmuError::Unreadable {
            fmu: path.to_path_buf(),
            source,
        })?;
        let unpacked = archive::unpack(archive::FMU, path, &bytes)?;
        let description = description::read(path, unpacked.path(), &HashMap::new(), false)?;
        let platforms = archive::platforms(unpacked.path());
        Ok(Self {
            path: path.to_path_buf(),
            file: file.to_path_buf(),
            description,
            sha256: digest(&bytes),
            is_own: false,
            tolerance: None,
            sizes: HashMap::new(),
            platforms,
            unpacked: Arc::new(unpacked),
            stand_in: None,
        })
    }

    /// The same FMU with structural parameters of these values, by position, so that its arrays
    /// have other sizes.
    ///
    /// # Errors
    /// Sizes that are too large.
    pub fn resized(&self, sizes: &[(usize, u64)]) -> Result<Arc<Self>, FmuError> {
        let variables = &self.description.variables;
        let sizes = sizes
            .iter()
            .map(|&(position, size)| (variables[position].reference, size))
            .collect();
        let is_exchange = self.description.interface == Interface::ModelExchange;
        self.described(sizes, is_exchange)
    }

    /// The same FMU, stepped by the program's own solver and not by itself.
    ///
    /// # Errors
    /// It does not offer model exchange.
    pub fn for_model_exchange(&self) -> Result<Arc<Self>, FmuError> {
        let fmu = self.described(self.sizes.clone(), true)?;
        if fmu.description.interface == Interface::ModelExchange {
            return Ok(fmu);
        }
        Err(FmuError::Description {
            fmu: self.path.clone(),
            reason: "it does not offer model exchange".to_string(),
        })
    }

    fn described(&self, sizes: HashMap<u32, u64>, exchange: bool) -> Result<Arc<Self>, FmuError> {
        let unpacked = self.unpacked.path();
        Ok(Arc::new(Self {
            description: description::read(&self.path, unpacked, &sizes, exchange)?,
            sizes,
            ..self.clone()
        }))
    }

    /// The same FMU as if no output depended directly on an input.
    pub fn without_feedthrough(&self) -> Self {
        let mut fmu = self.clone();
        let none: Arc<[usize]> = [].into();
        for variable in &mut fmu.description.variables {
            variable.dependencies = none.clone();
        }
        fmu
    }

    /// The same FMU with local variables, by position, as outputs: arrays as a whole. Whether they
    /// depend directly on inputs is not declared, so they count as if they did.
    pub fn with_outputs(&self, locals: &[usize]) -> Self {
        let mut fmu = self.clone();
        let inputs: Arc<[usize]> = self.description.of(Causality::Input).collect();
        for &local in locals {
            let (element, size) = fmu.description.variables[local].element;
            for variable in &mut fmu.description.variables[local - element..][..size] {
                variable.causality = Causality::Output;
                variable.dependencies = inputs.clone();
            }
        }
        fmu
    }

    /// Keeps the library of a component of this project loaded: one that is loaded again for each
    /// of many runs leaks what it allocated once. None for others, whose library may be loaded
    /// elsewhere or rely on being loaded again.
    pub fn hold(&self) -> Option<Held> {
        let Description {
            version,
            model_identifier,
            ..
        } = &self.description;
        let path = archive::binary(&self.path, self.unpacked.path(), *version, model_identifier);
        let path = path.ok().filter(|_| self.is_own)?;
        native::hold(&path).map(Held)
    }

    /// Where the file is, for as long as the archive that it may lie in is open.
    pub fn file(&self) -> &PathBuf {
        &self.file
    }

    /// The file's name, as messages give it.
    pub fn file_name(&self) -> String {
        archive::file_name(&self.path)
    }
}

/// The SHA-256 of bytes, in hexadecimal.
#[must_use]
pub fn digest(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

/// Bytes as lower-case hexadecimal digits.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By FIPS 180-2, B.1.
    #[test]
    fn a_digest_is_sha_256_in_hexadecimal() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(digest(b"abc"), expected);
        assert_eq!(hexadecimal(&[0, 10, 255]), "000aff");
    }
}
