//! Plots as data for the page: JSON, the numbers as 32-bit floats in base 64 (seven digits in a
//! little over five characters).

use serde_json::{Value, json};

use super::{Abscissa, Axis, Panel, Series, Style, Units};

/// Values of one series that are embedded as they are; longer ones keep their envelope.
const MOST_VALUES: usize = 60_000;

/// The data of all panels, safe inside a `script` element.
pub(super) fn json_for_script<'a>(panels: impl Iterator<Item = &'a Panel>) -> String {
    let panels: Vec<Value> = panels.map(panel).collect();
    // `</script>` and `<!--` would end or derail the element, whatever the JSON says.
    Value::from(panels).to_string().replace('<', "\\u003c")
}

fn panel(panel: &Panel) -> Value {
    let series: Vec<Value> = panel
        .series
        .iter()
        .enumerate()
        .map(|(order, one)| series(one, order))
        .collect();
    json!({
        "title": panel.title,
        "x": axis(&panel.x),
        "y": axis(&panel.y),
        "series": series,
    })
}

fn axis(axis: &Axis) -> Value {
    let Units {
        laboratory,
        laboratory_factor,
        si,
        si_factor,
    } = &axis.units;
    json!({
        "label": axis.label,
        "laboratory": [laboratory, laboratory_factor],
        "si": [si, si_factor],
        "log": axis.logarithmic,
        "limits": axis.limits,
    })
}

fn series(series: &Series, order: usize) -> Value {
    let thin;
    let (shown, thinned) = if series.values.len() > MOST_VALUES {
        thin = envelope(series, MOST_VALUES / 2);
        (&thin, true)
    } else {
        (series, false)
    };
    let count = shown.values.len();
    let x = match &shown.abscissa {
        Abscissa::Even { start, step } => json!([start, step]),
        Abscissa::At(places) => json!(base64_of_floats(places.iter().take(count).copied())),
    };
    let (style, upper) = match &shown.style {
        Style::Line => ("line", Value::Null),
        Style::Dashed => ("dashed", Value::Null),
        Style::Points => ("points", Value::Null),
        Style::Path => ("path", Value::Null),
        Style::Band(upper) => ("band", json!(base64_of_floats(upper.iter().copied()))),
    };
    json!({
        "name": shown.name,
        "style": style,
        "colour": shown.colour.unwrap_or(order + 1),
        "x": x,
        "y": base64_of_floats(shown.values.iter().copied()),
        "upper": upper,
        "thinned": thinned,
    })
}

/// The series with the least and the largest value of each of about `buckets` stretches, in
/// their order, so that no peak is lost.
pub(super) fn envelope(series: &Series, buckets: usize) -> Series {
    let length = series.values.len().div_ceil(buckets);
    let mut keep = Vec::with_capacity(2 * buckets + 2);
    for (bucket, values) in series.values.chunks(length).enumerate() {
        let finite = || {
            values
                .iter()
                .enumerate()
                .filter(|value| value.1.is_finite())
        };
        let by_value = |a: &(usize, &f64), b: &(usize, &f64)| a.1.total_cmp(b.1);
        let least = finite().min_by(by_value).map_or(0, |found| found.0);
        let largest = finite().max_by(by_value).map_or(0, |found| found.0);
        keep.push(bucket * length + least.min(largest));
        keep.push(bucket * length + least.max(largest));
    }
    keep.dedup();
    let pick = |values: &[f64]| {
        keep.iter()
            .filter_map(|&n| values.get(n).copied())
            .collect()
    };
    Series {
        name: series.name.clone(),
        abscissa: Abscissa::At(keep.iter().map(|&n| series.place(n)).collect()),
        values: pick(&series.values),
        style: match &series.style {
            Style::Band(upper) => Style::Band(pick(upper)),
            other => other.clone(),
        },
        colour: series.colour,
    }
}

/// Little-endian 32-bit floats in base 64 (RFC 4648).
fn base64_of_floats(values: impl Iterator<Item = f64>) -> String {
    let mut bytes = Vec::with_capacity(4 * values.size_hint().0);
    for value in values {
        bytes.extend_from_slice(&(value as f32).to_le_bytes());
    }
    base64(&bytes)
}

fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let four = |[first, second, third]: [u8; 3]| {
        let bits = u32::from_be_bytes([0, first, second, third]);
        let letter = |shift: u32| LETTERS[(bits >> shift) as usize & 63];
        [letter(18), letter(12), letter(6), letter(0)]
    };
    let mut text = Vec::with_capacity(bytes.len().div_ceil(3) * 4);
    let threes = bytes.chunks_exact(3);
    let rest = threes.remainder();
    for three in threes {
        text.extend_from_slice(&four([three[0], three[1], three[2]]));
    }
    if let Some(&first) = rest.first() {
        let mut last = four([first, rest.get(1).copied().unwrap_or(0), 0]);
        last[rest.len() + 1..].fill(b'=');
        text.extend_from_slice(&last);
    }
    // Letters of ASCII only.
    String::from_utf8(text).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648.
    #[test]
    fn base_64_as_in_its_standard() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64_of_floats([1.0, -2.5].into_iter()), "AACAPwAAIMA=");
    }

    #[test]
    fn a_long_series_keeps_its_peaks_in_order() {
        let mut values: Vec<f64> = (0..200_000).map(|n| (f64::from(n) * 0.01).sin()).collect();
        values[123_457] = 9.0;
        values[123_458] = -9.0;
        let short = envelope(&Series::history("a", 0.002, &values), 1000);
        assert!(short.values.len() <= 2000);
        let Abscissa::At(places) = &short.abscissa else {
            panic!("places expected")
        };
        assert_eq!(places.len(), short.values.len());
        assert!(places.windows(2).all(|pair| pair[0] < pair[1]));
        let peak = short.values.iter().position(|&value| value == 9.0).unwrap();
        assert!((places[peak] - 123_457.0 * 0.002).abs() < 1e-9);
        assert_eq!(short.values[peak + 1], -9.0);
    }
}
