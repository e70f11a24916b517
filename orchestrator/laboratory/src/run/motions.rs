//! The motion that a request plays, made once for all that play the same.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::request::Request;
use crate::error::Error;
use fmi_system::{Origin, SystemFile};
use motion::{self, Motion, Unscaled};

/// Records that have been made playable but for their scale, for requests that play the same.
#[derive(Debug, Default)]
pub struct Motions(Mutex<HashMap<String, Arc<Unscaled>>>);

impl Motions {
    /// More are not kept.
    const MOST: usize = 256;

    /// What the request plays.
    ///
    /// # Errors
    /// A record, a reference or options at fault.
    pub(super) fn find(&self, request: &Request, file: &SystemFile) -> Result<Motion, Error> {
        let usual = motion::Options::default();
        let options = motion::Options {
            sample_time: file.sampling()?.unwrap_or(usual.sample_time),
            scaling: request.scaling,
            ..usual
        };
        let is_biaxial = is_biaxial(file);
        if !is_biaxial {
            refuse_second(request)?;
        }
        let unscaled = |record: Option<&Path>, seed| self.unscaled(record, seed, &options);
        let (motion, across) = match source(request, file)? {
            Source::Reference(path) => {
                let second = request.reference_y.as_deref();
                let second = second.map(|path| motion::load_reference(path, &options));
                (
                    motion::load_reference(&path, &options)?,
                    second.transpose()?,
                )
            }
            Source::Record(path) => {
                let first = unscaled(Some(&path), request.seed)?;
                if let Some(second) = &request.record_y {
                    let second = unscaled(Some(second), request.seed)?;
                    return Ok(first.pair_scaled(&second, &options)?);
                }
                (first.scaled(&options)?, None)
            }
            Source::Seed => {
                let first = unscaled(None, request.seed)?;
                if is_biaxial {
                    let second = unscaled(None, request.seed.wrapping_add(SECOND_SEED))?;
                    return Ok(first.pair_scaled(&second, &options)?);
                }
                (first.scaled(&options)?, None)
            }
        };
        Ok(match (across, is_biaxial) {
            (Some(across), _) => motion.along_two_axes(across),
            (None, true) => {
                let rest = motion.at_rest();
                motion.along_two_axes(rest)
            }
            (None, false) => motion,
        })
    }

    /// A record, or the built-in motion of a seed, made playable but for its scale.
    fn unscaled(
        &self,
        record: Option<&Path>,
        seed: u64,
        options: &motion::Options,
    ) -> Result<Arc<Unscaled>, Error> {
        let key = format!("{record:?} {seed} {}", options.sample_time);
        let open = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = open().get(&key).cloned();
        if let Some(unscaled) = known {
            return Ok(unscaled);
        }
        let unscaled = Arc::new(match record {
            Some(path) => motion::load_unscaled(path, options)?,
            None => motion::built_in_unscaled(seed, options)?,
        });
        let mut known = open();
        if known.len() >= Self::MOST {
            known.clear();
        }
        known.insert(key, unscaled.clone());
        Ok(unscaled)
    }
}

/// The seed of the built-in motion along a second axis, less that along the first.
const SECOND_SEED: u64 = 100;

/// Whether a system follows a motion along a second axis.
pub(super) fn is_biaxial(file: &SystemFile) -> bool {
    let second = |origin: &Origin| matches!(origin, Origin::Reference { quantity, .. } if quantity.is_second());
    file.connections.iter().any(|link| second(&link.from))
}

/// # Errors
/// A motion along a second axis, which the system has not.
fn refuse_second(request: &Request) -> Result<(), Error> {
    let option = match (&request.record_y, &request.reference_y) {
        (Some(_), _) => "--record-y",
        (None, Some(_)) => "--reference-y",
        (None, None) => return Ok(()),
    };
    Err(Error::Option {
        option,
        reason: format!(
            "{} has a single axis; expected `--plant biaxial`, or a system with connections from \
             `reference.displacement_y`",
            request.system
        ),
    })
}

/// What is played.
enum Source {
    Record(PathBuf),
    Reference(PathBuf),
    /// The built-in motion.
    Seed,
}

/// What a request plays: what it names, or what its system does.
fn source(request: &Request, file: &SystemFile) -> Result<Source, Error> {
    let beside = |path: &String| {
        file.directory
            .as_deref()
            .unwrap_or(Path::new(""))
            .join(path)
    };
    let experiment = &file.experiment;
    let own = request.record.is_none() && request.reference.is_none();
    if own && experiment.record.is_some() && experiment.reference.is_some() {
        let reason = "record and reference are both given; expected one of them".to_string();
        return Err(file.at_fault("experiment", reason).into());
    }
    let record = request.record.clone();
    let record = record.or(experiment.record.as_ref().filter(|_| own).map(beside));
    let reference = request.reference.clone();
    let reference = reference.or(experiment.reference.as_ref().filter(|_| own).map(beside));
    Ok(match (record, reference) {
        (_, Some(path)) => Source::Reference(path),
        (Some(path), None) => Source::Record(path),
        (None, None) => Source::Seed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    fn file(links: &[&str], experiment: &str) -> SystemFile {
        let text =
            format!("name = \"own\"\n[experiment]\n{experiment}\n[components.a]\nfmu = \"A\"\n");
        let mut file = SystemFile::parse("own", &text).unwrap();
        file.connections = made::links(links);
        file.directory = Some("folder".into());
        file
    }

    fn request() -> Request {
        Request {
            seed: 5,
            ..Request::built_in("own.toml")
        }
    }

    fn shown(request: &Request, file: &SystemFile) -> String {
        match source(request, file) {
            Ok(Source::Record(path)) => format!("record {}", path.display()),
            Ok(Source::Reference(path)) => format!("reference {}", path.display()),
            Ok(Source::Seed) => "seed".to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn what_is_asked_for_is_played_before_what_the_system_plays() {
        let record = file(&[], "record = \"a.AT2\"");
        let reference = file(&[], "reference = \"a.csv\"");
        assert_eq!(shown(&request(), &file(&[], "")), "seed");
        assert_eq!(shown(&request(), &record), "record folder/a.AT2");
        assert_eq!(shown(&request(), &reference), "reference folder/a.csv");
        let asked = Request {
            record: Some("b.AT2".into()),
            ..request()
        };
        assert_eq!(shown(&asked, &record), "record b.AT2");
        assert_eq!(shown(&asked, &reference), "record b.AT2");
        let asked = Request {
            reference: Some("b.csv".into()),
            ..request()
        };
        assert_eq!(shown(&asked, &record), "reference b.csv");
        let both = file(&[], "record = \"a.AT2\"\nreference = \"a.csv\"");
        let told = shown(&request(), &both);
        assert!(
            told.contains("record and reference are both given"),
            "{told}"
        );
        assert_eq!(shown(&asked, &both), "reference b.csv");
    }

    #[test]
    fn a_second_axis_rests_or_has_a_motion_of_its_own() {
        let single = file(&["reference.displacement -> a.u"], "");
        let both = file(
            &[
                "reference.displacement -> a.u",
                "reference.displacement_y -> a.v",
            ],
            "",
        );
        assert!(!is_biaxial(&single) && is_biaxial(&both));
        let motions = Motions::default();
        let one = motions.find(&request(), &single).unwrap();
        assert_eq!(
            (one.seed, one.across.is_none(), one.dt),
            (Some(5), true, 0.002)
        );
        let two = motions.find(&request(), &both).unwrap();
        let across = two.across.unwrap();
        assert_eq!((two.seed, across.seed), (Some(5), Some(105)));
        assert_eq!(across.len(), two.displacement.len());
        // A reference alone leaves the second axis at rest.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wave.csv");
        std::fs::write(
            &path,
            crate::iteration::drive_text(&made::wave("wave", 500)),
        )
        .unwrap();
        let asked = Request {
            reference: Some(path.clone()),
            ..request()
        };
        let own = motions.find(&asked, &both).unwrap();
        let across = own.across.unwrap();
        assert!(own.displacement.len() >= 500 && across.displacement.iter().all(|x| *x == 0.0));
        for (asked, option) in [
            (
                Request {
                    record_y: Some("a.AT2".into()),
                    ..request()
                },
                "--record-y",
            ),
            (
                Request {
                    reference_y: Some("a.csv".into()),
                    ..request()
                },
                "--reference-y",
            ),
        ] {
            let told = motions.find(&asked, &single).unwrap_err().to_string();
            assert!(
                told.contains(option) && told.contains("own.toml has a single axis"),
                "{told}"
            );
        }
    }

    #[test]
    fn a_motion_is_made_once_and_scaled_for_each_request() {
        let motions = Motions::default();
        let single = file(&["reference.displacement -> a.u"], "sampling = \"4 ms\"");
        let scaled = |factor| {
            let asked = Request {
                scaling: Some(motion::Scaling::Factor(factor)),
                ..request()
            };
            motions.find(&asked, &single).unwrap()
        };
        let (one, twice) = (scaled(0.1), scaled(0.2));
        assert_eq!(one.dt, 0.004);
        assert!((twice.peak_acceleration() / one.peak_acceleration() - 2.0).abs() < 1e-9);
        assert_eq!(motions.0.lock().unwrap().len(), 1);
    }
}
