//! `shakebench identify`

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use identification::identify::identified::RigIdentification;

use super::out::{asked_units, given};
use super::{multivariable, progress};
use laboratory::error::Error;
use laboratory::identify::{
    EQUATION_COLUMNS, Form, HydraulicIdentification, ONE_INPUT_COLUMNS, OneInputIdentification,
    Outcome, PARAMETER_COLUMNS, Request, Summary, identify, parameters,
};
use pages::report::columns::aligned;
use pages::report::number::significant;

/// Options of `shakebench identify`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench identify bare.csv payload.csv --out MODEL.toml\n\n\
    Columns: time, valve_command, displacement, acceleration, actuator_force and, with a specimen\n\
    on the table, specimen_acceleration; each header cell is `name [unit]` or `name (unit)`, parted\n\
    by comma, semicolon or tab. A bare table alone does not determine the actuator: measure with a\n\
    specimen or two payloads. Of a rig of which command and displacement alone are recorded, a\n\
    transfer function is found: valve_command (V) or reference (m), and displacement.\n\n\
    Of several actuators that move one body: time, command_1, command_2, stroke_1, stroke_2.")]
pub struct Arguments {
    /// Recordings of one rig
    #[arg(value_name = "DATA.csv", required = true)]
    data: Vec<PathBuf>,
    /// Output file of the model; a report with plots is written next to it
    #[arg(short, long, value_name = "MODEL.toml")]
    out: PathBuf,
    /// Part of each recording that is fitted; the rest validates the model
    #[arg(long, value_name = "PART", default_value_t = 0.75)]
    fit_part: f64,
    /// Known specimen, held fixed: TOML with `[specimen]` mass, damping, stiffness and units. One
    /// recording with it is enough; `specimen_acceleration` is then optional
    #[arg(long, value_name = "FILE")]
    specimen: Option<PathBuf>,
    /// Names of the columns, one per line: `channel = { column = "header", unit = "mm" }`
    #[arg(long, value_name = "MAP.toml")]
    columns: Option<PathBuf>,
    /// Use only command and displacement, as if nothing else were recorded
    #[arg(long, conflicts_with = "specimen")]
    one_input: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Identifies a rig and writes its model.
///
/// # Errors
/// Data at fault, or a file that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if !(0.3..=0.95).contains(&arguments.fit_part) {
        return Err(Error::Option {
            option: "--fit-part",
            reason: format!("{}; expected 0.3 to 0.95", arguments.fit_part),
        });
    }
    check_place(arguments)?;
    if multivariable::has_several(&arguments.data, arguments.columns.as_deref()) {
        let columns = arguments.columns.as_deref();
        return multivariable::identified(
            &arguments.data,
            columns,
            arguments.fit_part,
            &arguments.out,
            arguments.json,
        );
    }
    let bar = progress::spinner("identifying");
    let identified = identify(&Request {
        data: arguments.data.clone(),
        model: arguments.out.clone(),
        fit_part: arguments.fit_part,
        specimen: arguments.specimen.clone(),
        hydraulic_first: false,
        columns: arguments.columns.clone(),
        one_input: arguments.one_input,
    });
    bar.finish_and_clear();
    let identified = identified?;
    identified.write(&given(&identified.summary().model))?;
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(identified.summary()).unwrap_or_default()
        );
    } else {
        let text = match &identified {
            Outcome::OneInput(own) => one_input_text(&own.own, &own.summary),
            Outcome::Rig(own) => match &own.form {
                Form::General(found) => text(found, &own.summary),
                Form::Hydraulic(found) => hydraulic_text(found, &own.summary),
            },
        };
        print!("{text}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses a place for the model that cannot be written or overwrites data.
fn check_place(arguments: &Arguments) -> Result<(), Error> {
    let out = &arguments.out;
    let fault = |reason: String| Error::Option {
        option: "--out",
        reason,
    };
    if out.extension().is_none_or(|extension| extension != "toml") {
        return Err(fault(format!(
            "{}; expected a file name that ends in .toml",
            out.display()
        )));
    }
    let folder = match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(fault(format!(
            "{}: the folder does not exist; expected an existing folder",
            folder.display()
        )));
    }
    let given = &arguments.data;
    if let Some(path) = super::settings::twice(given) {
        return Err(Error::File {
            path: path.clone(),
            reason: "is given twice; expected different recordings".to_string(),
        });
    }
    let same =
        |path: &Path| matches!((path.canonicalize(), out.canonicalize()), (Ok(a), Ok(b)) if a == b);
    let read = arguments
        .data
        .iter()
        .chain(&arguments.specimen)
        .chain(&arguments.columns);
    if let Some(path) = read.into_iter().find(|path| same(path)) {
        return Err(fault(format!(
            "{} is an input; expected another file for the output",
            path.display()
        )));
    }
    Ok(())
}

fn pole(pole: &[f64; 2]) -> String {
    let frequency = pole[0].hypot(pole[1]) / TAU;
    format!(
        "{} {:+.4}i 1/s ({} Hz)",
        significant(pole[0], 5),
        pole[1],
        significant(frequency, 4)
    )
}

/// What is printed without `--json`.
fn text(found: &RigIdentification, summary: &Summary) -> String {
    let mut text = String::new();
    let colours: Vec<String> = found
        .residuals
        .iter()
        .filter(|(_, _, test)| !test.is_white())
        .map(|(recording, channel, _)| format!("{channel} of {recording}"))
        .collect();
    if !colours.is_empty() {
        text += &format!(
            "the one-step errors of {} are not white: the model lacks an effect of the rig, and \
             the standard errors are too small\n\n",
            colours.join(", ")
        );
    }
    if summary.identifiable {
        text += "actuator poles\n";
        for own in &summary.actuator_poles_rad_s {
            text += &format!("  {}\n", pole(own));
        }
    } else {
        text += "actuator: not determined by these data, see the warnings\n";
    }
    text += "table poles\n";
    for own in &summary.table_poles_rad_s {
        text += &format!("  {}\n", pole(own));
    }
    let mut rows = vec![
        ["parameter", "value", "standard error", "unit"]
            .map(String::from)
            .to_vec(),
    ];
    rows.extend(
        parameters(found)
            .iter()
            .map(|row| row.text(asked_units()).to_vec()),
    );
    text += &format!("\n{}", aligned(&rows));
    for (index, (payload, error)) in found.payload.iter().enumerate().skip(1) {
        text += &format!(
            "payload of {} relative to the first: {} kg (standard error {})\n",
            found.model.experiments[index].name,
            significant(*payload, 5),
            significant(*error, 2)
        );
    }
    let mut rows = vec![
        [
            "recording, channel",
            "simulated %",
            "one step %",
            "lags outside 99 %",
            "with command",
        ]
        .map(String::from)
        .to_vec(),
    ];
    for fit in &found.fits {
        let test = found
            .residuals
            .iter()
            .find(|(recording, channel, _)| *recording == fit.recording && *channel == fit.channel)
            .map(|(_, _, test)| (test.outside(), test.cross_outside()));
        let share =
            |value: Option<f64>| value.map_or("-".into(), |v| format!("{:.0} %", 100.0 * v));
        rows.push(vec![
            format!("{}, {}", fit.recording, fit.channel),
            format!("{:.2}", fit.simulated),
            format!("{:.2}", fit.predicted),
            share(test.map(|t| t.0)),
            share(test.map(|t| t.1)),
        ]);
    }
    text += &format!("\nfit on the part that was not fitted\n{}", aligned(&rows));
    text + &ending(&summary.warnings, summary)
}

/// Four columns under their heads.
fn table(columns: [&str; 4], rows: Vec<[String; 4]>) -> String {
    let mut all = vec![columns.map(String::from).to_vec()];
    all.extend(rows.into_iter().map(|row| row.to_vec()));
    aligned(&all)
}

/// The first warning, and those that are left for the end.
fn beginning(summary: &Summary) -> (String, &[String]) {
    match summary.warnings.split_first() {
        Some((first, rest)) => (format!("{first}\n\n"), rest),
        None => (String::new(), &[]),
    }
}

/// The end of the text of every identification: warnings, and the file of the model.
fn ending(warnings: &[String], summary: &Summary) -> String {
    let mut text = String::new();
    if !warnings.is_empty() {
        text += "\nwarnings\n";
        for warning in warnings {
            text += &format!("  {warning}\n");
        }
    }
    text + &format!(
        "\nwritten: {} ({:.1} s)\n",
        summary.model.display(),
        summary.wall_s
    )
}

/// As [`text`], for command to displacement; the most important result comes first.
fn one_input_text(own: &OneInputIdentification, summary: &Summary) -> String {
    let (mut text, rest) = beginning(summary);
    text += &format!("{} to displacement\n\npoles\n", own.found.input.name());
    for own in &summary.actuator_poles_rad_s {
        text += &format!("  {}\n", pole(own));
    }
    text += &format!("\n{}", table(ONE_INPUT_COLUMNS, own.parameters()));
    text += &format!("\n{}", table(own.candidate_columns(), own.candidates()));
    text += &format!("\n{}\n", own.checked());
    text + &ending(rest, summary)
}

/// As [`text`], for a hydraulic rig; the most important result comes first.
fn hydraulic_text(own: &HydraulicIdentification, summary: &Summary) -> String {
    let (mut text, rest) = beginning(summary);
    text += "hydraulic rig, with the reference as instrument\n\n";
    let rows = own.parameters();
    let rows = rows.iter().map(|row| row.text(asked_units()));
    text += &table(PARAMETER_COLUMNS, rows.collect());
    text += &format!("\n{}", table(EQUATION_COLUMNS, own.equations()));
    text + &ending(rest, summary)
}
