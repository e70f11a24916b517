//! Numbers as people read them.

use std::ops::RangeInclusive;

/// `value` with so many significant digits, for a terminal: `0.0123`, `12.3`, `1.23e-7`.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    rounded(value, digits, -5..=6)
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
    use super::{significant, typeset};

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
