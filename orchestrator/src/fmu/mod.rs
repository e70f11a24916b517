//! FMI import: an FMU is unpacked, checked and described before any of its code is loaded, and its
//! instances look the same whether they are FMI 2.0 or 3.0.

mod archive;
mod description;
mod error;
mod instance;
mod messages;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use sha2::{Digest, Sha256};

pub use description::{Causality, Description, FmiVersion, Item, Kind, Variability, Variable};
pub use error::{CallError, FmuError};
pub use instance::{Instance, State};
pub use messages::Message;

/// `fmi-rs` checks variable names with a parser that keeps its state in globals: one at a time.
static PARSER: Mutex<()> = Mutex::new(());

/// An FMU file: described and unpacked, not yet loaded.
#[derive(Debug)]
pub struct Fmu {
    /// The file.
    pub path: PathBuf,
    /// What its `modelDescription.xml` says.
    pub description: Description,
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
    /// Platforms it has binaries for, as its folders are named.
    pub platforms: Vec<String>,
    unpacked: tempfile::TempDir,
}

impl Fmu {
    /// Opens an FMU: unpacks it into a temporary directory and reads its description.
    ///
    /// # Errors
    /// A file that cannot be read, an archive that is broken or would write outside its directory,
    /// a description that cannot be used. Nothing of the FMU has been executed by then.
    pub fn open(path: &Path) -> Result<Arc<Self>, FmuError> {
        let bytes = std::fs::read(path).map_err(|source| FmuError::Unreadable {
            fmu: path.to_path_buf(),
            source,
        })?;
        let unpacked = archive::unpack(path, &bytes)?;
        let description = {
            let _alone = PARSER.lock().unwrap_or_else(PoisonError::into_inner);
            description::read(path, unpacked.path())?
        };
        let platforms = archive::platforms(unpacked.path());
        Ok(Arc::new(Self {
            path: path.to_path_buf(),
            description,
            sha256: hexadecimal(&Sha256::digest(&bytes)),
            platforms,
            unpacked,
        }))
    }

    /// The file's name, as messages give it.
    pub fn file_name(&self) -> String {
        archive::file_name(&self.path)
    }
}

/// Bytes as lower-case hexadecimal digits.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
