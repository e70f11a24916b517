//! The frequency responses of `shakebench design`: the content of Fig 3-3, 3-4, 3-7, 3-9 and 3-10, and
//! every loop in continuous time beside the one that is sampled.

use std::path::PathBuf;

use controllers::loop_shaping::LoopShapingCoefficients;
use controllers::loops::Time;
use controllers::synthesis::{self, LoopShapingDesign};
use nalgebra::Complex;
use plant::identified::shake_table::ShakeTable;
use plant::linear::FrequencyResponse;

use super::loops::{LoopName, NamedLoop};
use super::panels::{gain_panel, line, phase_panel, response};
use super::table::table;
use super::{Design, bode};
use crate::error::Error;
use crate::figures::Figure;
use crate::results::{self, Out};
use pages::report::{Report, Section, Style, Table, identity};

/// Writes `report.html` into `folder`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(design: &Design, folder: &Out) -> Result<PathBuf, Error> {
    results::write_report(&report(design), folder)
}

fn report(design: &Design) -> Report {
    let loops = &design.drawn;
    let figures = Table::headed_with_units("Margins", table(&design.loops));
    let mut sections = vec![Section {
        heading: "Loops".into(),
        text: vec![
            "The loops are opened at the valve. Margins are the smallest in magnitude; the \
             crossover is \
             that of the phase margin; the bandwidth is the frequency at which the closed loop \
             has fallen by 3 dB. Sampled loops contain the difference equations of the \
             components, with a zero-order hold before the plant."
                .into(),
        ],
        tables: vec![figures],
        ..Section::default()
    }];
    let pairs = loops.iter().zip(&design.loops);
    sections.extend(pairs.map(|(one, figures)| bode::section(one, figures)));
    if loops.len() == LoopName::ALL.len() {
        sections.push(comparison(loops));
        sections.push(shaping(&design.shaping));
    }
    Report {
        title: "Loops of the shake table".into(),
        summary: summary(design),
        identity: vec![
            identity::entry("Plant", "identified (Eq 2-13, 2-28)"),
            identity::entry("Specimen", design.specimen.name()),
            identity::entry(
                "Loops",
                loops
                    .iter()
                    .map(|one| one.name.name())
                    .collect::<Vec<_>>()
                    .join(", "),
            ),
            identity::entry("Sampled at", "500 Hz"),
            identity::version(),
        ],
        sections,
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

/// How many loops are stable, and which comes nearest to not being.
fn summary(design: &Design) -> String {
    let stable = design.loops.iter().filter(|row| row.sampled.stable);
    let least = stable.clone().filter_map(|row| {
        let margin = row.sampled.phase_margin_deg?;
        Some((margin, row.name.name()))
    });
    let least = least.min_by(|a, b| a.0.total_cmp(&b.0));
    let least = least.map_or(String::new(), |(margin, name)| {
        format!(" The smallest phase margin of these is {margin:.1}°, of {name}.")
    });
    format!(
        "{} of {} loops are stable as sampled at 500 Hz.{least}",
        stable.count(),
        design.loops.len()
    )
}

/// Fig 3-7 and 3-10: what the loops make of their reference.
fn comparison(all: &[NamedLoop]) -> Section {
    let series = |names: &[LoopName], values: fn(&FrequencyResponse) -> Vec<f64>| {
        all.iter()
            .filter(|one| names.contains(&one.name))
            .map(|one| {
                let closed = response(|omega| one.rig_loop.closed(Time::Sampled, omega));
                line(one.name.name(), &closed, values(&closed))
            })
            .collect()
    };
    let tracking = [
        LoopName::DisplacementPid,
        LoopName::LoopShaping,
        LoopName::ThreeVariable,
        LoopName::SlidingMode,
    ];
    Section {
        heading: "Comparison of the closed loops".into(),
        text: vec!["Displacement over its reference, sampled at 500 Hz.".into()],
        panels: vec![
            gain_panel(
                "Three-variable control and PID (Fig 3-7)",
                series(
                    &[LoopName::DisplacementPid, LoopName::ThreeVariable],
                    FrequencyResponse::gain_db,
                ),
            ),
            gain_panel(
                "Loop shaping and PID (Fig 3-10)",
                series(
                    &[LoopName::DisplacementPid, LoopName::LoopShaping],
                    FrequencyResponse::gain_db,
                ),
            ),
            gain_panel("All, gain", series(&tracking, FrequencyResponse::gain_db)),
            phase_panel("All, phase", series(&tracking, bode::closed_phase)),
        ],
        ..Section::default()
    }
}

/// Figures 3-3, 3-4, 3-7, 3-9 and 3-10, of a design with all loops.
pub fn thesis_figures(design: &Design) -> Vec<Figure> {
    let mut figures = Vec::new();
    let pairs = design.drawn.iter().zip(&design.loops);
    for (number, name, text) in [
        (
            "3-3",
            LoopName::DisplacementPid,
            "The displacement PID, Eq 3-6.",
        ),
        (
            "3-4",
            LoopName::ForcePid,
            "The force PID, Eq 3-7, which as sampled at 500 Hz is unstable.",
        ),
    ] {
        let found = pairs.clone().find(|(one, _)| one.name == name);
        figures.extend(found.map(|(one, own)| Figure {
            number,
            text: text.into(),
            panels: bode::section(one, own).panels,
        }));
    }
    let mut closed = comparison(&design.drawn).panels.into_iter();
    for (number, text) in [
        ("3-7", "Closed loops of PID and three-variable control."),
        ("3-10", "Closed loops of PID and loop shaping."),
    ] {
        figures.extend(closed.next().map(|panel| Figure {
            number,
            text: text.into(),
            panels: vec![panel],
        }));
    }
    figures.push(Figure {
        number: "3-9",
        text: "The synthesis of the loop-shaping controller, Eq 3-10.".into(),
        panels: shaping(&design.shaping).panels,
    });
    figures
}

/// Fig 3-9: plant, controller, loop and target.
fn shaping(design: &LoopShapingDesign) -> Section {
    let plant = ShakeTable::default().voltage_to_displacement();
    let printed = synthesis::transfer_function(&LoopShapingCoefficients::equation_3_10());
    let reduced = design.reduced();
    let at = |omega: f64| Complex::new(0.0, omega);
    let gain = |name: &str, value: &dyn Fn(f64) -> Complex<f64>| {
        let response = response(value);
        let gain = response.gain_db();
        line(name, &response, gain)
    };
    let full = |omega: f64| {
        design
            .full(at(omega))
            .unwrap_or(Complex::new(f64::NAN, 0.0))
    };
    Section {
        heading: "Synthesis of the loop-shaping controller".into(),
        text: vec![format!(
            "Target {:.3} rad/s over s (Eq 3-8); gamma_min {:.4}.",
            design.crossover, design.robust.gamma_min
        )],
        panels: vec![
            gain_panel(
                "Loop and target (Fig 3-9)",
                vec![
                    gain("target", &|omega| design.crossover / at(omega)).coloured(0),
                    gain("plant, V to m", &|omega| plant.evaluate(at(omega))),
                    gain("full order", &|omega| {
                        full(omega) * plant.evaluate(at(omega))
                    }),
                    gain("second order", &|omega| {
                        reduced.evaluate(at(omega)) * plant.evaluate(at(omega))
                    })
                    .styled(Style::Dashed),
                ],
            ),
            gain_panel(
                "Controller, V/m",
                vec![
                    gain("Eq 3-10", &|omega| printed.evaluate(at(omega))).coloured(0),
                    gain("full order", &full),
                    gain("second order", &|omega| reduced.evaluate(at(omega)))
                        .styled(Style::Dashed),
                ],
            ),
        ],
        ..Section::default()
    }
}

#[cfg(test)]
pub(super) fn text_of(design: &Design) -> String {
    let numbers = thesis_figures(design);
    let numbers: Vec<&str> = numbers.iter().map(|own| own.number).collect();
    let page = expected::text_of(&report(design), pages::report::UnitSystem::Si);
    format!("figures {}\n{page}\n", numbers.join(", "))
}
