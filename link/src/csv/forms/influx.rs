//! InfluxDB line protocol: `measurement,tag=a temp=79.9,pwm=0.3 1710230400000000000`.
//!
//! Reference: InfluxData, "Line protocol". A name is the measurement, the values of the tags and the field.

use super::fields::{Fields, field};

/// The fields of a line with numbers and a time.
pub(super) fn fields(line: &str) -> Fields {
    read(line).unwrap_or_default()
}

fn read(line: &str) -> Option<Fields> {
    let (series, rest) = split(line, ' ')?;
    let (values, time) = split(rest, ' ')?;
    let time = field("time", time.trim())?;
    let mut parts = parts(series);
    let measurement = parts
        .next()
        .filter(|name| !name.is_empty() && !name.starts_with('#'))?;
    let mut series = plain(measurement);
    for tag in parts {
        let (_, value) = split(tag, '=')?;
        series = format!("{series}.{}", plain(value));
    }
    let mut found = vec![time];
    for part in self::parts(values) {
        let (name, value) = split(part, '=')?;
        let name = match plain(name) {
            name if name == "value" => series.clone(),
            name => format!("{series}.{name}"),
        };
        let number = match value {
            "t" | "T" => "1",
            "f" | "F" => "0",
            _ => value.strip_suffix(['i', 'u']).unwrap_or(value),
        };
        // A text is no signal.
        if !value.starts_with('"') {
            found.push(field(name, number)?);
        }
    }
    (found.len() > 1).then_some(found)
}

/// Splits at the first mark that is neither behind a backslash nor within quotes.
fn split(text: &str, mark: char) -> Option<(&str, &str)> {
    let at = marks(text, mark).next()?;
    Some((&text[..at], &text[at + mark.len_utf8()..]))
}

/// The parts between commas.
fn parts(text: &str) -> impl Iterator<Item = &str> {
    let starts = std::iter::once(0).chain(marks(text, ',').map(|at| at + 1));
    let ends = marks(text, ',').chain([text.len()]);
    starts.zip(ends).map(|(start, end)| &text[start..end])
}

fn marks(text: &str, mark: char) -> impl Iterator<Item = usize> + use<'_> {
    let (mut is_quoted, mut is_escaped) = (false, false);
    text.char_indices().filter_map(move |(at, c)| {
        let was_escaped = is_escaped;
        is_escaped = c == '\\' && !was_escaped;
        is_quoted ^= c == '"' && !was_escaped;
        (c == mark && !was_escaped && !is_quoted).then_some(at)
    })
}

/// A name without the backslashes before marks.
fn plain(name: &str) -> String {
    name.replace('\\', "")
}

#[cfg(test)]
mod tests {
    use super::super::fields::joined;
    use super::*;

    #[test]
    fn lines_of_the_protocol() {
        for (line, expected) in [
            (
                "boiler temp=79.9,pwm=0.3 17000",
                "time=17000 boiler.temp=79.9 boiler.pwm=0.3",
            ),
            (
                "temp,site=a,unit=b value=79.9 17000",
                "time=17000 temp.a.b=79.9",
            ),
            (
                "my\\ boiler,a=b\\,c n=3i,on=t,s=\"a b=c\" 17",
                "time=17 my boiler.b,c.n=3 my boiler.b,c.on=1",
            ),
            ("boiler temp=79.9", ""),
            ("# comment a=1 2", ""),
            ("boiler temp=x 17", ""),
            ("boiler s=\"text\" 17", ""),
        ] {
            assert_eq!(joined(fields(line)), expected, "{line}");
        }
    }
}
