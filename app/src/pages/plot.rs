//! Plots of a page: series of points as plotly.js draws them (plotly.rs, MIT licence).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::page::escaped;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Marks {
    Line,
    Points,
    LineAndPoints,
}

/// Points under one name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) marks: Marks,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
}

/// Digits of a coordinate that a screen can show.
const DIGITS: usize = 5;

impl Series {
    /// Of points, as exact as a screen is.
    pub(crate) fn of_points(
        name: &str,
        marks: Marks,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        let (x, y) = points
            .into_iter()
            .map(|(x, y)| (short(x), short(y)))
            .unzip();
        Self {
            name: name.to_owned(),
            marks,
            x,
            y,
        }
    }
}

/// The number with no more digits than are shown.
fn short(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// An axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Axis {
    /// What it shows, and in which unit.
    pub(crate) title: String,
    /// Whether it is logarithmic.
    #[serde(default)]
    pub(crate) is_logarithmic: bool,
}

/// A plot and what stands under it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Figure {
    pub(crate) caption: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    #[serde(default)]
    pub(crate) series: Vec<Series>,
}

impl Figure {
    /// Data and layout as JSON. Colours are the page's, which change with its theme; plotly.js reads a few
    /// tags in names and titles, and there are none in ours.
    pub(crate) fn to_json(&self) -> String {
        let trace = |series: &Series| {
            let mode = match series.marks {
                Marks::Line => "lines",
                Marks::Points => "markers",
                Marks::LineAndPoints => "lines+markers",
            };
            json!({
                "type": "scatter",
                "name": escaped(&series.name),
                "mode": mode,
                "x": series.x,
                "y": series.y,
            })
        };
        let axis = |axis: &Axis| {
            json!({
                "title": { "text": escaped(&axis.title) },
                "type": if axis.is_logarithmic { "log" } else { "linear" },
                "automargin": true,
                "zeroline": false,
            })
        };
        let figure = json!({
            "data": self.series.iter().map(trace).collect::<Vec<_>>(),
            "layout": {
                "xaxis": axis(&self.x),
                "yaxis": axis(&self.y),
                "legend": { "orientation": "h", "y": 1.02, "yanchor": "bottom" },
                "showlegend": self.series.len() > 1,
                "margin": { "l": 56, "r": 16, "t": 24, "b": 48 },
            },
        });
        figure.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // What plotly.js is given: a trace a series, types of the axes, five digits, and no tag of a name.
    #[test]
    fn series_and_axes_reach_the_plot() {
        let figure = Figure {
            caption: String::new(),
            x: Axis {
                title: "time (s)".to_owned(),
                is_logarithmic: false,
            },
            y: Axis {
                title: "|J| (%)".to_owned(),
                is_logarithmic: true,
            },
            series: vec![
                Series::of_points("<b>one", Marks::Line, [(0.1, 1.234_567), (0.2, 2e-9)]),
                Series::of_points("two", Marks::Points, [(1.0, 0.0)]),
            ],
        };
        let json: serde_json::Value = serde_json::from_str(&figure.to_json()).unwrap();
        assert_eq!(json["data"][0]["y"], serde_json::json!([1.2346, 2e-9]));
        assert_eq!(json["data"][0]["name"], "&lt;b&gt;one");
        assert_eq!(json["data"][1]["mode"], "markers");
        assert_eq!(json["layout"]["yaxis"]["type"], "log");
        assert_eq!(json["layout"]["xaxis"]["type"], "linear");
        assert_eq!(json["layout"]["showlegend"], true);
    }
}
