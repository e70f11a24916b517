//! `shakebench build`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use super::quantity::ValueError;
use laboratory::error::Error;
use pack::{self, FmiVersion, Platform};

/// Options of `shakebench build`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench build --fmi 2 --out fmus\n  \
    shakebench build --merge fmus-linux fmus-mac --out fmus\n  \
    shakebench build --libraries x86_64-linux=LIB --libraries x86_64-windows=DLL --out fmus")]
pub struct Arguments {
    /// FMI version
    #[arg(long, value_enum, default_value = "all")]
    fmi: Versions,
    /// Folder for fmi2/NAME.fmu and fmi3/NAME.fmu [default: target/fmus]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Merge the FMUs of these folders instead of building: one archive with all their platforms
    #[arg(
        long,
        value_name = "DIR",
        num_args = 1..,
        requires = "out",
        conflicts_with_all = ["fmi", "libraries", "revision", "notices"]
    )]
    merge: Vec<PathBuf>,
    /// Pack compiled libraries instead of building: one folder per platform, such as
    /// x86_64-windows=DIR; this platform is required
    #[arg(long, value_name = "PLATFORM=DIR", value_parser = libraries)]
    libraries: Vec<(Platform, PathBuf)>,
    /// Revision of the sources, for the descriptions
    #[arg(long, value_name = "TEXT", requires = "libraries")]
    revision: Option<String>,
    /// Use the strongest compression: 4 % smaller, some seconds per library
    #[arg(long, requires = "libraries")]
    smallest: bool,
    /// Write the licences of all linked code to this file, without packing
    #[arg(long, value_name = "FILE", conflicts_with_all = ["fmi", "out", "libraries", "revision"])]
    notices: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

fn libraries(text: &str) -> Result<(Platform, PathBuf), ValueError> {
    let expected = ValueError::Expected("PLATFORM=DIR, as in x86_64-windows=DIR");
    let (platform, folder) = text.split_once('=').ok_or(expected)?;
    let folder = PathBuf::from(folder);
    if !folder.is_dir() {
        return Err(ValueError::NoFolder(folder));
    }
    Ok((platform.parse()?, folder))
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Versions {
    #[value(name = "2")]
    Two,
    #[value(name = "3")]
    Three,
    All,
}

/// Packs every component and prints where.
///
/// # Errors
/// Components that do not build, or a folder that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(file) = &arguments.notices {
        let text = pack::notices_of_the_program()?;
        std::fs::write(file, text).map_err(|error| Error::File {
            path: file.clone(),
            reason: error.to_string(),
        })?;
        return Ok(ExitCode::SUCCESS);
    }
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => pack::default_folder()?,
    };
    let versions: &[FmiVersion] = match arguments.fmi {
        Versions::Two => &[FmiVersion::V2],
        Versions::Three => &[FmiVersion::V3],
        Versions::All => &FmiVersion::ALL,
    };
    let packed = if !arguments.merge.is_empty() {
        pack::merge(&arguments.merge, &out)?
    } else if !arguments.libraries.is_empty() {
        let revision = arguments.revision.as_deref();
        pack::pack_libraries(
            &arguments.libraries,
            &out,
            versions,
            revision,
            arguments.smallest,
        )?
    } else {
        note!("building the components (the first time takes a minute)...");
        pack::build_fmus(&out, versions)?
    };
    if arguments.json {
        let fmus = packed.iter().map(|fmu| {
            serde_json::json!({"name": fmu.name, "fmi": fmu.version.to_string(), "file": fmu.path})
        });
        println!("{}", serde_json::json!({"fmus": fmus.collect::<Vec<_>>()}));
        return Ok(ExitCode::SUCCESS);
    }
    for fmu in packed {
        println!("{}", fmu.path.display());
    }
    Ok(ExitCode::SUCCESS)
}
