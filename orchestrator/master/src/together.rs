//! Sampled components in one other process that are called at the same tick: their steps travel there
//! together, and what one of them gives flows there to those called after it.

use std::collections::{HashMap, HashSet};

use super::action::{Action, Moment};
use super::signals::Signals;
use super::{Part, comes};
use fmi_import::Wire;

/// Steps that travel together.
#[derive(Debug, PartialEq)]
pub(super) struct Together {
    /// The action before which they are requested.
    pub at: usize,
    /// The parts that are called, in their order.
    parts: Vec<usize>,
}

/// What an action has to do with the signals.
#[derive(Debug, Default)]
struct Role {
    does: Does,
    /// Float64 that drive a Float64 and are converted linearly at most.
    driven: Vec<usize>,
    /// The other signals that it takes.
    others: Vec<usize>,
    /// The Float64 that it gives.
    reals: Vec<usize>,
    /// All that it gives.
    gives: Vec<usize>,
}

#[derive(Debug, Default, Clone, Copy, PartialEq)]
enum Does {
    /// Reads a part.
    Read { part: usize },
    /// Calls a part whose step may travel to that process.
    Call { part: usize, process: usize },
    /// Something else.
    #[default]
    Other,
}

/// Sampled components that may travel together: as the first of them is called, all that drives the others
/// is known, or given by one of them. From then on `actions` begin with those that only read what no call
/// changes.
pub(super) fn plan(actions: &mut Vec<Action>, parts: &[Part]) -> Vec<Together> {
    let roles: Vec<Role> = actions.iter().map(|action| role(action, parts)).collect();
    let order = readings_first(&roles);
    let ordered: Vec<&Role> = order.iter().map(|&at| &roles[at]).collect();
    let all = groups(&ordered);
    if !all.is_empty() {
        let mut before: Vec<Option<Action>> = actions.drain(..).map(Some).collect();
        actions.extend(order.iter().filter_map(|&at| before[at].take()));
    }
    all
}

fn role(action: &Action, parts: &[Part]) -> Role {
    let (does, inputs, outputs) = match action {
        Action::Solve(inner) => {
            return Role {
                gives: inner.signals(parts),
                ..Role::default()
            };
        }
        Action::Read {
            part,
            inputs,
            outputs,
        } => (Does::Read { part: *part }, inputs, outputs),
        Action::Call { part } => {
            let own = &parts[*part];
            let process = own.instance.process();
            let process = process.filter(|_| own.inputs.is_plain(&own.instance));
            let does = process.map_or(Does::Other, |process| Does::Call {
                part: *part,
                process,
            });
            (does, &own.inputs, &own.outputs)
        }
    };
    let reals = outputs.reals();
    Role {
        does,
        driven: inputs.driven().map(|driven| driven.signal).collect(),
        others: inputs.others().collect(),
        reals: reals.map_or(Vec::new(), |(_, first, count)| {
            (first..first + count).collect()
        }),
        gives: outputs.signals().collect(),
    }
}

/// The order in which readings come first that depend on such readings alone, or on what no action gives.
/// Those of one part keep their order.
fn readings_first(roles: &[Role]) -> Vec<usize> {
    let mut waiting: HashSet<usize> = roles.iter().flat_map(|role| role.gives.clone()).collect();
    let (mut waits, mut first, mut later) = (HashSet::new(), Vec::new(), Vec::new());
    for (at, role) in roles.iter().enumerate() {
        let Does::Read { part } = role.does else {
            later.push(at);
            continue;
        };
        let mut takes = role.driven.iter().chain(&role.others);
        if waits.contains(&part) || takes.any(|signal| waiting.contains(signal)) {
            waits.insert(part);
            later.push(at);
            continue;
        }
        first.push(at);
        for signal in &role.gives {
            waiting.remove(signal);
        }
    }
    first.extend(later);
    first
}

/// Calls in one process so far, to which others may be added.
struct Open {
    group: usize,
    /// The Float64 that they give.
    reals: HashSet<usize>,
    /// What can be known only after they have been made.
    later: HashSet<usize>,
}

impl Open {
    fn takes(&self, role: &Role) -> bool {
        let is_later = |signal: &usize| self.later.contains(signal);
        let is_given = |signal: &usize| self.reals.contains(signal);
        !role.driven.iter().any(is_later)
            && !role.others.iter().any(|it| is_later(it) || is_given(it))
    }

    fn add(&mut self, role: &Role) {
        self.reals.extend(&role.reals);
        let others = role.gives.iter().filter(|it| !role.reals.contains(it));
        self.later.extend(others);
    }
}

fn groups(roles: &[&Role]) -> Vec<Together> {
    let mut all: Vec<Together> = Vec::new();
    let mut open: HashMap<usize, Open> = HashMap::new();
    for (at, role) in roles.iter().enumerate() {
        let own = match role.does {
            Does::Call { part, process } => {
                let joins = open.get(&process).is_some_and(|open| open.takes(role));
                if !joins {
                    let (reals, later) = (HashSet::new(), HashSet::new());
                    let group = all.len();
                    let parts = Vec::new();
                    all.push(Together { at, parts });
                    open.insert(
                        process,
                        Open {
                            group,
                            reals,
                            later,
                        },
                    );
                }
                if let Some(open) = open.get_mut(&process) {
                    all[open.group].parts.push(part);
                    open.add(role);
                }
                Some(process)
            }
            Does::Read { .. } | Does::Other => None,
        };
        let others = open
            .iter_mut()
            .filter(|(process, _)| own != Some(**process));
        for (_, open) in others {
            open.later.extend(&role.gives);
        }
    }
    all.retain(|together| together.parts.len() > 1);
    all
}

impl Together {
    /// Requests the steps that are due, as far as they may travel together; the others are called each by
    /// itself.
    pub(super) fn request(&self, at: Moment, parts: &mut [Part], signals: &Signals) {
        let is_ready = |part: &Part| {
            part.failure.is_none() && part.ended.is_none() && part.instance.is_settled()
        };
        if !self.parts.iter().all(|&part| is_ready(&parts[part])) {
            return;
        }
        // What will be read after the steps so far: first signal, how many, and the number of the reading.
        let mut given: Vec<(usize, usize, Option<usize>)> = Vec::new();
        for &part in &self.parts {
            let part = &mut parts[part];
            let Some(every) = part.every.filter(|every| comes(at.tick, *every)) else {
                continue;
            };
            let mut wires = Vec::new();
            for driven in part.inputs.driven() {
                let from = given
                    .iter()
                    .find(|(first, count, _)| (*first..first + count).contains(&driven.signal));
                match from {
                    None => {}
                    Some((.., None)) => return,
                    Some((first, _, Some(reading))) => wires.push(Wire {
                        reading: *reading,
                        element: driven.signal - first,
                        place: driven.place,
                        change: driven.change,
                    }),
                }
            }
            // A setting that fails fails again when its part is called.
            if part.inputs.transfer(signals, &mut part.instance).is_err() {
                return;
            }
            let (read, first, count) = part.outputs.reals().unwrap_or((&[], 0, 0));
            let step = (at.time, every as f64 * at.step, part.is_timed());
            let requested = part
                .instance
                .request_wired_step(step, &wires, (read, count));
            let Some(reading) = requested else {
                return;
            };
            part.is_requested = true;
            given.push((first, count, reading));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn call(part: usize, process: usize, driven: &[usize], gives: &[usize]) -> Role {
        Role {
            does: Does::Call { part, process },
            driven: driven.to_vec(),
            reals: gives.to_vec(),
            gives: gives.to_vec(),
            ..Role::default()
        }
    }

    fn read(part: usize, driven: &[usize], gives: &[usize]) -> Role {
        Role {
            does: Does::Read { part },
            ..call(0, 0, driven, gives)
        }
    }

    fn together(roles: &[Role]) -> Vec<Together> {
        groups(&roles.iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_chain_of_calls_travels_as_one_and_what_others_compute_in_between_parts_it() {
        let chain = [
            call(0, 7, &[100], &[0]),
            call(1, 7, &[0], &[1]),
            call(2, 7, &[0, 1], &[2]),
        ];
        let whole = [Together {
            at: 0,
            parts: vec![0, 1, 2],
        }];
        assert_eq!(together(&chain), whole);
        // The second takes what a call in this process computes from the first.
        let elsewhere = Role {
            driven: vec![0],
            gives: vec![5],
            ..Role::default()
        };
        let parted = [
            call(0, 7, &[], &[0]),
            elsewhere,
            call(1, 7, &[5], &[1]),
            call(2, 7, &[1, 0], &[2]),
        ];
        let rest = [Together {
            at: 2,
            parts: vec![1, 2],
        }];
        assert_eq!(together(&parted), rest);
    }

    #[test]
    fn processes_do_not_wait_for_each_other_and_single_calls_are_left_alone() {
        let roles = [
            call(0, 7, &[], &[0]),
            call(1, 8, &[], &[1]),
            call(2, 7, &[0], &[2]),
            // Of what the other process gives after the group has begun.
            call(3, 7, &[1], &[3]),
        ];
        let pair = [Together {
            at: 0,
            parts: vec![0, 2],
        }];
        assert_eq!(together(&roles), pair);
    }

    #[test]
    fn what_does_not_flow_as_a_number_parts_a_group() {
        let mut taker = call(1, 7, &[], &[1]);
        taker.others = vec![0];
        assert_eq!(together(&[call(0, 7, &[], &[0]), taker]), []);
        // A Boolean of the first drives the second.
        let mut giver = call(0, 7, &[], &[0]);
        giver.gives.push(9);
        assert_eq!(together(&[giver, call(1, 7, &[9], &[1])]), []);
    }

    #[test]
    fn readings_come_first_that_wait_for_no_call() {
        let roles = [
            call(0, 7, &[4], &[0]),
            read(1, &[], &[1]),
            read(1, &[0], &[2]),
            // After the reading before, of the same part.
            read(1, &[], &[3]),
            read(2, &[1], &[4]),
            read(3, &[2], &[5]),
        ];
        assert_eq!(readings_first(&roles), [1, 4, 0, 2, 3, 5]);
    }
}
