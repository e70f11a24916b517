//! Runs the program as a user does, within a limit of processor time.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use hidden_effects::score::wilson;
use serde_json::Value;

/// The program and what it may use.
#[derive(Debug, Clone)]
pub struct Judge {
    /// The program.
    pub program: PathBuf,
    /// Seconds of a core after which it is stopped.
    pub limit: u64,
    /// Folder that it runs in; outside of a workspace it compiles no components.
    pub place: PathBuf,
}

/// What a run of the program came to.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Its JSON object, where it printed one.
    pub json: Option<Value>,
    /// Exit status; `None` where it was stopped.
    pub status: Option<i32>,
    /// Last lines of its standard error.
    pub complaint: String,
    /// Seconds of a core, user and system.
    pub seconds: f64,
}

impl Judge {
    /// Runs the program with `arguments`; its output is kept in `folder`. Paths are absolute.
    ///
    /// # Errors
    /// A folder that cannot be written, or no shell.
    pub fn ask(&self, arguments: &[&str], folder: &Path) -> io::Result<Answer> {
        fs::create_dir_all(folder)?;
        let at = |name: &str| folder.join(name);
        let limited = "limit=$1; out=$2; err=$3; shift 3; \
                       (ulimit -t \"$limit\"; exec \"$@\") >\"$out\" 2>\"$err\"; \
                       code=$?; times; exit $code";
        let status = Command::new("sh")
            .args(["-c", limited, "judge", &self.limit.to_string()])
            .args([at("out.json"), at("err.txt")])
            .arg(&self.program)
            .args(arguments)
            .current_dir(&self.place)
            .stdout(File::create(at("times.txt"))?)
            .status()?;
        // The second line is of the shell's children: user, system.
        let seconds = fs::read_to_string(at("times.txt"))?
            .lines()
            .nth(1)
            .map_or(0.0, |line| {
                line.split_whitespace().filter_map(minutes).sum()
            });
        let complaint = fs::read_to_string(at("err.txt")).unwrap_or_default();
        let tail: Vec<&str> = complaint.lines().collect();
        Ok(Answer {
            json: serde_json::from_slice(&fs::read(at("out.json"))?).ok(),
            status: status.code().filter(|code| *code < 128),
            complaint: tail[tail.len().saturating_sub(3)..].join(" | "),
            seconds,
        })
    }
}

/// A share in percent with its Wilson interval.
pub fn share(hits: usize, of: usize) -> String {
    if of == 0 {
        return "none".into();
    }
    let (low, high) = wilson(hits, of);
    format!(
        "{:5.1} % ({hits} of {of}; {:.0} to {:.0})",
        100.0 * hits as f64 / of as f64,
        100.0 * low,
        100.0 * high
    )
}

/// `1m2.5s` in seconds.
fn minutes(text: &str) -> Option<f64> {
    let (minutes, seconds) = text.trim_end_matches('s').split_once('m')?;
    Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_goes_on_is_stopped_and_its_time_is_known() {
        let folder = std::env::temp_dir().join(format!("strangers-{}", std::process::id()));
        let judge = Judge {
            program: "sh".into(),
            limit: 1,
            place: folder.clone(),
        };
        fs::create_dir_all(&folder).expect("a folder");
        let stopped = judge
            .ask(&["-c", "while :; do :; done"], &folder)
            .expect("a shell");
        assert_eq!(stopped.status, None);
        assert!((0.9..2.0).contains(&stopped.seconds), "{}", stopped.seconds);
        let told = judge
            .ask(&["-c", "echo '{\"a\": 1}'; exit 2"], &folder)
            .expect("a shell");
        assert_eq!((told.status, told.json.is_some()), (Some(2), true));
        fs::remove_dir_all(folder).expect("its own folder");
    }
}
