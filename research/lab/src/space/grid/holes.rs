//! Members that close the holes between rays.
//!
//! If a space is thin (a known dead time, a single actuator), a ray has one radius, and processes
//! between rays may be far from all members. Random processes search for such holes, and the farthest
//! of them becomes a member, until none is left. Such members are more than `J*` from all others, as
//! all members are.

use super::index::Index;
use super::{GridSettings, Member, draws};
use crate::space::candidate::{Candidate, CandidateError};
use crate::workers::Workers;

/// Number of random processes in a search, and their seed, which nobody chooses by chance.
const SEARCHERS: usize = 4000;
const SEED: u64 = u64::MAX;

/// Adds to `members` until no search finds a hole.
pub(super) fn close(
    settings: &GridSettings,
    members: &mut Vec<Member>,
    workers: &dyn Workers,
) -> Result<(), CandidateError> {
    let mut searched = 0;
    loop {
        let mut holes = search(settings, members, searched, workers)?;
        searched += SEARCHERS;
        if holes.is_empty() {
            return Ok(());
        }
        while let Some(farthest) = farthest(&holes) {
            let (candidate, _) = holes.swap_remove(farthest);
            holes.retain_mut(|(hole, distance)| {
                *distance = distance.min(hole.distance(&candidate));
                *distance > settings.deterioration
            });
            members.push(Member::alone(candidate));
        }
    }
}

/// The processes of the next search that are farther than `J*` from every member, with their distances.
fn search(
    settings: &GridSettings,
    members: &[Member],
    searched: usize,
    workers: &dyn Workers,
) -> Result<Vec<(Candidate, f64)>, CandidateError> {
    let index = Index::new(members.iter().map(|member| &member.candidate));
    let found = workers.map(SEARCHERS, |n| {
        let times_s = draws::times_s(&settings.space, SEED, (searched + n) as u64);
        let candidate = settings.candidate(times_s)?;
        let nearest = index.nearest(&candidate);
        let distance = nearest.map_or(f64::INFINITY, |(_, distance)| distance);
        Ok((candidate, distance))
    });
    let found: Result<Vec<(Candidate, f64)>, CandidateError> = found.into_iter().collect();
    let mut holes = found?;
    holes.retain(|(_, distance)| *distance > settings.deterioration);
    Ok(holes)
}

fn farthest(holes: &[(Candidate, f64)]) -> Option<usize> {
    let distances = holes.iter().map(|(_, distance)| distance).enumerate();
    let (place, _) = distances.max_by(|a, b| a.1.total_cmp(b.1))?;
    Some(place)
}
