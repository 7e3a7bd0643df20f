//! `campaign` on processes out of the family: one row for each kind.

use crate::common::{Scratch, UNREADABLE, run};

const CAMPAIGN: &str =
    "measure = \"unknown\"\ncases = 1\nseed = 1\nbias = 0.5\nsigma = 0.01\ntrim = true\n";

// One case of each kind and five of the family, which are all steady, known, not refused and not harmful. Three lines of
// text, the head, and 14 rows. The clipped case is unknown, and refused for any number of cycles.
#[test]
fn a_row_for_each_kind() {
    let folder = Scratch::new();
    let path = folder.write("unknown.toml", CAMPAIGN.as_bytes());
    let table = run(&["campaign", &path]);
    assert_eq!(table.code, Some(0), "{table:?}");
    let lines: Vec<&str> = table.stdout.lines().collect();
    assert_eq!(lines.len(), 18, "{}", table.stdout);
    let row = |name: &str| -> Vec<usize> {
        let line = lines.iter().find(|line| line.starts_with(name)).unwrap();
        let words = line.split_whitespace().skip(1);
        words.map(|word| word.parse().unwrap()).collect()
    };
    let mut in_family = vec![0; 15];
    (in_family[0], in_family[4]) = (5, 5);
    assert_eq!(row("in_family"), in_family);
    let clipping = row("clipping");
    assert_eq!(clipping[..2], [1, 0]);
    let [harmful, unknown, harmless, also_unknown] = clipping[2..6] else {
        panic!("{clipping:?}");
    };
    assert_eq!((harmful + harmless, unknown + also_unknown), (1, 1));
    // One, two and eight cycles: refused, harmful, silent.
    assert_eq!(clipping[6..], [1, 0, 0, 1, 0, 0, 1, 0, 0]);
    assert_eq!(run(&["campaign", &path]).stdout, table.stdout);
}

#[test]
fn impossible_experiments_are_refused() {
    let folder = Scratch::new();
    let text = CAMPAIGN.replace("bias = 0.5", "bias = 0.95");
    let path = folder.write("unknown.toml", text.as_bytes());
    run(&["campaign", &path]).refused(UNREADABLE, &["bias", "0 to 0.9"]);
}
