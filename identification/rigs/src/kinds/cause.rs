//! What differs from a rig as it should be, with its value and interval, in words.

use serde::{Deserialize, Serialize};

use super::named_value::NamedValue;

/// Standard deviations to either side of an estimate that hold the truth in 95 of 100 cases.
pub const INTERVAL_95: f64 = 1.96;
/// Half of that interval over the value above which the data do not determine the value: an interval so wide is
/// that of a singular fit, while a value near zero with an ordinary interval is an answer.
const WIDE: f64 = 100.0;

/// Stated deviations from which on a parameter is not what was stated.
pub(super) const FROM: f64 = 2.0;

/// Integral over proportional gain, 1/s, below which it makes up for nothing during a record: it takes minutes.
const SLOW: f64 = 2e-3;

/// A nominal parameter such as a scale or an offset that is not what was stated, or a sensor that
/// contradicts another one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// What was found, SI, under the parameter's name.
    pub found: NamedValue,
    /// What was stated, SI.
    pub stated: f64,
}

impl Cause {
    /// The cause, if `found` is beyond two of the deviations `stated_within` of `stated`, and by more than
    /// chance.
    pub fn of(found: NamedValue, (stated, stated_within): (f64, f64)) -> Option<Self> {
        Self::perhaps(found, (stated, stated_within)).filter(Self::is_clear)
    }

    /// As [`Self::of`], where it may be chance.
    pub(super) fn perhaps(found: NamedValue, (stated, stated_within): (f64, f64)) -> Option<Self> {
        let is_off = (found.value - stated).abs() > FROM * stated_within;
        is_off.then_some(Self { found, stated })
    }

    /// Whether it is off by more than chance.
    pub(super) fn is_clear(&self) -> bool {
        self.deviations() > 2.5
    }

    /// Probability that it is off by as much as rigs are and not by chance, either as likely before the data.
    pub(super) fn weight(&self) -> f64 {
        // Standard deviation of the shares, and of the delays in s, by which what is off is off.
        const SHARE: f64 = 0.1;
        const LATE: f64 = 0.01;
        let error = self.found.standard_error;
        let off = (self.found.value - self.stated).abs();
        // Of a delay the interval is what data leave open, all of it alike.
        let (usual, off) = if self.found.unit == "s" {
            (LATE, (off - INTERVAL_95 * error).max(0.0))
        } else {
            (SHARE, off)
        };
        let density = |deviation: f64| (-0.5 * (off / deviation).powi(2)).exp() / deviation;
        let [chance, fault] = [density(error), density(error.hypot(usual))];
        fault / (fault + chance)
    }

    /// The ends of its 95 % interval.
    pub(super) fn ends(&self) -> (f64, f64) {
        let half = INTERVAL_95 * self.found.standard_error;
        (self.found.value - half, self.found.value + half)
    }

    /// Widens its interval to what data leave open, from `low` to `high`: the middle may be beside what a fit found.
    pub(super) fn widen(&mut self, (low, high): (f64, f64)) {
        let half = 0.5 * (high - low);
        if half > INTERVAL_95 * self.found.standard_error {
            self.found.value = low + half;
            self.found.standard_error = half / INTERVAL_95;
        }
    }

    /// Whether data leave open, from `low` to `high`, that it is as rigs without a fault are, `within` of what was stated.
    pub(super) fn is_usual(&self, (low, high): (f64, f64), within: f64) -> bool {
        low < self.stated + within && high > self.stated - within
    }

    /// Standard errors between what was found and what was stated.
    pub(super) fn deviations(&self) -> f64 {
        (self.found.value - self.stated).abs() / self.found.standard_error
    }

    /// What explains it as well in a model of these `parameters`, as an effect and in words: without an integral that
    /// makes up for it, a table on a spring moves less than commanded.
    pub fn or(&self, parameters: &[NamedValue]) -> Option<(&'static str, &'static str)> {
        let is_short = self.found.name == "scale" && self.found.value < self.stated;
        let gives_way = |p: &NamedValue| p.name == "integral" && p.value < SLOW;
        let spring = ("table_spring", "a spring under it holds it back");
        (is_short && parameters.iter().any(gives_way)).then_some(spring)
    }

    /// Whether it makes up for others of these `parameters`: no command arrives early, but in a model with a lag that is
    /// too long. Without one the record's channels are shifted.
    pub fn makes_up(&self, parameters: &[NamedValue]) -> bool {
        const LAGS: [&str; 3] = ["command_lag", "loop_lag", "resonance"];
        let is_early = self.found.name == "command_delay" && self.found.value < self.stated;
        let mut lags = parameters
            .iter()
            .filter(|p| LAGS.contains(&p.name.as_str()));
        is_early && lags.any(|p| p.value > 0.0)
    }

    /// How much of it may be a lag that a fit of these `parameters` lost, which is `stated` by its place: a mass that rings
    /// has oil under it, so that a valve moves it, and a valve lags.
    pub(super) fn lost_lag(&self, parameters: &[NamedValue], stated: impl Fn(usize) -> f64) -> f64 {
        const RINGS: f64 = 0.45;
        const LOST: f64 = 0.01;
        let is_late = self.found.name == "command_delay" && self.found.value > self.stated;
        let rings = |p: &NamedValue| match p.name.as_str() {
            "resonance" => p.value > 0.0,
            "resonance_damping" => p.value < RINGS,
            _ => false,
        };
        if !is_late || parameters.iter().filter(|p| rings(p)).count() < 2 {
            return 0.0;
        }
        let lag = parameters.iter().position(|p| p.name == "loop_lag");
        lag.map(|i| (parameters[i].value, stated(i)))
            .filter(|(value, stated)| *value < LOST * stated)
            .map_or(0.0, |(_, stated)| stated)
    }

    /// The cause in words, with value, unit and 95 % interval.
    pub fn words(&self) -> String {
        let NamedValue {
            name,
            value,
            unit,
            standard_error,
        } = &self.found;
        let by = value - self.stated;
        let size = |unit: &str| measure(by.abs(), *standard_error, unit);
        let share = || {
            let text = measure(100.0 * by.abs(), 100.0 * standard_error, "1");
            format!("{text} %")
        };
        let more = if by > 0.0 { "more" } else { "less" };
        let high = if by > 0.0 { "high" } else { "low" };
        let too = |what: &str| format!("{what} {} too {high}", size(unit));
        match name.as_str() {
            "command_delay" => {
                let when = if by > 0.0 { "late" } else { "early" };
                format!("the command arrives {} {when}", size(unit))
            }
            "scale" => format!("the table moves {} {more} than commanded", share()),
            "offset" if unit == "m" => too("the displacement reads"),
            "load_cell_zero" => too("the load cell reads"),
            "position_zero" => too("the recorded position is"),
            "accelerometer_scale" => format!(
                "the accelerometer reads {} {more} than the displacement says",
                share()
            ),
            _ => format!(
                "{} is {} and not {}",
                name.replace('_', " "),
                measure(*value, *standard_error, unit),
                measure(self.stated, f64::NAN, unit)
            ),
        }
    }
}

/// An effect with its parameters, for a sentence.
pub(super) fn effect_in_words(name: &str, values: &[NamedValue]) -> String {
    let own = |p: &NamedValue| measure(p.value, p.standard_error, &p.unit);
    let name = name.replace('_', " ");
    match values {
        [] => name,
        [one] => match ends(one.value, one.standard_error, true) {
            [low, high] if low == 0.0 || high == 0.0 => {
                let far = measure(low + high, f64::NAN, &one.unit);
                format!("{name} (0 to {far})")
            }
            _ => format!("{name} ({})", own(one)),
        },
        [size, details @ ..] => {
            // Details that data do not tell are of no use to a reader.
            let holds_zero = |p: &&NamedValue| p.value.abs() <= INTERVAL_95 * p.standard_error;
            let told = details.iter().filter(|p| !holds_zero(p));
            let all: Vec<String> = std::iter::once(size)
                .chain(told)
                .map(|p| format!("{} {}", p.name.replace('_', " "), own(p)))
                .collect();
            format!("{name} ({})", all.join(", "))
        }
    }
}

/// The ends of the 95 % interval of a value. The only size of a named effect is not beyond zero: the effect is there,
/// whatever size it has.
pub fn ends(value: f64, standard_error: f64, is_only: bool) -> [f64; 2] {
    let half = INTERVAL_95 * standard_error;
    let ends = [value - half, value + half];
    if !is_only || is_undetermined(value, standard_error) {
        return ends;
    }
    if value > 0.0 {
        [ends[0].max(0.0), ends[1]]
    } else {
        [ends[0], ends[1].min(0.0)]
    }
}

/// Whether the interval of a value is so wide that the data do not determine it.
pub fn is_undetermined(value: f64, standard_error: f64) -> bool {
    value != 0.0 && INTERVAL_95 * standard_error > WIDE * value.abs()
}

/// A sentence on the parameters of `effects` that the data do not determine, and on what to record.
pub(super) fn undetermined(effects: &[(String, Vec<NamedValue>)]) -> Option<String> {
    let all = effects.iter().flat_map(|(effect, values)| {
        let wide = values
            .iter()
            .filter(|p| is_undetermined(p.value, p.standard_error));
        wide.map(move |p| format!("`{effect}.{}`", p.name))
    });
    match &all.collect::<Vec<String>>()[..] {
        [] => None,
        [one] => Some(format!(
            "these records do not determine {one}: record a larger motion, or other levels of the inputs"
        )),
        several => Some(format!(
            "these records do not determine {} one by one, because one compensates for another: record more \
             levels of the inputs and of the motion",
            joined(several)
        )),
    }
}

/// A value with its 95 % interval, in a unit that laboratories use.
pub(super) fn measure(value: f64, standard_error: f64, unit: &str) -> String {
    if is_undetermined(value, standard_error) {
        let about = measure(value, f64::NAN, unit);
        return format!("about {about}, not determined by these records");
    }
    let (unit, factor) = match unit {
        "m" => ("mm", 1e3),
        "s" => ("ms", 1e3),
        "Pa" => ("MPa", 1e-6),
        "1" => ("", 1.0),
        other => (other, 1.0),
    };
    let (value, half) = (factor * value, INTERVAL_95 * factor * standard_error);
    let power = value.abs().log10().floor();
    if value.is_finite() && value != 0.0 && !(-4.0..5.0).contains(&power) {
        let one = 10f64.powf(power);
        let text = plain(value / one, half / one);
        return format!("({text})e{power} {unit}").trim_end().to_owned();
    }
    format!("{} {unit}", plain(value, half))
        .trim_end()
        .to_owned()
}

/// A value and half its interval, by the interval's first digit; a value alone by three.
fn plain(value: f64, half: f64) -> String {
    let digits_of = |size: f64| -> usize {
        if size.is_finite() && size > 0.0 {
            (-size.log10().floor()).clamp(0.0, 9.0) as usize
        } else {
            0
        }
    };
    if half.is_finite() && half > 0.0 {
        let digits = digits_of(half).min(digits_of(value) + 4);
        let half = half.max(10f64.powi(-(digits as i32)));
        format!("{value:.digits$} ± {half:.digits$}")
    } else {
        let power = if value == 0.0 {
            2.0
        } else {
            value.abs().log10().floor()
        };
        let digits = (2.0 - power).clamp(0.0, 9.0) as usize;
        format!("{value:.digits$}")
    }
}

/// An effect of the user's own by its `sentence`, in which `{parameter}` is replaced by the value with its
/// interval; parameters that it does not hold follow in parentheses. It follows "shows".
pub(super) fn in_own_words(sentence: &str, values: &[NamedValue]) -> String {
    let mut text = sentence.trim().trim_end_matches('.').to_owned();
    let mut rest = Vec::new();
    for p in values {
        let place = format!("{{{}}}", p.name);
        let own = measure(p.value, p.standard_error, &p.unit);
        if text.contains(&place) {
            text = text.replace(&place, &own);
        } else {
            rest.push(format!("{} {own}", p.name.replace('_', " ")));
        }
    }
    if rest.is_empty() {
        format!("that {text}")
    } else {
        format!("that {text} ({})", rest.join(", "))
    }
}

/// Parts of a sentence, joined.
pub(super) fn joined(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(name: &str, value: f64, standard_error: f64, unit: &str) -> NamedValue {
        NamedValue {
            name: name.into(),
            value,
            unit: unit.into(),
            standard_error,
        }
    }

    #[test]
    fn a_delay_that_may_be_none_weighs_less_than_none_the_less_the_narrower() {
        let weight = |value: f64, error: f64| {
            let found = found("command_delay", value, error, "s");
            Cause { found, stated: 0.0 }.weight()
        };
        // All of 0 to 4 ms and of 0 to 40 ms, whatever the middle.
        let [narrow, wide] = [4e-3, 4e-2].map(|far| weight(0.5 * far, 0.5 * far / INTERVAL_95));
        assert!(
            (narrow - 1.02e-3 / (1.02e-3 + 10.05e-3)).abs() < 1e-3,
            "{narrow}"
        );
        assert!(narrow < wide && wide < 0.5, "{narrow} {wide}");
        assert!(weight(4e-3, 0.5e-3) > 0.9);
    }

    #[test]
    fn a_delay_beside_a_mass_that_rings_may_be_the_lag_of_its_valve() {
        let lost = |name: &str, value: f64, lag: f64, damping: f64| {
            let own = [
                found("loop_lag", lag, 1e-3, "s"),
                found("resonance", 6e-3, 1e-4, "s"),
                found("resonance_damping", damping, 0.01, "1"),
            ];
            let found = found(name, value, 1e-3, "s");
            Cause { found, stated: 0.0 }.lost_lag(&own, |i| [4e-3, 5e-3, 0.5][i])
        };
        assert_eq!(lost("command_delay", 4e-3, 0.0, 0.3), 4e-3);
        assert_eq!(lost("command_delay", 4e-3, 1e-3, 0.3), 0.0);
        assert_eq!(lost("command_delay", 4e-3, 0.0, 0.6), 0.0);
        assert_eq!(lost("command_delay", -4e-3, 0.0, 0.3), 0.0);
        assert_eq!(lost("offset", 4e-3, 0.0, 0.3), 0.0);
        let found = found("command_delay", 4e-3, 1e-3, "s");
        assert_eq!(Cause { found, stated: 0.0 }.lost_lag(&[], |_| 1.0), 0.0);
    }

    #[test]
    fn a_share_weighs_as_much_as_it_is_beyond_chance() {
        let weight = |value: f64, error: f64| {
            let found = found("accelerometer_scale", value, error, "1");
            Cause::perhaps(found, (1.0, 0.01)).map(|own| own.weight())
        };
        assert_eq!(weight(1.015, 1e-3), None);
        // Both densities are those of a normal distribution: 0.05 beside 0.02 and beside 0.102.
        let own = weight(1.05, 0.02).unwrap();
        assert!((own - 0.7983).abs() < 1e-4, "{own}");
        assert_eq!(weight(0.95, 0.02), Some(own));
        assert!(weight(1.05, 0.01).unwrap() > 0.999);
        assert!(weight(1.03, 0.05).unwrap() < 0.35);
    }

    #[test]
    fn causes_have_their_value_unit_and_interval() {
        let cause = |value: NamedValue, stated| Cause::of(value, stated).map(|own| own.words());
        let delay = found("command_delay", 12.1e-3, 5e-5, "s");
        assert_eq!(
            cause(delay, (0.0, 1e-3)).as_deref(),
            Some("the command arrives 12.10 ± 0.10 ms late")
        );
        let scale = found("scale", 1.0498, 6e-4, "1");
        assert_eq!(
            cause(scale, (1.0, 0.01)).as_deref(),
            Some("the table moves 5.0 ± 0.1 % more than commanded")
        );
        assert_eq!(cause(found("scale", 1.015, 1e-3, "1"), (1.0, 0.01)), None);
        assert_eq!(cause(found("scale", 1.05, 0.03, "1"), (1.0, 0.01)), None);
        let high = found("load_cell_zero", 33e6, 1.4e6, "Pa");
        assert_eq!(
            cause(high, (0.0, 2e6)).as_deref(),
            Some("the load cell reads 33 ± 3 MPa too high")
        );
        let low = found("load_cell_zero", -1031.0, 150.0, "N");
        assert_eq!(
            cause(low, (0.0, 100.0)).as_deref(),
            Some("the load cell reads 1031 ± 294 N too low")
        );
        let offset = found("offset", -1.2e-3, 1e-4, "m");
        assert_eq!(
            cause(offset, (0.0, 1e-4)).as_deref(),
            Some("the displacement reads 1.2 ± 0.2 mm too low")
        );
    }

    #[test]
    fn a_spring_explains_a_table_that_moves_less_where_no_integral_works_against_it() {
        let with = |integral: f64| [found("integral", integral, 0.0, "1/s")];
        let or = |scale: f64, all: &[NamedValue]| {
            let cause = Cause::of(found("scale", scale, 1e-3, "1"), (1.0, 0.01)).unwrap();
            cause.or(all).map(|(name, _)| name)
        };
        assert_eq!(or(0.95, &with(0.0)), Some("table_spring"));
        assert_eq!(or(0.95, &with(1e-4)), Some("table_spring"));
        assert_eq!(or(0.95, &with(0.5)), None);
        assert_eq!(or(1.05, &with(0.0)), None);
        assert_eq!(or(0.95, &[]), None);
    }

    #[test]
    fn an_early_command_is_a_cause_only_where_no_lag_is_too_long() {
        let with = |lag: f64| {
            [
                found("integral", 0.5, 0.0, "1/s"),
                found("resonance", lag, 1e-4, "s"),
            ]
        };
        let cause = |delay: f64| {
            let own = found("command_delay", delay, 1e-4, "s");
            Cause::of(own, (0.0, 1e-3)).unwrap()
        };
        assert!(cause(-3e-3).makes_up(&with(2e-3)));
        assert!(!cause(-3e-3).makes_up(&with(0.0)));
        assert!(!cause(3e-3).makes_up(&with(2e-3)));
    }

    #[test]
    fn an_effect_has_its_parameters_beside_it() {
        let width = found("half_width", 3.6e-5, 1e-6, "m");
        assert_eq!(
            effect_in_words("dead_band", std::slice::from_ref(&width)),
            "dead band (0.036 ± 0.002 mm)"
        );
        let memory = |value: f64| [found("decay", value, 21.0, "1/m")];
        assert_eq!(
            effect_in_words("excursion_memory", &memory(39.65)),
            "excursion memory (0 to 80.8 1/m)"
        );
        assert_eq!(
            effect_in_words("excursion_memory", &memory(-39.65)),
            "excursion memory (0 to -80.8 1/m)"
        );
        let stiffness = found("stiffness", 2.9978e7, 1.8e4, "N/m3");
        assert_eq!(
            effect_in_words("cubic_stiffness", &[stiffness]),
            "cubic stiffness ((2.998 ± 0.004)e7 N/m3)"
        );
        let [force, growth] = [
            found("force", 50.7, 1.8e7, "N"),
            found("growth", 1.1, 4.7e5, "1/V"),
        ];
        assert_eq!(
            effect_in_words("friction", std::slice::from_ref(&force)),
            "friction (about 50.7 N, not determined by these records)"
        );
        let effects = [
            ("friction".to_owned(), vec![force]),
            ("by_command".to_owned(), vec![growth]),
        ];
        let note = undetermined(&effects).unwrap();
        assert!(
            note.contains("`friction.force` and `by_command.growth` one by one"),
            "{note}"
        );
        assert_eq!(undetermined(&[]), None);
        let parts = ["a", "b", "c"].map(String::from);
        assert_eq!(joined(&parts), "a, b and c");
    }
}
