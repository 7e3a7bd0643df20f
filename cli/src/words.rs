//! Sentences of the program: what the facts of the libraries mean, and what to do about them.

pub(crate) mod recording;
pub(crate) mod remark;
pub(crate) mod verdict;

/// With a capital letter at the start and a full stop at the end.
pub(crate) fn sentence(clause: &str) -> String {
    let mut letters = clause.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first
        .into_iter()
        .chain(letters)
        .chain(std::iter::once('.'))
        .collect()
}
