//! How long a step of four FMUs in a process of their own takes, on a quiet and on a busy machine:
//!
//! ```sh
//! cargo run --release -p fmi-import --example isolation -- MODEL.fmu [STEPS] [BUSY]
//! ```
//!
//! In each step every instance gets its first Float64 input, steps by 1 ms and gives its first Float64
//! output. BUSY processes (12) compute without end meanwhile. Prints quantiles in microseconds.

use std::error::Error;
use std::path::Path;
use std::process::{Child, Command, ExitCode};
use std::time::Instant;

use fmi_import::{Causality, Fmu, Instance, Isolation, Kind, Options, Processes, isolation};

const STEP: f64 = 1e-3;
const INSTANCES: usize = 4;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        [isolation::COMMAND, frame] => return isolation::guest(Path::new(frame)),
        ["busy"] => loop {
            std::hint::spin_loop();
        },
        [fmu] => compare(Path::new(fmu), 20_000, 12),
        [fmu, steps] => compare(Path::new(fmu), steps.parse().unwrap_or(20_000), 12),
        [fmu, steps, busy] => compare(
            Path::new(fmu),
            steps.parse().unwrap_or(20_000),
            busy.parse().unwrap_or(12),
        ),
        _ => Err("expected MODEL.fmu [STEPS] [BUSY]".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn compare(fmu: &Path, steps: usize, busy: usize) -> Result<(), Box<dyn Error>> {
    println!("busy processes   10 %      50 %      90 %      99 %   mean, us per step");
    for busy in [0, busy] {
        let _busy = Busy::start(busy)?;
        let mut times = measure(fmu, steps)?;
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        println!(
            "{busy:14} {:9.2} {:9.2} {:9.2} {:9.2} {mean:9.2}",
            at(0.1),
            at(0.5),
            at(0.9),
            at(0.99)
        );
    }
    Ok(())
}

/// Seconds in millionths of each of so many steps.
fn measure(fmu: &Path, steps: usize) -> Result<Vec<f64>, Box<dyn Error>> {
    let fmu = Fmu::open(fmu)?;
    let reference = |causality: Causality| {
        let variables = &fmu.description.variables;
        let mut all = fmu.description.of(causality);
        let found = all.find(|&at| variables[at].kind == Kind::Float64);
        found.map(|at| variables[at].reference)
    };
    let (input, output) = (reference(Causality::Input), reference(Causality::Output));
    let options = Options {
        isolation: Isolation::All,
        guest: Some(std::env::current_exe()?),
        ..Options::default()
    };
    let mut processes = Processes::new(&options);
    let mut instances = Vec::new();
    for number in 0..INSTANCES {
        let name = format!("part_{number}");
        let mut instance = Instance::within(&fmu, &name, &mut processes, false)?;
        instance.enter_initialization(0.0, steps as f64 * STEP)?;
        instance.exit_initialization()?;
        instances.push(instance);
    }
    let mut values = [0.0];
    let mut times = Vec::with_capacity(steps);
    for tick in 0..steps {
        let begin = Instant::now();
        for instance in &mut instances {
            if let Some(input) = input {
                instance.set(&Kind::Float64, &[input], &values)?;
            }
        }
        let time = tick as f64 * STEP;
        let mut requested = [false; INSTANCES];
        for (instance, requested) in instances.iter_mut().zip(&mut requested) {
            *requested = instance.request_step(time, STEP, false);
            if !*requested {
                instance.do_step(time, STEP)?;
            }
        }
        for (instance, _) in instances
            .iter_mut()
            .zip(requested)
            .filter(|(_, asked)| *asked)
        {
            instance.finish_step()?;
        }
        for instance in &mut instances {
            if let Some(output) = output {
                instance.get(&Kind::Float64, &[output], &mut values)?;
            }
        }
        times.push(1e6 * begin.elapsed().as_secs_f64());
    }
    Ok(times)
}

/// Processes that compute without end, for as long as this lives.
struct Busy(Vec<Child>);

impl Busy {
    fn start(count: usize) -> std::io::Result<Self> {
        let program = std::env::current_exe()?;
        let mut busy = Self(Vec::new());
        for _ in 0..count {
            busy.0.push(Command::new(&program).arg("busy").spawn()?);
        }
        Ok(busy)
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
