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
