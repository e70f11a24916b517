use std::path::Path;
use std::sync::Arc;

use super::*;
use ::units::INCH;
use motion::metrics::tracking;
use motion::{Motion, Options, built_in};

/// A table that follows with a lag and a little ringing: something to look at.
fn followed(motion: &Motion) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let late = |history: &[f64]| -> Vec<f64> {
        let mut state = 0.0;
        history
            .iter()
            .enumerate()
            .map(|(n, value)| {
                state += 0.25 * (value - state);
                state * (1.0 + 0.05 * (0.11 * n as f64).sin())
            })
            .collect()
    };
    (
        late(&motion.displacement),
        late(&motion.velocity),
        late(&motion.acceleration),
    )
}

fn run_report() -> Report {
    let motion = built_in(1, &Options::default()).unwrap();
    let (displacement, velocity, acceleration) = followed(&motion);
    let figures = tracking(&motion, &displacement, &acceleration).unwrap();
    let command: Vec<f64> = motion.velocity.iter().map(|v| 20.0 * v).collect();
    run(&Run {
        system: "three-variable",
        motion: &motion,
        duration: motion.duration(),
        displacement: &displacement,
        velocity: &velocity,
        acceleration: &acceleration,
        identity: vec![identity::entry("System", "three-variable")],
        commands: vec![("control.valve_command".into(), command)],
        valve_limit: Some(10.0),
        specimen: Some(SpecimenHistory {
            drift: motion.displacement.iter().map(|x| -0.2 * x).collect(),
            force: motion.acceleration.iter().map(|a| 15.0 * a).collect(),
        }),
        trip: Some((20.0, "the table left its reference".into())),
        changed: vec![Changed {
            name: "control.proportional_gain".into(),
            value: Cell::Quantity(196.85, Units::of("V/m"), 4),
            default: Cell::Quantity(137.8, Units::of("V/m"), 4),
        }],
        components: vec![Component {
            name: "control".into(),
            model: "ThreeVariableControl.fmu".into(),
            time: Some(0.0123),
        }],
        tracking: Some(&figures),
        ended: "complete",
        settings: vec![
            ("FMI version".into(), "3.0".into()),
            ("real-time factor".into(), Cell::Number(2314.2, 4)),
        ],
        footer: "Shakebench 0.1.0".into(),
    })
}

/// Every kind of series, both kinds of axes, and text that would break a careless page.
fn gallery() -> Report {
    let frequencies: Arc<[f64]> = (0..200)
        .map(|n| 10_f64.powf(-1.0 + f64::from(n) / 66.0))
        .collect();
    let gain: Vec<f64> = frequencies
        .iter()
        .map(|f| -10.0 * (1.0 + (f / 5.0).powi(2)).log10())
        .collect();
    let at = || Abscissa::At(Arc::clone(&frequencies));
    let band = Style::Band(gain.iter().map(|g| g + 2.0).collect());
    let low: Vec<f64> = gain.iter().map(|g| g - 2.0).collect();
    let every: Vec<usize> = (0..200).step_by(8).collect();
    let measured: Vec<f64> = every.iter().map(|&n| gain[n] + (n as f64).sin()).collect();
    let places: Arc<[f64]> = every.iter().map(|&n| frequencies[n]).collect();
    let turn: Vec<f64> = (0..600).map(|n| 0.03 * f64::from(n)).collect();
    let drift: Vec<f64> = turn.iter().map(|t| 0.01 * t.sin() * t / 18.0).collect();
    let force: Vec<f64> = turn
        .iter()
        .map(|t| 20.0 * (t + 0.4).sin() * t / 18.0)
        .collect();
    Report {
        title: "A gallery <script>alert(1)</script> & \"more\"".into(),
        summary: "Nothing </title> here </script> is markup <!-- at all.".into(),
        identity: vec![identity::entry("System", "<i>")],
        facts: vec![Fact {
            label: "Margin".into(),
            value: Cell::Number(47.3, 3),
            note: "<b>".into(),
        }],
        sections: vec![Section {
            heading: "Loops".into(),
            text: vec!["One & all.".into()],
            notes: vec!["a < b".into()],
            bars: Vec::new(),
            tables: vec![Table {
                caption: "Margins".into(),
                columns: vec!["loop".into(), "crossover".into(), "stroke".into()],
                rows: vec![vec![
                    "outer <i>".into(),
                    Cell::Quantity(12.5, Units::FREQUENCY, 3),
                    Cell::Quantity(0.0381, Units::DISPLACEMENT, 3),
                ]],
            }],
            panels: vec![
                Panel {
                    title: "Gain </script>".into(),
                    x: Axis::logarithmic("frequency", Units::FREQUENCY),
                    y: Axis::linear("gain", Units::DECIBEL),
                    series: vec![
                        Series::line("95 %", at(), low).styled(band).coloured(1),
                        Series::line("model", at(), gain.clone()).coloured(1),
                        Series::line("measured </script>", Abscissa::At(places), measured)
                            .styled(Style::Points)
                            .coloured(2),
                    ],
                },
                Panel {
                    title: "Loop of the specimen".into(),
                    x: Axis::linear("drift", Units::DISPLACEMENT),
                    y: Axis::linear("force", Units::FORCE),
                    series: vec![
                        Series::line("specimen", Abscissa::At(drift.into()), force)
                            .styled(Style::Path),
                    ],
                },
                Panel {
                    title: "Error against the coupling step".into(),
                    x: Axis::logarithmic("step", Units::same("ms")),
                    y: Axis::logarithmic("error", Units::PERCENT).between(0.05, 5.0),
                    series: vec![
                        Series::line("slope 1", Abscissa::At([0.25, 2.0].into()), vec![0.2, 1.6])
                            .styled(Style::Dashed)
                            .coloured(0),
                        Series::line(
                            "found",
                            Abscissa::At([0.25, 0.5, 1.0, 2.0].into()),
                            vec![0.21, 0.4, f64::NAN, 1.7],
                        )
                        .styled(Style::Points),
                    ],
                },
            ],
        }],
        footer: String::new(),
    }
}

/// Everything between two markers, which must be there.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let start = text.find(from).unwrap() + from.len();
    &text[start..start + text[start..].find(to).unwrap()]
}

/// The page without the style sheets, the scripts and the numbers.
fn structure(page: &str) -> String {
    let mut rest = page;
    let mut out = String::new();
    while let Some(start) = ["<style", "<script"]
        .iter()
        .filter_map(|t| rest.find(t))
        .min()
    {
        let close = if rest[start..].starts_with("<style") {
            "</style>"
        } else {
            "</script>"
        };
        let inside = start + rest[start..].find('>').unwrap() + 1;
        out.push_str(&rest[..inside]);
        rest = &rest[inside + rest[inside..].find(close).unwrap()..];
    }
    out + rest
}

#[test]
fn the_page_refers_to_nothing_outside_itself() {
    for report in [run_report(), gallery()] {
        // Files are handed to the reader as blobs, and a picture clips at a shape of its own: no requests.
        let page = html(&report, None).unwrap().to_lowercase();
        let page = page
            .replace("createobjecturl(", "")
            .replace("revokeobjecturl(", "")
            .replace("url(#inside)", "");
        for outside in [
            "src=",
            "@import",
            "url(",
            "fetch(",
            "xmlhttprequest",
            "import(",
            "sendbeacon",
            "<iframe",
            "<object",
            "<embed",
            "<base",
            "websocket(",
        ] {
            assert!(!page.contains(outside), "{outside}");
        }
        // Addresses stand in the comment of the library's licence and name the language of pictures.
        for (place, _) in page.match_indices("http") {
            let known = [
                "https://github.com/leeoniya/uplot",
                "http-equiv=",
                "http://www.w3.org/2000/svg",
            ];
            assert!(
                known.iter().any(|known| page[place..].starts_with(known)),
                "{}",
                &page[place..place + 60]
            );
        }
        for (place, _) in page.match_indices("href=") {
            assert!(page[place..].starts_with("href=\"data:,\""));
        }
        assert!(page.contains("default-src 'none'"));
        assert!(
            page.contains("permission is hereby granted"),
            "the library's licence"
        );
    }
}

#[test]
fn the_embedded_numbers_are_json_and_are_the_numbers() {
    let report = run_report();
    let page = html(&report, None).unwrap();
    let text = between(&page, "id=\"panels\">", "</script>");
    let panels: serde_json::Value = serde_json::from_str(text).unwrap();
    let embedded = panels.as_array().unwrap();
    let given: Vec<&Panel> = report.sections.iter().flat_map(|s| &s.panels).collect();
    assert_eq!(embedded.len(), given.len());
    assert_eq!(
        embedded.len(),
        page.matches("class=\"chart\" data-panel").count()
    );
    for (embedded, given) in embedded.iter().zip(given) {
        assert_eq!(embedded["title"], given.title.as_str());
        for (one, series) in embedded["series"]
            .as_array()
            .unwrap()
            .iter()
            .zip(&given.series)
        {
            let letters = one["y"].as_str().unwrap().trim_end_matches('=').len();
            assert_eq!(letters * 6 / 8 / 4, series.values.len(), "{}", series.name);
        }
    }
    let text = html(&gallery(), None).unwrap();
    let text = between(&text, "id=\"panels\">", "</script>");
    let panels: serde_json::Value = serde_json::from_str(text).unwrap();
    assert_eq!(panels[0]["title"], "Gain </script>");
    assert_eq!(panels[2]["y"]["limits"][1], 5.0);
}

#[test]
fn a_long_run_stays_a_small_file() {
    let motion = built_in(1, &Options::default()).unwrap();
    let long =
        |history: &[f64]| -> Vec<f64> { history.iter().cycle().take(30_001).copied().collect() };
    let motion = Motion {
        displacement: long(&motion.displacement),
        velocity: long(&motion.velocity),
        acceleration: long(&motion.acceleration),
        ..motion
    };
    let (displacement, velocity, acceleration) = followed(&motion);
    let page = html(
        &run(&Run {
            system: "three-variable",
            motion: &motion,
            duration: motion.duration(),
            displacement: &displacement,
            velocity: &velocity,
            acceleration: &acceleration,
            identity: Vec::new(),
            commands: vec![
                ("control.valve_command".into(), velocity.clone()),
                ("interlock.valve_command".into(), velocity.clone()),
            ],
            valve_limit: Some(10.0),
            specimen: Some(SpecimenHistory {
                drift: displacement.clone(),
                force: acceleration.clone(),
            }),
            trip: Some((20.0, "the table left its reference".into())),
            changed: Vec::new(),
            components: Vec::new(),
            tracking: None,
            ended: "complete",
            settings: Vec::new(),
            footer: String::new(),
        }),
        None,
    )
    .unwrap();
    println!("a minute at 500 Hz: {} bytes", page.len());
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
}

#[test]
fn text_is_never_markup() {
    let page = html(&gallery(), None).unwrap();
    let structure = structure(&page);
    assert!(!structure.contains("<script>alert"));
    assert!(structure.contains("A gallery &lt;script&gt;"));
    assert!(!structure.contains("<i>") && !structure.contains("<b>") && !page.contains("<!-- at"));
    assert_eq!(
        page.matches("<script").count(),
        page.matches("</script>").count()
    );
    assert_eq!(page.matches("</script>").count(), 3);
    assert_eq!(page.matches("<title>").count(), 1);
}

/// A page is as the file in `expected/`, which `SHAKEBENCH_REGENERATE=1` rewrites.
fn compare(name: &str, structure: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("src/report/expected")
        .join(name);
    if std::env::var("SHAKEBENCH_REGENERATE").is_ok_and(|value| value == "1") {
        std::fs::write(&path, format!("{}\n", structure.trim_end())).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap();
    let pairs = structure.trim_end().lines().zip(expected.lines());
    for (n, (now, before)) in pairs.enumerate() {
        assert_eq!(now, before, "{name}:{}", n + 1);
    }
    let lines = structure.trim_end().lines().count();
    assert_eq!(lines, expected.lines().count(), "lines of {name}");
}

#[test]
fn structure_of_a_page() {
    compare("gallery.html", &structure(&html(&gallery(), None).unwrap()));
    compare("run.html", &structure(&html(&run_report(), None).unwrap()));
}

/// The pictures are well-formed XML, hold a drawing of every series, and no markup of the text.
#[test]
fn pictures_are_well_formed() {
    for report in [run_report(), gallery()] {
        for panel in report.sections.iter().flat_map(|section| &section.panels) {
            let picture = svg(panel, UnitSystem::Us);
            let document = roxmltree::Document::parse(&picture).unwrap();
            assert_eq!(document.root_element().tag_name().name(), "svg");
            assert!(
                !picture.contains("NaN") && !picture.contains("inf"),
                "{}",
                panel.title
            );
            assert!(
                picture.len() < 200_000,
                "{}: {} bytes",
                panel.title,
                picture.len()
            );
            let texts: Vec<&str> = document.descendants().filter_map(|n| n.text()).collect();
            assert!(texts.contains(&panel.title.as_str()));
            for series in &panel.series {
                assert!(texts.contains(&series.name.as_str()), "{}", series.name);
            }
        }
    }
}

/// A peak is at its coordinates: a triangle with its top at (1 s, 2 in).
#[test]
fn a_picture_puts_values_where_the_axes_say() {
    let panel = Panel {
        title: "triangle".into(),
        x: Axis::linear("time", Units::TIME).between(0.0, 2.0),
        y: Axis::linear("displacement", Units::DISPLACEMENT).between(0.0, 4.0 * INCH),
        series: vec![Series::history("a", 1.0, &[0.0, 2.0 * INCH, 0.0])],
    };
    // The plot lies between x = 76 and 802, y = 42 and 268 of the picture.
    assert!(
        svg(&panel, UnitSystem::Us).contains("M76.0 268.0L439.0 155.0L802.0 268.0"),
        "{}",
        svg(&panel, UnitSystem::Us)
    );
    // An empty plot is a plot still.
    let empty = Panel {
        series: Vec::new(),
        ..panel
    };
    assert!(roxmltree::Document::parse(&svg(&empty, UnitSystem::Us)).is_ok());
}

/// Writes the two pages and a picture where SHAKEBENCH_PAGES says, to be looked at.
#[test]
fn pages_to_look_at() {
    let folder = std::env::var_os("SHAKEBENCH_PAGES").map(std::path::PathBuf::from);
    let temporary = tempfile::tempdir().unwrap();
    let folder = folder.unwrap_or_else(|| temporary.path().to_path_buf());
    for (name, report) in [("run", run_report()), ("gallery", gallery())] {
        std::fs::write(
            folder.join(format!("{name}.html")),
            html(&report, None).unwrap(),
        )
        .unwrap();
        for (n, panel) in report.sections.iter().flat_map(|s| &s.panels).enumerate() {
            std::fs::write(
                folder.join(format!("{name}-{n}.svg")),
                svg(panel, UnitSystem::Us),
            )
            .unwrap();
        }
    }
    assert!(std::fs::metadata(folder.join("run.html")).unwrap().len() > 100_000);
}

#[test]
fn an_error_is_the_reference_less_the_table() {
    let motion = built_in(1, &Options::default()).unwrap();
    let (displacement, _, acceleration) = followed(&motion);
    let report = run_report();
    let panels: Vec<&Panel> = report.sections.iter().flat_map(|s| &s.panels).collect();
    for (quantity, reference, table) in [
        ("Acceleration", &motion.acceleration, &acceleration),
        ("Displacement", &motion.displacement, &displacement),
    ] {
        let title = format!("{quantity} error (reference minus table)");
        let panel = panels.iter().find(|panel| panel.title == title).unwrap();
        let shown = &panel.series[0].values;
        assert_eq!(shown.len(), reference.len());
        for ((error, wanted), found) in shown.iter().zip(reference).zip(table) {
            assert_eq!(*error, wanted - found);
        }
        // The stroke where the run was stopped is as high as what is drawn, with zero.
        let stroke = &panel.series[1];
        let high = shown.iter().copied().fold(0.0, f64::max);
        let low = shown.iter().copied().fold(0.0, f64::min);
        assert_eq!(stroke.values, [low, high], "{}", stroke.name);
    }
}

/// The triangle's limits are 4 in or 101.6 mm: the units are those that are asked for, and only without a wish can a
/// reader switch them.
#[test]
fn pages_and_pictures_are_in_the_units_that_were_asked_for() {
    let panel = Panel {
        title: "triangle".into(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("displacement", Units::DISPLACEMENT).between(0.0, 4.0 * INCH),
        series: vec![Series::history("a", 1.0, &[0.0, 2.0 * INCH, 0.0])],
    };
    let us = svg(&panel, UnitSystem::Us);
    assert!(
        us.contains("displacement [in]") && us.contains(">4<"),
        "{us}"
    );
    let si = svg(&panel, UnitSystem::Si);
    assert!(
        si.contains("displacement [mm]") && si.contains(">100<"),
        "{si}"
    );
    for (asked, tag) in [
        (None, "data-units=\"laboratory\">"),
        (
            Some(UnitSystem::Us),
            "data-units=\"laboratory\" data-units-asked=\"1\">",
        ),
        (
            Some(UnitSystem::Si),
            "data-units=\"si\" data-units-asked=\"1\">",
        ),
    ] {
        assert!(html(&gallery(), asked).unwrap().contains(tag), "{tag}");
    }
}

/// Names, places and values of all series, in few digits: what the page's numbers hold.
fn digest(report: &Report) -> String {
    let of = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let square = values.iter().map(|value| value * value).sum::<f64>();
        let root = (square / values.len() as f64).sqrt();
        let few = |value: f64| number::significant(value, 5);
        format!("{} to {}, RMS {}", few(least), few(largest), few(root))
    };
    let mut text = String::new();
    for panel in report.sections.iter().flat_map(|section| &section.panels) {
        let axis = |axis: &Axis| {
            let kind = if axis.logarithmic { "log " } else { "" };
            let (label, unit) = (&axis.label, &axis.units.si);
            format!("{kind}{label} [{unit}] {:?}", axis.limits)
        };
        text += &format!(
            "{}: {} over {}\n",
            panel.title,
            axis(&panel.y),
            axis(&panel.x)
        );
        for series in &panel.series {
            let style = match series.style {
                Style::Band(_) => "Band".to_string(),
                ref style => format!("{style:?}"),
            };
            text += &format!(
                "  {} ({style}, {:?}): {} values {} at {}\n",
                series.name,
                series.colour,
                series.values.len(),
                of(&mut series.values.iter().copied()),
                of(&mut (0..series.values.len()).map(|n| series.place(n)))
            );
        }
    }
    text
}

#[test]
fn plots_of_a_run_hold_its_histories_spectra_and_energy() {
    compare("run-plots.txt", &digest(&run_report()));
}

#[test]
fn pictures_are_as_before() {
    for (n, panel) in gallery().sections[0].panels.iter().enumerate() {
        compare(&format!("gallery-{n}.svg"), &svg(panel, UnitSystem::Si));
    }
}

/// A run along two axes, of which the second was to rest and both ended early.
fn two_axes(at_rest: bool, ended: &str, trip: Option<(f64, String)>) -> Report {
    let motion = built_in(1, &Options::default()).unwrap();
    let played = 2000;
    let (mut displacement, mut velocity, mut acceleration) = followed(&motion);
    for history in [&mut displacement, &mut velocity, &mut acceleration] {
        history.truncate(played);
    }
    let figures = tracking(&motion, &displacement, &acceleration).unwrap();
    let across = Motion {
        name: "rest".into(),
        notes: vec!["held at zero".into()],
        ..motion.clone()
    };
    let along = |motion, tracking, specimen: bool| Run {
        system: "biaxial",
        motion,
        duration: 10.0,
        displacement: &displacement,
        velocity: &velocity,
        acceleration: &acceleration,
        identity: vec![identity::entry("System", "biaxial")],
        commands: vec![("control.valve_command".into(), velocity.clone())],
        valve_limit: Some(10.0),
        specimen: specimen.then(|| SpecimenHistory {
            drift: displacement.clone(),
            force: acceleration.clone(),
        }),
        trip: trip.clone(),
        changed: Vec::new(),
        components: vec![Component {
            name: "table".into(),
            model: "BiaxialTable.fmu".into(),
            time: None,
        }],
        tracking,
        ended,
        settings: vec![("FMI version".into(), "3.0".into())],
        footer: "Shakebench 0.1.0".into(),
    };
    run_along(&[
        AxisRun {
            name: "x",
            run: along(&motion, Some(&figures), true),
            at_rest: None,
        },
        AxisRun {
            name: "y",
            run: along(&across, None, false),
            at_rest: at_rest.then_some([1.25, 3.5]),
        },
    ])
}

#[test]
fn a_run_along_two_axes_compares_them_and_shows_each() {
    let trip = Some((3.998, "the table left its reference".to_string()));
    let report = two_axes(true, "interlock", trip);
    let page = structure(&html(&report, None).unwrap());
    compare("two-axes.html", &page);
    compare("two-axes-plots.txt", &digest(&report));
}

#[test]
fn the_summary_of_two_axes_says_how_the_run_ended_and_what_was_measured() {
    let complete = two_axes(false, "complete", None);
    assert!(complete.summary.starts_with("Along x the table followed"));
    assert!(
        complete
            .summary
            .ends_with("Along y there is no tracking error."),
        "{}",
        complete.summary
    );
    let early = two_axes(true, "the user stopped it", None);
    assert!(
        early
            .summary
            .starts_with("The run ended early: the user stopped it. Along x"),
        "{}",
        early.summary
    );
    assert!(
        early.summary.ends_with(
            "Axis y was to rest and moved by 1.25 % of the other axis' displacement and 3.50 % of its acceleration \
             (RMS over peak)."
        ),
        "{}",
        early.summary
    );
    // Without an axis at rest its columns are left out.
    let columns = |report: &Report| report.sections[0].tables[0].columns.len();
    assert_eq!((columns(&complete), columns(&early)), (7, 9));
}

#[test]
fn the_summary_of_a_run_says_how_it_ended() {
    let motion = built_in(1, &Options::default()).unwrap();
    let (displacement, velocity, acceleration) = followed(&motion);
    let said = |ended, trip: Option<(f64, String)>| {
        let report = run(&Run {
            system: "bare",
            motion: &motion,
            duration: motion.duration(),
            displacement: &displacement[..500],
            velocity: &velocity[..500],
            acceleration: &acceleration[..500],
            identity: Vec::new(),
            commands: Vec::new(),
            valve_limit: None,
            specimen: None,
            trip,
            changed: Vec::new(),
            components: Vec::new(),
            tracking: None,
            ended,
            settings: Vec::new(),
            footer: String::new(),
        });
        assert_eq!(report.facts.len(), 2, "no figures of tracking");
        let headings: Vec<&str> = report.sections.iter().map(|own| &*own.heading).collect();
        assert_eq!(
            headings,
            ["Time histories", "In frequency", "The motion", "The run"]
        );
        // What was not played is drawn, unless a shorter run was asked for.
        let reference = &report.sections[0].panels[0].series[0];
        let drawn = if ended == "complete" {
            500
        } else {
            motion.len()
        };
        assert_eq!(reference.values.len(), drawn);
        report.summary
    };
    assert_eq!(said("complete", None), "Tracking could not be measured.");
    let stopped = (0.998, "the valve saturated".to_string());
    assert_eq!(
        said("interlock", Some(stopped)),
        "The run was stopped at 0.998 s: the valve saturated. It has no tracking error."
    );
    assert_eq!(
        said("the client left", None),
        "The run ended early: the client left. It has no tracking error."
    );
}

#[test]
fn bars_are_boxes_with_marks_intervals_and_a_legend() {
    let bar = |name: &str, value, interval, colour| Bar {
        name: name.into(),
        value,
        interval,
        colour,
    };
    let report = Report {
        sections: vec![Section {
            bars: vec![Bars {
                title: "Errors".into(),
                groups: vec![
                    BarGroup {
                        label: "one & two".into(),
                        bars: vec![
                            bar("before", 8.0, None, 1),
                            bar("after", 2.0, Some([1.0, 3.0]), 2),
                        ],
                    },
                    BarGroup {
                        label: "three".into(),
                        bars: vec![bar("before", 4.0, None, 1)],
                    },
                ],
                mark: Some((6.0, "limit <6>".into())),
            }],
            ..Section::default()
        }],
        ..Report::default()
    };
    let page = html(&report, Some(UnitSystem::Si)).unwrap();
    let drawn = between(
        &page,
        "<div class=\"bars\">\n",
        "</div></div>\n<div class=\"legend\">",
    );
    let group = |label: &str| format!("<div class=\"group\"><span>{label}</span><div>");
    let track = |name: &str, width: &str, colour: usize| {
        format!(
            "<div class=\"track\" title=\"{name}\"><i style=\"width:{width}%;background:var(--series-{colour})\"></i>\
             <s style=\"left:75.00%\"></s>"
        )
    };
    let expected = [
        group("one &amp; two"),
        track("before", "100.00", 1),
        "<b style=\"left:100.00%\">8.00</b></div>".into(),
        track("after", "25.00", 2),
        "<u style=\"left:12.50%;width:25.00%\"></u><b style=\"left:37.50%\">2.00</b></div>".into(),
        "</div></div>\n".into(),
        group("three"),
        track("before", "50.00", 1),
        "<b style=\"left:50.00%\">4.00</b></div>".into(),
    ];
    assert_eq!(drawn, expected.concat());
    let legend = between(&page, "<div class=\"legend\">", "</div>");
    assert_eq!(
        legend,
        "<span><i style=\"background:var(--series-1)\"></i>before</span>\
         <span><i style=\"background:var(--series-2)\"></i>after</span>\
         <span><s></s>limit &lt;6&gt;</span>"
    );
}

#[test]
fn the_first_rows_of_a_table_are_its_headings_and_their_units() {
    let rows = |text: &str| -> Vec<Vec<String>> {
        let rows = text.lines();
        rows.map(|row| row.split('|').map(str::to_string).collect())
            .collect()
    };
    let table = Table::headed("errors", rows("axis|error\nx|1\ny|2"));
    assert_eq!(
        (&*table.caption, table.columns),
        ("errors", vec!["axis".into(), "error".into()])
    );
    let cells = |row: &[&str]| -> Vec<Cell> { row.iter().map(|cell| Cell::from(*cell)).collect() };
    assert_eq!(table.rows, [cells(&["x", "1"]), cells(&["y", "2"])]);
    let table = Table::headed_with_units("", rows("axis|error\n|mm\nx|1"));
    assert_eq!(table.columns, ["axis", "error (mm)"]);
    assert_eq!(table.rows, [cells(&["x", "1"])]);
    let lone = Table::headed_with_units("", rows("axis|error"));
    assert_eq!((lone.columns.len(), lone.rows.len()), (2, 0));
    assert_eq!(
        Cell::Quantity(0.0254, Units::DISPLACEMENT, 3).text(UnitSystem::Us),
        "1.00 in"
    );
    assert_eq!(
        Cell::Quantity(0.0254, Units::DISPLACEMENT, 3).text(UnitSystem::Si),
        "25.4 mm"
    );
    assert_eq!(
        Cell::Quantity(2.0, Units::NONE, 2).text(UnitSystem::Si),
        "2.0"
    );
}

#[test]
fn a_thinned_series_keeps_its_extremes_and_a_short_one_everything() {
    let values: Vec<f64> = (0..100).map(f64::from).collect();
    let series = Series::history("a", 0.5, &values);
    assert_eq!(series.clone().thinned(100).values, values);
    let thin = series.thinned(10);
    assert_eq!(
        thin.values,
        [0.0, 19.0, 20.0, 39.0, 40.0, 59.0, 60.0, 79.0, 80.0, 99.0]
    );
    assert_eq!((thin.place(1), thin.place(9)), (9.5, 49.5));
    assert!(thin.place(10).is_nan());
}
