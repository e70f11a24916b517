//! A description guessed from data files alone: kind, columns, units, roles, and which data are held out.
//!
//! What is guessed is the text of a description, so that a person can read it, change it and hand it back.

mod roles;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use units::vocabulary;

use recordings::{DataError, Sheet, Wanted, mean_and_deviation};

use self::roles::{Recognised, Role, recognised};
use super::description::{Description, DescriptionError, column_map};
use super::{Measurement, Rig, RigRecording, of_kind};

/// A guessed description.
#[derive(Debug, Clone)]
pub struct Guess {
    /// The description.
    pub description: Description,
    /// Its data.
    pub measurement: Measurement,
    /// The text of the description.
    pub text: String,
    /// What was guessed, a sentence each.
    pub sentences: Vec<String>,
}

/// Least sampling rate of a test of motion, Hz: slower ones are times in another unit.
pub const SLOWEST: f64 = 8.0;

/// Sampling rate that is enough for a table's motion, Hz, and the least for records of more samples than these.
const ENOUGH: f64 = 200.0;
const LONG: usize = 20_000;
const ENOUGH_OF_LONG: f64 = 100.0;

/// A kind, what it is, and its channels with the roles of their columns.
type Known = (&'static str, &'static str, &'static [(&'static str, Role)]);

/// The kinds that columns are taken for.
const KINDS: [Known; 4] = [
    (
        "closed_loop_actuator",
        "a table or actuator in a closed displacement loop: command to displacement",
        &[
            ("command", Role::Command),
            ("displacement", Role::Displacement),
        ],
    ),
    (
        "linear_axis",
        "an axis without its controller: voltage to position",
        &[
            ("motor_voltage", Role::Voltage),
            ("position", Role::Displacement),
        ],
    ),
    (
        "cyclic_material",
        "a material under cyclic strain",
        &[("strain", Role::Strain), ("stress", Role::Stress)],
    ),
    (
        "hysteretic_device",
        "a device between displacement and force",
        &[
            ("displacement", Role::Displacement),
            ("velocity", Role::Velocity),
            ("force", Role::Force),
        ],
    ),
];

/// Guesses a description of `files`; `columns` may name some of them by channel. The last of several files is
/// held out, of a single one the second half.
///
/// # Errors
/// A file that cannot be read, columns that are of no kind or of which a unit is not known, by name, with what
/// to do.
pub fn guess(files: &[PathBuf], columns: Option<&Path>) -> Result<Guess, DescriptionError> {
    let first = files
        .first()
        .ok_or_else(|| wrong(Path::new("data"), "no file".into()))?;
    let sheet = read(first, columns)?;
    let found = columns_of(&sheet, columns)?;
    // Columns with a unit come first: a reference without one may be a number for a controller.
    let has = |role: Role, bare: bool| {
        let mut all = found.iter();
        all.any(|own| own.role == role && (bare || own.unit.is_some()))
    };
    let fitting = |bare: bool| {
        let mut kinds = KINDS.iter();
        kinds.find(|(_, _, all)| all.iter().all(|(_, role)| has(*role, bare)))
    };
    let Some((kind, about, channels)) = fitting(false).or_else(|| fitting(true)) else {
        return Err(wrong(first, refusal(&sheet, &found)));
    };
    let mut guessing = Guessing {
        files,
        kind,
        columns: chosen(first, channels, &found, *kind == "closed_loop_actuator")?,
        rate: ENOUGH,
    };
    // Without values of the nominal model, which are read from the data.
    let place = first.with_file_name("the guessed description");
    let bare = Description::parse(&place, &guessing.text(&[]))?;
    let measurement = bare.measurement(&[])?;
    let rig = of_kind(kind).ok_or_else(|| wrong(first, format!("unknown kind {kind}")))?;
    check_rate(first, &measurement)?;
    let nominal = nominal(rig, &measurement);
    guessing.rate = rate_of(&measurement);
    let text = guessing.text(&nominal);
    let description = Description::parse(&place, &text)?;
    let measurement = description.measurement(&[])?;
    let mut sentences = vec![format!("kind {kind}: {about}")];
    for (channel, column, unit) in &guessing.columns {
        sentences.push(format!("column `{column}` is the {channel} in {unit}"));
    }
    for one in &measurement.recordings {
        sentences.push(format!(
            "{}: {} samples at {:.4} Hz",
            one.name(),
            one.len(),
            1.0 / one.period()
        ));
    }
    sentences.push(match files {
        [_] => "the second half of the file is held out of the fit".into(),
        [.., last] => format!(
            "{} is held out of the fit",
            last.file_name().unwrap_or_default().to_string_lossy()
        ),
        [] => String::new(),
    });
    Ok(Guess {
        description,
        measurement,
        text,
        sentences,
    })
}

fn wrong(path: &Path, what: String) -> DescriptionError {
    DescriptionError::Description {
        path: path.to_owned(),
        what,
    }
}

/// The sheet of a file whose header is recognised, or named by the map `columns`.
fn read(file: &Path, columns: Option<&Path>) -> Result<Sheet, DescriptionError> {
    let named = columns.map(column_map).transpose()?.unwrap_or_default();
    let heads: Vec<String> = named.into_values().map(|(head, _)| head).collect();
    let is_column = |cell: &str| {
        recognised(cell, None).is_some()
            || heads.iter().any(|head| recordings::is_called(cell, head))
    };
    Ok(Sheet::read(
        file,
        Wanted {
            is_column: &is_column,
            header: "such as `time [s],command [mm],displacement [mm]` (any units)",
        },
    )?)
}

/// The recognised columns; those that the map names have their channel's role.
fn columns_of(sheet: &Sheet, columns: Option<&Path>) -> Result<Vec<Recognised>, DescriptionError> {
    let named = columns.map(column_map).transpose()?.unwrap_or_default();
    let below = |place: usize| sheet.unit_below(place).map(|(_, unit)| unit);
    let mut found = Vec::new();
    for (channel, (head, unit)) in &named {
        let place = sheet.place(head)?;
        let cell = &sheet.heads()[place];
        // A channel's name says its role as a header does.
        let role = recognised(channel, unit.as_deref()).ok_or_else(|| {
            wrong(
                columns.unwrap_or(sheet.file()),
                format!("`{channel}` is not a channel: expected time, command, displacement, acceleration, force"),
            )
        })?;
        let in_header = recognised(cell, below(place)).and_then(|own| own.unit);
        let in_header = in_header.or_else(|| recordings::name_and_unit(cell).1.map(str::to_owned));
        found.push(Recognised {
            head: cell.clone(),
            unit: unit.clone().or(in_header),
            fit: u8::MAX,
            ..role
        });
    }
    let heads = sheet.heads().iter().enumerate();
    let own = heads.filter_map(|(place, cell)| recognised(cell, below(place)));
    let more: Vec<Recognised> = own
        .filter(|own| found.iter().all(|known| known.head != own.head))
        .collect();
    found.extend(more);
    Ok(found)
}

/// Why the columns are of no kind, and what to do.
fn refusal(sheet: &Sheet, found: &[Recognised]) -> String {
    let recognised: Vec<String> = found
        .iter()
        .map(|own| format!("`{}` ({})", own.head, own.role.words()))
        .collect();
    let recognised = match recognised.as_slice() {
        [] => "no column is recognised".to_owned(),
        some => format!("recognised are {}", some.join(", ")),
    };
    format!(
        "which columns are the command and the displacement? {recognised}, among {}; name them in a file \
         MAP.toml, one per line such as `command = {{ column = \"{}\", unit = \"mm\" }}`, and pass \
         --columns MAP.toml; for another kind of rig, `shakebench diagnose --template KIND` prints a \
         description to fill in",
        sheet.heads().join(", "),
        sheet.heads().get(1).map_or("x", String::as_str)
    )
}

/// Channel, header and unit of every column that is used.
fn chosen(
    file: &Path,
    channels: &[(&'static str, Role)],
    found: &[Recognised],
    with_acceleration: bool,
) -> Result<Vec<(&'static str, String, String)>, DescriptionError> {
    let mut wanted = vec![("time", Role::Time)];
    wanted.extend(channels);
    if with_acceleration {
        wanted.push(("acceleration", Role::Acceleration));
    }
    let mut all = Vec::new();
    for (channel, role) in wanted {
        let best = found
            .iter()
            .filter(|own| own.role == role)
            .map(|own| own.fit)
            .max();
        let own: Vec<&Recognised> = found
            .iter()
            .filter(|own| own.role == role && Some(own.fit) == best)
            .collect();
        // A path of strain has no time.
        let is_path = channels.iter().any(|(_, own)| *own == Role::Strain);
        let is_needed = role != Role::Acceleration && !(is_path && role == Role::Time);
        let one = match own[..] {
            [one] => one,
            [] | [_, _, ..] if !is_needed => continue,
            [] => {
                return Err(wrong(
                    file,
                    format!(
                        "no column of the {}; expected one such as `time [s]`",
                        role.words()
                    ),
                ));
            }
            [first, second, ..] => {
                return Err(wrong(
                    file,
                    format!(
                        "which column is the {}, `{}` or `{}`? Write `{channel} = \"{}\"` in a file MAP.toml \
                         and pass --columns MAP.toml",
                        role.words(),
                        first.head,
                        second.head,
                        first.head
                    ),
                ));
            }
        };
        let unit = match (&one.unit, role) {
            (Some(unit), _) => unit.clone(),
            (None, Role::Time) => "s".into(),
            (None, Role::Strain) => "1".into(),
            (None, _) => {
                return Err(wrong(
                    file,
                    format!(
                        "which unit has column `{}` ({})? Write it into the header, such as `{} [mm]`, or \
                         `{channel} = {{ column = \"{}\", unit = \"mm\" }}` in a file MAP.toml and pass \
                         --columns MAP.toml",
                        one.head,
                        role.words(),
                        one.head,
                        one.head
                    ),
                ));
            }
        };
        all.push((channel, one.head.clone(), unit));
    }
    Ok(all)
}

/// Refuses a rate at which nobody records a motion.
fn check_rate(file: &Path, measurement: &Measurement) -> Result<(), DescriptionError> {
    for one in &measurement.recordings {
        let rate = 1.0 / one.period();
        if rate < SLOWEST {
            return Err(DataError::file(file, slow(rate)).into());
        }
    }
    Ok(())
}

/// The message for a sampling rate below [`SLOWEST`].
pub fn slow(rate: f64) -> String {
    format!(
        "the times give a sampling rate of {rate:.3} Hz, too slow for a motion; if they are milliseconds \
         ({:.0} Hz), write `[ms]` as the unit of the time column",
        1e3 * rate
    )
}

/// What goes into the text.
struct Guessing<'a> {
    files: &'a [PathBuf],
    kind: &'a str,
    columns: Vec<(&'static str, String, String)>,
    /// Rate towards which faster records are reduced, Hz.
    rate: f64,
}

/// A nominal parameter: name, value, one standard deviation, unit.
pub type Start = (&'static str, f64, f64, &'static str);

/// Values of the nominal model of `description`, read from its data.
///
/// # Errors
/// Data that cannot be read.
pub fn begun(description: &Description) -> Result<Vec<Start>, DescriptionError> {
    let measurement = description.measurement(&[])?;
    Ok(nominal(description.rig()?, &measurement))
}

/// The rate towards which records that are reduced to [`ENOUGH`] are to be reduced, Hz: the highest that leaves
/// [`LONG`] samples, since a delay is read less exactly from slower ones.
fn rate_of(measurement: &Measurement) -> f64 {
    let samples: usize = measurement.recordings.iter().map(RigRecording::len).sum();
    let fastest = measurement.recordings.iter();
    let fastest = fastest.min_by(|a, b| a.period().total_cmp(&b.period()));
    match fastest {
        Some(own) if samples > LONG => {
            let share = samples as f64 / LONG as f64;
            let means = (share * own.period() / own.recorded_period).ceil();
            (1.0 / (means * own.recorded_period)).max(ENOUGH_OF_LONG)
        }
        _ => ENOUGH,
    }
}

impl Guessing<'_> {
    fn text(&self, nominal: &[Start]) -> String {
        let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
        let name = self.files.first().and_then(|file| file.file_stem());
        let name = name.unwrap_or_default().to_string_lossy();
        let mut text = String::from(
            "# Guessed from the files. Change what is wrong and run: shakebench diagnose THIS_FILE.toml\n",
        );
        let _ = writeln!(text, "name = {}", quoted(&name));
        let _ = writeln!(text, "kind = {}", quoted(self.kind));
        let files: Vec<String> = self
            .files
            .iter()
            .map(|file| {
                let whole = std::path::absolute(file).unwrap_or_else(|_| file.clone());
                quoted(&whole.to_string_lossy())
            })
            .collect();
        let _ = writeln!(text, "data = [{}]", files.join(", "));
        let _ = writeln!(text, "# Faster records are reduced towards this rate.");
        let _ = writeln!(
            text,
            "reduced_to = {{ value = {:?}, unit = \"1/s\" }}",
            self.rate
        );
        let _ = writeln!(text, "\n[columns]");
        for (channel, column, unit) in &self.columns {
            let (column, unit) = (quoted(column), quoted(unit));
            let _ = writeln!(text, "{channel} = {{ column = {column}, unit = {unit} }}");
        }
        let _ = writeln!(
            text,
            "\n# Value, one standard deviation (without it the value is exact), unit."
        );
        let _ = writeln!(text, "[nominal]");
        for (name, value, deviation, unit) in nominal {
            let _ = writeln!(
                text,
                "{name} = {{ value = {value:?}, plus_minus = {deviation:?}, unit = \"{unit}\" }}"
            );
        }
        let _ = writeln!(text, "\n[left_out]");
        match self.files {
            [_, .., last] => {
                let last = last.file_name().unwrap_or_default().to_string_lossy();
                let _ = writeln!(text, "files = [{}]", quoted(&last));
            }
            _ => text += "second_half = true\n",
        }
        if self.kind == "linear_axis" {
            text += "\n# Model errors accumulate: it begins again from measured positions.\n[windows]\n\
                     length = { value = 2.0, unit = \"s\" }\nknown = { value = 0.1, unit = \"s\" }\n";
        }
        text
    }
}

/// Values of the nominal model from which the fit begins.
fn nominal(rig: &dyn Rig, measurement: &Measurement) -> Vec<Start> {
    let longest = measurement.recordings.iter().max_by_key(|one| one.len());
    let Some(one) = longest else {
        return Vec::new();
    };
    let input = one.input(rig.inputs()[0]);
    match rig.kind() {
        "closed_loop_actuator" => closed_loop(input, one),
        "linear_axis" => axis(input, one),
        "cyclic_material" | "hysteretic_device" => device(rig, input, one),
        _ => Vec::new(),
    }
}

/// One over the angular frequency at which a table's mass swings on the oil: 30 Hz.
const RESONANCE: f64 = 5.3e-3;

/// The lag of the displacement behind the command is that of loop and delay together.
fn closed_loop(command: &[f64], one: &RigRecording) -> Vec<Start> {
    let (output, period) = (one.output(), one.period());
    let lag = lag(command, output, (0.5 / period) as usize) * period;
    let gain = (1.0 / lag.max(2.0 * period)).clamp(2.0, 200.0);
    let (_, size) = mean_and_deviation(output);
    vec![
        ("loop_gain", gain, 0.5 * gain, "1/s"),
        ("loop_lag", 0.1 / gain, 0.1 / gain, "s"),
        ("resonance", RESONANCE, RESONANCE, "s"),
        ("resonance_damping", 0.5, 0.3, "1"),
        ("command_lag", 0.0, 0.0, "s"),
        ("feedforward", 0.1, 0.1, "1"),
        ("integral", 0.1, 0.1, "1/s"),
        ("spring_droop", 0.01, 0.01, "1"),
        // Beyond two of these deviations they are causes.
        ("command_delay", 0.0, 1.5e-3, "s"),
        ("scale", 1.0, 0.01, "1"),
        ("offset", 0.0, 0.01 * size, "m"),
    ]
}

/// Samples by which `output` lags `input`, up to `most`, by the maximum of their correlation.
fn lag(input: &[f64], output: &[f64], most: usize) -> f64 {
    let (mean_in, _) = mean_and_deviation(input);
    let (mean_out, _) = mean_and_deviation(output);
    let at = |shift: usize| -> f64 {
        let pairs = input.iter().zip(output.iter().skip(shift));
        pairs.map(|(u, y)| (u - mean_in) * (y - mean_out)).sum()
    };
    let all: Vec<f64> = (0..most.min(output.len() / 2)).map(at).collect();
    let best = (0..all.len()).max_by(|&a, &b| all[a].total_cmp(&all[b]));
    best.unwrap_or(0) as f64
}

/// Least squares of the acceleration on voltage, speed and its direction; the mass is one, since voltage and
/// position tell forces only against it.
fn axis(voltage: &[f64], one: &RigRecording) -> Vec<Start> {
    let (output, period) = (one.output(), one.period());
    // Differences over 30 ms, of means.
    let reach = ((0.03 / period).round() as usize).max(1);
    let step = reach as f64 * period;
    let mut normal = nalgebra::Matrix4::<f64>::zeros();
    let mut right = nalgebra::Vector4::<f64>::zeros();
    let (mut speeds, mut accelerations) = (Vec::new(), Vec::new());
    for k in reach..output.len().saturating_sub(reach) {
        let speed = (output[k + reach] - output[k - reach]) / (2.0 * step);
        let acceleration =
            (output[k + reach] - 2.0 * output[k] + output[k - reach]) / (step * step);
        let mean = voltage[k - reach..=k + reach].iter().sum::<f64>() / (2 * reach + 1) as f64;
        let row = nalgebra::Vector4::new(mean, -speed, -speed.signum(), 1.0);
        normal += row * row.transpose();
        right += row * acceleration;
        speeds.push(speed);
        accelerations.push(acceleration);
    }
    let (_, speed) = mean_and_deviation(&speeds);
    let (_, acceleration) = mean_and_deviation(&accelerations);
    let (_, volts) = mean_and_deviation(voltage);
    let found = normal.lu().solve(&right).unwrap_or_default();
    let or = |value: f64, other: f64| if value > 0.0 { value } else { other };
    // Where a motor's electric brake is strong, speed follows voltage within a few samples.
    let gain = or(found[0], acceleration / volts.max(1e-12));
    let viscous = or(found[1], gain * volts / speed.max(1e-12));
    let coulomb = or(found[2], 0.1 * gain * volts);
    vec![
        ("mass", 1.0, 0.0, "kg"),
        (vocabulary::FORCE_GAIN, gain, 0.9 * gain, "N/V"),
        ("viscous_friction", viscous, 0.9 * viscous, "N s/m"),
        (vocabulary::COULOMB_FRICTION, coulomb, 0.9 * coulomb, "N"),
        ("offset", 0.0, 0.2 * gain * volts, "N"),
    ]
}

/// The largest force, and the steepest rise from a turn.
fn device(rig: &dyn Rig, input: &[f64], one: &RigRecording) -> Vec<Start> {
    let (_, force) = mean_and_deviation(one.output());
    let (_, travel) = mean_and_deviation(input);
    let stiffness = 5.0 * force / travel.max(1e-12);
    rig.parameters()
        .iter()
        .zip(rig.defaults())
        .filter(|(_, default)| default.is_none())
        .map(|((name, unit), _)| {
            let value = match *unit {
                "N" => force,
                "N/m" => stiffness,
                "Pa" if name.contains("modulus") => stiffness,
                "Pa" => force,
                _ => 1.0,
            };
            (*name, value, 0.9 * value, *unit)
        })
        .collect()
}
