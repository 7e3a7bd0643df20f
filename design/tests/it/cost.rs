//! Closed form of the cost against quadrature of Parseval's integral and against hand calculations.

use num_complex::Complex64;
use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::criterion::Criterion;
use onecycle_design::soiptd_pd::margins::margins;
use onecycle_design::soiptd_pd::open_loop::{OpenLoop, lead_for_margin};
use onecycle_design::soiptd_pd::optimum::{pd, pd_at_phase_margin, pd_by};
use onecycle_onboard::{Pd, Soiptd};

/// Nodes of the reference quadrature.
const NODES: usize = 60_000;

/// `1/pi int |E(jw)|^2 dw` by the trapezoidal rule in `x`, `ln w = ln wc + width sinh x`: dense at the resonance, 17
/// decades to either side of it.
fn ise_by_quadrature(process: &Soiptd, pd: Pd) -> f64 {
    let margins = margins(process, pd).expect("the gains have the right sign");
    let width = margins.phase_margin_rad.min(1.0);
    let end = (40.0 / width).asinh();
    let dx = 2.0 * end / NODES as f64;
    let sum: f64 = (0..=NODES)
        .map(|k| {
            let x = -end + dx * k as f64;
            let omega = margins.gain_crossover_rad_per_s * (width * x.sinh()).exp();
            error_spectrum(process, pd, omega).norm_sqr() * omega * width * x.cosh()
        })
        .sum();
    sum * dx / std::f64::consts::PI
}

/// `E(jw) = (1 + Kd s G) / (s (1 + (Kp + Kd s) G))`, evaluated as written.
fn error_spectrum(process: &Soiptd, pd: Pd, omega: f64) -> Complex64 {
    let s = Complex64::new(0.0, omega);
    let g = process.k_over_t_body() * (-s * process.tau_s()).exp()
        / (s * (s * process.t_prop_s() + 1.0) * (s + process.inv_t_body_per_s()));
    (1.0 + pd.kd * s * g) / (s * (1.0 + (pd.kp + pd.kd * s) * g))
}

fn assert_close(a: f64, b: f64, tolerance: f64, what: &str) {
    assert!(
        (a / b - 1.0).abs() < tolerance,
        "{what}: {a} {b} {:e}",
        a / b - 1.0
    );
}

// Columns: acceleration gain, T_prop (s), 1/T_body (1/s), tau (s), phase margin (deg). With and without damping, equal
// lags, no dead time, dominating dead time, margins from 0.5 to 60 deg.
#[test]
fn closed_form_matches_quadrature() {
    for (gain, t_prop, damping, tau, margin_deg) in [
        (0.5, 0.3, 0.5, 0.1, 20.0_f64),
        (0.5, 0.3, 0.5, 0.1, 0.5),
        (-7.0, 0.3, 0.5, 0.1, 60.0),
        (1.0, 0.3, 1.0 / 0.3, 0.05, 20.0),
        (1.0, 0.3, 0.0, 0.05, 20.0),
        (1.0, 0.3, 0.0, 0.0, 3.0),
        (1.0, 0.015, 5.0, 0.0005, 20.0),
        (1.0, 0.015, 5.0, 0.1, 3.0),
        (1.0, 0.01, 100.0, 1.0, 45.0),
        (1.0, 1.0, 0.01, 1e-9, 20.0),
        (1e6, 30.0, 1e-3, 10.0, 20.0),
    ] {
        let process = Soiptd::from_acceleration_gain(gain, t_prop, damping, tau).unwrap();
        let best = pd_at_phase_margin(&process, margin_deg.to_radians()).unwrap();
        let label = format!("{process:?} at {margin_deg}");
        assert_close(
            best.ise,
            ise_by_quadrature(&process, best.pd),
            2e-11,
            &label,
        );
        assert_close(best.ise, ise(&process, best.pd).unwrap(), 1e-11, &label);
        // Far from the optimum: an eighth of Kd, and a Kp small enough for a stable loop.
        let slow = Pd {
            kp: 0.02 * best.pd.kp,
            kd: 0.125 * best.pd.kd,
        };
        assert_close(
            ise(&process, slow).unwrap(),
            ise_by_quadrature(&process, slow),
            2e-11,
            &label,
        );
    }
}

// T_prop = 1 s, 1/T_body = 1/2 1/s, tau = 0.2 s. At kp = 9/8 and kd^2 = 5/2 - kp^2 the gain crossover is 1 rad/s, and
// the two other roots of P have the sum 9/4 and the product kp^2: both are 9/8. For nearby kp they are real or complex,
// and the contour integral is used where half their distance is below 3 % of their mean.
#[test]
fn closed_form_is_regular_where_roots_meet() {
    let process = Soiptd::from_acceleration_gain(1.0, 1.0, 0.5, 0.2).unwrap();
    for change in [0.0, 1e-15, 1e-9, 1e-6, 1e-4, 4.4e-4, 4.6e-4, 1e-3, 1e-2] {
        for sign in [1.0, -1.0] {
            let kp = 1.125 * (1.0 + sign * change);
            let pd = Pd {
                kp,
                kd: (2.5 - kp * kp).sqrt(),
            };
            let cost = ise(&process, pd).unwrap();
            let label = format!("change {change}");
            assert_close(cost, ise_by_quadrature(&process, pd), 1e-11, &label);
        }
    }
}

// Without delay E = (c2 s^2 + c1 s + c0)/(d3 s^3 + d2 s^2 + d1 s + d0) with, for K/T_body = A,
//   c2 = T_prop, c1 = 1 + T_prop/T_body, c0 = 1/T_body + A Kd,
//   d3 = T_prop, d2 = 1 + T_prop/T_body, d1 = 1/T_body + A Kd, d0 = A Kp,
// and the Lyapunov equation of its companion form gives (Newton, Gould, Kaiser, "Analytical Design
// of Linear Feedback Controls", 1957, appendix E)
//   J = (c2^2 d0 d1 + (c1^2 - 2 c0 c2) d0 d3 + c0^2 d2 d3) / (2 d0 d3 (d1 d2 - d0 d3)).
#[test]
fn delay_free_cost_matches_the_lyapunov_solution() {
    for (t_prop, damping, kp, kd) in [
        (0.3, 0.5, 1.0, 0.5),
        (0.3, 0.5, 30.0, 18.0),
        (0.3, 0.0, 1.0, 2.0),
        (1.0, 1.0, 1.99, 0.0),
        (1e-4, 10.0, 50.0, 3.0),
        (5.0, 0.01, 1e-3, 0.1),
        (0.5, 3.0, 2.0, -1.0),
    ] {
        let (c2, c1, c0) = (t_prop, 1.0 + t_prop * damping, damping + kd);
        let (d3, d2, d1, d0) = (c2, c1, c0, kp);
        let lyapunov =
            (c2 * c2 * d0 * d1 + (c1 * c1 - 2.0 * c0 * c2) * d0 * d3 + c0 * c0 * d2 * d3)
                / (2.0 * d0 * d3 * (d1 * d2 - d0 * d3));
        let process = Soiptd::from_acceleration_gain(1.0, t_prop, damping, 0.0).unwrap();
        let label = format!("{t_prop} {damping} {kp} {kd}");
        // At kp = 1.99 (stable below 2) both forms lose a factor of about 400 in precision.
        assert_close(
            ise(&process, Pd { kp, kd }).unwrap(),
            lyapunov,
            2e-13,
            &label,
        );
    }
}

// T_prop = 1/5, 1/T_body = 1, Kp = Kd = 6/5: closed-loop poles -1, -2, -3, y = (1 - e^-t)^3, so with
// x = e^-t the cost is int_0^1 (3x - 3x^2 + x^3)^2 / x dx = 9/2 - 6 + 15/4 - 6/5 + 1/6 = 73/60.
// T_prop = 1/2, 1/T_body = 2, Kp = 5, Kd = 5/2: poles -2, -1 +- 2j, error e^-2t + e^-t sin 2t,
// cost 1/4 + 4/13 + 1/5 = 197/260.
#[test]
fn delay_free_cost_by_hand() {
    for (t_prop, damping, kp, kd, cost) in [
        (0.2, 1.0, 1.2, 1.2, 73.0 / 60.0),
        (0.5, 2.0, 5.0, 2.5, 197.0 / 260.0),
    ] {
        let process = Soiptd::from_acceleration_gain(1.0, t_prop, damping, 0.0).unwrap();
        assert_close(
            ise(&process, Pd { kp, kd }).unwrap(),
            cost,
            1e-14,
            "by hand",
        );
    }
}

// As the dead time takes the phase margin PM to zero, the resonance dominates the cost: J PM tends to a constant, and
// its difference from the constant is proportional to PM. Relative to 1e-7 rad the changes at 1e-5 and 1e-6 rad are as
// 99 to 9.
#[test]
fn cost_grows_like_the_inverse_of_a_small_margin() {
    let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
    let best = pd_at_phase_margin(&process, 20_f64.to_radians()).unwrap();
    let product = |margin: f64| {
        let left_s = margin / best.margins.gain_crossover_rad_per_s;
        let tau_s = 0.1 + best.margins.delay_margin_s - left_s;
        let process = Soiptd::new(1.0, 0.3, 2.0, tau_s).unwrap();
        margin * ise(&process, best.pd).unwrap()
    };
    let change = |margin: f64| product(margin) / product(1e-7) - 1.0;
    assert!(change(1e-5).abs() < 1e-3, "{:e}", change(1e-5));
    assert_close(change(1e-5) / change(1e-6), 11.0, 1e-2, "change of J PM");
}

#[test]
fn unstable_or_meaningless_loops_have_no_cost() {
    let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
    for (kp, kd) in [
        (100.0, 7.0),
        (8.5, 0.0),
        (8.5, -7.0),
        (0.0, 7.0),
        (-8.5, 7.0),
        (-8.5, -7.0),
        (f64::NAN, 7.0),
        (8.5, f64::NAN),
        (f64::INFINITY, 7.0),
        (1e300, 1e300),
    ] {
        assert_eq!(ise(&process, Pd { kp, kd }), None, "{kp} {kd}");
    }
    // A double integrator needs Kd/Kp > T_prop + tau, whatever the gain.
    let process = Soiptd::from_acceleration_gain(1.0, 0.3, 0.0, 0.1).unwrap();
    for gain in [1e-6, 1e-3, 1.0] {
        assert_eq!(
            ise(
                &process,
                Pd {
                    kp: gain,
                    kd: 0.399 * gain
                }
            ),
            None
        );
    }
    assert!(
        ise(
            &process,
            Pd {
                kp: 1e-6,
                kd: 0.401e-6
            }
        )
        .is_some()
    );
}

// Within the precision of the integrals no PD of a grid of crossovers and margins from the floor to 80 degrees costs less than the optimum of each criterion, on
// processes with short and long dead time; that of the ISE is `pd`. A floor that is higher than the criterion wants is kept.
#[test]
fn optima_of_the_absolute_error_against_a_grid() {
    for (t_prop_s, t_body_s, tau_s) in [(0.3, 2.0, 0.1), (0.015, 2.0, 0.0005), (0.015, 0.2, 0.1)] {
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).unwrap();
        let floor_rad = 20_f64.to_radians();
        assert_eq!(
            pd_by(Criterion::Ise, &process, floor_rad),
            pd(&process, floor_rad)
        );
        for criterion in [Criterion::Iae, Criterion::Itae] {
            let best = pd_by(criterion, &process, floor_rad).unwrap();
            let least = criterion.cost(&process, best.pd).unwrap();
            let centre = best.margins.gain_crossover_rad_per_s;
            for margin_deg in (20..=80).step_by(5) {
                for k in -12..=12 {
                    let omega = centre * (0.1 * f64::from(k)).exp();
                    let margin_rad = f64::from(margin_deg).to_radians();
                    let lead_rad = lead_for_margin(&process, omega, margin_rad);
                    if !(0.0..1.57).contains(&lead_rad) {
                        continue;
                    }
                    let other = OpenLoop::crossing_at(&process, omega, lead_rad).pd(&process);
                    let cost = criterion.cost(&process, other).unwrap_or(f64::INFINITY);
                    assert!(
                        cost > least * (1.0 - 2e-4),
                        "{criterion:?} {process:?} {margin_deg} deg, {omega}: {cost} {least}"
                    );
                }
            }
            let margin_deg = best.margins.phase_margin_rad.to_degrees();
            assert!(margin_deg > 20.0 - 1e-6, "{criterion:?} {margin_deg}");
            let strict = pd_by(criterion, &process, 78_f64.to_radians()).unwrap();
            let kept_deg = strict.margins.phase_margin_rad.to_degrees();
            assert!(
                (78.0 - 1e-6..78.5).contains(&kept_deg),
                "{criterion:?} {kept_deg}"
            );
        }
    }
}
