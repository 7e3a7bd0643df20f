//! Random processes of every structure, and what is asked for them.

use onecycle_design::{
    Execution, Form, Linear, MeasurementNoise, Model, Specification, Structure, Style,
};

/// Numbers of the splitmix64 sequence (Steele, Lea, Flood 2014).
pub(crate) struct Random(u64);

impl Random {
    /// A sequence of its own for each number.
    pub(crate) fn new(number: u64) -> Self {
        Self(number.wrapping_mul(0xd134_2543_de82_ef95))
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Ten to the power of a uniform number.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.uniform(low, high))
    }

    fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.uniform(0.0, choices.len() as f64) as usize]
    }

    /// Process of any structure: gains of either sign over six decades, a time scale from 1 ms to 10^4 s, and times spread
    /// over four decades about it.
    pub(crate) fn process(&mut self) -> Model {
        let structure = self.one_of(&Structure::ALL);
        let scale_s = self.decades(-3.0, 4.0);
        let sign = self.one_of(&[1.0, 1.0, 1.0, -1.0]);
        let natural = 1.0 / scale_s;
        let damping = self.decades(-2.5, 0.7);
        Linear::new(structure)
            .with_gain(sign * self.decades(-3.0, 3.0))
            .with_lags_s([
                scale_s * self.decades(-3.0, 0.0),
                scale_s * self.decades(-3.0, 0.0),
            ])
            .with_pole_per_s(self.one_of(&[0.0, 1.0, 1.0, 1.0]) * self.decades(-2.0, 1.5) / scale_s)
            .with_pair(2.0 * damping * natural, natural * natural)
            .with_tau_s(scale_s * self.decades(-3.0, 1.0))
            .into()
    }

    /// Process with an unstable pole, at most one lag, and a dead time up to a fifth of the time in which it grows.
    pub(crate) fn unstable_process(&mut self) -> Model {
        let structure = self.one_of(&[Structure::Foptd, Structure::Soptd]);
        let growth_s = self.decades(-3.0, 4.0);
        Linear::new(structure)
            .with_gain(self.one_of(&[1.0, -1.0]) * self.decades(-3.0, 3.0))
            .with_lags_s([growth_s * self.decades(-2.5, -0.7), 1.0])
            .with_pole_per_s(-1.0 / growth_s)
            .with_tau_s(growth_s * self.decades(-2.5, -0.7))
            .into()
    }

    /// Any form and style; some with sampling, some with noise.
    pub(crate) fn specification(&mut self, model: &Model) -> Specification {
        let form = self.one_of(&Form::ALL);
        let style = self.one_of(&[Style::Sharp, Style::Balanced, Style::Calm]);
        let asked = Specification::new(form, style);
        let tau_s = model.linear().tau_s();
        let asked = match self.one_of(&[0, 0, 1, 2]) {
            1 => asked.with_execution(Execution::sampled(tau_s * self.decades(-2.0, 0.3))),
            _ => asked,
        };
        if self.uniform(0.0, 1.0) < 0.15 {
            let std = self.decades(-4.0, -1.0);
            asked.with_noise(MeasurementNoise::new(
                std,
                tau_s * self.decades(-2.0, 0.0),
                1.0,
            ))
        } else {
            asked
        }
    }
}
