//! Rules by name, and from files: TOML, or CSV with the damping in a comment.

use std::path::Path;

use motion::metrics::Measure;
use recordings::{Sheet, Wanted, name_and_unit, read_text};
use serde::Deserialize;
use toml::{Table, Value};

use crate::QualificationError;
use crate::rule::{Interpolation, Point, Rule, Search, unknown_key};

/// Keys of a rule's file; each may be set.
const KEYS: [&str; 23] = [
    "name",
    "source",
    "damping_percent",
    "measure",
    "interpolation",
    "frequency_unit",
    "acceleration_unit",
    "points",
    "band_hz",
    "points_per_octave",
    "grids",
    "lowest_ratio",
    "highest_ratio",
    "single_points_below_1",
    "duration_s",
    "strong_s",
    "axes",
    "correlation",
    "coherence",
    "search_level_g",
    "search_octaves_per_minute",
    "search_band_hz",
    "level",
];

/// What a file of a rule may hold. What is not given is that of AC156, but for spectrum, damping and
/// tolerance.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RuleFile {
    name: Option<String>,
    source: Option<String>,
    damping_percent: Option<f64>,
    measure: Option<Measure>,
    interpolation: Option<Interpolation>,
    frequency_unit: Option<String>,
    acceleration_unit: Option<String>,
    points: Option<Vec<[f64; 2]>>,
    band_hz: Option<[f64; 2]>,
    points_per_octave: Option<usize>,
    grids: Option<usize>,
    lowest_ratio: Option<f64>,
    highest_ratio: Option<f64>,
    single_points_below_1: Option<bool>,
    duration_s: Option<f64>,
    strong_s: Option<f64>,
    axes: Option<usize>,
    correlation: Option<f64>,
    coherence: Option<f64>,
    search_level_g: Option<f64>,
    search_octaves_per_minute: Option<f64>,
    search_band_hz: Option<[f64; 2]>,
    /// Part of the level.
    level: Option<f64>,
}

/// The rule of this name (`ac156`, `ieee693`) or file, with `KEY=VALUE` settings. `ac156` has `s_ds`, `z_h`
/// and `direction`; `ieee693` has `level` (high or moderate) and `damping_percent`.
///
/// # Errors
/// An unknown name or key, a file that cannot be read, and every rule that makes no sense.
pub fn load(name: &str, settings: &[String]) -> Result<Rule, QualificationError> {
    let mut set = Table::new();
    for setting in settings {
        let Some((key, text)) = setting.split_once('=') else {
            return Err(fault(
                name,
                format!("--set {setting}: expected KEY=VALUE, such as s_ds=1.0"),
            ));
        };
        set.insert(key.trim().to_string(), value(text.trim()));
    }
    let rule = match name {
        "ac156" => {
            check_keys(name, &set, &["s_ds", "z_h", "direction"])?;
            let s_ds = number(name, &mut set, "s_ds", 1.0, [0.0, 30.0])?;
            let z_h = number(name, &mut set, "z_h", 0.0, [0.0, 1.0])?;
            if s_ds <= 0.0 {
                return Err(fault(name, format!("s_ds = {s_ds} is not positive")));
            }
            let vertical =
                word(name, &mut set, "direction", ["horizontal", "vertical"])? == "vertical";
            Rule::ac156(s_ds, z_h, vertical)
        }
        "ieee693" => {
            check_keys(name, &set, &["level", "damping_percent"])?;
            let level = word(name, &mut set, "level", ["high", "moderate"])?;
            let damping = number(name, &mut set, "damping_percent", 2.0, [0.1, 49.0])?;
            let part = if level == "high" { 1.0 } else { 0.5 };
            Rule::ieee693(level, part, damping)
        }
        _ if name.ends_with(".toml") || name.ends_with(".csv") => {
            return from_file(Path::new(name), set);
        }
        _ => {
            return Err(fault(
                name,
                format!(
                    "unknown rule{}; expected ac156, ieee693, or a .toml or .csv file",
                    units::hint(name, ["ac156", "ieee693"])
                ),
            ));
        }
    };
    let file = parsed(name, &set.to_string(), name)?;
    apply(rule, file)?.check()
}

fn fault(rule: &str, reason: String) -> QualificationError {
    QualificationError::Rule {
        rule: rule.into(),
        reason,
    }
}

/// A setting as TOML reads it, or else as words.
fn value(text: &str) -> Value {
    let table: Result<Table, _> = format!("v = {text}").parse();
    let known = table.ok().and_then(|mut table| table.remove("v"));
    known.unwrap_or_else(|| Value::String(text.to_string()))
}

fn check_keys(name: &str, set: &Table, own: &[&str]) -> Result<(), QualificationError> {
    let known: Vec<&str> = own.iter().chain(&KEYS).copied().collect();
    match set.keys().find(|key| !known.contains(&key.as_str())) {
        Some(key) => Err(unknown_key(name, key, &known)),
        None => Ok(()),
    }
}

fn number(
    name: &str,
    set: &mut Table,
    key: &str,
    usual: f64,
    [low, high]: [f64; 2],
) -> Result<f64, QualificationError> {
    let Some(value) = set.remove(key) else {
        return Ok(usual);
    };
    let found = match &value {
        Value::Float(own) => Some(*own),
        Value::Integer(own) => Some(*own as f64),
        // A number with its unit, such as `1 g` or `5 %`.
        Value::String(own) if key == "s_ds" => units::value_in(own, "g").ok(),
        _ => None,
    };
    let found = found.filter(|own| (low..=high).contains(own));
    found.ok_or_else(|| {
        fault(
            name,
            format!("{key} = {value}; expected a number from {low} to {high}"),
        )
    })
}

fn word<'a>(
    name: &str,
    set: &mut Table,
    key: &str,
    known: [&'a str; 2],
) -> Result<&'a str, QualificationError> {
    match set.remove(key) {
        None => Ok(known[0]),
        Some(Value::String(text)) if text == known[0] => Ok(known[0]),
        Some(Value::String(text)) if text == known[1] => Ok(known[1]),
        Some(other) => Err(fault(
            name,
            format!("{key} = {other}; expected {} or {}", known[0], known[1]),
        )),
    }
}

fn from_file(path: &Path, set: Table) -> Result<Rule, QualificationError> {
    let name = path.display().to_string();
    check_keys(&name, &set, &[])?;
    let text = read_text(path)?;
    let is_csv = path.extension().is_some_and(|own| own == "csv");
    let mut file = if is_csv {
        from_csv(path, &name)?
    } else {
        parsed(&name, &text.text, &name)?
    };
    let over = parsed("--set", &set.to_string(), &name)?;
    let missing = |key: &str, why: &str| fault(&name, format!("`{key}` is missing; {why}"));
    let Some(damping) = over.damping_percent.or(file.damping_percent) else {
        let how = if is_csv {
            "no damping is stated; expected a comment `# damping_percent = 5`, or --set damping_percent=5"
        } else {
            "no damping is stated; expected `damping_percent = 5`"
        };
        return Err(missing("damping_percent", how));
    };
    let points = file.points.take().ok_or_else(|| {
        missing(
            "points",
            "expected `points = [[1.3, 1.0], [8.3, 1.0], [33.3, 0.4]]`",
        )
    })?;
    let unit = |own: Option<String>, key: &'static str, meant: &'static str| {
        let text = own.ok_or_else(|| {
            missing(
                key,
                &format!("the unit is unstated; expected `{key} = \"{meant}\"`"),
            )
        })?;
        units::factor_meant(&text, meant).map_err(|error| fault(&name, format!("{key}: {error}")))
    };
    let hertz = unit(file.frequency_unit.take(), "frequency_unit", "Hz")?;
    let g = unit(file.acceleration_unit.take(), "acceleration_unit", "g")?;
    let next = over
        .interpolation
        .or(file.interpolation)
        .unwrap_or_default();
    let points: Vec<Point> = points
        .iter()
        .map(|&[frequency, level]| Point {
            frequency: frequency * hertz,
            level: level * g,
            next,
        })
        .collect();
    for (n, point) in points.iter().enumerate() {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !(positive(point.frequency) && positive(point.level)) {
            return Err(fault(
                &name,
                format!(
                    "point {} of the spectrum, {} Hz and {} g: expected positive numbers",
                    n + 1,
                    point.frequency,
                    point.level
                ),
            ));
        }
        if n > 0 && point.frequency <= points[n - 1].frequency {
            return Err(fault(
                &name,
                format!(
                    "point {} of the spectrum: {} Hz does not rise above the {} Hz before it; sort the \
                     points by frequency",
                    n + 1,
                    point.frequency,
                    points[n - 1].frequency
                ),
            ));
        }
    }
    let [Some(first), Some(last)] = [points.first(), points.last()] else {
        return Err(fault(&name, "the spectrum has no points".into()));
    };
    let stem = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned());
    let rule = Rule {
        name: stem.unwrap_or_else(|| name.clone()),
        source: format!("the file {name}"),
        damping: damping / 100.0,
        band_hz: [first.frequency, last.frequency],
        points,
        points_per_octave: 12,
        grids: 1,
        lowest_ratio: 1.0,
        single_points_below_1: false,
        ..Rule::ac156(1.0, 0.0, false)
    };
    let rule = apply(apply(rule, file)?, over)?;
    let mut rule = rule.check().map_err(|error| match error {
        QualificationError::Rule { reason, .. } => fault(&name, reason),
        other => other,
    })?;
    if rule.search.band_hz == Rule::ac156(1.0, 0.0, false).search.band_hz {
        rule.search.band_hz = rule.band_hz;
    }
    Ok(rule)
}

fn parsed(place: &str, text: &str, name: &str) -> Result<RuleFile, QualificationError> {
    toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| {
            let before = text.get(..span.start).unwrap_or_default();
            format!(", line {}", before.matches('\n').count() + 1)
        });
        let at = if place == name && text.contains('\n') {
            line.unwrap_or_default()
        } else {
            String::new()
        };
        fault(&format!("{place}{at}"), error.message().to_string())
    })
}

/// A sheet with frequency and acceleration; comments `key = value` give the rest.
fn from_csv(path: &Path, name: &str) -> Result<RuleFile, QualificationError> {
    const HEADER: &str = "`frequency [Hz],acceleration [g]`";
    let wanted = ["frequency", "acceleration"];
    let is = |cell: &str, what: &str| name_and_unit(cell).0.eq_ignore_ascii_case(what);
    let sheet = Sheet::read(
        path,
        Wanted {
            is_column: &|cell| wanted.iter().any(|what| is(cell, what)),
            header: HEADER,
        },
    )?;
    let mut text = String::new();
    for comment in sheet.comments() {
        let key = comment.split_once('=').map(|(key, _)| key.trim());
        if key.is_some_and(|key| KEYS.contains(&key)) {
            text += comment.trim();
            text += "\n";
        }
    }
    let mut file = parsed(name, &text, name)?;
    let column = |what: &str| {
        let place = sheet.heads().iter().position(|head| is(head, what));
        let place = place.ok_or_else(|| {
            fault(
                &format!("{name}, line {}", sheet.header_line()),
                format!("no column `{what}`; expected {HEADER}"),
            )
        })?;
        let unit = name_and_unit(&sheet.heads()[place]).1.map(str::to_string);
        let unit = unit.or_else(|| sheet.unit_below(place).map(|(_, unit)| unit.to_string()));
        Ok::<_, QualificationError>((sheet.full_column(place, what)?, unit))
    };
    let (frequency, hertz) = column("frequency")?;
    let (level, g) = column("acceleration")?;
    file.points = Some(
        frequency
            .into_iter()
            .zip(level)
            .map(|(f, a)| [f, a])
            .collect(),
    );
    file.frequency_unit = hertz.or(file.frequency_unit);
    file.acceleration_unit = g.or(file.acceleration_unit);
    Ok(file)
}

/// Puts what is given over a rule.
fn apply(rule: Rule, over: RuleFile) -> Result<Rule, QualificationError> {
    if over.points.is_some() || over.frequency_unit.is_some() || over.acceleration_unit.is_some() {
        return Err(fault(
            &rule.name,
            "points and their units come from a file, not from --set".into(),
        ));
    }
    let mut points = rule.points;
    if let Some(next) = over.interpolation {
        points.iter_mut().for_each(|point| point.next = next);
    }
    let own = Rule {
        name: over.name.unwrap_or(rule.name),
        source: over.source.unwrap_or(rule.source),
        damping: over.damping_percent.map_or(rule.damping, |own| own / 100.0),
        measure: over.measure.unwrap_or(rule.measure),
        points,
        band_hz: over.band_hz.unwrap_or(rule.band_hz),
        points_per_octave: over.points_per_octave.unwrap_or(rule.points_per_octave),
        grids: over.grids.unwrap_or(rule.grids),
        lowest_ratio: over.lowest_ratio.unwrap_or(rule.lowest_ratio),
        single_points_below_1: over
            .single_points_below_1
            .unwrap_or(rule.single_points_below_1),
        highest_ratio: over.highest_ratio.unwrap_or(rule.highest_ratio),
        duration_s: over.duration_s.unwrap_or(rule.duration_s),
        strong_s: over.strong_s.unwrap_or(rule.strong_s),
        axes: over.axes.unwrap_or(rule.axes),
        correlation: over.correlation.unwrap_or(rule.correlation),
        coherence: over.coherence.unwrap_or(rule.coherence),
        search: Search {
            level_g: over.search_level_g.unwrap_or(rule.search.level_g),
            octaves_per_minute: over
                .search_octaves_per_minute
                .unwrap_or(rule.search.octaves_per_minute),
            band_hz: over.search_band_hz.unwrap_or(rule.search.band_hz),
        },
    };
    match over.level {
        None => Ok(own),
        Some(level) if level > 0.0 => Ok(own.at_level(level)),
        Some(level) => Err(fault(&own.name, format!("level = {level} is not positive"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(all: &[&str]) -> Vec<String> {
        all.iter().map(|own| (*own).to_string()).collect()
    }

    fn error(name: &str, settings: &[&str]) -> String {
        load(name, &set(settings)).unwrap_err().to_string()
    }

    fn file(ending: &str, text: &str) -> tempfile::TempPath {
        let mut file = tempfile::Builder::new().suffix(ending).tempfile().unwrap();
        std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
        file.into_temp_path()
    }

    #[test]
    fn built_in_rules_take_their_own_values_and_those_of_all() {
        let rule = load(
            "ac156",
            &set(&["s_ds=1.25", "z_h = 1", "duration_s=20", "strong_s=12"]),
        )
        .unwrap();
        assert_eq!((rule.required(5.0), rule.duration_s), (2.0, 20.0));
        let rule = load("ac156", &set(&["s_ds=0.5 g", "direction=vertical"])).unwrap();
        assert!((rule.required(5.0) - 0.335).abs() < 1e-12);
        let rule = load("ieee693", &set(&["level=moderate", "damping_percent=5"])).unwrap();
        assert!((rule.required(40.0) - 0.25).abs() < 1e-12 && rule.damping == 0.05);
        assert!(error("ac156", &["s_sd=1"]).contains("did you mean `s_ds`"));
        assert!(error("ac156", &["s_ds"]).contains("expected KEY=VALUE"));
        assert!(error("ac156", &["s_ds=-1"]).contains("expected a number from 0 to 30"));
        assert!(error("ac157", &[]).contains("did you mean `ac156`"));
        assert!(error("ac156", &["s_ds=30", "level=4"]).contains("no shake table reaches"));
        assert!(error("ieee693", &["level=low"]).contains("expected high or moderate"));
        assert!(error("ac156", &["measure=pseudo_velocity"]).contains("absolute_acceleration"));
    }

    const WHOLE: &str = "damping_percent = 3\nfrequency_unit = \"Hz\"\nacceleration_unit = \"m/s^2\"\n\
        band_hz = [1, 30]\npoints = [[0.5, 2], [2, 9.80665], [10, 9.80665], [30, 4]]\n";

    #[test]
    fn a_file_is_a_rule_and_its_faults_are_named() {
        let whole = file(".toml", WHOLE);
        let path = whole.display().to_string();
        let rule = load(&path, &[]).unwrap();
        assert!((rule.required(5.0) - 1.0).abs() < 1e-12);
        assert_eq!(
            (rule.damping, rule.lowest_ratio, rule.search.band_hz),
            (0.03, 1.0, [1.0, 30.0])
        );
        // Frequencies in another unit; those of the band are in Hz.
        let text = WHOLE.replace("\"Hz\"", "\"kHz\"");
        let (head, _) = text.split_once("points").unwrap();
        let points = "points = [[5e-4, 2], [2e-3, 9.80665], [0.01, 9.80665], [0.03, 4]]\n";
        let other = file(".toml", &format!("{head}{points}"));
        let other = load(&other.display().to_string(), &[]).unwrap();
        for frequency in [1.0, 5.0, 20.0] {
            let (found, wanted) = (other.required(frequency), rule.required(frequency));
            assert!(
                (found / wanted - 1.0).abs() < 1e-12,
                "{frequency} Hz: {found}"
            );
        }
        let halved = load(&path, &set(&["level=0.5", "damping_percent=5"])).unwrap();
        assert!((halved.required(5.0) - 0.5).abs() < 1e-12 && halved.damping == 0.05);
        for (was, now, expected) in [
            ("damping_percent = 3\n", "", "no damping is stated"),
            (
                "frequency_unit = \"Hz\"\n",
                "",
                "the unit is unstated; expected `frequency_unit",
            ),
            ("\"m/s^2\"", "\"mm\"", "acceleration_unit"),
            (
                "[2, 9.8",
                "[0.4, 9.8",
                "0.4 Hz does not rise above the 0.5 Hz",
            ),
            ("[0.5, 2]", "[0.5, -2]", "expected positive numbers"),
            ("band_hz", "band", "line 4"),
            ("[1, 30]", "[1, 300]", "LOW < HIGH <= 100"),
            ("9.80665], [10", "9806.65], [10", "no shake table reaches"),
        ] {
            let broken = file(".toml", &WHOLE.replace(was, now));
            let said = error(&broken.display().to_string(), &[]);
            assert!(said.contains(expected) && said.contains(".toml"), "{said}");
        }
    }

    #[test]
    fn a_sheet_is_a_rule_with_its_damping_in_a_comment() {
        let sheet = "# damping_percent = 5\nfrequency [Hz],acceleration [g]\n1,0.5\n8,1\n33,0.4\n";
        let whole = file(".csv", sheet);
        let rule = load(&whole.display().to_string(), &[]).unwrap();
        assert_eq!(
            (rule.damping, rule.required(8.0), rule.band_hz),
            (0.05, 1.0, [1.0, 33.0])
        );
        let bare = file(".csv", &sheet[sheet.find('f').unwrap()..]);
        let path = bare.display().to_string();
        assert!(error(&path, &[]).contains("--set damping_percent=5"));
        assert!(load(&path, &set(&["damping_percent=2"])).is_ok());
        let unit = file(".csv", &sheet.replace(" [g]", ""));
        assert!(error(&unit.display().to_string(), &[]).contains("the unit is unstated"));
    }
}
