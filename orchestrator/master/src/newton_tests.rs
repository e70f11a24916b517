use super::*;

struct Function<F> {
    of: F,
    sent: usize,
}

impl<F: Fn(&[f64], &mut [f64])> Round for Function<F> {
    fn send(&mut self, values: &[f64], back: &mut [f64]) -> Result<(), MasterError> {
        self.sent += 1;
        (self.of)(values, back);
        Ok(())
    }
}

fn seek(
    of: impl Fn(&[f64], &mut [f64]),
    from: &[f64],
    smooth: &[bool],
) -> (Vec<f64>, Result<(), Unsolved>, usize) {
    let mut round = Function { of, sent: 0 };
    let mut values = from.to_vec();
    let mut solver = Solver::new(smooth);
    let solved = solve(&mut solver, &mut round, &mut values).unwrap();
    (values, solved, round.sent)
}

#[test]
fn gains_that_substitution_cannot_bear_are_solved() {
    for gain in [-1e6, -5.0, -1.0, 0.05, 0.99, 3.0, 1e6] {
        let (values, solved, sent) = seek(|x, y| y[0] = gain * x[0] + 1.0, &[0.0], &[true]);
        assert_eq!(solved, Ok(()), "{gain}");
        let exact = 1.0 / (1.0 - gain);
        assert!((values[0] / exact - 1.0).abs() < 1e-9, "{gain}: {values:?}");
        assert!(sent < 12, "{gain}: {sent}");
    }
}

#[test]
fn values_of_very_different_sizes_are_solved_together() {
    // A pressure in Pa and a displacement in m.
    let round = |x: &[f64], y: &mut [f64]| {
        y[0] = 1e7 - 3e10 * x[1];
        y[1] = 2e-10 * x[0];
    };
    let (values, solved, _) = seek(round, &[0.0, 0.0], &[true, true]);
    assert_eq!(solved, Ok(()));
    let exact = 1e7 / 7.0;
    assert!((values[0] / exact - 1.0).abs() < 1e-10, "{values:?}");
}

#[test]
fn a_curved_loop_is_solved_from_afar() {
    // x = 3 - x^3 / 2, by hand 1.3744378...: substitution runs away.
    let (values, solved, _) = seek(|x, y| y[0] = 3.0 - 0.5 * x[0].powi(3), &[20.0], &[true]);
    assert_eq!(solved, Ok(()));
    let x = values[0];
    assert!((x + 0.5 * x.powi(3) - 3.0).abs() < 1e-10, "{x}");
}

#[test]
fn a_switch_in_the_loop_is_substituted() {
    let round = |x: &[f64], y: &mut [f64]| {
        y[0] = f64::from(x[1] > 0.5);
        y[1] = -4.0 * x[1] + 5.0 * x[0] + 5.0;
    };
    let (values, solved, _) = seek(round, &[0.0, 0.0], &[false, true]);
    assert_eq!(solved, Ok(()));
    assert!(
        values[0] == 1.0 && (values[1] - 2.0).abs() < 1e-10,
        "{values:?}"
    );
}

#[test]
fn a_loop_that_gives_back_what_it_is_given_and_more_has_no_solution() {
    let (_, solved, _) = seek(|x, y| y[0] = x[0] + 1.0, &[0.0], &[true]);
    let unsolved = solved.unwrap_err();
    assert!(unsolved.is_singular(), "{unsolved:?}");
}

#[test]
fn the_closest_that_was_found_is_told() {
    // x = x^2 + 1 has none; the two come closest at 1/2.
    let (_, solved, _) = seek(|x, y| y[0] = x[0] * x[0] + 1.0, &[3.0], &[true]);
    let unsolved = solved.unwrap_err();
    assert!((unsolved.value - 0.5).abs() < 0.1, "{unsolved:?}");
    assert!((unsolved.back - unsolved.value - 0.75).abs() < 0.02);
}

#[test]
fn a_loop_with_a_tolerance_of_its_own_is_solved_within_it() {
    // What comes back is rounded to 1e-10.
    let round = |x: &[f64], y: &mut [f64]| y[0] = ((1.0 - 2.0 * x[0]) * 1e10).round() / 1e10;
    let (values, solved, _) = seek(round, &[0.0], &[true]);
    assert_eq!(solved, Ok(()));
    assert!((values[0] - 1.0 / 3.0).abs() < 1e-9, "{values:?}");
}

#[test]
fn derivatives_that_are_wrong_are_not_believed_twice() {
    struct Wrong;
    impl Round for Wrong {
        fn send(&mut self, values: &[f64], back: &mut [f64]) -> Result<(), MasterError> {
            back[0] = 1.0 - 5.0 * values[0];
            Ok(())
        }
        fn derivative(
            &mut self,
            _: usize,
            _: &[f64],
            change: &mut [f64],
        ) -> Result<bool, MasterError> {
            change[0] = 50.0;
            Ok(true)
        }
    }
    let mut values = [0.0];
    let mut solver = Solver::new(&[true]);
    assert_eq!(solve(&mut solver, &mut Wrong, &mut values).unwrap(), Ok(()));
    assert!((values[0] - 1.0 / 6.0).abs() < 1e-12);
}

#[test]
fn what_does_not_settle_is_explained_by_how_a_change_comes_back() {
    for (gain, is_singular, words) in [
        (
            Some(1.0 + 0.9e-3),
            true,
            "a change of the values returns at its full size",
        ),
        (Some(1.0 - 0.9e-3), true, "the loop gain is 1"),
        (
            Some(1.0 + 1.1e-3),
            false,
            "a change of the values returns 1.0011 times as large",
        ),
        (
            Some(-3.0),
            false,
            "returns -3.0000 times as large, and Newton's method does not converge",
        ),
        (None, false, "after 17 iterations they still change"),
    ] {
        let unsolved = Unsolved {
            passes: 17,
            place: 0,
            value: 0.0,
            back: 1.0,
            gain,
        };
        assert_eq!(unsolved.is_singular(), is_singular, "{gain:?}");
        let reason = unsolved.reason();
        assert!(
            reason.starts_with(words) || reason.contains(words),
            "{reason}"
        );
    }
}

#[test]
fn the_gain_is_the_real_eigenvalue_next_to_one() {
    let of = |rows: &[f64]| {
        let n = (rows.len() as f64).sqrt() as usize;
        gain(&DMatrix::from_row_slice(n, n, rows))
    };
    let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-9;
    // Eigenvalues 0.2 and 1.5; then 4 and -1.
    assert!(near(of(&[0.2, 7.0, 0.0, 1.5]), 1.5));
    assert!(near(of(&[1.5, 7.0, 0.0, 0.2]), 1.5));
    assert!(near(of(&[1.0, 2.0, 3.0, 2.0]), -1.0));
    // A rotation has none that is real.
    assert_eq!(of(&[0.0, -1.0, 1.0, 0.0]), None);
    assert_eq!(of(&[f64::NAN]), None);
}

#[test]
fn whole_numbers_that_go_to_and_fro_are_not_found() {
    let (_, solved, sent) = seek(|x, y| y[0] = 1.0 - x[0], &[0.0], &[false]);
    let unsolved = solved.unwrap_err();
    assert_eq!((unsolved.gain, unsolved.passes), (None, MOST_PASSES));
    assert_eq!(sent, MOST_PASSES);
    assert!((unsolved.back - unsolved.value).abs() == 1.0);
}
