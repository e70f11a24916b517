//! Numbers as people read them.

use std::ops::RangeInclusive;

/// `value` with so many significant digits, for a terminal: `0.0123`, `12.3`, `1.23e-7`.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    rounded(value, digits, -5..=6)
}

/// `value` to the last of two digits of its standard `error`, and to five digits at most: beyond, it says nothing.
pub fn estimated(value: f64, error: f64) -> String {
    if !(error > 0.0 && error.is_finite() && value.is_finite()) {
        return significant(value, 5);
    }
    let place = |size: f64| size.abs().log10().floor();
    let digits = place(value) - place(error) + 2.0;
    let unit = 10_f64.powf(place(error) - 1.0);
    if digits < 1.0 {
        return significant((value / unit).round() * unit, 1);
    }
    significant(value, digits.min(5.0) as usize)
}

/// The same for a page, with a minus sign, and a dash where there is no number.
pub(super) fn typeset(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_string();
    }
    rounded(value, digits, -4..=7).replace('-', "\u{2212}")
}

/// `value` with so many significant digits, without exponent where that is in `plain`.
fn rounded(value: f64, digits: usize, plain: RangeInclusive<i32>) -> String {
    if value == 0.0 {
        return "0".to_string();
    }
    let digits = digits.clamp(1, 15);
    let scientific = format!("{value:.*e}", digits - 1);
    let exponent: i32 = scientific
        .split_once('e')
        .and_then(|parts| parts.1.parse().ok())
        .unwrap_or(0);
    if !plain.contains(&exponent) {
        return scientific;
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::{estimated, significant, typeset};

    #[test]
    fn an_estimate_has_the_digits_that_its_error_leaves() {
        assert_eq!(estimated(12.3456, 0.21), "12.35");
        assert_eq!(estimated(12.3456, 0.021), "12.346");
        assert_eq!(estimated(12.3456, 0.000_021), "12.346");
        assert_eq!(estimated(-0.000_859_4, 0.000_15), "-0.00086");
        assert_eq!(estimated(4.3631e-10, 2.1e-8), "0");
        assert_eq!(estimated(-4.3631e-10, 2.1e-8), "0");
        assert_eq!(estimated(0.83, 12.0), "1");
        assert_eq!(estimated(3.0, 120.0), "0");
        assert_eq!(estimated(6.2, 120.0), "10");
        assert_eq!(estimated(0.0, 0.1), "0");
        assert_eq!(estimated(1.5, 0.0), "1.5000");
        assert_eq!(estimated(1.5, f64::NAN), "1.5000");
    }

    #[test]
    fn so_many_digits_and_no_more() {
        assert_eq!(typeset(0.012345, 3), "0.0123");
        assert_eq!(typeset(12.345, 3), "12.3");
        assert_eq!(typeset(-9.996, 3), "\u{2212}10.0");
        assert_eq!(typeset(123_456.0, 3), "123456");
        assert_eq!(typeset(1.23e-7, 3), "1.23e\u{2212}7");
        assert_eq!(typeset(0.0, 3), "0");
        assert_eq!(typeset(f64::NAN, 3), "–");
        assert_eq!(significant(-9.996, 3), "-10.0");
        assert_eq!(significant(1.23e-7, 3), "1.23e-7");
        assert_eq!(significant(f64::NAN, 3), "NaN");
    }
}
