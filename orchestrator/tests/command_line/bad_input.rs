//! Input at fault, over all commands: status 2, a message that names the place and what was expected,
//! and nothing written. A row of [`REFUSED`] is a command with the words of its message.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::{shakebench, stderr, stdout};

const SYSTEM: &str = r#"connections = [
  "reference.displacement -> control.reference_displacement",
  "table.displacement -> control.measured_displacement",
  "control.valve_command -> table.valve_command",
]
[components.control]
fmu = "DisplacementPid"
[components.table]
fmu = "ShakeTable"
inputs = { specimen_force = 0 }
[experiment]
duration = "1 s"
"#;

const STUDY: &str = r#"[study]
design = "sobol"
runs = 4
[fixed]
duration = "1 s"
[factors]
"specimen.stiffness" = { uniform = ["80 lbf/in", "120 lbf/in"] }
"#;

/// Rows of `count` values of each column at 2 ms; `cell` gives the value of a sample and column.
fn table(head: &str, count: u32, cell: impl Fn(u32, usize) -> String) -> String {
    let columns = head.split(',').count();
    let mut text = format!("{head}\n");
    for k in 0..count {
        let cells: Vec<String> = (0..columns).map(|column| cell(k, column)).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    text
}

/// A record of a sine, with another cell at sample 500.
fn record(head: &str, scale: f64, other: Option<&str>) -> String {
    table(head, 1000, |k, column| match (column, other) {
        (0, _) => format!("{}", 0.01 * f64::from(k)),
        (_, Some(other)) if k == 500 => other.to_string(),
        _ => format!("{:e}", scale * (0.3 * f64::from(k)).sin()),
    })
}

/// A recording of a rig; `cell` replaces what it does not like.
fn recording(head: &str, count: u32, other: impl Fn(u32, usize) -> Option<String>) -> String {
    table(head, count, |k, column| {
        other(k, column).unwrap_or_else(|| match column {
            0 => format!("{}", 0.002 * f64::from(k)),
            column => format!("{}", (f64::from(k) * 0.01 * column as f64).sin()),
        })
    })
}

const CHANNELS: &str =
    "time [s],valve_command [V],displacement [mm],acceleration [g],actuator_force [N]";

/// The archive `from` as `to`, with other names of its files.
fn repack(from: &Path, to: &Path, name: impl Fn(&str) -> Option<String>) {
    let mut archive = ZipArchive::new(File::open(from).unwrap()).unwrap();
    let mut written = ZipWriter::new(File::create(to).unwrap());
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).unwrap();
        let own = entry.name().unwrap().into_owned();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        if let Some(name) = name(&own).filter(|name| !name.ends_with('/')) {
            let options = SimpleFileOptions::default();
            written.start_file(name, options).unwrap();
            written.write_all(&content).unwrap();
        }
    }
    written.finish().unwrap();
}

/// Files to give to commands.
fn files(folder: &Path) {
    let write = |name: &str, content: &[u8]| fs::write(folder.join(name), content).unwrap();
    for name in ["empty.csv", "empty.toml", "empty.fmu", "empty.ssp", "file"] {
        write(name, b"");
    }
    for name in ["folder", "case", "records"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    let good = record("t_s,a_g", 0.1, None);
    for (name, text) in [
        ("good.csv", good.clone()),
        ("records/a.csv", good.clone()),
        ("nan.csv", record("t_s,a_g", 0.1, Some("nan"))),
        ("inf.csv", record("t_s,a_g", 0.1, Some("inf"))),
        ("text.csv", record("t_s,a_g", 0.1, Some("strong"))),
        ("huge.csv", record("t_s,a_g", 1e308, None)),
        ("zero.csv", record("t_s,a_g", 0.0, None)),
        ("kilo.csv", record("t_s,a_kg", 0.1, None)),
        ("one.csv", "t_s,a_g\n0,0.1\n".to_string()),
        (
            "back.csv",
            "t_s,a_g\n0,0.1\n-0.01,0.2\n-0.02,0.1\n".to_string(),
        ),
        ("ragged.csv", good.replacen("\n1,", "\n1,2,3,", 1)),
        (
            "short.AT2",
            "PEER\nEVENT\nACC\nNPTS= 99, DT= .02 SEC\n 0.1 0.2\n".to_string(),
        ),
        (
            "points.AT2",
            "PEER\nEVENT\nACC\nNPTS= -9, DT= .02 SEC\n 0.1 0.2\n".to_string(),
        ),
        ("rig.toml", SYSTEM.to_string()),
        (
            "quote.toml",
            SYSTEM.replace("\"ShakeTable\"", "\"ShakeTable"),
        ),
        (
            "twice.toml",
            SYSTEM.replace("components.table", "components.control"),
        ),
        ("time.toml", SYSTEM.replace("\"1 s\"", "\"one s\"")),
        ("nan.toml", SYSTEM.replace("\"1 s\"", "nan")),
        ("key.toml", SYSTEM.replace("duration", "durration")),
        (
            "arrow.toml",
            SYSTEM.replace("_command -> table", "_command - table"),
        ),
        (
            "dimension.toml",
            SYSTEM.replace("\"table.displacement ->", "\"control.valve_command ->"),
        ),
        (
            "missing.toml",
            SYSTEM.replace("\"ShakeTable\"", "\"missing.fmu\""),
        ),
        (
            "nested.toml",
            "[components.a]\nsystem = \"nested.toml\"\n".to_string(),
        ),
        ("study.toml", STUDY.to_string()),
        ("negative.toml", STUDY.replace("runs = 4", "runs = -4")),
        ("many.toml", STUDY.replace("runs = 4", "runs = 1e308")),
        ("range.toml", STUDY.replace("120", "12")),
        ("unit.toml", STUDY.replace("120 lbf/in", "120 kg")),
        ("infinite.toml", STUDY.replace("\"120 lbf/in\"", "inf")),
        ("design.toml", STUDY.replace("sobol", "sobl")),
        (
            "alone.toml",
            STUDY.replace("[factors]", "[factors]\nrecord = \"folder\""),
        ),
        ("rows.csv", recording(CHANNELS, 6000, |_, _| None)),
        ("few.csv", recording(CHANNELS, 20, |_, _| None)),
        (
            "gaps.csv",
            recording(CHANNELS, 6000, |k, _| (k > 2).then(|| "nan".to_string())),
        ),
        (
            "units.csv",
            recording(&CHANNELS.replace("mm", "kg"), 600, |_, _| None),
        ),
        (
            "plain.csv",
            recording("time,valve_command,displacement", 600, |_, _| None),
        ),
        (
            "column.csv",
            recording(
                &CHANNELS.replace("acceleration [g]", "displacement [mm]"),
                600,
                |_, _| None,
            ),
        ),
        (
            "milli.csv",
            recording(CHANNELS, 6000, |k, column| {
                (column == 0).then(|| (2 * k).to_string())
            }),
        ),
        ("map.toml", "displacemnt = \"x\"\n".to_string()),
        ("number.toml", "displacement = 5\n".to_string()),
        (
            "nothing.toml",
            "displacement = { column = \"nothing\", unit = \"mm\" }\n".to_string(),
        ),
        (
            "body.toml",
            "[specimen]\nmass = -1\ndamping = nan\nstiffness = 0\n".to_string(),
        ),
        (
            "effect.toml",
            "[mine]\nat = \"input\"\nvalue = \"u *\"\nsentence = \"x\"\n[mine.parameters]\n"
                .to_string(),
        ),
        (
            "points.csv",
            "frequency [Hz],acceleration [g]\n1,-1\n5,2\n".to_string(),
        ),
        ("case/nominal.toml", String::new()),
    ] {
        write(name, text.as_bytes());
    }
    let utf16: Vec<u8> = good.encode_utf16().flat_map(u16::to_le_bytes).collect();
    write("utf16.csv", &utf16);
    write(
        "latin.toml",
        &[SYSTEM.as_bytes(), b"# M\xfcller\n"].concat(),
    );
    write("binary.csv", &[0x93, 0, 1, 0xff].repeat(500));
    write("page.fmu", b"<!doctype html><title>404</title>");
    let sound = pack::all_fmus().unwrap().into_iter();
    let sound = sound.filter(|fmu| fmu.version == pack::FmiVersion::V3);
    let sound = sound.clone().find(|fmu| fmu.name == "ShakeTable").unwrap();
    let bytes = fs::read(&sound.path).unwrap();
    write("cut.fmu", &bytes[..bytes.len() / 2]);
    repack(&sound.path, &folder.join("bare.fmu"), |name| {
        (name != "modelDescription.xml").then(|| name.to_string())
    });
    repack(&sound.path, &folder.join("elsewhere.fmu"), |name| {
        Some(name.replace("x86_64-linux", "riscv64-linux"))
    });
}

/// Commands, `~` for a blank within a word, and words of their messages.
const REFUSED: &[(&str, &[&str])] = &[
    // Motions.
    ("run --record empty.csv", &["empty.csv", "empty"]),
    ("run --record nothing.AT2", &["nothing.AT2", "no such file"]),
    (
        "run --record folder",
        &["folder", "it is a folder; expected a file"],
    ),
    (
        "run --record /dev/zero",
        &["/dev/zero", "it is a device; expected a file"],
    ),
    ("run --record good.csv/x.csv", &["x.csv", "no such file"]),
    (
        "run --record nan.csv",
        &["nan.csv, line 502, column 2 (`a_g`)", "finite number"],
    ),
    (
        "run --record inf.csv",
        &["inf.csv, line 502", "\"inf\"", "finite number"],
    ),
    (
        "run --record text.csv",
        &["line 502", "\"strong\"", "finite number"],
    ),
    (
        "run --record huge.csv",
        &["huge", "expected at most 10000 g"],
    ),
    ("run --record zero.csv", &["zero", "nothing moves"]),
    (
        "run --record kilo.csv",
        &["kilo.csv, line 1", "`acceleration`", "t_s,a_g"],
    ),
    (
        "run --record utf16.csv",
        &["utf16.csv", "binary data, text was expected"],
    ),
    (
        "run --record binary.csv",
        &["binary.csv", "binary data, text was expected"],
    ),
    ("run --record one.csv", &["one.csv", "only one point"]),
    ("run --record back.csv", &["back.csv, line 3", "rising"]),
    (
        "run --record ragged.csv",
        &["ragged.csv, line 102", "4 cells; expected 2"],
    ),
    ("run --record short.AT2", &["short.AT2", "2 of 99 points"]),
    ("run --record points.AT2", &["points.AT2, line 4", "-9"]),
    (
        "run --reference good.csv",
        &["good.csv, line 1", "`displacement`", "expected"],
    ),
    ("run --scale 0", &["positive"]),
    ("run --scale=nan", &["positive"]),
    ("run --pga 0.1~m", &["--pga", "does not fit"]),
    ("run --peak=-1~in", &["--peak", "not positive"]),
    (
        "run --scale 1 --pga 0.1",
        &["--scale", "--pga", "cannot be used with"],
    ),
    ("run --scale 1 --scale 2", &["--scale", "multiple times"]),
    ("run --record good.csv --seed 2", &["--record", "--seed"]),
    // Systems.
    (
        "run empty.toml",
        &["empty.toml", "components: there is none"],
    ),
    ("run folder", &["`folder`", "it is a folder", ".toml"]),
    ("run good.csv", &["`good.csv`", "--record"]),
    ("run zzz", &["`zzz` is unknown", "`three-variable`"]),
    ("run mpc+zzz", &["aid `zzz` is unknown", "`friction`"]),
    ("run quote.toml", &["quote.toml", "line 9"]),
    ("run twice.toml", &["twice.toml", "line 8", "duplicate key"]),
    (
        "run time.toml",
        &["time.toml: experiment.duration", "one s"],
    ),
    (
        "run nan.toml",
        &["nan.toml: experiment.duration", "more than 0 s"],
    ),
    (
        "run key.toml",
        &["key.toml", "line 12", "`durration`", "`duration`"],
    ),
    (
        "run latin.toml",
        &["latin.toml: line 13 is not UTF-8; save the file as UTF-8"],
    ),
    (
        "run arrow.toml",
        &[
            "arrow.toml",
            "line 4",
            "component.output -> component.input",
        ],
    ),
    (
        "run dimension.toml",
        &["dimension.toml", "line 3", "does not fit"],
    ),
    (
        "run missing.toml",
        &["missing.toml: components.table", "missing.fmu"],
    ),
    ("run nested.toml", &["nested.toml", "line 2", "`system`"]),
    (
        "run rig.toml --plant servohydraulic",
        &["--plant: rig.toml", "edit it instead"],
    ),
    (
        "run empty.ssp",
        &["empty.ssp", "not an SSP archive: the file is empty"],
    ),
    // FMUs.
    (
        "run cut.fmu",
        &["cut.fmu", "damaged or cut short", "download it again"],
    ),
    ("run page.fmu", &["page.fmu", "not a zip archive"]),
    ("run bare.fmu", &["bare.fmu", "no modelDescription.xml"]),
    (
        "run elsewhere.fmu",
        &[
            "elsewhere.fmu",
            "no binary for this platform",
            "it has riscv64-linux",
        ],
    ),
    ("run empty.fmu", &["empty.fmu", "the file is empty"]),
    (
        "--fmus file run",
        &["file: no FMUs in this folder", "--fmus"],
    ),
    ("info cut.fmu", &["cut.fmu", "damaged or cut short"]),
    ("info zzz", &["zzz", "expected an .fmu"]),
    ("validate folder", &["folder", "expected an .fmu"]),
    ("validate good.csv", &["good.csv", "expected an .fmu"]),
    // Options of a run.
    (
        "run --duration -1~s",
        &["--duration: `-1 s` is not positive"],
    ),
    (
        "run --duration nan",
        &["--duration: cannot read `nan`", "such as `10 s`"],
    ),
    (
        "run --duration 1e308~s",
        &["--duration", "1e308 s", "limit"],
    ),
    ("run --duration 5~kg", &["--duration", "does not fit"]),
    ("run --step 0~s", &["--step: `0 s` is not positive"]),
    (
        "run --step 1e-300~s",
        &["--step", "shorter than a nanosecond"],
    ),
    (
        "run --seed=-1",
        &["--seed", "expected a whole number from 0"],
    ),
    (
        "run --seed 1.5",
        &["--seed", "expected a whole number from 0"],
    ),
    ("run --fmi 4", &["--fmi", "[possible values: 2, 3]"]),
    (
        "run --plant zzz",
        &["plant `zzz` is unknown", "`servohydraulic`"],
    ),
    (
        "run --specimen zzz",
        &["specimen `zzz` is unknown", "`yielding`"],
    ),
    (
        "run --specimen opensees:",
        &["opensees:", "expected opensees:MODEL.py"],
    ),
    ("run --units imperial", &["--units", "expected us or si"]),
    ("run --set a", &["--set a", "component.variable=VALUE"]),
    (
        "run --set a.b=1",
        &["--set a.b=1", "no component `a`", "`control`"],
    ),
    (
        "run --set table.table_mass=-5~kg",
        &["`table`", "`table_mass` is -5, expected a positive number"],
    ),
    (
        "run --set table.table_mass=5~kg --set table.table_mass=6~kg",
        &[
            "--set",
            "`table.table_mass` is set twice",
            "`5 kg`",
            "`6 kg`",
        ],
    ),
    (
        "run --control-model rig.toml",
        &["rig.toml", "line", "expected [actuator]"],
    ),
    (
        "run --control-model folder",
        &["folder", "it is a folder; expected a file"],
    ),
    (
        "run --trace good.csv",
        &["good.csv", "is not a trace", "--force"],
    ),
    ("run --resume nothing", &["nothing", "holds no checkpoint"]),
    ("run --out file", &["file", "it is a file, not a folder"]),
    (
        "run --out file/below",
        &["file/below", "cannot be written here"],
    ),
    (
        "run rig.toml --tuning tuned",
        &["--tuning", "rig.toml", "its own parameters", "edit it"],
    ),
    // Comparisons, designs, exports.
    (
        "compare --controllers rig.toml --control-model m.toml",
        &["--control-model", "rig.toml", "its own parameters"],
    ),
    (
        "compare folder",
        &["folder", "contains no run", "manifest.json"],
    ),
    ("compare mpc mpc", &["`mpc` is given twice"]),
    (
        "compare mpc --records good.csv records/../good.csv",
        &["--records: records/../good.csv: is given twice"],
    ),
    ("compare --controllers=", &["system `` is unknown"]),
    ("compare --controllers mpc,zzz", &["`zzz` is unknown"]),
    ("compare --records folder", &["folder", "holds no record"]),
    (
        "compare --seed x",
        &["--seed", "expected a whole number from 0"],
    ),
    (
        "design --loop zzz",
        &["--loop", "`zzz` is not a loop", "three-variable"],
    ),
    ("design --crossover=-1", &["--crossover", "-1", "positive"]),
    (
        "design --model empty.toml",
        &["empty.toml", "expected [actuator]"],
    ),
    (
        "design --figures 9-9",
        &["--figures", "`9-9`", "expected some of"],
    ),
    ("export zzz --ssp x.ssp", &["`zzz` is unknown"]),
    (
        "export mpc --ssp good.csv",
        &["--ssp: good.csv", "ends in .ssp"],
    ),
    (
        "export mpc --ssp folder",
        &["--ssp: folder", "ends in .ssp"],
    ),
    ("report folder", &["folder", "contains no results"]),
    ("report file", &["file", "is not a folder"]),
    // Studies.
    (
        "campaign empty.toml",
        &["empty.toml", "missing field `study`"],
    ),
    (
        "campaign folder",
        &["folder: it is a folder; expected a file"],
    ),
    ("campaign rig.toml", &["rig.toml", "line 6", "`components`"]),
    ("campaign negative.toml", &["negative.toml", "line 3", "-4"]),
    (
        "campaign many.toml",
        &["many.toml", "line 3", "(309 digits)"],
    ),
    (
        "campaign range.toml",
        &["[factors] specimen.stiffness", "from 80 to 12 is empty"],
    ),
    (
        "campaign unit.toml",
        &["[factors] specimen.stiffness", "does not fit"],
    ),
    (
        "campaign infinite.toml",
        &["[factors] specimen.stiffness", "`inf` is not a number"],
    ),
    (
        "campaign design.toml",
        &["[study] design", "did you mean `sobol`"],
    ),
    (
        "campaign alone.toml",
        &["[factors] record", "folder: holds no record"],
    ),
    (
        "campaign study.toml --shard 5/4",
        &["--shard", "1 <= I <= N"],
    ),
    ("campaign study.toml --rows 5-2", &["--rows", "A < B"]),
    ("campaign study.toml --jobs 0", &["--jobs", "1..="]),
    (
        "tune study.toml",
        &["study.toml: [tune] is missing", "[tune.parameters]"],
    ),
    // Measured data.
    ("identify empty.csv --out m.toml", &["empty.csv", "empty"]),
    ("identify folder --out m.toml", &["folder", "a folder"]),
    ("identify rows.csv --out m.csv", &["--out", "ends in .toml"]),
    (
        "identify rows.csv --out folder/none/m.toml",
        &["--out", "the folder does not exist"],
    ),
    (
        "identify rows.csv rows.csv --out m.toml",
        &["rows.csv: is given twice"],
    ),
    (
        "identify few.csv --out m.toml",
        &["few.csv: 20 samples are too short", "record at least"],
    ),
    ("identify gaps.csv --out m.toml", &["gaps.csv", "row 4"]),
    (
        "identify units.csv --out m.toml",
        &["units.csv, line 1, column 3", "does not fit"],
    ),
    (
        "identify plain.csv --out m.toml",
        &["plain.csv, line 1", "no unit", "time [s]"],
    ),
    (
        "identify column.csv --out m.toml",
        &["column.csv, line 1", "`displacement` occurs twice"],
    ),
    (
        "identify milli.csv --out m.toml",
        &["milli.csv", "milliseconds", "[ms]"],
    ),
    (
        "identify rows.csv --fit-part nan --out m.toml",
        &["--fit-part", "0.3 to 0.95"],
    ),
    (
        "identify rows.csv --columns map.toml --out m.toml",
        &["map.toml", "did you mean `displacement`"],
    ),
    (
        "identify rows.csv --columns number.toml --out m.toml",
        &["number.toml", "line 1", "{ column = \"header\""],
    ),
    (
        "identify rows.csv --columns nothing.toml --out m.toml",
        &["rows.csv, line 1", "no column `nothing`"],
    ),
    (
        "identify rows.csv --columns folder --out m.toml",
        &["folder", "it is a folder"],
    ),
    (
        "identify rows.csv --specimen body.toml --out m.toml",
        &["body.toml", "mass > 0"],
    ),
    ("diagnose nothing", &["nothing", "nominal.toml"]),
    (
        "diagnose folder",
        &["folder/nominal.toml", "--template table"],
    ),
    ("diagnose case", &["case/nominal.toml", "missing field"]),
    ("diagnose /dev/zero", &["/dev/zero"]),
    (
        "diagnose --model /dev/zero --validate rows.csv",
        &["/dev/zero"],
    ),
    ("diagnose rows.csv --effects effect.toml", &["effect.toml"]),
    ("diagnose empty.csv", &["empty.csv", "empty"]),
    ("diagnose good.csv", &["good.csv", "--columns MAP.toml"]),
    ("diagnose rows.csv rows.csv", &["rows.csv: is given twice"]),
    (
        "diagnose rows.csv --time-limit -1~s",
        &["--time-limit", "more than 0 s"],
    ),
    (
        "diagnose --template zzz",
        &["--template", "`zzz`", "oscillator"],
    ),
    (
        "diagnose --model empty.toml --validate rows.csv",
        &["empty.toml", "missing field"],
    ),
    (
        "diagnose --fmu ShakeTable rows.csv",
        &["--fmu", "--map MAP.toml", "--template map"],
    ),
    (
        "diagnose --fmu ShakeTable --map map.toml rows.csv",
        &["map.toml", "line 1", "`displacemnt`"],
    ),
    // Rigs and rules.
    (
        "commission --level 0 --out out",
        &["--level", "0.02 to 2 g"],
    ),
    (
        "commission --stroke=-1~in --out out",
        &["--stroke", "0.001 to 2 m"],
    ),
    (
        "commission --record nan.csv --out out",
        &["nan.csv, line 502", "finite number"],
    ),
    (
        "commission --plant zzz --out out",
        &["plant `zzz` is unknown"],
    ),
    ("iterate --gain nan", &["--gain", "at most 1"]),
    ("iterate --band 5 1", &["--band", "LOW < HIGH"]),
    ("iterate --replay good.csv", &["good.csv"]),
    ("qualify zzz", &["zzz: unknown rule", "`ac156`"]),
    (
        "qualify ac156 --set s_ds=1e308",
        &["s_ds", "(309 digits)", "from 0 to 30"],
    ),
    ("qualify ac156 --set zz=1", &["unknown key `zz`", "`s_ds`"]),
    (
        "qualify ieee693 --set level=banana",
        &["banana", "high or moderate"],
    ),
    (
        "qualify points.csv --set damping_percent=5",
        &["points.csv"],
    ),
    (
        "qualify ac156 --rounds 0",
        &["--rounds", "whole number from 1"],
    ),
    (
        "trs nothing.csv --rrs ac156",
        &["nothing.csv", "no such file"],
    ),
    ("trs good.csv --rrs folder", &["folder", "expected ac156"]),
    (
        "serve mpc --openfresco localhost:99999 --units m,N",
        &["--openfresco", "127.0.0.1:8090"],
    ),
    (
        "serve mpc --openfresco localhost:8090 --units kg,s",
        &["--units", "length"],
    ),
    (
        "serve mpc --openfresco --units m,N --time-scale nan",
        &["--time-scale", "above 0"],
    ),
    ("build --fmi 4", &["--fmi", "[possible values: 2, 3, all]"]),
    ("completions tcsh", &["tcsh", "bash"]),
    ("zzz", &["unrecognized subcommand 'zzz'"]),
];

/// Names and contents of everything below.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            all.extend(contents(&path));
        }
        let content = fs::read(&path).unwrap_or_default();
        all.insert(path.display().to_string(), content);
    }
    all
}

#[test]
fn input_at_fault_is_refused_by_every_command_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    files(folder);
    let before = contents(folder);
    let mut faults = Vec::new();
    for (command, words) in REFUSED {
        let arguments: Vec<String> = command
            .split(' ')
            .map(|word| word.replace('~', " "))
            .collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let output = shakebench(folder, &arguments);
        let said = stderr(&output);
        let mut wrong = Vec::new();
        if output.status.code() != Some(2) {
            wrong.push(format!("status {:?}", output.status.code()));
        }
        if !said.contains("error: ") || said.contains("panicked") {
            wrong.push("not a message of ours".to_string());
        }
        if !stdout(&output).is_empty() {
            wrong.push("printed results".to_string());
        }
        let missing = words.iter().filter(|word| !said.contains(**word));
        wrong.extend(missing.map(|word| format!("without `{word}`")));
        if contents(folder) != before {
            wrong.push("changed files".to_string());
        }
        if !wrong.is_empty() {
            faults.push(format!(
                "{command}\n  {}\n  {}",
                wrong.join(", "),
                said.trim()
            ));
        }
    }
    println!("{} commands", REFUSED.len());
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn files_in_utf_16_and_with_other_line_ends_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let wide = |text: &str| -> Vec<u8> {
        let units = text.encode_utf16().flat_map(u16::to_le_bytes);
        [0xff, 0xfe].into_iter().chain(units).collect()
    };
    let good = record("t_s,a_g", 0.1, None);
    fs::write(folder.join("wide.toml"), wide(SYSTEM)).unwrap();
    fs::write(folder.join("wide.csv"), wide(&good)).unwrap();
    fs::write(folder.join("ends.toml"), SYSTEM.replace('\n', "\r\n")).unwrap();
    fs::write(folder.join("ends.csv"), good.replace('\n', "\r\n")).unwrap();
    for name in ["wide", "ends"] {
        let [system, record] = ["toml", "csv"].map(|ending| format!("{name}.{ending}"));
        let arguments = ["run", &system, "--record", &record, "--out", name];
        let output = shakebench(folder, &arguments);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
    }
    let [wide, ends] = ["wide", "ends"].map(|name| fs::read(folder.join(name).join("results.csv")));
    assert_eq!(wide.unwrap(), ends.unwrap());
}

#[test]
fn a_folder_of_records_is_a_factor() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    files(folder);
    let good = fs::read(folder.join("good.csv")).unwrap();
    fs::write(folder.join("records/b.csv"), good).unwrap();
    for written in ["\"records\"", "[\"records\"]"] {
        let study = format!("[study]\ndesign = \"full\"\n[factors]\nrecord = {written}\n");
        fs::write(folder.join("folder.toml"), study).unwrap();
        let output = shakebench(folder, &["campaign", "folder.toml", "--plan", "--json"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(0), "{written}: {said}");
        let plan: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!(plan["runs"], 2, "{written}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_fault() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["--help"][..],
        &["info", "mpc"],
        &["completions", "zsh"],
        &["diagnose", "--template", "table"],
        &["run", "--duration", "1 s", "--out", "out"],
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_shakebench"))
            .args(arguments)
            .current_dir(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(stderr(&output), "", "{arguments:?}");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
    }
}
