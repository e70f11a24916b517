//! Horizontal bars inside the page, in the page's colours: boxes whose widths are shares, so that they
//! fit any screen.

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

/// From a value to its share of the width, in percent.
struct Scale {
    most: f64,
    /// Where a logarithmic scale begins.
    least: Option<f64>,
}

impl Scale {
    fn of(bars: &Bars) -> Self {
        let far = |bar: &Bar| {
            bar.interval
                .map_or(bar.value, |[_, high]| high.max(bar.value))
        };
        let mark = bars.mark.as_ref().map_or(0.0, |(place, _)| *place);
        let all = bars.groups.iter().flat_map(|group| &group.bars);
        let most = all.map(far).filter(|v| v.is_finite()).fold(mark, f64::max);
        let logarithmic = mark > 0.0 && most > FAR * mark;
        Self {
            most,
            least: logarithmic.then_some(0.1 * mark),
        }
    }

    fn share(&self, value: f64) -> f64 {
        let share = match self.least {
            Some(least) => (value / least).ln() / (self.most / least).ln(),
            None => value / self.most.max(1e-300),
        };
        if share.is_finite() {
            100.0 * share.clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

/// Draws the bars; all text is escaped.
pub(super) fn html(bars: &Bars) -> String {
    let scale = Scale::of(bars);
    let mut out = String::from("<div class=\"bars\">\n");
    for group in &bars.groups {
        let _ = write!(
            out,
            "<div class=\"group\"><span>{}</span><div>",
            escaped(&group.label)
        );
        for bar in &group.bars {
            track(&mut out, bar, bars.mark.as_ref().map(|(at, _)| *at), &scale);
        }
        out.push_str("</div></div>\n");
    }
    legend(&mut out, bars, &scale);
    out.push_str("</div>");
    out
}

fn track(out: &mut String, bar: &Bar, mark: Option<f64>, scale: &Scale) {
    let end = scale.share(bar.value);
    let _ = write!(
        out,
        "<div class=\"track\" title=\"{}\"><i style=\"width:{end:.2}%;background:var(--series-{})\"></i>",
        escaped(&bar.name),
        bar.colour
    );
    let mut far = end;
    if let Some(at) = mark {
        let _ = write!(out, "<s style=\"left:{:.2}%\"></s>", scale.share(at));
    }
    if let Some([low, high]) = bar.interval {
        let [low, high] = [low, high].map(|end| scale.share(end));
        far = far.max(high);
        let _ = write!(
            out,
            "<u style=\"left:{low:.2}%;width:{:.2}%\"></u>",
            high - low
        );
    }
    let _ = write!(
        out,
        "<b style=\"left:{far:.2}%\">{}</b></div>",
        typeset(bar.value, 3)
    );
}

fn legend(out: &mut String, bars: &Bars, scale: &Scale) {
    out.push_str("<div class=\"legend\">");
    let mut named: Vec<&str> = Vec::new();
    for bar in bars.groups.iter().flat_map(|group| &group.bars) {
        if named.contains(&bar.name.as_str()) {
            continue;
        }
        named.push(&bar.name);
        let _ = write!(
            out,
            "<span><i style=\"background:var(--series-{})\"></i>{}</span>",
            bar.colour,
            escaped(&bar.name)
        );
    }
    if let Some((_, name)) = &bars.mark {
        let _ = write!(out, "<span><s></s>{}</span>", escaped(name));
    }
    if scale.least.is_some() {
        out.push_str("<span>logarithmic</span>");
    }
    out.push_str("</div>");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(values: &[f64], mark: Option<f64>) -> Scale {
        let bar = |value: &f64| Bar {
            name: "error".to_string(),
            value: *value,
            interval: None,
            colour: 1,
        };
        Scale::of(&Bars {
            title: String::new(),
            groups: vec![BarGroup {
                label: String::new(),
                bars: values.iter().map(bar).collect(),
            }],
            mark: mark.map(|place| (place, "limit".to_string())),
        })
    }

    #[test]
    fn bars_far_beyond_the_mark_are_logarithmic_from_a_tenth_of_it() {
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-9, "{found}");
        // 25 times the mark: shares of the largest.
        let linear = scale(&[10.0, 50.0], Some(2.0));
        near(linear.share(10.0), 20.0);
        near(linear.share(2.0), 4.0);
        // 5000 times: ln(v / 0.2) of ln(10000 / 0.2).
        let logarithmic = scale(&[10.0, 10_000.0, f64::INFINITY], Some(2.0));
        near(logarithmic.share(10_000.0), 100.0);
        near(
            logarithmic.share(2.0),
            100.0 * 10_f64.ln() / 50_000_f64.ln(),
        );
        near(logarithmic.share(0.1), 0.0);
        // Without a mark nothing is far.
        near(scale(&[1.0, 1e6], None).share(1e5), 10.0);
        // A mark beyond all bars is the end.
        near(scale(&[1.0], Some(4.0)).share(1.0), 25.0);
    }
}
