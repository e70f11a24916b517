//! What is read after the steps of FMUs in other processes, told to these before. Where connections among
//! them lead from output to input at the same time, the reading of a whole chain travels with the steps.

use std::collections::HashMap;

use super::Part;
use super::action::Action;
use super::transfer::Driven;
use fmi_import::{Kind, Wire};

/// A number that is read, by the process and the signal: which reading, and which of its values.
type Known = HashMap<(usize, usize), (usize, usize)>;

/// A reading of a part, with what is set before it.
struct Planned<'a> {
    part: usize,
    set: &'a [u32],
    values: &'a [f64],
    driven: Vec<Driven>,
    kind: &'a Kind,
    read: &'a [u32],
    first: usize,
    count: usize,
}

/// Tells the processes of the parts what the actions will set and read.
pub(super) fn foresee(parts: &mut [Part], actions: &[Action]) {
    let mut planned = Vec::new();
    let mut known = Known::new();
    // Whose later readings come after something that is not foreseen.
    let mut done = vec![false; parts.len()];
    // A process gains something where a value goes from one reading to another.
    let mut gains = Vec::new();
    for action in actions {
        let Action::Read {
            part,
            inputs,
            outputs,
        } = action
        else {
            continue;
        };
        let Some(process) = parts[*part].instance.process() else {
            continue;
        };
        let driven = inputs.foreseen().filter(|_| !done[*part]);
        let driven = driven.filter(|(.., driven)| {
            let mut signals = driven.iter().map(|it| (process, it.signal));
            signals.all(|signal| known.contains_key(&signal))
        });
        let Some((set, values, driven)) = driven else {
            done[*part] = true;
            continue;
        };
        if !driven.is_empty() {
            gains.push(process);
        }
        let mut before = Some((set, values, driven));
        for (kind, read, first, count) in outputs.readings() {
            if *kind == Kind::Clock {
                done[*part] = true;
                break;
            }
            let (set, values, driven) = before.take().unwrap_or_default();
            let wired = if *kind == Kind::Float64 { count } else { 0 };
            for element in 0..wired {
                known.insert((process, first + element), (usize::MAX, 0));
            }
            planned.push(Planned {
                part: *part,
                set,
                values,
                driven,
                kind,
                read,
                first,
                count,
            });
        }
        done[*part] |= before.is_some() || outputs.has_exact();
    }
    for it in planned {
        let instance = &mut parts[it.part].instance;
        let Some(process) = instance.process().filter(|own| gains.contains(own)) else {
            continue;
        };
        let wires = it.driven.iter().filter_map(|driven| {
            let (reading, element) = *known.get(&(process, driven.signal))?;
            Some(Wire {
                reading,
                element,
                place: driven.place,
                change: driven.change,
            })
        });
        let wires: Vec<Wire> = wires.collect();
        let read = (it.kind, it.read, it.count);
        let Some(reading) = instance.foresee((it.set, it.values, &wires), read) else {
            continue;
        };
        if *it.kind != Kind::Float64 {
            continue;
        }
        for element in 0..it.count {
            known.insert((process, it.first + element), (reading, element));
        }
    }
}
