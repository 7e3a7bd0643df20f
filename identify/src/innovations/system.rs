//! A process under its noises as a linear system, and the states that it may start from.

use onecycle_design::matrix::{Matrix, identity};
use onecycle_design::state_space::StateSpace;

use super::lifted::{Lifted, Sample};
use super::record::Blocks;
use super::theta::{NoiseKind, Theta};

/// Calls a function of the number of states for a process.
macro_rules! by_size {
    ($theta:expr, $call:ident($($argument:expr),*)) => {
        match $theta.structure.stages().states() + 1 {
            2 => $call::<2>($($argument),*),
            3 => $call::<3>($($argument),*),
            4 => $call::<4>($($argument),*),
            5 => $call::<5>($($argument),*),
            _ => None,
        }
    };
}
pub(super) use by_size;

/// Matrices of a process under its noises.
pub(super) struct System<const N: usize> {
    pub(super) model: StateSpace<N>,
    /// Output row.
    pub(super) c: [f64; N],
    /// Intensities of the noises over the variance of the white noise of a sample.
    intensity: Matrix<N>,
    grows: bool,
}

impl<const N: usize> System<N> {
    pub(super) fn new(theta: &Theta, dt_s: f64) -> Self {
        let mut model = StateSpace::<N>::new(&theta.process(1.0));
        let stages = theta.structure.stages();
        let behind = stages.behind_the_lags() as i32;
        let mut c = [0.0; N];
        c[model.output] = 1.0;
        let [w1, w0, wy] = NoiseKind::ALL.map(|kind| theta.noise(kind));
        // Without an integrator the last state is the walk of the output. It takes the place of the disturbance, from
        // which it could hardly be told in the steady state.
        let mut walking = model.output;
        if wy > 0.0 && stages.integrators == 0 {
            walking = N - 1;
            c[N - 1] = 1.0;
            for row in &mut model.a {
                row[N - 1] = 0.0;
            }
        }
        let mut intensity = [[0.0; N]; N];
        if w1 > 0.0 && walking != N - 1 {
            intensity[N - 1][N - 1] = dt_s * w1.powi(2 * behind + 2);
        }
        for i in 0..N {
            for j in 0..N {
                intensity[i][j] += model.entry[i] * model.entry[j] * dt_s * w0.powi(2 * behind);
            }
        }
        if wy > 0.0 {
            intensity[walking][walking] += dt_s * wy * wy;
        }
        Self {
            model,
            c,
            intensity,
            grows: theta.grows,
        }
    }

    /// Matrices of one sample of `step_s`.
    fn sample(&self, step_s: f64, phi: Matrix<N>) -> Sample<N> {
        Sample {
            phi,
            c: self.c,
            q: self.model.covariance(&self.intensity, step_s),
            noise: 1.0,
        }
    }

    /// States that the start may have.
    pub(super) fn start_of(&self, blocks: &Blocks<'_>, theta: &Theta) -> Start<N> {
        match blocks.record.rest {
            Some(rest) => Start::at_rest(theta, self, rest.may_drift),
            None => Start::free(),
        }
    }

    fn is_quiet(&self) -> bool {
        self.intensity.iter().flatten().all(|v| *v == 0.0)
    }

    /// Matrices of each kind of block.
    pub(super) fn lifted(&self, blocks: &Blocks<'_>) -> Vec<Lifted<N>> {
        let mut lifted: Vec<Lifted<N>> = Vec::with_capacity(blocks.kinds.len());
        let mut last: Option<(f64, Sample<N>)> = None;
        for kind in &blocks.kinds {
            let sample = match last.take() {
                Some((step_s, sample)) if step_s == kind.step_s => sample,
                _ => self.sample(kind.step_s, self.model.step(kind.step_s).phi),
            };
            lifted.push(if kind.mask.iter().all(|present| *present) {
                Lifted::of_full(&sample, kind.mask.len())
            } else {
                Lifted::of_mask(&sample, &kind.mask)
            });
            last = Some((kind.step_s, sample));
        }
        lifted
    }

    /// Covariance that the filter starts from: the steady one of the first kind of block without absent samples.
    ///
    /// Of an unstable process no start without a disturbance gives a stable filter.
    pub(super) fn start(&self, blocks: &Blocks<'_>, lifted: &[Lifted<N>]) -> Option<Matrix<N>> {
        if self.is_quiet() {
            return (!self.grows).then_some([[0.0; N]; N]);
        }
        let is_full = |kind: usize| blocks.kinds[kind].mask.iter().all(|present| *present);
        let full = (0..lifted.len()).find(|&kind| is_full(kind) && lifted[kind].r > 0.0);
        let any = || (0..lifted.len()).find(|&kind| lifted[kind].r > 0.0);
        lifted[full.or_else(any)?].steady_covariance()
    }
}

/// States that the start may have: the sum of the first `count` columns of `basis`, each times an unknown.
pub(super) struct Start<const N: usize> {
    /// By rows: the state of a column is `basis[0..N][column]`.
    pub(super) basis: Matrix<N>,
    pub(super) count: usize,
}

impl<const N: usize> Start<N> {
    /// Any state.
    fn free() -> Self {
        Self {
            basis: identity(),
            count: N,
        }
    }

    /// The states at rest under a constant input, which the response to the input leaves out: a constant output, and if that of an
    /// integrator may drift a constant rate too. The disturbance is the one that keeps that state.
    fn at_rest(theta: &Theta, system: &System<N>, may_drift: bool) -> Self {
        let stages = theta.structure.stages();
        let [_, c0] = theta.process(1.0).pair();
        let pole = theta.process(1.0).pole_per_s();
        let walks = system.c[N - 1] != 0.0;
        let entry = stages.lags;
        let mut columns: Vec<[f64; N]> = Vec::with_capacity(2);
        let mut column = |state: usize, disturbance: f64| {
            let mut at = [0.0; N];
            at[state] = 1.0;
            at[N - 1] += disturbance;
            columns.push(at);
        };
        match (walks, stages.integrators) {
            (true, _) => column(N - 1, 0.0),
            (false, 0) if stages.pairs > 0 => column(entry, c0),
            (false, 0) => column(entry, pole),
            (false, integrators) => {
                column(system.model.output, 0.0);
                match (stages.poles, integrators) {
                    _ if !may_drift => {}
                    (0, 1) => column(N - 1, 0.0),
                    (0, _) => column(entry, 0.0),
                    _ => column(entry, pole),
                }
            }
        }
        let mut basis = [[0.0; N]; N];
        for (j, column) in columns.iter().enumerate() {
            for i in 0..N {
                basis[i][j] = column[i];
            }
        }
        Self {
            basis,
            count: columns.len(),
        }
    }

    /// Covariance of the gain, the first linear unknown, and of the disturbance at the start, from that of any two unknowns.
    pub(super) fn with_disturbance(
        &self,
        responses: usize,
        covariance: impl Fn(usize, usize) -> f64,
    ) -> [[f64; 2]; 2] {
        let row = &self.basis[N - 1][..self.count];
        let weighted = |i: usize| -> f64 {
            let columns = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            columns
                .map(|(j, weight)| weight * covariance(i, responses + j))
                .sum()
        };
        let columns = row.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        let own = columns
            .map(|(j, weight)| weight * weighted(responses + j))
            .sum();
        let mixed = weighted(0);
        [[covariance(0, 0), mixed], [mixed, own]]
    }
}
