//! What it takes merely to read the weights: their sum. No forward pass of one sample can be
//! faster, as it reads each weight once too.

use onecycle_lab::learn::train::Network;
use pulp::{Arch, Simd, WithSimd};

use crate::rounds::Contender;

/// Sums side by side, so that none waits for an addition: two a cycle, each of four cycles.
const SUMS: usize = 8;

/// The weights in memory of their own.
pub(crate) fn copy(network: &Network) -> Vec<f32> {
    let matrices = network.parameters().map(|matrix| matrix.values());
    matrices.flatten().copied().collect()
}

/// Reads from front to back, in one place or in several at a time.
pub(crate) fn contender(values: &[f32], places: usize) -> Contender<'_> {
    let name = format!("reading the weights: a sum, at {places} places at a time");
    let run = move |_: &[f32], outputs: &mut Vec<f32>| {
        outputs.clear();
        outputs.push(match places {
            1 => Arch::new().dispatch(Sum::<1, SUMS>(values)),
            _ => Arch::new().dispatch(Sum::<4, { SUMS / 4 }>(values)),
        });
        Ok(())
    };
    Contender::new(name, run).without_outputs()
}

/// At so many places, with so many sums at each.
struct Sum<'a, const PLACES: usize, const EACH: usize>(&'a [f32]);

impl<const PLACES: usize, const EACH: usize> WithSimd for Sum<'_, PLACES, EACH> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let (vectors, rest) = S::as_simd_f32s(self.0);
        let (groups, more) = vectors.as_chunks::<EACH>();
        let length = groups.len() / PLACES;
        let places: [&[[S::f32s; EACH]]; PLACES] =
            std::array::from_fn(|place| &groups[place * length..][..length]);
        let mut sums = [[simd.splat_f32s(0.0); EACH]; PLACES];
        for i in 0..length {
            for (sums, place) in sums.iter_mut().zip(&places) {
                for (sum, vector) in sums.iter_mut().zip(&place[i]) {
                    *sum = simd.add_f32s(*sum, *vector);
                }
            }
        }
        let last = groups[PLACES * length..].as_flattened().iter().chain(more);
        let all = sums.as_flattened().iter().chain(last);
        let sum = all.fold(simd.splat_f32s(0.0), |sum, vector| {
            simd.add_f32s(sum, *vector)
        });
        simd.reduce_sum_f32s(sum) + rest.iter().sum::<f32>()
    }
}
