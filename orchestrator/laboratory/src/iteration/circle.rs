//! From a diagnosis back to the rig: the drive for a motion, computed on the extended model under
//! the law of the case. It is compared with the motion itself and with the drive of the nominal
//! model.

use std::path::{Path, PathBuf};

use identification::diagnosis::case::{Nominal, rig_of};
use identification::identify::model_file::ModelFile;
use plant::identified::rig::IdentifiedRig;
use serde::{Deserialize, Serialize};

use super::drive;
use super::on_model::{ModelledRig, Search};
use crate::error::Error;
use crate::results::{Out, Results};
use motion::metrics::Tracking;
use motion::{self, Motion, Scaling};
use units::INCH;
use units::constants::STROKE;

/// File with the figures.
const FIGURES: &str = "drive.json";
/// The drive.
const DRIVE: &str = "drive.csv";

/// What a drive is looked for.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Folder with `nominal.toml`.
    pub case: PathBuf,
    /// The extended model.
    pub model: PathBuf,
    /// Record to follow.
    pub record: Option<PathBuf>,
    /// Reference to follow.
    pub reference: Option<PathBuf>,
    /// How large.
    pub scaling: Option<Scaling>,
    /// Seed of the built-in motion, where no file is named.
    pub seed: u64,
    /// How to look.
    pub search: Search,
}

/// What the extended model expects of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// RMS error of acceleration, %.
    pub time_domain_percent: f64,
    /// Largest deviation of the response spectrum, 0.5 to 15 Hz, %.
    pub response_spectrum_percent: Option<f64>,
    /// Largest command, V.
    pub peak_command_v: f64,
}

/// A drive with what is expected of it: `drive.json`, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Circle {
    /// The case.
    pub case: String,
    /// The motion.
    pub motion: String,
    /// Effects of the extended model.
    pub effects: Vec<String>,
    /// Of the motion itself as the drive.
    pub motion_itself: Expected,
    /// Of the drive that was computed on the nominal model.
    pub nominal_drive: Expected,
    /// Of the drive that was computed on the extended model.
    pub extended_drive: Expected,
    /// RMS errors on the extended model after each correction that helped, %.
    pub corrections_percent: Vec<f64>,
    /// What to know before it is played.
    pub warnings: Vec<String>,
    /// The drive.
    #[serde(skip)]
    pub drive: Option<Motion>,
    /// That of the nominal model.
    #[serde(skip)]
    pub unaware: Option<Motion>,
    /// The motion that is wanted.
    #[serde(skip)]
    pub wanted: Option<Motion>,
}

impl Circle {
    /// The drives by name, each with what is expected of it.
    #[must_use]
    pub fn expected(&self) -> [(&'static str, Expected); 3] {
        [
            ("the motion itself", self.motion_itself),
            ("computed on the nominal model", self.nominal_drive),
            ("computed on the extended model", self.extended_drive),
        ]
    }
}

/// Looks for the drive.
///
/// # Errors
/// Files at fault; a case without a law; a model that does not follow.
pub fn close(plan: &Plan) -> Result<Circle, Error> {
    let path = plan.case.join("nominal.toml");
    let fault = |reason: String| Error::File {
        path: path.clone(),
        reason,
    };
    let text =
        identification::data::read_written(&path).map_err(|error| fault(error.to_string()))?;
    let nominal = Nominal::parse(&text).map_err(|error| fault(error.to_string()))?;
    let law = nominal
        .controller
        .ok_or_else(|| fault("no [controller]; expected the control law of the rig".to_string()))?;
    let file = ModelFile::read(&plan.model)?;
    let extended = rig_of(&file, &plan.model.display().to_string())?;
    let believed = IdentifiedRig {
        shake_table: nominal.shake_table,
        specimen: nominal.specimen,
        effects: nominal.effects,
        sensors: nominal.sensors,
    };
    let period = 1.0 / nominal.sample_rate;
    let wanted = motion(plan, period)?;
    let modelled = |rig: &IdentifiedRig| {
        ModelledRig::new(rig, &law, period).map_err(|error| Error::File {
            path: plan.model.clone(),
            reason: error.to_string(),
        })
    };
    let rig = modelled(&extended)?;
    let expected = |tracking: Tracking, peak_command_v: f64| Expected {
        time_domain_percent: tracking.time_domain_percent,
        response_spectrum_percent: tracking
            .laboratory
            .map(|figures| figures.largest_spectrum_deviation()),
        peak_command_v,
    };
    let unaware = modelled(&believed)?.drive(&wanted, &plan.search)?;
    let found = rig.drive(&wanted, &plan.search)?;
    let on_model = |drive: &Motion| {
        let (tracking, followed) = rig.tracking(&wanted, drive)?;
        Ok::<_, Error>(expected(tracking, followed.peak_command))
    };
    let extended_drive = expected(found.tracking, found.peak_command);
    let mut warnings = Vec::new();
    let reach = found.drive.peak_displacement();
    if reach > STROKE {
        warnings.push(format!(
            "the drive reaches {:.2} in; the usual stroke is 1.5 in in either direction",
            reach / INCH
        ));
    }
    if extended_drive.peak_command_v >= law.limit {
        warnings.push("the command reaches its limit on the model: reduce the motion".into());
    }
    Ok(Circle {
        case: name_of(&plan.case),
        motion: wanted.name.clone(),
        effects: file.effects.keys().cloned().collect(),
        motion_itself: on_model(&wanted)?,
        nominal_drive: on_model(&unaware.drive)?,
        extended_drive,
        corrections_percent: found.errors,
        warnings,
        drive: Some(found.drive),
        unaware: Some(unaware.drive),
        wanted: Some(wanted),
    })
}

fn motion(plan: &Plan, period: f64) -> Result<Motion, Error> {
    let options = motion::Options {
        sample_time: period,
        scaling: plan.scaling,
        ..motion::Options::default()
    };
    Ok(match (&plan.record, &plan.reference) {
        (Some(path), _) => motion::load(path, &options)?,
        (None, Some(path)) => motion::load_reference(path, &options)?,
        (None, None) => motion::built_in(plan.seed, &options)?,
    })
}

fn name_of(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
    let name = whole.file_name().map(|name| name.to_string_lossy());
    name.map_or("case".into(), |name| name.into_owned())
}

/// Writes `drive.csv` and `drive.json`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(circle: &Circle, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    results.write_text(FIGURES, &(serde_json::json!(circle).to_string() + "\n"))?;
    if let Some(found) = &circle.drive {
        results.write_text(DRIVE, &drive::text(found))?;
    }
    Ok(results.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(name: &str, value: f64) -> Motion {
        Motion {
            name: name.into(),
            dt: 0.5,
            displacement: vec![0.0, value],
            velocity: vec![0.0, 2.0 * value],
            acceleration: vec![0.0, -value],
            notes: Vec::new(),
            seed: None,
            across: None,
        }
    }

    #[test]
    fn a_drive_is_written_with_what_is_expected_of_it() {
        let expected = |percent| Expected {
            time_domain_percent: percent,
            response_spectrum_percent: None,
            peak_command_v: 2.5,
        };
        let circle = Circle {
            case: "case-1".into(),
            motion: "wave".into(),
            effects: vec!["seal_friction".into()],
            motion_itself: expected(9.0),
            nominal_drive: expected(5.0),
            extended_drive: expected(1.0),
            corrections_percent: vec![4.0, 1.0],
            warnings: Vec::new(),
            drive: Some(motion("drive", 0.25)),
            unaware: None,
            wanted: None,
        };
        let percents = circle
            .expected()
            .map(|(name, own)| (name, own.time_domain_percent));
        assert_eq!(
            percents,
            [
                ("the motion itself", 9.0),
                ("computed on the nominal model", 5.0),
                ("computed on the extended model", 1.0),
            ]
        );
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path().join("out"));
        assert_eq!(write(&circle, &out).unwrap().len(), 2);
        let text = std::fs::read_to_string(out.join(DRIVE)).unwrap();
        assert_eq!(
            text,
            "time [s],displacement [m],velocity [m/s],acceleration [m/s^2]\n0,0,0,0\n0.5,0.25,0.5,-0.25\n"
        );
        let text = std::fs::read_to_string(out.join(FIGURES)).unwrap();
        let read: Circle = serde_json::from_str(&text).unwrap();
        assert_eq!(read.expected(), circle.expected());
        assert_eq!(name_of(Path::new("a/b/case-1")), "case-1");
    }

    #[test]
    fn the_motion_is_the_file_that_is_named_or_the_built_in_one() {
        let plan = Plan {
            case: "case".into(),
            model: "model.toml".into(),
            record: None,
            reference: None,
            scaling: None,
            seed: 3,
            search: Search::default(),
        };
        assert_eq!(super::motion(&plan, 0.002).unwrap().seed, Some(3));
        let named = Plan {
            record: Some("/no/such/record.AT2".into()),
            ..plan.clone()
        };
        assert!(
            super::motion(&named, 0.002)
                .unwrap_err()
                .to_string()
                .contains("record.AT2")
        );
        let named = Plan {
            reference: Some("/no/such/reference.csv".into()),
            ..plan.clone()
        };
        assert!(
            super::motion(&named, 0.002)
                .unwrap_err()
                .to_string()
                .contains("reference.csv")
        );
        let told = close(&plan).err().unwrap().to_string();
        assert!(told.contains("nominal.toml"), "{told}");
    }

    #[test]
    fn a_drive_of_another_length_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.csv");
        let options = motion::Options::default();
        let wanted = motion::built_in(1, &options).unwrap();
        std::fs::write(&path, drive::text(&wanted)).unwrap();
        let read = drive::read(&path, &wanted).unwrap();
        assert_eq!(
            (read.len(), read.displacement[777]),
            (wanted.len(), wanted.displacement[777])
        );
        let mut longer = wanted.clone();
        longer.displacement.push(0.0);
        let told = drive::read(&path, &longer).unwrap_err().to_string();
        assert!(
            told.contains(&format!(
                "a drive of {} samples; expected {}",
                wanted.len(),
                longer.len()
            )),
            "{told}"
        );
    }
}
