//! Systems of FMUs in another process, which is this program again: their values, and how often calls travel.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[allow(dead_code, reason = "other tests need more")]
#[path = "../../fmi/tests/compiled/made.rs"]
mod made;

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use fmi_import::{FmiVersion, Fmu, Isolation, Options, isolation};
use fmi_master::{Algorithm, Plan, Samples, Simulation};
use fmi_system::{Library, SystemFile, assemble};

const STEP: f64 = 0.125;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [isolation::COMMAND, frame] = *arguments.iter().map(String::as_str).collect::<Vec<_>>() {
        return isolation::guest(Path::new(frame));
    }
    for version in made::BOTH {
        for algorithm in [
            Algorithm::GaussSeidel,
            Algorithm::Jacobi,
            Algorithm::Iterative,
        ] {
            println!("test a chain, {version}, {algorithm}");
            a_chain(version, algorithm, false);
            println!("test a sampled chain, {version}, {algorithm}");
            a_chain(version, algorithm, true);
        }
    }
    ExitCode::SUCCESS
}

struct Minimal(Arc<Fmu>);

impl Library for Minimal {
    fn fmu(&mut self, _: &str) -> Result<Arc<Fmu>, Box<dyn std::error::Error>> {
        Ok(self.0.clone())
    }
}

/// `y = 2 u` of each of three; the last gets the difference from a constant.
fn a_chain(version: FmiVersion, algorithm: Algorithm, is_sampled: bool) {
    let fmu = made::stepped(
        version,
        r#"canHandleVariableCommunicationStepSize="true""#,
        "",
    );
    let period = if is_sampled { "period = 0.125\n" } else { "" };
    let part = |name: &str| format!("[components.{name}]\nfmu = \"minimal\"\n{period}");
    let text = format!(
        "connections = [\"a.y -> b.u\", {{ connect = \"b.y -> c.u\", factor = -1.0, offset = 5.0 }}]\n\
        {}inputs = {{ u = 1.5 }}\n{}{}",
        part("a"),
        part("b"),
        part("c"),
    );
    let file = SystemFile::parse("chain", &text).unwrap();
    let system = assemble(&file, &[], &mut Minimal(fmu)).unwrap();
    let plan = Plan {
        algorithm,
        ..Plan::fixed(STEP, 2.0)
    };
    let options = Options {
        isolation: Isolation::All,
        guest: Some(std::env::current_exe().unwrap()),
        ..Options::default()
    };
    let mut own = Simulation::planned(&system, &Samples::none(STEP), &plan, &options).unwrap();
    own.observe().unwrap();
    let mut before = own.exchanges();
    let mut travelled = Vec::new();
    for step in 0..8 {
        own.advance().unwrap();
        own.observe().unwrap();
        travelled.push(own.exchanges() - before);
        before = own.exchanges();
        // All at once, a value is seen by the next one at the next step.
        if algorithm == Algorithm::Jacobi && step < 3 {
            continue;
        }
        let signal = |name: &str| {
            let place = own.names().iter().position(|known| known == name);
            own.signals()[place.unwrap()]
        };
        let values = ["a.y", "b.y", "c.y"].map(signal);
        assert_eq!(values, [3.0, 6.0, -2.0], "step {step}");
        // A sampled component is called at a sample for the time until the next.
        let steps = step
            + if is_sampled && algorithm != Algorithm::Jacobi {
                2
            } else {
                1
            };
        let x = (-STEP * f64::from(steps)).exp();
        for name in ["a.x", "b.x", "c.x"] {
            assert!(
                (signal(name) - x).abs() < 1e-12,
                "{name} at step {step}: {}",
                signal(name)
            );
        }
    }
    // Where each is called in its order, all of them travel together once they are known.
    if algorithm == Algorithm::GaussSeidel {
        assert_eq!(travelled[4..], [1; 4], "{travelled:?}");
    }
}
