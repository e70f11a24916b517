//! The extended model of a rig, and the simulation of its records by the nominal and the extended
//! model.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;

use identification::diagnosis::rigs::curves::{self, Curves};
use identification::diagnosis::rigs::{
    Description, DescriptionError, ExtendedRig, Measurement, Rig, RigDiagnosis, of_kind,
};

use super::{EXTENDED_MODEL, fault, file_fault};
use crate::error::Error;
use crate::results::Results;
use pages::report::{Abscissa, Axis, Panel, Series, Style, Units};

/// File with measured and simulated output.
const CURVES: &str = "curves.csv";
/// Pictures by themselves, in the order of [`pictures`].
const PICTURES: [&str; 2] = ["error.svg", "close.svg"];
/// Files beside those of every diagnosis.
pub(super) const FILES: [&str; 3] = [CURVES, PICTURES[0], PICTURES[1]];
/// Points of a curve that are drawn.
const DRAWN: usize = 1500;

/// Writes the extended model, the curves and their pictures.
///
/// # Errors
/// Files that cannot be written.
pub(super) fn extend(
    description: &Description,
    measurement: &Measurement,
    found: &RigDiagnosis,
    results: &mut Results,
    folder: &Path,
) -> Result<Vec<Curves>, Error> {
    let failed = |error: DescriptionError| fault(&description.path, error.into());
    let rig = description.rig().map_err(failed)?;
    let curves = curves::curves(description, measurement, found).map_err(failed)?;
    let model = ExtendedRig::new(description, measurement, found)
        .map_err(failed)?
        .to_toml()
        .map_err(|error| file_fault(&folder.join(EXTENDED_MODEL), error))?;
    results.write_text(EXTENDED_MODEL, &model)?;
    results.write(CURVES, |file| {
        curves::write(&curves, rig.inputs()[0], rig.output(), file).map_err(io::Error::other)
    })?;
    for (name, panel) in PICTURES.into_iter().zip(pictures(found, &curves)) {
        results.write_picture(name, &panel)?;
    }
    Ok(curves)
}

/// The curves that lie in `folder`, none where they do not.
///
/// # Errors
/// A file that is none of curves, by line.
pub(super) fn curves_again(folder: &Path) -> Result<Option<Vec<Curves>>, Error> {
    let path = folder.join(CURVES);
    if !path.is_file() {
        return Ok(None);
    }
    let file = File::open(&path).map_err(|error| file_fault(&path, error))?;
    let curves = curves::read(file).map_err(|error| file_fault(&path, error))?;
    Ok(Some(curves))
}

fn units(si: &str) -> Units {
    match si {
        "m" => Units::pair("mm", 1e-3, "mm", 1e-3),
        "N" => Units::pair("kN", 1e3, "kN", 1e3),
        "V" => Units::VOLTAGE,
        "Pa" => Units::pair("MPa", 1e6, "MPa", 1e6),
        _ => Units::NONE,
    }
}

/// Pictures of the first record that contains held-out data: errors over time, and loops or a close
/// look. None where there is no such kind of rig or no curve.
pub(super) fn pictures(found: &RigDiagnosis, curves: &[Curves]) -> Vec<Panel> {
    let shown = curves.iter().find(|one| one.left_out.contains(&true));
    let (Some(rig), Some(shown)) = (of_kind(&found.kind), shown.or(curves.first())) else {
        return Vec::new();
    };
    let close = if rig.is_hysteretic() {
        loops(found, rig, shown)
    } else {
        close_look(found, rig, shown)
    };
    vec![over_time(found, rig, shown), close]
}

fn step(curves: &Curves) -> f64 {
    curves.time.get(1).copied().unwrap_or(1.0)
}

fn thin(values: &[f64]) -> Vec<f64> {
    let every = values.len().div_ceil(DRAWN).max(1);
    values.iter().step_by(every).copied().collect()
}

/// Measured less simulated where the data were left out, a gap elsewhere.
fn errors(curves: &Curves, model: &[f64]) -> Vec<f64> {
    let pairs = curves.measured.iter().zip(model).zip(&curves.left_out);
    pairs
        .map(|((m, y), out)| if *out { m - y } else { f64::NAN })
        .collect()
}

fn over_time(found: &RigDiagnosis, rig: &dyn Rig, curves: &Curves) -> Panel {
    let (output, si) = (rig.output().name(), rig.output().unit());
    let every = curves.time.len().div_ceil(DRAWN).max(1);
    let history = |name: &str, model: &[f64], colour| {
        let errors = thin(&errors(curves, model));
        Series::history(name, step(curves) * every as f64, &errors).coloured(colour)
    };
    Panel {
        title: format!("{}: error of {output} on the held-out data", found.name),
        x: if curves.is_timed {
            Axis::linear("time", Units::TIME)
        } else {
            Axis::linear("sample", Units::NONE)
        },
        y: Axis::linear("measured - simulated", units(si)),
        series: vec![
            history("nominal", &curves.nominal, 2),
            history("extended", &curves.extended, 1),
        ],
    }
}

/// The output as measured and as both models have it, over time.
pub(super) fn overlay(found: &RigDiagnosis, curves: &[Curves]) -> Option<Panel> {
    const MOST: usize = 12_000;
    let shown = curves.iter().find(|one| one.left_out.contains(&true));
    let (rig, shown) = (of_kind(&found.kind)?, shown.or(curves.first())?);
    let line = |name: &str, values: &[f64], colour| {
        let line = Series::history(name, step(shown), values).coloured(colour);
        line.thinned(MOST)
    };
    Some(Panel {
        title: format!(
            "{} of {}, measured and simulated",
            rig.output().name(),
            shown.record
        ),
        x: if shown.is_timed {
            Axis::linear("time", Units::TIME)
        } else {
            Axis::linear("sample", Units::NONE)
        },
        y: Axis::linear(rig.output().name(), units(rig.output().unit())),
        series: vec![
            line("measured", &shown.measured, 0),
            line("nominal", &shown.nominal, 2),
            line("extended", &shown.extended, 1),
        ],
    })
}

fn loops(found: &RigDiagnosis, rig: &dyn Rig, curves: &Curves) -> Panel {
    let (input, output) = (rig.inputs()[0], rig.output());
    let places: Arc<[f64]> = thin(&curves.input).into();
    let path = |name: &str, values: &[f64], colour| {
        Series::line(name, Abscissa::At(places.clone()), thin(values))
            .styled(Style::Path)
            .coloured(colour)
    };
    Panel {
        title: format!("{}, {}", found.name, curves.record),
        x: Axis::linear(input.name(), units(input.unit())),
        y: Axis::linear(output.name(), units(output.unit())),
        series: vec![
            path("measured", &curves.measured, 0),
            path("nominal", &curves.nominal, 2),
            path("extended", &curves.extended, 1),
        ],
    }
}

/// A fortieth of the record, where the nominal model is worst.
fn close_look(found: &RigDiagnosis, rig: &dyn Rig, curves: &Curves) -> Panel {
    let (output, si) = (rig.output().name(), rig.output().unit());
    let samples = curves.measured.len();
    let errors = errors(curves, &curves.nominal);
    let length = (samples / 40).max(64).min(samples);
    let sum = |start: usize| -> f64 {
        let block = &errors[start..start + length];
        block.iter().filter(|e| e.is_finite()).map(|e| e * e).sum()
    };
    let worst = (0..samples / length.max(1))
        .map(|block| block * length)
        .max_by(|&a, &b| sum(a).total_cmp(&sum(b)))
        .unwrap_or(0);
    let line = |name: &str, values: &[f64], colour| {
        let abscissa = Abscissa::Even {
            start: worst as f64 * step(curves),
            step: step(curves),
        };
        Series::line(name, abscissa, values[worst..worst + length].to_vec()).coloured(colour)
    };
    Panel {
        title: format!("{}: {output} where the nominal model is worst", found.name),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear(output, units(si)),
        series: vec![
            line("measured", &curves.measured, 0),
            line("nominal", &curves.nominal, 2),
            line("extended", &curves.extended, 1),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curves() -> Curves {
        let samples = 200;
        let at = |size: f64| -> Vec<f64> {
            (0..samples)
                .map(|n| size * (0.1 * f64::from(n)).sin())
                .collect()
        };
        let mut nominal = at(0.8);
        nominal[150] = 5.0;
        Curves {
            record: "one".into(),
            is_timed: true,
            time: (0..samples).map(|n| 0.01 * f64::from(n)).collect(),
            input: at(2.0),
            measured: at(1.0),
            nominal,
            extended: at(0.99),
            left_out: (0..samples).map(|n| n >= 100).collect(),
        }
    }

    fn drawn(panel: &Panel) -> String {
        expected::plot(panel)
    }

    #[test]
    fn errors_are_those_of_the_held_out_data() {
        let own = curves();
        let errors = errors(&own, &own.nominal);
        assert!(errors[..100].iter().all(|error| error.is_nan()));
        assert_eq!(errors[150], own.measured[150] - 5.0);
        let many: Vec<f64> = (0..4000).map(f64::from).collect();
        let few = thin(&many);
        assert_eq!((few.len(), few[1]), (1334, 3.0));
        assert_eq!((step(&own), thin(&own.input).len()), (0.01, 200));
        assert_eq!(
            ["m", "N", "V", "Pa", "1"].map(|si| units(si).si.to_string()),
            ["mm", "kN", "V", "MPa", ""]
        );
    }

    #[test]
    fn every_kind_of_rig_has_its_pictures() {
        let mut text = String::new();
        let mut shapes = Vec::new();
        for kind in KINDS_DRAWN {
            let rig = of_kind(kind).unwrap();
            let found = crate::made::rig_diagnosis(kind);
            let all = pictures(&found, &[curves()]);
            assert_eq!(all.len(), 2);
            shapes.push(rig.is_hysteretic());
            text += &format!("{kind}\n");
            text += &all.iter().map(drawn).collect::<String>();
            text += &drawn(&overlay(&found, &[curves()]).unwrap());
        }
        assert_eq!(shapes, [true, false]);
        assert!(pictures(&crate::made::rig_diagnosis("none"), &[curves()]).is_empty());
        assert!(overlay(&crate::made::rig_diagnosis(KINDS_DRAWN[0]), &[]).is_none());
        expected::compare(env!("CARGO_MANIFEST_DIR"), "rig-pictures.txt", &text);
    }

    #[test]
    fn curves_of_a_folder_are_read_where_they_are() {
        let folder = tempfile::tempdir().unwrap();
        assert!(curves_again(folder.path()).unwrap().is_none());
        let rig = of_kind(KINDS_DRAWN[1]).unwrap();
        let file = File::create(folder.path().join(CURVES)).unwrap();
        let (before, one) = (curves(), curves().record);
        curves::write(&[curves()], rig.inputs()[0], rig.output(), file).unwrap();
        let found = curves_again(folder.path()).unwrap().unwrap();
        assert_eq!((found.len(), &found[0].record), (1, &one));
        assert_eq!(
            (&found[0].nominal, &found[0].left_out),
            (&before.nominal, &before.left_out)
        );
    }

    /// A hysteretic one and another one.
    const KINDS_DRAWN: [&str; 2] = ["controlled_damper", "linear_axis"];
}
