//! Options of the judges: `--name value`, numbers or texts.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::judge::Judge;

fn absolute(text: &str) -> PathBuf {
    std::path::absolute(text).unwrap_or_else(|_| PathBuf::from(text))
}

/// The options of a command line.
#[derive(Debug, Clone, Default)]
pub struct Options(BTreeMap<String, String>);

impl Options {
    /// Those of this process; what is not one of `known` is refused.
    ///
    /// # Errors
    /// An unknown option or one without a value.
    pub fn read(known: &[&str]) -> Result<Self, String> {
        let mut options = BTreeMap::new();
        let mut rest = std::env::args().skip(1);
        while let Some(name) = rest.next() {
            let key = name.trim_start_matches("--").to_string();
            if !known.contains(&key.as_str()) {
                return Err(format!(
                    "`{name}` is unknown; expected one of --{}",
                    known.join(", --")
                ));
            }
            let value = rest
                .next()
                .ok_or_else(|| format!("`{name}` needs a value"))?;
            options.insert(key, value);
        }
        Ok(Self(options))
    }

    /// A text.
    pub fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    /// A number, or `otherwise`.
    ///
    /// # Errors
    /// What is not a number.
    pub fn number(&self, name: &str, otherwise: u64) -> Result<u64, String> {
        self.text(name).map_or(Ok(otherwise), |text| {
            text.parse()
                .map_err(|_| format!("--{name} {text}: expected a whole number"))
        })
    }

    /// Which of several numbers are those of `--shard i/n`.
    ///
    /// # Errors
    /// What is not a shard.
    pub fn shard(&self) -> Result<impl Fn(u64) -> bool + use<>, String> {
        let text = self.text("shard").unwrap_or("1/1");
        let parts = text
            .split_once('/')
            .and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let Some((part, of)) = parts.filter(|(part, of): &(u64, u64)| (1..=*of).contains(part))
        else {
            return Err(format!("--shard {text}: expected a part such as 1/4"));
        };
        Ok(move |number| number % of == part - 1)
    }

    /// The judge that they ask for.
    ///
    /// # Errors
    /// A limit that is not a number.
    pub fn judge(&self, limit: u64) -> Result<Judge, String> {
        Ok(Judge {
            program: self
                .path("program")
                .unwrap_or(absolute("target/release/shakebench")),
            limit: self.number("limit", limit)?,
            place: std::env::temp_dir(),
        })
    }

    /// A path, absolute.
    pub fn path(&self, name: &str) -> Option<PathBuf> {
        self.text(name).map(absolute)
    }

    /// The folder of `--out`, or one that is this process's own.
    pub fn scratch(&self) -> PathBuf {
        let own = format!("strangers-{}", std::process::id());
        self.path("out")
            .unwrap_or_else(|| std::env::temp_dir().join(own))
    }
}
