//! Writes cases to a folder: `cargo run --release -p hidden-effects --example generate -- DIR N
//! SEED [one|two|nothing|outside|EFFECT] [NOISE] [MISMATCH]`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::{env, fs};

use hidden_effects::catalogue::entry;
use hidden_effects::{Case, Kind, Settings};

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let get = |i: usize| arguments.get(i).map(String::as_str);
    let (Some(folder), Some(Ok(count)), Some(Ok(seed))) = (
        get(0).map(PathBuf::from),
        get(1).map(str::parse::<u64>),
        get(2).map(str::parse::<u64>),
    ) else {
        eprintln!("usage: generate DIR N SEED [one|two|nothing|outside|EFFECT] [NOISE] [MISMATCH]");
        return ExitCode::from(2);
    };
    let kind = match get(3).unwrap_or("one") {
        "one" => Kind::One,
        "two" => Kind::Two,
        "nothing" => Kind::Nothing,
        "outside" => Kind::Outside,
        name => match entry(name) {
            Some(entry) => Kind::This(entry.name),
            None => {
                eprintln!("`{name}` is not in the catalogue");
                return ExitCode::from(2);
            }
        },
    };
    let number =
        |i: usize, otherwise: f64| get(i).and_then(|s| s.parse().ok()).unwrap_or(otherwise);
    let settings = Settings {
        noise: number(4, 1.0),
        mismatch: number(5, 0.01),
        ..Settings::new(kind)
    };
    println!("seed {seed}");
    for i in 0..count {
        let case = Case::draw(seed + i, &settings);
        let name = format!("case-{:05}", seed + i);
        let written = case
            .write(&folder.join("cases").join(&name))
            .and_then(|()| {
                let truth = folder.join("truth");
                fs::create_dir_all(&truth)?;
                let text =
                    serde_json::to_string_pretty(&case.truth).map_err(std::io::Error::other)?;
                fs::write(truth.join(format!("{name}.json")), text)
            });
        if let Err(error) = written {
            eprintln!("{}: {error}", folder.display());
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
