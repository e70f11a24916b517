//! `shakebench info`

use super::out::{self, installation};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::json;

use fmi_import::{Causality, FmiVersion, Fmu};
use fmi_ssp as ssp;
use fmi_system::{Operation, System, SystemFile, assemble};
use laboratory::error::Error;
use laboratory::systems::built_in;
use laboratory::systems::tuning::Wanted;
use pack::library::FmuLibrary;
use pages::report::columns::last_left;
use pages::report::number::significant;
use pages::report::{Cell, Units};

/// Options of `shakebench info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench info ShakeTable\n  \
    shakebench info three-variable\n  \
    shakebench info target/fmus/fmi3/ShakeTable.fmu\n  \
    shakebench info records/RSN1633_MANJIL_ABBAR--L.AT2")]
pub struct Arguments {
    /// A component's name, an .fmu, a system (.toml, .ssp or built-in), or a motion (.AT2, .csv)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What a file holds, for people and for programs.
type Content = (String, serde_json::Value);

/// Prints what a file holds.
///
/// # Errors
/// A file at fault.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let path = &arguments.file;
    let name = path.to_string_lossy();
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let (text, json) = match extension.as_deref() {
        Some("fmu") => fmu(&*Fmu::open(path)?),
        Some("toml") => system(&SystemFile::read(path)?)?,
        _ if ssp::is_ssp(&name) => system(&ssp::read(&name)?)?,
        Some("at2" | "csv") => motion(path)?,
        _ if built_in::check(&name).is_ok() => system(&built_in::system(
            &name,
            built_in::DEFAULT_PLANT,
            built_in::DEFAULT_SPECIMEN,
            Wanted::default(),
        )?)?,
        None if installation()
            .fmus()?
            .iter()
            .any(|known| known.name == name) =>
        {
            let packed = installation()
                .component(&name, FmiVersion::V3)
                .map_err(|error| Error::File {
                    path: path.clone(),
                    reason: error.to_string(),
                })?;
            fmu(&*Fmu::open_own(&packed.path)?)
        }
        _ => {
            let mut components: Vec<&str> = installation()
                .fmus()
                .unwrap_or_default()
                .iter()
                .map(|fmu| fmu.name.as_str())
                .collect();
            components.dedup();
            let reason = format!(
                "expected an .fmu, .ssp, .toml, .AT2 or .csv file, a built-in system ({}), or a \
                 component ({})",
                built_in::names().collect::<Vec<_>>().join(", "),
                components.join(", ")
            );
            return Err(Error::File {
                path: path.clone(),
                reason,
            });
        }
    };
    match arguments.json {
        true => println!("{json}"),
        false => print!("{text}"),
    }
    Ok(ExitCode::SUCCESS)
}

fn fmu(fmu: &Fmu) -> Content {
    let d = &fmu.description;
    let yes = |truth| if truth { "yes" } else { "no" };
    let mut text = format!("{}: {}\n", d.model_name, d.about);
    let row = |name: &str, value: &str| format!("  {name:<20}{value}\n");
    text += &row("FMI", &d.version.to_string());
    text += &row("token", &d.token);
    text += &row("made by", &d.generation_tool);
    text += &row("platforms", &fmu.platforms.join(", "));
    text += &row("model exchange", yes(d.offers_model_exchange));
    text += &row("saves its state", yes(d.saves_state));
    text += &row("writes its state", yes(d.writes_state));
    if let Some(step) = d.preferred_step {
        text += &row("preferred step", &format!("{step} s"));
    }
    text += &row("SHA-256", &fmu.sha256);
    for (causality, heading) in [
        (Causality::Input, "inputs"),
        (Causality::Output, "outputs"),
        (Causality::Parameter, "parameters"),
        (Causality::Local, "locals"),
    ] {
        let rows: Vec<Vec<String>> = d
            .of(causality)
            .map(|index| {
                let v = &d.variables[index];
                let known = v
                    .dependencies
                    .iter()
                    .map(|&on| d.variables[on].name.as_str());
                let known: Vec<&str> = known.collect();
                let mut about = v.description.clone();
                if !known.is_empty() {
                    about += &format!(" (directly from {})", known.join(", "));
                }
                vec![
                    format!("  {}", v.name),
                    v.kind.name().to_string(),
                    v.start.clone().unwrap_or_default(),
                    v.unit.clone().unwrap_or_default(),
                    about,
                ]
            })
            .collect();
        if !rows.is_empty() {
            text += &format!("\n{heading}\n{}", last_left(rows));
        }
    }
    if !d.terminals.is_empty() {
        let rows = d.terminals.iter().map(|terminal| {
            let members = terminal.members.iter();
            let members: Vec<String> = members
                .map(|member| format!("{} = {}", member.name, member.variable))
                .collect();
            vec![
                format!("  {}", terminal.name),
                terminal.kind.clone().unwrap_or_default(),
                members.join(", "),
            ]
        });
        text += &format!("\nterminals\n{}", last_left(rows.collect()));
    }
    for remark in &d.remarks {
        text += &format!("\nremark: {remark}\n");
    }
    let variables = d.variables.iter().map(|v| {
        json!({
            "name": v.name,
            "causality": format!("{:?}", v.causality).to_lowercase(),
            "type": v.kind.name(),
            "start": v.start,
            "unit": v.unit,
            "description": v.description,
            "depends_on": v.dependencies.iter().map(|&on| &d.variables[on].name).collect::<Vec<_>>(),
        })
    });
    let terminals = d.terminals.iter().map(|terminal| {
        let members = terminal.members.iter();
        json!({
            "name": terminal.name,
            "kind": terminal.kind,
            "members": members.map(|own| json!({"name": own.name, "variable": own.variable})).collect::<Vec<_>>(),
        })
    });
    let json = json!({
        "kind": "fmu",
        "name": d.model_name,
        "description": d.about,
        "fmi": d.version,
        "token": d.token,
        "generation_tool": d.generation_tool,
        "platforms": fmu.platforms,
        "model_exchange": d.offers_model_exchange,
        "saves_state": d.saves_state,
        "writes_state": d.writes_state,
        "preferred_step_s": d.preferred_step,
        "sha256": fmu.sha256,
        "variables": variables.collect::<Vec<_>>(),
        "terminals": terminals.collect::<Vec<_>>(),
        "remarks": d.remarks,
    });
    (text, json)
}

fn system(file: &SystemFile) -> Result<Content, Error> {
    let mut library = FmuLibrary::of(FmiVersion::V3, file).from(installation());
    let system = assemble(file, &[], &mut library)?;
    let mut text = format!("{}: {}\n\ncomponents\n", system.name, system.description);
    let rows = system.components.iter().map(|component| {
        let sampled = match component.period {
            Some(period) => format!("sampled every {} ms", 1e3 * period),
            None => "continuous".to_string(),
        };
        let model = component.fmu.description.model_name.clone();
        vec![format!("  {}", component.name), model, sampled]
    });
    text += &last_left(rows.collect());
    text += "\nconnections\n";
    let rows = system
        .links()
        .map(|link| vec![format!("  {}", link.from), format!("-> {}", link.to)]);
    text += &last_left(rows.collect());
    text += "\norder of calls at a sample\n";
    let schedule = system.schedule(true)?;
    let order: Vec<String> = schedule
        .operations
        .iter()
        .map(|own| words(&system, own))
        .collect();
    for (number, operation) in order.iter().enumerate() {
        text += &format!("  {}. {operation}\n", number + 1);
    }
    text += "  then the continuous components step\n";
    let components = system.components.iter().map(|component| {
        json!({
            "name": component.name,
            "model": component.fmu.description.model_name,
            "period_s": component.period,
        })
    });
    let connections = system
        .links()
        .map(|link| json!({"from": link.from.to_string(), "to": link.to.to_string()}));
    let json = json!({
        "kind": "system",
        "name": system.name,
        "description": system.description,
        "components": components.collect::<Vec<_>>(),
        "connections": connections.collect::<Vec<_>>(),
        "order_of_calls": order,
        "notes": system.notes,
    });
    Ok((text, json))
}

fn words(system: &System, operation: &Operation) -> String {
    match operation {
        Operation::Call { component } => format!("call {}", system.components[*component].name),
        Operation::Read { component, outputs } => {
            let names = outputs
                .iter()
                .map(|&output| system.variable_name(*component, output).to_string());
            format!("read {}", names.collect::<Vec<_>>().join(", "))
        }
        Operation::Iterate { operations, .. } => {
            let parts = operations.iter().map(|part| words(system, part));
            format!("solve together: {}", parts.collect::<Vec<_>>().join("; "))
        }
    }
}

fn motion(path: &Path) -> Result<Content, Error> {
    let options = motion::Options::default();
    let playable = match motion::read_record(path) {
        Ok(_) => motion::load(path, &options)?,
        // Not an acceleration alone: a reference, perhaps.
        Err(error) => motion::load_reference(path, &options).map_err(|_| error)?,
    };
    let mut text = format!("{}\n", playable.name);
    for note in &playable.notes {
        text += &format!("  {note}\n");
    }
    let shown = |value, units| Cell::Quantity(value, units, 4).text(out::units());
    text += &format!(
        "  as played: {} s, {} samples of {} ms, {}, {}, {}\n",
        significant(playable.duration(), 4),
        playable.len(),
        1e3 * playable.dt,
        shown(playable.peak_acceleration(), Units::ACCELERATION),
        shown(playable.peak_velocity(), Units::VELOCITY),
        shown(playable.peak_displacement(), Units::DISPLACEMENT),
    );
    let json = json!({
        "kind": "motion",
        "name": playable.name,
        "notes": playable.notes,
        "duration_s": playable.duration(),
        "samples": playable.len(),
        "step_s": playable.dt,
        "peak_acceleration_m_s2": playable.peak_acceleration(),
        "peak_velocity_m_s": playable.peak_velocity(),
        "peak_displacement_m": playable.peak_displacement(),
    });
    Ok((text, json))
}
