//! The gain crossover of random loops.

use onecycle_onboard::Soiptd;
use onecycle_onboard::crossover::{gain_crossover, power_of_two_cube_root};
use proptest::prelude::*;

proptest! {
    // The magnitude is one at the crossover, to the roundings of its own formula; the two bounds that Newton's
    // method may start from lead to the same root. Times over six decades, leads to a degree below 90.
    #[test]
    fn the_magnitude_is_one_there(
        ln_omega in -7.0..7.0_f64,
        ln_lag in -7.0..7.0_f64,
        ln_damping in -7.0..7.0_f64,
        lead_rad in 0.01..1.55_f64,
    ) {
        let (omega, lag_s, damping) = (ln_omega.exp(), ln_lag.exp(), ln_damping.exp());
        let process = Soiptd::from_acceleration_gain(1.0, lag_s, damping, 0.1).unwrap();
        let over_magnitude = 1.0 / process.magnitude(omega);
        let kp = lead_rad.cos() * over_magnitude;
        let kd = lead_rad.sin() * over_magnitude / omega;
        for bound in [f64::cbrt, power_of_two_cube_root] {
            let found = gain_crossover(kp, kd, damping, lag_s, bound);
            let magnitude = kp.hypot(kd * found) * process.magnitude(found);
            prop_assert!((magnitude - 1.0).abs() < 1e-14, "{found} {magnitude}");
        }
    }
}
