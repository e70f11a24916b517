use super::*;
use fmi_import::Causality;

fn variable(reference: u32, kind: Kind, variability: Variability) -> Variable {
    Variable {
        name: format!("v{reference}"),
        reference,
        kind,
        causality: Causality::Input,
        variability,
        unit: None,
        base_unit: None,
        display_unit: None,
        bounds: [None; 2],
        start: None,
        is_settable: true,
        is_structural: false,
        clocks: Vec::new(),
        element: (0, 1),
        is_element: false,
        description: String::new(),
        dependencies: [].into(),
    }
}

fn real(reference: u32) -> Variable {
    variable(reference, Kind::Float64, Variability::Continuous)
}

/// A number at a place, with factor and offset.
fn drive(signal: usize, factor: f64, offset: f64) -> Option<Drive> {
    Some(Drive {
        signal: Place::Number(signal),
        passage: Passage {
            factor,
            offset,
            map: Vec::new(),
        },
        is_smooth: false,
    })
}

fn smooth(signal: usize) -> Option<Drive> {
    drive(signal, 1.0, 0.0).map(|drive| Drive {
        is_smooth: true,
        ..drive
    })
}

const ZERO: Datum = Datum::Number(0.0);

/// An array of four of which three are side by side, one that is smooth, and one that is scaled.
fn inputs() -> Inputs {
    let mut inputs = Inputs::default();
    let array = [
        (drive(2, 1.0, 0.0), ZERO),
        (drive(3, 1.0, 0.0), ZERO),
        (drive(4, 1.0, 0.0), ZERO),
        (None, Datum::Number(7.0)),
    ];
    inputs.add(&real(1), &array);
    inputs.add(&real(2), &[(smooth(1), ZERO)]);
    inputs.add(&real(3), &[(drive(0, -2.0, 5.0), ZERO)]);
    inputs
}

#[test]
fn inputs_change_with_the_signals_by_their_factors() {
    let signals = [10.0, 20.0, 30.0, 40.0, 50.0];
    let (references, changes) = inputs().change(&signals).unwrap();
    assert_eq!(references, [1, 2, 3]);
    // What nothing drives stays, and an offset does not change anything.
    assert_eq!(changes, [30.0, 40.0, 50.0, 0.0, 20.0, -20.0]);
    // Another type must not change.
    let mut inputs = inputs();
    inputs.add(
        &variable(4, Kind::Float32, Variability::Continuous),
        &[(drive(5, 1.0, 0.0), ZERO)],
    );
    assert_eq!(inputs.change(&[10.0, 20.0, 30.0, 40.0, 50.0, 1.0]), None);
    assert!(
        inputs
            .change(&[10.0, 20.0, 30.0, 40.0, 50.0, 0.0])
            .is_some()
    );
}

#[test]
fn sources_are_all_that_drives_and_the_smooth_ones_change_between_samples() {
    let inputs = inputs();
    let sorted = |all: Vec<usize>| {
        let mut all = all;
        all.sort_unstable();
        all
    };
    assert_eq!(sorted(inputs.sources().collect()), [0, 1, 2, 3, 4]);
    assert_eq!(inputs.smooth_sources().collect::<Vec<_>>(), [1]);
    assert!(inputs.others().next().is_none());
}

#[test]
fn what_is_foreseen_is_float64_that_is_driven_linearly() {
    let own = inputs();
    let (references, values, driven) = own.foreseen().unwrap();
    assert_eq!(
        (references, values),
        (&[1, 2, 3][..], &[0.0, 0.0, 0.0, 7.0, 0.0, 0.0][..])
    );
    let at = |place, signal, factor, offset| Driven {
        place,
        signal,
        change: Linear { factor, offset },
    };
    let expected = [
        at(0, 2, 1.0, 0.0),
        at(1, 3, 1.0, 0.0),
        at(2, 4, 1.0, 0.0),
        at(4, 1, 1.0, 0.0),
        at(5, 0, -2.0, 5.0),
    ];
    assert_eq!(driven, expected);
    assert_eq!(own.driven().collect::<Vec<_>>(), expected);
    assert!(
        Inputs::default()
            .foreseen()
            .is_some_and(|(set, ..)| set.is_empty())
    );
    let with = |variable: &Variable, drive: Option<Drive>| {
        let mut own = inputs();
        own.add(variable, &[(drive, ZERO)]);
        own
    };
    let mapped = drive(0, 1.0, 0.0).map(|mut drive| {
        drive.passage.map = vec![(0.0, 1.0)];
        drive
    });
    for own in [
        with(&real(4), mapped.clone()),
        with(
            &variable(4, Kind::Int32, Variability::Continuous),
            drive(0, 1.0, 0.0),
        ),
        with(
            &variable(4, Kind::Float64, Variability::Discrete),
            drive(0, 1.0, 0.0),
        ),
        with(&variable(4, Kind::String, Variability::Continuous), None),
    ] {
        assert!(own.foreseen().is_none());
    }
    // A number that is mapped, and one of another type, drive otherwise.
    assert_eq!(with(&real(4), mapped).others().collect::<Vec<_>>(), [0]);
    let whole = with(
        &variable(4, Kind::Int32, Variability::Continuous),
        drive(3, 1.0, 0.0),
    );
    assert_eq!(whole.others().collect::<Vec<_>>(), [3]);
}

#[test]
fn outputs_are_known_by_type_and_place() {
    let mut outputs = Outputs::default();
    outputs.add(&Kind::Int32, vec![5], 1, 3);
    outputs.add(&Kind::Float64, vec![6, 7], 3, 4);
    outputs.add(&Kind::Float32, vec![8], 1, 7);
    assert_eq!(outputs.reals(), Some((&[6, 7][..], 4, 3)));
    assert_eq!(outputs.signals().collect::<Vec<_>>(), [3, 4, 5, 6, 7]);
    assert_eq!(outputs.real_signals().collect::<Vec<_>>(), [4, 5, 6, 7]);
    assert!(!outputs.has_exact());
    let mut more = Outputs::default();
    more.add(&Kind::Binary, vec![9], 1, 0);
    assert_eq!((more.reals(), more.has_exact()), (None, true));
    outputs.extend(&more);
    assert!(outputs.has_exact());
    assert_eq!(outputs.readings().count(), 3);
}
