//! `shakebench serve`

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use bridges::element::{Interval, Moves, Shape};
use bridges::{Admission, Event};
use clap::{Args, ValueEnum};

use super::out::{self, given, unused};
use super::quantity::{ValueError, at_least_one, if_given, positive};
use super::rig::RigArguments;
use super::{OneVersion, interrupt, run};
use fmi_system::ElementFile;
use laboratory::error::Error;
use laboratory::results::Results;
use laboratory::run::manifest::Manifest;
use laboratory::run::page;
use laboratory::run::summary::Summary;
use laboratory::serve::{self, Mode, Times, Wanted, Watched};

/// How a rig goes through a step of the analysis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PathShape {
    /// On a straight line over the whole step
    Ramp,
    /// On a straight line over the step; then it is held for --settle before the force is read
    Hold,
    /// On a cubic that keeps the velocity from step to step
    Continuous,
    /// First where the last steps point, then to the trial
    Predict,
}

/// When a rig moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Move {
    /// When the force at a new displacement is asked for
    Trial,
    /// At the commit; until then the force is that of the step before
    Commit,
}

/// An address of this machine with a port; `localhost` is 127.0.0.1.
fn address(text: &str) -> Result<SocketAddr, ValueError> {
    let port = text.strip_prefix("localhost:");
    let whole = port.map_or(text.to_string(), |port| format!("127.0.0.1:{port}"));
    let expected = "an address and a port up to 65535, such as 127.0.0.1:8090";
    whole.parse().map_err(|_| ValueError::Expected(expected))
}

/// Options of `shakebench serve`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench serve three-variable --openfresco --mode rig --units in,kip\n  \
    shakebench serve element.toml --openfresco 127.0.0.1:8090 --mode ideal --units m,N")]
pub struct Arguments {
    /// Built-in system, .toml or .fmu file, or .ssp archive
    #[arg(value_name = "SYSTEM")]
    system: String,
    /// Answer OpenFresco's protocol at this address, over TCP and UDP; other machines reach it only
    /// where --allow names them
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, required = true,
        default_missing_value = "127.0.0.1:8090", value_parser = address)]
    openfresco: SocketAddr,
    /// What a trial is answered: `rig` moves once a step and takes nothing back, `ideal` answers any
    /// trial from the state at the last commit
    #[arg(long, value_enum, default_value_t = Mode::Rig)]
    mode: Mode,
    #[command(flatten)]
    rig: RigArguments,
    /// What a trial moves: `reference`, or inputs as COMPONENT.INPUT
    #[arg(long, value_name = "INPUT,...", value_delimiter = ',')]
    command: Vec<String>,
    /// The force that resists a positive displacement, with - before it where its sign is the other
    /// [default: -specimen.force, or the only force]
    #[arg(
        long,
        value_name = "[-]OUTPUT,...",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    force_signal: Vec<String>,
    /// The displacement that is measured [default: that of the table, plant or actuator]
    #[arg(long, value_name = "OUTPUT,...", value_delimiter = ',')]
    displacement: Vec<String>,
    /// Stiffness of the element, row by row, in the client's units
    #[arg(
        long,
        value_name = "K,...",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    stiffness: Vec<f64>,
    /// How the rig goes through a step
    #[arg(long, value_enum, default_value_t = PathShape::Ramp)]
    path: PathShape,
    /// How long --path hold waits before the force is read
    #[arg(long, value_name = "T", default_value = "0.1 s")]
    settle: String,
    /// Share of the step that --path predict predicts
    #[arg(long, value_name = "SHARE", default_value = "60 %")]
    predicted: String,
    /// How long a step of the analysis lasts [default: as the client's time passes]
    #[arg(long, value_name = "T")]
    interval: Option<String>,
    /// Seconds of the rig for a second of the analysis
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    time_scale: f64,
    /// When the rig moves, in --mode rig
    #[arg(long = "move", value_enum, default_value_t = Move::Trial)]
    moves: Move,
    /// Trials that share a step out, of an integrator with a fixed number of iterations
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    iterations: usize,
    /// Addresses that may come, besides this machine's own
    #[arg(long, value_name = "IP,...", value_delimiter = ',')]
    allow: Vec<IpAddr>,
    /// How long the client may be silent
    #[arg(long, value_name = "T", default_value = "60 s")]
    silence: String,
    /// Parameter, such as control.valve_limit="5 V"; may be given several times
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// FMI version of the project's own components
    #[arg(long, value_enum, default_value_t)]
    fmi: OneVersion,
    /// Coupling step [default: that of the system]
    #[arg(long, value_name = "T")]
    step: Option<String>,
    /// Show trials, forces and round trips live on a local page at this port (default: any free port)
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    watch: Option<u16>,
    /// Folder for the results [default: shakebench-results/SYSTEM-served]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Serves one client and writes what came of it.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments, units: Option<&str>) -> Result<ExitCode, Error> {
    let wanted = wanted(arguments, units)?;
    let request = wanted.request.clone();
    let service = serve::prepare(wanted)?;
    let server = service.listen()?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let stem = std::path::Path::new(&arguments.system).file_stem();
        let name = stem.map_or("system".into(), |stem| stem.to_string_lossy());
        unused(&serve::usual_folder(&name), |_| false)
    });
    Results::check(&folder)?;
    say_what(&service);
    let n = service.channels().degrees_of_freedom();
    let mut watched = match arguments.watch {
        Some(port) => Some(Watched::start(&arguments.system, n, port, out::units())?),
        None => None,
    };
    if let Some(watched) = &watched {
        eprintln!("watch it at {}", watched.url());
    }
    eprintln!("listening at {} (TCP and UDP)", server.address());
    let mut over = service.serve(
        &server,
        &folder,
        interrupt::heed(),
        &mut |event| match event {
            Event::Connected { peer, protocol, .. } => {
                eprintln!("{peer} is served over {protocol}")
            }
            Event::TurnedAway { peer, reason } => eprintln!("{peer} was turned away: {reason}"),
            Event::Step(step) => {
                if let Some(watched) = &mut watched {
                    watched.step(step);
                }
            }
        },
    )?;
    let (prepared, outcome) = (&over.prepared, &mut over.outcome);
    let plan = (prepared.algorithm, prepared.step, prepared.samples);
    let mut manifest = Manifest::new(&request, &prepared.system, &prepared.motion, plan);
    let summary = Summary::new(prepared, outcome, &manifest);
    let mut files = page::write(&folder, prepared, outcome, &summary, &mut manifest, false)?;
    let own = folder.join("service.json");
    let text = serde_json::to_string_pretty(&over.summary).unwrap_or_default();
    std::fs::write(&own, text).map_err(|error| Error::File {
        path: own.clone(),
        reason: error.to_string(),
    })?;
    files.extend([folder.join(serve::EXCHANGES), own]);
    if arguments.json {
        println!("{}", serde_json::json!(over.summary));
    } else {
        print!("{}", text_of(&over.summary));
        println!();
        super::print_files(&files);
    }
    if let Some(watched) = watched {
        watched.finish(over.summary.ended);
    }
    match &over.summary.reason {
        None => Ok(ExitCode::SUCCESS),
        Some(reason) => {
            eprintln!("error: the service ended early: {reason}");
            eprintln!("what was computed until then is saved");
            Ok(ExitCode::from(1))
        }
    }
}

fn wanted(arguments: &Arguments, units: Option<&str>) -> Result<Wanted, Error> {
    let run = run::Arguments::of(
        Some(arguments.system.clone()),
        super::motion::MotionArguments::default(),
        arguments.rig.clone(),
        arguments.set.clone(),
    );
    let mut request = run::request(&run)?;
    request.fmi = arguments.fmi.into();
    request.step_s = if_given("--step", &arguments.step, "s")?;
    let seconds = |option, text: &str| {
        let value = positive(option, text, "s")?;
        Duration::try_from_secs_f64(value).map_err(|error| Error::Option {
            option,
            reason: error.to_string(),
        })
    };
    if !(arguments.time_scale > 0.0 && arguments.time_scale.is_finite()) {
        return Err(Error::Option {
            option: "--time-scale",
            reason: format!("{}; expected a number above 0", arguments.time_scale),
        });
    }
    let silence = seconds("--silence", &arguments.silence)?;
    let shape = match arguments.path {
        PathShape::Ramp => Shape::Ramp,
        PathShape::Hold => Shape::Hold {
            settle: positive("--settle", &arguments.settle, "s")?,
        },
        PathShape::Continuous => Shape::Continuous,
        PathShape::Predict => {
            let share = super::quantity::percent("--predicted", &arguments.predicted)? / 100.0;
            if share >= 1.0 {
                return Err(Error::Option {
                    option: "--predicted",
                    reason: "nothing of the step is left to correct; expected less than 100 %"
                        .to_string(),
                });
            }
            Shape::PredictorCorrector { share }
        }
    };
    Ok(Wanted {
        request,
        element: ElementFile {
            units: units.map(str::to_string),
            command: arguments.command.clone(),
            displacement: arguments.displacement.clone(),
            force: arguments.force_signal.clone(),
            stiffness: arguments.stiffness.clone(),
        },
        address: arguments.openfresco,
        admission: Admission {
            peers: arguments.allow.clone(),
            set_up: Duration::from_secs(10).min(silence),
            silence,
        },
        mode: arguments.mode,
        shape,
        interval: Interval {
            fixed: if_given("--interval", &arguments.interval, "s")?,
            scale: arguments.time_scale,
        },
        moves: match arguments.moves {
            Move::Trial => Moves::AtTrials {
                iterations: arguments.iterations,
            },
            Move::Commit => Moves::AtCommit,
        },
    })
}

/// Says what moves and what is measured, for both may have been found rather than said.
fn say_what(service: &serve::Service) {
    let channels = service.channels();
    let moved = match &channels.command {
        serve::Command::Reference => "the reference".to_string(),
        serve::Command::Inputs(inputs) => format!("`{}`", inputs.join("`, `")),
    };
    let force = channels.force.iter().map(|channel| {
        let sign = if channel.factor < 0.0 { "-" } else { "" };
        format!("`{sign}{}`", channel.name)
    });
    let force: Vec<String> = force.collect();
    eprintln!("a trial moves {moved}; the force is {}", force.join(", "));
}

fn text_of(summary: &serve::Summary) -> String {
    let times = |times: &Times| {
        format!(
            "median {:.1} us, 99.9 % below {:.1} us, longest {:.1} us",
            1e6 * times.median_s,
            1e6 * times.p999_s,
            1e6 * times.longest_s
        )
    };
    let client = summary.client.as_deref().unwrap_or("none");
    format!(
        "{} as an experimental element ({})\n  client     {client}\n  steps      {} with {} trials\n  \
         exchanges  {:.0} a second\n  answers    {}\n  pauses     {}\n",
        summary.system,
        match summary.mode {
            Mode::Ideal => "ideal",
            Mode::Rig => "rig",
        },
        summary.steps,
        summary.trials,
        summary.exchanges_per_s,
        times(&summary.answers),
        times(&summary.pauses),
    )
}
