//! Processes that FMUs start and leave behind. They end with the guest: those of its group by the
//! group, those that left it (daemons) by a mark in the environment that they inherited.

use crate::folder::unique;

/// The variable of the environment that holds the mark.
pub(super) const VARIABLE: &str = "SHAKEBENCH_GUEST";

/// What tells the processes of one guest from all others.
#[derive(Debug)]
pub(super) struct Mark(String);

impl Mark {
    /// A mark that no other guest has.
    pub(super) fn new() -> Self {
        Self(unique())
    }

    pub(super) fn value(&self) -> &str {
        &self.0
    }
}

/// Ends the group that the guest `process` leads, and the processes that bear its mark.
#[cfg(unix)]
pub(super) fn kill(process: u32, mark: &Mark) {
    if let Ok(group) = libc::pid_t::try_from(process)
        && group > 1
    {
        // SAFETY: it sends a signal. The guest leads the group and is waited for afterwards, or its
        // group has the number for as long as a member lives.
        unsafe { libc::kill(-group, libc::SIGKILL) };
    }
    // A process that forks and ends during a look, as daemons do at their beginning, is found by the next.
    let mut is_quiet = false;
    for _ in 0..10 {
        let marked = marked(mark);
        if marked.is_empty() {
            if is_quiet {
                return;
            }
            is_quiet = true;
            continue;
        }
        is_quiet = false;
        for process in marked {
            // SAFETY: it sends a signal to a process that bears the mark.
            unsafe { libc::kill(process, libc::SIGKILL) };
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

/// Processes with the mark in the environment that they began with.
#[cfg(target_os = "linux")]
fn marked(mark: &Mark) -> Vec<libc::pid_t> {
    let entry = format!("{VARIABLE}={}", mark.value());
    let bears = |process: &libc::pid_t| {
        let environment = std::fs::read(format!("/proc/{process}/environ")).unwrap_or_default();
        environment
            .split(|byte| *byte == 0)
            .any(|line| line == entry.as_bytes())
    };
    let own = libc::pid_t::try_from(std::process::id()).unwrap_or(0);
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let processes = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    processes
        .filter(|process| *process > 1 && *process != own)
        .filter(bears)
        .collect()
}

#[cfg(all(unix, not(target_os = "linux")))]
fn marked(_mark: &Mark) -> Vec<libc::pid_t> {
    Vec::new()
}

/// Elsewhere the guest alone is ended.
#[cfg(not(unix))]
pub(super) fn kill(_process: u32, _mark: &Mark) {}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::{CommandExt, ExitStatusExt};
    use std::process::{Child, Command};

    /// A process that sleeps in a group of its own, with this mark.
    fn sleeping(mark: &Mark) -> Child {
        let mut command = Command::new("sleep");
        let command = command.arg("60").env(VARIABLE, mark.value());
        command.process_group(0).spawn().unwrap()
    }

    #[test]
    fn processes_that_bear_the_mark_are_ended_and_no_others() {
        let (own, other) = (Mark::new(), Mark::new());
        assert_ne!(own.value(), other.value());
        let [mut first, mut second] = [&own, &other].map(sleeping);
        // The environment is there once the program has begun.
        while marked(&own).is_empty() || marked(&other).is_empty() {
            std::thread::yield_now();
        }
        assert_eq!(marked(&own), [first.id().cast_signed()]);
        // No group has this number.
        kill(0, &own);
        assert_eq!(first.wait().unwrap().signal(), Some(libc::SIGKILL));
        assert!(second.try_wait().unwrap().is_none() && marked(&own).is_empty());
        // A group ends whatever its members' marks are.
        kill(second.id(), &own);
        assert_eq!(second.wait().unwrap().signal(), Some(libc::SIGKILL));
    }
}
