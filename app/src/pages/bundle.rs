//! plotly.js as pages hold it: of some fifty kinds of traces only those that pages draw are set up.
//!
//! Setting up all of them takes a browser more than a second on a small machine, most of it for maps and volumes that
//! no page has: 2.2 s until a page was open, 0.8 s with these alone.

use plotly::Plot;

/// Where the bundle of plotly.js 3.0.1 has the kinds beside curves that pages draw: bar, heatmap, contour.
const KINDS: [usize; 3] = [0, 2, 6];

/// The element that holds plotly.js; what the crate adds for formulas is left out.
pub(super) fn script() -> String {
    const END: &str = "</script>";
    let mut sources = Plot::offline_js_sources();
    let end = sources.find(END).map_or(sources.len(), |at| at + END.len());
    sources.truncate(end);
    with_kinds_alone(sources)
}

/// The call that sets up all kinds, at the end of the bundle.
const BEGIN: &str = ".register([";

/// The same without the other kinds; as it is where its end is another one.
fn with_kinds_alone(bundle: String) -> String {
    let Some((before, rest)) = bundle.rsplit_once(BEGIN) else {
        return bundle;
    };
    let Some((all, after)) = rest.split_once("])") else {
        return bundle;
    };
    let all: Vec<&str> = all.split(',').collect();
    let wanted = KINDS.iter().filter_map(|&place| all.get(place).copied());
    let wanted: Vec<&str> = wanted.collect();
    format!("{before}{BEGIN}{}]){after}", wanted.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The module of a name, up to the next one.
    fn module<'a>(bundle: &'a str, name: &str) -> &'a str {
        let (_, behind) = bundle.split_once(&format!("{name}=ye((")).unwrap();
        behind.split("=ye((").next().unwrap()
    }

    // Each of the three is a module that exports another one's whole, and that one says its name.
    #[test]
    fn the_places_are_those_of_the_kinds() {
        let bundle = Plot::offline_js_sources();
        let trimmed = script();
        let list = |text: &str| -> Vec<String> {
            let calls = text
                .rsplit_once(BEGIN)
                .unwrap()
                .1
                .split_once("])")
                .unwrap()
                .0;
            calls
                .split(',')
                .map(|call| call.replace("()", ""))
                .collect()
        };
        let (_, plotly) = bundle.split_once("<script").unwrap();
        let (plotly, _) = plotly.split_once("</script>").unwrap();
        assert!(list(plotly).len() > 40);
        let kept = list(&trimmed);
        for (name, kind) in kept.iter().zip(["bar", "heatmap", "contour"]) {
            let (_, exported) = module(plotly, name).split_once("exports=").unwrap();
            let (whole, _) = exported.split_once("()").unwrap();
            let text = module(plotly, whole);
            assert!(text.contains(&format!("name:\"{kind}\"")), "{kind}: {text}");
        }
        assert_eq!(kept.len(), 3);
        assert!(trimmed.ends_with("</script>"));
    }

    #[test]
    fn another_bundle_is_left_alone() {
        let other = "<script>nothing to set up</script>".to_owned();
        assert_eq!(with_kinds_alone(other.clone()), other);
    }
}
