//! The calls on FMUs that are computed here, each with one fault.

use std::io::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering};

use fmi_import::{Behaviour, BehaviourError};

use super::*;

#[test]
fn a_run_has_the_steps_that_are_named_or_a_few_usual_ones() {
    assert_eq!(steps(Some(0.5), Some(3.0)), (0.5, 3.0));
    // Twenty steps, a hundredth of the end, twenty of a millisecond.
    assert_eq!(steps(Some(0.5), None), (0.5, 10.0));
    assert_eq!(steps(None, Some(3.0)), (0.03, 3.0));
    assert_eq!(steps(None, None), (1e-3, 0.02));
}

/// What an FMU does that it should not.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Each run has values of its own.
    Random,
    /// Instances share a variable.
    Shared,
    /// A restored state has forgotten the steps.
    Forgets,
    NotSaved,
    /// The third step fails.
    Fails,
    /// A choice that does not exist.
    Choice,
    /// Any time and any step will do.
    Careless,
}

/// Counts its steps, which must follow each other.
struct Counter {
    fault: Fault,
    steps: u32,
    run: usize,
    alive: Arc<AtomicUsize>,
}

impl Drop for Counter {
    fn drop(&mut self) {
        self.alive.fetch_sub(1, Ordering::Relaxed);
    }
}

const STEP: f64 = 0.25;

impl Behaviour for Counter {
    fn step(
        &mut self,
        time: f64,
        step: f64,
        _: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        let is_next = time == STEP * f64::from(self.steps) && step == STEP;
        if !is_next && self.fault != Fault::Careless {
            return Err(format!("is at step {}", self.steps).into());
        }
        self.steps += 1;
        if self.fault == Fault::Fails && self.steps == 3 {
            return Err("has run dry".into());
        }
        outputs[0] = match self.fault {
            Fault::Random => self.run as f64,
            Fault::Shared => self.alive.load(Ordering::Relaxed) as f64,
            _ => f64::from(self.steps),
        };
        outputs[1] = if self.fault == Fault::Choice {
            3.0
        } else {
            2.0
        };
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        match self.fault {
            Fault::NotSaved => Err("has no room".into()),
            Fault::Careless => Ok(Vec::new()),
            _ => Ok(self.steps.to_ne_bytes().to_vec()),
        }
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError> {
        if let Ok(bytes) = state.try_into() {
            self.steps = u32::from_ne_bytes(bytes);
        }
        if self.fault == Fault::Forgets {
            // The times fit, the values do not.
            self.fault = Fault::Random;
            self.run = 77;
        }
        Ok(())
    }
}

/// An FMU of four steps with that fault.
fn counter(fault: Fault) -> Arc<Fmu> {
    let text = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="Counter" instantiationToken="1">
        <CoSimulation modelIdentifier="Counter"/><TypeDefinitions>
        <EnumerationType name="Mode"><Item name="Off" value="1"/><Item name="On" value="2"/></EnumerationType>
        </TypeDefinitions><DefaultExperiment stopTime="1" stepSize="{STEP}"/><ModelVariables>
        <Float64 name="u" valueReference="1" causality="input" start="0"/>
        <Float64 name="count" valueReference="2" causality="output" initial="exact" start="0"/>
        <Enumeration name="mode" declaredType="Mode" valueReference="3" causality="output" initial="exact" start="1"/>
        </ModelVariables><ModelStructure/></fmiModelDescription>"#
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Counter.fmu");
    let mut archive = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file("modelDescription.xml", options).unwrap();
    archive.write_all(text.as_bytes()).unwrap();
    archive.finish().unwrap();
    let (runs, alive) = (AtomicUsize::new(0), Arc::new(AtomicUsize::new(0)));
    let begin: Arc<fmi_import::Begin> = Arc::new(move |_: &str| {
        alive.fetch_add(1, Ordering::Relaxed);
        Ok(Box::new(Counter {
            fault,
            steps: 0,
            run: runs.fetch_add(1, Ordering::Relaxed),
            alive: alive.clone(),
        }) as Box<dyn Behaviour>)
    });
    Arc::new(Fmu::open(&path).unwrap().computed_by(&[], false, begin))
}

/// What is found and what was checked, a line each.
fn found(fmu: &Arc<Fmu>) -> Vec<String> {
    let mut findings = Findings::default();
    check(&mut findings, fmu, None);
    let all = findings.findings.iter();
    let mut lines: Vec<String> = all
        .map(|own| format!("{}: {}", own.severity, own.message))
        .collect();
    lines.extend(findings.checked.iter().map(|what| format!("ok: {what}")));
    lines
}

const RUN: &str =
    "ok: library: instantiated, initialized, 4 steps of 0.25 s, every variable read, terminated";
const TWO: &str = "ok: library: two instances in one process";
const REPEATED: &str = "ok: library: steps repeated from a saved state, the same to the bit";
const ORDER: &str = "ok: library: 6 calls out of order";

#[test]
fn a_sound_fmu_passes_but_for_what_only_a_library_refuses() {
    let refused = [
        "warning: ExitInitializationMode without entering it is accepted, not refused",
        "warning: reading an unknown value reference is accepted, not refused",
    ];
    let early = "warning: doStep before initialization is accepted, not refused";
    let lines = found(&counter(Fault::None));
    let expected = [early, refused[0], refused[1], RUN, TWO, REPEATED, ORDER];
    assert_eq!(lines, expected);
    // One that steps from anywhere to anywhere.
    let lines = found(&counter(Fault::Careless));
    for what in [
        "doStep by a negative step",
        "doStep from a time that it has not reached",
        "doStep from a time that is not a number",
    ] {
        let line = format!("warning: {what} is accepted, not refused");
        assert!(lines.contains(&line), "{lines:#?}");
    }
}

#[test]
fn each_fault_is_found() {
    let differs = "error: two instances in one process give results that differ from those of one";
    for (fault, expected) in [
        (
            Fault::Random,
            "warning: a second run gives different results from the first",
        ),
        (Fault::Shared, differs),
        (
            Fault::Forgets,
            "error: steps from a saved state give different values",
        ),
    ] {
        let lines = found(&counter(fault));
        assert!(lines.iter().any(|line| line == expected), "{lines:#?}");
        assert!(lines.iter().any(|line| line == RUN), "{lines:#?}");
        // Nothing else is blamed.
        let blamed = |what: &str| lines.iter().any(|line| line.contains(what));
        assert_eq!(blamed("a second run"), fault == Fault::Random);
        assert_eq!(blamed("from a saved state give"), fault == Fault::Forgets);
    }
    let lines = found(&counter(Fault::NotSaved));
    let told = lines
        .iter()
        .find(|line| line.starts_with("error: a state saved and restored: "));
    assert!(
        told.is_some_and(|line| line.contains("has no room")),
        "{lines:#?}"
    );
    // An FMU that does not run is not called further.
    let lines = found(&counter(Fault::Fails));
    assert_eq!(lines.len(), 1, "{lines:#?}");
    assert!(lines[0].starts_with("error: ") && lines[0].contains("has run dry"));
}

#[test]
fn a_choice_that_does_not_exist_is_found_once() {
    let lines = found(&counter(Fault::Choice));
    let told = "warning: `mode` is 3, which is not one of its choices";
    let count = lines.iter().filter(|line| *line == told).count();
    assert_eq!(count, 1, "{lines:#?}");
    assert!(lines.iter().any(|line| line == REPEATED), "{lines:#?}");
}

#[test]
fn what_a_description_excludes_is_not_tried() {
    let mut fmu = counter(Fault::Shared);
    let own = Arc::make_mut(&mut fmu);
    own.description.only_one_per_process = true;
    own.description.saves_state = false;
    let lines = found(&fmu);
    let unsaved = "note: it cannot save its state, so its steps cannot be repeated";
    assert!(lines.iter().any(|line| line == unsaved), "{lines:#?}");
    let is_tried = |line: &String| line.contains("two instances") || line.contains("saved state");
    assert!(!lines.iter().any(is_tried), "{lines:#?}");
}

#[test]
fn derivatives_that_are_promised_and_not_given_are_found() {
    let mut fmu = counter(Fault::None);
    let promised = "warning: it says that it gives derivatives, and gives none by `u`";
    assert!(!found(&fmu).iter().any(|line| line == promised));
    Arc::make_mut(&mut fmu).description.directional_derivatives = true;
    let lines = found(&fmu);
    assert!(lines.iter().any(|line| line == promised), "{lines:#?}");
}

/// Outputs stand still before a run, so that each difference is 0 within the rounding of the output's size.
#[test]
fn differences_are_taken_in_proportion_to_the_input_which_gets_its_value_back() {
    let mut fmu = counter(Fault::None);
    let count = 2;
    let own = Arc::make_mut(&mut fmu);
    let output = own.description.position("count").unwrap();
    own.description.variables[output].start = Some("3".to_string());
    let mut instance = instance(&fmu, &Options::default()).unwrap();
    instance.enter_initialization(0.0, 1.0).unwrap();
    for (value, step) in [(0.0, 1e-3), (0.5, 1e-3), (-20.0, 0.02)] {
        instance.set(&Kind::Float64, &[1], &[value]).unwrap();
        let found = derivatives::differences(&mut instance, &[count, count], 1).unwrap();
        assert_eq!(found.len(), 2);
        for own in found {
            let (derivative, uncertainty) = own.unwrap();
            let expected = 1e4 * f64::EPSILON * 3.0 / step;
            assert_eq!(derivative, 0.0);
            assert!((uncertainty / expected - 1.0).abs() < 1e-9, "{uncertainty}");
        }
        let mut kept = [f64::NAN];
        instance.get(&Kind::Float64, &[1], &mut kept).unwrap();
        assert_eq!(kept, [value]);
    }
}
