//! Draws the picture of the README: `cargo run --release -p onecycle-lab --example picture`.
//!
//! An identification of a simulated relay test: the oscillation with the model's fit over it, and
//! the step that its controller will give.

use onecycle_lab::identify::{FitPoint, Identification, Options, Signals, identify};
use onecycle_lab::step_response;
use onecycle_onboard::{Process, Relay, RelaySettings};
use onecycle_plant::{Experiment, Trace};
use plotters::prelude::*;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

const OUT: &str = "docs/picture.svg";
const SIZE: (u32, u32) = (960, 380);
const MEASURED: RGBColor = RGBColor(150, 160, 175);
const FITTED: RGBColor = RGBColor(200, 70, 40);
const RELAY: RGBColor = RGBColor(60, 110, 190);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let trace = experiment()?;
    let found = identify(
        &Signals {
            time_s: &trace.time_s,
            input: &trace.input,
            output: &trace.output,
            samples_per_point: 1,
            sample_period_s: 1e-3,
            breaks: &[],
        },
        &Options {
            cycles: 3,
            ..Options::default()
        },
    );
    let root = SVGBackend::new(OUT, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(580);
    draw_cycle(&left, &trace, &found)?;
    draw_step(&right, &found)?;
    root.present()?;
    Ok(())
}

/// The paper's hovering quadrotor under the relay, with 2 % noise and a bias of 0.3 h.
fn experiment() -> Result<Trace, Box<dyn std::error::Error>> {
    let process = Process::new(1.0, 0.0321, 1.6886, 0.0237)?;
    let mut experiment = Experiment::new(process, 1e-3, 8.0);
    experiment.input_bias = 0.3;
    experiment.sensor.noise_sigma = 6e-5;
    let mut settings = RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA);
    settings.preroll_s = 0.1;
    settings.trim_gain = RelaySettings::TRIM_GAIN;
    let mut relay = Relay::new(settings)?;
    Ok(experiment.run(&mut relay, &mut Pcg64Mcg::seed_from_u64(1)))
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw_cycle(
    area: &Area<'_>,
    trace: &Trace,
    found: &Identification,
) -> Result<(), Box<dyn std::error::Error>> {
    let fit: &[FitPoint] = found
        .outcome
        .as_ref()
        .map_or(&[], |identified| &identified.fit);
    let (Some(first), Some(last)) = (fit.first(), fit.last()) else {
        return Ok(());
    };
    let period_s = found
        .oscillation
        .map_or(0.0, |oscillation| oscillation.period_s);
    let times = first.time_s - period_s..last.time_s + 0.25 * period_s;
    let inside = |t: &f64| times.contains(t);
    let mut chart = ChartBuilder::on(area)
        .caption(
            "A relay test, and the process fitted to three of its cycles",
            ("sans-serif", 17),
        )
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(16)
        .build_cartesian_2d(times.clone(), -7.6..5.2)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc("time (s)")
        .y_labels(0)
        .draw()?;
    let measured = trace
        .time_s
        .iter()
        .zip(&trace.output)
        .filter(|(t, _)| inside(t))
        .step_by(2);
    chart
        .draw_series(measured.map(|(&t, &y)| Circle::new((t, 1e3 * y), 1.5, MEASURED.filled())))?;
    chart.draw_series(LineSeries::new(
        fit.iter().map(|point| (point.time_s, 1e3 * point.fitted)),
        FITTED.stroke_width(2),
    ))?;
    let relay = trace
        .time_s
        .iter()
        .zip(&trace.input)
        .filter(|(t, _)| inside(t));
    chart.draw_series(LineSeries::new(
        relay.map(|(&t, &u)| (t, -5.9 + u)),
        RELAY.stroke_width(2),
    ))?;
    for (text, y, color) in [
        ("output: measured", 4.9, MEASURED),
        ("output: fitted", 4.3, FITTED),
        ("relay", -4.4, RELAY),
    ] {
        let style = ("sans-serif", 14).into_font().color(&color);
        chart.draw_series(std::iter::once(Text::new(text, (times.start, y), style)))?;
    }
    Ok(())
}

fn draw_step(area: &Area<'_>, found: &Identification) -> Result<(), Box<dyn std::error::Error>> {
    let Ok(identified) = &found.outcome else {
        return Ok(());
    };
    let response = step_response(&identified.refined.process, identified.controller.pd)?;
    let mut chart = ChartBuilder::on(area)
        .caption(
            "The step its optimal controller will give",
            ("sans-serif", 17),
        )
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(30)
        .build_cartesian_2d(0.0..0.8, 0.0..1.25)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc("time (s)")
        .x_labels(5)
        .y_labels(6)
        .draw()?;
    chart.draw_series(LineSeries::new(
        [(0.0, 1.0), (0.8, 1.0)],
        MEASURED.stroke_width(1),
    ))?;
    let points = response
        .samples
        .iter()
        .take_while(|sample| sample.t_s <= 0.8);
    chart.draw_series(LineSeries::new(
        points.map(|sample| (sample.t_s, sample.y)),
        FITTED.stroke_width(2),
    ))?;
    let process = &identified.refined.process;
    let pd = identified.controller.pd;
    for (row, text) in [
        format!(
            "T_prop {:.1} ms, tau {:.1} ms",
            1e3 * process.t_prop_s(),
            1e3 * process.tau_s()
        ),
        format!("K/T_body {:.3}", process.k_over_t_body()),
        format!("Kp {:.1}, Kd {:.1}", pd.kp, pd.kd),
    ]
    .into_iter()
    .enumerate()
    {
        let style = ("sans-serif", 14).into_font().color(&BLACK);
        chart.draw_series(std::iter::once(Text::new(
            text,
            (0.33, 0.5 - 0.1 * row as f64),
            style,
        )))?;
    }
    Ok(())
}
