//! `shakebench design`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use controllers::ModelError;
use controllers::allocation::ControlAllocation;
use controllers::loop_shaping::LoopShapingCoefficients;
use controllers::loops::{Controlled, LinearLaw, Loop, Time};
use controllers::pid::Pid;
use controllers::sliding_mode::{self, SlidingMode};
use controllers::synthesis::{self, EQUATION_3_10_CROSSOVER, LoopShapingDesign};
use controllers::three_variable::ThreeVariableGains;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;
use serde::Serialize;
use units::constants::SAMPLING_PERIOD;

use crate::design::page as design_report;
use crate::error::Error;
use crate::report::columns::{aligned, significant};
use crate::units::INCH;

/// Options of `shakebench design`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench design\n  \
    shakebench design --loop loop-shaping-synthesis --crossover 50 --json")]
pub struct Arguments {
    /// One loop: displacement-pid, force-pid, loop-shaping, loop-shaping-synthesis,
    /// three-variable or sliding-mode [default: all]
    #[arg(long = "loop", value_name = "NAME")]
    only: Option<String>,
    /// Target crossover of the loop-shaping synthesis, rad/s [default: 65, which comes nearest to
    /// Eq 3-10]
    #[arg(long, value_name = "RAD_PER_S")]
    crossover: Option<f64>,
    /// What stands on the table: none, linear [default: none]
    #[arg(long, value_name = "NAME")]
    specimen: Option<String>,
    /// Folder for report.html [default: shakebench-results/design]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Lowest frequency that is looked at, rad/s: a decade below the slow zero of the plant.
const LOWEST: f64 = 1e-3;
/// Lower edge of the band of the motions, rad/s: 0.25 Hz.
const BAND: f64 = std::f64::consts::TAU * 0.25;

/// A loop with its name.
pub(crate) struct NamedLoop {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) rig_loop: Loop,
}

/// Names of the loops.
pub const NAMES: [&str; 6] = [
    "displacement-pid",
    "force-pid",
    "loop-shaping",
    "loop-shaping-synthesis",
    "three-variable",
    "sliding-mode",
];

#[derive(Debug, Serialize)]
struct Figures {
    stable: bool,
    crossover_rad_s: Option<f64>,
    /// All crossovers, ascending; the margin is smallest at the one above.
    crossovers_rad_s: Vec<f64>,
    phase_margin_deg: Option<f64>,
    phase_crossover_rad_s: Option<f64>,
    gain_margin_db: Option<f64>,
    /// Where the closed loop has fallen by 3 dB, sought from the band of the motions upwards; absent
    /// where the loop is unstable or does not fall so far below the Nyquist frequency.
    bandwidth_hz: Option<f64>,
    /// The same sought from frequency zero upwards: feedforward beside feedback can leave a dip
    /// far below the band.
    bandwidth_from_zero_hz: Option<f64>,
    /// The closed-loop pole nearest to instability (or farthest in it): real and imaginary part,
    /// in 1/s, as sampled in the z plane.
    critical_pole: [f64; 2],
}

#[derive(Debug, Serialize)]
struct Row {
    name: &'static str,
    #[serde(flatten)]
    continuous: Figures,
    sampled: Figures,
    sampling_period_s: f64,
    note: String,
}

#[derive(Debug, Serialize)]
struct Synthesis {
    crossover_rad_s: f64,
    gamma_min: f64,
    gamma: f64,
    gain_v_m: f64,
    numerator_rate_1_s: f64,
    numerator_constant_1_s2: f64,
    pole_1_s: f64,
    hankel_singular_values: Vec<f64>,
}

/// Loops with their figures.
pub struct Design {
    loops: Vec<NamedLoop>,
    rows: Vec<Row>,
    shaping: LoopShapingDesign,
    specimen: String,
}

/// Finds the figures of the loop `only` (or of all), with the loop-shaping synthesis for the target
/// `crossover` in rad/s and `specimen` (none or linear) on the table.
///
/// # Errors
/// An unknown name, or a crossover for which there is no controller.
pub fn design(
    only: Option<&str>,
    crossover: Option<f64>,
    specimen: Option<&str>,
) -> Result<Design, Error> {
    if let Some(name) = only
        && !NAMES.contains(&name)
    {
        let reason = format!("`{name}` is no loop; expected one of {}", NAMES.join(", "));
        return Err(Error::Option {
            option: "--loop",
            reason,
        });
    }
    let specimen = specimen.unwrap_or("none");
    let rig = Rig {
        specimen: linear_specimen(specimen)?,
        ..Rig::default()
    };
    let fault = |option| {
        move |error: ModelError| Error::Option {
            option,
            reason: error.to_string(),
        }
    };
    let shaping = synthesis::loop_shaping(
        &ShakeTable::default().voltage_to_displacement(),
        crossover.unwrap_or(EQUATION_3_10_CROSSOVER),
    )
    .map_err(fault("--crossover"))?;
    let mut loops = loops(&rig, &shaping).map_err(fault("design"))?;
    loops.retain(|one| only.is_none_or(|name| name == one.name));
    Ok(Design {
        rows: loops.iter().map(row).collect(),
        loops,
        shaping,
        specimen: specimen.to_string(),
    })
}

impl Design {
    /// What `--json` prints.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "loops": self.rows,
            "specimen": self.specimen,
            "synthesis": Synthesis::from(&self.shaping),
            "sliding_mode_rate_1_s": sliding_mode::IDENTIFIED_RATE,
        })
    }
}

/// Prints margins, crossover, bandwidth and stability of the loops and draws their responses.
///
/// # Errors
/// What [`design`] refuses, or a report that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let design = design(
        arguments.only.as_deref(),
        arguments.crossover,
        arguments.specimen.as_deref(),
    )?;
    let rows = &design.rows;
    let folder = arguments.out.clone();
    let folder = folder.unwrap_or_else(|| "shakebench-results/design".into());
    let file = design_report::write(&folder, &design.loops, &design.shaping, &table(rows))?;
    if arguments.json {
        let mut json = design.json();
        json["report"] = file.display().to_string().into();
        println!("{json}");
        return Ok(ExitCode::SUCCESS);
    }
    print!("{}", aligned(&table(rows)));
    println!();
    for row in rows.iter().filter(|row| !row.note.is_empty()) {
        println!("{}: {}", row.name, row.note);
    }
    if rows.iter().any(|row| row.name == "loop-shaping-synthesis") {
        print!("{}", Synthesis::from(&design.shaping).words());
    }
    println!("\nwritten:\n  {}", file.display());
    Ok(ExitCode::SUCCESS)
}

fn linear_specimen(name: &str) -> Result<Option<LinearSpecimen>, Error> {
    match name {
        "none" => Ok(None),
        "linear" => Ok(Some(LinearSpecimen::appendix_a())),
        other => Err(Error::Option {
            option: "--specimen",
            reason: format!("`{other}` has no linear model; expected none or linear"),
        }),
    }
}

/// Every loop around `rig`, in the order of [`NAMES`].
fn loops(rig: &Rig, design: &LoopShapingDesign) -> Result<Vec<NamedLoop>, ModelError> {
    let h = SAMPLING_PERIOD;
    let allocation = ControlAllocation::default();
    let laws = [
        (
            LinearLaw::pid(&Pid::equation_3_6(), Controlled::Displacement, h)?,
            "displacement PID, Eq 3-6",
        ),
        (
            LinearLaw::pid(&Pid::equation_3_7(), Controlled::Force, h)?,
            "force PID, Eq 3-7, with the whole valve",
        ),
        (
            LinearLaw::loop_shaping(&LoopShapingCoefficients::equation_3_10(), h)?,
            "loop shaping, Eq 3-10",
        ),
        (
            LinearLaw::loop_shaping(&design.coefficients, h)?,
            "loop shaping, synthesised for the target crossover",
        ),
        (
            LinearLaw::three_variable(&ThreeVariableGains::table_3_2(), h)?,
            "three-variable control, Table 3-2, broken at the valve",
        ),
        (
            LinearLaw::hierarchy(
                &SlidingMode::default(),
                &sliding_mode::displacement_loop(&allocation),
                &sliding_mode::force_loop(&allocation),
                &allocation,
                h,
            )?,
            "sliding mode over displacement and force loop, Fig 4-3, broken at the valve",
        ),
    ];
    Ok(NAMES
        .into_iter()
        .zip(laws)
        .map(|(name, (law, about))| NamedLoop {
            name,
            about,
            rig_loop: Loop::new(rig, law),
        })
        .collect())
}

fn row(one: &NamedLoop) -> Row {
    let [continuous, sampled] =
        [Time::Continuous, Time::Sampled].map(|time| figures(&one.rig_loop, time));
    let mut note = String::new();
    if continuous.stable && !sampled.stable {
        let [re, im] = sampled.critical_pole;
        note = format!(
            "stable in continuous time only; sampled at {} Hz it is unstable (a pole at |z| = {:.2})",
            1.0 / SAMPLING_PERIOD,
            re.hypot(im)
        );
    } else if !continuous.stable {
        note = "unstable".to_string();
    }
    Row {
        name: one.name,
        continuous,
        sampled,
        sampling_period_s: SAMPLING_PERIOD,
        note,
    }
}

fn figures(rig_loop: &Loop, time: Time) -> Figures {
    let margins = rig_loop.margins(time, LOWEST);
    let poles = rig_loop.closed_loop_poles(time);
    let growth = |pole: &nalgebra::Complex<f64>| match time {
        Time::Continuous => pole.re,
        Time::Sampled => pole.norm(),
    };
    let critical = poles.iter().max_by(|a, b| growth(a).total_cmp(&growth(b)));
    let stable = rig_loop.is_stable(time);
    let bandwidth = |from| {
        let found = stable
            .then(|| rig_loop.bandwidth(time, LOWEST, from))
            .flatten();
        found.map(|omega| omega / std::f64::consts::TAU)
    };
    Figures {
        stable,
        crossover_rad_s: margins.crossover,
        crossovers_rad_s: rig_loop.crossovers(time, LOWEST),
        phase_margin_deg: margins.phase_margin_deg,
        phase_crossover_rad_s: margins.phase_crossover,
        gain_margin_db: margins.gain_margin_db,
        bandwidth_hz: bandwidth(BAND),
        bandwidth_from_zero_hz: bandwidth(LOWEST),
        critical_pole: critical.map_or([0.0; 2], |pole| [pole.re, pole.im]),
    }
}

fn table(rows: &[Row]) -> Vec<Vec<String>> {
    let heads = [
        "loop",
        "time",
        "stable",
        "crossover",
        "phase margin",
        "gain margin",
        "bandwidth",
    ];
    let units = ["", "", "", "rad/s", "deg", "dB", "Hz"];
    let mut table = vec![
        heads.map(String::from).to_vec(),
        units.map(String::from).to_vec(),
    ];
    let cell = |value: Option<f64>| value.map_or("-".to_string(), |value| significant(value, 4));
    for row in rows {
        for (time, figures) in [("continuous", &row.continuous), ("500 Hz", &row.sampled)] {
            table.push(vec![
                if time == "continuous" {
                    row.name.to_string()
                } else {
                    String::new()
                },
                time.to_string(),
                if figures.stable { "yes" } else { "NO" }.to_string(),
                cell(figures.crossover_rad_s),
                cell(figures.phase_margin_deg),
                cell(figures.gain_margin_db),
                cell(figures.bandwidth_hz),
            ]);
        }
    }
    table
}

impl From<&LoopShapingDesign> for Synthesis {
    fn from(design: &LoopShapingDesign) -> Self {
        let c = design.coefficients;
        Self {
            crossover_rad_s: design.crossover,
            gamma_min: design.robust.gamma_min,
            gamma: design.robust.gamma,
            gain_v_m: c.gain,
            numerator_rate_1_s: c.numerator_rate,
            numerator_constant_1_s2: c.numerator_constant,
            pole_1_s: c.pole,
            hankel_singular_values: design.hankel_singular_values.clone(),
        }
    }
}

impl Synthesis {
    fn words(&self) -> String {
        format!(
            "loop-shaping-synthesis: target {} rad/s, gamma_min {:.4}; C = {:.4} (s^2 + {:.4} s + {:.4}) / \
             (s (s + {:.5})) V/in (Eq 3-10: 6.986, 0.2975, 0.5892, 0.01046)\n",
            significant(self.crossover_rad_s, 3),
            self.gamma_min,
            self.gain_v_m * INCH,
            self.numerator_rate_1_s,
            self.numerator_constant_1_s2,
            self.pole_1_s
        )
    }
}
