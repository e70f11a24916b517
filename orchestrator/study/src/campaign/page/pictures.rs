//! Pictures of a study.

use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::words;
use crate::campaign::analysis::{ERROR, Findings, Fit, Fragility, Importance};
use crate::campaign::table::Table;
use fmi_master::Ending;
use pages::report::{Abscissa, Axis, Bar, BarGroup, Bars, Panel, Series, Style, UnitSystem, Units};

/// Dots of a picture, in all.
const MOST_DOTS: usize = 2000;
/// Curves of one picture that are drawn with their bands.
const MOST_BANDS: usize = 3;
/// Errors this many times the median get a logarithmic axis.
const FAR: f64 = 20.0;

fn intensity_axis(findings: &Findings) -> Axis {
    Axis::linear(
        &words::label(&findings.intensity),
        words::intensity_units(findings),
    )
}

/// Median, 5th and 95th percentile of the error of what is compared.
pub(super) fn errors(findings: &Findings) -> Option<Bars> {
    let groups = words::compared(findings).into_iter().enumerate();
    let groups: Vec<BarGroup> = groups
        .filter_map(|(n, group)| {
            let own = group.figure(ERROR)?;
            let bar = Bar {
                name: "median, with 5 and 95 %".into(),
                value: own.p50?,
                interval: own.p5.zip(own.p95).map(|(low, high)| [low, high]),
                colour: 1 + n % 8,
            };
            let all = "all runs".to_string();
            Some(BarGroup {
                label: if group.factor.is_some() {
                    group.value.clone()
                } else {
                    all
                },
                bars: vec![bar],
            })
        })
        .collect();
    (!groups.is_empty()).then(|| Bars {
        title: "Acceleration error, %".into(),
        groups,
        mark: None,
    })
}

/// The column of controllers, where there are several.
fn controllers(table: &Table) -> (Vec<&str>, Vec<&str>) {
    for name in ["controller", "system"] {
        let texts = table.texts(name);
        let mut names: Vec<&str> = Vec::new();
        for text in &texts {
            if !text.is_empty() && !names.contains(text) {
                names.push(text);
            }
        }
        if names.len() > 1 {
            return (names, texts);
        }
    }
    (vec!["runs"], vec!["runs"; table.rows.len()])
}

/// The error of each run against its intensity.
pub(super) fn scatter(table: &Table, findings: &Findings) -> Option<Panel> {
    let (intensity, errors) = (table.numbers(&findings.intensity), table.numbers(ERROR));
    let ended = table.texts("ended");
    let mut rows: Vec<usize> = (0..table.rows.len())
        .filter(|&run| {
            let place = intensity.get(run).zip(errors.get(run));
            ended.get(run) == Some(&Ending::Complete.word())
                && place.is_some_and(|(x, y)| (x + y).is_finite())
        })
        .collect();
    if rows.is_empty() {
        return None;
    }
    let of = rows.len();
    if of > MOST_DOTS {
        let mut random = ChaCha8Rng::seed_from_u64(findings.seed);
        let picked = index::sample(&mut random, of, MOST_DOTS);
        rows = picked.into_iter().map(|n| rows[n]).collect();
    }
    let mut sorted: Vec<f64> = rows.iter().map(|&run| errors[run]).collect();
    sorted.sort_by(f64::total_cmp);
    let is_wide = sorted[sorted.len() - 1] > FAR * sorted[sorted.len() / 2];
    let (names, controller) = controllers(table);
    let series = names.iter().enumerate().map(|(n, name)| {
        let own: Vec<usize> = rows
            .iter()
            .copied()
            .filter(|&run| controller[run] == *name)
            .collect();
        let places: Vec<f64> = own.iter().map(|&run| intensity[run]).collect();
        let values = own.iter().map(|&run| errors[run]).collect();
        Series::line(name, Abscissa::At(places.into()), values)
            .styled(Style::Points)
            .coloured(1 + n % 8)
    });
    let shown = match rows.len() < of {
        true => format!(
            ", {} of {} runs",
            words::count(rows.len()),
            words::count(of)
        ),
        false => String::new(),
    };
    Some(Panel {
        title: format!("Acceleration error of the complete runs{shown}"),
        x: intensity_axis(findings),
        y: match is_wide {
            true => Axis::logarithmic("acceleration error", Units::PERCENT),
            false => Axis::linear("acceleration error", Units::PERCENT),
        },
        series: series.collect(),
    })
}

/// A picture for each limit that some run exceeded and some did not.
pub(super) fn fragility(findings: &Findings, units: UnitSystem) -> Vec<Panel> {
    let names: Vec<&str> = words::compared(findings)
        .iter()
        .map(|own| own.value.as_str())
        .collect();
    let mut panels: Vec<Panel> = Vec::new();
    let curves = findings.fragility.chunk_by(|a, b| a.limit == b.limit);
    for curves in curves {
        let is_mixed = |own: &Fragility| own.exceeded > 0 && !own.observed.is_empty();
        if !curves.iter().any(is_mixed) {
            continue;
        }
        let colour = |own: &Fragility| {
            let controller = own.controller.as_deref();
            let place = names.iter().position(|name| Some(*name) == controller);
            1 + place.unwrap_or(0) % 8
        };
        let mut series = Vec::new();
        for own in curves {
            let name = own.controller.as_deref().unwrap_or("fitted");
            if let Fit::Lognormal(fit) = &own.fit {
                let curve = &fit.curve;
                let places = || Abscissa::At(curve.intensity.clone().into());
                if curves.len() <= MOST_BANDS {
                    let band = Style::Band(curve.high.clone());
                    let band = Series::line(&format!("{name}, band"), places(), curve.low.clone())
                        .styled(band);
                    series.push(band.coloured(colour(own)));
                }
                series
                    .push(Series::line(name, places(), curve.share.clone()).coloured(colour(own)));
            }
            let places: Vec<f64> = own.observed.iter().map(|own| own.intensity).collect();
            let shares = own.observed.iter().map(|own| own.share).collect();
            let counted = own.controller.as_ref();
            let counted = counted.map_or("counted".to_string(), |name| format!("{name}, counted"));
            let dots = Series::line(&counted, Abscissa::At(places.into()), shares);
            series.push(dots.styled(Style::Points).coloured(colour(own)));
        }
        panels.push(Panel {
            title: words::limit(&curves[0], units),
            x: intensity_axis(findings),
            y: Axis::linear("share of runs", Units::NONE).between(0.0, 1.0),
            series,
        });
    }
    panels
}

/// Shares of the variance, one group per factor.
pub(super) fn importance(own: &Importance) -> Bars {
    let bar = |name: &str, value: f64, interval: [f64; 2], colour| Bar {
        name: name.into(),
        value: 100.0 * value.max(0.0),
        interval: Some(interval.map(|end| 100.0 * end.max(0.0))),
        colour,
    };
    let groups = own.factors.iter().map(|factor| {
        let mut bars = vec![bar("alone", factor.alone, factor.alone_band, 1)];
        if let (Some(total), Some(band)) = (factor.total, factor.total_band) {
            bars.push(bar("in total", total, band, 2));
        }
        BarGroup {
            label: factor.factor.clone(),
            bars,
        }
    });
    Bars {
        title: format!(
            "{}, % of its variance",
            words::capital(&words::outcome(own))
        ),
        groups: groups.collect(),
        mark: None,
    }
}
