//! Margins as a table.

use std::f64::consts::TAU;

use super::figures::LoopFigures;
use pages::report::number::significant;

/// The figures as a table: two rows of heads (name, unit), then two a loop.
pub fn table(rows: &[LoopFigures]) -> Vec<Vec<String>> {
    let heads = [
        "loop",
        "time",
        "stable",
        "crossover",
        "crossover",
        "phase margin",
        "gain margin",
        "bandwidth",
        "bandwidth",
    ];
    let units = ["", "", "", "Hz", "rad/s", "deg", "dB", "Hz", "rad/s"];
    let mut table = vec![
        heads.map(String::from).to_vec(),
        units.map(String::from).to_vec(),
    ];
    let cell = |value: Option<f64>| value.map_or("-".to_string(), |value| significant(value, 4));
    for row in rows {
        for (time, figures) in [("continuous", &row.continuous), ("500 Hz", &row.sampled)] {
            table.push(vec![
                if time == "continuous" {
                    row.name.to_string()
                } else {
                    String::new()
                },
                time.to_string(),
                if figures.stable { "yes" } else { "NO" }.to_string(),
                cell(figures.crossover_rad_s.map(|omega| omega / TAU)),
                cell(figures.crossover_rad_s),
                cell(figures.phase_margin_deg),
                cell(figures.gain_margin_db),
                cell(figures.bandwidth_hz),
                cell(figures.bandwidth_hz.map(|hertz| TAU * hertz)),
            ]);
        }
    }
    table
}
