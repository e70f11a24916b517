//! The report of a run: how the table followed its reference.

mod axes;
mod panels;
mod tables;

pub use axes::{AxisRun, run_along};

use super::{Cell, Fact, Panel, Report, Section, Units};
use motion::metrics::Tracking;
use motion::{Motion, peak};

/// What a run gives to its report; histories in SI units, a sample each as in the motion (fewer
/// when the run ended early).
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Name of the system, for example `three-variable`.
    pub system: &'a str,
    /// What was run, in few words.
    pub identity: Vec<(String, Cell)>,
    /// What the table was asked to do, as far as it is known.
    pub motion: &'a Motion,
    /// Its duration, also of what was not played, s.
    pub duration: f64,
    /// Displacement of the table, m.
    pub displacement: &'a [f64],
    /// Velocity of the table, m/s.
    pub velocity: &'a [f64],
    /// Acceleration of the table, m/s^2.
    pub acceleration: &'a [f64],
    /// Commands on their way to the valve by name, V, the last as the valve takes it.
    pub commands: Vec<(String, Vec<f64>)>,
    /// Largest command that the controller gives, V.
    pub valve_limit: Option<f64>,
    /// What stood on the table.
    pub specimen: Option<SpecimenHistory>,
    /// When the run was stopped, s, and why.
    pub trip: Option<(f64, String)>,
    /// Figures of tracking, when they could be computed.
    pub tracking: Option<&'a Tracking>,
    /// How the run ended: `complete`, or why it did not.
    pub ended: &'a str,
    /// Parameters that differ from their component's default.
    pub changed: Vec<Changed>,
    /// The components, and how long their steps took.
    pub components: Vec<Component>,
    /// How it was run (FMI version, algorithm, step, speed...), a row each.
    pub settings: Vec<(String, Cell)>,
    /// Versions, seed, how to repeat: the last line.
    pub footer: String,
}

/// A specimen's motion.
#[derive(Debug, Clone, Default)]
pub struct SpecimenHistory {
    /// Displacement relative to the table, m.
    pub drift: Vec<f64>,
    /// Its force on the table, N.
    pub force: Vec<f64>,
}

/// A parameter that differs from its component's default.
#[derive(Debug, Clone)]
pub struct Changed {
    /// `component.parameter`.
    pub name: String,
    /// Its value.
    pub value: Cell,
    /// The component's default.
    pub default: Cell,
}

/// A component of the run.
#[derive(Debug, Clone)]
pub struct Component {
    /// Name of the instance.
    pub name: String,
    /// Model, FMI version and beginning of the file's SHA-256.
    pub model: String,
    /// Time that its steps took, s, where it was measured.
    pub time: Option<f64>,
}

/// The report of a run.
#[must_use]
pub fn run(run: &Run) -> Report {
    let mut all = sections(run);
    if let Some(specimen) = &run.specimen {
        let place = all.len() - usize::from(!run.commands.is_empty());
        all.insert(
            place,
            section("The specimen", panels::specimen(run, specimen)),
        );
    }
    all.push(Section {
        notes: run.motion.notes.clone(),
        ..section("The motion", Vec::new())
    });
    all.push(what_was_run(run));
    Report {
        title: format!("{} on {}", run.system, run.motion.name),
        summary: sentence(run),
        identity: run.identity.clone(),
        facts: facts(run),
        sections: all,
        footer: run.footer.clone(),
    }
}

fn section(heading: &str, panels: Vec<Panel>) -> Section {
    Section {
        heading: heading.to_string(),
        panels,
        ..Section::default()
    }
}

/// How the table followed, over time and frequency, and what the valve got.
fn sections(run: &Run) -> Vec<Section> {
    let mut sections = vec![
        Section {
            tables: run
                .tracking
                .map(|tracking| tables::tracking(run, tracking))
                .into_iter()
                .collect(),
            ..section("Time histories", panels::histories(run))
        },
        Section {
            text: vec![
                "Response spectra with 5 % of critical damping. The transfer function leads from \
                 the reference to the table's acceleration (averaged spectra); where the coherence \
                 is low, noise or nonlinearity makes the table's motion and the function says \
                 little."
                    .into(),
            ],
            tables: run
                .tracking
                .and_then(|tracking| tracking.laboratory.as_ref())
                .map(|own| vec![tables::bands(own), tables::strong_part(own)])
                .unwrap_or_default(),
            ..section("In frequency", panels::frequency(run))
        },
    ];
    if !run.commands.is_empty() {
        sections.push(section("The valve", vec![panels::valve(run)]));
    }
    sections
}

fn what_was_run(run: &Run) -> Section {
    Section {
        tables: tables::what_was_run(run),
        ..section("The run", Vec::new())
    }
}

fn fact(label: &str, value: Cell, note: &str) -> Fact {
    Fact {
        label: label.to_string(),
        value,
        note: note.to_string(),
    }
}

fn sentence(run: &Run) -> String {
    let figures = match run.tracking {
        Some(tracking) => format!(
            "The table followed the reference with a normalised RMS acceleration error of {:.2} % \
             and a Fourier amplitude error of {:.3} %.",
            tracking.time_domain_percent, tracking.frequency_domain_percent
        ),
        None if run.ended == "complete" => "Tracking could not be measured.".to_string(),
        None => "It has no tracking error.".to_string(),
    };
    match &run.trip {
        _ if run.ended == "complete" => figures,
        Some((time, cause)) => format!("The run was stopped at {time:.3} s: {cause}. {figures}"),
        None => format!("The run ended early: {}. {figures}", run.ended),
    }
}

fn facts(run: &Run) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(tracking) = run.tracking {
        let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
        facts.push(fact(
            "Acceleration error",
            percent(tracking.time_domain_percent),
            "RMS over the peak of the reference",
        ));
        facts.push(fact(
            "Fourier amplitude error",
            percent(tracking.frequency_domain_percent),
            "RMS to 25 Hz over the peak of the reference",
        ));
        facts.push(fact(
            "Delay",
            Cell::Quantity(1e3 * tracking.delay, Units::same("ms"), 3),
            "at which the accelerations agree best over the whole motion",
        ));
    }
    facts.push(fact(
        "Peak displacement",
        Cell::Quantity(peak(run.displacement), Units::DISPLACEMENT, 3),
        "of the table",
    ));
    facts.push(fact(
        "Peak acceleration",
        Cell::Quantity(peak(run.acceleration), Units::ACCELERATION, 3),
        "of the table",
    ));
    facts
}
