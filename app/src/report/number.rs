//! Numbers as people read them.

/// Four significant digits, with a power of ten only where it is needed.
pub(crate) fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{value:.3e}");
    }
    let decimals = (3.0 - magnitude).max(0.0) as usize;
    format!("{value:.decimals$}")
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
