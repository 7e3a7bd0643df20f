//! Plots of a page: panels of series as plotly.js draws them (plotly.rs, MIT licence).
//!
//! A series says what it is, not how it looks: colours are the page's, the same for the same thing in every figure,
//! and they change with its theme.

mod json;

use serde::{Deserialize, Serialize};

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Marks {
    Line,
    Dashes,
    /// Each value is held until the next.
    Steps,
    Points,
    /// Few points, which stand for themselves.
    Rings,
    LineAndPoints,
    /// A closed polygon, filled.
    Area,
    Bars,
}

/// What a series shows, which is what decides its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Hue {
    /// One of several of a kind: the next of the palette.
    #[default]
    Next,
    Measured,
    Model,
    Input,
    /// What others are held against.
    Reference,
}

/// Points under one name; those of no name are not in the legend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) marks: Marks,
    #[serde(default)]
    pub(crate) hue: Hue,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
}

/// Digits that a screen can show of a coordinate, and of the width of all that there are.
const DIGITS: usize = 5;

impl Series {
    /// Of points, as exact as a screen is.
    pub(crate) fn of_points(
        name: &str,
        marks: Marks,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        Self {
            name: name.to_owned(),
            marks,
            hue: Hue::Next,
            x: shortened(x),
            y: shortened(y),
        }
    }

    /// What lies between two curves over the same abscissas.
    pub(crate) fn between(name: &str, x: &[f64], low: &[f64], high: &[f64]) -> Self {
        let there = x.iter().zip(low);
        let back = x.iter().zip(high).rev();
        Self::of_points(name, Marks::Area, there.chain(back).map(|(&x, &y)| (x, y)))
    }

    pub(crate) fn hue(self, hue: Hue) -> Self {
        Self { hue, ..self }
    }
}

/// The numbers with no more digits than are shown: of each, and of what lies between the least and the greatest.
fn shortened(mut values: Vec<f64>) -> Vec<f64> {
    let ends = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (value.min(low), value.max(high))
        });
    let width = ends.1 - ends.0;
    for value in &mut values {
        let ahead = (value.abs() / width).log10();
        let common = if ahead.is_finite() {
            ahead.floor().clamp(0.0, 10.0) as usize
        } else {
            0
        };
        *value = format!("{value:.*e}", DIGITS - 1 + common)
            .parse()
            .unwrap_or(*value);
    }
    values
}

/// An axis.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Axis {
    /// What it shows, and in which unit.
    pub(crate) title: String,
    /// Whether it is logarithmic.
    #[serde(default)]
    pub(crate) is_logarithmic: bool,
    /// What is shown of it [default: all that there is].
    #[serde(default)]
    pub(crate) range: Option<(f64, f64)>,
    /// Whether it has neither numbers nor a grid.
    #[serde(default)]
    pub(crate) is_bare: bool,
}

impl Axis {
    /// A linear axis.
    pub(crate) fn titled(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ..Self::default()
        }
    }

    pub(crate) fn logarithmic(self) -> Self {
        Self {
            is_logarithmic: true,
            ..self
        }
    }

    pub(crate) fn spanning(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }
}

/// Words at a point of a panel, with an arrow to it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Note {
    pub(crate) text: String,
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Where the words stand from there: to the right and down (pixels).
    pub(crate) away: (f64, f64),
}

/// Values over a plane, `z[row][column]` at `y[row]`, `x[column]`, or between `y[row]` and `y[row + 1]` where there is one
/// more of these than rows, and columns likewise. NaN is left blank.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    pub(crate) kind: FieldKind,
    pub(crate) x: Places,
    pub(crate) y: Places,
    pub(crate) z: Vec<Vec<f64>>,
}

/// Where the values of a field stand.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Places {
    Numbers(Vec<f64>),
    Names(Vec<String>),
}

/// What the values of a field are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FieldKind {
    /// Contents of the smallest regions, 0 to 1: lines about those of 50, 90 and 99 %.
    Regions,
    /// Correlations, -1 to 1: coloured squares with their numbers.
    Correlations,
    /// Values on either side of a middle, with a scale beside them.
    Diverging { middle: f64, reach: f64 },
}

/// One of the panels that stand above each other over the same abscissas.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Panel {
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
    pub(crate) field: Option<Field>,
    pub(crate) notes: Vec<Note>,
}

impl Panel {
    pub(crate) fn new(y: Axis, series: Vec<Series>) -> Self {
        Self {
            y,
            series,
            ..Self::default()
        }
    }
}

/// How much room a figure has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Shape {
    #[default]
    Wide,
    /// For two panels.
    Tall,
    /// Both axes have one scale.
    ToScale,
    Square,
    /// One of several in a row.
    Small,
}

impl Shape {
    /// As the page's style has it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Wide => "wide",
            Self::Tall => "tall",
            Self::ToScale => "to-scale",
            Self::Square => "square",
            Self::Small => "small",
        }
    }
}

/// Panels above each other and what stands under them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Figure {
    pub(crate) caption: String,
    pub(crate) x: Axis,
    /// The uppermost first.
    pub(crate) panels: Vec<Panel>,
    pub(crate) shape: Shape,
    /// What is marked of the abscissas.
    pub(crate) span: Option<(f64, f64)>,
}

impl Figure {
    /// Of one panel.
    pub(crate) fn single(caption: &str, x: Axis, panel: Panel) -> Self {
        Self::stacked(caption, x, vec![panel])
    }

    /// Of panels above each other.
    pub(crate) fn stacked(caption: &str, x: Axis, panels: Vec<Panel>) -> Self {
        let shape = if panels.len() > 1 {
            Shape::Tall
        } else {
            Shape::Wide
        };
        Self {
            caption: caption.to_owned(),
            x,
            panels,
            shape,
            span: None,
        }
    }

    pub(crate) fn shaped(self, shape: Shape) -> Self {
        Self { shape, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Five digits of numbers over decades; of numbers that differ in the sixth the next five.
    #[test]
    fn digits_are_those_that_are_seen() {
        assert_eq!(shortened(vec![1.234_567, 1234.567]), [1.2346, 1234.6]);
        assert_eq!(
            shortened(vec![0.300_001_234_567, 0.300_004]),
            [0.300_001_234_6, 0.300_004]
        );
        assert_eq!(shortened(vec![0.123_456_78]), [0.123_46]);
    }
}
