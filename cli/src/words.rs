//! Sentences of the program: what the facts of the libraries mean, and what to do about them.

pub(crate) mod answer;
mod caution;
pub(crate) mod controllers;
pub(crate) mod flight;
pub(crate) mod limits;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod log_gains;
pub(crate) mod oscillation;
pub(crate) mod recording;
pub(crate) mod remark;
pub(crate) mod verdict;

/// With a capital letter at the start and a full stop at the end.
pub(crate) fn sentence(clause: &str) -> String {
    capital(clause.trim_end_matches('.')) + "."
}

/// With a capital letter at the start.
pub(crate) fn capital(clause: &str) -> String {
    let mut letters = clause.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// `a`, `a and b`, `a, b and c`.
fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_with_and() {
        assert_eq!(listed(&["a"]), "a");
        assert_eq!(listed(&["a", "b", "c"]), "a, b and c");
    }
}
