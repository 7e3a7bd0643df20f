//! Random processes that search a grid for holes: inside the space, on its faces, in its corners.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::space::Space;

/// If the lowest time is zero, logarithmic draws start at this part of the highest time.
const LEAST_PART: f64 = 1e-3;

/// Number of corners of a box.
const CORNERS: u64 = 8;

/// Distance of the streams of neighbouring seeds: 2^64 over the golden ratio.
const STRIDE: u64 = 0x9E37_79B9_7F4A_7C15;

/// `T_prop`, `T_body`, `tau` (s) of draw number `n`.
///
/// The first eight draws are the corners. Of the others a quarter is uniform in the times, a quarter in
/// their logarithms, and half is one of these with each time moved to its lowest or highest value with
/// a probability of one half: of these 3/8 lie on a face, 3/8 on an edge, 1/8 in a corner.
pub(super) fn times_s(space: &Space, seed: u64, n: u64) -> [f64; 3] {
    let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(STRIDE).wrapping_add(n));
    let (in_logarithms, on_faces) = (n % 2 == 1, n % 4 >= 2);
    let mut axis = 0;
    space.ranges_s().map(|(low, high)| {
        let part: f64 = rng.random_range(0.0..=1.0);
        let side: u32 = rng.random_range(0..4);
        let is_high_corner = n >> axis & 1 == 1;
        axis += 1;
        if n < CORNERS {
            return if is_high_corner { high } else { low };
        }
        let inside = if in_logarithms {
            let least = low.max(LEAST_PART * high);
            // A range of zero to zero has one value.
            if least > 0.0 {
                least * (high / least).powf(part)
            } else {
                low
            }
        } else {
            low + part * (high - low)
        };
        match side {
            0 if on_faces => low,
            1 if on_faces => high,
            _ => inside.clamp(low, high),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // The first eight draws are the eight corners, each once. All later draws lie in the box. Two of
    // every four draws may have a time on a face, each with a probability of 1 - 1/8 = 7/8:
    #[test]
    fn corners_faces_and_the_inside() {
        let space = Space::MULTIROTOR;
        let on_a_face = |times_s: [f64; 3]| {
            let on = |(time, (low, high))| time == low || time == high;
            times_s
                .into_iter()
                .zip(space.ranges_s())
                .filter(|&pair| on(pair))
                .count()
        };
        let mut corners: Vec<[f64; 3]> = (0..8).map(|n| times_s(&space, 5, n)).collect();
        assert!(corners.iter().all(|&corner| on_a_face(corner) == 3));
        corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
        corners.dedup();
        assert_eq!(corners.len(), 8);
        let mut faces = 0;
        for n in 8..4008 {
            let times = times_s(&space, 5, n);
            for (time_s, (low, high)) in times.into_iter().zip(space.ranges_s()) {
                assert!((low..=high).contains(&time_s));
            }
            faces += usize::from(on_a_face(times) > 0);
        }
        // 4000 * 7/16 = 1750, give or take three times sqrt(2000 * 7/64) = 15.
        assert!((1705..1795).contains(&faces), "{faces}");
        assert_eq!(times_s(&space, 5, 77), times_s(&space, 5, 77));
        assert_ne!(times_s(&space, 5, 77), times_s(&space, 6, 77));
    }
}
