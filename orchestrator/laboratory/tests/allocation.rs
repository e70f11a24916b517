//! Nothing is allocated while a simulation steps, neither by the master nor by the components.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use controllers::pid::{Pid, PidInput};
use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion};
use fmi_import::FmiVersion;
use fmi_master::Algorithm;
use laboratory::run::experiment::{Request, prepare};
use plant::identified::shake_table::{ShakeTable, ShakeTableState};
use plant::specimens::linear::{LinearSpecimen, SpecimenState};

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: everything is handed on to the system's allocator.
#[allow(unsafe_code, reason = "an allocator is unsafe by nature")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations of this thread during `action`.
fn allocations(action: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    action();
    COUNT.with(Cell::get) - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(
        allocations(|| drop(std::hint::black_box(vec![1.0; 100]))),
        1
    );
}

#[test]
fn the_master_allocates_nothing_in_a_step() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        for algorithm in [
            Algorithm::GaussSeidel,
            Algorithm::Jacobi,
            Algorithm::Iterative,
        ] {
            let request = Request {
                fmi,
                step_s: Some(0.001),
                ..Request::built_in("three-variable")
            };
            let mut simulation = prepare(&request).unwrap().simulation(algorithm).unwrap();
            let count = allocations(|| {
                for _ in 0..1000 {
                    simulation.observe().unwrap();
                    simulation.advance().unwrap();
                }
            });
            assert_eq!(count, 0, "FMI {fmi}, {algorithm}");
            assert!(simulation.time() > 0.999);
        }
    }
}

/// The FMUs have allocators of their own, so their components are counted here.
#[test]
fn the_components_allocate_nothing_in_a_step() {
    let (table, specimen) = (ShakeTable::default(), LinearSpecimen::appendix_a());
    let (sampled_table, sampled_specimen) = (table.sample(0.002), specimen.sample(0.002));
    let (mut pid, mut law) = (Pid::equation_3_6(), ThreeVariableControl::table_3_2());
    let (mut table_state, mut specimen_state) =
        (ShakeTableState::default(), SpecimenState::default());
    let count = allocations(|| {
        for k in 0..1000 {
            let reference = Motion {
                displacement: 1e-5 * f64::from(k),
                ..Motion::default()
            };
            let force = specimen.force(&specimen_state);
            let measured = Motion {
                displacement: table_state.displacement,
                velocity: table_state.velocity,
                acceleration: table.acceleration(&table_state, force),
            };
            let input = PidInput {
                reference: reference.displacement,
                measured: measured.displacement,
            };
            let input_3 = ThreeVariableInput {
                reference,
                measured,
            };
            let command = 0.5 * (pid.step(&input, 0.002) + law.step(&input_3, 0.002));
            table_state = sampled_table.advance(&table_state, command, force);
            specimen_state = sampled_specimen.advance(&specimen_state, measured.acceleration);
        }
    });
    assert_eq!(count, 0);
    assert!(table_state.displacement > 1e-3, "{table_state:?}");
}
