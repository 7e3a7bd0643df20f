//! Units of time: their names, their symbols, their length in seconds.

/// A unit of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum TimeUnit {
    /// 86,400 s, as spreadsheets count dates.
    Days,
    /// 3600 s.
    Hours,
    /// 60 s.
    Minutes,
    /// 1 s.
    Seconds,
    /// 1e-3 s.
    Milliseconds,
    /// 1e-6 s.
    Microseconds,
    /// 1e-9 s.
    Nanoseconds,
    /// 1e-7 s, in which Windows counts from the year 1601.
    Ticks,
}

impl TimeUnit {
    /// The unit of this name or symbol, in any case: `s`, `ms`, `usec`, `minutes`, ...
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name.trim().to_lowercase().as_str() {
            "d" | "day" | "days" => Self::Days,
            "h" | "hr" | "hrs" | "hour" | "hours" => Self::Hours,
            "min" | "mins" | "minute" | "minutes" => Self::Minutes,
            "s" | "sec" | "secs" | "second" | "seconds" => Self::Seconds,
            "ms" | "msec" | "msecs" | "millis" | "millisecond" | "milliseconds" => {
                Self::Milliseconds
            }
            "us" | "\u{b5}s" | "\u{3bc}s" | "\u{fffd}s" | "usec" | "usecs" | "micros"
            | "microsecond" | "microseconds" => Self::Microseconds,
            "ns" | "nsec" | "nsecs" | "nanos" | "nanosecond" | "nanoseconds" => Self::Nanoseconds,
            "100 ns" | "100ns" | "filetime" => Self::Ticks,
            _ => return None,
        })
    }

    /// Its symbol, such as `ms`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Days => "d",
            Self::Hours => "h",
            Self::Minutes => "min",
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
            Self::Microseconds => "us",
            Self::Nanoseconds => "ns",
            Self::Ticks => "100 ns",
        }
    }

    /// Converts a time in this unit to seconds.
    pub fn seconds(self, time: f64) -> f64 {
        // Division by a whole number is rounded once; the factor 1e-3 would be rounded twice.
        match self {
            Self::Days => time * 86_400.0,
            Self::Hours => time * 3600.0,
            Self::Minutes => time * 60.0,
            Self::Seconds => time,
            Self::Milliseconds => time / 1e3,
            Self::Microseconds => time / 1e6,
            Self::Nanoseconds => time / 1e9,
            Self::Ticks => time / 1e7,
        }
    }
}
