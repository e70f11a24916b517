//! One instance of a component: its life from instantiation to termination.

use std::ffi::CString;

use serde::{Deserialize, Serialize};

use crate::{
    component::Component,
    extended::Importer,
    fault::{Fault, Outcome},
    log::Log,
    model::Model,
    phase::{Kind, Phase},
};

/// Everything about an instance that its saved state holds.
#[derive(Clone, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Snapshot<C: Component> {
    /// The component's fields.
    pub component: C,
    /// Its phase in the order of calls.
    pub phase: Phase,
    /// How it is driven.
    pub kind: Kind,
    /// Time, s.
    pub time: f64,
    /// End of the experiment, s, if the importer gave one.
    pub stop_time: Option<f64>,
    /// The experiment was set up.
    pub set_up: bool,
    /// Parameters changed since the component was last initialized.
    pub unprepared: bool,
    /// Something changed since the outputs were last computed.
    pub stale: bool,
}

/// An instance of a component.
pub struct Instance<C: Component> {
    pub(crate) model: &'static Model<C>,
    pub(crate) now: Snapshot<C>,
    pub(crate) start: C,
    pub(crate) log: Log,
    pub(crate) poisoned: bool,
    pub(crate) event_mode_used: bool,
    pub(crate) importer: Importer,
    pub(crate) texts: Vec<CString>,
}

impl<C: Component> Instance<C> {
    /// An instance with the start values `start`.
    pub fn new(model: &'static Model<C>, start: C, kind: Kind, log: Log) -> Self {
        let texts = vec![CString::default(); model.variables.len()];
        Self {
            model,
            now: Snapshot::new(start.clone(), kind),
            start,
            log,
            poisoned: false,
            event_mode_used: false,
            importer: Importer::default(),
            texts,
        }
    }

    pub(crate) fn require(&self, allowed: &[Phase]) -> Outcome {
        if allowed.contains(&self.now.phase) {
            return Ok(());
        }
        let names: Vec<_> = allowed.iter().map(|phase| phase.name()).collect();
        Err(Fault::error(format!(
            "wrong order of calls: not allowed {}, only {}",
            self.now.phase.name(),
            names.join(" or ")
        )))
    }

    pub(crate) fn enter(&mut self, phase: Phase) {
        self.now.phase = phase;
        self.log
            .event(&format!("now {}, t = {} s", phase.name(), self.now.time));
    }

    /// Sets start and end, s, of the experiment.
    pub(crate) fn set_up(&mut self, start_time: f64, stop_time: Option<f64>) -> Outcome {
        self.require(&[Phase::Instantiated])?;
        if !start_time.is_finite() {
            return Err(Fault::error(format!(
                "start time {start_time} is not finite"
            )));
        }
        if let Some(stop) = stop_time
            && (stop.is_nan() || stop < start_time)
        {
            return Err(Fault::error(format!(
                "stop time {stop} s is not after the start time {start_time} s"
            )));
        }
        self.now.time = start_time;
        self.now.stop_time = stop_time;
        self.now.set_up = true;
        Ok(())
    }

    pub(crate) fn enter_initialization(&mut self) -> Outcome {
        self.require(&[Phase::Instantiated])?;
        self.now.stale = true;
        self.now.unprepared = true;
        self.enter(Phase::Initialization);
        Ok(())
    }

    pub(crate) fn exit_initialization(&mut self) -> Outcome {
        self.require(&[Phase::Initialization])?;
        self.refresh()?;
        self.enter(match self.now.kind {
            Kind::CoSimulation => Phase::Step,
            Kind::ModelExchange => Phase::Event,
        });
        Ok(())
    }

    /// Brings computed variables up to date.
    #[inline]
    pub(crate) fn refresh(&mut self) -> Outcome {
        if !self.now.stale || !self.now.phase.computes() {
            return Ok(());
        }
        if self.now.unprepared {
            self.prepare()?;
        }
        self.now.component.update_outputs(self.now.time);
        self.now.stale = false;
        Ok(())
    }

    #[cold]
    fn prepare(&mut self) -> Outcome {
        if self.now.phase == Phase::Initialization {
            let mut outcome = self.now.component.initialize();
            if self.now.kind == Kind::ModelExchange {
                outcome = outcome.and_then(|()| self.now.component.allow_model_exchange());
            }
            outcome.map_err(|e| Fault::error(format!("cannot initialize: {e}")))?;
        }
        self.now.unprepared = false;
        Ok(())
    }

    /// Steps from `time` to `time + step_size`, s.
    #[inline]
    pub(crate) fn do_step(&mut self, time: f64, step_size: f64) -> Outcome {
        if self.now.phase != Phase::Step {
            self.require(&[Phase::Step])?;
        }
        let slack = 1e-6 * step_size.abs() + 1e-12 * time.abs();
        let in_place = (time - self.now.time).abs() <= slack;
        let in_range = step_size > 0.0 && step_size.is_finite();
        let in_time = self
            .now
            .stop_time
            .is_none_or(|stop| time + step_size <= stop + slack);
        // A law for one step size takes whole multiples of it, with its inputs held.
        let parts = (step_size / C::STEP_SIZE).round().max(1.0);
        // Some masters count whole nanoseconds.
        let rounding = slack + 1e-9;
        let fits = C::ANY_STEP_SIZE || (step_size - parts * C::STEP_SIZE).abs() <= rounding;
        if !(in_place && in_range && in_time && fits) {
            return Err(self.refuse_step(time, step_size, in_place, in_range, in_time));
        }
        // A master that computes the step as a difference of times errs by rounding; components
        // prepared for their own step size need not prepare again.
        let nominal = (step_size - C::STEP_SIZE).abs() <= 1e-9 * C::STEP_SIZE;
        if nominal || C::ANY_STEP_SIZE {
            let length = if nominal { C::STEP_SIZE } else { step_size };
            self.step_once(time, length)?;
        } else {
            for part in 0..parts as u64 {
                self.step_once(time + part as f64 * C::STEP_SIZE, C::STEP_SIZE)?;
            }
        }
        self.now.time = time + step_size;
        self.now.stale = true;
        Ok(())
    }

    #[inline]
    fn step_once(&mut self, time: f64, length: f64) -> Outcome {
        self.now.component.step(time, length).map_err(|problem| {
            self.now.phase = Phase::Failed;
            Fault::error(format!(
                "the step from t = {time} s to {} s failed: {problem}",
                time + length
            ))
        })
    }

    #[cold]
    fn refuse_step(&self, t: f64, h: f64, place: bool, range: bool, in_time: bool) -> Box<Fault> {
        Fault::error(if !range {
            format!("step size {h} s at t = {t} s, expected a positive finite number")
        } else if !place {
            format!(
                "communication point {t} s, but the instance is at {} s",
                self.now.time
            )
        } else if !in_time {
            let stop = self.now.stop_time.unwrap_or(f64::INFINITY);
            format!("the step from {t} s by {h} s goes past the stop time {stop} s")
        } else {
            format!(
                "step size {h} s, but {} takes whole multiples of {} s",
                C::NAME,
                C::STEP_SIZE
            )
        })
    }

    pub(crate) fn terminate(&mut self) -> Outcome {
        self.require(&[
            Phase::Step,
            Phase::Event,
            Phase::ContinuousTime,
            Phase::Failed,
        ])?;
        self.enter(Phase::Terminated);
        Ok(())
    }

    /// Puts the instance back to where it was after instantiation.
    pub(crate) fn reset(&mut self) {
        self.now = Snapshot::new(self.start.clone(), self.now.kind);
        self.enter(Phase::Instantiated);
    }
}

impl<C: Component> Snapshot<C> {
    fn new(component: C, kind: Kind) -> Self {
        Self {
            component,
            phase: Phase::Instantiated,
            kind,
            time: 0.0,
            stop_time: None,
            set_up: false,
            unprepared: true,
            stale: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oscillator::{ACCELERATION, FORCE, MASS, Oscillator, instance, refusal, running};

    /// The calls that move an instance on, by name.
    type Call = (&'static str, fn(&mut Instance<Oscillator>) -> Outcome);

    const CALLS: [Call; 7] = [
        ("set up", |i| i.set_up(0.0, None)),
        ("enter initialization", |i| i.enter_initialization()),
        ("exit initialization", |i| i.exit_initialization()),
        ("step", |i| i.do_step(i.now.time, 0.002)),
        ("event mode", |i| i.enter_event_mode()),
        ("continuous time", |i| i.enter_continuous_time_mode()),
        ("terminate", |i| i.terminate()),
    ];

    fn accepted(kind: Kind, phase: Phase) -> Vec<&'static str> {
        let mut names = Vec::new();
        for (name, call) in CALLS {
            let mut instance = running(kind);
            instance.now.phase = phase;
            if call(&mut instance).is_ok() {
                names.push(name);
            }
        }
        names
    }

    #[test]
    fn each_phase_accepts_its_calls_and_no_others() {
        use Kind::{CoSimulation, ModelExchange};
        use Phase::*;
        let first = ["set up", "enter initialization"];
        let running = ["event mode", "continuous time", "terminate"];
        for kind in [CoSimulation, ModelExchange] {
            assert_eq!(accepted(kind, Instantiated), first);
            assert_eq!(accepted(kind, Initialization), ["exit initialization"]);
            assert_eq!(accepted(kind, Failed), ["terminate"]);
            assert!(accepted(kind, Terminated).is_empty());
        }
        assert_eq!(accepted(CoSimulation, Step), ["step", "terminate"]);
        assert_eq!(accepted(ModelExchange, Event), running);
        assert_eq!(
            accepted(ModelExchange, ContinuousTime),
            ["event mode", "terminate"]
        );
    }

    #[test]
    fn outputs_follow_inputs_and_parameters_during_initialization() {
        let mut instance = instance(Kind::CoSimulation);
        instance.set_up(0.0, None).unwrap();
        instance.enter_initialization().unwrap();
        instance.set_real(FORCE, 8.0).unwrap();
        assert_eq!(instance.get_real(ACCELERATION), Ok(4.0));
        instance.set_real(MASS, 4.0).unwrap();
        assert_eq!(instance.get_real(ACCELERATION), Ok(2.0));
        instance.set_real(MASS, 1e7).unwrap();
        assert!(refusal(instance.get_real(ACCELERATION)).contains("`mass` is too large"));
        assert!(refusal(instance.exit_initialization()).contains("`mass` is too large"));
        instance.set_real(MASS, 1.0).unwrap();
        assert_eq!(instance.exit_initialization(), Ok(()));
    }

    #[test]
    fn rounding_of_the_time_is_accepted_and_anything_more_refused() {
        let mut instance = running(Kind::CoSimulation);
        let mut time = 0.0;
        for _ in 0..50_000 {
            instance.do_step(time, 0.002).unwrap();
            time += 0.002;
        }
        assert_eq!(instance.do_step(50_000.0 * 0.002, 0.002), Ok(()));
        assert!(refusal(instance.do_step(100.0, 0.002)).contains("is at 100.002 s"));
        assert!(refusal(instance.do_step(100.002 + 1e-6, 0.002)).contains("communication point"));
        assert!(refusal(instance.do_step(100.002, -0.0)).contains("step size -0 s"));
        assert!(refusal(instance.do_step(100.002, f64::NAN)).contains("step size NaN s"));
    }

    #[test]
    fn failed_step_is_left_by_reset_only_or_an_earlier_state() {
        let mut instance = running(Kind::CoSimulation);
        instance.set_real(FORCE, 13.0).unwrap();
        let message = refusal(instance.do_step(0.0, 0.002));
        assert!(message.contains("from t = 0 s to 0.002 s failed: a force that the step refuses"));
        assert!(refusal(instance.do_step(0.0, 0.002)).contains("after a failed step"));
        instance.reset();
        assert_eq!(instance.now.phase, Phase::Instantiated);
        assert_eq!(instance.get_real(FORCE), Ok(0.0));
    }

    #[test]
    fn an_experiment_ends_after_it_starts() {
        let mut instance = instance(Kind::CoSimulation);
        for (start, stop) in [(1.0, 0.5), (0.0, -1.0), (0.0, f64::NAN)] {
            let message = refusal(instance.set_up(start, Some(stop)));
            assert!(
                message.contains(&format!("stop time {stop} s")),
                "{message}"
            );
            assert!(!instance.now.set_up);
        }
        for start in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(refusal(instance.set_up(start, None)).contains("not finite"));
        }
        assert_eq!(instance.set_up(1.0, Some(1.5)), Ok(()));
        assert_eq!(
            (instance.now.time, instance.now.stop_time),
            (1.0, Some(1.5))
        );
        // An experiment without length and one without end.
        assert_eq!(instance.set_up(1.0, Some(1.0)), Ok(()));
        assert_eq!(instance.set_up(-1.0, Some(f64::INFINITY)), Ok(()));
    }

    #[test]
    fn steps_go_to_the_stop_time_and_no_further() {
        let mut instance = instance(Kind::CoSimulation);
        instance.set_up(0.5, Some(0.504)).unwrap();
        instance.enter_initialization().unwrap();
        instance.exit_initialization().unwrap();
        instance.do_step(0.5, 0.002).unwrap();
        instance.do_step(0.502, 0.002).unwrap();
        let message = refusal(instance.do_step(0.504, 0.002));
        assert!(message.contains("past the stop time 0.504 s"), "{message}");
        assert_eq!(instance.now.time, 0.504);
    }

    /// Counts its steps and adds up their times.
    #[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
    struct Sampled {
        count: i32,
        sum: f64,
    }

    impl Component for Sampled {
        const NAME: &'static str = "Sampled";
        const DESCRIPTION: &'static str = "Steps by 1/4096 s only";
        const STEP_SIZE: f64 = 1.0 / 4096.0;
        const ANY_STEP_SIZE: bool = false;

        fn variables() -> Vec<crate::variable::Variable<Self>> {
            crate::table! { Self, s:
                output("count", s.count, "Steps");
                output("sum", s.sum, "Sum of the times of the steps", "s");
            }
        }

        fn initialize(&mut self) -> crate::component::ComponentResult {
            Ok(())
        }

        fn step(&mut self, time: f64, step_size: f64) -> crate::component::ComponentResult {
            assert_eq!(step_size, Self::STEP_SIZE);
            self.count += 1;
            self.sum += time;
            Ok(())
        }
    }

    #[test]
    fn a_law_for_one_step_size_takes_whole_multiples_of_it() {
        let model = crate::model::Model::get().unwrap();
        let log = crate::log::Log::new(crate::log::Sink::None, c"it", false);
        let mut instance = Instance::new(model, Sampled::default(), Kind::CoSimulation, log);
        instance.set_up(0.0, None).unwrap();
        instance.enter_initialization().unwrap();
        instance.exit_initialization().unwrap();
        let own = Sampled::STEP_SIZE;
        instance.do_step(0.0, 4.0 * own).unwrap();
        let component = &instance.now.component;
        assert_eq!((component.count, component.sum), (4, 6.0 * own));
        instance.do_step(4.0 * own, own).unwrap();
        // In whole nanoseconds.
        instance.do_step(5.0 * own, 244_141e-9).unwrap();
        assert_eq!(instance.now.component.count, 6);
        let message = refusal(instance.do_step(instance.now.time, 1.5 * own));
        assert!(
            message.contains("whole multiples of 0.000244140625 s"),
            "{message}"
        );
        assert!(
            refusal(instance.do_step(instance.now.time, 0.5 * own)).contains("whole multiples")
        );
    }
}
