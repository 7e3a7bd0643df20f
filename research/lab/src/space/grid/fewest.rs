//! The fewest members such that no process of a space is farther than `J*` from one of them.
//!
//! A sample of the space is covered with members of the same sample: first greedily (the process near
//! the most others, then the one near the most of the rest, ..), then by exchange: one member is
//! removed, and others are exchanged until everything is covered again or patience ends. Then random
//! processes search for holes. Those without a member join the sample, which is covered again, until
//! ten thousand new ones find no hole, even after walks away from the members.
//!
//! The smallest cover is hard to find; these covers are small. References: V. Chvatal, "A greedy
//! heuristic for the set-covering problem", Math. Oper. Res. 4 (1979); C. Gao et al., "An efficient
//! local search heuristic with row weighting for the unicost set covering problem", Eur. J. Oper. Res.
//! 246 (2015), for the weights.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::index::Index;
use super::{GridSettings, Member, draws, rays};
use crate::space::candidate::{Candidate, CandidateError};
use crate::space::surface::Direction;
use crate::workers::Workers;

/// Shapes of the sample: rows by columns.
const SHAPES: (usize, usize) = (16, 10);

/// Radii of the sample per step of their ray.
const RADII_PER_STEP: f64 = 2.0;

/// Exchanges without a smaller cover after which the search ends.
const PATIENCE: u32 = 1000;

/// Number of random processes without a hole that ends the search, and number of draws before holes
/// among them are closed.
const PROOFS: usize = 10_000;
const BATCH: usize = 2_500;

/// Number and length of walks from the farthest of them away from the members: as much work again.
const CLIMBERS: usize = 200;
const STRIDES: usize = 40;

/// First stride of a walk (natural logarithms of the times), and its factor after a failure: the last
/// stride of a walk without success is a hundredth of the first.
const FIRST_STRIDE: f64 = 0.1;
const SHORTER: f64 = 0.9;

/// Seed of these processes, which nobody chooses by chance.
const SEED: u64 = u64::MAX;

/// The sample is covered within this part of `J*`, all else within the second part.
const SHRINK: f64 = 0.95;
const PROVEN: f64 = 0.97;

/// The members, by rising `Kd`.
pub(super) fn members(
    settings: &GridSettings,
    workers: &dyn Workers,
) -> Result<Vec<Member>, CandidateError> {
    let mut sample = sample(settings, workers)?;
    let mut near = neighbours(settings, &sample, &sample, workers);
    let mut draws_before = 0;
    loop {
        let chosen = Exchange::new(&near, greedy(&near)).least();
        let chosen: Vec<Candidate> = chosen.into_iter().map(|number| sample[number]).collect();
        let missed = missed(settings, &chosen, draws_before, workers)?;
        draws_before += PROOFS;
        if missed.is_empty() {
            return Ok(in_order(&chosen));
        }
        let known = sample.len();
        let new = neighbours(settings, &sample, &missed, workers);
        for (all, new) in near.iter_mut().zip(new) {
            all.extend(new.into_iter().map(|number| known + number));
        }
        sample.extend(&missed);
        near.extend(neighbours(settings, &missed, &sample, workers));
    }
}

/// Processes all over the space, with its faces, edges and corners.
fn sample(
    settings: &GridSettings,
    workers: &dyn Workers,
) -> Result<Vec<Candidate>, CandidateError> {
    let shapes = settings.space.shapes(SHAPES.0, SHAPES.1);
    let rays = workers.map(shapes.len(), |k| ray(settings, shapes[k]));
    let rays: Vec<Vec<Candidate>> = rays.into_iter().collect::<Result<_, _>>()?;
    let corners = (0..8).map(|n| settings.candidate(draws::times_s(&settings.space, SEED, n)));
    let corners: Vec<Candidate> = corners.collect::<Result<_, _>>()?;
    Ok([rays.concat(), corners].concat())
}

/// Processes from end to end of a ray.
fn ray(settings: &GridSettings, direction: Direction) -> Result<Vec<Candidate>, CandidateError> {
    let Some((low_s, high_s)) = settings.space.radius_range_s(direction) else {
        return Ok(Vec::new());
    };
    let lowest = settings.candidate(direction.at(low_s))?;
    let step = rays::step(&lowest, settings.deterioration);
    let length = (high_s / low_s).ln();
    let count = (RADII_PER_STEP * length / step.ln()).ceil() as usize;
    (0..=count)
        .map(|k| lowest.scaled((length * k as f64 / count.max(1) as f64).exp()))
        .collect()
}

/// For each process of `sample`, the numbers of the `others` near it.
fn neighbours(
    settings: &GridSettings,
    sample: &[Candidate],
    others: &[Candidate],
    workers: &dyn Workers,
) -> Vec<Vec<usize>> {
    let index = Index::new(others);
    workers.map(sample.len(), |k| {
        index.within(&sample[k], SHRINK * settings.deterioration)
    })
}

/// Numbers of the members of a greedy cover.
fn greedy(near: &[Vec<usize>]) -> Vec<usize> {
    let mut is_left = vec![true; near.len()];
    let mut chosen = Vec::new();
    loop {
        let gains = near
            .iter()
            .map(|near| near.iter().filter(|&&point| is_left[point]).count());
        // The first of equals.
        let best = gains
            .enumerate()
            .max_by_key(|&(number, gain)| (gain, usize::MAX - number));
        match best {
            Some((number, gain)) if gain > 0 => {
                chosen.push(number);
                for &point in &near[number] {
                    is_left[point] = false;
                }
            }
            _ => return chosen,
        }
    }
}

/// A search for a smaller cover.
struct Exchange<'a> {
    near: &'a [Vec<usize>],
    members: Vec<usize>,
    /// Number of members near each point.
    owners: Vec<u32>,
    /// How often each point was uncovered: points that are hard to cover gain weight.
    weights: Vec<u64>,
}

impl<'a> Exchange<'a> {
    fn new(near: &'a [Vec<usize>], members: Vec<usize>) -> Self {
        let mut owners = vec![0; near.len()];
        for &point in members.iter().flat_map(|&member| &near[member]) {
            owners[point] += 1;
        }
        Self {
            near,
            members,
            owners,
            weights: vec![1; near.len()],
        }
    }

    /// The smallest cover found.
    fn least(mut self) -> Vec<usize> {
        let mut best = self.members.clone();
        let mut patience = PATIENCE;
        while patience > 0 {
            if self.owners.iter().all(|&owners| owners > 0) {
                best.clone_from(&self.members);
                patience = PATIENCE;
                self.remove_cheapest(None);
                continue;
            }
            patience -= 1;
            let Some(added) = self.add_dearest() else {
                break;
            };
            self.remove_cheapest(Some(added));
        }
        best
    }

    /// Removes the member, other than `kept`, whose own points have the least weight; the earliest of
    /// equals.
    fn remove_cheapest(&mut self, kept: Option<usize>) {
        let own = |member: &usize| -> u64 {
            let points = self.near[*member].iter();
            let own = points.filter(|&&point| self.owners[point] == 1);
            own.map(|&point| self.weights[point]).sum()
        };
        let candidates = self.members.iter().enumerate();
        let cheapest = candidates
            .filter(|&(_, &member)| Some(member) != kept)
            .min_by_key(|(_, member)| own(member));
        if let Some((place, _)) = cheapest {
            let member = self.members.remove(place);
            for &point in &self.near[member] {
                self.owners[point] -= 1;
            }
        }
    }

    /// Adds the candidate near the heaviest uncovered point that gains the most weight.
    fn add_dearest(&mut self) -> Option<usize> {
        let left = (0..self.near.len()).filter(|&point| self.owners[point] == 0);
        let heaviest = left.max_by_key(|&point| (self.weights[point], usize::MAX - point))?;
        let gain = |candidate: usize| -> u64 {
            let points = self.near[candidate].iter();
            let gained = points.filter(|&&point| self.owners[point] == 0);
            gained.map(|&point| self.weights[point]).sum()
        };
        // Nearness is symmetric.
        let candidates = self.near[heaviest].iter().copied();
        let added =
            candidates.max_by_key(|&candidate| (gain(candidate), usize::MAX - candidate))?;
        self.members.push(added);
        for &point in &self.near[added] {
            self.owners[point] += 1;
        }
        for (weight, &owners) in self.weights.iter_mut().zip(&self.owners) {
            *weight += u64::from(owners == 0);
        }
        Some(added)
    }
}

/// Processes that are farther than `PROVEN` from every member: from the first batch of random ones that
/// has some or, if none has, from walks that start at the farthest of all.
fn missed(
    settings: &GridSettings,
    chosen: &[Candidate],
    draws_before: usize,
    workers: &dyn Workers,
) -> Result<Vec<Candidate>, CandidateError> {
    let index = Index::new(chosen);
    let limit = PROVEN * settings.deterioration;
    let beyond = |found: &[Far]| -> Vec<Candidate> {
        let beyond = found.iter().filter(|far| far.distance > limit);
        beyond.map(|far| far.candidate).collect()
    };
    let mut drawn: Vec<Far> = Vec::with_capacity(PROOFS);
    while drawn.len() < PROOFS {
        let first = draws_before + drawn.len();
        let batch = workers.map(BATCH, |n| {
            let n = (first + n) as u64;
            Far::at(settings, &index, draws::times_s(&settings.space, SEED, n))
        });
        let batch: Vec<Far> = batch.into_iter().collect::<Result<_, _>>()?;
        let missed = beyond(&batch);
        if !missed.is_empty() {
            return Ok(missed);
        }
        drawn.extend(batch);
    }
    drawn.sort_by(|a, b| b.distance.total_cmp(&a.distance));
    let climbed = workers.map(CLIMBERS, |n| {
        let mut rng = Pcg64Mcg::seed_from_u64((draws_before + n) as u64);
        climb(settings, &index, drawn[n], &mut rng)
    });
    let climbed: Vec<Far> = climbed.into_iter().collect::<Result<_, _>>()?;
    Ok(beyond(&climbed))
}

/// A process and the distance of its nearest member.
#[derive(Clone, Copy, Debug)]
struct Far {
    candidate: Candidate,
    times_s: [f64; 3],
    distance: f64,
}

impl Far {
    fn at(
        settings: &GridSettings,
        index: &Index<'_>,
        times_s: [f64; 3],
    ) -> Result<Self, CandidateError> {
        let candidate = settings.candidate(times_s)?;
        let nearest = index.nearest(&candidate);
        Ok(Self {
            candidate,
            times_s,
            distance: nearest.map_or(f64::INFINITY, |(_, distance)| distance),
        })
    }
}

/// A random walk in the space that keeps steps away from the members.
fn climb(
    settings: &GridSettings,
    index: &Index<'_>,
    from: Far,
    rng: &mut Pcg64Mcg,
) -> Result<Far, CandidateError> {
    let mut top = from;
    let mut stride = FIRST_STRIDE;
    for _ in 0..STRIDES {
        let mut times_s = top.times_s;
        for (time_s, (low, high)) in times_s.iter_mut().zip(settings.space.ranges_s()) {
            *time_s *= (stride * rng.random_range(-1.0..1.0_f64)).exp();
            *time_s = time_s.clamp(low, high);
        }
        let there = Far::at(settings, index, times_s)?;
        if there.distance > top.distance {
            top = there;
        } else {
            stride *= SHORTER;
        }
    }
    Ok(top)
}

fn in_order(chosen: &[Candidate]) -> Vec<Member> {
    let mut members: Vec<Member> = chosen.iter().copied().map(Member::alone).collect();
    members.sort_by(|a, b| {
        let kd = |member: &Member| member.candidate.optimum.pd.kd;
        kd(a).total_cmp(&kd(b))
    });
    members
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_a_line(count: usize) -> Vec<Vec<usize>> {
        let near = |k: usize| k.saturating_sub(1)..(k + 2).min(count);
        (0..count).map(|k| near(k).collect()).collect()
    }

    // Processes in a line, each near its neighbours. Of six, greedy takes number 1 (the first of those
    // near the most), then 4, which is near 3 and 5. Two is the least for six, because each is near
    // three. From four members of seven, the exchange leaves ceil(7/3) = 3.
    #[test]
    fn covers_by_hand() {
        let six = in_a_line(6);
        assert_eq!(greedy(&six), [1, 4]);
        assert_eq!(Exchange::new(&six, vec![0, 2, 3, 5]).least().len(), 2);
        let seven = in_a_line(7);
        let least = Exchange::new(&seven, vec![0, 2, 4, 6]).least();
        assert_eq!(least.len(), 3);
        assert!((0..7).all(|point| least.iter().any(|member| seven[*member].contains(&point))));
    }
}
