//! Commissions rigs with valves that are not ideal, and runs the controllers that come of it.
//!
//! `cargo run --release -p stranger-rig --example judge_rigs -- [--cases N] [--seed S] [--shard I/N]
//! [--program FILE] [--limit SECONDS] [--controller NAME] [--record FILE] [--out DIR]`
//!
//! The rigs are FMUs with equations of their own (`tests/strangers/src/hydraulic.rs`); sensors, interlock and
//! controllers are the program's. With `--out` results are kept, and only rigs that are missing are tried.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use StrangerRig::StrangerRig as Component;
use fmu_kit::description::fmi3;
use fmu_kit::model::Model;
use serde_json::{Value, json};
use strangers::dice::Dice;
use strangers::hydraulic::Rig;
use strangers::judge::{Judge, share};
use strangers::options::Options;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const PLANT: &str =
    include_str!("../../../../orchestrator/laboratory/systems/plant/servohydraulic.toml");
const POUND: f64 = 4.448_221_615_260_5;
const SNAIL: f64 = POUND / 0.0254;
/// What the displacement's sensor is late, s: a sample and a lag of 300 Hz. Recordings do not tell it from the command's
/// delay.
const SENSOR: f64 = 2e-3 + 1.0 / (std::f64::consts::TAU * 300.0);

/// Packs the rig's library, which Cargo leaves beside the folder of this program, for FMI 3.0 on this platform.
fn pack(folder: &Path) -> Result<PathBuf, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let built = program
        .ancestors()
        .nth(2)
        .ok_or("this program lies nowhere")?;
    let library = built.join("deps/libStrangerRig.so");
    let code = fs::read(&library).map_err(|error| format!("{}: {error}", library.display()))?;
    let model = Model::<Component>::get().map_err(|error| error.to_string())?;
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let fmu = folder.join("StrangerRig.fmu");
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", fmu.display());
    let mut archive = ZipWriter::new(File::create(&fmu).map_err(|error| failed(&error))?);
    for (name, content) in [
        ("modelDescription.xml", fmi3(model).as_bytes()),
        ("binaries/x86_64-linux/StrangerRig.so", &code),
    ] {
        archive
            .start_file(name, SimpleFileOptions::default())
            .map_err(|error| failed(&error))?;
        archive.write_all(content).map_err(|error| failed(&error))?;
    }
    archive.finish().map_err(|error| failed(&error))?;
    Ok(fmu)
}

/// A rig of a seed, what is on it, and how loud its sensors are.
fn draw(seed: u64) -> (Rig, bool, f64) {
    let dice = &mut Dice::new(seed, 40);
    let usual = Rig::default();
    let friction = dice.between(0.5, 3.0);
    let sometimes = |dice: &mut Dice, value: f64| if dice.chance(0.3) { 0.0 } else { value };
    let mut rig = Rig {
        overlap: dice.between(5e-3, 0.3),
        null_loss: dice.even(0.0, 0.5),
        null_width: dice.between(0.05, 0.3),
        asymmetry: dice.even(-0.05, 0.05),
        null_bias: dice.even(-0.05, 0.05),
        delay: dice.even(0.0, 4e-3),
        valve_frequency: dice.between(45.0, 90.0),
        flow_coefficient: usual.flow_coefficient * dice.between(0.8, 1.25),
        bulk_modulus: usual.bulk_modulus * dice.between(0.7, 1.4),
        coulomb: usual.coulomb * friction,
        breakaway: usual.breakaway * friction * dice.even(0.8, 1.2),
        deflection: usual.deflection * dice.between(0.3, 2.0),
        payload: usual.table_mass * dice.even(0.0, 2.0),
        disturbance: dice.between(5e-4, 4e-3),
        disturbance_frequency: dice.between(5.0, 40.0),
        ..usual
    };
    rig.overlap = sometimes(dice, rig.overlap);
    rig.null_loss = sometimes(dice, rig.null_loss);
    if dice.chance(0.25) {
        rig.specimen_mass = usual.table_mass * dice.even(0.2, 1.0);
        rig.specimen_frequency = dice.between(1.5, 6.0);
        rig.payload /= 2.0;
    }
    (rig, dice.chance(0.5), dice.between(0.5, 4.0))
}

/// The system file of its plant: the program's, with the rig's FMU and its parameters.
fn plant(fmu: &Path, rig: &Rig, elasto_plastic: bool, noise: f64) -> String {
    let parameters = format!(
        "fmu = \"{}\"\n[components.table.parameters]\noverlap = {:e}\nnull_loss = {:e}\nnull_width = {:e}\n\
         asymmetry = {:e}\nnull_bias = {:e}\ndelay = {:e}\nvalve_frequency = {:e}\nflow_coefficient = {:e}\n\
         bulk_modulus = {:e}\ncoulomb = {:e}\nbreakaway = {:e}\ndeflection = {:e}\npayload = {:e}\n\
         specimen_mass = {:e}\nspecimen_frequency = {:e}\ndisturbance = {:e}\ndisturbance_frequency = {:e}\n\
         elasto_plastic = {elasto_plastic}\n",
        fmu.display(),
        rig.overlap,
        rig.null_loss,
        rig.null_width,
        rig.asymmetry,
        rig.null_bias,
        rig.delay,
        rig.valve_frequency,
        rig.flow_coefficient,
        rig.bulk_modulus,
        rig.coulomb,
        rig.breakaway,
        rig.deflection,
        rig.payload,
        rig.specimen_mass,
        rig.specimen_frequency,
        rig.disturbance,
        rig.disturbance_frequency,
    );
    let louder = |line: &str| {
        let (key, value) = line.split_once("_noise = \"")?;
        let (number, unit) = value.split_once(' ')?;
        let number: f64 = number.parse().ok()?;
        Some(format!("{key}_noise = \"{:e} {unit}", noise * number))
    };
    let lines = PLANT
        .lines()
        .map(|line| louder(line).unwrap_or_else(|| line.to_string()));
    let text = lines.collect::<Vec<_>>().join("\n");
    let inside = rig.specimen_mass > 0.0;
    let text = if inside {
        text.replace(
            "specimen.acceleration  ->",
            "table.specimen_acceleration ->",
        )
        .replacen("specimen_acceleration = \"0 g\"\n", "", 1)
    } else {
        text
    };
    text.replace("fmu = \"ServoHydraulicTable\"\n", &parameters)
}

/// `time_domain_percent` of a run; nothing where it ended early.
fn tracking(judge: &Judge, arguments: &[&str], folder: &Path) -> Result<Option<f64>, String> {
    let answer = judge
        .ask(arguments, folder)
        .map_err(|error| error.to_string())?;
    let json = answer.json.unwrap_or_default();
    if json["ended"] != "complete" {
        eprintln!("    {} {}", json["ended"], answer.complaint);
        return Ok(None);
    }
    Ok(json["tracking"]["time_domain_percent"].as_f64())
}

/// Estimate and standard error of what the model file says, beside the truth: mass, delay, friction, oil and
/// valve.
fn intervals(model: &str, rig: &Rig) -> Vec<Value> {
    let find = |section: &str, key: &str| -> Option<f64> {
        let mut inside = section.is_empty();
        for line in model.lines() {
            if line.starts_with('[') {
                inside = line.trim_matches(['[', ']']) == section;
            } else if inside
                && let Some((name, value)) = line.split_once(" = ")
                && name == key
            {
                return value.parse().ok();
            }
        }
        None
    };
    let oil = 4.0 * rig.bulk_modulus * rig.area * rig.area / rig.volume;
    let speed = rig.flow_coefficient * (rig.supply / 2.0).sqrt() / rig.area;
    [
        ("table", "mass", (rig.table_mass + rig.payload) / SNAIL),
        ("", "command_delay", rig.delay + SENSOR),
        ("hydraulics", "seal_friction", rig.coulomb),
        ("hydraulics", "oil_stiffness", oil),
        ("hydraulics", "force_rate", oil * speed),
    ]
    .into_iter()
    .filter(|(_, key, _)| *key != "mass" || rig.specimen_mass == 0.0)
    .filter_map(|(section, key, truth)| {
        let errors = ["standard_errors", section].join(".");
        let (value, error) = (find(section, key)?, find(errors.trim_end_matches('.'), key)?);
        let held = (value - truth).abs() <= 1.96 * error;
        Some(json!({"parameter": key, "truth": truth, "value": value, "standard_error": error, "held": held}))
    })
    .collect()
}

/// Commissions the rig of a seed and runs what came of it.
fn try_rig(
    judge: &Judge,
    fmu: &Path,
    seed: u64,
    options: &Options,
    scratch: &Path,
) -> Result<Value, String> {
    let (rig, elasto_plastic, noise) = draw(seed);
    let folder = scratch.join(format!("rig-{seed}"));
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let file = folder.join("plant.toml");
    fs::write(&file, plant(fmu, &rig, elasto_plastic, noise)).map_err(|error| error.to_string())?;
    let text = |path: PathBuf| path.to_string_lossy().into_owned();
    let (file, out) = (text(file), folder.join("commissioned"));
    let commissioned = judge
        .ask(
            &[
                "commission",
                "--plant",
                &file,
                "--out",
                &text(out.clone()),
                "--json",
            ],
            &folder.join("commission"),
        )
        .map_err(|error| error.to_string())?;
    let said = commissioned.json.unwrap_or_default();
    let controller = options.text("controller").unwrap_or("adaptive-preview");
    let mut motion = vec!["--duration", "20 s", "--json"];
    let record = options.path("record").map(text);
    if let Some(record) = &record {
        motion.extend(["--record", record]);
    }
    let run = |system: &str, plant: &[&str], name: &str| {
        let out = text(folder.join(name).join("run"));
        let arguments = [&["run", system, "--out", &out], plant, &motion].concat();
        tracking(judge, &arguments, &folder.join(name))
    };
    let own = out.join(format!("{controller}.toml"));
    let own = if own.is_file() {
        run(&text(own), &[], "own")?
    } else {
        None
    };
    let usual = run(
        controller,
        &["--plant", &file, "--specimen", "none"],
        "usual",
    )?;
    let predictions = said["predictions"]
        .as_array()
        .map_or(&[][..], Vec::as_slice);
    let largest = predictions
        .iter()
        .filter_map(|p| p["largest_percent"].as_f64())
        .reduce(f64::max);
    let model = fs::read_to_string(out.join("model.toml")).unwrap_or_default();
    Ok(json!({
        "seed": seed,
        "rig": rig,
        "noise": noise,
        "status": commissioned.status,
        "seconds": commissioned.seconds,
        "complaint": commissioned.complaint,
        "verdict": said["verdict"],
        "causes": said["causes"],
        "validation": said["validation_percent"].as_f64().or(largest),
        "predicted": said["predicted_percent"][controller],
        "own": own,
        "usual": usual,
        "intervals": intervals(&model, &rig),
    }))
}

fn table(rigs: &[Value]) {
    let number = |rig: &Value, key: &str| rig[key].as_f64();
    let quantile = |key: &str, p: f64| {
        let mut values: Vec<f64> = rigs
            .iter()
            .map(|rig| number(rig, key).unwrap_or(f64::INFINITY))
            .collect();
        values.sort_by(f64::total_cmp);
        let last = values.len().saturating_sub(1);
        values
            .get((p * last as f64).round() as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    println!("{:<52}{:>10}   came out", "what", "aim");
    let row = |name: &str, aim: &str, value: String| println!("{name:<52}{aim:>10}   {value}");
    for (key, name) in [
        ("own", "on its own recordings"),
        ("usual", "with the usual design"),
    ] {
        let (half, most) = (quantile(key, 0.5), quantile(key, 0.95));
        let stopped = rigs.iter().filter(|rig| rig[key].is_null()).count();
        row(
            &format!("{name}: median, 95 %, %"),
            "1.5, 3",
            format!("{half:.2}, {most:.2}; {stopped} stopped or refused"),
        );
    }
    let warned = |rig: &&Value| {
        rig["verdict"] == "robust" || rig["verdict"] == "extended" || rig["status"] != 0
    };
    let worse = |rig: &&Value| {
        let own = number(rig, "own").unwrap_or(f64::INFINITY);
        number(rig, "usual").is_some_and(|usual| own > 1.1 * usual) && !warned(rig)
    };
    row(
        "worse than the usual design by a tenth, unannounced",
        "0",
        share(rigs.iter().filter(worse).count(), rigs.len()),
    );
    let far: Vec<&Value> = rigs
        .iter()
        .filter(|rig| number(rig, "validation").is_none_or(|v| v > 5.0))
        .collect();
    row(
        "validation above 5 %: refused, extended or robust",
        "all",
        share(far.iter().copied().filter(warned).count(), far.len()),
    );
    let foretold: Vec<f64> = rigs
        .iter()
        .filter_map(|rig| Some(number(rig, "own")? / number(rig, "predicted")?))
        .collect();
    let near = foretold
        .iter()
        .filter(|ratio| (1.0 / 1.3..=1.3).contains(*ratio))
        .count();
    row(
        "predicted error within a factor of 1.3",
        "90 %",
        share(near, foretold.len()),
    );
    for key in [
        "mass",
        "command_delay",
        "seal_friction",
        "oil_stiffness",
        "force_rate",
    ] {
        let all = rigs
            .iter()
            .filter_map(|rig| rig["intervals"].as_array())
            .flatten();
        let of: Vec<&Value> = all.filter(|i| i["parameter"] == key).collect();
        let held = of.iter().filter(|i| i["held"] == true).count();
        row(
            &format!("95 % interval holds the {}", key.replace('_', " ")),
            "90 %",
            share(held, of.len()),
        );
    }
    row(
        "seconds of a core: median, longest",
        "",
        format!(
            "{:.0}, {:.0}",
            quantile("seconds", 0.5),
            quantile("seconds", 1.0)
        ),
    );
    for rig in rigs {
        println!(
            "seed {}: overlap {:.0} mV, lost {:.0} %, noise {:.1}: validation {}, {} {}, own {}, usual {}, predicted {} {}",
            rig["seed"],
            1e3 * number(&rig["rig"], "overlap").unwrap_or_default(),
            100.0 * number(&rig["rig"], "null_loss").unwrap_or_default(),
            number(rig, "noise").unwrap_or_default(),
            rig["validation"],
            rig["verdict"],
            rig["causes"],
            rig["own"],
            rig["usual"],
            rig["predicted"],
            rig["complaint"],
        );
    }
}

fn run() -> Result<(), String> {
    let options = Options::read(&[
        "cases",
        "seed",
        "shard",
        "program",
        "limit",
        "controller",
        "record",
        "out",
    ])?;
    // Components are compiled where the sources are.
    let judge = Judge {
        place: std::env::current_dir().map_err(|error| error.to_string())?,
        ..options.judge(300)?
    };
    let (cases, seed) = (options.number("cases", 5)?, options.number("seed", 1)?);
    let is_mine = options.shard()?;
    let scratch = options.scratch();
    let fmu = pack(&scratch)?;
    let journal = scratch.join("judged.jsonl");
    let read = || -> Vec<Value> {
        let text = fs::read_to_string(&journal).unwrap_or_default();
        text.lines()
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect()
    };
    println!("seed {seed}");
    let done = read();
    for number in (seed..seed + cases).filter(|number| is_mine(*number)) {
        if done.iter().any(|rig| rig["seed"] == number) {
            continue;
        }
        let judged = try_rig(&judge, &fmu, number, &options, &scratch)?;
        eprintln!(
            "seed {number}: own {}, usual {}",
            judged["own"], judged["usual"]
        );
        let file = OpenOptions::new().create(true).append(true).open(&journal);
        let mut file = file.map_err(|error| format!("{}: {error}", journal.display()))?;
        writeln!(file, "{judged}").map_err(|error| format!("{}: {error}", journal.display()))?;
    }
    table(&read());
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("error: {reason}");
            ExitCode::from(2)
        }
    }
}
