//! Parses a cell as a number.
//!
//! A decimal is `m * 10^e` with whole `m`. When `m <= 2^53` and `|e| <= 22`, both `m` and
//! `10^|e|` are exact doubles, so one multiplication or division rounds correctly (Clinger 1990,
//! "How to read floating point numbers accurately"). Everything else goes to the standard parser.

use super::names;

/// Content of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell {
    /// A finite number and its decimal mark.
    Number(f64, Mark),
    /// An empty cell, a word that logs write for a missing number, or an infinity.
    Missing,
    /// What historians and control systems write in place of a sample that is no good.
    Bad,
    /// Anything else.
    Text,
}

/// Decimal mark of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mark {
    None,
    Point,
    Comma,
    /// No digits, but a word of a two-valued signal.
    Word,
}

/// What logs write for a missing number, in lower case.
const MISSING: [&str; 25] = [
    "",
    "nan",
    "+nan",
    "-nan",
    "nan(ind)",
    "-nan(ind)",
    "na",
    "n/a",
    "#n/a",
    "null",
    "none",
    "nil",
    "inf",
    "+inf",
    "-inf",
    "infinity",
    "-infinity",
    "--",
    "---",
    "----",
    "***",
    "****",
    // What a channel of an oscilloscope beyond its range has.
    "\u{221e}",
    "+\u{221e}",
    "-\u{221e}",
];

/// Words of two-valued signals, in lower case, and their numbers.
const SWITCHES: [(&str, f64); 6] = [
    ("on", 1.0),
    ("off", 0.0),
    ("true", 1.0),
    ("false", 0.0),
    ("ein", 1.0),
    ("aus", 0.0),
];

/// How the words begin that historians and control systems write for a sample that is no good, in lower case: digital
/// states of the PI system, status of OPC, errors of Excel. An interpolated sample was not measured.
const BAD: [&str; 35] = [
    "bad",
    "no data",
    "nodata",
    "no good data",
    "no result",
    "no sample",
    "no value",
    "i/o timeout",
    "io timeout",
    "timeout",
    "comm fail",
    "comm error",
    "not connect",
    "disconnect",
    "scan off",
    "scan timeout",
    "scan time-out",
    "shutdown",
    "intf shut",
    "pt created",
    "configure",
    "over range",
    "overrange",
    "under range",
    "underrange",
    "calc failed",
    "error",
    "failed",
    "invalid",
    "stale",
    "offline",
    "unavailable",
    "unknown",
    "interpolated",
    "[-",
];
/// Errors of Excel.
const ERRORS: [&str; 5] = ["#value!", "#ref!", "#div/0!", "#name?", "#num!"];

/// Longest number accepted, in bytes; no logger writes a longer one.
const LONGEST: usize = 128;

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Parses a cell after removing blanks and quotes around it.
pub(super) fn parse(cell: &[u8]) -> Cell {
    let cell = bare(cell);
    let Some(decimal) = Decimal::scan(cell) else {
        return match ascii(cell).or_else(|| ungrouped(cell, None)) {
            Some(plain) => parse(&plain),
            None if is_missing(cell) => Cell::Missing,
            None if is_bad(cell) => Cell::Bad,
            None => switch(cell).map_or(Cell::Text, |value| Cell::Number(value, Mark::Word)),
        };
    };
    match decimal.fast_value().or_else(|| slow_value(cell)) {
        Some(value) if value.is_finite() => Cell::Number(value, decimal.mark),
        Some(_) => Cell::Missing,
        None => Cell::Text,
    }
}

/// A cell without the hard blanks around it, and with a hyphen for a minus sign; `None` if it has neither.
fn ascii(cell: &[u8]) -> Option<Vec<u8>> {
    if cell.is_ascii() {
        return None;
    }
    let text = std::str::from_utf8(cell).ok()?;
    let plain = text.trim();
    let plain = match plain.strip_prefix('\u{2212}') {
        Some(size) => format!("-{size}"),
        None => plain.to_owned(),
    };
    (plain != text).then(|| plain.into_bytes())
}

/// The number of a two-valued signal: 1 of `on` and `true`, 0 of `off` and `false`.
fn switch(cell: &[u8]) -> Option<f64> {
    let mut words = SWITCHES.iter();
    let found = words.find(|(word, _)| cell.eq_ignore_ascii_case(word.as_bytes()));
    found.map(|(_, value)| *value)
}

/// A number with its unit behind it, as dashboards export them: `79.9 \u{b0}C`, `45%`. The unit must be a known one.
pub(super) fn with_unit(cell: &[u8]) -> Option<(&[u8], &str)> {
    let cell = bare(cell);
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || b"+-.,eE".contains(byte);
    // The `e` of an exponent is followed by digits; no known unit begins with e.
    let length = cell.iter().take_while(|byte| is_of_number(byte)).count();
    let (number, unit) = cell.split_at_checked(length)?;
    let unit = std::str::from_utf8(unit).ok()?.trim();
    let is_number = matches!(parse(number), Cell::Number(..)) && number.len() <= LONGEST;
    let is_unit = names::is_known_unit(unit) && unit != "1";
    (is_number && is_unit).then_some((number, unit))
}

/// Parses an integer exactly; `None` if the cell is anything else or does not fit.
pub(super) fn parse_whole(cell: &[u8]) -> Option<i64> {
    let cell = bare(cell);
    let (negative, digits) = signed(cell);
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let size = digits.iter().try_fold(0_i64, |sum, digit| {
        sum.checked_mul(10)?.checked_add(i64::from(digit - b'0'))
    })?;
    Some(if negative { -size } else { size })
}

/// Whether a cell looks like a date or a time of day.
pub(super) fn is_clock_time(cell: &[u8]) -> bool {
    let cell = bare(cell);
    let digits = cell.iter().filter(|byte| byte.is_ascii_digit()).count();
    let mut marks = cell
        .iter()
        .filter(|&byte| matches!(byte, b':' | b'-' | b'/'));
    let dots = cell.iter().filter(|&byte| *byte == b'.').count();
    digits >= 3
        && cell.first().is_some_and(u8::is_ascii_digit)
        && (marks.next().is_some() || dots >= 2)
        && cell
            .iter()
            .all(|byte| byte.is_ascii_digit() || b":-/.,TZ+ APMapm".contains(byte))
}

/// The cell without the blanks and quotes around it.
pub(super) fn bare(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    match cell {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => cell,
    }
}

/// Whether a cell says that a sample is no good.
pub(super) fn is_bad(cell: &[u8]) -> bool {
    let cell = bare(cell);
    let begins = |word: &&str| {
        let start = cell.get(..word.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(word.as_bytes()))
    };
    BAD.iter().chain(&ERRORS).any(begins)
}

/// The separator of thousands of a cell that proves one: by both marks, as in `1,234.5`, by two groups, or by an
/// apostrophe or a blank.
pub(super) fn thousands(cell: &[u8]) -> Option<char> {
    let cell = bare(cell);
    if cell.len() > LONGEST || Decimal::scan(cell).is_some() {
        return None;
    }
    let text = std::str::from_utf8(cell).ok()?;
    let (mark, groups) = grouped(text)?;
    let is_proved = groups > 1 || !matches!(mark, '.' | ',') || text.contains(other(mark));
    is_proved.then_some(mark)
}

/// A number without its separators of thousands; `known` is the separator that another cell proved.
pub(super) fn ungrouped(cell: &[u8], known: Option<char>) -> Option<Vec<u8>> {
    let mark = thousands(cell).or(known)?;
    let text = std::str::from_utf8(bare(cell)).ok()?;
    let (found, _) = grouped(text)?;
    (found == mark).then(|| text.replace(mark, "").into_bytes())
}

/// The separator of the groups of three digits before the decimal mark, and how many there are.
fn grouped(text: &str) -> Option<(char, usize)> {
    let unsigned = text.trim_start_matches(['+', '-']);
    let mark = unsigned.chars().find(|c| !c.is_ascii_digit())?;
    if !matches!(
        mark,
        ',' | '.' | '\'' | ' ' | '\u{a0}' | '\u{202f}' | '\u{2019}'
    ) {
        return None;
    }
    // `.` after `,` and the reverse; after other separators either.
    let decimals = match mark {
        ',' => &['.'][..],
        '.' => &[','],
        _ => &['.', ','],
    };
    let whole = unsigned.split(decimals).next()?;
    let mut groups = whole.split(mark);
    let first = groups.next()?;
    let mut count = 0;
    for group in groups {
        if group.len() != 3 || !group.bytes().all(|byte| byte.is_ascii_digit()) {
            return None;
        }
        count += 1;
    }
    let is_first = (1..=3).contains(&first.len()) && !first.starts_with('0');
    let fraction = unsigned.get(whole.len()..)?.get(1..).unwrap_or("");
    let is_fraction = fraction.bytes().all(|byte| byte.is_ascii_digit());
    (is_first && is_fraction && count > 0).then_some((mark, count))
}

/// The decimal mark beside a separator of thousands.
fn other(mark: char) -> char {
    if mark == ',' { '.' } else { ',' }
}

fn is_missing(cell: &[u8]) -> bool {
    MISSING
        .iter()
        .any(|word| cell.eq_ignore_ascii_case(word.as_bytes()))
        || cell.starts_with(b"1.#")
        || cell.starts_with(b"-1.#")
}

fn signed(cell: &[u8]) -> (bool, &[u8]) {
    match cell {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, cell),
    }
}

/// Parts of a decimal number.
struct Decimal {
    negative: bool,
    /// All digits as one integer, while they fit.
    digits: u64,
    /// Whether all digits fit.
    fits: bool,
    /// Power of ten.
    exponent: i32,
    mark: Mark,
}

impl Decimal {
    /// Splits a number such as `+12,5e-3` into its parts; `None` if it is not a decimal number.
    fn scan(cell: &[u8]) -> Option<Self> {
        if cell.len() > LONGEST {
            return None;
        }
        let (negative, mut rest) = signed(cell);
        let mut number = Self {
            negative,
            digits: 0,
            fits: true,
            exponent: 0,
            mark: Mark::None,
        };
        let mut any = false;
        while let [byte, after @ ..] = rest {
            match byte {
                b'0'..=b'9' => {
                    any = true;
                    number.fits &= number.digits < 1_000_000_000_000_000_000;
                    if number.fits {
                        number.digits = 10 * number.digits + u64::from(byte - b'0');
                    }
                    number.exponent -= i32::from(number.mark != Mark::None);
                }
                b'.' if number.mark == Mark::None => number.mark = Mark::Point,
                b',' if number.mark == Mark::None => number.mark = Mark::Comma,
                b'e' | b'E' | b'd' | b'D' if any => {
                    number.exponent = number.exponent.saturating_add(power(after)?);
                    rest = &[];
                    continue;
                }
                _ => return None,
            }
            rest = after;
        }
        any.then_some(number)
    }

    fn fast_value(&self) -> Option<f64> {
        let power = POWERS.get(usize::try_from(self.exponent.unsigned_abs()).ok()?)?;
        if !self.fits || self.digits > 1 << 53 {
            return None;
        }
        let digits = self.digits as f64;
        let size = if self.exponent < 0 {
            digits / power
        } else {
            digits * power
        };
        Some(if self.negative { -size } else { size })
    }
}

/// The exponent after the `e` of a number.
fn power(cell: &[u8]) -> Option<i32> {
    let (negative, digits) = signed(cell);
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let size = digits.iter().fold(0_i32, |sum, digit| {
        sum.saturating_mul(10)
            .saturating_add(i32::from(digit - b'0'))
    });
    Some(if negative { -size } else { size })
}

/// Parses with the standard parser, after replacing `,` by `.` and `d` by `e`.
fn slow_value(cell: &[u8]) -> Option<f64> {
    let mut plain = [0; LONGEST];
    let plain = plain.get_mut(..cell.len())?;
    for (to, &from) in plain.iter_mut().zip(cell) {
        *to = match from {
            b',' => b'.',
            b'd' | b'D' => b'e',
            _ => from,
        };
    }
    std::str::from_utf8(plain).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(cell: &str) -> f64 {
        match parse(cell.as_bytes()) {
            Cell::Number(value, _) => value,
            other => panic!("{cell}: {other:?}"),
        }
    }

    #[test]
    fn thousands_that_a_cell_proves() {
        for (cell, value) in [
            ("1,234.5", 1234.5),
            ("1.234,5", 1234.5),
            ("-12.345.678", -12_345_678.0),
            ("1'234.5", 1234.5),
            ("1\u{a0}234,5", 1234.5),
            ("12 345", 12_345.0),
        ] {
            assert_eq!(number(cell), value, "{cell}");
        }
        // One group may be a decimal; another cell can prove that it is none.
        assert_eq!(number("1,234"), 1.234);
        assert_eq!(ungrouped(b"1,234", Some(',')), Some(b"1234".to_vec()));
        for cell in [
            "1,23.4",
            "0,123.4",
            "1,234.5.6",
            "1234,567.8",
            "1,2345.6",
            ",123.4",
            "1,,234",
        ] {
            assert_eq!(parse(cell.as_bytes()), Cell::Text, "{cell}");
        }
    }

    #[test]
    fn samples_that_are_no_good() {
        for cell in [
            "Bad",
            "No Data",
            "I/O Timeout",
            "Bad Input",
            "#DIV/0!",
            "[-11059] No Good Data",
            "Interpolated",
        ] {
            assert_eq!(parse(cell.as_bytes()), Cell::Bad, "{cell}");
        }
        for cell in ["Good", "running", "abc"] {
            assert_eq!(parse(cell.as_bytes()), Cell::Text, "{cell}");
        }
    }

    #[test]
    fn reads_the_usual_forms() {
        assert_eq!(number(" 1.5 "), 1.5);
        assert_eq!(number("+1.5"), 1.5);
        assert_eq!(number("-.5"), -0.5);
        assert_eq!(number("5."), 5.0);
        assert_eq!(number("1,5"), 1.5);
        assert_eq!(number("1.5e-3"), 0.0015);
        assert_eq!(number("1.5D+03"), 1500.0);
        assert_eq!(number("\"2.5\""), 2.5);
        assert_eq!(number("-3.85696249e-14"), -3.85696249e-14);
        assert_eq!(number("0.1000000000000000055511151231257827"), 0.1);
        assert_eq!(number("1e-400"), 0.0);
        assert_eq!(number("-0").to_bits(), (-0.0_f64).to_bits());
        assert_eq!(parse(b"1,5"), Cell::Number(1.5, Mark::Comma));
        assert_eq!(parse(b"15"), Cell::Number(15.0, Mark::None));
    }

    #[test]
    fn missing_numbers_and_text() {
        for missing in [
            "", "  ", "nan", "NaN", "NA", "null", "-inf", "1e999", "-1.#IND",
        ] {
            assert_eq!(parse(missing.as_bytes()), Cell::Missing, "{missing}");
        }
        let texts = [
            "1,234.5.6",
            "1.2.3",
            "e5",
            ".",
            "-",
            "1e",
            "0x10",
            "1 2",
            "abc",
            "--1",
            "1e5.0",
        ];
        for text in texts {
            assert_eq!(parse(text.as_bytes()), Cell::Text, "{text}");
        }
        assert_eq!(parse(&[b'1'; 200]), Cell::Text);
    }

    #[test]
    fn whole_numbers_are_exact() {
        assert_eq!(
            parse_whole(b"1700000000123456789"),
            Some(1_700_000_000_123_456_789)
        );
        assert_eq!(parse_whole(b"9999999999999999999"), None);
        assert_eq!(parse_whole(b" -12 "), Some(-12));
        assert_eq!(parse_whole(b"12.0"), None);
        assert_eq!(parse_whole(b"-"), None);
    }

    #[test]
    fn clock_times() {
        for clock in [
            "12:00:01.5",
            "2024-01-31",
            "2024-01-31T12:00:00Z",
            "31.01.2024",
            "1/2/2024",
        ] {
            assert!(is_clock_time(clock.as_bytes()), "{clock}");
        }
        for other in ["12.5", "-12", "abc", "", "time"] {
            assert!(!is_clock_time(other.as_bytes()), "{other}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        #[test]
        fn agrees_with_the_standard_parser(digits in "[-+]?[0-9]{1,20}(\\.[0-9]{0,20})?(e[-+]?[0-9]{1,2})?") {
            let expected: f64 = digits.parse().unwrap();
            prop_assert_eq!(number(&digits).to_bits(), expected.to_bits());
        }

        #[test]
        fn every_double_survives(bits: u64) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            prop_assert_eq!(number(&format!("{value:?}")).to_bits(), bits);
        }
    }
}
