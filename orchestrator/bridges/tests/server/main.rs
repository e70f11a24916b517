//! The server from outside: what it answers, and what it says to those that do it wrong.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    reason = "a test fails where it unwraps nothing"
)]

mod clients;
mod wrong;

use std::io::Read;
use std::net::{SocketAddr, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use bridges::element::{
    Command, Element, Ideal, Interval, Matrices, Measured, Moves, Rig, RigError, Shape, Stepwise,
};
use bridges::protocol::{Action, Quantities, Sizes};
use bridges::{Admission, Client, Ending, Event, Scale, Server};

/// Stiffness of the springs, N/m.
pub const STIFFNESS: f64 = 2.8e3;
/// The rigs' step, s.
pub const STEP: f64 = 0.002;

/// A client that is refused gets no numbers from then on, whatever it asks for, and may take its leave.
pub fn is_dismissed(mut client: Client, action: Action) {
    for action in [action, Action::GetForce, Action::GetDisplacement] {
        let numbers = client.ask(action).unwrap();
        assert!(numbers.iter().all(|number| number.is_nan()), "{numbers:?}");
    }
    client.send(Action::End, &[]).unwrap();
}

/// Springs that yield with kinematic hardening; what is passed is remembered.
#[derive(Debug, Clone)]
pub struct Springs {
    /// Largest elastic force, N.
    yields_at: f64,
    now: State,
    kept: Option<State>,
    /// Steps since the beginning that were not taken back.
    pub ticks: usize,
    kept_ticks: usize,
}

#[derive(Debug, Clone, PartialEq)]
struct State {
    displacement: Vec<f64>,
    plastic: Vec<f64>,
}

impl Springs {
    pub fn new(degrees_of_freedom: usize, yields_at: f64) -> Self {
        let zeros = vec![0.0; degrees_of_freedom];
        Self {
            yields_at,
            now: State {
                displacement: zeros.clone(),
                plastic: zeros,
            },
            kept: None,
            ticks: 0,
            kept_ticks: 0,
        }
    }

    /// Return mapping of an elastic, perfectly plastic spring.
    pub fn force(displacement: f64, plastic: &mut f64, yields_at: f64) -> f64 {
        let trial = STIFFNESS * (displacement - *plastic);
        let force = trial.clamp(-yields_at, yields_at);
        if trial != force {
            *plastic = displacement - force / STIFFNESS;
        }
        force
    }
}

impl Rig for Springs {
    fn degrees_of_freedom(&self) -> usize {
        self.now.displacement.len()
    }

    fn step(&self) -> f64 {
        STEP
    }

    fn advance(&mut self, command: &Command) -> Result<(), RigError> {
        self.ticks += 1;
        self.place(command)
    }

    fn place(&mut self, command: &Command) -> Result<(), RigError> {
        self.now.displacement.clone_from(&command.displacement);
        for (x, plastic) in self.now.displacement.iter().zip(&mut self.now.plastic) {
            Self::force(*x, plastic, self.yields_at);
        }
        Ok(())
    }

    fn measure(&self, into: &mut Measured) {
        into.displacement.clone_from(&self.now.displacement);
        into.force.clear();
        for (x, plastic) in self.now.displacement.iter().zip(&self.now.plastic) {
            into.force
                .push(Self::force(*x, &mut plastic.clone(), self.yields_at));
        }
        into.time = self.ticks as f64 * STEP;
    }

    fn save(&mut self) -> Result<(), RigError> {
        self.kept = Some(self.now.clone());
        self.kept_ticks = self.ticks;
        Ok(())
    }

    fn restore(&mut self) -> Result<(), RigError> {
        self.now = self.kept.clone().ok_or("nothing is kept")?;
        self.ticks = self.kept_ticks;
        Ok(())
    }
}

pub fn matrices() -> Matrices {
    Matrices {
        stiffness: Some(vec![STIFFNESS]),
        ..Matrices::default()
    }
}

pub fn ideal() -> Ideal<Springs> {
    let springs = Springs::new(1, 1e9);
    Ideal::new(springs, Interval::default(), Shape::Ramp, matrices()).unwrap()
}

pub fn stepwise(moves: Moves) -> Stepwise<Springs> {
    let springs = Springs::new(1, 1e9);
    Stepwise::new(springs, Interval::default(), Shape::Ramp, moves, matrices())
}

/// What OpenSees' `genericClient` with one degree of freedom was seen to say.
pub fn sizes() -> Sizes {
    Sizes {
        trial: Quantities {
            displacement: 1,
            velocity: 1,
            acceleration: 1,
            time: 1,
            ..Quantities::default()
        },
        wanted: Quantities {
            force: 1,
            ..Quantities::default()
        },
        length: 256,
    }
}

/// A server in a thread of its own.
pub struct Served {
    pub address: SocketAddr,
    pub said: Receiver<String>,
    thread: JoinHandle<Ending>,
}

impl Served {
    pub fn by<E: Element>(make: impl FnOnce() -> E + Send + 'static, admission: Admission) -> Self {
        let server = Server::bind(([127, 0, 0, 1], 0).into(), admission).unwrap();
        let address = server.address();
        let (tell, said) = channel();
        let thread = std::thread::spawn(move || {
            let mut element = make();
            let scale = Scale::read("m,N").unwrap();
            server.serve(&mut element, &scale, None, &mut |event| {
                let line = match event {
                    Event::Connected { .. } => "connected".to_string(),
                    Event::TurnedAway { reason, .. } => reason.to_string(),
                    Event::Step(step) => format!("step {}", step.number),
                };
                let _ = tell.send(line);
            })
        });
        Self {
            address,
            said,
            thread,
        }
    }

    pub fn ideal() -> Self {
        Self::by(ideal, quick())
    }

    pub fn ending(self) -> Ending {
        self.thread.join().unwrap()
    }

    /// What ended it, as text.
    pub fn error(self) -> String {
        self.ending().error.unwrap().to_string()
    }

    pub fn raw(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        stream
    }
}

/// Time limits that a test can wait for.
pub fn quick() -> Admission {
    Admission {
        silence: Duration::from_millis(400),
        set_up: Duration::from_millis(400),
        ..Admission::default()
    }
}

pub fn read_all(mut stream: TcpStream) -> String {
    let mut bytes = Vec::new();
    // A reset after the last word does not take it back.
    let _ = stream.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}
