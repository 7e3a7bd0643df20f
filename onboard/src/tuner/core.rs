//! Tuner without its identification's analysis: phases, guard, control laws.

use super::TunerPhase;
use super::settings::{CheckedSettings, Consent, TunerSettings};
use crate::control::{Measurement, RateEstimate};
use crate::guard::{Abort, Guard, Motion};
use libm::sqrtf;

use crate::identification::{Collector, Desk, PAST_EDGES, Refusal, TestSample, TuningResult};
use crate::integral::Integral;
use crate::pid::{PidLaw, PidSettings};
use crate::prediction::{Beginning, Prediction};
use crate::relay::Relay;
use crate::take_off;
use crate::window::Edge;

/// Switches of the relay that end a take-off: the vehicle has been above the reference and has returned.
const AIRBORNE_SWITCHES: u32 = 2;
/// Periods of the oscillation over which the response is compared with the prediction.
const CHECKED_PERIODS: f64 = 4.0;
/// Tolerance of that comparison, in amplitudes of the oscillation: the prediction begins within the oscillation
/// with an approximate force, and noise and gusts continue.
const MOST_MISMATCH: f32 = 1.5;
/// Standard deviations of the wander under the safe controller within which the process counts as at rest, and the part of
/// the limit of the excursion that it may be: usually an amplitude of the oscillation.
const REST_DEVIATIONS: f32 = 3.0;
const MOST_REST: f32 = 0.1;

/// Tuner of one axis without the analysis of its identification, which may run in another thread. Each tick is
/// [`TunerCore::tick`], then [`TunerCore::conclude`] if the desk is there. See [`tuner`](super).
pub struct TunerCore {
    settings: TunerSettings,
    phase: TunerPhase,
    reason: Option<Abort>,
    guard: Guard,
    last_time_s: Option<f64>,
    /// The last valid sample.
    value: f32,
    rate: RateEstimate,
    /// The reference in use; during a test that of its start.
    reference: f32,
    /// Means under the safe controller: of its output (input unit), of the process's output (output unit).
    usual: f32,
    usual_value: f32,
    /// Mean square of the output's distance from that mean (output unit^2).
    wander_squared: f32,
    /// Command of another controller for the next tick and for this one, and the last output (input unit).
    given: Option<f32>,
    other: Option<f32>,
    output: f32,
    test_s: f32,
    /// Offset of the relay, then of the new controller (input unit).
    offset: f32,
    relay: Relay,
    since_switch_s: f32,
    collector: Collector,
    /// Whether an order for the analysis is out whose outcome is wanted.
    is_waiting: bool,
    attempts_left: u8,
    identified: Option<TuningResult>,
    /// The integral beside the PD found.
    integral: Integral,
    /// The law of the controller found, once it is in use.
    law: Option<PidLaw>,
    prediction: Option<Prediction>,
    unchecked_s: f32,
    /// Whether the relay has its second amplitude.
    is_second: bool,
}

impl TunerCore {
    /// A tuner with checked settings.
    #[must_use]
    #[inline]
    pub fn of(checked: &CheckedSettings) -> Self {
        let CheckedSettings { settings, relay } = checked;
        Self {
            phase: TunerPhase::Idle,
            reason: None,
            guard: Guard::new(settings.limits),
            last_time_s: None,
            value: 0.0,
            rate: RateEstimate::default(),
            reference: 0.0,
            usual: settings.safe.offset,
            usual_value: 0.0,
            wander_squared: 0.0,
            given: None,
            other: None,
            output: settings.safe.offset,
            test_s: 0.0,
            offset: 0.0,
            relay: relay.clone(),
            since_switch_s: 0.0,
            collector: Collector::new(
                f64::from(settings.sample_s),
                settings.cycles,
                f64::from(settings.rate_delay_s),
            ),
            is_waiting: false,
            attempts_left: settings.attempts,
            identified: None,
            integral: Integral::NONE,
            law: None,
            prediction: None,
            unchecked_s: 0.0,
            is_second: false,
            settings: *settings,
        }
    }

    /// Begins the test at the next tick. Only in [`TunerPhase::Idle`].
    pub fn start(&mut self) {
        if self.phase != TunerPhase::Idle {
            return;
        }
        if self.settings.take_off.is_some() {
            self.phase = TunerPhase::TakeOff;
        } else {
            self.phase = TunerPhase::Relay;
            if self.settings.bias_filter_s > 0.0 {
                self.offset = self.usual;
                self.reference = self.usual_value;
                self.relay.begin_within(self.rest_level());
            } else if self.other.is_some() {
                self.offset = self.output;
            }
        }
        self.guard.begin((self.value - self.reference).abs());
    }

    /// Distance from the reference within which the process counts as at rest (output unit): what it wanders under the
    /// safe controller. An oscillation much smaller than the limit of the excursion is not expected.
    fn rest_level(&self) -> f32 {
        let wander = REST_DEVIATIONS * sqrtf(self.wander_squared);
        wander.min(MOST_REST * self.settings.limits.excursion)
    }

    /// Puts the proposed controller in force from the next tick on. Only in [`TunerPhase::Proposed`] with
    /// [`Consent::Ask`]; returns whether it was so.
    pub fn accept(&mut self) -> bool {
        let (Some(identified), Some(time_s)) = (self.identified, self.last_time_s) else {
            return false;
        };
        if self.phase != TunerPhase::Proposed || self.settings.consent != Consent::Ask {
            return false;
        }
        let held = [Edge {
            time_s,
            input: f64::from(self.output),
        }];
        let measurement = Measurement::of(self.value).with_rate(self.rate.rate());
        let (reference, command) = (self.reference, self.output);
        if let Some(mut law) = self.law_of(&identified) {
            law.take_over(reference, &measurement, command);
            self.fly(law, &identified, &held, time_s);
        } else {
            self.end(Abort::NotFinite);
        }
        true
    }

    /// Takes the command (input unit) of another controller, which holds the axis instead of the safe controller outside of a
    /// test. It counts for the next tick only: give it before each. One that is not finite aborts the test, and the safe
    /// controller holds the axis. See [`TunerCore::is_in_charge`].
    pub fn beside(&mut self, command: f32) {
        self.given = Some(command);
    }

    /// Whether the last output was the tuner's own: that of the relay or of the controller found. If not, it was that of the
    /// safe controller, or the command given to [`TunerCore::beside`], unchanged.
    #[must_use]
    pub fn is_in_charge(&self) -> bool {
        matches!(
            self.phase,
            TunerPhase::TakeOff | TunerPhase::Relay | TunerPhase::Identify | TunerPhase::Control
        )
    }

    /// Mean of the output while the safe controller or another one held the axis (input unit); needs a bias filter. Another
    /// controller that takes the axis back begins there.
    #[must_use]
    pub fn usual(&self) -> f32 {
        self.usual
    }

    /// Aborts the test, rejects a proposal, or stops the controller found. The output of the next tick is that of the safe
    /// controller.
    pub fn abort(&mut self) {
        if self.phase != TunerPhase::Idle {
            self.end(Abort::Operator);
        }
    }

    /// Resets the tuner for another test; results are forgotten. Only in [`TunerPhase::Aborted`],
    /// [`TunerPhase::Proposed`] and [`TunerPhase::Control`].
    pub fn reset(&mut self) {
        use TunerPhase::{Aborted, Control, Proposed};
        if !matches!(self.phase, Aborted | Proposed | Control) {
            return;
        }
        let Ok(relay) = Relay::new(self.settings.relay) else {
            return;
        };
        self.phase = TunerPhase::Idle;
        self.reason = None;
        self.guard = Guard::new(self.settings.limits);
        self.last_time_s = None;
        self.test_s = 0.0;
        self.offset = 0.0;
        self.relay = relay;
        self.since_switch_s = 0.0;
        self.collector.restart();
        self.is_waiting = false;
        self.attempts_left = self.settings.attempts;
        self.identified = None;
        self.integral = Integral::NONE;
        self.law = None;
        self.prediction = None;
        self.is_second = false;
    }

    /// One tick of guard, relay and control. Takes time (s), measurement and reference (output unit); returns the input to
    /// hold until the next tick (input unit), which is always finite, and within the limits if it is the tuner's own. Without
    /// the desk, which another thread may have, everything but the collection of cycles goes on.
    #[inline]
    pub fn tick(
        &mut self,
        desk: Option<&mut Desk>,
        time_s: f64,
        measurement: &Measurement,
        reference: f32,
    ) -> f32 {
        let dt_s = self.tick_s(time_s);
        self.other = self.given.take();
        if let Err(reason) = self.watch(dt_s, measurement, reference) {
            self.end(reason);
        }
        self.output = match self.phase {
            TunerPhase::Idle | TunerPhase::Proposed => self.idle(dt_s),
            TunerPhase::TakeOff => self.take_off(dt_s),
            TunerPhase::Relay | TunerPhase::Identify => self.offset + self.excite(dt_s),
            TunerPhase::Control => self.control(dt_s),
            TunerPhase::Aborted => self.safe(),
        };
        if self.is_in_charge() {
            self.output = self.within_limits(self.output);
        }
        self.collect(desk, time_s);
        self.output
    }

    fn tick_s(&mut self, time_s: f64) -> f32 {
        match self.last_time_s {
            None if time_s.is_finite() => {
                self.last_time_s = Some(time_s);
                self.settings.sample_s
            }
            None => f32::NAN,
            Some(last_s) => {
                if time_s.is_finite() && time_s > last_s {
                    self.last_time_s = Some(time_s);
                }
                (time_s - last_s) as f32
            }
        }
    }

    /// Takes the sample after the guard has checked it.
    fn watch(&mut self, dt_s: f32, measurement: &Measurement, reference: f32) -> Result<(), Abort> {
        let is_test = self.is_in_charge() && !self.is_proven();
        // Before the rest, which may end the tick too.
        if self.other.is_some_and(|command| !command.is_finite()) {
            self.other = None;
            return Err(Abort::NotFinite);
        }
        self.guard.check_data(measurement, reference, dt_s)?;
        self.value = measurement.value;
        let rate = self.rate.step(measurement, dt_s, self.settings.rate_lag_s);
        if !is_test {
            self.reference = reference;
            return Ok(());
        }
        self.test_s += dt_s;
        let has_relay = self.has_relay();
        self.guard.check_motion(&Motion {
            distance: self.value - self.reference,
            rate,
            test_s: (self.phase != TunerPhase::Control).then_some(self.test_s),
            since_switch_s: has_relay.then_some(self.since_switch_s + dt_s),
        })
    }

    fn end(&mut self, reason: Abort) {
        if !matches!(self.phase, TunerPhase::Idle | TunerPhase::Aborted) {
            self.phase = TunerPhase::Aborted;
            self.reason = Some(reason);
            self.law = None;
            self.prediction = None;
            self.is_waiting = false;
        }
    }

    /// Command of the other controller, or of the safe one.
    fn safe(&self) -> f32 {
        self.other.unwrap_or_else(|| {
            let safe = &self.settings.safe;
            self.within_limits(safe.output(self.reference, self.value, self.rate.rate()))
        })
    }

    fn idle(&mut self, dt_s: f32) -> f32 {
        let output = self.safe();
        let filter_s = self.settings.bias_filter_s;
        if dt_s > 0.0 && filter_s > 0.0 {
            let share = dt_s / (dt_s + filter_s);
            self.usual += share * (output - self.usual);
            self.usual_value += share * (self.value - self.usual_value);
            let off = self.value - self.usual_value;
            self.wander_squared += share * (off * off - self.wander_squared);
        }
        output
    }

    fn take_off(&mut self, dt_s: f32) -> f32 {
        if let Some(settings) = &self.settings.take_off {
            let error = self.reference - self.value;
            self.offset = take_off::lift(settings, self.offset, error, self.rate.rate(), dt_s);
        }
        let output = self.offset + self.excite(dt_s);
        if self.relay.switches() >= AIRBORNE_SWITCHES {
            self.phase = TunerPhase::Relay;
        }
        output
    }

    /// Output of the relay at this tick.
    fn excite(&mut self, dt_s: f32) -> f32 {
        let was_high = self.relay.is_high();
        let output = self.relay.step(self.reference - self.value, dt_s);
        if self.relay.is_high() == was_high {
            self.since_switch_s += dt_s;
        } else {
            self.since_switch_s = 0.0;
        }
        output
    }

    /// Passes the sample of this tick to the identification.
    fn collect(&mut self, mut desk: Option<&mut Desk>, time_s: f64) {
        if !self.is_waiting
            && let Some(desk) = desk.as_deref_mut()
        {
            desk.clear();
        }
        if !self.has_relay() && self.phase != TunerPhase::TakeOff {
            return;
        }
        let observed = TestSample {
            time_s,
            input: f64::from(self.output),
            output: f64::from(self.value),
            is_high: self.relay.is_high(),
            undone: self.relay.undone(),
        };
        self.collector.observe(desk.as_deref_mut(), &observed);
        if desk.is_some_and(|desk| desk.is_ordered()) {
            self.is_waiting = true;
            if self.phase == TunerPhase::Relay {
                self.phase = TunerPhase::Identify;
            }
        }
    }

    /// Ends a tick with the desk: takes the outcome of the analysis, if there is one. Returns the input to hold until the next
    /// tick.
    pub fn conclude(&mut self, desk: &mut Desk) -> f32 {
        if !self.has_relay() || !self.is_waiting {
            return self.output;
        }
        let Some(outcome) = desk.take_outcome() else {
            return self.output;
        };
        self.is_waiting = false;
        match outcome {
            Ok(identified) if self.is_second || self.settings.second_amplitude == 0.0 => {
                self.enter_control(&identified);
            }
            Ok(_) => self.enter_second(),
            Err(refusal @ Refusal::AmplitudeDependent(_)) => self.end(Abort::Refused(refusal)),
            Err(refusal) => {
                self.attempts_left -= 1;
                self.phase = TunerPhase::Relay;
                if self.attempts_left == 0 {
                    self.end(Abort::Refused(refusal));
                }
            }
        }
        if !self.is_in_charge() {
            self.output = self.safe();
        }
        self.output
    }

    fn has_relay(&self) -> bool {
        matches!(self.phase, TunerPhase::Relay | TunerPhase::Identify)
    }

    /// Goes on with the second amplitude of the relay from the next tick on.
    fn enter_second(&mut self) {
        let amplitude = self.settings.relay.amplitude * self.settings.second_amplitude;
        if self.relay.set_amplitude(amplitude).is_err() {
            self.end(Abort::NotFinite);
            return;
        }
        self.collector.confirm();
        self.is_second = true;
        self.phase = TunerPhase::Relay;
    }

    /// Switches to the new controller from the next tick on, or proposes it. Its offset holds the process at rest and stays
    /// within an amplitude of the relay's centre, because the relay cannot hold a larger bias.
    fn enter_control(&mut self, identified: &TuningResult) {
        let centre = self.offset + self.relay.trim();
        let h = self.settings.relay.amplitude;
        let at_rest = -identified.input_bias as f32;
        self.offset = at_rest.max(centre - h).min(centre + h);
        let phase_rad = f64::from(self.settings.integral_phase_rad);
        self.integral = Integral::beside(identified.pd, &identified.process, phase_rad);
        self.identified = Some(*identified);
        let (Some(law), Some(time_s)) = (self.law_of(identified), self.last_time_s) else {
            self.identified = None;
            self.end(Abort::NotFinite);
            return;
        };
        if self.settings.consent == Consent::Automatic {
            let law = law.started_at(self.reference, self.offset);
            let edges = self.collector.past_edges();
            let mut latest = [Edge::default(); PAST_EDGES];
            let latest = &mut latest[..edges.len()];
            latest.copy_from_slice(edges);
            self.fly(law, identified, latest, time_s);
        } else {
            self.phase = TunerPhase::Proposed;
        }
    }

    /// Flies with a law from the next tick on, and checks the response. `edges` are the latest inputs.
    fn fly(&mut self, law: PidLaw, identified: &TuningResult, edges: &[Edge], time_s: f64) {
        self.law = Some(law);
        self.prediction = Some(Prediction::new(
            &identified.process,
            law,
            f64::from(self.settings.sample_s),
            &Beginning {
                edges,
                time_s: time_s + f64::from(self.settings.sample_s),
                value: self.value,
                rate: self.rate.rate(),
                reference: self.reference,
                input_bias: identified.input_bias,
            },
        ));
        self.unchecked_s = (CHECKED_PERIODS * identified.period_s) as f32;
        self.phase = TunerPhase::Control;
    }

    /// The PD found with the integral beside it.
    fn law_of(&self, identified: &TuningResult) -> Option<PidLaw> {
        let settings = PidSettings {
            ki: self.integral.ki as f32,
            ..PidSettings::from(identified.pd)
        };
        let settings = settings
            .with_setpoint_weight(self.integral.setpoint_weight as f32)
            .with_limits(self.settings.output_lowest, self.settings.output_highest);
        let law = PidLaw::new(settings).ok()?;
        self.offset.is_finite().then_some(law)
    }

    fn control(&mut self, dt_s: f32) -> f32 {
        if let (Some(prediction), Some(identified)) = (&mut self.prediction, &self.identified) {
            let off = (prediction.step() - self.value).abs();
            if off > MOST_MISMATCH * identified.amplitude as f32 {
                self.end(Abort::Mismatch(off));
                return self.safe();
            }
            self.unchecked_s -= self.settings.sample_s;
            if self.unchecked_s <= 0.0 {
                self.prediction = None;
            }
        }
        let measurement = Measurement::of(self.value).with_rate(self.rate.rate());
        let reference = self.reference;
        match &mut self.law {
            Some(law) => law.step(dt_s, reference, &measurement),
            None => self.safe(),
        }
    }

    fn within_limits(&self, output: f32) -> f32 {
        output
            .max(self.settings.output_lowest)
            .min(self.settings.output_highest)
    }

    /// Phase of the tuner.
    #[must_use]
    pub fn phase(&self) -> TunerPhase {
        self.phase
    }

    /// Reason of the abort, if the test was aborted.
    #[must_use]
    pub fn reason(&self) -> Option<Abort> {
        self.reason
    }

    /// Result of the test: process, deviations, gains.
    #[must_use]
    pub fn identified(&self) -> Option<&TuningResult> {
        self.identified.as_ref()
    }

    /// The integral beside the PD of [`TunerCore::identified`]; [`Integral::NONE`] before it and where it is switched off.
    #[must_use]
    pub fn integral(&self) -> Integral {
        self.integral
    }

    /// The law in use in [`TunerPhase::Control`], with its integral; `None` in any other phase.
    #[must_use]
    pub fn law(&self) -> Option<&PidLaw> {
        self.law.as_ref()
    }

    /// Whether the new controller runs and its response was as predicted.
    #[must_use]
    pub fn is_proven(&self) -> bool {
        self.phase == TunerPhase::Control && self.prediction.is_none()
    }

    /// Whether cycles are being collected.
    #[must_use]
    pub fn is_collecting(&self) -> bool {
        self.collector.is_collecting()
    }

    /// The relay of the test.
    #[must_use]
    pub fn relay(&self) -> &Relay {
        &self.relay
    }

    /// Centre of the output while the relay runs, without its trim (input unit).
    #[must_use]
    pub fn offset(&self) -> f32 {
        self.offset
    }
}
