//! Units of column headers, as a factor to SI and a dimension.

/// Exponents of kg, m, s, A and rad.
type Dimension = [i32; 5];

const NAMES: [(&str, f64, Dimension); 27] = [
    ("1", 1.0, [0; 5]),
    ("s", 1.0, [0, 0, 1, 0, 0]),
    ("ms", 1e-3, [0, 0, 1, 0, 0]),
    ("min", 60.0, [0, 0, 1, 0, 0]),
    ("Hz", std::f64::consts::TAU, [0, 0, -1, 0, 1]),
    ("m", 1.0, [0, 1, 0, 0, 0]),
    ("cm", 1e-2, [0, 1, 0, 0, 0]),
    ("mm", 1e-3, [0, 1, 0, 0, 0]),
    ("um", 1e-6, [0, 1, 0, 0, 0]),
    ("in", plant::units::INCH, [0, 1, 0, 0, 0]),
    ("inch", plant::units::INCH, [0, 1, 0, 0, 0]),
    ("ft", 12.0 * plant::units::INCH, [0, 1, 0, 0, 0]),
    ("g", plant::units::G, [0, 1, -2, 0, 0]),
    ("gal", 1e-2, [0, 1, -2, 0, 0]),
    ("Gal", 1e-2, [0, 1, -2, 0, 0]),
    ("kg", 1.0, [1, 0, 0, 0, 0]),
    ("t", 1e3, [1, 0, 0, 0, 0]),
    ("N", 1.0, [1, 1, -2, 0, 0]),
    ("kN", 1e3, [1, 1, -2, 0, 0]),
    ("MN", 1e6, [1, 1, -2, 0, 0]),
    ("lbf", plant::units::LBF, [1, 1, -2, 0, 0]),
    ("kip", 1e3 * plant::units::LBF, [1, 1, -2, 0, 0]),
    ("V", 1.0, [1, 2, -3, -1, 0]),
    ("mV", 1e-3, [1, 2, -3, -1, 0]),
    ("kV", 1e3, [1, 2, -3, -1, 0]),
    ("rad", 1.0, [0, 0, 0, 0, 1]),
    ("deg", std::f64::consts::PI / 180.0, [0, 0, 0, 0, 1]),
];

/// Factor and dimension of a unit such as `in/s^2`, `lbf*s^2/in` or `m s-2`; what is wrong with it
/// otherwise.
fn parse(text: &str) -> Result<(f64, Dimension), String> {
    let (mut factor, mut dimension) = (1.0, [0; 5]);
    let mut sign = 1;
    let separate = text.replace('·', "*").replace("**", "^");
    for part in separate.split_inclusive(['*', '/', '.', ' ']) {
        let next_sign = if part.ends_with('/') { -1 } else { sign };
        let symbol = part.trim_end_matches(['*', '/', '.', ' ']);
        if symbol.is_empty() {
            sign = next_sign;
            continue;
        }
        let at = symbol
            .find(|c: char| c == '^' || c == '-' || c.is_ascii_digit())
            .filter(|&at| at > 0)
            .unwrap_or(symbol.len());
        let (name, power) = symbol.split_at(at);
        let power = match power.trim_start_matches('^') {
            "" => 1,
            digits => digits
                .parse::<i32>()
                .ok()
                .filter(|power| power.abs() < 10)
                .ok_or_else(|| format!("`{digits}` in unit `{text}` is no power"))?,
        };
        let (_, size, exponents) = NAMES
            .iter()
            .find(|(known, _, _)| *known == name)
            .ok_or_else(|| format!("unknown unit `{name}` in `{text}`"))?;
        factor *= size.powi(sign * power);
        for (sum, exponent) in dimension.iter_mut().zip(exponents) {
            *sum += sign * power * exponent;
        }
        sign = next_sign;
    }
    Ok((factor, dimension))
}

/// Factor from `unit` to the SI unit `si`; a sentence saying what does not fit otherwise.
pub fn factor_to(unit: &str, si: &str) -> Result<f64, String> {
    let (factor, dimension) = parse(unit)?;
    let (_, expected) = parse(si)?;
    if dimension != expected {
        return Err(format!("unit `{unit}` does not measure what `{si}` does"));
    }
    Ok(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_of_common_headers() {
        for (unit, si, want) in [
            ("in", "m", 0.0254),
            ("in/s^2", "m/s^2", 0.0254),
            ("g", "m/s^2", 9.80665),
            ("m s-2", "m/s^2", 1.0),
            ("mm/s2", "m/s^2", 1e-3),
            ("kN", "N", 1e3),
            ("mV", "V", 1e-3),
            ("lbf*s^2/in", "kg", 175.126_835_246_47),
        ] {
            let got = factor_to(unit, si).unwrap();
            assert!((got / want - 1.0).abs() < 1e-12, "{unit}: {got}");
        }
    }

    #[test]
    fn misfits_are_named() {
        assert!(
            factor_to("lbf", "m")
                .unwrap_err()
                .contains("does not measure")
        );
        assert!(
            factor_to("furlong", "m")
                .unwrap_err()
                .contains("unknown unit `furlong`")
        );
    }
}
