//! Draws the pictures of `docs/physical-rig.md`: `cargo run --release -p acceptance --example
//! physical_rig` writes the rig's frequency response beside the identified plant's, its answers to
//! steps and sines, and the specimen's hysteresis under the built-in motion (compare Fig 4-6); with
//! a FILE.html they become a page instead.

use std::f64::consts::TAU;
use std::path::Path;

use acceptance::native_rig::{NativeRig, PERIOD};
use motion::{self, Options};
use nalgebra::Complex;
use pages::report::{
    Abscissa, Axis, Panel, Report, Section, Series, Style, UnitSystem, Units, html, svg,
};
use plant::identified::shake_table::ShakeTable;
use plant::linear::log_space;
use plant::servo_hydraulic::{ServoHydraulicInput, ServoHydraulicTable};

/// Displacement of the rig without specimen under `command` (V at s), m.
fn answer(rig: &ServoHydraulicTable, duration: f64, command: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut state = rig.rest();
    (0..(duration / PERIOD) as u32)
        .map(|k| {
            let displacement = state.displacement;
            let input = ServoHydraulicInput {
                valve_command: command(PERIOD * f64::from(k)),
                ..ServoHydraulicInput::default()
            };
            state = rig.advance(&state, &input, PERIOD);
            displacement
        })
        .collect()
}

fn histories(title: &str, series: Vec<Series>) -> Panel {
    Panel {
        title: title.into(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("displacement", Units::DISPLACEMENT),
        series,
    }
}

fn frequency_responses() -> Panel {
    let grid = log_space(0.1, 60.0, 300);
    let gain = |system: &plant::linear::StateSpace| {
        let at = |f: &f64| system.evaluate(Complex::new(0.0, TAU * f));
        let norm = |f: &f64| at(f).map_or(f64::NAN, |g| g[(0, 0)].norm() / units::constants::INCH);
        grid.iter().map(|f| 20.0 * norm(f).log10()).collect()
    };
    let line = |name: &str, values| Series::line(name, Abscissa::At(grid.clone().into()), values);
    Panel {
        title: "Valve command to displacement".into(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y: Axis::linear("gain over 1 in/V", Units::DECIBEL),
        series: vec![
            line(
                "identified (Eq 2-13, 2-14)",
                gain(&ShakeTable::default().state_space()),
            ),
            line(
                "physical, linearised",
                gain(&ServoHydraulicTable::default().linearised()),
            ),
        ],
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rig = ServoHydraulicTable::default();
    let steps = [0.05, 0.1, 0.2, 0.4].map(|volts| {
        let values = answer(&rig, 0.5, |t| if t < 0.05 { 0.0 } else { volts });
        Series::history(&format!("{volts} V"), PERIOD, &values)
    });
    let sines = [0.1, 0.5, 2.0].map(|volts| {
        let values = answer(&rig, 2.0, |t| volts * (TAU * 2.0 * t).cos());
        let per_volt: Vec<f64> = values.iter().map(|x| x / volts).collect();
        Series::history(&format!("{volts} V"), PERIOD, &per_volt)
    });
    let motion = motion::built_in(1, &Options::default())?;
    let run = NativeRig::laboratory(1).play(&motion);
    let specimen = Panel {
        title: "Hysteresis of the specimen under the built-in motion".into(),
        x: Axis::linear("drift", Units::DISPLACEMENT),
        y: Axis::linear("force", Units::FORCE),
        series: vec![
            Series::line(
                "columns",
                Abscissa::At(run.drift.into()),
                run.specimen_force,
            )
            .styled(Style::Path),
        ],
    };
    let panels = vec![
        frequency_responses(),
        histories("Steps of the valve command", steps.into()),
        histories("Sines of 2 Hz, per volt", sines.into()),
        specimen,
    ];
    let Some(file) = std::env::args().nth(1) else {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
        let names = ["response", "steps", "sines", "hysteresis"];
        for (name, panel) in names.into_iter().zip(&panels) {
            let file = docs.join(format!("physical_rig_{name}.svg"));
            std::fs::write(&file, svg(panel, UnitSystem::Us))?;
            println!("written: {}", file.display());
        }
        return Ok(());
    };
    let report = Report {
        title: "The physical rig".into(),
        summary: "Servo-hydraulic table from first principles with its yielding specimen.".into(),
        sections: vec![Section {
            panels,
            ..Section::default()
        }],
        ..Report::default()
    };
    std::fs::write(&file, html(&report, None)?)?;
    println!("written: {file}");
    Ok(())
}
