//! Numbers as text.

use std::f64::consts::TAU;

/// Four significant digits; a power of ten only for very small and very large numbers.
pub fn significant(value: f64) -> String {
    digits(value, 4)
}

/// Three significant digits, for tables.
pub fn short(value: f64) -> String {
    digits(value, 3)
}

/// Values with three significant digits, or with as many as it takes that no two are written alike, at most six.
pub fn apart<const N: usize>(values: [f64; N]) -> [String; N] {
    let of = |count: usize| values.map(|value| digits(value, count));
    let differ = |count: &usize| {
        let all = of(*count);
        (0..N).all(|i| (0..i).all(|j| all[i] != all[j] || values[i] == values[j]))
    };
    of((3..6).find(differ).unwrap_or(6))
}

/// A frequency (rad/s) in Hz with two significant digits.
pub fn frequency(omega_rad_per_s: f64) -> String {
    format!("{} Hz", digits(omega_rad_per_s / TAU, 2))
}

/// `count` significant digits, with trailing zeros.
fn digits(value: f64, count: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if value.is_nan() {
        return "unknown".to_owned();
    }
    // The power of ten after rounding: 0.99999 becomes 1.000.
    let last = count as i32 - 1;
    let scientific = format!("{value:.*e}", count - 1);
    let power = scientific
        .split_once('e')
        .and_then(|(_, power)| power.parse::<i32>().ok());
    match power {
        Some(power @ -4..=5) => format!("{value:.*}", (last - power).max(0) as usize),
        _ => scientific,
    }
}

/// Four significant digits, or `unbounded`.
pub fn bounded(value: Option<f64>) -> String {
    value.map_or("unbounded".to_owned(), significant)
}

/// A fraction as a percentage with two decimals; never "-0.00".
pub fn percent(part: f64) -> String {
    let rounded = (1e4 * part).round() / 100.0;
    format!("{:.2} %", rounded + 0.0)
}

/// An angle (rad) in degrees with two decimals.
pub fn degrees(angle_rad: f64) -> String {
    format!("{:.2} deg", angle_rad.to_degrees())
}

/// A time (s) in the unit that suits it: us, ms, s, min or h.
pub fn seconds(time_s: f64) -> String {
    match time_s {
        36_000.0.. => format!("{:.1} h", time_s / 3600.0),
        600.0.. => format!("{:.1} min", time_s / 60.0),
        100.0.. => format!("{time_s:.0} s"),
        0.1.. => format!("{time_s:.2} s"),
        1e-3..0.1 => format!("{:.1} ms", 1e3 * time_s),
        _ => format!("{:.0} us", 1e6 * time_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1.000"),
            (0.99999, "1.000"),
            (999999.9, "1.000e6"),
            (-12.3456, "-12.35"),
            (774.29, "774.3"),
            (123456.7, "123457"),
            (0.00050049, "0.0005005"),
            (1.5e-7, "1.500e-7"),
            (3.2e9, "3.200e9"),
        ] {
            assert_eq!(significant(value), text);
        }
        assert_eq!(bounded(None), "unbounded");
    }

    #[test]
    fn frequencies_are_in_hertz() {
        for (hertz, text) in [
            (0.999, "1.0 Hz"),
            (0.0123, "0.012 Hz"),
            (19.96, "20 Hz"),
            (123.0, "123 Hz"),
        ] {
            assert_eq!(frequency(TAU * hertz), text);
        }
        assert_eq!(frequency(f64::NAN), "unknown Hz");
    }

    // A value that rounds to zero has no sign.
    #[test]
    fn with_units() {
        assert_eq!(percent(0.12346), "12.35 %");
        assert_eq!(percent(-0.00001), "0.00 %");
        assert_eq!(percent(-0.0123), "-1.23 %");
        assert_eq!(degrees(-0.818_355), "-46.89 deg");
        assert_eq!(seconds(86_400.0), "24.0 h");
        assert_eq!(seconds(4914.75), "81.9 min");
        assert_eq!(seconds(128.73), "129 s");
        assert_eq!(seconds(1.8936), "1.89 s");
        assert_eq!(seconds(0.005), "5.0 ms");
        assert_eq!(seconds(3.2e-5), "32 us");
    }
}
