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

/// Local minimum of `f` from `start`, whose value is known.
pub(crate) fn minimise(f: &mut impl FnMut(&[f64]) -> f64, start: &Best, extent: Extent) -> Best {
    let n = start.point.len();
    if n == 0 {
        return start.clone();
    }
    let mut evaluations = 0;
    let mut of = |point: Vec<f64>| {
        evaluations += 1;
        (f(&point), point, evaluations)
    };
    let mut corners = vec![(start.value, start.point.clone())];
    for i in 0..n {
        let mut point = start.point.clone();
        point[i] += extent.size;
        let (value, point, _) = of(point);
        corners.push((value, point));
    }
    let mut count = n;
    while count < extent.evaluations {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let spread = (corners[1..].iter().flat_map(|corner| &corner.1))
            .zip(corners[0].1.iter().cycle())
            .fold(0.0, |spread: f64, (a, b)| spread.max((a - b).abs()));
        if spread < extent.tolerance {
            break;
        }
        let centre: Vec<f64> = (0..n)
            .map(|i| corners[..n].iter().map(|corner| corner.1[i]).sum::<f64>() / n as f64)
            .collect();
        let along = |factor: f64, worst: &[f64]| -> Vec<f64> {
            centre
                .iter()
                .zip(worst)
                .map(|(c, w)| c + factor * (c - w))
                .collect()
        };
        let (reflected, point, _) = of(along(1.0, &corners[n].1));
        if reflected < corners[0].0 {
            let (expanded, further, used) = of(along(2.0, &corners[n].1));
            corners[n] = if expanded < reflected {
                (expanded, further)
            } else {
                (reflected, point)
            };
            count = used;
            continue;
        }
        if reflected < corners[n - 1].0 {
            corners[n] = (reflected, point);
            count += 1;
            continue;
        }
        let factor = if reflected < corners[n].0 { 0.5 } else { -0.5 };
        let (contracted, inner, used) = of(along(factor, &corners[n].1));
        count = used;
        if contracted < reflected.min(corners[n].0) {
            corners[n] = (contracted, inner);
            continue;
        }
        let best = corners[0].1.clone();
        for corner in &mut corners[1..] {
            let point = corner
                .1
                .iter()
                .zip(&best)
                .map(|(a, b)| b + 0.5 * (a - b))
                .collect();
            let (value, point, used) = of(point);
            *corner = (value, point);
            count = used;
        }
    }
    corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (value, point) = corners.swap_remove(0);
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
