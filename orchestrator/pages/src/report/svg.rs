//! One plot as SVG, for pages that cannot run a script.

use std::fmt::Write;

use super::chart_data::envelope;
use super::number::typeset;
use super::{Axis, Panel, Series, Style, UnitSystem};

const WIDTH: f64 = 820.0;
const HEIGHT: f64 = 320.0;
const LEFT: f64 = 76.0;
const RIGHT: f64 = 18.0;
const TOP: f64 = 42.0;
const BOTTOM: f64 = 52.0;
/// The palette of the page, light.
const COLOURS: [&str; 9] = [
    "#6b7683", "#1f6fc4", "#d9622b", "#2b8a5e", "#8a4fbf", "#b3891b", "#c23b63", "#2a91a2",
    "#6f7f1e",
];

/// Draws the panel in a system of units, on white. All text is escaped.
#[must_use]
pub fn svg(panel: &Panel, system: UnitSystem) -> String {
    let x = Scale::new(
        (&panel.x, system),
        panel.series.iter().flat_map(places),
        LEFT,
        WIDTH - RIGHT,
    );
    let y = Scale::new(
        (&panel.y, system),
        panel.series.iter().flat_map(values),
        HEIGHT - BOTTOM,
        TOP,
    );
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\" \
         font-family=\"system-ui, 'Segoe UI', 'DejaVu Sans', sans-serif\" font-size=\"12\" \
         fill=\"#17202b\">\n<title>{title}</title>\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#ffffff\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"14\" font-weight=\"600\">{title}</text>\n\
         <clipPath id=\"plot\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\
         </clipPath>\n",
        // A little wider than the plot, so that a dot on its edge is whole.
        LEFT - 3.0,
        TOP - 3.0,
        WIDTH - RIGHT - LEFT + 6.0,
        HEIGHT - BOTTOM - TOP + 6.0,
        title = escaped(&panel.title),
    );
    grid(&mut out, panel, system, &x, &y);
    out.push_str("<g clip-path=\"url(#plot)\" fill=\"none\" stroke-linejoin=\"round\">\n");
    for (order, series) in panel.series.iter().enumerate() {
        draw(&mut out, series, colour(series, order), &x, &y);
    }
    out.push_str("</g>\n");
    legend(&mut out, &panel.series);
    out.push_str("</svg>\n");
    out
}

/// From data to points of the picture.
struct Scale {
    unit: f64,
    logarithmic: bool,
    /// Limits in the unit shown (their logarithm to 10 on a logarithmic axis).
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    fn new(
        (axis, system): (&Axis, UnitSystem),
        data: impl Iterator<Item = f64>,
        from: f64,
        to: f64,
    ) -> Self {
        let (unit, _) = axis.units.unit(system);
        let shown = |value: f64| {
            let value = value / unit;
            if axis.logarithmic {
                value.log10()
            } else {
                value
            }
        };
        let (mut low, mut high) = data
            .map(shown)
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        if let Some([least, largest]) = axis.limits {
            (low, high) = (shown(least), shown(largest));
        } else if low.is_finite() && high > low && from > to {
            // Air above and below the curves, none before and after them.
            (low, high) = (low - 0.05 * (high - low), high + 0.05 * (high - low));
        }
        if !(low.is_finite() && high.is_finite() && high > low) {
            let middle = if low.is_finite() { low } else { 0.0 };
            (low, high) = (middle - 1.0, middle + 1.0);
        }
        Self {
            unit,
            logarithmic: axis.logarithmic,
            low,
            high,
            from,
            to,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let value = value / self.unit;
        self.place(if self.logarithmic {
            value.log10()
        } else {
            value
        })
    }

    fn place(&self, shown: f64) -> f64 {
        self.from + (shown - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Place and label of each tick.
    fn ticks(&self) -> Vec<(f64, String)> {
        let span = self.high - self.low;
        if self.logarithmic && span >= 1.0 {
            let within: &[f64] = if span < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
            let decades = self.low.floor() as i32..=self.high.floor() as i32;
            return decades
                .flat_map(|decade| within.iter().map(move |digit| digit * 10_f64.powi(decade)))
                .filter(|value| (self.low - 1e-9..=self.high + 1e-9).contains(&value.log10()))
                .map(|value| (self.place(value.log10()), typeset(value, 1)))
                .collect();
        }
        let rough = span / 6.0;
        let decade = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|m| m * decade)
            .find(|s| *s >= rough);
        let step = step.unwrap_or(10.0 * decade);
        let decimals = usize::try_from(-(step * 1.000_001).log10().floor() as i32).unwrap_or(0);
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        let labelled = |digits: usize| -> Vec<(f64, String)> {
            (first..=last)
                .map(|n| {
                    let shown = n as f64 * step;
                    let label = if self.logarithmic {
                        typeset(10_f64.powf(shown), digits)
                    } else {
                        format!("{shown:.decimals$}").replace('-', "\u{2212}")
                    };
                    (self.place(shown), label)
                })
                .collect()
        };
        // Two digits of a logarithmic scale are not enough where it spans little.
        let differ = |all: &Vec<(f64, String)>| all.windows(2).all(|two| two[0].1 != two[1].1);
        let found = (2..=12).map(labelled).find(differ);
        found.unwrap_or_default()
    }
}

fn places(series: &Series) -> impl Iterator<Item = f64> {
    (0..series.values.len()).map(|n| series.place(n))
}

fn values(series: &Series) -> impl Iterator<Item = f64> {
    let upper: &[f64] = match &series.style {
        Style::Band(upper) => upper,
        _ => &[],
    };
    series.values.iter().chain(upper).copied()
}

fn colour(series: &Series, order: usize) -> &'static str {
    match series.colour.unwrap_or(order + 1) {
        0 => COLOURS[0],
        n => COLOURS[1 + (n - 1) % (COLOURS.len() - 1)],
    }
}

fn grid(out: &mut String, panel: &Panel, system: UnitSystem, x: &Scale, y: &Scale) {
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    for (at, label) in x.ticks() {
        let _ = writeln!(
            out,
            "<path d=\"M{at:.1} {TOP}V{bottom}\" stroke=\"#e3e7ec\"/>\
             <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#5b6775\">{label}</text>",
            bottom + 17.0
        );
    }
    for (at, label) in y.ticks() {
        let _ = writeln!(
            out,
            "<path d=\"M{LEFT} {at:.1}H{right}\" stroke=\"#e3e7ec\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#5b6775\">{label}</text>",
            LEFT - 7.0,
            at + 4.0
        );
    }
    let _ = writeln!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
        (LEFT + right) / 2.0,
        HEIGHT - 12.0,
        axis_title(&panel.x, system)
    );
    let _ = writeln!(
        out,
        "<text transform=\"translate(18 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        (TOP + bottom) / 2.0,
        axis_title(&panel.y, system)
    );
}

fn axis_title(axis: &Axis, system: UnitSystem) -> String {
    let (_, unit) = axis.units.unit(system);
    let title = if unit.is_empty() {
        axis.label.clone()
    } else {
        format!("{} [{unit}]", axis.label)
    };
    escaped(&title)
}

fn draw(out: &mut String, series: &Series, colour: &str, x: &Scale, y: &Scale) {
    let in_order = matches!(series.style, Style::Line | Style::Dashed | Style::Band(_));
    let thin;
    let series = if in_order && series.values.len() > 3 * WIDTH as usize {
        thin = envelope(series, WIDTH as usize);
        &thin
    } else {
        series
    };
    let point = |n: usize, value: f64| {
        let (px, py) = (x.at(series.place(n)), y.at(value));
        // What lies far outside is clipped anyway; coordinates stay short.
        (px.is_finite() && py.is_finite()).then(|| (px, py.clamp(-HEIGHT, 2.0 * HEIGHT)))
    };
    let line = |values: &mut dyn Iterator<Item = (usize, f64)>| {
        let mut path = String::new();
        let mut pen = 'M';
        for (n, value) in values {
            match point(n, value) {
                Some((px, py)) => {
                    let _ = write!(path, "{pen}{px:.1} {py:.1}");
                    pen = 'L';
                }
                None => pen = 'M',
            }
        }
        path
    };
    let forward = line(&mut series.values.iter().copied().enumerate());
    // A reference lies wide and pale behind what follows it, so that both are seen.
    let pen = if colour == COLOURS[0] {
        "3.6\" stroke-opacity=\"0.5"
    } else {
        "1.2"
    };
    let _ = match &series.style {
        Style::Line | Style::Path => {
            writeln!(
                out,
                "<path d=\"{forward}\" stroke=\"{colour}\" stroke-width=\"{pen}\"/>"
            )
        }
        Style::Dashed => writeln!(
            out,
            "<path d=\"{forward}\" stroke=\"{colour}\" stroke-width=\"1.3\" \
             stroke-dasharray=\"6 4\"/>"
        ),
        Style::Points => {
            for (n, value) in series.values.iter().enumerate() {
                if let Some((px, py)) = point(n, *value) {
                    let _ = write!(
                        out,
                        "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"2.2\" fill=\"{colour}\"/>"
                    );
                }
            }
            writeln!(out)
        }
        Style::Band(upper) => {
            let back = line(&mut upper.iter().copied().enumerate().rev());
            writeln!(
                out,
                "<path d=\"{forward}{}Z\" fill=\"{colour}\" fill-opacity=\"0.2\"/>",
                back.replacen('M', "L", 1)
            )
        }
    };
}

fn legend(out: &mut String, series: &[Series]) {
    let mut at = WIDTH - RIGHT;
    for (order, one) in series.iter().enumerate().rev() {
        let _ = writeln!(
            out,
            "<text x=\"{at:.1}\" y=\"24\" text-anchor=\"end\">{}</text>",
            escaped(&one.name)
        );
        // Width of a letter, about; a legend needs no more.
        at -= 6.8 * one.name.chars().count() as f64 + 6.0;
        let dash = if one.style == Style::Dashed {
            " stroke-dasharray=\"6 4\""
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "<path d=\"M{:.1} 20H{at:.1}\" stroke=\"{}\" stroke-width=\"2.5\"{dash}/>",
            at - 22.0,
            colour(one, order)
        );
        at -= 38.0;
    }
}

pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_within_the_limits() {
        let scale = |logarithmic, [low, high]: [f64; 2]| Scale {
            unit: 1.0,
            logarithmic,
            low,
            high,
            from: 0.0,
            to: 100.0,
        };
        let ticks = |scale: Scale| -> Vec<(i64, String)> {
            let all = scale.ticks().into_iter();
            all.map(|(place, label)| (place.round() as i64, label))
                .collect()
        };
        let expected = |all: &[(i64, &str)]| -> Vec<(i64, String)> {
            let all = all.iter();
            all.map(|(place, label)| (*place, (*label).to_string()))
                .collect()
        };
        assert_eq!(
            ticks(scale(false, [-0.2, 0.39])),
            expected(&[
                (0, "\u{2212}0.2"),
                (17, "\u{2212}0.1"),
                (34, "0.0"),
                (51, "0.1"),
                (68, "0.2"),
                (85, "0.3"),
            ])
        );
        assert_eq!(
            ticks(scale(true, [-1.0, 1.0])),
            expected(&[
                (0, "0.1"),
                (15, "0.2"),
                (35, "0.5"),
                (50, "1"),
                (65, "2"),
                (85, "5"),
                (100, "10"),
            ])
        );
        assert_eq!(
            ticks(scale(true, [0.0, 4.0])),
            expected(&[
                (0, "1"),
                (25, "10"),
                (50, "100"),
                (75, "1000"),
                (100, "10000")
            ])
        );
    }

    #[test]
    fn no_two_ticks_have_the_same_label() {
        for (low, high, logarithmic) in [
            (0.0, 1.0, false),
            (-0.000_31, 0.000_4, false),
            (0.1234, 0.1235, false),
            (0.1234, 0.1235, true),
            (1000.0, 1000.4, true),
        ] {
            let shown = |value: f64| if logarithmic { value.log10() } else { value };
            let scale = Scale {
                unit: 1.0,
                logarithmic,
                low: shown(low),
                high: shown(high),
                from: 0.0,
                to: 100.0,
            };
            let mut labels: Vec<String> = scale.ticks().into_iter().map(|own| own.1).collect();
            let count = labels.len();
            labels.sort();
            labels.dedup();
            assert!(count >= 3, "{low} {high} {labels:?}");
            assert_eq!(labels.len(), count, "{low} {high} {labels:?}");
        }
    }
}
