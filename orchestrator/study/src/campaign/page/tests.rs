//! The page of a study whose answer is known.

use super::*;
use crate::campaign::analysis::analyse;
use crate::campaign::analysis::tests::{command, settings, study};

fn made(runs: usize) -> (Table, Findings, Report) {
    let (table, settings) = (study(runs, 8, 2), settings());
    let findings = analyse(&table, &settings, &command);
    let about = About {
        title: "A study".into(),
        ..About::default()
    };
    let page = report(&table, &findings, about);
    (table, findings, page)
}

#[test]
fn the_sentence_says_what_came_of_it() {
    let (_, _, page) = made(2000);
    println!("{}", page.summary);
    for part in [
        "mpc stays below",
        "three-variable stays below",
        "of 1,000 runs",
        "Half of the runs exceed 2.00 in of specimen.displacement under mpc at 0.",
        " g of peak ground acceleration",
        "The error depends most on controller: alone",
    ] {
        assert!(page.summary.contains(part), "{}", page.summary);
    }
    let (_, _, none) = made(0);
    assert_eq!(none.summary, "No run.");
}

#[test]
fn shares_have_the_places_they_need() {
    let told = [
        (0, 10),
        (10, 10),
        (1, 3),
        (1, 300),
        (9999, 10_000),
        (299, 300),
    ];
    let told = told.map(|(part, of)| words::percent(part, of));
    assert_eq!(
        told,
        ["0 %", "100 %", "33 %", "0.33 %", "99.99 %", "99.7 %"]
    );
    assert_eq!(
        [7, 1234, 1_234_567].map(words::count),
        ["7", "1,234", "1,234,567"]
    );
}

/// To look at it: SHAKEBENCH_PICTURES=FOLDER.
#[test]
fn a_page_of_ten_thousand_runs_is_small() {
    let (_, _, page) = made(10_000);
    let text = pages::report::html(&page, None).unwrap();
    println!("{} bytes", text.len());
    assert!(text.len() < 500_000);
    if let Some(folder) = std::env::var_os("SHAKEBENCH_PICTURES") {
        std::fs::write(std::path::Path::new(&folder).join("campaign.html"), &text).unwrap();
    }
    let dots: usize = page.sections[0].panels[0]
        .series
        .iter()
        .map(|own| own.values.len())
        .sum();
    assert_eq!(dots, 2000);
}

#[test]
fn few_runs_and_one_controller_make_a_page_too() {
    for runs in [0, 1, 2, 5, 20] {
        let (mut table, settings) = (study(runs, 2, 3), settings());
        table.rows.retain(|row| row[2].text() == Some("mpc"));
        let findings = analyse(&table, &settings, &command);
        let page = report(&table, &findings, About::default());
        assert!(pages::report::html(&page, None).is_ok());
        assert!(!page.summary.is_empty());
        serde_json::to_string(&findings).unwrap();
    }
}
