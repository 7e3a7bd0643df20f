//! plotly.js without the modules that the pages do not use.
//!
//! The crate has all of plotly.js 3.0.1: 4.7 MB, most of it for maps and 3-D plots, which take a browser on a small machine
//! two seconds to load. The bundle is a list of modules; each is a function that other modules call when they need it:
//!
//! ```text
//! (function(){ ... ;var A=ye((x,y)=>{ ... B() ... });var B=ye(x=>{ ... });var Z=ye(( ... .register([A(),B(), ...]) ... })();
//! ```
//!
//! The last module registers every kind of trace. With only the kinds that the pages draw in that list, the modules that
//! can be reached are 1 MB, and a page opens four times faster.

use std::collections::{BTreeSet, HashMap};

/// Positions in the list of the kinds that pages draw besides curves: bar, heatmap, contour.
const KINDS: [usize; 3] = [0, 2, 6];

/// The call that registers the kinds of traces, and its end.
const LIST: (&str, &str) = (".register([", "])");

/// The needed part of a bundle; the whole bundle if it is built differently.
pub(crate) fn needed(bundle: &str) -> String {
    let Some((before, rest)) = bundle.rsplit_once(LIST.0) else {
        return bundle.to_owned();
    };
    let Some((all, after)) = rest.split_once(LIST.1) else {
        return bundle.to_owned();
    };
    let all: Vec<&str> = all.split(',').collect();
    let wanted = KINDS.iter().filter_map(|&place| all.get(place).copied());
    let wanted: Vec<&str> = wanted.collect();
    reached(&[before, LIST.0, &wanted.join(","), LIST.1, after].concat())
}

/// Text between the end of a module and the name of the next one.
const BETWEEN: &str = ";var ";
/// Text between the name of a module and its function.
const IS_MODULE: &str = "=ye(";

/// The text before the first module and after the last, and the modules that are called from there.
fn reached(bundle: &str) -> String {
    let pieces = pieces(bundle);
    let names = pieces.iter().map(|piece| name(piece));
    let places: HashMap<&str, usize> = (names.enumerate())
        .filter_map(|(place, name)| Some((name?, place)))
        .collect();
    let mut kept = BTreeSet::new();
    let mut waiting = vec![0, pieces.len() - 1];
    while let Some(place) = waiting.pop() {
        if kept.insert(place) {
            let called = calls(pieces[place]).filter_map(|name| places.get(name));
            waiting.extend(called.filter(|place| !kept.contains(place)));
        }
    }
    let kept: Vec<&str> = kept.into_iter().map(|place| pieces[place]).collect();
    kept.join(BETWEEN)
}

/// The bundle, split before the name of each module.
fn pieces(bundle: &str) -> Vec<&str> {
    let mut pieces = vec![];
    let mut start = 0;
    for (at, _) in bundle.match_indices(BETWEEN) {
        let next = at + BETWEEN.len();
        if bundle[..at].ends_with("})") && name(&bundle[next..]).is_some() {
            pieces.push(&bundle[start..at]);
            start = next;
        }
    }
    pieces.push(&bundle[start..]);
    pieces
}

fn is_of_name(character: char) -> bool {
    character.is_ascii_alphanumeric() || matches!(character, '_' | '$')
}

/// The name of the module at the start of this text.
fn name(piece: &str) -> Option<&str> {
    let end = piece.find(|character| !is_of_name(character))?;
    piece[end..].starts_with(IS_MODULE).then(|| &piece[..end])
}

/// Every name that is called without arguments.
fn calls(piece: &str) -> impl Iterator<Item = &str> {
    piece.match_indices("()").map(|(at, _)| {
        let start = piece[..at].rfind(|character| !is_of_name(character));
        &piece[start.map_or(0, |before| before + 1)..at]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // As build.rs has written them.
    fn script() -> &'static str {
        include_str!(concat!(env!("OUT_DIR"), "/plotly.js"))
    }

    // Each kind in the list is a module that exports another one, which contains its name.
    #[test]
    fn the_places_are_those_of_the_kinds() {
        let script = script();
        let pieces = pieces(script);
        let module = |wanted: &str| -> &str {
            let mut all = pieces.iter().copied();
            all.find(|piece| name(piece) == Some(wanted)).unwrap()
        };
        let (_, list) = script.rsplit_once(LIST.0).unwrap();
        let (list, _) = list.split_once(LIST.1).unwrap();
        let kept: Vec<&str> = list
            .split(',')
            .map(|call| call.trim_end_matches("()"))
            .collect();
        assert_eq!(kept.len(), 3);
        for (kept, kind) in kept.into_iter().zip(["bar", "heatmap", "contour"]) {
            let (_, exported) = module(kept).split_once("exports=").unwrap();
            let whole = module(exported.split_once("()").unwrap().0);
            assert!(
                whole.contains(&format!("name:\"{kind}\"")),
                "{kind}: {whole}"
            );
        }
    }

    // Every module that is called is there, so are the licences, and three quarters of the bundle are gone.
    #[test]
    fn what_is_left_is_closed() {
        let bundle = include_str!(concat!(env!("OUT_DIR"), "/plotly.whole.js"));
        let whole = pieces(bundle);
        let script = script();
        assert_eq!(script, needed(bundle));
        let left = pieces(script);
        assert!(
            whole.len() > 1000 && left.len() < 500,
            "{} {}",
            whole.len(),
            left.len()
        );
        let all: BTreeSet<&str> = whole.iter().filter_map(|piece| name(piece)).collect();
        let there: BTreeSet<&str> = left.iter().filter_map(|piece| name(piece)).collect();
        for piece in &left {
            let missing =
                calls(piece).find(|called| all.contains(called) && !there.contains(called));
            assert_eq!(missing, None);
        }
        assert!(script.contains("plotly.js v3.0.1") && script.contains("MIT"));
        assert!(script.len() < 1_200_000, "{}", script.len());
    }

    // Three modules of which the first needs the last; and a text that is no bundle.
    #[test]
    fn by_hand() {
        let bundle = "(()=>{var ye=0;f({});var A=ye((x,y)=>{C()});var B=ye(x=>{A()});var C=ye(()=>{});var Z=ye((x)=>{\
                      p.register([A(),B(),C(),B()])});return Z()})();";
        let left = needed(bundle);
        assert!(
            left.contains(".register([A(),C()])") && left.ends_with("return Z()})();"),
            "{left}"
        );
        assert!(left.contains("A=ye(") && left.contains("C=ye(") && !left.contains("B=ye("));
        let other = "nothing to set up";
        assert_eq!(needed(other), other);
    }
}
