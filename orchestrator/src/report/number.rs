//! Numbers as people read them.

/// `value` with so many significant digits: `0.0123`, `12.3`, `1.23e-7`.
pub(super) fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    let digits = digits.clamp(1, 15);
    let scientific = format!("{value:.*e}", digits - 1);
    let exponent: i32 = scientific
        .split_once('e')
        .and_then(|parts| parts.1.parse().ok())
        .unwrap_or(0);
    if !(-4..=7).contains(&exponent) {
        return scientific.replace('-', "\u{2212}");
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    format!("{value:.decimals$}").replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn so_many_digits_and_no_more() {
        assert_eq!(significant(0.012345, 3), "0.0123");
        assert_eq!(significant(12.345, 3), "12.3");
        assert_eq!(significant(-9.996, 3), "\u{2212}10.0");
        assert_eq!(significant(123_456.0, 3), "123456");
        assert_eq!(significant(1.23e-7, 3), "1.23e\u{2212}7");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(significant(f64::NAN, 3), "–");
    }
}
