//! Studies whose answer is known.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::campaign::table::{Cell, Column, Kind, Role};

/// The columns of a study of a controller, a motion and a scale.
fn columns() -> Vec<Column> {
    let column = |name: &str, unit: Option<&str>, role, kind| Column {
        name: name.to_string(),
        unit: unit.map(str::to_string),
        role,
        kind,
    };
    use Kind::{Number, Text};
    use Role::{Ending, Factor, Result, Run};
    vec![
        column("number", None, Run, Number),
        column("run", None, Run, Text),
        column("controller", None, Factor, Text),
        column("record", None, Factor, Text),
        column("scale", None, Factor, Number),
        column("specimen.stiffness", Some("N/m"), Factor, Number),
        column("table.bulk_modulus", Some("Pa"), Factor, Number),
        column("pga_g", None, Result, Number),
        column("peak_reference_m", Some("m"), Result, Number),
        column("time_domain_percent", None, Result, Number),
        column("peak_displacement_m", Some("m"), Result, Number),
        column("delay_s", Some("s"), Result, Number),
        column("peak.specimen.displacement", Some("m"), Result, Number),
        column("ended", None, Ending, Text),
        column("ended_s", Some("s"), Ending, Number),
        column("reason", None, Ending, Text),
    ]
}

/// Runs whose specimen exceeds 2 in with a median of 0.5 g under `mpc`, of 0.35 g under `three-variable`, and
/// a dispersion of 0.4, of which 0.2 is between motions.
pub(crate) fn study(runs: usize, motions: usize, seed: u64) -> Table {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = |random: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(random) };
    let between: Vec<f64> = (0..motions).map(|_| 0.2 * normal(&mut random)).collect();
    let within = (0.4_f64.powi(2) - 0.2_f64.powi(2)).sqrt();
    let rows = (0..runs).map(|number| {
        let is_mpc = number % 2 == 0;
        let motion = random.random_range(0..motions);
        let scale = 0.1 + 0.9 * random.random::<f64>();
        let stiffness = 14_000.0 + 7_000.0 * random.random::<f64>();
        let modulus = 1.4e9 + 7e7 * normal(&mut random);
        let pga = 1.1 * scale;
        let median: f64 = if is_mpc { 0.5 } else { 0.35 };
        let noise = between[motion] + within * normal(&mut random);
        let peak = 0.0508 * pga / median * noise.exp();
        let error =
            (if is_mpc { 2.0 } else { 4.0 }) + 3.0 * scale.powi(2) + 1e-4 * (stiffness - 14_000.0);
        let stops = !is_mpc && pga > 0.95;
        let fails = number % 97 == 13;
        let (ended, at, reason) = match (fails, stops) {
            (true, _) => ("failed", 0.4, "specimen: the run ran away"),
            (_, true) => ("interlock", 3.2, "the table left its reference"),
            _ => ("complete", 10.0, ""),
        };
        let told = |value: f64| if fails { Cell::Missing } else { value.into() };
        vec![
            (number as f64).into(),
            format!("{number:08x}").into(),
            (if is_mpc { "mpc" } else { "three-variable" }).into(),
            format!("RSN{}.AT2", 100 + motion).into(),
            scale.into(),
            stiffness.into(),
            modulus.into(),
            told(pga),
            told(0.03 * scale),
            told(error),
            told(0.03 * scale),
            told(0.012),
            told(peak),
            ended.into(),
            at.into(),
            if reason.is_empty() {
                Cell::Missing
            } else {
                reason.into()
            },
        ]
    });
    Table {
        rows: rows.collect(),
        columns: columns(),
    }
}

pub(crate) fn settings() -> Settings {
    Settings {
        intensity: "pga_g".to_string(),
        limits: vec![Limit {
            name: "specimen.displacement".to_string(),
            column: "peak.specimen.displacement".to_string(),
            above: 0.0508,
        }],
        design: Design::Other,
        ranked: None,
        seed: 1,
    }
}

pub(crate) fn command(number: usize) -> String {
    format!("shakebench run mpc --seed {number}")
}

fn lognormal(found: &Fragility) -> &Lognormal {
    match &found.fit {
        Fit::Lognormal(own) => own,
        other => panic!("{other:?}"),
    }
}

fn find<'a>(all: &'a [Fragility], limit: Option<&str>, controller: &str) -> &'a Fragility {
    let mut all = all.iter();
    let is_it = |own: &&Fragility| {
        own.limit.as_deref() == limit && own.controller.as_deref() == Some(controller)
    };
    all.find(is_it).unwrap()
}

#[test]
fn a_study_tells_what_it_was_made_of() {
    let table = study(2000, 40, 2);
    let found = analyse(&table, &settings(), &command);
    let all = &found.groups[0];
    assert_eq!(all.endings.runs, 2000);
    assert_eq!(all.endings.failed, 21);
    let share = |median: f64| {
        lognormal(find(
            &found.fragility,
            Some("specimen.displacement"),
            if median > 0.4 {
                "mpc"
            } else {
                "three-variable"
            },
        ))
        .clone()
    };
    for median in [0.5, 0.35] {
        let own = share(median);
        assert_eq!(own.motions, Some(40));
        assert!((own.median / median - 1.0).abs() < 0.12, "{own:?}");
        assert!((own.dispersion - 0.4).abs() < 0.1, "{own:?}");
        assert!(own.median_band[0] < median && median < own.median_band[1]);
    }
    // The interlock trips above 0.95 g, under one controller.
    let stopped = find(&found.fragility, None, "three-variable");
    let Fit::Separated { between } = stopped.fit else {
        panic!("{:?}", stopped.fit)
    };
    assert!(between[0] <= 0.95 && between[1] > 0.95 && between[1] - between[0] < 0.02);
    assert!(matches!(
        find(&found.fragility, None, "mpc").fit,
        Fit::Never { .. }
    ));
    // What decides over the error: the controller (2 % against 4 %), then the scale. That they do not
    // depend on each other holds while no run is stopped.
    let mut all = table.clone();
    let ended = all.place("ended").unwrap();
    let whole = |row: &&mut Vec<Cell>| row[ended].text() == Some("interlock");
    let stopped = all.rows.iter_mut().filter(whole);
    stopped.for_each(|row| row[ended] = "complete".into());
    let found = analyse(&all, &settings(), &command);
    let error = &found.importance[0];
    assert_eq!(error.column.as_deref(), Some(ERROR));
    let names: Vec<&str> = error
        .factors
        .iter()
        .map(|own| own.factor.as_str())
        .collect();
    assert_eq!(names[..2], ["controller", "scale"]);
    let share = |name: &str| error.factors.iter().find(|own| own.factor == name).unwrap();
    assert_eq!(share("table.bulk_modulus").alone, 0.0);
    assert_eq!(share("record").alone, 0.0);
    assert!(error.rest < 0.1, "{error:?}");
}

#[test]
fn quantiles_count_a_stopped_run_as_the_worst() {
    let table = study(2000, 3, 2);
    let found = analyse(&table, &settings(), &command);
    let group = |value: &str| found.groups.iter().find(|own| own.value == value).unwrap();
    let [mpc, other] = ["mpc", "three-variable"].map(group);
    assert!(other.endings.interlock > 50 && mpc.endings.interlock == 0);
    let error = other.figure(ERROR).unwrap();
    assert_eq!(error.over, Over::All);
    assert!(error.p50.is_some() && error.p95.is_none());
    assert!(mpc.figure(ERROR).unwrap().p95.is_some());
    let delay = other.figure("delay_s").unwrap();
    assert_eq!((delay.over, delay.p95), (Over::Complete, Some(0.012)));
    assert_eq!(delay.runs, other.endings.complete);
    assert!(other.figure("pga_g").is_none());
    assert_eq!(
        found
            .groups
            .iter()
            .filter(|own| own.factor.as_deref() == Some("record"))
            .count(),
        3
    );
    assert!(
        found
            .groups
            .iter()
            .all(|own| own.factor.as_deref() != Some("scale"))
    );
}

#[test]
fn the_worst_are_those_that_failed_then_the_stopped_then_the_largest_error() {
    let mut table = study(60, 3, 2);
    table.rows.retain(|row| row[13] != Cell::from("interlock"));
    let ended = table.place("ended").unwrap();
    table.rows[20][ended] = "interlock".into();
    let found = analyse(&table, &settings(), &command);
    let endings: Vec<Ended> = found.worst.iter().map(|own| own.ended).collect();
    assert_eq!(
        endings[..3],
        [Ended::Failed, Ended::Interlock, Ended::Complete]
    );
    assert_eq!(found.worst.len(), 10);
    assert_eq!(found.worst[0].number, 13);
    assert_eq!(found.worst[0].command, command(13));
    assert_eq!(
        found.worst[0].reason.as_deref(),
        Some("specimen: the run ran away")
    );
    let errors: Vec<f64> = found.worst[2..]
        .iter()
        .filter_map(|own| own.time_domain_percent)
        .collect();
    assert!(errors.windows(2).all(|pair| pair[0] >= pair[1]) && errors.len() == 8);
}

/// Share of 300 studies whose band holds what they were made with: median, and share at half of it.
fn coverage(runs: usize, motions: usize) -> [f64; 2] {
    let (mut held, mut studies) = ([0, 0], 0);
    for seed in 0..300 {
        let mut table = study(2 * runs, motions, 1000 + seed);
        table.rows.retain(|row| row[2] == Cell::from("mpc"));
        let found = fragility::fragility(&Runs::of(&table), &settings());
        let Fit::Lognormal(own) = &found[0].fit else {
            continue;
        };
        studies += 1;
        held[0] += usize::from(own.median_band[0] < 0.5 && 0.5 < own.median_band[1]);
        let curve = &own.curve;
        for (end, name) in [(&curve.low, "low"), (&curve.high, "high")] {
            let grows = end.windows(2).all(|pair| pair[0] <= pair[1]);
            assert!(grows, "seed {seed}: {name} {end:?}");
        }
        let at = curve.intensity.iter().position(|own| *own >= 0.3).unwrap();
        let truth =
            statrs::function::erf::erfc((0.5 / curve.intensity[at]).ln() / 0.4 / 2f64.sqrt()) / 2.0;
        held[1] += usize::from(curve.low[at] < truth && truth < curve.high[at]);
    }
    assert!(studies > 290, "{studies}");
    held.map(|own| own as f64 / studies as f64)
}

/// Runs that share a motion do not count as so many: the band is that of other motions, too.
#[test]
fn the_band_of_fragility_holds_the_curve_as_often_as_it_says() {
    for (runs, motions, least) in [(200, 20, 0.9), (200, 8, 0.88)] {
        let found = coverage(runs, motions);
        println!("{runs} runs of {motions} motions: {found:?}");
        assert!(
            found.iter().all(|own| (least..=0.99).contains(own)),
            "{found:?}"
        );
    }
}

#[test]
fn what_has_no_curve_is_said() {
    let limit = |above: f64| Settings {
        limits: vec![Limit {
            above,
            ..settings().limits[0].clone()
        }],
        ..settings()
    };
    let table = study(400, 3, 7);
    let first = |settings: &Settings, table: &Table| {
        analyse(table, settings, &command).fragility[0].clone()
    };
    let never = first(&limit(9.0), &table);
    let Fit::Never { share_below } = never.fit else {
        panic!("{never:?}")
    };
    // 1 - 0.05^(1/n), about three over n.
    assert!(
        (share_below * never.runs as f64 - 3.0).abs() < 0.05,
        "{never:?}"
    );
    assert!(matches!(first(&limit(0.0), &table).fit, Fit::Always { .. }));
    let unknown = Settings {
        intensity: "sa_1_s_g".to_string(),
        ..settings()
    };
    let why = |found: Fragility| match found.fit {
        Fit::None { why } => why,
        other => panic!("{other:?}"),
    };
    assert_eq!(why(first(&unknown, &table)), Why::SameIntensity);
    let mut same = table.clone();
    let (pga, peak) = (
        same.place("pga_g").unwrap(),
        same.place("peak.specimen.displacement").unwrap(),
    );
    same.rows.iter_mut().for_each(|row| row[pga] = 0.3.into());
    assert_eq!(why(first(&settings(), &same)), Why::SameIntensity);
    let mut falling = table.clone();
    for row in &mut falling.rows {
        let own = row[pga].number().unwrap_or(1.0);
        row[peak] = (0.02 / own).into();
    }
    assert_eq!(why(first(&settings(), &falling)), Why::DoesNotGrow);
    let empty = Table {
        rows: Vec::new(),
        ..table
    };
    assert_eq!(analyse(&empty, &settings(), &command).fragility.len(), 2);
}

/// A mixed sample that is missing leaves out its factor's triple alone.
fn rows_missing(table: &Table, mut design: Settings) {
    if let Design::Saltelli { rows, .. } = &mut design.design {
        rows[2] = None;
        rows[20] = None;
    }
    let found = analyse(table, &design, &command).importance;
    // Without its base sample nothing is known of a block.
    assert_eq!((found[0].runs, found[0].left_out), (2000 - 1 - 5, 6));
}

/// The product of two of three factors, crossed with two controllers of which one gains twice.
#[test]
fn sobol_indices_of_each_controller() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let names = ["a", "b", "c"];
    let mut columns = vec![Column {
        name: "controller".to_string(),
        unit: None,
        role: Role::Factor,
        kind: Kind::Text,
    }];
    for name in names.iter().chain(&[ERROR, "number"]) {
        columns.push(Column {
            name: name.to_string(),
            unit: None,
            role: if names.contains(name) {
                Role::Factor
            } else {
                Role::Result
            },
            kind: Kind::Number,
        });
    }
    columns.push(Column {
        name: "ended".to_string(),
        unit: None,
        role: Role::Ending,
        kind: Kind::Text,
    });
    let mut rows = Vec::new();
    for _ in 0..400 {
        let mut draw = || [(); 3].map(|()| random.random::<f64>());
        let (one, other) = (draw(), draw());
        for mixed in 0..5 {
            let mut at = if mixed == 4 { other } else { one };
            if (1..4).contains(&mixed) {
                at[mixed - 1] = other[mixed - 1];
            }
            for (controller, gain) in [("p", 1.0), ("q", 2.0)] {
                let error = gain * at[0] * at[1];
                let mut row: Vec<Cell> = vec![controller.into()];
                row.extend(at.map(Cell::from));
                row.extend([error.into(), (rows.len() as f64).into(), "complete".into()]);
                rows.push(row);
            }
        }
    }
    let mut table = Table { columns, rows };
    let design = Settings {
        design: Design::Saltelli {
            sampled: names.map(String::from).to_vec(),
            crossed: vec!["controller".to_string()],
            crossings: 2,
            rows: (0..4000).map(Some).collect(),
        },
        limits: Vec::new(),
        ..settings()
    };
    let found = analyse(&table, &design, &command).importance;
    assert_eq!(found.len(), 2);
    for own in &found {
        assert_eq!((own.method, own.runs), (Method::Sobol, 2000));
        let [a, b, c] =
            names.map(|name| own.factors.iter().find(|own| own.factor == name).unwrap());
        // Var(ab) = 7/144, of which the variance of each alone is 1/48.
        for factor in [a, b] {
            assert!((factor.alone - 3.0 / 7.0).abs() < 0.1, "{own:?}");
            assert!((factor.total.unwrap() - 4.0 / 7.0).abs() < 0.1, "{own:?}");
        }
        assert_eq!((c.alone, c.total), (0.0, Some(0.0)));
    }
    assert_eq!(found[1].among.as_deref(), Some("q"));
    // A mixed sample that is its base sample over again has no row of its own.
    let mut twice = table.clone();
    let mut shared = design.clone();
    let Design::Saltelli { rows, .. } = &mut shared.design else {
        unreachable!()
    };
    for block in 0..5 {
        let [base, mixed, other] = [10 * block, 10 * block + 6, 10 * block + 8];
        rows[mixed] = rows[base];
        let c = twice.rows[base][3].clone();
        twice.rows[other][3] = c;
    }
    let found = analyse(&twice, &shared, &command).importance;
    assert_eq!((found[0].runs, found[0].left_out), (2000, 0));
    rows_missing(&twice, shared);
    // Rows that are no such design are not taken for one.
    table.rows.swap(0, 8);
    table.rows.rotate_left(2);
    let lost = analyse(&table, &design, &command).importance;
    assert!(lost.is_empty(), "{lost:?}");
}
