//! A study file, and the runs that it asks for.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::analysis;
use super::design::{Design, Points};
use super::factor::Values;
use super::setting::{self, Key, KeyError, misfit};
use super::table::Table;
use fmi_import::hexadecimal;
use fmi_system::Setting;
use laboratory::error::Error;
use units::hint;

/// The study as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    study: WrittenStudy,
    #[serde(default)]
    fixed: BTreeMap<String, Setting>,
    #[serde(default)]
    factors: BTreeMap<String, toml::Value>,
    #[serde(default)]
    limits: BTreeMap<String, Setting>,
    tune: Option<toml::Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenStudy {
    design: Option<String>,
    runs: Option<u64>,
    #[serde(default = "one")]
    seed: u64,
    #[serde(default)]
    cross: Vec<String>,
    #[serde(default = "usual_intensity")]
    intensity: String,
    #[serde(default)]
    results: Vec<String>,
}

fn one() -> u64 {
    1
}

fn usual_intensity() -> String {
    "pga_g".to_string()
}

/// A factor.
#[derive(Debug, Clone)]
pub struct Factor {
    /// As it is called in the study.
    pub name: String,
    /// What it sets.
    pub key: Key,
    /// What it may be.
    pub values: Values,
}

/// What a run may not exceed.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// The column that is compared: a figure, or `peak.instance.variable`.
    pub column: String,
    /// The signal whose peak that is; none for a figure.
    pub signal: Option<String>,
    /// As written.
    pub written: Setting,
}

/// A study: what is fixed, what varies, and how.
#[derive(Debug, Clone)]
pub struct Study {
    /// Its file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// How the factors' space is filled.
    pub design: Design,
    /// Seed of what is drawn.
    pub seed: u64,
    /// What is the same in all runs.
    pub fixed: Vec<(String, Key, Setting)>,
    /// What varies, by name.
    pub factors: Vec<Factor>,
    /// What a run may not exceed.
    pub limits: Vec<Limit>,
    /// The column against which a share of runs is drawn.
    pub intensity: String,
    /// Figures that are asked for by other programs.
    pub results: Vec<String>,
    /// What is searched, for `shakebench tune`.
    pub tune: Option<toml::Table>,
    /// Places in `factors` of those that are crossed with every point.
    crossed: Vec<usize>,
    /// Places in `factors` of the others, a dimension of the points each.
    sampled: Vec<usize>,
    points: Points,
    /// Checksums of the files that its runs read, by path.
    files: BTreeMap<PathBuf, String>,
    /// For each file that is a value, a checksum of it and of all that it refers to, so that a run's name
    /// says what it plays.
    contents: BTreeMap<PathBuf, String>,
}

impl Study {
    /// Reads a study; paths in it count from its folder. A name without an ending is that of a study that
    /// comes with the program, where there is no such file.
    ///
    /// # Errors
    /// The place and what was expected there.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let built_in = BUILT_IN.iter().find(|(name, _)| Path::new(name) == path);
        if let (Some((_, text)), false) = (built_in, path.exists()) {
            return Self::parse(path, (*text).to_string());
        }
        let text = recordings::read_written(path).map_err(|error| Error::File {
            path: path.to_path_buf(),
            reason: error.to_string(),
        })?;
        Self::parse(path, text)
    }

    /// As [`Study::read`], from a text in place of the file at `path`.
    ///
    /// # Errors
    /// As [`Study::read`].
    pub fn parse(path: &Path, text: String) -> Result<Self, Error> {
        let fault = |reason: String| Error::File {
            path: path.to_path_buf(),
            reason,
        };
        let at = |place: &str, name: &str| {
            let place = format!("[{place}] {name}");
            move |reason: String| fault(format!("{place}: {reason}"))
        };
        let written: Written = toml::from_str(&text)
            .map_err(|error| fault(error.to_string().trim_end().to_string()))?;
        let folder = folder(path);
        let mut fixed = Vec::new();
        for (name, value) in written.fixed {
            let key = Key::of(&name);
            let key = key.map_err(|error| at("fixed", &name)(error.to_string()))?;
            fixed.push((name, key, value));
        }
        let mut factors: Vec<Factor> = Vec::new();
        for (name, value) in written.factors {
            let at = at("factors", &name);
            let read = Values::read(&alone(&name, value, &folder));
            let (mut values, of) = read.map_err(|error| at(error.to_string()))?;
            let key = match of {
                Some(variables) => Key::together(&name, variables),
                None => Key::of(&name),
            };
            let key = key.map_err(|error| at(error.to_string()))?;
            if key == Key::Record {
                values = whole_folders(values, &folder).map_err(|error| at(error.to_string()))?;
            }
            if values.is_relative() && key.variables().is_empty() {
                return Err(at(
                    "`relative` belongs to a variable of an instance".to_string()
                ));
            }
            factors.push(Factor { name, key, values });
        }
        if factors.is_empty() {
            return Err(fault(
                "[factors] is missing: nothing varies; expected for example controller = \
                 [\"three-variable\", \
                 \"mpc\"]"
                    .to_string(),
            ));
        }
        exclusive(&fixed, &factors).map_err(|error| fault(error.to_string()))?;
        let mut crossed = Vec::new();
        for name in &written.study.cross {
            let at = at("study", "cross");
            let place = factors.iter().position(|factor| factor.name == *name);
            let Some(place) = place else {
                let known = factors.iter().map(|factor| factor.name.as_str());
                return Err(at(format!("`{name}` is not a factor{}", hint(name, known))));
            };
            if factors[place].values.count().is_none() {
                return Err(at(format!("`{name}` is not a list")));
            }
            crossed.push(place);
        }
        let all_lists = factors.iter().all(|factor| factor.values.count().is_some());
        let design = match &written.study.design {
            Some(name) => clap::ValueEnum::from_str(name, false).map_err(|_| {
                let known = ["full", "latin-hypercube", "sobol", "random", "saltelli"];
                let hint = hint(name, known);
                let reason = format!(
                    "`{name}` is unknown{hint}; expected one of {}",
                    known.join(", ")
                );
                at("study", "design")(reason)
            })?,
            None if all_lists && written.study.runs.is_none() => Design::Full,
            None => Design::Sobol,
        };
        let sampled: Vec<usize> = (0..factors.len())
            .filter(|place| !crossed.contains(place))
            .collect();
        let counts = sampled
            .iter()
            .map(|&place| factors[place].values.count())
            .collect();
        let points = Points::new(design, counts, written.study.runs, written.study.seed)
            .map_err(|error| at("study", "design")(error.to_string()))?;
        let limits = written.limits.into_iter().map(|(name, written)| {
            let signal = name.contains('.').then(|| name.clone());
            Limit {
                column: signal
                    .as_ref()
                    .map_or(name, |signal| format!("{PEAK}{signal}")),
                signal,
                written,
            }
        });
        let mut study = Self {
            path: path.to_path_buf(),
            text,
            design,
            seed: written.study.seed,
            fixed,
            factors,
            limits: limits.collect(),
            intensity: written.study.intensity,
            results: written.study.results,
            tune: written.tune,
            crossed,
            sampled,
            points,
            files: BTreeMap::new(),
            contents: BTreeMap::new(),
        };
        study.read_files()?;
        Ok(study)
    }

    /// An error of this study.
    pub(crate) fn fault(&self, reason: &str) -> Error {
        Error::File {
            path: self.path.clone(),
            reason: reason.to_string(),
        }
    }

    /// How many runs there are.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.points.count() * self.crossings()
    }

    /// How the rows came about, as the analysis asks.
    pub(super) fn analysed(&self, table: &Table) -> analysis::Design {
        let names = |places: &[usize]| -> Vec<String> {
            let places = places.iter();
            places
                .map(|&place| self.factors[place].name.clone())
                .collect()
        };
        if self.design != Design::Saltelli {
            return analysis::Design::Other;
        }
        let runs = table.texts("run").into_iter().enumerate();
        let rows: HashMap<&str, usize> = runs.map(|(row, name)| (name, row)).collect();
        let row = |number| {
            rows.get(self.name(&self.settings(number)).as_str())
                .copied()
        };
        analysis::Design::Saltelli {
            sampled: names(&self.sampled),
            crossed: names(&self.crossed),
            crossings: self.crossings() as usize,
            rows: (0..self.runs()).map(row).collect(),
        }
    }

    /// What is ranked on points that it shares: the controllers where they are crossed, otherwise the first
    /// crossed factor that chooses a component.
    pub(super) fn ranked(&self) -> Option<analysis::Ranked> {
        let crossed = self.crossed.iter().map(|&place| &self.factors[place]);
        let choosing: Vec<&Factor> = crossed
            .filter(|factor| factor.key.is_structural())
            .collect();
        let controllers = choosing.iter().find(|factor| factor.key == Key::System);
        let ranked = controllers.or(choosing.first())?;
        let others = choosing.iter().filter(|factor| factor.name != ranked.name);
        Some(analysis::Ranked {
            factor: ranked.name.clone(),
            among: others.map(|factor| factor.name.clone()).collect(),
            crossings: self.crossings(),
        })
    }

    /// Runs at each point of the design.
    fn crossings(&self) -> u64 {
        let counts = self
            .crossed
            .iter()
            .map(|&place| self.factors[place].values.count());
        counts.map(|count| count.unwrap_or(1) as u64).product()
    }

    /// What the factors are in a run, in their order.
    #[must_use]
    pub fn settings(&self, number: u64) -> Vec<Setting> {
        let crossings = self.crossings();
        let point = self.points.at(number / crossings);
        let mut at = vec![0.0; self.factors.len()];
        for (&place, coordinate) in self.sampled.iter().zip(point) {
            at[place] = coordinate;
        }
        let mut rest = number % crossings;
        for &place in self.crossed.iter().rev() {
            let count = self.factors[place].values.count().unwrap_or(1) as u64;
            at[place] = ((rest % count) as f64 + 0.5) / count as f64;
            rest /= count;
        }
        self.factors
            .iter()
            .zip(at)
            .map(|(factor, at)| factor.values.value(at))
            .collect()
    }

    /// The name of a run with these factors: what it is, not its position in the study. Files count
    /// by what they hold.
    #[must_use]
    pub fn name(&self, settings: &[Setting]) -> String {
        let folder = folder(&self.path);
        let mut sum = Sha256::new();
        let mut add = |name: &str, key: &Key, value: &Setting, relative: bool| {
            let mut text = value.to_string();
            if let Setting::Text(path) = value
                && key.is_path(path)
                && let Some(sum) = self.contents.get(&folder.join(path))
            {
                text.clone_from(sum);
            }
            let how = if relative { "*=" } else { "=" };
            let name = match key.variables() {
                [] => name.to_string(),
                variables => variables.join(" "),
            };
            sum.update(format!("{name}{how}{text}\n").as_bytes());
        };
        let mut all: Vec<(&str, &Key, &Setting, bool)> = self.all_values(settings).collect();
        all.sort_by_key(|(name, ..)| *name);
        for (name, key, value, relative) in all {
            add(name, key, value, relative);
        }
        for limit in self.limits.iter().filter_map(|limit| limit.signal.as_ref()) {
            // A row without that peak is another.
            sum.update(format!("{PEAK}{limit}\n").as_bytes());
        }
        hexadecimal(&sum.finalize())[..16].to_string()
    }

    /// The files that its runs read, by path, with their checksums.
    #[must_use]
    pub fn files(&self) -> &BTreeMap<PathBuf, String> {
        &self.files
    }

    /// The folder from which its paths count.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        folder(&self.path)
    }

    /// Every key with its value in a run with these factors, and whether that is times the system's own.
    pub(super) fn all_values<'a>(
        &'a self,
        settings: &'a [Setting],
    ) -> impl Iterator<Item = (&'a str, &'a Key, &'a Setting, bool)> {
        let fixed = self.fixed.iter();
        let fixed = fixed.map(|(name, key, value)| (name.as_str(), key, value, false));
        let varied = self.factors.iter().zip(settings);
        fixed.chain(varied.map(|(factor, value)| {
            let is_relative = factor.values.is_relative();
            (factor.name.as_str(), &factor.key, value, is_relative)
        }))
    }

    /// Every key with each of its values in the study.
    pub(super) fn every_value(&self) -> impl Iterator<Item = (&str, &Key, &Setting)> {
        let fixed = self.fixed.iter();
        let fixed = fixed.map(|(name, key, value)| (name.as_str(), key, value));
        let lists = self
            .factors
            .iter()
            .filter_map(|factor| match &factor.values {
                Values::List(list) => Some(
                    list.iter()
                        .map(|value| (factor.name.as_str(), &factor.key, value)),
                ),
                Values::Drawn(_) => None,
            });
        fixed.chain(lists.flatten())
    }

    /// Takes the checksums of all files.
    fn read_files(&mut self) -> Result<(), Error> {
        let folder = self.folder();
        let (mut files, mut contents) = (BTreeMap::new(), BTreeMap::new());
        for (name, key, value) in self.every_value() {
            let mut whole = Sha256::new();
            let own = setting::files(key, value, &folder);
            for path in &own {
                if !files.contains_key(path) {
                    let bytes = recordings::read_bytes(path).map_err(|error| {
                        self.fault(&format!("`{name}`: {}: {error}", path.display()))
                    })?;
                    files.insert(path.clone(), fmi_import::digest(&bytes));
                }
                whole.update(&files[path]);
            }
            if let Some(first) = own.into_iter().next() {
                contents.insert(first, hexadecimal(&whole.finalize()));
            }
        }
        (self.files, self.contents) = (files, contents);
        Ok(())
    }
}

/// The studies that come with the program.
const BUILT_IN: [(&str, &str); 1] = [("rigs", include_str!("../../studies/rigs.toml"))];

/// How the name of a column begins that holds the peak of a signal.
pub(super) const PEAK: &str = "peak.";

fn folder(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    absolute.parent().map(Path::to_path_buf).unwrap_or_default()
}

/// A factor as written; a single folder of records as a list of it.
fn alone(name: &str, value: toml::Value, folder: &Path) -> toml::Value {
    match &value {
        toml::Value::String(path) if name == "record" && folder.join(path).is_dir() => {
            toml::Value::Array(vec![value])
        }
        _ => value,
    }
}

/// Folders in a list of records stand for all records in them.
fn whole_folders(values: Values, folder: &Path) -> Result<Values, KeyError> {
    let Values::List(list) = values else {
        return Err(KeyError::NotFiles);
    };
    let mut all = Vec::new();
    for value in list {
        let Setting::Text(name) = &value else {
            return Err(misfit(&value, "a file"));
        };
        if !folder.join(name).is_dir() {
            all.push(value);
            continue;
        }
        for path in laboratory::comparison::Played::records_in(&folder.join(name))? {
            if let Some(file) = path.file_name() {
                let path = Path::new(name).join(file);
                all.push(Setting::Text(path.display().to_string()));
            }
        }
    }
    Ok(Values::List(all))
}

/// A thing is fixed or varies, and is stated once.
fn exclusive(fixed: &[(String, Key, Setting)], factors: &[Factor]) -> Result<(), KeyError> {
    let mut known: Vec<(&str, &Key)> = Vec::new();
    let all = fixed.iter().map(|(name, key, _)| (name.as_str(), key));
    for (name, key) in all.chain(
        factors
            .iter()
            .map(|factor| (factor.name.as_str(), &factor.key)),
    ) {
        if let Some((other, _)) = known.iter().find(|(_, one)| *one == key) {
            return Err(match *other == name {
                true => KeyError::FixedAndVaries(name.to_string()),
                false => KeyError::Synonyms {
                    first: (*other).to_string(),
                    second: name.to_string(),
                },
            });
        }
        known.push((name, key));
    }
    for group in [
        &[Key::Record, Key::Reference, Key::Seed][..],
        &[Key::Scale, Key::PeakAcceleration, Key::PeakDisplacement],
    ] {
        let given: Vec<&str> = known
            .iter()
            .filter(|(_, key)| group.contains(key))
            .map(|(name, _)| *name)
            .collect();
        if let [one, other, ..] = given[..] {
            return Err(KeyError::Exclusive {
                first: one.to_string(),
                second: other.to_string(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::analysis::Ranked;

    fn parse(text: &str) -> Result<Study, String> {
        Study::parse(Path::new("some.toml"), text.to_string()).map_err(|error| error.to_string())
    }

    #[test]
    fn crossed_factors_vary_fastest_and_the_last_of_them_first() {
        let own = parse(
            "[study]\ncross = [\"controller\", \"seed\"]\nruns = 3\n[fixed]\nplant = \"identified\"\n\
             [factors]\ncontroller = [\"mpc\", \"lqg\"]\nseed = [1, 2, 3]\nscale = { uniform = [0.5, 1.5] }\n",
        )
        .unwrap();
        assert_eq!((own.runs(), own.design), (18, Design::Sobol));
        let texts = |number| -> Vec<String> {
            own.settings(number)
                .iter()
                .map(ToString::to_string)
                .collect()
        };
        let crossed: Vec<String> = (0..6).map(|number| texts(number)[..].join(" ")).collect();
        let scale = &texts(0)[1];
        let expected = ["mpc", "lqg"]
            .map(|controller| [1, 2, 3].map(|seed| format!("{controller} {scale} {seed}")));
        assert_eq!(crossed, expected.concat());
        assert_ne!(&texts(6)[1], scale);
        let ranked = own.ranked().unwrap();
        assert_eq!(
            ranked,
            Ranked {
                factor: "controller".into(),
                among: Vec::new(),
                crossings: 6
            }
        );
        let names: Vec<&str> = own
            .factors
            .iter()
            .map(|factor| factor.name.as_str())
            .collect();
        assert_eq!(names, ["controller", "scale", "seed"]);
        assert_eq!(own.every_value().count(), 1 + 2 + 3);
        assert_eq!(own.all_values(&own.settings(0)).count(), 4);
        assert!(own.files().is_empty());
    }

    #[test]
    fn a_run_is_named_by_what_it_is() {
        let name = |text: &str, number| {
            let own = parse(text).unwrap();
            own.name(&own.settings(number))
        };
        let text = "[study]\n[factors]\nseed = [1, 2]\n\"table.mass\" = [\"5 kg\", \"6 kg\"]\n";
        let first = name(text, 0);
        assert_eq!(first.len(), 16);
        // Whatever else varies, and in which order.
        let other = text.replace("[1, 2]", "[7, 1]").replace("6 kg", "8 kg");
        let same = (0..4).filter(|number| name(&other, *number) == first);
        assert_eq!(same.count(), 1);
        let all: std::collections::HashSet<String> =
            (0..4).map(|number| name(text, number)).collect();
        assert_eq!(all.len(), 4);
        // The peak of a signal is another row; a limit of a figure is not.
        assert_ne!(
            name(&format!("{text}[limits]\n\"table.force\" = \"1 kN\"\n"), 0),
            first
        );
        assert_eq!(name(&format!("{text}[limits]\npga_g = 1\n"), 0), first);
        let relative = "[study]\nruns = 1\n[factors]\n\"table.mass\" = { uniform = [1.0, 2.0], relative = true }\n";
        let plain = relative.replace(", relative = true", "");
        assert_ne!(name(relative, 0), name(&plain, 0));
    }

    #[test]
    fn files_count_by_what_they_hold() {
        let folder = tempfile::tempdir().unwrap();
        let (path, record) = (
            folder.path().join("study.toml"),
            folder.path().join("a.csv"),
        );
        let read = || {
            Study::parse(
                &path,
                "[study]\n[factors]\nreference = [\"a.csv\"]\n".to_string(),
            )
        };
        assert!(read().unwrap_err().to_string().contains("a.csv"));
        std::fs::write(&record, "one").unwrap();
        let own = read().unwrap();
        let before = own.name(&own.settings(0));
        assert_eq!(own.files()[&record], fmi_import::digest(b"one"));
        std::fs::write(&record, "two").unwrap();
        let own = read().unwrap();
        assert_ne!(own.name(&own.settings(0)), before);
        assert_eq!(own.folder(), folder.path());
    }

    #[test]
    fn studies_at_fault_are_refused_by_place() {
        for (text, expected) in [
            ("[study]\n", "[factors] is missing: nothing varies"),
            (
                "[study]\ndesign = \"grid\"\n[factors]\nseed = [1]\n",
                "[study] design: `grid` is unknown",
            ),
            (
                "[study]\ncross = [\"sead\"]\n[factors]\nseed = [1]\n",
                "[study] cross: `sead` is not a factor",
            ),
            (
                "[study]\ncross = [\"scale\"]\n[factors]\nscale = { uniform = [1, 2] }\n",
                "[study] cross: `scale` is not a list",
            ),
            (
                "[study]\n[fixed]\nsead = 1\n[factors]\nseed = [1]\n",
                "[fixed] sead: is an unknown key",
            ),
            (
                "[study]\n[factors]\nseed = 1\n",
                "[factors] seed: 1 is a single value",
            ),
            (
                "[study]\n[factors]\nscale = { uniform = [1, 2], relative = true }\n",
                "[factors] scale: `relative` belongs to a variable of an instance",
            ),
            (
                "[study]\n[fixed]\nseed = 1\n[factors]\nseed = [1]\n",
                "`seed` is fixed and varies",
            ),
            (
                "[study]\n[fixed]\nsystem = \"mpc\"\n[factors]\ncontroller = [\"mpc\"]\n",
                "`system` and `controller` are synonyms",
            ),
            (
                "[study]\n[fixed]\nscale = 1\n[factors]\npga = [1]\n",
                "`scale` and `pga` exclude each other",
            ),
            (
                "[study]\n[factors]\nboth = { list = [1], of = [\"a.x\", \"a\"] }\n",
                "[factors] both: `a` is not a variable",
            ),
            (
                "[study]\n[factors]\nseed = { list = [1], of = [\"a.x\"] }\n",
                "a factor with `of` needs its own name",
            ),
            (
                "[study]\n[factors]\nown = { list = [1], of = [] }\n",
                "`of` is empty",
            ),
        ] {
            let told = parse(text).unwrap_err();
            assert!(told.contains(expected), "{text}: {told}");
        }
    }

    #[test]
    fn variables_that_are_the_same_have_one_factor() {
        let own = parse("[study]\n[factors]\nboth = { list = [1, 2], of = [\"a.x\", \"b.x\"] }\n")
            .unwrap();
        assert_eq!(
            own.factors[0].key,
            Key::Variables(vec!["a.x".into(), "b.x".into()])
        );
        assert_eq!((own.runs(), own.design), (2, Design::Full));
        assert!(own.ranked().is_none());
        let none = Table::default();
        assert!(matches!(own.analysed(&none), analysis::Design::Other));
    }

    #[test]
    fn the_rows_of_a_saltelli_design_are_found_by_their_names() {
        let own = parse(
            "[study]\ndesign = \"saltelli\"\nruns = 2\ncross = [\"controller\"]\n[factors]\n\
             controller = [\"mpc\", \"lqg\"]\nscale = { uniform = [1, 2] }\n\"a.x\" = { uniform = [1, 2] }\n",
        )
        .unwrap();
        let names: Vec<String> = (0..own.runs())
            .map(|number| own.name(&own.settings(number)))
            .collect();
        let column = super::super::table::Column {
            name: "run".into(),
            unit: None,
            role: super::super::table::Role::Run,
            kind: super::super::table::Kind::Text,
        };
        let table = Table {
            columns: vec![column],
            rows: names
                .iter()
                .skip(1)
                .map(|name| vec![name.as_str().into()])
                .collect(),
        };
        let analysis::Design::Saltelli {
            sampled,
            crossed,
            crossings,
            rows,
        } = own.analysed(&table)
        else {
            panic!("another design")
        };
        assert_eq!(
            (sampled, crossed, crossings),
            (
                vec!["a.x".into(), "scale".into()],
                vec!["controller".into()],
                2
            )
        );
        let known = |name: &String| names.iter().skip(1).rposition(|own| own == name);
        let expected: Vec<Option<usize>> = names.iter().map(known).collect();
        assert_eq!(rows, expected);
    }

    #[test]
    fn the_studies_of_the_program_are_read_by_their_names() {
        let own = Study::read(Path::new("rigs")).unwrap();
        assert!(own.runs() > 1);
        assert!(Study::read(Path::new("rig")).is_err());
    }
}
