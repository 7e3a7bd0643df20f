//! Output on a terminal: colours.

use crate::colours::{coloured, only_colours_differ};

#[test]
fn colours_change_nothing_but_the_colours() {
    for command in [
        &["certify", "--process", "0.3,2,0.1", "--bias", "0,90%"][..],
        &["grid", "--deterioration", "50%", "--check", "20"],
        &["pack", "verify", "default"],
        &["pack", "show", "default"],
    ] {
        only_colours_differ(command);
    }
    let [text, _] = coloured(&["pack", "verify", "default"], Some("CLICOLOR_FORCE"));
    assert!(text.contains("\x1b[32m"), "{text}");
}
