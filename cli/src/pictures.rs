//! Pictures: SVG that needs no installed font, written whole or not at all.

pub(crate) mod certify;
pub(crate) mod grid;
pub(crate) mod phase;

use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::failure::Failure;
use crate::output::write_text;

/// What is drawn on.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// What drawing returns: writing to memory fails only where the drawing itself is wrong.
pub(crate) type Drawn = Result<(), Box<dyn std::error::Error>>;

/// What everything is measured against: data, frames, other people's numbers.
pub(crate) const GREY: RGBColor = RGBColor(150, 160, 175);
/// What the picture is about.
pub(crate) const RED: RGBColor = RGBColor(200, 70, 40);
/// What it is made of.
pub(crate) const BLUE: RGBColor = RGBColor(60, 110, 190);

/// The family that every viewer has, and the size of captions and of labels (pixels).
pub(crate) const FONT: &str = "sans-serif";
pub(crate) const CAPTION: (&str, u32) = (FONT, 17);
pub(crate) const LABEL: (&str, u32) = (FONT, 14);

/// Draws on a white area of `size` (pixels) and writes it to `path`.
pub(crate) fn write_svg(
    path: &Path,
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Drawn,
) -> Result<(), Failure> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE)
            .map_err(Into::into)
            .and_then(|()| draw(&area))
            .and_then(|()| area.present().map_err(Into::into))
            .map_err(|error| Failure::output(path, std::io::Error::other(error.to_string())))?;
    }
    write_text(path, &svg)
}

/// A number beside an axis, without the rounding of the steps that led to it.
pub(crate) fn tick(value: &f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}
