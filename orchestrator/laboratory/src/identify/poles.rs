//! The poles of an identified rig.

use std::f64::consts::TAU;

use super::summary::Summary;
use pages::report::{Abscissa, Axis, Cell, Panel, Series, Style, Table, Units};

/// Name, poles and colour of actuator and table.
fn parts(summary: &Summary) -> [(&'static str, &[[f64; 2]], usize); 2] {
    [
        ("actuator", &summary.actuator_poles_rad_s, 1),
        ("table", &summary.table_poles_rad_s, 2),
    ]
}

/// The poles in the complex plane.
pub(super) fn panel(summary: &Summary) -> Panel {
    let series = parts(summary).into_iter().filter(|own| !own.1.is_empty());
    let series = series.map(|(name, poles, colour)| {
        let [re, im] = [0, 1].map(|part| -> Vec<f64> { poles.iter().map(|p| p[part]).collect() });
        Series::line(name, Abscissa::At(re.into()), im)
            .styled(Style::Points)
            .coloured(colour)
    });
    Panel {
        title: "Poles".into(),
        x: Axis::linear("real part", Units::same("1/s")),
        y: Axis::linear("imaginary part", Units::same("1/s")),
        series: series.collect(),
    }
}

/// The poles with frequency and damping.
pub(super) fn table(summary: &Summary) -> Table {
    let rows = parts(summary).into_iter().flat_map(|(name, poles, _)| {
        poles.iter().map(move |&[re, im]| {
            let size = re.hypot(im);
            [
                Cell::from(name),
                Cell::Number(re, 5),
                Cell::Number(im, 5),
                Cell::Quantity(size, Units::same("rad/s"), 4),
                Cell::Quantity(size / TAU, Units::FREQUENCY, 4),
                Cell::Number(-re / size.max(f64::MIN_POSITIVE), 3),
            ]
        })
    });
    Table::of(
        "Poles",
        [
            "of",
            "real part [1/s]",
            "imaginary part [1/s]",
            "natural frequency",
            "in Hz",
            "damping ratio",
        ],
        rows,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_have_frequency_and_damping() {
        let summary = Summary {
            model: "model.toml".into(),
            actuator_poles_rad_s: vec![[-30.0, 40.0], [-30.0, -40.0]],
            table_poles_rad_s: vec![[-TAU, 0.0]],
            fit_percent: Default::default(),
            identifiable: true,
            warnings: Vec::new(),
            wall_s: 0.0,
        };
        let shown = |summary: &Summary| {
            let table = table(summary);
            expected::table(&table, pages::report::UnitSystem::Si)
        };
        assert_eq!(
            shown(&summary),
            "table: Poles\n\
             of        real part [1/s]  imaginary part [1/s]  natural frequency     in Hz  damping ratio\n\
             actuator          -30.000                40.000        50.00 rad/s  7.958 Hz          0.600\n\
             actuator          -30.000               -40.000        50.00 rad/s  7.958 Hz          0.600\n\
             table             -6.2832                     0        6.283 rad/s  1.000 Hz           1.00\n"
        );
        let drawn = panel(&summary);
        assert_eq!(drawn.series.len(), 2);
        let own = &drawn.series[0];
        assert_eq!(
            (&*own.name, &own.values[..]),
            ("actuator", &[40.0, -40.0][..])
        );
        let Abscissa::At(places) = &own.abscissa else {
            panic!("places expected")
        };
        assert_eq!(places[..], [-30.0, -30.0]);
        let table_alone = Summary {
            actuator_poles_rad_s: Vec::new(),
            ..summary
        };
        assert_eq!(panel(&table_alone).series[0].name, "table");
    }
}
