//! How many exchanges of a trial and its force a second go over the loopback, and how long they take:
//!
//! ```sh
//! cargo run --release -p bridges --example exchanges -- [EXCHANGES] [TRIALS]
//! ```
//!
//! The element is a spring, so that the time is that of the connection. Each of EXCHANGES (100,000) sends
//! a trial and asks for its force; after every TRIALS (1) the step is committed.

use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bridges::element::{Element, ElementError, Measured, Trial};
use bridges::protocol::{Action, Matrix, Quantities, Sizes};
use bridges::{Admission, Client, Scale, Server};

/// `f = k u`.
struct Spring {
    measured: Measured,
}

/// Its stiffness, N/m.
const STIFFNESS: f64 = 2.8e3;

impl Element for Spring {
    fn degrees_of_freedom(&self) -> usize {
        1
    }

    fn set_trial(&mut self, trial: &Trial) {
        self.measured.displacement[0] = trial.displacement[0];
        self.measured.force[0] = STIFFNESS * trial.displacement[0];
    }

    fn measure(&mut self) -> Result<&Measured, ElementError> {
        Ok(&self.measured)
    }

    fn commit(&mut self) -> Result<(), ElementError> {
        Ok(())
    }

    fn last(&self) -> &Measured {
        &self.measured
    }

    fn matrix(&self, _matrix: Matrix) -> Option<&[f64]> {
        None
    }
}

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse());
    let exchanges = numbers.next().unwrap_or(Ok(100_000));
    let trials = numbers.next().unwrap_or(Ok(1));
    let (Ok(exchanges), Ok(trials)) = (exchanges, trials) else {
        eprintln!("error: expected [EXCHANGES] [TRIALS]");
        return ExitCode::from(2);
    };
    match measure(exchanges, usize::max(trials, 1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}

fn measure(exchanges: usize, trials: usize) -> Result<(), Box<dyn Error>> {
    let server = Server::bind(([127, 0, 0, 1], 0).into(), Admission::default())?;
    let address = server.address();
    let serving = std::thread::spawn(move || {
        let mut spring = Spring {
            measured: Measured::zeros(1),
        };
        let scale = Scale {
            text: "m,N".to_string(),
            length: 1.0,
            force: 1.0,
        };
        server.serve(&mut spring, &scale, None, &mut |_| {})
    });
    let one = |trial: bool| Quantities {
        displacement: usize::from(trial),
        force: usize::from(!trial),
        ..Quantities::default()
    };
    let sizes = Sizes {
        trial: one(true),
        wanted: one(false),
        // As OpenSees' clients send.
        length: 256,
    };
    let mut client = Client::connect(address, sizes, Duration::from_secs(10))?;
    let mut times = Vec::with_capacity(exchanges);
    let begun = Instant::now();
    for number in 0..exchanges {
        let displacement = 1e-6 * number as f64;
        let at = Instant::now();
        client.send(Action::SetTrial, &[displacement])?;
        let force = client.ask(Action::GetForce)?[0];
        times.push(1e6 * at.elapsed().as_secs_f64());
        if (force - STIFFNESS * displacement).abs() > 1e-12 * force.abs() {
            return Err(format!("the force of {displacement} m came back as {force} N").into());
        }
        if (number + 1) % trials == 0 {
            client.send(Action::Commit, &[])?;
        }
    }
    let took = begun.elapsed().as_secs_f64();
    client.send(Action::End, &[])?;
    let ending = serving.join().map_err(|_| "the server failed")?;
    if let Some(error) = ending.error {
        return Err(error.into());
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{:.0} exchanges a second; median {:.1} us, 99 % {:.1} us, 99.9 % {:.1} us, longest {:.0} us",
        exchanges as f64 / took,
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    );
    Ok(())
}
