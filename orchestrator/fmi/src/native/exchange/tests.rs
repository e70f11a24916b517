//! The solver on systems whose solutions are known, in place of FMUs.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::call::Values;

type Slope = fn(f64, &[f64], &mut [f64]);

/// `J e_i` at a point.
type Directional = fn(&[f64], usize, &mut [f64]);

/// A system of equations that answers as an FMU does.
struct Equations {
    slope: Slope,
    /// A state that makes an event where it crosses this value.
    event: Option<(usize, f64)>,
    /// Directional derivatives, whether right or not.
    directional: Option<Directional>,
    states: Vec<f64>,
    time: f64,
    kept: Vec<Vec<f64>>,
    evaluations: Arc<AtomicUsize>,
}

impl Endpoint for Equations {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let column = call.references.get(call.unknowns()).copied();
        let numbers = match &mut call.values {
            Values::Out(bytes) | Values::Both(bytes) => bytemuck::cast_slice_mut(bytes),
            Values::In(bytes) => {
                if call.function == Function::SetContinuousStates {
                    self.states.copy_from_slice(bytemuck::cast_slice(bytes));
                }
                return Ok(0);
            }
            _ => &mut [][..],
        };
        match call.function {
            Function::SetTime => self.time = call.numbers[0],
            Function::GetContinuousStates => numbers.copy_from_slice(&self.states),
            Function::GetNominals => return Ok(3),
            Function::GetDerivatives => {
                self.evaluations.fetch_add(1, Ordering::Relaxed);
                (self.slope)(self.time, &self.states, numbers);
            }
            Function::GetEventIndicators => {
                if let Some((state, value)) = self.event {
                    numbers[0] = self.states[state] - value;
                }
            }
            Function::GetDirectionalDerivative => {
                let directional = self.directional.ok_or(Lost(String::new()))?;
                let column = column.ok_or(Lost(String::new()))?;
                directional(&self.states, column as usize, &mut numbers[1..]);
            }
            Function::GetState => {
                self.kept.push(self.states.clone());
                call.handle = self.kept.len() as u64;
            }
            Function::SetState => self.states.clone_from(&self.kept[call.handle as usize - 1]),
            _ => call.flags = [false; 5],
        }
        Ok(0)
    }
}

struct Solved {
    solver: Stepped,
    evaluations: Arc<AtomicUsize>,
}

impl Solved {
    fn new(
        slope: Slope,
        states: &[f64],
        event: Option<(usize, f64)>,
        directional: Option<Directional>,
    ) -> Self {
        let evaluations = Arc::new(AtomicUsize::new(0));
        let fmu = Equations {
            slope,
            event,
            directional,
            states: states.to_vec(),
            time: 0.0,
            kept: Vec::new(),
            evaluations: evaluations.clone(),
        };
        let n = states.len() as u32;
        let pairs: Vec<(u32, u32)> = match directional {
            Some(_) => (0..n).map(|at| (at, n + at)).collect(),
            None => Vec::new(),
        };
        let sizes = (states.len(), usize::from(event.is_some()));
        let mut solver = Stepped::new(Box::new(fmu), false, sizes, &pairs);
        let mut exit = Call::plain(Function::ExitInitializationMode);
        assert_eq!(solver.call(&mut exit), Ok(0));
        Self {
            solver,
            evaluations,
        }
    }

    fn step(&mut self, from: f64, to: f64) -> Vec<f64> {
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [from, to - from, 0.0];
        assert_eq!(self.solver.call(&mut call), Ok(0));
        self.solver.now.states.clone()
    }

    fn evaluations(&self) -> usize {
        self.evaluations.load(Ordering::Relaxed)
    }
}

fn robertson(_time: f64, y: &[f64], slope: &mut [f64]) {
    let third = 1.0 - y[0] - y[1];
    let (slow, quick) = (0.04 * y[0] - 1e4 * y[1] * third, 3e7 * y[1] * y[1]);
    (slope[0], slope[1]) = (-slow, slow - quick);
}

fn robertson_derivative(y: &[f64], column: usize, into: &mut [f64]) {
    let third = 1.0 - y[0] - y[1];
    let slow = match column {
        0 => 0.04 + 1e4 * y[1],
        _ => -1e4 * third + 1e4 * y[1],
    };
    let quick = if column == 1 { 6e7 * y[1] } else { 0.0 };
    (into[0], into[1]) = (-slow, slow - quick);
}

/// By SciPy 1.16's Radau with rtol 1e-10 and atol 1e-16.
const ROBERTSON: [(f64, f64, f64); 5] = [
    (0.4, 0.9851721138594426, 3.386395378937251e-5),
    (40.0, 0.7158270687171653, 9.185534764465404e-6),
    (400.0, 0.45051866846962707, 3.222901441685659e-6),
    (4000.0, 0.18320225777747265, 8.942371252826182e-7),
    (10000.0, 0.10730042853780496, 4.800166972571705e-7),
];

#[test]
fn robertson_s_reaction_agrees_with_scipy() {
    let right: fn(&[f64], usize, &mut [f64]) = robertson_derivative;
    // Derivatives that are false cost time and nothing else.
    let wrong: fn(&[f64], usize, &mut [f64]) = |_, _, into| into.fill(1e3);
    for directional in [None, Some(right), Some(wrong)] {
        let mut solved = Solved::new(robertson, &[1.0, 0.0], None, directional);
        let mut time = 0.0;
        for (end, y1, y2) in ROBERTSON {
            let y = solved.step(time, end);
            assert!(
                (y[0] - y1).abs() < 1e-8 && (y[1] - y2).abs() < 1e-11,
                "{end} s: {y:?}"
            );
            time = end;
        }
        assert!(solved.solver.now.is_stiff);
        println!("{} evaluations", solved.evaluations());
        assert!(solved.evaluations() < 30_000);
    }
}

fn van_der_pol(_time: f64, y: &[f64], slope: &mut [f64]) {
    (slope[0], slope[1]) = (y[1], 1e6 * (1.0 - y[0] * y[0]) * y[1] - y[0]);
}

#[test]
fn van_der_pol_s_oscillator_agrees_with_scipy() {
    // By SciPy 1.16's Radau with rtol 1e-11 and atol 1e-14, before and after the jump at 807,000 s.
    let reference = [
        (4e5, 1.693209005119728),
        (8e5, 1.083892946675993),
        (1e6, -1.8633839229607099),
        (1.2e6, -1.6994006675043591),
        (1.6e6, -1.119268647778863),
    ];
    let derivative: fn(&[f64], usize, &mut [f64]) = |y, column, into| match column {
        0 => (into[0], into[1]) = (0.0, -2e6 * y[0] * y[1] - 1.0),
        _ => (into[0], into[1]) = (1.0, 1e6 * (1.0 - y[0] * y[0])),
    };
    for (step, directional) in [
        (4e5, None),
        (2e5, Some(derivative)),
        (2e4, None),
        (2e4, Some(derivative)),
    ] {
        let mut solved = Solved::new(van_der_pol, &[2.0, 0.0], None, directional);
        let mut time = 0.0;
        while time < 1.6e6 {
            let y = solved.step(time, time + step);
            time += step;
            let expected = reference.iter().find(|(end, _)| *end == time);
            if let Some((end, expected)) = expected {
                let error = (y[0] - expected).abs();
                println!("steps of {step} s, {end} s: {error:e}");
                assert!(error < 1e-6, "steps of {step} s, {end} s: {y:?}");
            }
        }
        println!("{} evaluations", solved.evaluations());
        assert!(solved.evaluations() < 100_000, "{}", solved.evaluations());
    }
}

#[test]
fn a_mild_system_keeps_the_explicit_method() {
    let oscillator: Slope = |_, y, slope| (slope[0], slope[1]) = (y[1], -y[0]);
    let mut solved = Solved::new(oscillator, &[1.0, 0.0], None, None);
    for step in 0..100 {
        let y = solved.step(0.1 * f64::from(step), 0.1 * f64::from(step + 1));
        assert!((y[0] - (0.1 * f64::from(step + 1)).cos()).abs() < 1e-8);
    }
    assert!(!solved.solver.now.is_stiff);
}

/// A quick part that follows a slow one.
fn follower(_time: f64, y: &[f64], slope: &mut [f64]) {
    (slope[0], slope[1]) = (1e5 * (y[1].sin() - y[0]), 1.0);
}

#[test]
fn the_implicit_method_ends_a_step_at_an_event() {
    let mut solved = Solved::new(follower, &[0.0, 0.0], Some((0, 0.5)), None);
    let slow = solved.step(0.0, 0.1);
    assert!(solved.solver.now.is_stiff, "{slow:?}");
    solved.solver.now.next_event = None;
    let reached = solved.solver.integrate(0.1, 1.0);
    let Ok(Reached::Event(at)) = reached else {
        panic!("no event");
    };
    // y = (a² sin t - a cos t + a exp(-a t)) / (a² + 1): it lags by 1 / a.
    let expected = 0.5_f64.asin() + 1e-5;
    assert!((at - expected).abs() < 1e-9, "{at} {expected}");
    assert!(solved.solver.now.states[0] >= 0.5);
    assert!((solved.solver.now.states[0] - 0.5).abs() < 1e-9);
}

#[test]
fn a_stiff_system_goes_on_from_a_kept_state_to_the_bit() {
    let mut solved = Solved::new(follower, &[0.3, 0.0], None, None);
    let ends: Vec<f64> = (0..=20).map(|at| 0.05 * f64::from(at)).collect();
    for pair in ends[..=8].windows(2) {
        solved.step(pair[0], pair[1]);
    }
    let mut keep = Call::plain(Function::GetState);
    assert_eq!(solved.solver.call(&mut keep), Ok(0));
    let rest = |solved: &mut Solved| -> Vec<Vec<f64>> {
        let pairs = ends[8..].windows(2);
        pairs.map(|pair| solved.step(pair[0], pair[1])).collect()
    };
    let first = rest(&mut solved);
    let mut back = Call::plain(Function::SetState);
    back.handle = keep.handle;
    assert_eq!(solved.solver.call(&mut back), Ok(0));
    assert_eq!(rest(&mut solved), first);
}

#[test]
fn a_system_that_is_no_longer_stiff_is_stepped_explicitly_again() {
    // Stiff until 1 s.
    let changing: Slope = |time, y, slope| {
        let rate = if time < 1.0 { 1e5 } else { 1.0 };
        slope[0] = rate * (time.sin() - y[0]);
    };
    let mut solved = Solved::new(changing, &[0.0], None, None);
    solved.step(0.0, 0.5);
    assert!(solved.solver.now.is_stiff);
    solved.step(0.5, 100.0);
    assert!(!solved.solver.now.is_stiff);
}
