//! `exchanges.csv`: a row for every step of a client, written while it happens, so that whatever ends the
//! service leaves them.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use bridges::Step;

/// The file's name in the folder of results.
pub const EXCHANGES: &str = "exchanges.csv";

/// The file, row by row.
pub struct Journal {
    file: File,
    row: String,
}

impl Journal {
    /// Begins the file in `folder`.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn create(folder: &Path, degrees_of_freedom: usize) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        let mut file = File::create(folder.join(EXCHANGES))?;
        let mut head = "step,time [s],rig time [s],trials,answer [s]".to_string();
        for quantity in ["trial displacement [m]", "displacement [m]", "force [N]"] {
            let (name, unit) = quantity.split_once(" [").unwrap_or((quantity, ""));
            for i in 1..=degrees_of_freedom {
                let number = match degrees_of_freedom {
                    1 => String::new(),
                    _ => format!(" {i}"),
                };
                head += &format!(",{name}{number} [{unit}");
            }
        }
        writeln!(file, "{head}")?;
        Ok(Self {
            file,
            row: String::new(),
        })
    }

    /// Adds a step.
    ///
    /// # Errors
    /// A disk that is full.
    pub fn add(&mut self, step: &Step<'_>) -> io::Result<()> {
        use std::fmt::Write as _;
        self.row.clear();
        let time = step
            .trial
            .time
            .map_or(String::new(), |time| time.to_string());
        let Step {
            number,
            measured,
            trials,
            ..
        } = step;
        let answer = step.answer.as_secs_f64();
        // Writing to a text does not fail.
        let _ = write!(
            self.row,
            "{number},{time},{},{trials},{answer}",
            measured.time
        );
        let groups = [
            &step.trial.displacement,
            &measured.displacement,
            &measured.force,
        ];
        for value in groups.into_iter().flatten() {
            let _ = write!(self.row, ",{value}");
        }
        self.row.push('\n');
        self.file.write_all(self.row.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bridges::element::{Measured, Trial};
    use std::time::Duration;

    #[test]
    fn every_step_is_a_row_with_its_degrees_of_freedom() {
        let folder = tempfile::tempdir().unwrap();
        let written = |degrees: usize| {
            let mut journal = Journal::create(&folder.path().join("out"), degrees).unwrap();
            let mut trial = Trial {
                displacement: vec![0.5; degrees],
                time: Some(0.25),
                ..Trial::default()
            };
            let measured = Measured {
                displacement: vec![0.25; degrees],
                force: vec![-3.0; degrees],
                time: 1.5,
                ..Measured::default()
            };
            for number in 1..=2 {
                let step = Step {
                    number,
                    trial: &trial,
                    measured: &measured,
                    trials: 4,
                    answer: Duration::from_millis(125),
                };
                journal.add(&step).unwrap();
                trial.time = None;
            }
            std::fs::read_to_string(folder.path().join("out").join(EXCHANGES)).unwrap()
        };
        let head = "step,time [s],rig time [s],trials,answer [s]";
        assert_eq!(
            written(1),
            format!(
                "{head},trial displacement [m],displacement [m],force [N]\n1,0.25,1.5,4,0.125,0.5,0.25,-3\n\
                 2,,1.5,4,0.125,0.5,0.25,-3\n"
            )
        );
        assert_eq!(
            written(2),
            format!(
                "{head},trial displacement 1 [m],trial displacement 2 [m],displacement 1 [m],displacement 2 [m],\
                 force 1 [N],force 2 [N]\n1,0.25,1.5,4,0.125,0.5,0.5,0.25,0.25,-3,-3\n\
                 2,,1.5,4,0.125,0.5,0.5,0.25,0.25,-3,-3\n"
            )
        );
    }
}
