//! `shakebench doctor`

use super::out::installation;
use std::process::ExitCode;

use clap::Args;

use laboratory::error::Error;
use pack::doctor::{Examination, State, examine};
use pages::report::columns::last_left;

/// Options of `shakebench doctor`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  shakebench doctor\n\n\
    Exit status: 0 if the program can work, 1 if it cannot.")]
pub struct Arguments {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints the parts of the installation, what is missing, and what to do.
///
/// # Errors
/// None.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let found = examine(installation());
    if arguments.json {
        println!("{}", serde_json::json!(found));
    } else {
        print!("{}", text(&found));
    }
    Ok(match found.ready {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(1),
    })
}

fn text(found: &Examination) -> String {
    let mut text = format!("shakebench {} on {}\n", found.shakebench, found.platform);
    if let Some(program) = &found.program {
        text += &format!("  program     {}\n", program.display());
    }
    if let (Some(folder), Some(origin)) = (&found.fmus, found.origin) {
        text += &format!("  components  {} ({})\n", folder.display(), origin.words());
    }
    text.push('\n');
    let rows = found.findings.iter().map(|finding| {
        let state = match finding.state {
            State::Good => "ok",
            State::Absent => "-",
            State::Bad => "BAD",
        };
        vec![
            finding.part.to_string(),
            state.to_string(),
            finding.found.clone(),
        ]
    });
    text += &last_left(rows.collect());
    let cures: Vec<String> = found
        .findings
        .iter()
        .filter_map(|finding| {
            let cure = finding.cure.as_ref()?;
            Some(format!(
                "  {} (for {}): {cure}\n",
                finding.part, finding.needed_for
            ))
        })
        .collect();
    if !cures.is_empty() {
        text += &format!("\nto have more\n{}", cures.concat());
    }
    text += match found.ready {
        true => "\nall required parts are installed\n",
        false => "\na required part is missing or faulty\n",
    };
    text
}
