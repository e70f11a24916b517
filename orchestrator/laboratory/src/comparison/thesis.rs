//! What the thesis prints: Table 4-1 and 5-2.

/// A record of the thesis: how a file of it is recognised, its title, and the printed errors, loop
/// shaping, sliding mode (Table 4-1) and model predictive control (Table 5-2), in frequency and
/// in time.
pub(super) struct Printed {
    pub(super) file: &'static str,
    pub(super) title: &'static str,
    pub(super) frequency: [f64; 3],
    pub(super) time: [f64; 3],
}

const fn printed(
    file: &'static str,
    title: &'static str,
    frequency: [f64; 3],
    time: [f64; 3],
) -> Printed {
    Printed {
        file,
        title,
        frequency,
        time,
    }
}

/// Controllers of these tables, in their order.
pub(super) const CONTROLLERS: [&str; 3] = ["loop-shaping", "sliding-mode", "mpc"];

/// Table 4-1 and 5-2.
pub(super) const PRINTED: [Printed; 8] = [
    printed(
        "nahanni",
        "Nahanni, Canada (1985)",
        [0.51, 0.50, 0.11],
        [7.68, 6.86, 2.34],
    ),
    printed(
        "coalinga",
        "Coalinga, USA (1983)",
        [0.63, 0.54, 0.24],
        [12.73, 12.93, 5.99],
    ),
    printed(
        "kobe",
        "Kobe, Japan (1995)",
        [0.44, 0.39, 0.14],
        [17.43, 15.19, 4.73],
    ),
    printed(
        "morgan",
        "Morgan Hill, USA (1984)",
        [0.53, 0.50, 0.15],
        [7.60, 9.38, 4.79],
    ),
    printed(
        "northridge",
        "Northridge, USA (1994)",
        [0.63, 0.73, 0.10],
        [11.31, 11.09, 3.22],
    ),
    printed(
        "friuli",
        "Friuli, Italy (1976), stand-in for Irpinia, Italy (1980)",
        [0.67, 0.42, 0.23],
        [14.98, 9.93, 7.05],
    ),
    printed(
        "manjil",
        "Manjil, Iran (1990)",
        [1.49, 1.06, 0.31],
        [20.59, 20.23, 8.62],
    ),
    printed(
        "imperial",
        "Imperial Valley, US (1979)",
        [2.21, 1.61, 0.24],
        [13.64, 10.31, 3.89],
    ),
];

/// Median and standard deviation as printed, in frequency and in time. The median of loop shaping in
/// frequency, 0.65 there, is a misprint: the eight values give 0.63.
pub(super) const PRINTED_FREQUENCY: [[f64; 3]; 2] = [[0.65, 0.52, 0.19], [0.62, 0.42, 0.08]];
pub(super) const PRINTED_TIME: [[f64; 3]; 2] = [[13.19, 10.70, 4.76], [4.49, 4.14, 2.06]];

/// The record of the thesis that a record is, by its name.
pub(super) fn known(record: &str) -> Option<&'static Printed> {
    let name = record.to_lowercase();
    PRINTED.iter().find(|printed| name.contains(printed.file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::result::{deviation, median};

    #[test]
    fn printed_values_have_the_printed_medians_and_deviations() {
        let of = |at: usize| -> Vec<f64> { PRINTED.iter().map(|p| p.time[at]).collect() };
        for at in 0..3 {
            let [middle, spread] = PRINTED_TIME.map(|row| row[at]);
            assert!((median(&of(at)).unwrap() - middle).abs() < 0.0051, "{at}");
            assert!((deviation(&of(at)).unwrap() - spread).abs() < 0.006, "{at}");
        }
        let frequency: Vec<f64> = PRINTED.iter().map(|p| p.frequency[0]).collect();
        assert!((median(&frequency).unwrap() - 0.63).abs() < 1e-9);
    }

    #[test]
    fn a_stand_in_is_labelled() {
        let title = known("Friuli_Italy_1976_TMZ-000").unwrap().title;
        assert!(title.contains("stand-in for Irpinia"));
        assert!(known("synthetic-1").is_none());
    }
}
