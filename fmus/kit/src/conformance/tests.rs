//! The checks pass a sound component and name the fault of each other one.

use super::*;
use crate::{guard::catch, oscillator::Oscillator, panel::*};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn complaint<C: Component>() -> String {
    catch(check::<C>)
        .err()
        .map(|panic| panic.to_string())
        .unwrap_or_default()
}

#[test]
fn sound_components_pass() {
    assert_eq!(complaint::<Panel<SOUND>>(), "");
    assert_eq!(complaint::<Oscillator>(), "");
}

#[test]
fn every_fault_is_found_and_named() {
    for (said, expected) in [
        (
            complaint::<Panel<SILENT_DEPENDENCY>>(),
            "`product` depends on `b`",
        ),
        (
            complaint::<Panel<SILENT_INITIAL_DEPENDENCY>>(),
            "`product` depends initially on `gain`",
        ),
        (complaint::<Panel<WRONG_PARTIAL>>(), "d product / d "),
        (complaint::<Panel<FORGETFUL>>(), "replay, step"),
        (complaint::<Panel<ALLOCATES>>(), "heap allocations"),
        (
            complaint::<Panel<STARTS_ELSEWHERE>>(),
            "initializing again gives the same",
        ),
    ] {
        assert!(said.contains(expected), "`{said}` lacks `{expected}`");
    }
}

#[test]
fn allocations_are_counted() {
    assert_eq!(allocations(|| ()), 0);
    let kept = std::cell::RefCell::new(Vec::new());
    let counted = allocations(|| {
        for _ in 0..3 {
            kept.borrow_mut().push(Box::new(1));
        }
    });
    // Three boxes, and the vector that holds them.
    assert_eq!(counted, 4);
}

#[test]
fn the_numbers_are_splitmix64_spread_over_both_signs() {
    // The generator's first output for the seed 0 (Steele, Lea and Flood 2014) is e220a8397b1dcdaf.
    let first = Numbers(0).next();
    let expected = (0xe220_a839_7b1d_cdaf_u64 >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
    assert_eq!(first, expected);
    let mut numbers = Numbers(3);
    let drawn: Vec<f64> = (0..20_000).map(|_| numbers.next()).collect();
    assert!(drawn.iter().all(|x| (-1.0..1.0).contains(x)));
    let mean = drawn.iter().sum::<f64>() / 2e4;
    let square = drawn.iter().map(|x| x * x).sum::<f64>() / 2e4;
    // Three standard errors of 1/sqrt(3 n), and of a mean square of 1/3.
    assert!(mean.abs() < 0.0123, "{mean}");
    assert!((square - 1.0 / 3.0).abs() < 0.0064, "{square}");
}

#[test]
fn inputs_are_excited_by_a_hundredth_of_their_nominal_value() {
    let model = Model::<Panel<SOUND>>::get().unwrap();
    let mut component = Panel::<SOUND>::default();
    let mut numbers = Numbers(5);
    let mut largest = [0.0_f64; 2];
    for _ in 0..200 {
        set_inputs(model, &mut component, &mut numbers);
        largest[0] = largest[0].max(component.a.abs());
        largest[1] = largest[1].max(component.b.abs());
    }
    assert!((0.009..=0.01).contains(&largest[0]), "{largest:?}");
    assert!((0.09..=0.1).contains(&largest[1]), "{largest:?}");
    excite(model, &mut component, &mut numbers);
    assert!(component.level != 0.0, "it moved");
}

#[test]
fn values_are_numbered_and_refused_by_name() {
    let mut component = Panel::<SOUND>::default();
    number(&mut component, &["b", "offsets[2]", "inner", "a"]);
    assert_eq!(
        (
            component.b,
            component.offsets[1],
            component.inner.1,
            component.a
        ),
        (1.0, 2.0, 3.0, 4.0)
    );
    refuses::<Panel<SOUND>>(&[("gain", -1.0)]);
    let passed = catch(|| refuses::<Panel<SOUND>>(&[("gain", 1.0)]));
    assert!(passed.unwrap_err().to_string().contains("it is refused"));
}
