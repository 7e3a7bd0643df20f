//! The PID law of the firmware in sampled loops, against the design's continuous loops; the integral that the tuner puts
//! beside its PD, over the paper's multirotors.

use onecycle_design::{
    Controller as AnyController, Execution, Model, Pid, ise, load_iae, margins, sensitivity,
    step_response,
};
use onecycle_onboard::integral::{Integral, MOST_PHASE_RAD, USUAL_PHASE_RAD};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::{PidLaw, PidSettings, Soiptd};
use onecycle_plant::{Controller, Experiment, Noise, Sensed};

/// The paper's altitude and a PID of `Ms` 1.6 with its measurement filter: method, vector 11.
const GAINS: [f64; 3] = [47.6865, 93.8186, 13.9473];
const FILTER_S: f64 = 0.001_987_5;

fn altitude() -> Soiptd {
    Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap()
}

/// The design's controller: a backward Euler sum is the integral and half a sample period of `ki` on `kp`.
fn pid(sample_s: f64) -> AnyController {
    let execution = Execution::sampled(sample_s).with_computation_delay_s(0.0);
    let [kp, ki, kd] = GAINS;
    let kp = kp + 0.5 * sample_s * ki;
    let pid = Pid::new(kp, ki, kd).with_filter_s(FILTER_S);
    AnyController::from(pid.with_execution(execution))
}

fn law() -> PidLaw {
    let [kp, ki, kd] = GAINS.map(|gain| gain as f32);
    PidLaw::new(PidSettings::new(kp, ki, kd).with_filter_s(FILTER_S as f32)).unwrap()
}

/// A law whose measurement has an impulse, and what it measures.
struct Probe {
    law: PidLaw,
    measured: Vec<f64>,
}

/// Tick of the impulse: the law has started.
const IMPULSE: usize = 3;

impl Controller for Probe {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let impulse = f64::from(u8::from(self.measured.len() == IMPULSE));
        let output = sensed.output + impulse;
        self.measured.push(output);
        Controller::step(&mut self.law, dt_s, reference, Sensed { output, ..sensed })
    }
}

/// `Ms` of the sampled loop: the response of the measurement to an impulse of the measurement is the sensitivity, and its
/// transform is exact at any frequency.
fn sampled_ms(sample_s: f64) -> f64 {
    let mut probe = Probe {
        law: law(),
        measured: vec![],
    };
    let experiment = Experiment::new(altitude(), sample_s, 6.0);
    let _ = experiment.run(&mut probe, &mut Noise::from_seed(0));
    let at = |omega: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for (k, measured) in probe.measured[IMPULSE..].iter().enumerate() {
            let angle = omega * sample_s * k as f64;
            re += measured * angle.cos();
            im -= measured * angle.sin();
        }
        f64::hypot(re, im)
    };
    (0..400)
        .map(|i| at(3.0 * 1.008_f64.powi(i)))
        .fold(0.0, f64::max)
}

// The design counts half a sample period as dead time. What is left grows with the square of the sample period, to 1.1e-4
// at 10 ms. The law in single precision adds 1e-6.
#[test]
fn the_sampled_law_has_the_sensitivity_of_the_design() {
    for (sample_s, most) in [(0.001, 4e-6), (0.0025, 2e-5), (0.004, 4e-5), (0.01, 2e-4)] {
        let exact = sampled_ms(sample_s);
        let designed = sensitivity(&Model::from(altitude()), &pid(sample_s)).unwrap();
        let off = exact - designed.ms;
        assert!(off.abs() < most, "{sample_s}: {exact} {designed:?}");
    }
}

// The integral ends at minus the load, so the sum of ki h e is the load exactly, at any sample period. The IAE is that of
// the design, with an error of the square of the sample period.
#[test]
fn a_load_is_rejected_as_designed() {
    for (sample_s, most) in [(0.001, 1e-6), (0.0025, 1e-5), (0.004, 2e-5), (0.01, 1e-4)] {
        let experiment = Experiment::new(altitude(), sample_s, 8.0).with_input_bias(1.0);
        let mut law = law();
        let trace = experiment.run(&mut law, &mut Noise::from_seed(0));
        let sum: f64 = trace.true_output.iter().sum();
        assert!(
            (GAINS[1] * sample_s * sum - 1.0).abs() < 1e-5,
            "{sample_s}: {sum}"
        );
        assert!((f64::from(law.integral()) + 1.0).abs() < 1e-5);
        let iae: f64 = trace.true_output.iter().map(|y| y.abs() * sample_s).sum();
        let designed = load_iae(&Model::from(altitude()), &pid(sample_s)).unwrap();
        assert!(
            (iae / designed - 1.0).abs() < most,
            "{sample_s}: {iae} {designed}"
        );
    }
}

/// The paper's equation 3: lags and dead time of multirotors (s), from the least to the largest by equal factors.
fn multirotors(points: usize) -> impl Iterator<Item = Soiptd> {
    let times = move |low: f64, high: f64| {
        (0..points).map(move |i| low * (high / low).powf(i as f64 / (points - 1) as f64))
    };
    times(0.015, 0.3).flat_map(move |t_prop_s| {
        times(0.2, 2.0).flat_map(move |t_body_s| {
            times(0.0005, 0.1)
                .map(move |tau_s| Soiptd::new(2.0, t_prop_s, t_body_s, tau_s).unwrap())
        })
    })
}

/// What the integral of this phase changes on a process: phase margin lost (degrees), factors of `Ms`, ISE of a step, and
/// how much larger the overshoot becomes.
fn price(process: Soiptd, phase_rad: f64) -> [f64; 4] {
    let pack = Pack::embedded().unwrap();
    let pd = pack.gains_table().unwrap().pd(&process).unwrap();
    let integral = Integral::beside(pd, &process, phase_rad);
    let pid = Pid::new(pd.kp, integral.ki, pd.kd).with_setpoint_weight(integral.setpoint_weight);
    let model = Model::from(process);
    let [before, after] = [AnyController::from(pd), AnyController::from(pid)].map(|controller| {
        let step = step_response(&model, &controller).unwrap();
        [
            margins(&model, &controller)
                .unwrap()
                .phase_margin_rad
                .to_degrees(),
            sensitivity(&model, &controller).unwrap().ms,
            ise(&model, &controller).unwrap(),
            step.metrics.overshoot,
        ]
    });
    [
        before[0] - after[0],
        after[1] / before[1],
        after[2] / before[2],
        after[3] - before[3],
    ]
}

fn worst(points: usize, phase_rad: f64) -> [f64; 4] {
    multirotors(points).fold([f64::MIN; 4], |mut worst, process| {
        for (worst, price) in worst.iter_mut().zip(price(process, phase_rad)) {
            *worst = worst.max(price);
        }
        worst
    })
}

// Every loop is stable: the figures exist. At the usual 5 degrees the phase margin loses 0.31 degrees at most, `Ms` grows by
// 1.2 % and the overshoot by 2 % of the step; the ISE of a step grows by 15 % at worst. At the most allowed, 20 degrees,
// 1.8 degrees of the margin are lost.
#[test]
fn the_integral_keeps_the_margin_of_every_multirotor() {
    let [lost_deg, ms, ise, overshoot] = worst(8, f64::from(USUAL_PHASE_RAD));
    assert!(lost_deg < 0.32 && ms < 1.013, "{lost_deg} {ms}");
    assert!(ise < 1.16 && overshoot < 0.02, "{ise} {overshoot}");
    let [lost_deg, ms, ..] = worst(4, f64::from(MOST_PHASE_RAD));
    assert!(lost_deg < 1.9 && ms < 1.08, "{lost_deg} {ms}");
}
