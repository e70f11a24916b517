//! Horizontal bars as SVG inside the page, in the page's colours.

use std::fmt::Write;

use super::number::typeset;
use super::svg::escaped;

/// Bars in groups, from zero, each with its number.
#[derive(Debug, Clone, Default)]
pub struct Bars {
    /// What they show.
    pub title: String,
    /// Groups, top to bottom.
    pub groups: Vec<BarGroup>,
    /// A line across all of them: place and name.
    pub mark: Option<(f64, String)>,
}

/// Bars that belong together.
#[derive(Debug, Clone)]
pub struct BarGroup {
    /// Name of the group.
    pub label: String,
    /// Its bars.
    pub bars: Vec<Bar>,
}

/// One bar.
#[derive(Debug, Clone)]
pub struct Bar {
    /// What it is, the same words in all groups.
    pub name: String,
    /// Its length.
    pub value: f64,
    /// An interval that is drawn over its end.
    pub interval: Option<[f64; 2]>,
    /// Which colour of the palette.
    pub colour: usize,
}

/// Bars that reach this many times the mark are drawn on a logarithmic scale.
const FAR: f64 = 30.0;
const WIDTH: f64 = 1060.0;
const LEFT: f64 = 190.0;
const RIGHT: f64 = 110.0;
const TOP: f64 = 34.0;
const BAR: f64 = 15.0;
const GAP: f64 = 14.0;

/// Draws the bars; all text is escaped.
pub(super) fn svg(bars: &Bars) -> String {
    let all = || bars.groups.iter().flat_map(|group| &group.bars);
    let far = |bar: &Bar| {
        bar.interval
            .map_or(bar.value, |[_, high]| high.max(bar.value))
    };
    let mark = bars.mark.as_ref().map_or(0.0, |(place, _)| *place);
    let most = all()
        .map(far)
        .filter(|v| v.is_finite())
        .fold(mark, f64::max);
    let length = WIDTH - LEFT - RIGHT;
    let least = 0.1 * mark;
    let logarithmic = mark > 0.0 && most > FAR * mark;
    let x = |value: f64| {
        let share = if logarithmic {
            (value / least).ln() / (most / least).ln()
        } else {
            value / most.max(1e-300)
        };
        LEFT + share.max(0.0) * length
    };
    let mut body = String::new();
    let mut y = TOP;
    for group in &bars.groups {
        let height = BAR * group.bars.len() as f64;
        let _ = writeln!(
            body,
            "<text x=\"{:.0}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 12.0,
            y + height / 2.0 + 4.5,
            escaped(&group.label)
        );
        for bar in &group.bars {
            let (end, middle) = (x(bar.value), y + BAR / 2.0);
            let _ = writeln!(
                body,
                "<rect x=\"{LEFT}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"2\" \
                 style=\"fill:var(--series-{})\"/>",
                y + 1.0,
                (end - LEFT).max(1.0),
                BAR - 2.0,
                bar.colour
            );
            let mut at = end;
            if let Some([low, high]) = bar.interval {
                let _ = writeln!(
                    body,
                    "<path d=\"M{0:.1} {middle:.1}H{1:.1}M{0:.1} {2:.1}v6M{1:.1} {2:.1}v6\" \
                     style=\"stroke:var(--ink)\"/>",
                    x(low),
                    x(high),
                    middle - 3.0
                );
                at = at.max(x(high));
            }
            let _ = writeln!(
                body,
                "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                at + 7.0,
                middle + 4.5,
                typeset(bar.value, 3)
            );
            y += BAR;
        }
        y += GAP;
    }
    if let Some((place, name)) = &bars.mark {
        let _ = writeln!(
            body,
            "<path d=\"M{0:.1} {1}V{2:.1}\" style=\"stroke:var(--ink)\" stroke-dasharray=\"4 4\"/>\
             <text x=\"{0:.1}\" y=\"{3}\" text-anchor=\"middle\" style=\"fill:var(--soft)\">{4}</text>",
            x(*place),
            TOP - 8.0,
            y - GAP + 6.0,
            TOP - 14.0,
            escaped(name)
        );
    }
    let mut legend = String::new();
    let mut at = LEFT;
    let mut named: Vec<&str> = Vec::new();
    for bar in all() {
        if named.contains(&bar.name.as_str()) {
            continue;
        }
        named.push(&bar.name);
        let _ = writeln!(
            legend,
            "<rect x=\"{at:.0}\" y=\"{:.1}\" width=\"12\" height=\"12\" rx=\"2\" \
             style=\"fill:var(--series-{})\"/><text x=\"{:.0}\" y=\"{:.1}\">{}</text>",
            y + 4.0,
            bar.colour,
            at + 18.0,
            y + 14.5,
            escaped(&bar.name)
        );
        at += 40.0 + 7.0 * bar.name.chars().count() as f64;
    }
    if logarithmic {
        let _ = writeln!(
            legend,
            "<text x=\"{at:.0}\" y=\"{:.1}\" style=\"fill:var(--soft)\">logarithmic</text>",
            y + 14.5
        );
    }
    let height = y + 24.0;
    format!(
        "<svg viewBox=\"0 0 {WIDTH} {height}\" width=\"100%\" role=\"img\" font-size=\"13\" \
         fill=\"currentColor\"><title>{}</title>\n{body}{legend}</svg>",
        escaped(&bars.title)
    )
}
