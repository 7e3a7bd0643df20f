//! PID controller with measurement filter and set-point weight, and its three common forms.
//!
//! ```text
//! u = kp (b r - yf) + ki int (r - yf) dt - kd dyf/dt,     yf = F y,     F = 1/(1 + Tf s + (Tf s)^2/2)
//! ```
//!
//! | form | controller without filter and set-point weight |
//! |------|-----------|
//! | parallel | `kp + ki/s + kd s` |
//! | ideal | `k (1 + 1/(Ti s) + Td s)` |
//! | series | `k' (1 + 1/(Ti' s)) (1 + Td' s)`, which needs `Ti >= 4 Td` |
//!
//! Reference: K. J. Astrom, T. Hagglund, "Advanced PID Control" (ISA, 2006), section 3.2.

use super::execution::Execution;

/// PID controller in parallel form. A zero gain leaves a term out: P, PI, PD.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Pid {
    /// Proportional gain (input unit / output unit).
    pub kp: f64,
    /// Integral gain (input unit / (output unit s)).
    pub ki: f64,
    /// Derivative gain (input unit s / output unit). The derivative acts on the measurement.
    pub kd: f64,
    /// Time `Tf` of the measurement filter (s). Zero: no filter.
    pub filter_s: f64,
    /// Weight `b` of the reference in the proportional term.
    pub setpoint_weight: f64,
    /// Known filters and sampling.
    pub execution: Execution,
}

/// Gain and times of the ideal form.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Ideal {
    /// Gain `k` (input unit / output unit).
    pub gain: f64,
    /// Integral time `Ti` (s). Infinite without integral.
    pub integral_time_s: f64,
    /// Derivative time `Td` (s).
    pub derivative_time_s: f64,
}

/// Gain and times of the series form.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Series {
    /// Gain `k'` (input unit / output unit).
    pub gain: f64,
    /// Integral time `Ti'` (s). Infinite without integral.
    pub integral_time_s: f64,
    /// Derivative time `Td'` (s), not longer than the integral time.
    pub derivative_time_s: f64,
}

impl Pid {
    /// Controller with these gains, without filter, with set-point weight 1.
    #[must_use]
    pub fn new(kp: f64, ki: f64, kd: f64) -> Self {
        Self {
            kp,
            ki,
            kd,
            filter_s: 0.0,
            setpoint_weight: 1.0,
            execution: Execution::default(),
        }
    }

    /// Sets the time of the measurement filter (s).
    #[must_use]
    pub fn with_filter_s(self, filter_s: f64) -> Self {
        Self { filter_s, ..self }
    }

    /// Sets the set-point weight.
    #[must_use]
    pub fn with_setpoint_weight(self, setpoint_weight: f64) -> Self {
        Self {
            setpoint_weight,
            ..self
        }
    }

    /// Sets known filters and sampling.
    #[must_use]
    pub fn with_execution(self, execution: Execution) -> Self {
        Self { execution, ..self }
    }

    /// The ideal form. `None` if the proportional gain is zero.
    #[must_use]
    pub fn ideal(&self) -> Option<Ideal> {
        (self.kp != 0.0).then(|| Ideal {
            gain: self.kp,
            integral_time_s: self.kp / self.ki,
            derivative_time_s: self.kd / self.kp,
        })
    }

    /// The series form. `None` if the zeros are complex (`Ti < 4 Td`), or if the proportional gain is zero.
    #[must_use]
    pub fn series(&self) -> Option<Series> {
        let ideal = self.ideal()?;
        let share = 4.0 * ideal.derivative_time_s / ideal.integral_time_s;
        // k' = k (1 + sqrt(1 - 4 Td/Ti))/2; the times follow from Ti' = k'/ki and Td' = kd/k'.
        let gain = 0.5 * ideal.gain * (1.0 + (1.0 - share).sqrt());
        (share <= 1.0).then(|| Series {
            gain,
            integral_time_s: gain / self.ki,
            derivative_time_s: self.kd / gain,
        })
    }
}

impl Ideal {
    /// Ideal form with this gain (input unit / output unit) and these times (s).
    #[must_use]
    pub fn new(gain: f64, integral_time_s: f64, derivative_time_s: f64) -> Self {
        Self {
            gain,
            integral_time_s,
            derivative_time_s,
        }
    }

    /// The parallel form.
    #[must_use]
    pub fn pid(&self) -> Pid {
        Pid::new(
            self.gain,
            self.gain / self.integral_time_s,
            self.gain * self.derivative_time_s,
        )
    }
}

impl Series {
    /// Series form with this gain (input unit / output unit) and these times (s).
    #[must_use]
    pub fn new(gain: f64, integral_time_s: f64, derivative_time_s: f64) -> Self {
        Self {
            gain,
            integral_time_s,
            derivative_time_s,
        }
    }

    /// The parallel form.
    #[must_use]
    pub fn pid(&self) -> Pid {
        let factor = 1.0 + self.derivative_time_s / self.integral_time_s;
        Pid::new(
            self.gain * factor,
            self.gain / self.integral_time_s,
            self.gain * self.derivative_time_s,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: 2 (1 + 1/(3 s)) (1 + s) = 2 (1 + 1/3) + (2/3)/s + 2 s; ideal: k = 8/3, Ti = 4, Td = 3/4.
    #[test]
    fn forms_by_hand() {
        let pid = Series::new(2.0, 3.0, 1.0).pid();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-15 * b.abs(), "{a} {b}");
        close(pid.kp, 8.0 / 3.0);
        close(pid.ki, 2.0 / 3.0);
        close(pid.kd, 2.0);
        let ideal = pid.ideal().unwrap();
        close(ideal.integral_time_s, 4.0);
        close(ideal.derivative_time_s, 0.75);
        close(ideal.pid().ki, pid.ki);
        let series = pid.series().unwrap();
        close(series.gain, 2.0);
        close(series.integral_time_s, 3.0);
        close(series.derivative_time_s, 1.0);
    }

    // Ti = 3 Td has complex zeros. Without integral the series form is the parallel form.
    #[test]
    fn complex_zeros_have_no_series_form() {
        assert_eq!(Ideal::new(1.0, 3.0, 1.0).pid().series(), None);
        assert_eq!(Pid::new(0.0, 1.0, 1.0).ideal(), None);
        let pd = Pid::new(2.0, 0.0, 6.0).series().unwrap();
        assert_eq!(
            (pd.gain, pd.integral_time_s, pd.derivative_time_s),
            (2.0, f64::INFINITY, 3.0)
        );
    }
}
