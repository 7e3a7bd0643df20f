//! Thinning of long curves, so that a page stays small.

/// Pieces that a long curve is cut into, each drawn by its extremes: more than a screen is wide.
const PIECES: usize = 1500;

/// All points, or of each piece the first, the least, the greatest and the last, in their order.
pub(super) fn thinned(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = points.collect();
    if points.len() <= 4 * PIECES {
        return points;
    }
    let of_piece = |piece: &[(f64, f64)]| {
        let place = |of: fn(f64, f64) -> bool| {
            (0..piece.len()).reduce(|best, at| {
                if of(piece[at].1, piece[best].1) {
                    at
                } else {
                    best
                }
            })
        };
        let (least, most) = (place(|a, b| a < b), place(|a, b| a > b));
        let mut kept: Vec<usize> = [Some(0), least, most, piece.len().checked_sub(1)]
            .into_iter()
            .flatten()
            .collect();
        kept.sort_unstable();
        kept.dedup();
        kept.into_iter().map(|at| piece[at]).collect::<Vec<_>>()
    };
    points
        .chunks(points.len().div_ceil(PIECES))
        .flat_map(of_piece)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // A million points with one spike each way: at most four of a piece are left, both spikes among them, and time
    // never goes back.
    #[test]
    fn spikes_are_drawn() {
        let time_s: Vec<f64> = (0..1_000_000).map(f64::from).collect();
        let mut values = vec![0.0; time_s.len()];
        values[123_457] = 5.0;
        values[654_321] = -7.0;
        let of = |count: usize| {
            time_s[..count]
                .iter()
                .copied()
                .zip(values[..count].iter().copied())
        };
        let points = thinned(of(1_000_000));
        assert!(points.len() <= 4 * PIECES);
        assert!(points.contains(&(123_457.0, 5.0)) && points.contains(&(654_321.0, -7.0)));
        assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(points.last(), Some(&(999_999.0, 0.0)));
        assert_eq!(thinned(of(100)).len(), 100);
    }
}
