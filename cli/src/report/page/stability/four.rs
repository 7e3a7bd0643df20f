//! The gang of four: how reference, load and noise reach output and input.

use super::Loop;
use crate::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series, Shape};

/// Title, caption and hue of each function.
const FOUR: [(&str, &str, Hue); 4] = [
    (
        "|S|",
        "Sensitivity S = 1/(1 + L): error by reference.",
        Hue::Model,
    ),
    (
        "|T|",
        "Complementary sensitivity T = L/(1 + L): output by noise.",
        Hue::Model,
    ),
    (
        "|P S|",
        "Output by load at the input of the process.",
        Hue::Measured,
    ),
    ("|C S|", "Input by measurement noise.", Hue::Input),
];

pub(super) fn figures(of: &Loop) -> [Figure; 4] {
    let values: Vec<[f64; 4]> = (of.omegas_rad_per_s.iter().zip(&of.own))
        .map(|(&omega, at)| {
            let (size, cos) = (at.magnitude, at.phase_rad.cos());
            // |1 + L|^2 = 1 + 2 |L| cos(arg L) + |L|^2.
            let sensitivity = 1.0 / (1.0 + 2.0 * size * cos + size * size).sqrt();
            let controller = of.controller.frequency_response(omega).norm();
            let process = of.model.frequency_response(omega).norm();
            [1.0, size, process, controller].map(|factor| factor * sensitivity)
        })
        .collect();
    std::array::from_fn(|k| {
        let (title, caption, hue) = FOUR[k];
        let points = of.omegas_rad_per_s.iter().copied();
        let curve = points.zip(values.iter().map(|of| of[k]));
        let series = Series::of_points("", Marks::Line, curve).hue(hue);
        let panel = Panel::new(Axis::titled(title).logarithmic(), vec![series]);
        let x = Axis::titled("frequency (rad/s)").logarithmic();
        Figure::single(caption, x, panel).shaped(Shape::Small)
    })
}
