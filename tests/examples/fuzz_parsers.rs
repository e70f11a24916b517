//! Damages sound files of every kind that the program reads and reads them, for as long as is wished:
//!
//! `cargo run --release -p acceptance --example fuzz_parsers -- MINUTES [SEED] [PARSER...]`
//!
//! What panics, takes long, fills the memory or is refused without its file's name is kept in
//! `tests/corpus/found/PARSER/`. What ends the process (a stack that overflows) is in the folder that is
//! printed first.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use acceptance::fuzz::{PARSERS, Parser, corpus, fault, hostile, sound};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A file of some kilobytes needs no more memory, MB.
const MOST_MEMORY: u64 = 512;
/// What takes longer does not end.
const ENDLESS: Duration = Duration::from_secs(120);

/// Since when which file is read.
static NOW: Mutex<Option<(Instant, PathBuf)>> = Mutex::new(None);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let minutes: f64 = arguments.first().map_or(Ok(1.0), |text| text.parse())?;
    let seed: u64 = arguments.get(1).map_or(Ok(1), |text| text.parse())?;
    let wanted = arguments.get(2..).unwrap_or_default();
    let parsers: Vec<&Parser> = PARSERS
        .iter()
        .filter(|parser| wanted.is_empty() || wanted.iter().any(|name| name == parser.name))
        .collect();
    let folder = tempfile::tempdir()?.keep();
    println!("seed {seed}, files in {}", folder.display());
    std::panic::set_hook(Box::new(|info| println!("  {info}")));
    std::thread::spawn(watch);

    let sounds: Vec<_> = parsers.iter().map(|parser| sound(parser)).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut counts: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    let begin = Instant::now();
    let mut number = 0_usize;
    while begin.elapsed().as_secs_f64() < 60.0 * minutes {
        let place = number % parsers.len();
        let (parser, sound) = (parsers[place], &sounds[place]);
        number += 1;
        if sound.is_empty() {
            continue;
        }
        let path = folder.join(format!("{}.{}", parser.name, parser.extension));
        fs::write(&path, hostile(&mut random, sound))?;
        *NOW.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) =
            Some((Instant::now(), path.clone()));
        forget_peak();
        let wrong = fault(parser, &path).or_else(|| {
            let peak = peak()?;
            (peak > MOST_MEMORY).then(|| format!("takes {peak} MB"))
        });
        let count = counts.entry(parser.name).or_default();
        count[0] += 1;
        if let Some(wrong) = wrong {
            count[1] += 1;
            let kept = corpus().join("found").join(parser.name);
            fs::create_dir_all(&kept)?;
            let kept = kept.join(format!("{seed}-{number}.{}", parser.extension));
            fs::copy(&path, &kept)?;
            println!("{}: {wrong}", kept.display());
        }
    }
    println!("{number} files, by parser and faults: {counts:?}");
    fs::remove_dir_all(&folder)?;
    Ok(())
}

/// Ends the process where a file is read without end.
fn watch() {
    loop {
        std::thread::sleep(Duration::from_secs(5));
        let now = NOW.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some((begin, path)) = &*now
            && begin.elapsed() > ENDLESS
        {
            println!("{}: takes more than {ENDLESS:?}", path.display());
            std::process::exit(1);
        }
    }
}

/// The largest memory of this process since [`forget_peak`], MB; none where the system does not tell.
fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes >> 10)
}

fn forget_peak() {
    let file = Path::new("/proc/self/clear_refs");
    // Where the system has none the peak is that of the whole process.
    let _ = fs::write(file, "5");
}
