//! Dates with a time of day as time stamps, in nanoseconds from the first one.
//!
//! ```text
//! 2024-01-31T12:00:01.5+01:00   2024/01/31 12:00:01     year first, as ISO 8601 writes it
//! 31.01.2024 12:00:01,5                                 with points the day is first
//! 31/01/2024 12:00   1/31/24 12:00:01 PM                a number above 12 is the day
//! 31-Jan-24 12:00:01.5   31 Jan 2024 12:00              as the PI system writes it
//! Wed Jan 31 12:00:01 2024                              as C writes it
//! ```
//!
//! While all dates are the same, the order of day and month does not matter. It is settled by a number above 12, or by
//! a step to the next day.

use std::fmt;

use super::number;

const SECOND_NS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400 * SECOND_NS;

/// Order of the numbers of a date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    YearMonthDay,
    DayMonthYear,
    MonthDayYear,
}

/// A date and a time of day as in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Date {
    /// The three numbers of the date, in the order of the file.
    numbers: [u16; 3],
    /// Between these numbers: `-`, `/` or `.`.
    mark: u8,
    /// Whether the month is a name; the day is first then.
    has_month: bool,
    /// Time of day, less the distance of the time zone from UTC (ns).
    of_day_ns: i64,
}

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([a, b, c], mark) = (self.numbers, char::from(self.mark));
        let day_ns = self.of_day_ns.rem_euclid(DAY_NS);
        let (seconds, ns) = (day_ns / SECOND_NS, day_ns % SECOND_NS);
        let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
        write!(f, "{a:02}{mark}{b:02}{mark}{c:02} ")?;
        write!(f, "{hours:02}:{minutes:02}:{:02}", seconds % 60)?;
        if ns > 0 {
            write!(f, ".{}", format!("{ns:09}").trim_end_matches('0'))?;
        }
        Ok(())
    }
}

impl Date {
    /// The order, if this date alone shows it.
    fn order(&self) -> Option<Order> {
        match (self.numbers, self.mark) {
            _ if self.has_month => Some(Order::DayMonthYear),
            ([year, ..], _) if year > 99 => Some(Order::YearMonthDay),
            (_, b'.') => Some(Order::DayMonthYear),
            ([first, ..], _) if first > 12 => Some(Order::DayMonthYear),
            ([_, second, _], _) if second > 12 => Some(Order::MonthDayYear),
            _ => None,
        }
    }

    /// Days since 1970-01-01 in the Gregorian calendar; `None` if there is no such day.
    fn days(&self, order: Order) -> Option<i64> {
        let [a, b, c] = self.numbers.map(i64::from);
        let (year, month, day) = match order {
            Order::YearMonthDay => (a, b, c),
            Order::DayMonthYear => (c, b, a),
            Order::MonthDayYear => (c, a, b),
        };
        let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        let length = match month {
            2 => 28 + i64::from(is_leap),
            4 | 6 | 9 | 11 => 30,
            _ => 31,
        };
        let exists = (1..=12).contains(&month) && (1..=length).contains(&day) && year > 99;
        // Years that begin in March: the leap day is the last day, and 153 days in five months.
        let (march_year, march_month) = (year - i64::from(month < 3), (month + 9) % 12);
        let leaps = march_year / 4 - march_year / 100 + march_year / 400;
        let of_year = (153 * march_month + 2) / 5 + day - 1;
        exists.then_some(365 * march_year + leaps + of_year - 719_468)
    }
}

/// Why a date is no time stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fault {
    /// No day of the calendar in the order of the earlier dates, or no date.
    NoSuchDay,
    /// A date after time stamps that are numbers.
    AmongNumbers,
    /// Day and month can be taken in either order.
    EitherOrder,
}

/// Counts time from the first date.
#[derive(Debug, Clone, Copy)]
pub(super) struct Calendar {
    first: Date,
    order: Option<Order>,
}

impl Calendar {
    pub(super) fn new(first: Date) -> Self {
        let order = first.order();
        Self { first, order }
    }

    /// Time since the first date (ns).
    pub(super) fn since_first_ns(&mut self, date: &Date) -> Result<i64, Fault> {
        let of_day_ns = date.of_day_ns - self.first.of_day_ns;
        if date.mark != self.first.mark {
            return Err(Fault::NoSuchDay);
        }
        if self.order.is_none() && date.numbers != self.first.numbers {
            let order = date.order().or_else(|| self.next_day(date));
            self.order = Some(order.ok_or(Fault::EitherOrder)?);
        }
        let days = match self.order {
            Some(order) => {
                let days = |date: &Date| date.days(order).ok_or(Fault::NoSuchDay);
                days(date)? - days(&self.first)?
            }
            None => 0,
        };
        let since_ns = (days.checked_mul(DAY_NS)).and_then(|ns| ns.checked_add(of_day_ns));
        since_ns.ok_or(Fault::NoSuchDay)
    }

    /// The order in which a date is the day after the first one: at most one of the two.
    fn next_day(&self, date: &Date) -> Option<Order> {
        [Order::DayMonthYear, Order::MonthDayYear]
            .into_iter()
            .find(|&order| {
                let days = |date: &Date| date.days(order);
                days(date)
                    .zip(days(&self.first))
                    .is_some_and(|(day, first)| day == first + 1)
            })
    }
}

/// The date and time of day in a cell; `None` if it is anything else.
pub(super) fn parse(cell: &[u8]) -> Option<Date> {
    let text = std::str::from_utf8(number::bare(cell)).ok()?;
    let named = with_named_month(text);
    let text = named.as_deref().unwrap_or(text);
    let (date, of_day) = text.split_once(['T', 't', ' ', '_'])?;
    let mark = date.bytes().find(|byte| !byte.is_ascii_digit())?;
    let mut parts = date.split(char::from(mark));
    let texts = [parts.next()?, parts.next()?, parts.next()?];
    let month = month(texts[1]);
    let number = |at: usize| match month {
        Some(month) if at == 1 => Some(month),
        _ => digits(texts[at], 4),
    };
    let mut numbers = [number(0)?, number(1)?, number(2)?];
    // A year of two digits; with `-` it could be the first number.
    if texts[2].len() == 2 && texts[0].len() < 3 && (mark != b'-' || month.is_some()) {
        numbers[2] += 2000;
    }
    // One of the ends is the year, with four digits.
    let is_date = matches!(mark, b'-' | b'/' | b'.')
        && parts.next().is_none()
        && (numbers[0] > 99) != (numbers[2] > 99);
    let date = Date {
        numbers,
        mark,
        has_month: month.is_some(),
        of_day_ns: of_day_ns(of_day.trim())?,
    };
    let orders = match date.order() {
        Some(order) => vec![order],
        None => vec![Order::DayMonthYear, Order::MonthDayYear],
    };
    let exists = orders.into_iter().any(|order| date.days(order).is_some());
    (is_date && exists).then_some(date)
}

/// A date whose words are separated by blanks, as `31-Jan-2024 12:00:01`.
fn with_named_month(text: &str) -> Option<String> {
    let is_month = |word: &str| word.is_ascii() && month(word).is_some();
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    match words.as_slice() {
        [day, name, year, of_day @ ..] if is_month(name) && digits(day, 2).is_some() => {
            Some(format!("{day}-{name}-{year} {}", of_day.join(" ")))
        }
        [_, name, day, of_day, year] if is_month(name) && of_day.contains(':') => {
            Some(format!("{day}-{name}-{year} {of_day}"))
        }
        _ => None,
    }
}

/// `8:00:01`, `08:00:01:500`, `08:00:01,5`, `1:00:01 PM`: the time of day in a cell, or the time since a start, in ns. Two numbers are
/// none: `8:00` may be minutes and seconds.
pub(super) fn of_day(cell: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(number::bare(cell)).ok()?;
    let has_seconds = matches!(text.bytes().filter(|&byte| byte == b':').count(), 2 | 3);
    has_seconds.then(|| of_day_ns(text))?
}

/// Adds the days that times of day leave out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Days {
    before_ns: i64,
    since_ns: i64,
}

impl Days {
    pub(super) fn new(first_ns: i64) -> Self {
        Self {
            before_ns: first_ns,
            since_ns: 0,
        }
    }

    /// Time since the first one (ns). A time of day more than half a day earlier than the one before is of the next day.
    pub(super) fn since_first_ns(&mut self, of_day_ns: i64) -> i64 {
        let step_ns = of_day_ns - self.before_ns;
        let is_next = step_ns < -DAY_NS / 2;
        self.before_ns = of_day_ns;
        self.since_ns = self
            .since_ns
            .saturating_add(step_ns + if is_next { DAY_NS } else { 0 });
        self.since_ns
    }
}

/// A date and a time of day of two cells, as one.
pub(super) fn joined(date: &[u8], of_day: &[u8]) -> Vec<u8> {
    [number::bare(date), b" ", number::bare(of_day)].concat()
}

/// Number of the month of this name, in English or German.
fn month(name: &str) -> Option<u16> {
    const NAMES: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    let name = name.get(..3)?.to_ascii_lowercase();
    let name = match name.as_str() {
        "mai" => "may",
        "okt" => "oct",
        "dez" => "dec",
        "mrz" => "mar",
        name => name,
    };
    let at = NAMES.iter().position(|known| *known == name)?;
    u16::try_from(at + 1).ok()
}

/// `12:00`, `12:00:01,5`, `1:00 PM`, `12:00:01.5+01:00`, `12:00Z`: time of day less the zone (ns).
fn of_day_ns(text: &str) -> Option<i64> {
    let (text, zone_ns) = without_zone(text)?;
    let upper = text.to_ascii_uppercase();
    let (clock, half) = match upper.strip_suffix("AM") {
        Some(clock) => (clock, Some(0)),
        None => match upper.strip_suffix("PM") {
            Some(clock) => (clock, Some(12)),
            None => (upper.as_str(), None),
        },
    };
    // Milliseconds behind a fourth colon are three digits.
    let colon = clock.match_indices(':').nth(2).map(|(at, _)| at);
    let clock = match colon {
        Some(at) if clock.trim().len() == at + 4 => {
            format!("{}.{}", &clock[..at], &clock[at + 1..])
        }
        _ => clock.to_owned(),
    };
    let (clock, fraction_ns) = match clock.trim().split_once(['.', ',']) {
        Some((clock, fraction)) => (clock, nanoseconds(fraction)?),
        None => (clock.trim(), 0),
    };
    let mut parts = clock.split(':');
    let hour = i64::from(digits(parts.next()?, 2)?);
    let minute = i64::from(digits(parts.next()?, 2)?);
    let second = parts.next();
    let is_whole = parts.next().is_none() && (second.is_some() || fraction_ns == 0);
    let second = second.map_or(Some(0), |second| digits(second, 2))?;
    let hour = match half {
        Some(after) if (1..=12).contains(&hour) => hour % 12 + after,
        Some(_) => return None,
        None => hour,
    };
    // 60 is a leap second; 24:00 is the end of a day.
    let exists = is_whole && hour <= 24 && minute < 60 && second <= 60;
    let seconds = 3600 * hour + 60 * minute + i64::from(second);
    exists.then_some(seconds * SECOND_NS + fraction_ns - zone_ns)
}

/// Splits off `Z`, `UTC`, `+01:00`, `-0330` or `+01`; the distance from UTC in ns.
fn without_zone(text: &str) -> Option<(&str, i64)> {
    for utc in ["Z", "z", "UTC", "GMT"] {
        if let Some(text) = text.strip_suffix(utc) {
            return Some((text.trim_end(), 0));
        }
    }
    let Some(at) = text.rfind(['+', '-']) else {
        return Some((text, 0));
    };
    let zone = text[at + 1..].replace(':', "");
    let (hours, minutes) = match zone.len() {
        2 => (digits(&zone, 2)?, 0),
        4 => (digits(zone.get(..2)?, 2)?, digits(zone.get(2..)?, 2)?),
        _ => return None,
    };
    let size_ns = 60 * (60 * i64::from(hours) + i64::from(minutes)) * SECOND_NS;
    let is_west = text[at..].starts_with('-');
    Some((
        text[..at].trim_end(),
        if is_west { -size_ns } else { size_ns },
    ))
}

/// A number of at most `most` digits.
fn digits(text: &str, most: usize) -> Option<u16> {
    let is_number =
        !text.is_empty() && text.len() <= most && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_number { text.parse().ok() } else { None }
}

/// The digits after a decimal mark, in ns; digits beyond the ninth are dropped.
fn nanoseconds(fraction: &str) -> Option<i64> {
    if fraction.is_empty() || !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    format!("{fraction:0<9}").get(..9)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn date(text: &str) -> Date {
        parse(text.as_bytes()).unwrap_or_else(|| panic!("{text}"))
    }

    /// Seconds from the first to the last date.
    fn seconds(texts: &[&str]) -> Result<f64, Fault> {
        let mut calendar = Calendar::new(date(texts[0]));
        let mut since = Ok(0);
        for text in texts {
            since = Ok(calendar.since_first_ns(&date(text))?);
        }
        since.map(|ns| ns as f64 / 1e9)
    }

    // Unix times by `date -u -d ... +%s` of GNU coreutils 9.4.
    #[test]
    fn days_of_the_calendar() {
        for (text, unix_s) in [
            ("1970-01-01 00:00:00", 0),
            ("2000-02-29 12:00:00", 951_825_600),
            ("2024-03-01 00:00:00", 1_709_251_200),
            ("2100-12-31 23:59:59", 4_133_980_799),
        ] {
            let date = date(text);
            let days = date.days(Order::YearMonthDay).unwrap();
            assert_eq!(days * 86_400 + date.of_day_ns / SECOND_NS, unix_s, "{text}");
        }
    }

    #[test]
    fn the_usual_forms_are_the_same_instant() {
        for text in [
            "2024-01-31T13:00:01.500Z",
            "2024-01-31 13:00:01.5",
            "\"2024/01/31 13:00:01,500000000\"",
            "2024-01-31T14:00:01.5+01:00",
            "2024-01-31T09:30:01.5-0330",
            "31.01.2024 13:00:01,5",
            "31/01/2024 13:00:01.5",
            "1/31/2024 1:00:01.5 PM",
            "31-01-2024 13:00:01.5 UTC",
            "31-Jan-2024 13:00:01.5",
            "31-Jan-24 13:00:01.5",
            "31.01.24 13:00:01,5",
            "1/31/24 1:00:01.5 PM",
        ] {
            let date = date(text);
            let days = date.days(date.order().unwrap()).unwrap();
            assert_eq!(
                days * DAY_NS + date.of_day_ns,
                1_706_706_001_500_000_000,
                "{text}"
            );
        }
        assert_eq!(
            date("2024-01-31T13:00:01.5Z").to_string(),
            "2024-01-31 13:00:01.5"
        );
    }

    #[test]
    fn the_order_of_day_and_month() {
        // One day: the order does not matter.
        assert_eq!(seconds(&["1/2/2024 12:00", "1/2/2024 12:01"]), Ok(60.0));
        // The next day settles it; 10 s across midnight.
        assert_eq!(
            seconds(&["01/02/2024 23:59:55", "02/02/2024 00:00:05"]),
            Ok(10.0)
        );
        assert_eq!(
            seconds(&["01/02/2024 23:59:55", "01/03/2024 00:00:05"]),
            Ok(10.0)
        );
        // The end of January, settled by 31.
        assert_eq!(
            seconds(&["1/31/2024 23:59:55", "2/1/2024 00:00:05"]),
            Ok(10.0)
        );
        assert_eq!(
            seconds(&["01/02/2024 12:00", "03/02/2024 12:00"]),
            Err(Fault::EitherOrder)
        );
        assert_eq!(
            seconds(&["31/01/2024 12:00", "01/31/2024 12:01"]),
            Err(Fault::NoSuchDay)
        );
    }

    #[test]
    fn other_texts_are_none() {
        for text in [
            "12:00:01",
            "2024-01-31",
            "24-01-31 12:00",
            "31-Foo-24 12:00",
            "2023-02-29 12:00",
            "2024-13-01 12:00",
            "2024-01-31 25:00",
            "2024-01-31 12:61",
            "2024-01-31 13:00 PM",
            "2024-01-31 12",
            "1.5",
            "",
            "2024-01-31 12:00:01.",
            "2024-01-31T12:00:01+1",
            "2024-01-31T12:00+\u{20ac}1",
        ] {
            assert_eq!(parse(text.as_bytes()), None, "{text}");
        }
    }

    // One second over midnight; back by less than half a day is back.
    #[test]
    fn times_of_day() {
        assert_eq!(of_day(b"08:00:01.5"), Some(28_801_500_000_000));
        assert_eq!(of_day(b"1:00:00 PM"), Some(46_800_000_000_000));
        for text in [
            "08:00",
            "25:00:00",
            "08:00:61",
            "8:0:0:0",
            "2024-01-31 08:00:01",
        ] {
            assert_eq!(of_day(text.as_bytes()), None, "{text}");
        }
        let ns = |text: &str| of_day(text.as_bytes()).unwrap();
        let mut days = Days::new(ns("23:59:59"));
        for (text, since_s) in [
            ("23:59:59", 0),
            ("0:00:00", 1),
            ("11:00:00", 39_601),
            ("10:00:00", 36_001),
        ] {
            assert_eq!(days.since_first_ns(ns(text)), since_s * SECOND_NS, "{text}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(texts in prop::collection::vec("[0-9]{1,4}[-/.][0-9]{1,2}[-/.][0-9]{1,4}[ T][-0-9:.,+ZAPM ]{1,20}", 2..4)) {
            let dates: Vec<Date> = texts.iter().filter_map(|text| parse(text.as_bytes())).collect();
            if let [first, rest @ ..] = dates.as_slice() {
                let mut calendar = Calendar::new(*first);
                for date in rest {
                    drop((calendar.since_first_ns(date), date.to_string()));
                }
            }
        }
    }
}
