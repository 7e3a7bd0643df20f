//! A grid as a page: the summary, its members on the surface of shapes and over the times, and the deterioration along
//! two rays, which decides the distance of neighbours (after the paper's figures 2 and 3).

use onecycle_cli::pages::page::{self, Section, page};
use onecycle_cli::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series, Shape};
use onecycle_lab::space::Space;
use onecycle_lab::space::surface::Direction;

use super::{check_facts, check_verdict, kind, members};
use crate::results::grid::{CostsAlongRay, GridRun};

/// Points on each side of the outline.
const POINTS: i32 = 200;
/// A dead time of zero is drawn as this part of the radius.
const NO_DELAY: f64 = 1e-5;
/// Range of the deterioration axis, in deteriorations of the grid.
const SHOWN: (f64, f64) = (-0.4, 2.5);

/// The page of a grid.
pub(crate) fn html(run: &GridRun) -> String {
    let settings = &run.grid.settings;
    let mut lead = page::paragraph(
        "lead",
        &format!(
            "Processes that represent a space: for every process of the space, the controller of one member costs at \
             most J* = {} % more than the optimum of that process. The cost is the integral of the squared error (ISE) \
             after a step of the reference. The radius of a process is r = sqrt(T_prop^2 + T_body^2 + tau^2); processes on \
             one ray have the same ratios of their times and differ in r only.",
            100.0 * settings.deterioration
        ),
    );
    if let Some(check) = &run.check {
        let (processes, seed) = (check.processes, check.seed);
        let found = check_verdict(check, settings.deterioration);
        let words = format!("{processes} random processes, seed {seed}. {found}");
        lead += &page::verdict(run.holds(), &words);
    }
    let range = |(low, high): (f64, f64)| format!("{low} .. {high} s");
    let margin = settings.space.phase_margin_deg;
    let mut facts = vec![
        ("T_prop", range(settings.space.t_prop_s)),
        ("T_body", range(settings.space.t_body_s)),
        ("tau", range(settings.space.tau_s)),
        ("phase margin", format!("at least {margin} deg")),
        ("relay beta", settings.space.beta.to_string()),
        ("grid", kind(settings)),
        ("members", members(&run.grid).join(", ")),
    ];
    facts.extend(run.check.iter().flat_map(check_facts));
    lead += &page::facts(&facts);
    let rays: Vec<Figure> = (run.rays.iter())
        .map(|ray| along(ray, run.grid.settings.deterioration))
        .collect();
    let times = [times(run, 0, 1), times(run, 0, 2)];
    let sections = [
        Section::new("shapes", "Shapes", page::figure(&shapes(run))),
        Section::new("times", "Times", page::row(&times)),
        Section::new("rays", "Along a ray", page::row(&rays)),
    ];
    page("A grid of processes", &lead, &sections)
}

/// Coordinates of a shape, `T_body / T_prop` and `tau / r`: their logarithms show every corner.
fn place(shape: Direction) -> (f64, f64) {
    let [t_prop, t_body, delay] = shape.at(1.0);
    (t_body / t_prop, delay.max(NO_DELAY))
}

/// The border of the space on the surface of shapes.
fn outline(space: &Space) -> Vec<(f64, f64)> {
    let parts = || (0..=POINTS).map(|k| f64::from(k) / f64::from(POINTS));
    let sides: [Vec<(f64, f64)>; 4] = [
        parts().map(|part| (part, 0.0)).collect(),
        parts().map(|part| (1.0, part)).collect(),
        parts().map(|part| (1.0 - part, 1.0)).collect(),
        parts().map(|part| (0.0, 1.0 - part)).collect(),
    ];
    sides
        .concat()
        .into_iter()
        .filter_map(|(across, along)| space.shape(across, along))
        .map(place)
        .collect()
}

fn shapes(run: &GridRun) -> Figure {
    let members = run.grid.members.iter();
    let mut shapes: Vec<Direction> = members.map(|member| member.direction).collect();
    shapes.dedup();
    let outline = outline(&run.grid.settings.space);
    let outline = Series::of_points("border of the space", Marks::Line, outline);
    let rays = Series::of_points("rays", Marks::Points, shapes.into_iter().map(place));
    Figure::single(
        "Rays of members on the surface of shapes.",
        Axis::titled("T_body / T_prop").logarithmic(),
        Panel::new(
            Axis::titled("tau / r").logarithmic(),
            vec![outline.hue(Hue::Reference), rays.hue(Hue::Model)],
        ),
    )
}

/// Members over two of their times.
fn times(run: &GridRun, x: usize, y: usize) -> Figure {
    let axis = |k: usize| {
        let title = format!("{} (s)", ["T_prop", "T_body", "tau"][k]);
        Axis::titled(title).logarithmic()
    };
    let members = run.grid.members.iter();
    let points = members.map(|member| {
        let times_s = member.candidate.times_s();
        (times_s[x], times_s[y])
    });
    let members = Series::of_points("", Marks::Points, points).hue(Hue::Model);
    let panel = Panel::new(axis(y), vec![members]);
    Figure::single("Members over their times.", axis(x), panel).shaped(Shape::Square)
}

/// Cost of neighbours on a ray for each other.
fn along(ray: &CostsAlongRay, deterioration: f64) -> Figure {
    let percent = 100.0 * deterioration;
    let curve = |name, costs: &[f64]| {
        let points = ray.ratios.iter().zip(costs);
        let points = points.map(|(ratio, cost)| (*ratio, 100.0 * cost));
        Series::of_points(name, Marks::Line, points)
    };
    let ends = ray.ratios.first().into_iter().chain(ray.ratios.last());
    let limit = Series::of_points("J*", Marks::Dashes, ends.map(|ratio| (*ratio, percent)));
    let panel = Panel::new(
        Axis::titled("deterioration (%)").spanning(SHOWN.0 * percent, SHOWN.1 * percent),
        vec![
            curve("J_ij: controller of i on j", &ray.own_on_other).hue(Hue::Model),
            curve("J_ji: controller of j on i", &ray.other_on_own).hue(Hue::Input),
            limit.hue(Hue::Reference),
        ],
    );
    let caption = format!("{}: members at ratios of {:.3}.", ray.name, ray.step);
    let figure = Figure::single(&caption, Axis::titled("ratio of the radii"), panel);
    figure.shaped(Shape::Square)
}
