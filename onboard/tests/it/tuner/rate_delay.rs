//! A rate that arrives later than the value, as a gyro behind its low-pass beside an estimated angle.

use onecycle_onboard::Soiptd;
use onecycle_onboard::control::Pd;
use onecycle_onboard::tuner::TunerSettings;

use super::axis::{Axis, Noise};
use super::{SAMPLE_S, settings, tuner};

/// Phase margin (rad) of `L = G (kp + kd s exp(-s delay))`, from its definition at the highest frequency where `|L| = 1`.
fn margin_rad(process: &Soiptd, pd: &Pd, rate_delay_s: f64) -> f64 {
    let of = |w: f64| {
        let (sin, cos) = (w * rate_delay_s).sin_cos();
        let (real, imaginary) = (pd.kp + pd.kd * w * sin, pd.kd * w * cos);
        let lags = w.hypot(process.inv_t_body_per_s()) * (w * process.t_prop_s()).hypot(1.0);
        let gain = real.hypot(imaginary) * process.k_over_t_body() / (w * lags);
        let phase = imaginary.atan2(real)
            - (w * process.t_prop_s()).atan()
            - w.atan2(process.inv_t_body_per_s())
            - w * process.tau_s()
            - std::f64::consts::FRAC_PI_2;
        (gain, phase + std::f64::consts::PI)
    };
    let mut w = 1e4;
    while of(w).0 < 1.0 {
        w /= 1.0001;
    }
    of(w).1
}

// A controller that is designed without knowing of the delay has less margin than it states.
#[test]
fn the_margin_holds_with_a_late_rate() {
    let mut shortest = f64::INFINITY;
    for seed in 0..12 {
        let mut random = Noise(seed);
        let t_prop_s = random.between(0.02, 0.1);
        let tau_s = (t_prop_s * random.between(0.2, 1.0) / SAMPLE_S).round() * SAMPLE_S;
        let inv_t_body_per_s = random.between(0.2, 1.0);
        let process =
            Soiptd::from_acceleration_gain(4.0, t_prop_s, inv_t_body_per_s, tau_s).unwrap();
        let rate_delay_s = random.between(0.05, 0.2) * t_prop_s;
        let [short, [margin, stated]] = [0.0, rate_delay_s].map(|known_s| {
            let mut tuner = tuner(&TunerSettings {
                rate_delay_s: known_s as f32,
                ..settings()
            });
            let mut axis = Axis::new(process, SAMPLE_S, seed);
            tuner.start();
            axis.fly(&mut tuner, 0.0, 30.0, |tuner, _| {
                tuner.identified().is_some()
            });
            let found = tuner.identified().unwrap();
            [
                margin_rad(&process, &found.pd, rate_delay_s),
                found.phase_margin_rad,
            ]
            .map(f64::to_degrees)
        });
        assert!((margin - stated).abs() < 1.0, "{seed}: {margin} {stated}");
        shortest = shortest.min(short[0] - short[1]);
    }
    assert!(shortest < -4.0, "{shortest}");
}
