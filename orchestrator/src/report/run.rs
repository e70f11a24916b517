//! The report of a run: how the table followed its reference.

use super::{Axis, Cell, Fact, Panel, Report, Section, Series, Table, Units};
use crate::metrics::laboratory::Laboratory;
use crate::metrics::{HIGHEST_FREQUENCY, Tracking, fourier_amplitudes};
use crate::motion::Motion;

/// Size of a whole motion, also of one that was not played to its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whole {
    /// Time from the first to the last sample, s.
    pub duration: f64,
    /// Largest displacement, m.
    pub peak_displacement: f64,
    /// Largest acceleration, m/s^2.
    pub peak_acceleration: f64,
}

impl From<&Motion> for Whole {
    fn from(motion: &Motion) -> Self {
        Self {
            duration: motion.duration(),
            peak_displacement: motion.peak_displacement(),
            peak_acceleration: motion.peak_acceleration(),
        }
    }
}

/// What a run gives to its report; histories in SI units, a sample each as in the motion (fewer
/// when the run ended early).
#[derive(Debug, Clone)]
pub struct Run<'a> {
    /// Name of the system, for example `three-variable`.
    pub system: &'a str,
    /// What the table was asked to do, as far as it is known.
    pub motion: &'a Motion,
    /// Its size as a whole.
    pub whole: Whole,
    /// Displacement of the table, m.
    pub displacement: &'a [f64],
    /// Velocity of the table, m/s.
    pub velocity: &'a [f64],
    /// Acceleration of the table, m/s^2.
    pub acceleration: &'a [f64],
    /// Command of the valve, V.
    pub valve_command: Option<&'a [f64]>,
    /// Figures of tracking, when they could be computed.
    pub tracking: Option<&'a Tracking>,
    /// How the run ended: `complete`, or why it did not.
    pub ended: &'a str,
    /// How it was run (FMI version, algorithm, step, speed...), a row each.
    pub settings: Vec<(String, Cell)>,
    /// Versions, seed, how to repeat: the last line.
    pub footer: String,
}

/// The report of a run.
#[must_use]
pub fn run(run: &Run) -> Report {
    let motion = run.motion;
    let complete = run.ended == "complete";
    let mut summary = match run.tracking {
        Some(tracking) => format!(
            "The table followed the reference acceleration with an error of {:.2} % in time and \
             {:.3} % in Fourier amplitude.",
            tracking.time_domain_percent, tracking.frequency_domain_percent
        ),
        None => "Tracking could not be measured.".to_string(),
    };
    if !complete {
        summary = format!("The run ended early: {}. {summary}", run.ended);
    }
    Report {
        title: format!("{} on {}", run.system, motion.name),
        summary,
        facts: facts(run),
        sections: vec![
            Section {
                heading: "Tracking".to_string(),
                tables: run
                    .tracking
                    .map(|tracking| tracking_table(run.whole, tracking))
                    .into_iter()
                    .collect(),
                ..Section::default()
            },
            Section {
                heading: "As laboratories measure".to_string(),
                tables: run
                    .tracking
                    .and_then(|tracking| tracking.laboratory.as_ref())
                    .map(|own| vec![band_table(own), strong_table(own)])
                    .unwrap_or_default(),
                ..Section::default()
            },
            Section {
                heading: "Time histories".to_string(),
                panels: time_panels(run),
                ..Section::default()
            },
            Section {
                heading: "Fourier amplitudes".to_string(),
                panels: vec![fourier_panel(run)],
                ..Section::default()
            },
            Section {
                heading: "The motion".to_string(),
                notes: motion.notes.clone(),
                ..Section::default()
            },
            settings(run),
        ],
        footer: run.footer.clone(),
    }
}

fn fact(label: &str, value: Cell, note: &str) -> Fact {
    Fact {
        label: label.to_string(),
        value,
        note: note.to_string(),
    }
}

fn facts(run: &Run) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(tracking) = run.tracking {
        let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
        facts.push(fact(
            "Error in time",
            percent(tracking.time_domain_percent),
            "rms of acceleration error over the peak",
        ));
        facts.push(fact(
            "Error in frequency",
            percent(tracking.frequency_domain_percent),
            "rms of Fourier amplitudes to 25 Hz over the peak",
        ));
        facts.push(fact(
            "Delay",
            Cell::Quantity(1e3 * tracking.delay, Units::same("ms"), 3),
            "of the table behind its reference",
        ));
    }
    facts.push(fact(
        "Peak displacement",
        Cell::Quantity(run.whole.peak_displacement, Units::DISPLACEMENT, 3),
        "of the reference",
    ));
    facts.push(fact(
        "Peak acceleration",
        Cell::Quantity(run.whole.peak_acceleration, Units::ACCELERATION, 3),
        "of the reference",
    ));
    facts
}

fn tracking_table(whole: Whole, tracking: &Tracking) -> Table {
    let length = |value| Cell::Quantity(value, Units::DISPLACEMENT, 4);
    let acceleration = |value| Cell::Quantity(value, Units::ACCELERATION, 4);
    let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
    let none = || Cell::Text(String::new());
    Table {
        caption: "Errors in percent are relative to the peak of the reference.".to_string(),
        columns: ["", "reference", "table", "largest error", "rms error"]
            .map(str::to_string)
            .to_vec(),
        rows: vec![
            vec![
                "displacement, peak".into(),
                length(whole.peak_displacement),
                length(tracking.peak_displacement),
                length(tracking.peak_displacement_error),
                percent(tracking.displacement_percent),
            ],
            vec![
                "acceleration, peak".into(),
                acceleration(whole.peak_acceleration),
                acceleration(tracking.peak_acceleration),
                acceleration(tracking.peak_acceleration_error),
                percent(tracking.time_domain_percent),
            ],
            vec![
                "acceleration, Fourier amplitudes to 25 Hz".into(),
                none(),
                none(),
                none(),
                percent(tracking.frequency_domain_percent),
            ],
            vec![
                "acceleration, correlation".into(),
                none(),
                Cell::Number(tracking.correlation, 5),
                none(),
                none(),
            ],
        ],
    }
}

/// Response spectra and transfer function, a row for each band.
fn band_table(own: &Laboratory) -> Table {
    let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
    let rows = own.response_spectrum_percent.iter().enumerate();
    Table {
        caption: "Response spectrum at 5 % damping: how far the table's is from the reference's. \
                  Transfer function from the reference's to the table's acceleration, each frequency \
                  weighted by the reference's power."
            .to_string(),
        columns: [
            "band, Hz",
            "spectrum, largest",
            "spectrum, mean",
            "gain",
            "delay, ms",
            "coherence",
        ]
        .map(str::to_string)
        .to_vec(),
        rows: rows
            .map(|(n, spectrum)| {
                let [from, to] = spectrum.band_hz;
                let band = own.coherence.as_ref().map(|bands| &bands[n]);
                let number = |value: Option<f64>, digits| {
                    value.map_or("-".into(), |value| Cell::Number(value, digits))
                };
                vec![
                    format!("{from} to {to}").into(),
                    percent(spectrum.largest),
                    percent(spectrum.mean),
                    number(band.map(|band| band.gain), 4),
                    number(band.map(|band| 1e3 * band.delay_s), 3),
                    number(band.map(|band| band.coherence), 4),
                ]
            })
            .collect(),
    }
}

/// The strong part of the motion and its energy.
fn strong_table(own: &Laboratory) -> Table {
    Table {
        caption: "Significant duration: from 5 to 95 % of the reference's Arias intensity.".into(),
        columns: ["", "value"].map(str::to_string).to_vec(),
        rows: vec![
            vec![
                "significant duration".into(),
                Cell::Quantity(own.significant_duration_s, Units::TIME, 3),
            ],
            vec![
                "error in time over it".into(),
                Cell::Quantity(own.significant_duration_percent, Units::PERCENT, 3),
            ],
            vec!["peak ratio".into(), Cell::Number(own.peak_ratio, 4)],
            vec!["Arias ratio".into(), Cell::Number(own.arias_ratio, 4)],
        ],
    }
}

fn time_panel(title: &str, label: &str, units: Units, series: Vec<Series>) -> Panel {
    Panel {
        title: title.to_string(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear(label, units),
        series,
    }
}

fn time_panels(run: &Run) -> Vec<Panel> {
    let (motion, dt) = (run.motion, run.motion.dt);
    let both = |wanted: &[f64], found: &[f64]| {
        vec![
            Series::history("reference", dt, wanted).coloured(0),
            Series::history("table", dt, found).coloured(1),
        ]
    };
    let error: Vec<f64> = motion
        .acceleration
        .iter()
        .zip(run.acceleration)
        .map(|(r, a)| r - a)
        .collect();
    let mut panels = vec![
        time_panel(
            "Acceleration",
            "acceleration",
            Units::ACCELERATION,
            both(&motion.acceleration, run.acceleration),
        ),
        time_panel(
            "Acceleration error (reference minus table)",
            "error",
            Units::ACCELERATION,
            vec![Series::history("error", dt, &error).coloured(2)],
        ),
        time_panel(
            "Velocity",
            "velocity",
            Units::VELOCITY,
            both(&motion.velocity, run.velocity),
        ),
        time_panel(
            "Displacement",
            "displacement",
            Units::DISPLACEMENT,
            both(&motion.displacement, run.displacement),
        ),
    ];
    if let Some(command) = run.valve_command {
        let series = vec![Series::history("valve command", dt, command).coloured(3)];
        panels.push(time_panel(
            "Valve command",
            "command",
            Units::VOLTAGE,
            series,
        ));
    }
    panels
}

fn fourier_panel(run: &Run) -> Panel {
    let amplitudes = |name: &str, history: &[f64], colour| {
        let (frequencies, values) = fourier_amplitudes(history, run.motion.dt, HIGHEST_FREQUENCY);
        Series::line(name, super::Abscissa::At(frequencies.into()), values).coloured(colour)
    };
    let played = run.acceleration.len().min(run.motion.len());
    Panel {
        title: "Fourier amplitude of acceleration, |2A/N|".to_string(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY).between(0.1, HIGHEST_FREQUENCY),
        y: Axis::linear("amplitude", Units::ACCELERATION),
        series: vec![
            amplitudes("reference", &run.motion.acceleration[..played], 0),
            amplitudes("table", &run.acceleration[..played], 1),
        ],
    }
}

fn settings(run: &Run) -> Section {
    let motion = run.motion;
    let mut rows = vec![
        vec![Cell::from("system"), run.system.into()],
        vec!["ended".into(), run.ended.into()],
        vec!["motion".into(), motion.name.as_str().into()],
        vec![
            "duration".into(),
            Cell::Quantity(run.whole.duration, Units::TIME, 5),
        ],
        vec![
            "sample time".into(),
            Cell::Quantity(1e3 * motion.dt, Units::same("ms"), 3),
        ],
    ];
    if let Some(seed) = motion.seed {
        rows.push(vec!["seed".into(), seed.to_string().into()]);
    }
    rows.extend(
        run.settings
            .iter()
            .map(|(name, value)| vec![name.as_str().into(), value.clone()]),
    );
    Section {
        heading: "The run".to_string(),
        tables: vec![Table {
            columns: vec!["".into(), "".into()],
            rows,
            ..Table::default()
        }],
        ..Section::default()
    }
}
