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

fn as_before(name: &str, text: &str) {
    expected::compare(env!("CARGO_MANIFEST_DIR"), name, text);
}

#[test]
fn every_sentence_table_and_plot_of_a_page_is_as_before() {
    use pages::report::UnitSystem;
    let (table, findings, page) = made(300);
    as_before("page-us.txt", &expected::text_of(&page, UnitSystem::Us));
    let about = About {
        title: "A study".into(),
        units: UnitSystem::Si,
        ..About::default()
    };
    let page = report(&table, &findings, about);
    as_before("page-si.txt", &expected::text_of(&page, UnitSystem::Si));
    // Dots of a picture are drawn from all runs.
    let (_, _, many) = made(3000);
    let scatter = &many.sections[0].panels[0];
    as_before("scatter.txt", &expected::plot(scatter));
}

#[test]
fn runs_that_could_not_begin_and_shared_points_have_sections_of_their_own() {
    use crate::campaign::analysis::{Invalid, Pair, Ranking, Spread, Standing};
    use pages::report::UnitSystem;
    let (table, mut findings, _) = made(40);
    findings.invalid = vec![
        Invalid {
            runs: 1200,
            first: 3,
            reason: "`table`: a mass of -1 kg.".into(),
        },
        Invalid {
            runs: 1,
            first: 17,
            reason: "no motion".into(),
        },
    ];
    let spread = |p5, p50, p95| Spread { p5, p50, p95 };
    let standing = |value: &str, motion: &str, counts: [usize; 3], error_percent| Standing {
        value: value.into(),
        among: vec![motion.into()],
        complete: counts[0],
        tripped: counts[1],
        failed: counts[2],
        error_percent,
    };
    findings.ranking = Some(Ranking {
        factor: "controller".into(),
        among: vec!["plant".into()],
        points: 20,
        standings: vec![
            standing(
                "mpc",
                "thesis",
                [20, 0, 0],
                spread(Some(1.0), Some(2.0), Some(3.456)),
            ),
            standing(
                "lqg",
                "thesis",
                [18, 1, 1],
                spread(Some(1.5), Some(2.5), None),
            ),
            standing(
                "mpc",
                "modern",
                [20, 0, 0],
                spread(Some(0.5), Some(1.0), Some(2.0)),
            ),
            standing("lqg", "modern", [2, 10, 8], spread(None, None, None)),
        ],
        pairs: vec![
            Pair {
                among: vec!["thesis".into()],
                better: "mpc".into(),
                worse: "lqg".into(),
                part: 0.875,
                difference_percent: [0.25, f64::INFINITY],
            },
            Pair {
                among: vec!["modern".into()],
                better: "mpc".into(),
                worse: "lqg".into(),
                part: 0.5,
                difference_percent: [f64::NEG_INFINITY, 0.75],
            },
        ],
    });
    let page = report(&table, &findings, About::default());
    let shown: Vec<&str> = page.sections.iter().map(|own| &*own.heading).collect();
    assert!(shown.contains(&"On the same points") && shown.contains(&"Runs that could not begin"));
    let page = Report {
        sections: page
            .sections
            .into_iter()
            .filter(|own| {
                ["On the same points", "Runs that could not begin"].contains(&&*own.heading)
            })
            .collect(),
        facts: Vec::new(),
        ..page
    };
    as_before(
        "page-sections.txt",
        &expected::text_of(&page, UnitSystem::Us),
    );
}

#[test]
fn columns_have_names_in_words_and_the_units_of_their_endings() {
    let labels = [
        "frequency_domain_percent",
        "displacement_percent",
        "peak_displacement_error_m",
        "peak_acceleration_m_s2",
        "peak_acceleration_error_m_s2",
        "pga_g",
        "peak_reference_m",
        "peak.table.force",
        "other",
    ];
    assert_eq!(
        labels.map(words::label),
        [
            "Fourier amplitude error",
            "displacement error",
            "peak displacement error",
            "peak acceleration",
            "peak acceleration error",
            "peak ground acceleration",
            "peak displacement of the reference",
            "peak of table.force",
            "other",
        ]
    );
    let unit = |column, unit| {
        words::units(column, unit)
            .unit(UnitSystem::Si)
            .1
            .to_string()
    };
    assert_eq!(
        [
            unit("a_percent", None),
            unit("a_m_s2", Some("")),
            unit("a_g", Some("1")),
            unit("a_m", None),
            unit("a_s", None),
            unit("a", None),
            unit("a_s", Some("N")),
        ],
        ["%", "g", "g", "mm", "s", "", "kN"]
    );
    assert_eq!(
        (words::capital("größe"), words::capital("")),
        ("Größe".into(), String::new())
    );
}

#[test]
fn a_limit_without_a_curve_says_why() {
    use crate::campaign::analysis::{Fit, Fragility, Why};
    let (_, findings, _) = made(40);
    let told = |fit, controller: Option<&str>, limit: Option<&str>| {
        let own = Fragility {
            limit: limit.map(str::to_string),
            controller: controller.map(str::to_string),
            column: limit.map(|name| format!("peak.{name}")),
            unit: limit.map(|_| "m".to_string()),
            above: limit.map(|_| 0.0508),
            runs: 1234,
            exceeded: 12,
            fit,
            ..findings.fragility[0].clone()
        };
        let findings = Findings {
            fragility: vec![own],
            ..findings.clone()
        };
        words::without_curve(&findings, UnitSystem::Us).join("|")
    };
    let between = [0.25, 0.5];
    assert_eq!(
        told(
            Fit::Separated { between },
            Some("mpc"),
            Some("specimen.drift")
        ),
        "specimen.drift above 2.00 in, mpc: all runs up to 0.250 stay within the limit, all from 0.500 on exceed it: \
         no curve, because the likelihood has no maximum."
    );
    assert_eq!(
        told(
            Fit::Never {
                share_below: 0.0123
            },
            None,
            None
        ),
        "Stopped by the interlock: none of 1,234 runs; with 95 % confidence fewer than 1.2 % exceed it."
    );
    assert_eq!(
        told(Fit::Always { share_above: 0.987 }, None, None),
        "Stopped by the interlock: all of 1,234 runs; with 95 % confidence more than 99 % exceed it."
    );
    let none = |why| told(Fit::None { why }, None, None);
    assert_eq!(none(Why::NoRuns), "Stopped by the interlock: no run tells.");
    assert_eq!(
        none(Why::SameIntensity),
        "Stopped by the interlock: no curve: the runs have no peak ground acceleration, or all have the same."
    );
    assert_eq!(
        none(Why::DoesNotGrow),
        "Stopped by the interlock: 12 of 1,234 runs, but the share does not grow with peak ground acceleration: no curve."
    );
    let curve = findings
        .fragility
        .iter()
        .find(|own| matches!(own.fit, Fit::Lognormal(_)));
    let findings = Findings {
        fragility: curve.into_iter().cloned().collect(),
        ..findings.clone()
    };
    assert!(words::without_curve(&findings, UnitSystem::Us).is_empty());
}

#[test]
fn errors_far_above_their_median_are_drawn_on_a_logarithmic_axis() {
    let (mut table, settings) = (study(40, 2, 3), settings());
    let axis = |table: &Table| {
        let findings = analyse(table, &settings, &command);
        let panel = pictures::scatter(table, &findings).unwrap();
        panel.y.logarithmic
    };
    assert!(!axis(&table));
    let error = table.place("time_domain_percent").unwrap();
    table.rows[2][error] = 500.0.into();
    assert!(axis(&table));
    table.rows.clear();
    let findings = analyse(&table, &settings, &command);
    assert!(pictures::scatter(&table, &findings).is_none());
    assert!(pictures::errors(&findings).is_none());
}
