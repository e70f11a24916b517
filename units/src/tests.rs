use super::*;

fn si(text: &str) -> f64 {
    Quantity::parse(text).unwrap_or_else(|e| panic!("{e}")).si()
}

fn close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-12 * expected.abs(),
        "{found} is not {expected}"
    );
}

#[test]
fn quantities_as_people_write_them() {
    close(si("1.5 in"), 0.0381);
    close(si("3 lbf"), 13.344_664_845_781_5);
    close(si("0.3 g"), 2.941_995);
    close(si("12 in/s^2"), 0.3048);
    close(si("2 m/s2"), 2.0);
    close(si("2 m.s-2"), 2.0);
    close(si("2 m/s²"), 2.0);
    // 386.0886 lbm weigh 386.0886 lbf and are one lbf s^2/in of mass.
    close(si("1 lbf*s^2/in"), 386.088_582_677_165_35 * 0.453_592_37);
    close(si("1 V/in"), 1.0 / 0.0254);
    close(si("1 V s/in"), 1.0 / 0.0254);
    close(si("1 kN"), 1000.0);
    close(si("25 mm"), 0.025);
    close(si("2 ms"), 0.002);
    close(si("3000 psi"), 3000.0 * 6_894.757_293_168_361);
    close(
        si("1 in^3/s/V/sqrt(psi)"),
        1.638_706_4e-5 / 6_894.757_293_168_361_f64.sqrt(),
    );
    close(si("5 %"), 0.05);
    close(si("7"), 7.0);
    close(si("7 1"), 7.0);
    close(si("7 -"), 7.0);
    close(si("-1.5e-3in"), -1.5e-3 * 0.0254);
    close(si("1 N/(m/s)"), 1.0);
    close(si("4 s^-1"), 4.0);
    close(si("4 1/s"), 4.0);
    close(si("9 mm^(1/2)"), 9.0 * 1e-3_f64.sqrt());
    close(si("9 mm^-0.5"), 9.0 / 1e-3_f64.sqrt());
    close(si("9 m^1.5"), 9.0);
}

#[test]
fn hertz_fits_radians_per_second_but_not_one_over_second() {
    close(
        Quantity::parse("60 Hz").unwrap().to("rad/s").unwrap(),
        376.991_118_430_775_2,
    );
    close(Quantity::parse("60 Hz").unwrap().to("Hz").unwrap(), 60.0);
    assert_eq!(
        convert(1.0, "Hz", "1/s").unwrap_err().to_string(),
        "unit \"Hz\" (s^-1 rad) does not fit \"1/s\" (s^-1)"
    );
}

#[test]
fn base_units_of_fmi_are_those_of_the_si_brochure() {
    let base = |text: &str| Unit::parse(text).unwrap().base_unit();
    // kg, m, s, A, K, mol, cd, rad.
    let unit = |exponents, factor| Some(BaseUnit { exponents, factor });
    assert_eq!(base("N"), unit([1, 1, -2, 0, 0, 0, 0, 0], 1.0));
    assert_eq!(base("V/(m.s)"), unit([1, 1, -4, -1, 0, 0, 0, 0], 1.0));
    assert_eq!(base("A.s-1/m"), unit([0, -1, -1, 1, 0, 0, 0, 0], 1.0));
    assert_eq!(base("1"), unit([0; 8], 1.0));
    assert_eq!(base("rad/s"), unit([0, 0, -1, 0, 0, 0, 0, 1], 1.0));
    assert_eq!(base("Hz"), unit([0, 0, -1, 0, 0, 0, 0, 0], 1.0));
    assert_eq!(base("kHz"), unit([0, 0, -1, 0, 0, 0, 0, 0], 1000.0));
    assert_eq!(base("in"), unit([0, 1, 0, 0, 0, 0, 0, 0], 0.0254));
    assert_eq!(base("sqrt(psi)"), None);
}

#[test]
fn a_volt_is_what_it_is_in_base_units() {
    assert_eq!(
        Unit::parse("V").unwrap().dimension.to_string(),
        "kg m^2 s^-3 A^-1"
    );
    assert_eq!(
        Unit::parse("V").unwrap().dimension,
        Unit::parse("W/A").unwrap().dimension
    );
    assert_eq!(
        Unit::parse("sqrt(psi)").unwrap().dimension.to_string(),
        "kg^(1/2) m^(-1/2) s^-1"
    );
    assert_eq!(
        Unit::parse("%").unwrap().dimension.to_string(),
        "no dimension"
    );
}

#[test]
fn two_units_that_do_not_fit_are_both_named() {
    assert_eq!(
        Quantity::parse("3 lbf")
            .unwrap()
            .to("in")
            .unwrap_err()
            .to_string(),
        "unit \"lbf\" (kg m s^-2) does not fit \"in\" (m)"
    );
    assert_eq!(
        convert(1.0, "V", "-").unwrap_err().to_string(),
        "unit \"V\" (kg m^2 s^-3 A^-1) does not fit \"-\" (no dimension)"
    );
}

#[test]
fn what_cannot_be_read_says_where_and_what_was_expected() {
    let message = |text: &str| Unit::parse(text).unwrap_err().to_string();
    assert_eq!(
        message("V/inn"),
        "unknown unit \"inn\" in \"V/inn\"; did you mean \"in\"?"
    );
    assert_eq!(
        message("lb"),
        "unknown unit \"lb\" in \"lb\"; write lbf (force) or lbm (mass)"
    );
    assert_eq!(
        message("zorkmid"),
        "unknown unit \"zorkmid\" in \"zorkmid\""
    );
    assert_eq!(
        message("m/s s"),
        "cannot read the unit \"m/s s\" at character 5: expected brackets or `*`: a blank after \
         `/` is ambiguous"
    );
    assert_eq!(
        message("N/(m/s"),
        "cannot read the unit \"N/(m/s\" at character 7: expected `)`"
    );
    assert_eq!(
        message("m/"),
        "cannot read the unit \"m/\" at character 3: expected the name of a unit"
    );
    assert_eq!(
        message("m^(1/3)"),
        "cannot read the unit \"m^(1/3)\" at character 6: expected a half, as in ^(1/2)"
    );
    assert_eq!(
        Quantity::parse("in 1.5").unwrap_err().to_string(),
        "cannot read \"in 1.5\" as a number with a unit, as in \"1.5 in\""
    );
    for text in ["nan in", "inf", "1e999 in", "", "--1 in"] {
        assert!(Quantity::parse(text).is_err(), "{text}");
    }
}

#[test]
fn a_number_alone_is_in_the_unit_that_is_meant() {
    close(value_in("0.3", "g").unwrap(), 0.3);
    close(value_in("0.3 g", "g").unwrap(), 0.3);
    close(value_in("3.2 ft/s^2", "in/s^2").unwrap(), 38.4);
    close(value_in("5 %", "1").unwrap(), 0.05);
    assert_eq!(
        value_in("1.2 g", "m").unwrap_err().to_string(),
        "unit \"g\" (m s^-2) does not fit \"m\" (m)"
    );
}

#[test]
fn gal_is_what_is_meant() {
    close(factor_meant("gal", "m/s^2").unwrap(), 0.01);
    close(factor_meant("Gal", "g").unwrap(), 0.01 / 9.806_65);
    close(factor_meant("gal", "m^3").unwrap(), 3.785_411_784e-3);
    close(factor_meant("in", "m").unwrap(), 0.0254);
    assert!(factor_meant("gal", "m").is_err());
}

#[test]
fn grams_are_not_offered() {
    assert!(Unit::parse("mg").is_err());
    assert_eq!(
        Unit::parse("g").unwrap().dimension,
        Unit::parse("m/s^2").unwrap().dimension
    );
}

#[test]
fn headers_split_into_name_and_unit() {
    assert_eq!(
        split_header(" displacement [in] "),
        ("displacement", Some("in"))
    );
    assert_eq!(split_header("time [s]"), ("time", Some("s")));
    assert_eq!(split_header("flow[in^3/s]"), ("flow", Some("in^3/s")));
    assert_eq!(split_header("t_s"), ("t_s", None));
    assert_eq!(split_header("u[1] [V]"), ("u[1]", Some("V")));
}

proptest::proptest! {
    /// Any text at all: an answer or an error, never a panic.
    #[test]
    fn no_text_breaks_the_reader(text in "\\PC{0,40}") {
        let _ = Quantity::parse(&text);
        let _ = Unit::parse(&text);
    }

    /// The same with the letters that the grammar knows.
    #[test]
    fn no_unit_like_text_breaks_the_reader(text in "[ms in/^*().0-9+V²%-]{0,24}") {
        let _ = Quantity::parse(&text);
        let _ = Unit::parse(&text);
    }

    /// Converting there and back gives the value again.
    #[test]
    fn there_and_back(value in -1e6..1e6f64) {
        let there = convert(value, "in/s^2", "g").unwrap();
        let back = convert(there, "g", "in/s^2").unwrap();
        proptest::prop_assert!((back - value).abs() <= 1e-9 * value.abs());
    }
}

#[test]
fn a_value_is_converted_by_the_ratio_of_its_units() {
    close(convert(3.0, "in", "mm").unwrap(), 76.2);
    close(convert(500.0, "mm", "m").unwrap(), 0.5);
    close(convert(180.0, "°", "rad").unwrap(), std::f64::consts::PI);
    close(
        convert(90.0, "°/s", "rad/s").unwrap(),
        std::f64::consts::FRAC_PI_2,
    );
}

#[test]
fn units_that_touch_are_refused() {
    for text in ["m(s)", "N%", "(m)(s)"] {
        let said = Unit::parse(text).unwrap_err().to_string();
        assert!(said.contains("`*`, `/`, `^` or a blank"), "{text}: {said}");
    }
}
