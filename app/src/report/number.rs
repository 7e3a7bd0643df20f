//! Numbers as people read them.

/// Four significant digits, with a power of ten only where it is needed.
pub(crate) fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    // The power of ten after rounding: 0.99999 is 1.000.
    let scientific = format!("{value:.3e}");
    let power = scientific
        .split_once('e')
        .and_then(|(_, power)| power.parse::<i32>().ok());
    match power {
        Some(power @ -4..=5) => format!("{value:.*}", (3 - power).max(0) as usize),
        _ => scientific,
    }
}

/// The same, or `unbounded`.
pub(crate) fn bounded(value: Option<f64>) -> String {
    value.map_or("unbounded".to_owned(), significant)
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
}
