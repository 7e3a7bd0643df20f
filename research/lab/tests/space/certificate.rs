//! Certificates of the paper's multirotors, and of spaces that have none.

use onecycle_lab::space::Space;
use onecycle_lab::space::certificate::{Certificate, CertificateSummary, CycleStability};

fn certificates(space: &Space, bias: f64) -> Vec<Certificate> {
    space
        .shapes(8, 8)
        .into_iter()
        .map(|shape| {
            let times_s = space.middle_of_ray(shape).unwrap();
            Certificate::new(times_s, space.beta, bias).unwrap()
        })
        .collect()
}

// Without bias every process has exactly one cycle and it is stable; the describing function's period is
// 0.5 % too long to 7 % too short.
#[test]
fn every_multirotor_is_stable_without_bias() {
    let space = Space::MULTIROTOR;
    for certificate in certificates(&space, 0.0) {
        assert_eq!(certificate.bare.len(), 1, "{certificate:?}");
        assert_eq!(
            CycleStability::of(&certificate.bare),
            CycleStability::Stable
        );
        let (cycle, unbiased) = (certificate.bare[0], certificate.unbiased.unwrap());
        assert!((cycle.period_s() / unbiased.period_s() - 1.0).abs() < 1e-12);
        assert!(cycle.spectral_radius < 0.212);
        let (period, amplitude) = certificate.describing_function_ratios().unwrap();
        assert!((0.994..1.074).contains(&period), "{period}");
        assert!((0.97..1.19).contains(&amplitude), "{amplitude}");
    }
}

// The least stable process lies between two edges of the patch, at nearly no delay: 21.19 % of a
// deviation remains after a cycle. A finer lattice finds the same process.
#[test]
fn least_stable_multirotor() {
    let [coarse, fine] = [6, 20].map(|n| Space::MULTIROTOR.least_stable(n, n).unwrap());
    for found in [coarse, fine] {
        assert!((found.spectral_radius - 0.21188).abs() < 5e-6, "{found:?}");
        let [t_prop, t_body, tau] = found.times_s;
        assert!((t_prop - 0.1083).abs() < 1e-3 && (t_body - 2.0).abs() < 1e-9);
        assert!((tau - 0.0005).abs() < 1e-9);
    }
}

// At a bias of 0.3 of the relay's amplitude the bare relay is stable; at 0.5 it has no cycle of two
// switches. With a reduced lead there are stable cycles again, several of them. With the trim the cycle
// is stable at both, and up to its limit of 0.9.
#[test]
fn multirotors_under_a_bias() {
    let summary = |bias| CertificateSummary::of(bias, &certificates(&Space::MULTIROTOR, bias));
    let (calm, strong) = (summary(0.3), summary(-0.5));
    assert_eq!((calm.bare.stable, calm.bare.unstable), (64, 0));
    assert!(calm.bare.radius.unwrap() < 1.0);
    assert_eq!(strong.bare.no_cycle, 64);
    assert_eq!(strong.bare.stretch, None);
    assert_eq!(strong.turned_back.coexisting, 64);
    let (low, high) = strong.turned_back.stretch.unwrap();
    assert!(low > 1.2 && high < 3.3, "{low} {high}");
    for summary in [calm, strong] {
        assert_eq!(summary.trimmed, 64);
        assert!((summary.trimmed_radius.unwrap() - 0.511).abs() < 1e-3);
    }
    let process = [0.1, 1.0, 0.02];
    let at = |bias| Certificate::new(process, -0.73, bias).unwrap().trimmed;
    assert!(at(0.9).is_some() && at(0.91).is_none());
}

#[test]
fn verdicts() {
    let stable = certificates(&Space::MULTIROTOR, 0.0)[0].bare[0];
    let mut unstable = stable;
    unstable.spectral_radius = 1.0;
    for (cycles, verdict) in [
        (vec![], CycleStability::NoCycle),
        (vec![unstable], CycleStability::Unstable),
        (vec![stable], CycleStability::Stable),
        (vec![unstable, stable], CycleStability::Stable),
        (vec![stable, stable], CycleStability::Coexisting),
    ] {
        assert_eq!(CycleStability::of(&cycles), verdict);
    }
}

// Lags of milliseconds with a body of hours are close to a double integrator. A lagging relay does not
// reverse it within a reasonable period.
#[test]
fn a_lagging_relay_is_not_certified_on_double_integrators() {
    let space = Space {
        t_body_s: (1e8, 1e9),
        beta: 0.3,
        ..Space::MULTIROTOR
    };
    let worst = space.least_stable(4, 4).unwrap();
    println!("{worst:?}");
    assert!(worst.spectral_radius >= 1.0, "{worst:?}");
}
