//! A figure as JSON for plotly.js: traces and a layout. The page adds the colours.

use serde_json::{Map, Value, json};

use super::{Axis, Field, FieldKind, Figure, Hue, Marks, Note, Panel, Places, Series, Shape};
use crate::pages::escape::escaped;

/// Gap between two panels, as a fraction of the height.
const BETWEEN: f64 = 0.06;
/// The upper panel's fraction of the height of two panels.
const UPPER: f64 = 0.62;

impl Figure {
    /// Data and layout. plotly.js interprets some tags in names and titles, so these are escaped.
    pub(crate) fn to_json(&self) -> String {
        let mut data: Vec<Value> = vec![];
        let mut layout = Map::new();
        let mut annotations: Vec<Value> = vec![];
        let lowest = number(self.panels.len().saturating_sub(1));
        for (index, panel) in self.panels.iter().enumerate() {
            let number = number(index);
            data.extend(panel.field.iter().map(|field| of_field(field, &number)));
            data.extend(panel.series.iter().map(|series| trace(series, &number)));
            annotations.extend(
                panel
                    .notes
                    .iter()
                    .map(|note| annotation(note, panel, self, &number)),
            );
            let mut axis = axis(&panel.y, panel.field.as_ref().map(|field| &field.y));
            let values = panel.series.iter().flat_map(|series| &series.y);
            space_labels(&mut axis, &panel.y, values);
            axis["domain"] = json!(domain(index, self.panels.len()));
            if self.shape == Shape::ToScale {
                axis["scaleanchor"] = json!("x");
            }
            layout.insert(format!("yaxis{number}"), axis);
        }
        let field = self.panels.iter().find_map(|panel| panel.field.as_ref());
        let mut x = axis(&self.x, field.map(|field| &field.x));
        x["anchor"] = json!(format!("y{lowest}"));
        if self.shape == Shape::Small {
            x["nticks"] = json!(SMALL_LABELS);
        }
        let series = self.panels.iter().flat_map(|panel| &panel.series);
        space_labels(&mut x, &self.x, series.flat_map(|series| &series.x));
        layout.insert("xaxis".to_owned(), x);
        layout.insert("annotations".to_owned(), json!(annotations));
        if let Some((from, to)) = self.span {
            let span = json!({
                "type": "rect", "xref": "x", "yref": "paper", "x0": from, "x1": to, "y0": 0, "y1": 1,
                "layer": "below", "line": { "width": 0 },
            });
            layout.insert("shapes".to_owned(), json!([span]));
        }
        let named = data.iter().filter(|trace| trace["showlegend"] == true);
        layout.insert("showlegend".to_owned(), json!(named.count() > 1));
        // In plots over time or frequency, the hover label shows all curves at the mouse.
        let is_of_abscissa = matches!(self.shape, Shape::Wide | Shape::Tall);
        let hover = if is_of_abscissa { "x" } else { "closest" };
        layout.insert("hovermode".to_owned(), json!(hover));
        layout.insert(
            "legend".to_owned(),
            json!({ "orientation": "h", "y": 1.02, "yanchor": "bottom" }),
        );
        layout.insert(
            "margin".to_owned(),
            json!({ "l": 56, "r": 16, "t": 24, "b": 48 }),
        );
        json!({ "data": data, "layout": layout }).to_string()
    }
}

/// The suffix of the name of an axis in plotly.js; the first axis has none.
fn number(index: usize) -> String {
    match index {
        0 => String::new(),
        _ => (index + 1).to_string(),
    }
}

/// The range of the height that a panel occupies.
fn domain(index: usize, count: usize) -> [f64; 2] {
    match (index, count) {
        (0, 2) => [1.0 - UPPER + BETWEEN / 2.0, 1.0],
        (1, 2) => [0.0, 1.0 - UPPER - BETWEEN / 2.0],
        _ => {
            let height = (1.0 + BETWEEN) / count as f64;
            let top = 1.0 - index as f64 * height;
            [(top - height + BETWEEN).max(0.0), top]
        }
    }
}

/// Labels of a linear axis in a small figure: more touch each other if they are long.
const SMALL_LABELS: u8 = 3;

fn axis(axis: &Axis, places: Option<&Places>) -> Value {
    let kind = match places {
        Some(Places::Names(_)) => "category",
        _ if axis.is_logarithmic => "log",
        _ => "linear",
    };
    let mut out = json!({
        "title": { "text": escaped(&axis.title) },
        "type": kind,
        "automargin": true,
        "zeroline": false,
    });
    if kind == "category" {
        // Upright if there is no room: slanted labels touch each other.
        out["autotickangles"] = json!([0, 90]);
    }
    if axis.is_bare {
        out["showticklabels"] = json!(false);
        out["showgrid"] = json!(false);
    }
    if let Some(tick) = axis.tick {
        out["dtick"] = json!(tick);
    }
    if let Some((low, high)) = axis.range {
        out["range"] = json!([scaled(axis, low), scaled(axis, high)]);
    }
    out
}

/// Up to this number of decades, an axis has labels at 1, 2 and 5; with more decades, at most this number of labels.
const FEW_DECADES: f64 = 2.5;
const MOST_LABELS: f64 = 6.0;

/// Sets the labels of a logarithmic axis. By default plotly.js labels each of 1 to 9, and these labels touch.
fn space_labels<'a>(out: &mut Value, axis: &Axis, values: impl Iterator<Item = &'a f64>) {
    let (low, high) = axis.range.unwrap_or_else(|| {
        let positive = values.filter(|value| **value > 0.0);
        positive.fold((f64::INFINITY, 0.0), |(low, high), value| {
            (value.min(low), value.max(high))
        })
    });
    let decades = (high / low).log10();
    // Below half a decade 1, 2 and 5 may be missing, and plotly.js uses even steps.
    if axis.is_logarithmic && decades >= 0.5 {
        out["dtick"] = if decades < FEW_DECADES {
            json!("D2")
        } else {
            json!((decades / MOST_LABELS).ceil())
        };
    }
}

/// A coordinate in the units of ranges and annotations.
fn scaled(axis: &Axis, value: f64) -> f64 {
    if axis.is_logarithmic {
        value.log10()
    } else {
        value
    }
}

fn trace(series: &Series, number: &str) -> Value {
    let mode = match series.marks {
        Marks::Points | Marks::Rings => "markers",
        Marks::LineAndPoints => "lines+markers",
        _ => "lines",
    };
    let mut trace = json!({
        "type": if series.marks == Marks::Bars { "bar" } else { "scatter" },
        "name": escaped(&series.name),
        "showlegend": !series.name.is_empty(),
        "mode": mode,
        "x": series.x,
        "y": series.y,
        "yaxis": format!("y{number}"),
        "hue": series.hue,
    });
    match series.marks {
        Marks::Steps => trace["line"] = json!({ "shape": "hv" }),
        Marks::Dashes => trace["line"] = json!({ "dash": "dash", "width": 1.5 }),
        Marks::Area => {
            trace["fill"] = json!("toself");
            trace["line"] = json!({ "width": 0 });
        }
        Marks::Points => trace["marker"] = json!({ "size": 4 }),
        Marks::Rings => {
            trace["marker"] =
                json!({ "size": 10, "symbol": "circle-open", "line": { "width": 2.5 } });
        }
        Marks::Line | Marks::LineAndPoints | Marks::Bars => {}
    }
    if series.hue == Hue::Reference || series.marks == Marks::Area {
        trace["hoverinfo"] = json!("skip");
    } else if series.name.is_empty() {
        trace["hoverinfo"] = json!("x+y");
    }
    trace
}

fn of_field(field: &Field, number: &str) -> Value {
    let mut trace = json!({
        "x": field.x, "y": field.y,
        "yaxis": format!("y{number}"), "showlegend": false, "showscale": false,
    });
    match field.kind {
        FieldKind::Regions => {
            trace["kind"] = json!("regions");
            trace["type"] = json!("contour");
            trace["hoverinfo"] = json!("x+y");
            let rows = field.z.iter();
            let z: Vec<Vec<f64>> = rows
                .map(|row| row.iter().map(|&content| step(content)).collect())
                .collect();
            trace["z"] = json!(z);
            trace["zmin"] = json!(0.0);
            trace["zmax"] = json!(REGIONS.len());
            trace["contours"] = json!({ "start": 1, "end": REGIONS.len(), "size": 1 });
        }
        FieldKind::Correlations => {
            trace["kind"] = json!("diverging");
            trace["type"] = json!("heatmap");
            trace["z"] = json!(field.z);
            trace["zmin"] = json!(-1.0);
            trace["zmax"] = json!(1.0);
            trace["texttemplate"] = json!("%{z:.2f}");
            trace["hovertemplate"] = json!("%{x}, %{y}: %{z:.3f}<extra></extra>");
        }
        FieldKind::Diverging { middle, reach } => {
            trace["kind"] = json!("diverging");
            trace["type"] = json!("heatmap");
            trace["z"] = json!(field.z);
            trace["zmin"] = json!(middle - reach);
            trace["zmax"] = json!(middle + reach);
            trace["showscale"] = json!(true);
            trace["colorbar"] = json!({
                "orientation": "h", "x": 0.5, "xanchor": "center", "y": 1.02, "yanchor": "bottom",
                "thickness": 12, "outlinewidth": 0,
            });
            trace["hovertemplate"] = json!("%{x:.3g}, %{y:.3g}: %{z:.1f}<extra></extra>");
        }
    }
    trace
}

/// Probability contents of the contour lines.
const REGIONS: [f64; 3] = [0.5, 0.9, 0.99];

/// plotly.js draws contour lines at even steps, so contents are mapped to 1, 2, 3 at [`REGIONS`], linear between.
fn step(content: f64) -> f64 {
    let ends = [0.0, REGIONS[0], REGIONS[1], REGIONS[2], 1.0];
    let inside = ends[1..].partition_point(|&end| end <= content).min(3);
    let (from, to) = (ends[inside], ends[inside + 1]);
    inside as f64 + (content - from) / (to - from)
}

fn annotation(note: &Note, panel: &Panel, figure: &Figure, number: &str) -> Value {
    json!({
        "text": escaped(&note.text),
        "x": scaled(&figure.x, note.x),
        "y": scaled(&panel.y, note.y),
        "xref": "x",
        "yref": format!("y{number}"),
        "ax": note.away.0,
        "ay": note.away.1,
        "showarrow": note.away != (0.0, 0.0),
        "arrowhead": 2,
        "arrowsize": 0.8,
        "arrowwidth": 1.2,
        "align": "left",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(figure: &Figure) -> Value {
        serde_json::from_str(&figure.to_json()).unwrap()
    }

    // One trace for each series, the types of the axes, five digits, and tags in names escaped.
    #[test]
    fn series_and_axes_reach_the_plot() {
        let series = vec![
            Series::of_points("<b>one", Marks::Line, [(0.1, 1.234_567), (0.2, 2e-9)]),
            Series::of_points("two", Marks::Points, [(1.0, 0.0)]).hue(Hue::Model),
            Series::of_points("", Marks::Dashes, [(1.0, 0.0)]),
        ];
        let y = Axis::titled("|J| (%)").logarithmic();
        let json = parsed(&Figure::single(
            "",
            Axis::titled("time (s)"),
            Panel::new(y, series),
        ));
        assert_eq!(json["data"][0]["y"], json!([1.2346, 2e-9]));
        assert_eq!(json["data"][0]["name"], "&lt;b&gt;one");
        assert_eq!(json["data"][1]["mode"], "markers");
        assert_eq!(json["data"][1]["hue"], "model");
        assert_eq!(json["data"][2]["showlegend"], false);
        assert_eq!(json["layout"]["yaxis"]["type"], "log");
        assert_eq!(json["layout"]["xaxis"]["type"], "linear");
        assert_eq!(json["layout"]["showlegend"], true);
    }

    // Two panels share the x axis, which is drawn under the lower one. On a logarithmic axis, notes and ranges are given
    // by their logarithms: 100 is 2.
    #[test]
    fn panels_stand_above_each_other() {
        let mut upper = Panel::new(Axis::titled("a").logarithmic(), vec![]);
        upper.notes.push(Note {
            text: "here".to_owned(),
            x: 3.0,
            y: 100.0,
            away: (10.0, 0.0),
        });
        let lower = Panel::new(Axis::titled("b").spanning(-1.0, 4.0), vec![]);
        let x = Axis::titled("t").logarithmic().spanning(0.1, 1000.0);
        let figure = Figure::stacked("", x, vec![upper, lower]);
        assert_eq!(figure.shape, Shape::Tall);
        let json = parsed(&figure);
        let layout = &json["layout"];
        assert_eq!(layout["xaxis"]["anchor"], "y2");
        assert_eq!(layout["xaxis"]["range"], json!([-1.0, 3.0]));
        assert_eq!(layout["yaxis2"]["range"], json!([-1.0, 4.0]));
        // Four decades: one label each.
        assert_eq!(layout["xaxis"]["dtick"], 1.0);
        assert_eq!(layout["yaxis2"]["dtick"], Value::Null);
        assert_eq!(layout["annotations"][0]["y"], 2.0);
        assert_eq!(layout["annotations"][0]["yref"], "y");
        let top = layout["yaxis2"]["domain"][1].as_f64().unwrap();
        assert!(layout["yaxis"]["domain"][0].as_f64().unwrap() > top);
    }

    // 50, 90 and 99 % are mapped to 1, 2 and 3; half way from 50 to 90 % to 1.5.
    #[test]
    fn regions_are_even_steps() {
        for (content, expected) in [
            (0.0, 0.0),
            (0.5, 1.0),
            (0.7, 1.5),
            (0.9, 2.0),
            (0.99, 3.0),
            (1.0, 4.0),
        ] {
            assert!((step(content) - expected).abs() < 1e-12, "{content}");
        }
        let field = Field {
            kind: FieldKind::Regions,
            x: Places::Numbers(vec![1.0, 2.0]),
            y: Places::Names(vec!["a".to_owned()]),
            z: vec![vec![0.5, 0.9]],
        };
        let panel = Panel {
            field: Some(field),
            ..Panel::default()
        };
        let json = parsed(&Figure::single("", Axis::default(), panel));
        assert_eq!(json["data"][0]["z"], json!([[1.0, 2.0]]));
        assert_eq!(json["data"][0]["y"], json!(["a"]));
    }
}
