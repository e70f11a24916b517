//! Draws the pictures of `docs/hybrid-simulation.md`: tracking and synchronisation subspace of the
//! benchmark's sample controller and of the best one, on the built-in motion.

use std::fs;
use std::path::Path;

use hybrid::vrths::{BenchmarkCase, InteractionForm};
use hybrid_benchmark::vrths::outcome::Outcome;
use hybrid_benchmark::vrths::study::{Plants, Study};
use hybrid_benchmark::vrths::{motions, page, roster};
use pages::report::{UnitSystem, svg};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let names = [roster::SAMPLE, roster::BEST];
    let study = Study {
        cases: vec![BenchmarkCase::new(1)?],
        motions: motions::motions(&["built-in".to_string()], None, motions::INTENSITY)?,
        controllers: names
            .iter()
            .filter_map(|name| roster::entry(name))
            .collect(),
        plants: Plants::Drawn(0),
        form: InteractionForm::TransferFunction,
        seed: 1,
    };
    let outcome = Outcome::of(&study, None, None, || ())?;
    let report = page::report(&outcome, &page::pictures(&study)?);
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let panels = report.sections.iter().flat_map(|section| &section.panels);
    let files = [
        "tracking_sample",
        "tracking_best",
        "subspace_sample",
        "subspace_best",
    ];
    for (panel, file) in panels.zip(files) {
        fs::write(
            docs.join(format!("hybrid_{file}.svg")),
            svg(panel, UnitSystem::Us),
        )?;
    }
    Ok(())
}
