//! Battery: an open-circuit voltage that falls with the charge, and an internal resistance.
//!
//! The motors draw a power `P`, so `P = V I` and `V = E - R I`:
//!
//! ```text
//! V = (E + sqrt(E^2 - 4 R P)) / 2,   E = E_empty + (E_full - E_empty) charge,   d(charge)/dt = -I / C
//! ```
//!
//! `V` is the terminal voltage (V), `E` the open-circuit voltage (V), `R` the resistance (ohm), `C` the capacity
//! (A s). Above the largest power `P = E^2 / 4 R` the voltage stays at `E / 2`. An empty battery stays at
//! `E_empty`.

/// A battery.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Battery {
    /// Open-circuit voltage when full (V).
    pub full_v: f64,
    /// Open-circuit voltage when empty (V).
    pub empty_v: f64,
    /// Resistance of cells and leads (ohm).
    pub resistance_ohm: f64,
    /// Charge when full (A s).
    pub capacity_a_s: f64,
}

impl Battery {
    /// Open-circuit voltage (V) at a charge of 0..1.
    #[must_use]
    #[inline]
    pub fn open_circuit_v(&self, charge: f64) -> f64 {
        self.empty_v + (self.full_v - self.empty_v) * charge
    }

    /// Voltage (V) at a charge of 0..1 while `power_w` is drawn.
    #[must_use]
    #[inline]
    pub fn voltage_v(&self, charge: f64, power_w: f64) -> f64 {
        0.5 * (self.open_circuit_v(charge) + self.root_v(charge, power_w))
    }

    /// Derivative of the voltage by the power (V/W): `-R / sqrt(E^2 - 4 R P)`.
    #[must_use]
    pub fn sag_v_per_w(&self, charge: f64, power_w: f64) -> f64 {
        -self.resistance_ohm / self.root_v(charge, power_w)
    }

    fn root_v(&self, charge: f64, power_w: f64) -> f64 {
        let open_v = self.open_circuit_v(charge);
        (open_v * open_v - 4.0 * self.resistance_ohm * power_w)
            .max(0.0)
            .sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BATTERY: Battery = Battery {
        full_v: 16.0,
        empty_v: 12.0,
        resistance_ohm: 0.1,
        capacity_a_s: 10_000.0,
    };

    // Half full: 14 V. A current of 20 A leaves 12 V, so at 240 W the voltage is 12 V. More than 14^2 / 0.4 =
    // 490 W is not available: half the open-circuit voltage, 7 V.
    #[test]
    fn the_voltage_sags_with_the_power() {
        assert!((BATTERY.voltage_v(0.5, 240.0) - 12.0).abs() < 1e-14);
        assert_eq!(BATTERY.voltage_v(0.5, 0.0), 14.0);
        assert_eq!(BATTERY.voltage_v(0.5, 600.0), 7.0);
        // dV/dP = -R / (2 V - E) = -0.1 / 10.
        assert!((BATTERY.sag_v_per_w(0.5, 240.0) + 0.01).abs() < 1e-15);
    }
}
