//! Rigs that are integrated here, whose numbers are known, from their files to the page.

use std::f64::consts::TAU;

use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::sensors::channel::Noise;

use super::*;
use pages::report::{Abscissa, Panel, Section, Style};

const PERIOD: f64 = 0.002;

fn request(data: &Path) -> Request {
    Request {
        data: vec![data.to_path_buf()],
        model: "model.toml".into(),
        fit_part: 0.75,
        specimen: None,
        hydraulic_first: false,
        columns: None,
        one_input: false,
    }
}

fn gaussian(seed: u64, channel: u64, sample: usize) -> f64 {
    let sample = sample as u64;
    let noise = Noise {
        seed,
        channel,
        sample,
    };
    noise.gaussian()
}

fn headings(page: &Report) -> Vec<&str> {
    page.sections.iter().map(|own| &*own.heading).collect()
}

fn section<'a>(page: &'a Report, heading: &str) -> &'a Section {
    let mut all = page.sections.iter();
    all.find(|own| own.heading == heading).unwrap()
}

fn places(panel: &Panel, series: usize) -> Vec<f64> {
    match &panel.series[series].abscissa {
        Abscissa::At(places) => places.to_vec(),
        Abscissa::Even { .. } => panic!("places expected"),
    }
}

/// The value of a curve that was drawn, next to `place`.
fn at(panel: &Panel, series: usize, place: f64) -> f64 {
    let places = places(panel, series);
    let values = places.iter().zip(&panel.series[series].values);
    let known = values.filter(|(_, value)| value.is_finite());
    let nearest = known.min_by(|a, b| (a.0 - place).abs().total_cmp(&(b.0 - place).abs()));
    *nearest.unwrap().1
}

/// `x' = w`, `LAG w' = GAIN u - w` under `u = 60 V/m (r - x)`.
const GAIN: f64 = 0.15;
const LAG: f64 = 0.02;

/// A file of command (V) and displacement (mm).
fn valve_driven(path: &Path) {
    let (mut x, mut w, mut wanted) = (0.0, 0.0, [0.0; 2]);
    let mut text = "time [s],valve_command [V],displacement [mm]\n".to_string();
    for k in 0..15_000 {
        wanted[0] += 0.02 * (0.02 * gaussian(3, 1, k) - wanted[0]);
        wanted[1] += 0.2 * (wanted[0] - wanted[1]);
        let command = 60.0 * (wanted[1] - x - 2e-6 * gaussian(3, 2, k));
        let shown = 1e3 * (x + 2e-6 * gaussian(3, 2, k));
        text += &format!("{},{command},{shown}\n", k as f64 * PERIOD);
        // Both in closed form over a sample.
        let (settled, decay) = (GAIN * command, (-PERIOD / LAG).exp());
        x += settled * PERIOD + (w - settled) * LAG * (1.0 - decay);
        w = settled + (w - settled) * decay;
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn command_and_displacement_alone_give_their_transfer_function() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("valve.csv");
    valve_driven(&path);
    let outcome = identify(&request(&path)).unwrap();
    let Outcome::OneInput(found) = &outcome else {
        panic!("a rig without forces")
    };
    let (own, summary) = (&found.own, outcome.summary());
    // An integrator and the lag.
    let mut poles = summary.actuator_poles_rad_s.clone();
    poles.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert!((poles[0][0] * LAG + 1.0).abs() < 0.05, "{poles:?}");
    assert_eq!(poles[1], [0.0; 2]);
    assert!(summary.table_poles_rad_s.is_empty() && summary.identifiable);
    assert!(summary.fit_percent["displacement"].unwrap() > 99.0);
    let parameters = own.parameters();
    let number = |name: &str| -> f64 {
        let row = parameters.iter().find(|row| row[0] == name).unwrap();
        row[1].parse().unwrap()
    };
    assert!((number("numerator, s^0") * LAG / GAIN - 1.0).abs() < 0.05);
    assert!((number("denominator, s^1") * LAG - 1.0).abs() < 0.05);
    assert_eq!(number("denominator, s^0"), 0.0);
    assert!(number("delay").abs() < 1e-3);
    let units: Vec<&str> = parameters.iter().map(|row| &*row[3]).collect();
    assert_eq!(units, ["m/V 1/s^2", "1/s^1", "-", "s"]);
    let rows = own.candidates();
    let chosen = rows.iter().filter(|row| row[3].ends_with(" (chosen)"));
    let chosen: Vec<_> = chosen.map(|row| row[..3].to_vec()).collect();
    assert_eq!(chosen, [["1", "0", "yes"]]);

    let page = own.report(summary);
    assert_eq!(headings(&page), ["Model", "Validation"]);
    assert!(
        page.summary
            .starts_with("on the part that was not fitted: 99.")
    );
    let [_, gain, phase] = &section(&page, "Model").panels[..] else {
        panic!("poles, gain and phase expected")
    };
    let lines = places(gain, 1);
    let driven: Vec<f64> = lines
        .into_iter()
        .filter(|own| (0.5..8.0).contains(own))
        .collect();
    assert!(driven.len() > 5, "{driven:?}");
    for hertz in driven {
        let omega = TAU * hertz;
        let size = 20.0 * (GAIN / (omega * (omega * LAG).hypot(1.0))).log10();
        // Held over a sample, the command acts half a one later.
        let turn = -90.0 - (omega * LAG).atan().to_degrees() - (0.5 * omega * PERIOD).to_degrees();
        for series in [1, 2] {
            let off = at(gain, series, hertz) - size;
            assert!(off.abs() < 1.0, "{hertz} Hz: {off} dB");
        }
        for series in [0, 1] {
            let off = at(phase, series, hertz) - turn;
            assert!(off.abs() < 8.0, "{hertz} Hz: {off} degrees");
        }
        assert!(at(gain, 0, hertz) <= at(gain, 1, hertz));
    }
    // The band reaches two deviations to either side.
    let Style::Band(above) = &gain.series[0].style else {
        panic!("a band expected")
    };
    let linear = |decibel: f64| 10_f64.powf(decibel / 20.0);
    let ends = gain.series[0].values.iter().zip(above);
    let mut clear = 0;
    for (measured, (low, high)) in own.found.response.iter().zip(ends) {
        let (size, half) = (measured.value.norm(), 2.0 * measured.deviation);
        assert!((linear(*high) / (size + half) - 1.0).abs() < 1e-9);
        if half < 0.9 * size {
            assert!((linear(*low) / (size - half) - 1.0).abs() < 1e-9);
            clear += 1;
        }
    }
    assert!(clear > 5, "{clear}");
    let [rest] = &section(&page, "Validation").panels[..] else {
        panic!("one recording")
    };
    let [measured, simulated] = [0, 1].map(|n| &rest.series[n].values);
    let rms = |values: &mut dyn Iterator<Item = f64>| -> f64 {
        values.map(|value| value * value).sum::<f64>().sqrt()
    };
    let off = rms(&mut measured.iter().zip(simulated).map(|(m, s)| m - s));
    assert!(off < 0.02 * rms(&mut measured.iter().copied()));

    let out = folder.path().join("found/model.toml");
    outcome.write(&Out::new(&out)).unwrap();
    let written = std::fs::read_to_string(&out).unwrap();
    assert_eq!(written, own.text);
    assert!(out.with_extension("html").is_file());
}

/// A bare rig under displacement control, recorded with noise, with its reference.
fn rig(seconds: f64) -> (IdentifiedRig, Recording) {
    const NOISE: [f64; 3] = [1.3e-5, 0.04, 1.3];
    let rig = IdentifiedRig::default();
    let sampled = rig.sample(PERIOD, 2).unwrap();
    let mut state = IdentifiedRigState::default();
    let mut columns: [Vec<f64>; 5] = Default::default();
    let mut wanted = [0.0; 2];
    for k in 0..(seconds / PERIOD) as usize {
        wanted[0] += 0.05 * (0.05 * gaussian(7, 9, k) - wanted[0]);
        wanted[1] += 0.1 * (wanted[0] - wanted[1]);
        let mut shown = sampled.measure(&mut state, k as f64 * PERIOD);
        for (channel, (value, size)) in (0..).zip(shown.iter_mut().zip(NOISE)) {
            *value += size * gaussian(7, channel, k);
        }
        let command = 118.0 * (wanted[1] - shown[0]);
        let row = [wanted[1], command, shown[0], shown[1], shown[2]];
        for (column, value) in columns.iter_mut().zip(row) {
            column.push(value);
        }
        sampled.step(&mut state, command);
    }
    let channels = [
        Channel::Reference,
        Channel::ValveCommand,
        Channel::Displacement,
        Channel::Acceleration,
        Channel::ActuatorForce,
    ];
    let channels = channels.into_iter().zip(columns).collect();
    (rig, Recording::new("made", PERIOD, channels).unwrap())
}

#[test]
fn a_rig_with_its_forces_is_found_and_shown() {
    let (rig, recording) = rig(30.0);
    let found = from_recordings(vec![recording], &request(Path::new("made.csv"))).unwrap();
    let Form::General(own) = &found.form else {
        panic!("a linear rig expected")
    };
    let summary = &found.summary;
    let truth = rig.shake_table.table.transfer_function().poles();
    for pole in &summary.table_poles_rad_s {
        let off = truth
            .iter()
            .map(|own| (own.re - pole[0]).hypot(own.im - pole[1]));
        let size = pole[0].hypot(pole[1]);
        assert!(off.fold(f64::INFINITY, f64::min) < 0.1 * size, "{pole:?}");
    }
    let fitted: Vec<&str> = summary.fit_percent.keys().map(String::as_str).collect();
    assert_eq!(fitted, ["acceleration", "actuator_force", "displacement"]);
    assert!(found.model_file().unwrap().to_toml().is_ok());

    let page = page::report(own, &found.recordings, summary);
    assert_eq!(
        headings(&page),
        [
            "Model",
            "Validation",
            "Residuals",
            "Order",
            "Frequency responses"
        ]
    );
    let length = page.identity.iter().find(|own| own.0 == "Length").unwrap();
    assert!(
        matches!(length.1, pages::report::Cell::Quantity(seconds, ..) if (seconds - 30.0).abs() < 0.01)
    );
    let validation = section(&page, "Validation");
    assert_eq!(validation.panels.len(), own.fits.len());
    let [order] = &section(&page, "Order").panels[..] else {
        panic!("one plot expected")
    };
    assert!(order.title.ends_with("(the model has order 5)"));
    assert_eq!(places(order, 0)[..3], [1.0, 2.0, 3.0]);
    assert_eq!(order.series[0].values.len(), places(order, 0).len());

    // A row, a correlation with itself and one with the command per channel; the band around them is the widest.
    let residuals = section(&page, "Residuals");
    let lags = own.residuals[0].2.autocorrelation.len();
    for (panel, first) in residuals.panels.iter().zip([1.0, 0.0]) {
        assert_eq!(panel.series.len(), 1 + own.residuals.len());
        assert_eq!(places(panel, 0), [0.0, lags as f64]);
        assert_eq!(places(panel, 1)[0], first);
    }
    let widest = own
        .residuals
        .iter()
        .map(|own| own.2.band)
        .fold(0.0, f64::max);
    assert_eq!(residuals.panels[0].series[0].values, [-widest; 2]);

    // What was measured is the rig's own response where it was driven, and so is the model's.
    let responses = section(&page, "Frequency responses");
    let titles: Vec<&str> = responses.panels.iter().map(|own| &*own.title).collect();
    assert_eq!(
        titles[..7],
        [
            "valve_command to displacement, gain",
            "valve_command to displacement, phase",
            "valve_command to acceleration, gain",
            "valve_command to acceleration, phase",
            "valve_command to actuator_force, gain",
            "valve_command to actuator_force, phase",
            "Coherence",
        ]
    );
    assert!(responses.text[0].contains("with the reference as instrument"));
    for channel in [0, 2, 4] {
        for hertz in [2.0, 5.0, 10.0] {
            let of = |panel: usize, series| at(&responses.panels[panel], series, hertz);
            let off = of(channel, 1) - of(channel, 2);
            assert!(
                off.abs() < 2.0,
                "{} at {hertz} Hz: {off} dB",
                titles[channel]
            );
            let [low, high] = [of(channel, 0), of(channel, 1)];
            assert!(low < high);
            let off = (of(channel + 1, 0) - of(channel + 1, 1)).abs();
            assert!(
                off.min(360.0 - off) < 15.0,
                "{} at {hertz} Hz: {off}",
                titles[channel + 1]
            );
        }
    }
    if own.identifiable {
        assert_eq!(
            titles[7..],
            ["G1, command to force", "G2, velocity to force"]
        );
        assert_eq!(
            summary.actuator_poles_rad_s.len(),
            own.actuator_poles().len()
        );
    }
}

#[test]
fn pieces_that_are_too_short_are_left_out_where_longer_ones_remain() {
    let piece = |name: &str, seconds: f64| {
        let samples = vec![1.0; (seconds / PERIOD) as usize + 1];
        Recording::new(name, PERIOD, vec![(Channel::Displacement, samples)]).unwrap()
    };
    let names = |pieces: Vec<Recording>| {
        let mut warnings = Vec::new();
        let kept = long_enough(pieces, &mut warnings);
        let names: Vec<String> = kept.into_iter().map(|own| own.name).collect();
        (names, warnings)
    };
    let (kept, told) = names(vec![piece("a", 6.0), piece("b", 2.0), piece("c", 5.5)]);
    assert_eq!(kept, ["a", "c"]);
    assert_eq!(told, ["b: ignored, 2.00 s are too short"]);
    // The longest of short ones stays.
    let (kept, told) = names(vec![piece("a", 1.0), piece("b", 3.0)]);
    assert_eq!((kept, told.len()), (vec!["b".to_string()], 1));
}
