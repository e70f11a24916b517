//! The tests of what the model leaves: residuals that are noise have no memory and nothing of the
//! command in them.

use identification::identify::identified::RigIdentification;

use pages::report::{Abscissa, Axis, Cell, Panel, Section, Series, Style, Table, Units};

/// Correlations of the residuals with their 99 % bands, and how many lie outside.
pub(super) fn section(found: &RigIdentification) -> Section {
    let mut own = Vec::new();
    let mut cross = Vec::new();
    let mut rows = Vec::new();
    for (n, (recording, channel, test)) in found.residuals.iter().enumerate() {
        let name = format!("{recording}, {channel}");
        let line = |values: &[f64], first: usize| {
            let lags: Vec<f64> = (first..first + values.len())
                .map(|lag| lag as f64)
                .collect();
            Series::line(&name, Abscissa::At(lags.into()), values.to_vec()).coloured(1 + n % 8)
        };
        own.push(line(&test.autocorrelation, 1));
        cross.push(line(&test.cross_correlation, 0));
        let share = |value: f64| Cell::Quantity(100.0 * value, Units::PERCENT, 2);
        rows.push([
            Cell::from(name.as_str()),
            share(test.outside()),
            share(test.cross_outside()),
            if test.is_white() { "yes" } else { "no" }.into(),
        ]);
    }
    let bands = |half: fn(&identification::estimation::residuals::ResidualTest) -> f64| {
        let tests = found.residuals.iter();
        let widest = tests.map(|(_, _, test)| half(test)).fold(0.0, f64::max);
        let lags = found
            .residuals
            .first()
            .map_or(1, |own| own.2.autocorrelation.len());
        Series::line(
            "99 % of white noise",
            Abscissa::At([0.0, lags as f64].into()),
            vec![-widest; 2],
        )
        .styled(Style::Band(vec![widest; 2]))
        .coloured(0)
    };
    let panel = |title: &str, band: Series, lines: Vec<Series>| Panel {
        title: title.into(),
        x: Axis::linear("lag [samples]", Units::NONE),
        y: Axis::linear("correlation", Units::NONE),
        series: std::iter::once(band).chain(lines).collect(),
    };
    Section {
        heading: "Residuals".into(),
        text: vec![
            "One-step errors on the part that was not fitted. For white residuals about 1 % of \
             the lags are outside the band."
                .into(),
        ],
        panels: vec![
            panel(
                "Autocorrelation of the residuals",
                bands(|test| test.band),
                own,
            ),
            panel(
                "Correlation of the residuals with the command before them",
                bands(|test| test.cross_band),
                cross,
            ),
        ],
        tables: vec![Table::of(
            "",
            [
                "recording, channel",
                "lags outside 99 %",
                "with the command",
                "white",
            ],
            rows,
        )],
        ..Section::default()
    }
}
