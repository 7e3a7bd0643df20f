//! Plots of a page: figures of panels of series, drawn by plotly.js (MIT licence).
//!
//! A series names its meaning, not its colour. The page chooses the colours by theme, the same for the same meaning in
//! every figure.

mod json;

use serde::{Deserialize, Serialize};

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Marks {
    Line,
    Dashes,
    /// Steps: each value is held until the next one.
    Steps,
    Points,
    /// Large open circles, for a few points.
    Rings,
    LineAndPoints,
    /// A closed polygon, filled.
    Area,
    Bars,
}

/// Meaning of a series, which decides its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hue {
    /// One of several similar series: the next colour of the palette.
    #[default]
    Next,
    Measured,
    Model,
    Input,
    /// Reference for other series.
    Reference,
}

/// A series of points. A series without a name is not in the legend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
    pub name: String,
    pub marks: Marks,
    #[serde(default)]
    pub hue: Hue,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

/// Significant digits of a coordinate, of its value and of the range of all values.
const DIGITS: usize = 5;

impl Series {
    /// A series of points, rounded to what a screen can show.
    pub fn of_points(
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

    /// The area between two curves over the same abscissas.
    pub fn between(name: &str, x: &[f64], low: &[f64], high: &[f64]) -> Self {
        let there = x.iter().zip(low);
        let back = x.iter().zip(high).rev();
        Self::of_points(name, Marks::Area, there.chain(back).map(|(&x, &y)| (x, y)))
    }

    pub fn hue(self, hue: Hue) -> Self {
        Self { hue, ..self }
    }
}

/// The numbers rounded to [`DIGITS`] digits of the smaller one: the number or the range of all numbers.
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
pub struct Axis {
    /// Quantity and unit.
    pub title: String,
    /// Whether it is logarithmic.
    #[serde(default)]
    pub is_logarithmic: bool,
    /// Range that is shown [default: that of the data].
    #[serde(default)]
    pub range: Option<(f64, f64)>,
    /// Whether labels and grid are hidden.
    #[serde(default)]
    pub is_bare: bool,
    /// Distance of labels on a linear axis [default: chosen by the plot].
    #[serde(default)]
    pub tick: Option<f64>,
}

impl Axis {
    /// A linear axis.
    pub fn titled(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ..Self::default()
        }
    }

    pub fn logarithmic(self) -> Self {
        Self {
            is_logarithmic: true,
            ..self
        }
    }

    pub fn every(self, tick: f64) -> Self {
        Self {
            tick: Some(tick),
            ..self
        }
    }

    pub fn spanning(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }
}

/// A note at a point of a panel, with an arrow.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    pub text: String,
    pub x: f64,
    pub y: f64,
    /// Offset of the text from the point: right and down (pixels).
    pub away: (f64, f64),
}

/// Values over a plane: `z[row][column]` at `y[row]`, `x[column]`. If `y` has one value more than there are rows, they are
/// the edges of the rows; the same for `x` and columns. NaN is left blank.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    pub kind: FieldKind,
    pub x: Places,
    pub y: Places,
    pub z: Vec<Vec<f64>>,
}

/// Coordinates of the values of a field.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Places {
    Numbers(Vec<f64>),
    Names(Vec<String>),
}

/// Meaning of the values of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldKind {
    /// Probability content of highest-density regions, 0 to 1; contour lines at 50, 90 and 99 %.
    Regions,
    /// Correlations, -1 to 1; coloured squares with numbers.
    Correlations,
    /// Values below and above a middle value, with a colour bar.
    Diverging { middle: f64, reach: f64 },
}

/// One of several panels stacked over a common x axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    pub y: Axis,
    pub series: Vec<Series>,
    pub field: Option<Field>,
    pub notes: Vec<Note>,
}

impl Panel {
    pub fn new(y: Axis, series: Vec<Series>) -> Self {
        Self {
            y,
            series,
            ..Self::default()
        }
    }
}

/// Size of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    #[default]
    Wide,
    /// For two panels.
    Tall,
    /// With the same scale on both axes.
    ToScale,
    Square,
    /// One of several side by side.
    Small,
}

impl Shape {
    /// CSS class.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wide => "wide",
            Self::Tall => "tall",
            Self::ToScale => "to-scale",
            Self::Square => "square",
            Self::Small => "small",
        }
    }
}

/// A figure: panels, stacked, and a caption.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    pub caption: String,
    pub x: Axis,
    /// From top to bottom.
    pub panels: Vec<Panel>,
    pub shape: Shape,
    /// Shaded range of the x axis.
    pub span: Option<(f64, f64)>,
}

impl Figure {
    /// A figure with one panel.
    pub fn single(caption: &str, x: Axis, panel: Panel) -> Self {
        Self::stacked(caption, x, vec![panel])
    }

    /// A figure with several panels, from top to bottom.
    pub fn stacked(caption: &str, x: Axis, panels: Vec<Panel>) -> Self {
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

    pub fn shaped(self, shape: Shape) -> Self {
        Self { shape, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Five digits of numbers over decades; of numbers that differ in the sixth digit, the next five.
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
