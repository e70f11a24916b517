//! Variables of every type, and derivatives.

use fmi_import::{Datum, FmiVersion, Kind};

use crate::made::{
    ANSWER, BOTH, COUNT, EARLY, GAIN, OVER, PAIR, U, X, Y, answer, instance, one, running, set,
    stepped, value,
};

#[test]
fn an_output_is_the_gain_times_the_input_and_the_order_is_that_of_the_references() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[(GAIN, 3.0)]);
        own.set(&Kind::Float64, &[U, GAIN], &[0.5, 5.0]).unwrap();
        let mut all = [0.0; 4];
        let read = own.get(&Kind::Float64, &[Y, GAIN, U, X], &mut all);
        read.unwrap();
        assert_eq!(all, [2.5, 5.0, 0.5, 1.0], "{version}");
    }
}

#[test]
fn an_array_has_more_values_than_references() {
    let mut own = running(&stepped(FmiVersion::V3, "", ""), &[]);
    own.set(&Kind::Float64, &[U, PAIR, GAIN], &[1.5, 7.0, -8.0, 2.0])
        .unwrap();
    let mut all = [0.0; 3];
    own.get(&Kind::Float64, &[PAIR, Y], &mut all).unwrap();
    assert_eq!(all, [7.0, -8.0, 3.0]);
}

#[test]
fn numbers_of_every_type_are_kept_to_their_limits() {
    let mut own = running(&stepped(FmiVersion::V3, "", ""), &[]);
    let choice = Kind::Enumeration(Vec::new());
    for (kind, first, values) in [
        (Kind::Float32, 10, [f64::from(0.1_f32), -1.5]),
        (Kind::Int8, 20, [-128.0, 127.0]),
        (Kind::UInt8, 30, [255.0, 1.0]),
        (Kind::Int16, 40, [-32768.0, 32767.0]),
        (Kind::UInt16, 50, [65535.0, 256.0]),
        (Kind::UInt32, 60, [4294967295.0, 65536.0]),
        (Kind::Int32, ANSWER, [-2147483648.0, 2147483647.0]),
        (Kind::Boolean, EARLY, [1.0, 0.0]),
        (Kind::Boolean, EARLY, [0.0, 1.0]),
        (choice, 80, [-9007199254740992.0, 3.0]),
    ] {
        own.set(&kind, &[first, first + 1], &values).unwrap();
        let mut read = [0.5; 2];
        own.get(&kind, &[first + 1, first], &mut read).unwrap();
        assert_eq!(read, [values[1], values[0]], "{kind:?}");
    }
}

#[test]
fn numbers_of_fmi_2_are_kept_to_their_limits() {
    let mut own = running(&stepped(FmiVersion::V2, "", ""), &[]);
    let choice = Kind::Enumeration(Vec::new());
    for kind in [Kind::Int32, choice] {
        own.set(&kind, &[ANSWER, COUNT], &[-2147483648.0, 7.0])
            .unwrap();
        assert_eq!(one(&mut own, &kind, ANSWER), -2147483648.0);
        assert_eq!(one(&mut own, &kind, COUNT), 7.0);
    }
    for values in [[1.0, 0.0], [0.0, 1.0]] {
        own.set(&Kind::Boolean, &[EARLY, OVER], &values).unwrap();
        let mut read = [0.5; 2];
        own.get(&Kind::Boolean, &[EARLY, OVER], &mut read).unwrap();
        assert_eq!(read, values);
    }
}

#[test]
fn values_that_an_f64_does_not_hold_are_exact() {
    let mut own = running(&stepped(FmiVersion::V3, "", ""), &[]);
    for (kind, first, data) in [
        (Kind::Int64, 80, [i64::MIN, i64::MAX].map(Datum::Signed)),
        (Kind::UInt64, 90, [u64::MAX, 1 << 63].map(Datum::Unsigned)),
        (
            Kind::Binary,
            110,
            [vec![0, 255, 0], vec![]].map(Datum::Bytes),
        ),
        (
            Kind::String,
            100,
            ["", "\u{e9} 100 %"].map(|text| Datum::Text(text.into())),
        ),
    ] {
        own.set_exact(&kind, &[first, first + 1], &data).unwrap();
        let mut read = [Datum::empty(&kind), Datum::empty(&kind)];
        own.get_exact(&kind, &[first, first + 1], &mut read)
            .unwrap();
        assert_eq!(read, data);
    }
    // A number is taken as one of its type.
    own.set_exact(&Kind::Int64, &[80], &[Datum::Number(-7.0)])
        .unwrap();
    assert_eq!(one(&mut own, &Kind::Int64, 80), -7.0);
    let zero = Datum::Text(b"a\0b".to_vec());
    let refused = own.set_exact(&Kind::String, &[100], &[zero]).unwrap_err();
    assert_eq!(refused.outcome, "cannot take a text with a zero in it");
}

#[test]
fn texts_of_fmi_2_come_back() {
    let mut own = running(&stepped(FmiVersion::V2, "", ""), &[]);
    let data = ["first", ""].map(|text| Datum::Text(text.into()));
    own.set_exact(&Kind::String, &[100, 101], &data).unwrap();
    let mut read = [Datum::Number(0.0), Datum::Number(0.0)];
    own.get_exact(&Kind::String, &[100, 101], &mut read)
        .unwrap();
    assert_eq!(read, data);
}

#[test]
fn a_call_that_is_refused_names_its_variables_and_reasons_and_ends_the_instance() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[]);
        own.take_messages();
        let refused = own.set(&Kind::Float64, &[U, GAIN], &[1.0, -1.0]);
        let refused = refused.unwrap_err();
        assert_eq!(refused.variables, ["u", "gain"]);
        assert_eq!(refused.outcome, "returned error");
        assert_eq!(refused.messages, ["the gain is negative"]);
        assert!(!refused.may_be_of_the_step);
        let expected = match version {
            FmiVersion::V2 => "fmi2SetReal",
            FmiVersion::V3 => "fmi3SetFloat64",
        };
        assert_eq!(refused.call, expected);
        // Only freeing is allowed then.
        own.close();
        let texts = crate::made::texts(&own);
        assert_eq!(texts, ["FreeInstance"]);
    }
}

#[test]
fn variables_are_named_by_their_type_and_unknown_ones_by_their_reference() {
    for version in BOTH {
        let fmu = stepped(version, "", "");
        let mut own = running(&fmu, &[]);
        let refused = own
            .get(&Kind::Float64, &[Y, 99], &mut [0.0; 2])
            .unwrap_err();
        assert_eq!(refused.variables, ["y", "#99"]);
        let mut own = running(&fmu, &[]);
        // A Boolean with the reference of an Int32.
        let refused = own.set(&Kind::Boolean, &[ANSWER], &[1.0]).unwrap_err();
        assert_eq!(refused.variables, ["#70"]);
        let mut own = running(&fmu, &[]);
        let refused = own.set(&Kind::Int32, &[ANSWER, 3], &[1.0, 2.0]);
        assert_eq!(refused.unwrap_err().variables, ["answer", "#3"]);
    }
}

#[test]
fn a_value_that_is_not_finite_is_an_error_of_its_variable() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[]);
        set(&mut own, U, f64::INFINITY);
        let read = own.get(&Kind::Float64, &[X, Y], &mut [0.0; 2]);
        let error = read.unwrap_err();
        assert_eq!(
            (&*error.outcome, &error.variables[..]),
            ("gave inf", &["y".to_string()][..])
        );
        assert!(error.may_be_of_the_step);
        // It is not the end of the instance.
        set(&mut own, U, 0.5);
        assert_eq!(value(&mut own, Y), 1.0);
    }
}

#[test]
fn a_type_that_fmi_2_does_not_have_is_refused() {
    let mut own = instance(&stepped(FmiVersion::V2, "", ""));
    let refused = own.set(&Kind::Int8, &[20], &[1.0]).unwrap_err();
    assert!(
        refused.outcome.ends_with("is no function of FMI 2.0"),
        "{refused}"
    );
}

const DIRECTIONAL: &str = r#"providesDirectionalDerivatives="true""#;
const ADJOINT: &str = r#"providesAdjointDerivatives="true""#;

/// What changes of u and x by 3 and 5 change of y and x'.
fn derivative(own: &mut fmi_import::Instance) -> Option<[f64; 2]> {
    let mut changes = [f64::NAN; 2];
    let given = own.derivative(
        (&[Y, crate::made::SLOPE], &mut changes),
        (&[U, X], &[3.0, 5.0]),
    );
    given.unwrap().then_some(changes)
}

#[test]
fn derivatives_are_those_of_the_equations_whichever_the_fmu_gives() {
    let both = format!("{DIRECTIONAL} {ADJOINT}");
    for (attributes, if_discarded) in [
        (DIRECTIONAL, None),
        (ADJOINT, Some([12.0, -5.0])),
        (&both, Some([12.0, -5.0])),
    ] {
        let mut own = running(&stepped(FmiVersion::V3, attributes, ""), &[(GAIN, 4.0)]);
        assert!(own.gives_derivatives());
        assert_eq!(derivative(&mut own), Some([12.0, -5.0]));
        // Directional ones are discarded: adjoint ones are left, where it has them.
        answer(&mut own, 2);
        assert_eq!(derivative(&mut own), if_discarded);
    }
    let attributes = r#"providesDirectionalDerivative="true""#;
    let mut own = running(&stepped(FmiVersion::V2, attributes, ""), &[(GAIN, 4.0)]);
    assert_eq!(derivative(&mut own), Some([12.0, -5.0]));
    let mut own = running(&stepped(FmiVersion::V3, "", ""), &[]);
    assert!(!own.gives_derivatives());
    assert_eq!(derivative(&mut own), None);
}
