//! Numbers as people read them.

/// `value` with so many significant digits, without exponent where it can be read so: `0.0123`,
/// `12.3`, `1.23e-7`.
pub(crate) fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_string();
    }
    if !value.is_finite() {
        return format!("{value}");
    }
    let digits = digits.clamp(1, 15);
    let scientific = format!("{value:.*e}", digits - 1);
    let exponent: i32 = scientific
        .split_once('e')
        .and_then(|parts| parts.1.parse().ok())
        .unwrap_or(0);
    if !(-5..7).contains(&exponent) {
        return scientific;
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    format!("{value:.decimals$}")
}

/// The same for a page: with a true minus, and a dash for what is no number.
pub(super) fn typeset(value: f64, digits: usize) -> String {
    if value.is_finite() {
        significant(value, digits).replace('-', "\u{2212}")
    } else {
        "–".to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_digits_and_no_more() {
        for (value, text) in [
            (0.012345, "0.0123"),
            (12.345, "12.3"),
            (-9.996, "-10.0"),
            (123_456.0, "123456"),
            (1.23e-7, "1.23e-7"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(significant(value, 3), text);
        }
    }

    #[test]
    fn pages_have_true_signs() {
        assert_eq!(typeset(-9.996, 3), "\u{2212}10.0");
        assert_eq!(typeset(1.23e-7, 3), "1.23e\u{2212}7");
        assert_eq!(typeset(f64::NAN, 3), "–");
    }
}
