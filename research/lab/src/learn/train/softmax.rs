//! The losses of a classifier, one sample at a time.
//!
//! Each is the cross-entropy of a softmax of `z_i = gamma_i (a_i - s) + b_i`, where `a` are the
//! network's outputs, or an expectation over the plain softmax:
//!
//! ```text
//! p_i = exp(z_i) / sum_j exp(z_j),   L = -ln p_T = ln sum_j exp(z_j) - z_T
//!
//! s = 0                   dL/da_k = gamma_k (p_k - y_k)
//! s = a_m, the least one  dL/da_k = gamma_k (p_k - y_k) - [k = m] sum_i gamma_i (p_i - y_i)
//!
//! L = sum_i p_i J_i + c (-ln p_T) - h H,   H = -sum_i p_i ln p_i
//! dL/da_k = p_k (J_k - sum_i p_i J_i) + c (p_k - y_k) + h p_k (ln p_k + H)
//! ```
//!
//! The paper's equation 16 has `J` in place of `gamma`, and its appendix has the opposite sign in the
//! last line; finite differences confirm `p_k - y_k`.

/// Memory of a softmax: two rows of the length of the outputs, reused from sample to sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Softmax {
    gamma: Vec<f64>,
    p: Vec<f64>,
}

/// `z_i` in terms of the outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Logits {
    /// `z_i = a_i`.
    Plain,
    /// `z_i = (1 + J_i) a_i`.
    Scaled,
    /// `z_i = (1 + J_i) (a_i - min_j a_j)`.
    ScaledFromLeast,
    /// `z_i = a_i + m J_i`.
    Raised(f64),
}

/// Shares of the expected-cost loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shares {
    pub(super) cross_entropy: f64,
    pub(super) entropy: f64,
}

impl Softmax {
    /// `L` and, in `gradient`, its derivatives. `cost(i)` is `J_iT`.
    pub(super) fn cross_entropy(
        &mut self,
        (outputs, class): (&[f32], usize),
        logits: Logits,
        cost: impl Fn(usize) -> f64,
        gradient: &mut [f64],
    ) -> f64 {
        let least = (logits == Logits::ScaledFromLeast).then(|| position_of_least(outputs));
        let shift = least.map_or(0.0, |m| f64::from(outputs[m]));
        self.gamma.clear();
        self.p.clear();
        for (i, &a) in outputs.iter().enumerate() {
            let (gamma, raise) = match logits {
                Logits::Plain => (1.0, 0.0),
                Logits::Scaled | Logits::ScaledFromLeast => (1.0 + cost(i), 0.0),
                Logits::Raised(scale) => (1.0, scale * cost(i)),
            };
            self.gamma.push(gamma);
            self.p.push(gamma * (f64::from(a) - shift) + raise);
        }
        let of_true = self.p[class];
        let loss = normalise(&mut self.p) - of_true;
        let mut sum = 0.0;
        for (k, slope) in gradient.iter_mut().enumerate() {
            let y = if k == class { 1.0 } else { 0.0 };
            *slope = self.gamma[k] * (self.p[k] - y);
            sum += *slope;
        }
        if let Some(m) = least {
            gradient[m] -= sum;
        }
        loss
    }

    /// The expected cost with its shares; `gradient` as above.
    pub(super) fn expected_cost(
        &mut self,
        (outputs, class): (&[f32], usize),
        shares: Shares,
        cost: impl Fn(usize) -> f64,
        gradient: &mut [f64],
    ) -> f64 {
        self.p.clear();
        self.p.extend(outputs.iter().copied().map(f64::from));
        let log_sum = normalise(&mut self.p);
        let ln_p = |i: usize| f64::from(outputs[i]) - log_sum;
        let (mut expected, mut entropy) = (0.0, 0.0);
        for (i, p) in self.p.iter().enumerate() {
            expected += p * cost(i);
            entropy -= p * ln_p(i);
        }
        for (k, slope) in gradient.iter_mut().enumerate() {
            let p = self.p[k];
            let y = if k == class { 1.0 } else { 0.0 };
            *slope = p * (cost(k) - expected)
                + shares.cross_entropy * (p - y)
                + shares.entropy * p * (ln_p(k) + entropy);
        }
        expected - shares.cross_entropy * ln_p(class) - shares.entropy * entropy
    }
}

/// Replaces `z` by probabilities; returns `ln sum exp(z)`.
fn normalise(z: &mut [f64]) -> f64 {
    let highest = z.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sum = 0.0;
    for value in z.iter_mut() {
        *value = (*value - highest).exp();
        sum += *value;
    }
    z.iter_mut().for_each(|value| *value /= sum);
    highest + sum.ln()
}

/// The first of the least values.
fn position_of_least(values: &[f32]) -> usize {
    let mut least = 0;
    for (i, value) in values.iter().enumerate() {
        if *value < values[least] {
            least = i;
        }
    }
    least
}
