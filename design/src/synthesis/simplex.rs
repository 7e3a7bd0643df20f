//! Minimum of a function of a few variables by the simplex method of Nelder and Mead (1965).

/// Best value and point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Best {
    pub value: f64,
    pub point: Vec<f64>,
}

/// Size of the first simplex, tolerance of the variables, most evaluations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub size: f64,
    pub tolerance: f64,
    pub evaluations: usize,
}

/// Simplex in progress: values and corners.
struct Simplex<'a, F> {
    f: &'a mut F,
    corners: Vec<(f64, Vec<f64>)>,
    evaluations: usize,
}

impl<F: FnMut(&[f64]) -> f64> Simplex<'_, F> {
    fn corner(&mut self, point: Vec<f64>) -> (f64, Vec<f64>) {
        self.evaluations += 1;
        ((self.f)(&point), point)
    }

    fn sort(&mut self) {
        self.corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// Largest distance of a corner from the best one, in any variable.
    fn spread(&self) -> f64 {
        let best = self.corners[0].1.iter().cycle();
        let others = self.corners[1..].iter().flat_map(|corner| &corner.1);
        others
            .zip(best)
            .fold(0.0, |spread: f64, (a, b)| spread.max((a - b).abs()))
    }

    /// Corner on the line from the worst one through the centre of the others, `factor` times as far on the other side.
    fn along(&mut self, factor: f64) -> (f64, Vec<f64>) {
        let n = self.corners.len() - 1;
        let point = (0..n)
            .map(|i| {
                let sum: f64 = self.corners[..n].iter().map(|corner| corner.1[i]).sum();
                let centre = sum / n as f64;
                centre + factor * (centre - self.corners[n].1[i])
            })
            .collect();
        self.corner(point)
    }

    /// Replaces the worst of the sorted corners, or moves all to the best one.
    fn step(&mut self) {
        let n = self.corners.len() - 1;
        let reflected = self.along(1.0);
        if reflected.0 < self.corners[0].0 {
            let expanded = self.along(2.0);
            self.corners[n] = if expanded.0 < reflected.0 {
                expanded
            } else {
                reflected
            };
            return;
        }
        if reflected.0 < self.corners[n - 1].0 {
            self.corners[n] = reflected;
            return;
        }
        let outside = reflected.0 < self.corners[n].0;
        let contracted = self.along(if outside { 0.5 } else { -0.5 });
        if contracted.0 < reflected.0.min(self.corners[n].0) {
            self.corners[n] = contracted;
            return;
        }
        let best = self.corners[0].1.clone();
        for i in 1..=n {
            let halfway = |(a, b): (&f64, &f64)| b + 0.5 * (a - b);
            let point = self.corners[i].1.iter().zip(&best).map(halfway).collect();
            self.corners[i] = self.corner(point);
        }
    }
}

/// Local minimum of `f` from `start`, whose value is known.
pub(crate) fn minimise(f: &mut impl FnMut(&[f64]) -> f64, start: &Best, extent: Extent) -> Best {
    let n = start.point.len();
    let mut simplex = Simplex {
        f,
        corners: vec![(start.value, start.point.clone())],
        evaluations: 0,
    };
    for i in 0..n {
        let mut point = start.point.clone();
        point[i] += extent.size;
        let corner = simplex.corner(point);
        simplex.corners.push(corner);
    }
    simplex.sort();
    while n > 0 && simplex.evaluations < extent.evaluations && simplex.spread() >= extent.tolerance
    {
        simplex.step();
        simplex.sort();
    }
    let (value, point) = simplex.corners.swap_remove(0);
    Best { value, point }
}

#[cfg(test)]
mod tests {
    use super::*;

    // (x - 1)^2 + 10 (y - x^2)^2 is least at (1, 1).
    #[test]
    fn a_curved_valley() {
        let mut f = |p: &[f64]| (p[0] - 1.0).powi(2) + 10.0 * (p[1] - p[0] * p[0]).powi(2);
        let point = vec![-1.0, 2.0];
        let start = Best {
            value: f(&point),
            point,
        };
        let extent = Extent {
            size: 0.5,
            tolerance: 1e-7,
            evaluations: 1000,
        };
        let found = minimise(&mut f, &start, extent);
        assert!((found.point[0] - 1.0).abs() < 1e-6 && (found.point[1] - 1.0).abs() < 1e-6);
        assert_eq!(found.value, f(&found.point));
    }
}
