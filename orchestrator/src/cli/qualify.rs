//! `shakebench qualify`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use super::motion::MotionArguments;
use super::out::{given, unused};
use super::quantity::whole;
use super::rig::RigArguments;
use super::{progress, run};
use laboratory::error::Error;
use laboratory::qualify::{self, Plan, Qualification};
use laboratory::results::Results;
use pages::report::columns::aligned;
use qualification::load;
use qualification::resonance::Excitation;

/// The plant if none is given.
const DEFAULT_PLANT: &str = "servohydraulic";
/// The controller if none is given.
const DEFAULT_SYSTEM: &str = "preview";

/// `--search`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Search {
    /// One sine sweep upwards
    Sweep,
    /// Random motion for 60 s
    Random,
    /// None
    None,
}

/// Options of `shakebench qualify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench qualify ac156 --set s_ds=1.0 --set z_h=0.5 --motion-only --out motion\n  \
    shakebench qualify ac156 --set s_ds=0.5 --specimen yielding --out qualified\n  \
    shakebench qualify floor.toml --record NGA/RSN1633_MANJIL_ABBAR--L.AT2 --motion-only --json\n\n\
    Without --plant, --motion-only has no rig and no limits. A verdict states that the spectrum is within \
    these bounds of this rule, computed so. It is not a certificate.")]
pub struct Arguments {
    /// Required response spectrum: ac156 (s_ds, z_h, direction), ieee693 (level, damping_percent), or a
    /// .toml or .csv file
    #[arg(value_name = "RULE")]
    rule: String,
    /// Value of the rule, such as s_ds=1.0, or of the rig, such as control.valve_limit="5 V"; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Controller: a built-in system or a .toml file [default: preview]
    #[arg(long, value_name = "SYSTEM")]
    system: Option<String>,
    #[command(flatten)]
    rig: RigArguments,
    /// Record whose phases the motion keeps, as PEER .AT2 or .csv [default: random phases]
    #[arg(long, value_name = "FILE", conflicts_with = "seed")]
    record: Option<PathBuf>,
    /// Seed of the random phases
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Make the motion and stop
    #[arg(long)]
    motion_only: bool,
    /// Largest number of runs at the level
    #[arg(long, default_value_t = 3, value_parser = super::quantity::at_least_one)]
    rounds: usize,
    /// Resonance search before and after
    #[arg(long, value_enum, default_value_t = Search::Sweep)]
    search: Search,
    /// Parameter of the rig in the second resonance search, such as specimen.stiffness="36 lbf/in", to show
    /// what a change looks like; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set_after: Vec<String>,
    /// Folder for motions, rounds and report [default: shakebench-results/qualification-RULE]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Qualifies and writes.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let plan = plan(arguments)?;
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let bar = progress::spinner("qualifying");
    let found = qualify::qualify(&plan, &mut |what| progress::say(&bar, what.to_string()));
    bar.finish_and_clear();
    let mut found = found?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let stem = Path::new(&arguments.rule).file_stem().unwrap_or_default();
        let name = format!("qualification-{}", stem.to_string_lossy());
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = qualify::write(&plan, &found, &folder)?;
    for own in std::iter::once(&mut found.motion).chain(&mut found.further_axes) {
        own.file = folder.join(&own.file);
    }
    if arguments.json {
        super::print_json(serde_json::json!(found), &folder);
    } else {
        print!("{}", text(&found));
        println!();
        super::print_files(&files);
    }
    for warning in &found.warnings {
        eprintln!("warning: {warning}");
    }
    if let Some(reason) = found.ended_early() {
        eprintln!("error: a run ended early: {reason}");
        return Ok(ExitCode::from(1));
    }
    Ok(ExitCode::SUCCESS)
}

fn plan(arguments: &Arguments) -> Result<Plan, Error> {
    // What has a point before its `=` is the rig's.
    let is_rigs = |set: &&String| set.split('=').next().is_some_and(|key| key.contains('.'));
    let (of_rig, of_rule): (Vec<&String>, Vec<&String>) = arguments.set.iter().partition(is_rigs);
    let own = |all: Vec<&String>| all.into_iter().cloned().collect::<Vec<String>>();
    let rule = load(&arguments.rule, &own(of_rule))?;
    let record = arguments
        .record
        .as_deref()
        .map(motion::read_record)
        .transpose()?;
    let mut rig = arguments.rig.clone();
    let wants_rig = !arguments.motion_only || rig.plant.is_some() || arguments.system.is_some();
    let system = arguments
        .system
        .clone()
        .unwrap_or(DEFAULT_SYSTEM.to_string());
    if rig.plant.is_none() && !laboratory::run::experiment::is_file(&system) {
        rig.plant = Some(DEFAULT_PLANT.to_string());
    }
    let motion = MotionArguments::default();
    let request = || run::request(&run::Arguments::of(Some(system), motion, rig, own(of_rig)));
    Ok(Plan {
        rule,
        record,
        seed: arguments.seed,
        request: wants_rig.then(request).transpose()?,
        motion_only: arguments.motion_only,
        rounds: arguments.rounds,
        search: match arguments.search {
            Search::Sweep => Some(Excitation::Sweep),
            Search::Random => Some(Excitation::Random),
            Search::None => None,
        },
        set_after: arguments.set_after.clone(),
    })
}

fn text(found: &Qualification) -> String {
    let mut text = format!("{}\n\n", found.rule.name);
    for own in std::iter::once(&found.motion).chain(&found.further_axes) {
        let seed = own
            .seed
            .map_or(String::new(), |seed| format!(", seed {seed}"));
        text += &format!(
            "motion{seed}: {:.3} g, {:.1} mm/s, {:.2} mm; test over required spectrum {:.3} to {:.3}\n",
            own.pga_g,
            1e3 * own.peak_velocity_m_s,
            1e3 * own.peak_displacement_m,
            own.lowest_ratio,
            own.highest_ratio
        );
    }
    if let (Some(r), Some(c)) = (found.correlation, found.coherence) {
        text += &format!("axes: correlation {r:.3}, coherence {c:.3}\n");
    }
    text += &match &found.limited_by {
        Some(name) => format!("level {}: limited by {name}\n", found.level),
        None => format!("level {}\n", found.level),
    };
    for own in &found.high_pass {
        text += &format!(
            "  {} if the band begins at {:.2} Hz\n",
            own.level, own.from_hz
        );
    }
    if !found.approach.is_empty() {
        let heads = ["level", "lowest", "highest", "exposure", ""];
        let mut rows = vec![heads.map(str::to_string).to_vec()];
        for own in found.approach.iter().chain(&found.rounds) {
            rows.push(vec![
                format!("{:.3}", own.level),
                format!("{:.3}", own.lowest_ratio),
                format!("{:.3}", own.highest_ratio),
                format!("{:.2}", own.exposure),
                own.ended_because.clone().unwrap_or(own.verdict.to_string()),
            ]);
        }
        text += &format!("\n{}", aligned(&rows));
    }
    for (when, all) in [
        ("before", &found.resonances_before),
        ("after", &found.resonances_after),
    ] {
        for own in all {
            text += &format!(
                "resonance {when}: {:.3} Hz ({:.3} to {:.3}), damping {:.2} %\n",
                own.frequency_hz,
                own.interval_95[0],
                own.interval_95[1],
                100.0 * own.damping
            );
        }
    }
    for own in &found.shifts {
        text += &format!(
            "shift of {:.3} Hz: {:.2} % ({:.2} to {:.2}), {}\n",
            own.before_hz,
            own.shift_percent,
            own.interval_95[0],
            own.interval_95[1],
            if own.changed {
                "changed"
            } else {
                "no change shown"
            }
        );
    }
    text + &format!("\nThe test response spectrum {}.\n", found.verdict)
}
