//! Is the residual noise? Every test gives a normal deviate; the largest one decides.

use std::cell::OnceCell;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

use super::fit::Fit;
use super::model::ExtensibleModel;

/// Largest deviate that noise alone may show among the few hundred tests. Were they exact, 4.5
/// would be passed by chance once in a thousand cases (300 tests). The rest allows for the constant
/// gain of the predictor, which is optimal only for the linear part. Chosen on the generator's
/// cases.
pub const LARGEST_DEVIATE: f64 = 5.6;

/// Root mean square error of a channel in a band, in units of the noise floor, up to which it says nothing of
/// the model. The spectrum of a few thousand samples of noise is known no better.
const KNOWN: f64 = 1.25;
/// As [`KNOWN`], of a channel's whole record, whose level may differ from that of another record.
const KNOWN_WHOLE: f64 = 1.12;
/// As [`KNOWN`], of a part of a record: slow noise wanders.
const KNOWN_PART: f64 = 1.4;
/// As [`KNOWN`], of the drift of a sensor's zero beside a straight line: one record's says little of another's.
const KNOWN_DRIFT: f64 = 4.0;
/// Deviations of the nominal parameters in those stated, up to which they say nothing of the model: a noise of
/// another form than was learned bends them a little. Those farther off are findings of the report.
const KNOWN_SPREAD: f64 = 1.6;
/// How much farther they may be beside effects that explain nearly all. A nominal value with too small an uncertainty
/// says nothing against the effects; the report gives it as a finding.
const STATED_TOO_SURELY: f64 = 2.0;
/// Correlation with state or command up to which it says nothing of the model: 1/1000 of the residual's power.
const UNRELATED: f64 = 0.03;
/// As [`UNRELATED`], beside effects of a larger tolerance that explain nearly all. The constant gain of the predictor is
/// the worse the longer the table sticks. In two worlds the true law, its sizes right, left 0.10 and 0.21 in the record
/// of low level (`judge_tables`, 8041 and 8030).
const UNRELATED_AT_REST: f64 = 0.15;

/// One look at the residuals of one record.
#[derive(Debug, Clone, PartialEq)]
pub struct Test {
    /// What was looked at.
    pub what: String,
    /// Normal deviate under "only noise is left, as well as it is known": negative where there is less.
    pub deviate: f64,
    /// Where, if it is a channel's error in a band or a part of the record.
    pub place: Option<Place>,
    /// True of what was stated of the nominal model, which no effect's form excuses.
    pub is_stated: bool,
}

/// Where a model leaves more than noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Name of the channel; none where all were looked at together.
    pub channel: Option<String>,
    /// Which of its errors.
    pub part: Part,
    /// Root mean square error in units of the noise floor.
    pub over_floor: f64,
}

/// A part of a record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// All of it.
    Whole,
    /// From and to this share of the sampling rate.
    Band(f64, f64),
    /// From and to this sample.
    Samples(usize, usize),
}

impl Test {
    fn of(what: String, deviate: f64) -> Self {
        Self {
            what,
            deviate,
            place: None,
            is_stated: false,
        }
    }

    /// Whether it shows more than noise where traces of an effect may be `tolerance` times larger than usual.
    pub(crate) fn fails(&self, tolerance: f64) -> bool {
        let tolerance = if self.is_stated { 1.0 } else { tolerance };
        self.deviate >= tolerance * LARGEST_DEVIATE
    }

    fn at(self, channel: Option<&str>, part: Part, mean_square: f64) -> Self {
        let place = Place {
            channel: channel.map(str::to_owned),
            part,
            over_floor: mean_square.sqrt(),
        };
        Self {
            place: Some(place),
            ..self
        }
    }
}

/// First line of a periodogram that is asked for noise: what is slower is a drift of zeros.
const FIRST_LINE: usize = 2;
/// Parts that a record is cut into.
const PARTS: usize = 40;
/// Parts of a record, of forty, that may be louder than the rest: bursts of a noise, which no model explains.
const BURSTS: usize = 8;
/// Parts that one of them touches at most.
const ONE_BURST: usize = 2;
/// Standard deviations by which their motion may rank above the middle.
const WITH_THE_MOTION: f64 = 1.5;
/// Slowest lines of a periodogram that a mean is measured by.
const SLOWEST: usize = 4;
/// Edges of the frequency bands as shares of the sampling rate.
const BANDS: [f64; 11] = [
    0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256, 0.5,
];

/// Normal deviate of a sum of squares of `count` standard normal values (Wilson and Hilferty).
pub fn chi_square_deviate(sum: f64, count: f64) -> f64 {
    if count < 1.0 {
        return 0.0;
    }
    let v = 2.0 / (9.0 * count);
    ((sum / count).cbrt() - (1.0 - v)) / v.sqrt()
}

/// Looks at whitened residuals, `channels` a sample, with the channels' names; `regressors` are
/// functions of state and command that a wrong model leaves traces of, `motion` how much the rig moves in the
/// record's parts. Loud errors slower than `drift`, a share of the sampling rate, are the drift of a sensor's zero and
/// have a test of their own. A correlation up to `unrelated` says nothing.
pub fn tests(
    record: &str,
    residuals: &[f64],
    channels: &[&str],
    regressors: &[(String, Vec<f64>)],
    drift: f64,
    unrelated: f64,
    motion: &Motion<'_>,
) -> Vec<Test> {
    let width = channels.len();
    let n = residuals.len() / width.max(1);
    let mut tests = Vec::new();
    if n < 64 {
        return tests;
    }
    let samples = part_of(n);
    let mut steady = without_bursts(residuals, width, samples, motion);
    let mut planner = RealFftPlanner::<f64>::new();
    let transform = planner.plan_fft_forward(n);
    let spectrum_of = |series: &[f64]| {
        let mut spectrum = transform.make_output_vec();
        let done = transform.process(&mut series.to_vec(), &mut spectrum);
        done.is_ok().then_some(spectrum)
    };
    let power = |lines: &[Complex<f64>]| lines.iter().map(|z| z.norm_sqr()).sum::<f64>();
    let slow = FIRST_LINE..((drift * n as f64).ceil() as usize).clamp(FIRST_LINE, n / 2);
    let share = |line: usize| line as f64 / n as f64;
    let faster = OnceCell::new();
    for (c, channel) in channels.iter().enumerate() {
        let mut series: Vec<f64> = steady.iter().skip(c).step_by(width).copied().collect();
        let live = series.iter().filter(|r| **r != 0.0).count() as f64;
        let Some(mut spectrum) = spectrum_of(&series).filter(|_| live > 0.0) else {
            continue;
        };
        // A mean is one more draw of what is slow: it is measured by the slowest lines where those are
        // louder than white noise.
        let mean = series.iter().sum::<f64>() / live;
        let slowest = &spectrum[1..(1 + SLOWEST).min(spectrum.len())];
        let level = (power(slowest) / (slowest.len().max(1) as f64 * live)).max(1.0);
        tests.push(Test::of(
            format!("{record}: {channel}, mean"),
            mean.abs() * (live / level).sqrt(),
        ));
        let mut low = FIRST_LINE;
        let mut known = regressors;
        let count = slow.len() as f64;
        if power(&spectrum[slow.clone()]) > KNOWN.powi(2) * count * live {
            let mut rest = without_line(&series);
            let drifted = spectrum_of(&rest).map_or(0.0, |own| power(&own[slow.clone()]));
            let test = Test::of(
                format!("{record}: {channel}, drift"),
                chi_square_deviate(2.0 * drifted / (KNOWN_DRIFT.powi(2) * live), 2.0 * count),
            );
            let part = Part::Band(share(slow.start), share(slow.end));
            tests.push(test.at(Some(channel), part, drifted / (count * live)));
            rest = without_slow(&mut planner, &rest, slow.end);
            if let Some(own) = spectrum_of(&rest) {
                for (row, value) in steady.chunks_exact_mut(width).zip(&rest) {
                    row[c] = *value;
                }
                (series, spectrum, low) = (rest, own, slow.end);
                known = faster.get_or_init(|| {
                    let all = regressors.iter();
                    all.map(|(name, g)| (name.clone(), without_slow(&mut planner, g, slow.end)))
                        .collect::<Vec<_>>()
                });
            }
        }
        let energy: f64 = series.iter().map(|r| r * r).sum();
        let mean_square = energy / live;
        let whole = Test::of(
            format!("{record}: {channel}, mean square {mean_square:.3}"),
            chi_square_deviate(energy / KNOWN_WHOLE.powi(2), live),
        );
        tests.push(whole.at(Some(channel), Part::Whole, mean_square));
        for edge in BANDS {
            let high = ((edge * n as f64).round() as usize).min(spectrum.len() - 1);
            if high < low + 2 {
                continue;
            }
            let power = power(&spectrum[low..high]);
            let count = (high - low) as f64;
            let band = Test::of(
                format!("{record}: {channel}, below {edge} of the sampling rate"),
                chi_square_deviate(2.0 * power / (KNOWN.powi(2) * live), 2.0 * count),
            );
            tests.push(band.at(
                Some(channel),
                Part::Band(share(low), share(high)),
                power / (live * count),
            ));
            low = high;
        }
        for (name, regressor) in known {
            // What they share with the mean is seen there.
            let centre = regressor.iter().sum::<f64>() / regressor.len().max(1) as f64;
            let size: f64 = regressor.iter().map(|g| (g - centre).powi(2)).sum();
            let pairs = regressor.iter().zip(&series);
            let along: f64 = pairs.map(|(g, r)| (g - centre) * r).sum();
            if size > 0.0 {
                tests.push(Test::of(
                    format!("{record}: {channel} against {name}"),
                    (along / size.sqrt()).abs() - unrelated * energy.sqrt(),
                ));
            }
        }
    }
    let mut parts = Vec::new();
    for (i, part) in steady.chunks_exact(samples * width).enumerate() {
        let energy: f64 = part.iter().map(|r| r * r).sum();
        let live = part.iter().filter(|r| **r != 0.0).count();
        let part = Test::of(
            format!("{record}: part {} of {PARTS}", i + 1),
            chi_square_deviate(energy / KNOWN_PART.powi(2), live as f64),
        );
        parts.push(part.at(
            None,
            Part::Samples(i * samples, (i + 1) * samples),
            energy / live.max(1) as f64,
        ));
    }
    let loud: Vec<usize> = (0..parts.len())
        .filter(|i| parts[*i].deviate > LARGEST_DEVIATE)
        .collect();
    let are_bursts = motion.are_bursts(&loud);
    parts.retain(|part| !are_bursts || part.deviate <= LARGEST_DEVIATE);
    tests.extend(parts);
    tests
}

/// `series` without its straight line, where it is not zero.
fn without_line(series: &[f64]) -> Vec<f64> {
    let live = || series.iter().enumerate().filter(|(_, r)| **r != 0.0);
    let count = live().count().max(1) as f64;
    let middle = live().map(|(k, _)| k as f64).sum::<f64>() / count;
    let mean = live().map(|(_, r)| r).sum::<f64>() / count;
    let (mut along, mut size) = (0.0, 0.0);
    for (k, r) in live() {
        let off = k as f64 - middle;
        along += off * r;
        size += off * off;
    }
    let slope = along / f64::max(size, f64::MIN_POSITIVE);
    let line = |k: usize| mean + slope * (k as f64 - middle);
    let all = series.iter().enumerate();
    all.map(|(k, r)| if *r == 0.0 { 0.0 } else { r - line(k) })
        .collect()
}

/// `series` without its mean and what is slower than line `end` of its periodogram, where it is not zero.
fn without_slow(planner: &mut RealFftPlanner<f64>, series: &[f64], end: usize) -> Vec<f64> {
    let forward = planner.plan_fft_forward(series.len());
    let back = planner.plan_fft_inverse(series.len());
    let mut spectrum = forward.make_output_vec();
    let mut fast = series.to_vec();
    let done = forward.process(&mut fast, &mut spectrum);
    let end = end.min(spectrum.len());
    spectrum[..end].fill(Complex::default());
    match done.and_then(|()| back.process(&mut spectrum, &mut fast)) {
        Ok(()) => {
            let count = series.len() as f64;
            let pairs = fast.iter().zip(series);
            pairs
                .map(|(value, was)| if *was == 0.0 { 0.0 } else { value / count })
                .collect()
        }
        Err(_) => series.to_vec(),
    }
}

/// Samples in a part of a record of `n`.
fn part_of(n: usize) -> usize {
    (n / PARTS).max(16)
}

/// How much a rig moves in the parts of its records.
pub struct Motion<'a> {
    /// In those of a record.
    own: &'a [f64],
    /// In those of all records.
    all: &'a [f64],
    /// Whether effects explain nearly all that the nominal model leaves.
    is_explained: bool,
}

/// How much the rig moves in every part of every record. That is the median, over the record's regressors, of their
/// power there in their mean power over all records: a burst is in some of those, too.
fn motions(records: &[Vec<(String, Vec<f64>)>]) -> Vec<Vec<f64>> {
    let count = records.first().map_or(0, Vec::len);
    let power = |signal: &[f64]| signal.iter().map(|g| g * g).sum::<f64>();
    let mean = |i: usize| {
        let signals = || records.iter().filter_map(|own| Some(&own.get(i)?.1));
        let samples: usize = signals().map(Vec::len).sum();
        let sum: f64 = signals().map(|signal| power(signal)).sum();
        (sum / samples.max(1) as f64).max(f64::MIN_POSITIVE)
    };
    let means: Vec<f64> = (0..count).map(mean).collect();
    let in_parts = |own: &Vec<(String, Vec<f64>)>| -> Vec<f64> {
        let n = own.first().map_or(0, |(_, signal)| signal.len());
        let samples = part_of(n);
        let part = |i: usize| {
            let part = i * samples..(i + 1) * samples;
            let pairs = own.iter().zip(&means);
            let mut all: Vec<f64> = pairs
                .filter_map(|((_, signal), mean)| Some(power(signal.get(part.clone())?) / mean))
                .collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or_default()
        };
        (0..n / samples).map(part).collect()
    };
    records.iter().map(in_parts).collect()
}

/// `residuals` with zeros in the parts of `samples` in which a channel has a burst of noise: one would be in the
/// channel's bands and means as well.
fn without_bursts(
    residuals: &[f64],
    width: usize,
    samples: usize,
    motion: &Motion<'_>,
) -> Vec<f64> {
    let mut steady = residuals.to_vec();
    for channel in 0..width {
        let is_loud = |part: &[f64]| {
            let own = part.iter().skip(channel).step_by(width);
            let energy: f64 = own.map(|r| r * r).sum();
            let deviate = chi_square_deviate(energy / KNOWN_PART.powi(2), samples as f64);
            deviate > LARGEST_DEVIATE
        };
        let parts = residuals.chunks_exact(samples * width).enumerate();
        let loud: Vec<usize> = parts
            .filter(|(_, part)| is_loud(part))
            .map(|(i, _)| i)
            .collect();
        if motion.are_bursts(&loud) {
            for i in loud {
                let part = &mut steady[i * samples * width..(i + 1) * samples * width];
                let own = part.iter_mut().skip(channel).step_by(width);
                own.for_each(|value| *value = 0.0);
            }
        }
    }
    steady
}

impl Motion<'_> {
    /// Whether `loud` parts of a record are bursts of a noise: few, and no more where there is more motion, as
    /// those of a wrong model are. A single burst may be where a record of low level moves most, as long as other
    /// records are quiet where they move as much; and anywhere beside effects that explain all but a burst.
    fn are_bursts(&self, loud: &[usize]) -> bool {
        let count = loud.len() as f64;
        // Ranks of parts that have nothing to do with the motion are even between 0 and 1.
        let deviation = 1.0 / (12.0 * count.max(1.0)).sqrt();
        let is_even = |among: &[f64]| {
            let ranks = loud.iter().filter_map(|i| {
                let own = self.own.get(*i)?;
                let less = among.iter().filter(|other| *other < own).count();
                let same = among.iter().filter(|other| *other == own).count();
                Some((less as f64 + 0.5 * same as f64) / among.len() as f64)
            });
            let mean = ranks.sum::<f64>() / count.max(1.0);
            mean < 0.5 + WITH_THE_MOTION * deviation
        };
        (1..=BURSTS).contains(&loud.len())
            && (is_even(self.own)
                || loud.len() <= ONE_BURST && (self.is_explained || is_even(self.all)))
    }
}

/// Tests of nominal parameters, in their stated standard deviations: of all together, and of the farthest. One that is
/// far off shows a wrong model even if all others are as stated.
fn of_parameters(nuisance: &[f64], is_explained: bool) -> [Test; 2] {
    let spread = KNOWN_SPREAD * if is_explained { STATED_TOO_SURELY } else { 1.0 };
    let squares: f64 = nuisance.iter().map(|p| p * p).sum();
    let farthest = nuisance.iter().fold(0.0f64, |most, p| most.max(p.abs()));
    [
        Test::of(
            "nominal parameters against their stated uncertainty".into(),
            chi_square_deviate(squares / spread.powi(2), nuisance.len() as f64),
        ),
        Test::of(
            "the farthest nominal parameter against its stated uncertainty".into(),
            farthest / spread,
        ),
    ]
    .map(|test| Test {
        is_stated: true,
        ..test
    })
}

/// Tests of whether what `fit` leaves over on `records` is noise, and its parameters plausible; `is_explained` says
/// whether its effects explain nearly all that the nominal model leaves.
pub(crate) fn left_over<M: ExtensibleModel>(
    model: &M,
    fit: &Fit,
    records: &[usize],
    is_explained: bool,
) -> Vec<Test> {
    let mut effects = fit.point.effects.iter();
    let is_rough = effects.any(|(i, _)| model.candidates()[*i].tolerance > 1.0);
    let unrelated = match is_explained && is_rough {
        true => UNRELATED_AT_REST,
        false => UNRELATED,
    };
    let mut all = Vec::new();
    let mut rest = fit.residuals.as_slice();
    let regressors: Vec<_> = records.iter().map(|r| model.regressors(*r)).collect();
    let motions = motions(&regressors);
    let of_all: Vec<f64> = motions.iter().flatten().copied().collect();
    for ((&record, regressors), own) in records.iter().zip(&regressors).zip(&motions) {
        let count = model.residual_count(record).min(rest.len());
        let (mine, others) = rest.split_at(count);
        rest = others;
        all.extend(tests(
            model.record_name(record),
            mine,
            model.channels(),
            regressors,
            model.drifts_below(),
            unrelated,
            &Motion {
                own,
                all: &of_all,
                is_explained,
            },
        ));
    }
    all.extend(of_parameters(&fit.point.nuisance, is_explained));
    let priors = fit.point.prior_rows(model.candidates());
    for (_, off, spread) in priors {
        all.push(Test::of(
            "form of an effect against what is usual".into(),
            (off / spread).abs(),
        ));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Chi-square quantiles of printed tables at the normal deviates 1.6449 (95 %) and 2.3263 (99 %).
    #[test]
    fn bursts_are_few_and_not_where_the_motion_is() {
        let own: Vec<f64> = (0..20).map(f64::from).collect();
        let quiet = [100.0; 20];
        let calm = [-1.0; 20];
        let is_burst = |loud: &[usize], all: &[f64], is_explained| {
            let motion = Motion {
                own: &own,
                all,
                is_explained,
            };
            motion.are_bursts(loud)
        };
        // Anywhere, as long as they do not follow the motion.
        assert!(is_burst(&[3], &calm, false) && is_burst(&[1, 10, 18], &calm, false));
        assert!(!is_burst(&[15, 16, 17, 18, 19], &calm, false));
        assert!(!is_burst(&[], &quiet, true));
        // Eight at most.
        assert!(is_burst(&[0, 1, 2, 3, 4, 5, 6, 7], &calm, false));
        assert!(!is_burst(&[0, 1, 2, 3, 4, 5, 6, 7, 8], &calm, false));
        // One or two where it moves most, if other records move more or effects explain the rest.
        assert!(!is_burst(&[19], &calm, false));
        assert!(is_burst(&[19], &quiet, false) && is_burst(&[19], &calm, true));
        assert!(is_burst(&[18, 19], &quiet, false));
        assert!(!is_burst(&[17, 18, 19], &quiet, true));
        // Parts that move alike are in the middle of each other.
        let alike = Motion {
            own: &[2.0; 4],
            all: &calm,
            is_explained: false,
        };
        assert!(alike.are_bursts(&[0, 1, 2]));
    }

    #[test]
    fn the_deviate_of_a_chi_square_is_that_of_the_tables() {
        for (count, at_95, at_99) in [
            (5.0, 11.070, 15.086),
            (10.0, 18.307, 23.209),
            (30.0, 43.773, 50.892),
            (100.0, 124.342, 135.807),
        ] {
            assert!(
                (chi_square_deviate(at_95, count) - 1.6449).abs() < 0.03,
                "{count}"
            );
            assert!(
                (chi_square_deviate(at_99, count) - 2.3263).abs() < 0.03,
                "{count}"
            );
        }
        // The median of ten.
        assert!(chi_square_deviate(9.342, 10.0).abs() < 0.02);
        assert_eq!(chi_square_deviate(7.0, 0.0), 0.0);
    }

    const STILL: Motion<'_> = Motion {
        own: &[],
        all: &[],
        is_explained: false,
    };

    /// The tests of a record at rest.
    fn looks(
        residuals: &[f64],
        channels: &[&str],
        regressors: &[(String, Vec<f64>)],
        drift: f64,
    ) -> Vec<Test> {
        tests(
            "record", residuals, channels, regressors, drift, UNRELATED, &STILL,
        )
    }

    /// Normal values by the sum of twelve uniform ones.
    fn white(samples: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut one = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
        (0..samples).map(|_| one()).collect()
    }

    #[test]
    fn white_noise_of_unit_variance_passes_every_test() {
        let noise = white(8192);
        let regressors = [("ramp".to_string(), (0..4096).map(f64::from).collect())];
        let all = looks(&noise, &["one", "two"], &regressors, 0.0);
        // A mean square, a mean, bands and a regressor for each channel, and the parts of the record.
        assert!(all.len() > 60, "{}", all.len());
        for test in &all {
            assert!(test.deviate < 4.0, "{test:?}");
        }
        // Neither more nor less than noise: four deviations of a root mean square over the lines of a band.
        for place in all.iter().filter_map(|test| test.place.as_ref()) {
            let values = match place.part {
                Part::Whole => 4096.0,
                Part::Band(from, to) => 2.0 * 4096.0 * (to - from),
                Part::Samples(from, to) => 2.0 * (to - from) as f64,
            };
            let off = (place.over_floor - 1.0) * (2.0 * values).sqrt();
            assert!(off.abs() < 4.0, "{place:?} is off by {off} deviations");
        }
    }

    /// A correlation of 0.2 over 4096 samples: twelve deviations, 0.03 and 0.15 of 64 less.
    #[test]
    fn a_correlation_counts_from_where_it_says_something() {
        let series = white(4096);
        let energy: f64 = series.iter().map(|r| r * r).sum();
        let other = white(8192).split_off(4096);
        let regressor: Vec<f64> = series
            .iter()
            .zip(&other)
            .map(|(a, b)| 0.2 * a + 0.96_f64.sqrt() * b)
            .collect();
        let regressors = [("motion".to_string(), regressor)];
        let deviates = [0.0, UNRELATED, UNRELATED_AT_REST].map(|unrelated| {
            let all = tests(
                "record",
                &series,
                &["one"],
                &regressors,
                0.0,
                unrelated,
                &STILL,
            );
            let own = all
                .iter()
                .find(|test| test.what.ends_with("against motion"));
            own.unwrap().deviate
        });
        assert!(
            (deviates[0] - 0.2 * energy.sqrt()).abs() < 4.0,
            "{deviates:?}"
        );
        for (own, unrelated) in deviates.iter().zip([0.0, 0.03, 0.15]) {
            assert!((deviates[0] - own - unrelated * energy.sqrt()).abs() < 1e-6);
        }
    }

    /// A tone on the line 40 of a record, and nothing else.
    #[test]
    fn a_tone_has_the_figures_of_its_line() {
        let (n, size) = (1024, 3.0);
        let tone = |k: usize| (std::f64::consts::TAU * 40.0 * k as f64 / n as f64 + 0.3).sin();
        let series: Vec<f64> = (0..n).map(|k| size * tone(k)).collect();
        // Its own form about a mean, which does not count.
        let own: Vec<f64> = (0..n).map(|k| 5.0 + 0.1 * tone(k)).collect();
        let other = (0..n).map(|k| f64::from(u8::from(k % 2 == 0))).collect();
        let regressors = [("own".to_string(), own), ("other".to_string(), other)];
        let all = looks(&series, &["one"], &regressors, 0.0);
        let of = |what: &str| {
            let own = all.iter().find(|test| test.what.starts_with(what));
            own.unwrap_or_else(|| panic!("no {what}"))
        };
        let length = n as f64;
        let energy = size * size * length / 2.0;
        assert!(of("record: one, mean").deviate.abs() < 1e-9);
        let whole = of("record: one, mean square 4.500");
        let expected = chi_square_deviate(energy / KNOWN_WHOLE.powi(2), length);
        assert!((whole.deviate - expected).abs() < 1e-6);
        // From the line 33 to 65, of 33 lines.
        let band = of("record: one, below 0.064 of the sampling rate");
        let power = (size * length / 2.0).powi(2);
        let expected = chi_square_deviate(2.0 * power / (KNOWN.powi(2) * length), 66.0);
        assert!((band.deviate / expected - 1.0).abs() < 1e-9);
        let place = band.place.as_ref().unwrap();
        assert!((place.over_floor - (power / length / 33.0).sqrt()).abs() < 1e-9);
        let Part::Band(from, to) = place.part else {
            panic!("{place:?}");
        };
        assert_eq!((from, to), (33.0 / length, 66.0 / length));
        assert!(of("record: one, below 0.032 of the sampling rate").deviate < 0.0);
        // All of it is along its own form.
        let expected = (1.0 - UNRELATED) * energy.sqrt();
        assert!((of("record: one against own").deviate - expected).abs() < 1e-6);
        let other = of("record: one against other").deviate;
        assert!((other + UNRELATED * energy.sqrt()).abs() < 1e-6, "{other}");
        // A level alone is a mean of that many samples.
        let level = looks(&vec![0.5; n], &["one"], &[], 0.0);
        assert!(
            (level[0].deviate - 0.5 * length.sqrt()).abs() < 1e-9,
            "{level:?}"
        );
        assert!(looks(&[1.0; 63], &["one"], &[], 0.0).is_empty());
    }

    #[test]
    fn stated_tests_have_no_tolerance() {
        let own = |deviate, is_stated| Test {
            is_stated,
            ..Test::of("own".to_string(), deviate)
        };
        let most = LARGEST_DEVIATE;
        assert!(own(1.01 * most, false).fails(1.0) && !own(0.99 * most, false).fails(1.0));
        assert!(!own(1.9 * most, false).fails(2.0) && own(2.1 * most, false).fails(2.0));
        assert!(own(1.01 * most, true).fails(2.0) && !own(0.99 * most, true).fails(2.0));
    }

    #[test]
    fn a_burst_is_not_a_model_s_error_and_a_loud_half_is() {
        let failed = |loud: std::ops::Range<usize>| {
            let mut noise = white(16_000);
            // The second channel of two.
            let own = noise.chunks_exact_mut(2).enumerate();
            own.filter(|(i, _)| loud.contains(i))
                .for_each(|(_, row)| row[1] *= 5.0);
            let all = looks(&noise, &["one", "two"], &[], 0.0);
            all.iter()
                .filter(|test| test.deviate > LARGEST_DEVIATE)
                .count()
        };
        // Not in its bands either.
        assert_eq!(failed(1000..1300), 0);
        assert!(failed(4000..8000) > 25);
        // Where there is most motion it is.
        let own: Vec<f64> = (0..40).map(f64::from).collect();
        let motion = Motion {
            own: &own,
            all: &own,
            is_explained: false,
        };
        assert!(motion.are_bursts(&[3, 12, 30]));
        assert!(!motion.are_bursts(&[35, 37, 38]) && !motion.are_bursts(&[39]));
        // Unless effects explain all else.
        let explained = Motion {
            is_explained: true,
            ..motion
        };
        assert!(explained.are_bursts(&[39]) && !explained.are_bursts(&[35, 37, 38]));
        // Unless other records move more and are quiet there.
        let all: Vec<f64> = (0..120).map(f64::from).collect();
        let motion = Motion {
            own: &own,
            all: &all,
            is_explained: false,
        };
        assert!(motion.are_bursts(&[39]) && motion.are_bursts(&[38, 39]));
        assert!(!motion.are_bursts(&[35, 37, 38]));
    }

    #[test]
    fn a_part_s_motion_is_known_among_all_records() {
        let record = |size: f64| {
            let signal = |scale: f64| {
                let moving = |k: usize| scale * size * f64::from(u8::from(k / 20 == 7));
                (0..800).map(moving).collect::<Vec<f64>>()
            };
            let rest = vec![1.0; 800];
            vec![
                ("one".into(), signal(3.0)),
                ("two".into(), signal(0.1)),
                ("sign".into(), rest),
            ]
        };
        let found = motions(&[record(2.0), record(1.0)]);
        assert_eq!(found[0].len(), 40);
        // The median is that of `one`: 20 samples of 6 and of 3, over the mean square of both records.
        let mean = 20.0 * (36.0 + 9.0) / 1600.0;
        for (own, size) in found.iter().zip([6.0, 3.0]) {
            assert!((own[7] / (20.0 * size * size / mean) - 1.0).abs() < 1e-9);
        }
        assert_eq!(found[0][8], 0.0);
    }

    /// A level that is a tenth off says nothing of the model, one that is a third off does.
    #[test]
    fn noise_is_known_to_a_tenth() {
        let worst = |factor: f64| {
            let noise: Vec<f64> = white(40_000).iter().map(|value| factor * value).collect();
            let all = looks(&noise, &["one"], &[], 0.0);
            all.iter().map(|test| test.deviate).fold(0.0, f64::max)
        };
        assert!(worst(1.1) < LARGEST_DEVIATE);
        assert!(worst(1.33) > LARGEST_DEVIATE);
    }

    /// A zero that wanders by as much as the noise is loud: along a line, and about it.
    #[test]
    fn a_drift_of_a_zero_is_not_a_model_s_error_and_what_moves_faster_is() {
        let n = 18_000;
        let failed = |drift: f64, rise: f64, tone: f64, turns: f64| {
            let mut noise = white(n);
            let share = |k: usize| k as f64 / n as f64;
            for (k, value) in noise.iter_mut().enumerate() {
                *value += rise * share(k);
                *value += tone * (std::f64::consts::TAU * turns * share(k)).sin();
            }
            let signal = |k: usize| (std::f64::consts::TAU * turns * share(k)).sin();
            let regressors = [("signal".to_string(), (0..n).map(signal).collect())];
            let all = looks(&noise, &["one"], &regressors, drift);
            let failed = all.iter().filter(|test| test.deviate > LARGEST_DEVIATE);
            failed.map(|test| test.what.clone()).collect::<Vec<_>>()
        };
        // Nine turns in the record.
        let drift = 0.0005;
        for (rise, tone) in [(2.0, 0.0), (0.0, 0.15), (-2.0, -0.15)] {
            assert!(!failed(0.0, rise, tone, 4.0).is_empty());
            assert_eq!(failed(drift, rise, tone, 4.0), Vec::<String>::new());
            assert!(failed(drift, rise, 0.15, 20.0).contains(&"record: one against signal".into()));
        }
        assert_eq!(failed(drift, 0.0, 0.5, 4.0), ["record: one, drift"]);
    }

    /// Play that the noises took up left one parameter of fifteen eleven deviations off, and three at three.
    #[test]
    fn one_parameter_that_is_far_off_fails_where_all_together_pass() {
        let worst = |farthest: f64, is_explained: bool| {
            let mut nuisance = [0.0; 15];
            nuisance[..4].copy_from_slice(&[farthest, 3.4, -2.4, -3.0]);
            of_parameters(&nuisance, is_explained).map(|test| test.deviate)
        };
        let [together, alone] = worst(-11.4, false);
        assert!(together < LARGEST_DEVIATE && alone > LARGEST_DEVIATE);
        assert!(worst(-8.0, false).iter().all(|own| *own < LARGEST_DEVIATE));
        assert!(worst(-11.4, true).iter().all(|own| *own < LARGEST_DEVIATE));
        assert!(worst(-19.0, true)[1] > LARGEST_DEVIATE);
    }

    #[test]
    fn a_tone_shows_in_its_band_and_not_in_the_others() {
        let mut noise = white(4096);
        for (k, value) in noise.iter_mut().enumerate() {
            *value += 0.7 * (std::f64::consts::TAU * 0.1 * k as f64).sin();
        }
        let all = looks(&noise, &["one"], &[], 0.0);
        let bands = all
            .iter()
            .filter(|test| test.what.contains("sampling rate"));
        for test in bands {
            // 0.1 of the sampling rate is above 0.064 and below 0.128.
            let is_there = test.what.contains("below 0.128");
            assert_eq!(test.deviate > 5.6, is_there, "{test:?}");
        }
    }
}
