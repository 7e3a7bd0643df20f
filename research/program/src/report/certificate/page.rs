//! A certificate as a page: where relay and processes meet, by the describing function and exactly, and the least stable
//! process under a bias.

use std::f64::consts::TAU;

use onecycle_cli::pages::page::{self, Section, page};
use onecycle_cli::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series, Shape};
use onecycle_cli::report::number::significant;
use onecycle_lab::space::certificate::{Certificate, CertificateSummary};
use onecycle_onboard::Soiptd;

use super::{cycle_count, error, holds_text, percent, span_of_ratios, stretch};
use crate::results::certify::{BiasRow, CertifiedSpace};

/// Part of the complex plane that is shown at least, in units of the oscillation's `|G|`, and the radius beyond which
/// nothing is drawn.
const FAR: f64 = 8.0;
const REAL: (f64, f64) = (-2.3, 0.5);
const IMAGINARY: (f64, f64) = (-1.1, 1.2);
/// Frequencies of a locus, over that of the describing function.
const FREQUENCIES: (f64, f64) = (0.3, 8.0);
const LOCUS_POINTS: i32 = 400;

/// Range of the axis of deviations left after a cycle; larger and smaller ones are drawn at its ends.
const LEFT: (f64, f64) = (0.003, 10.0);

/// The page of a certified space.
pub(crate) fn html(certified: &CertifiedSpace) -> String {
    let space = &certified.space;
    let worst = &certified.least_stable;
    let [t_prop, t_body, tau] = worst.times_s.map(significant);
    let range = |(low, high): (f64, f64)| format!("{low} .. {high} s");
    let lead = page::verdict(certified.holds(), holds_text(certified.holds()))
        + &page::paragraph(
            "lead",
            "Limit cycles of the relay on every shape of process of the space: exact, with the part of a small deviation \
             that is left after one cycle. Below 100 % the cycle is stable. The time scale plays no part.",
        )
        + &page::facts(&[
            ("T_prop", range(space.t_prop_s)),
            ("T_body", range(space.t_body_s)),
            ("tau", range(space.tau_s)),
            (
                "relay",
                format!(
                    "beta {}, {:.2} deg",
                    space.beta,
                    space.beta.asin().to_degrees()
                ),
            ),
            (
                "least stable",
                format!(
                    "T_prop {t_prop} s, T_body {t_body} s, tau {tau} s: {} left after a cycle",
                    percent(worst.spectral_radius)
                ),
            ),
            (
                "describing function",
                format!(
                    "exact period over its own {}, amplitude {}",
                    span_of_ratios(certified, |(period, _)| period),
                    span_of_ratios(certified, |(_, amplitude)| amplitude)
                ),
            ),
        ]);
    let sections = [
        Section::new(
            "corners",
            "Corners of the space",
            page::figure(&loci(certified)) + &corners(certified),
        ),
        Section::new(
            "bias",
            "Under a bias",
            page::figure(&stability(certified)) + &biases(&certified.rows),
        ),
    ];
    page("Certificate of a space of processes", &lead, &sections)
}

fn loci(certified: &CertifiedSpace) -> Figure {
    let beta = certified.space.beta;
    let is_near = |&(x, y): &(f64, f64)| f64::hypot(x, y) < FAR;
    let loci: Vec<Locus> = certified.corners.iter().filter_map(Locus::of).collect();
    let (from, to) = (FREQUENCIES.0.ln(), FREQUENCIES.1.ln());
    let frequencies = || {
        let parts = (0..=LOCUS_POINTS).map(|k| f64::from(k) / f64::from(LOCUS_POINTS));
        parts.map(|part| (from + (to - from) * part).exp())
    };
    let mut series: Vec<Series> = (loci.iter().enumerate())
        .map(|(index, locus)| {
            let name = if index == 0 { "processes, G(jw)" } else { "" };
            let points = frequencies().map(|frequency| locus.at(frequency));
            Series::of_points(name, Marks::Line, points.filter(is_near)).hue(Hue::Reference)
        })
        .collect();
    // -1/N(a) = -pi a / (4 h) (sqrt(1 - beta^2) + j beta), a ray from the origin.
    let (x, y) = (-(1.0 - beta * beta).sqrt(), -beta);
    let ray = [(0.0, 0.0), (FAR * x, FAR * y)];
    series.push(Series::of_points("relay, -1/N(a)", Marks::Line, ray).hue(Hue::Input));
    let crossing = Series::of_points("describing function", Marks::Rings, [(x, y)]);
    series.push(crossing.hue(Hue::Input));
    let exact = loci.iter().filter_map(Locus::exact);
    series.push(Series::of_points("exact limit cycles", Marks::Rings, exact).hue(Hue::Model));
    Figure::single(
        "Nyquist plots of the processes at the corners, over |G| at the oscillation of the describing function, and the \
         relay. The describing function predicts the oscillation where both meet; the fundamentals of the exact limit \
         cycles lie beside it.",
        Axis::titled("real part").spanning(REAL.0, REAL.1),
        Panel::new(
            Axis::titled("imaginary part").spanning(IMAGINARY.0, IMAGINARY.1),
            series,
        ),
    )
    .shaped(Shape::ToScale)
}

/// `G(jw)` of a process in units of the oscillation of the describing function.
struct Locus {
    process: Soiptd,
    omega: f64,
    magnitude: f64,
    /// Frequency of the exact limit cycle, over that of the describing function.
    exact: Option<f64>,
}

impl Locus {
    fn of(certificate: &Certificate) -> Option<Self> {
        let (period_s, _) = certificate.describing_function?;
        let [t_prop_s, t_body_s, tau_s] = certificate.times_s;
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).ok()?;
        let omega = TAU / period_s;
        Some(Self {
            magnitude: process.magnitude(omega),
            process,
            omega,
            exact: certificate
                .unbiased
                .map(|cycle| period_s / cycle.period_s()),
        })
    }

    fn at(&self, frequency: f64) -> (f64, f64) {
        let omega = frequency * self.omega;
        let (sin, cos) = self.process.phase_rad(omega).sin_cos();
        let magnitude = self.process.magnitude(omega) / self.magnitude;
        (magnitude * cos, magnitude * sin)
    }

    fn exact(&self) -> Option<(f64, f64)> {
        self.exact.map(|frequency| self.at(frequency))
    }
}

fn stability(certified: &CertifiedSpace) -> Figure {
    let biases = || certified.rows.iter().map(|row| row.summary.bias);
    let low = biases().fold(0.0, f64::min);
    let high = biases().fold(0.1, f64::max);
    let curve = |name, radius: fn(&CertificateSummary) -> Option<f64>| {
        let points = certified.rows.iter().filter_map(move |row| {
            let left = radius(&row.summary)?.clamp(LEFT.0, LEFT.1);
            Some((row.summary.bias, left))
        });
        Series::of_points(name, Marks::LineAndPoints, points)
    };
    let limit = Series::of_points(
        "limit of stability",
        Marks::Dashes,
        [(low, 1.0), (high, 1.0)],
    );
    Figure::single(
        "Largest part of a deviation that is left after a cycle, of all shapes. The relay turns back: without trim, the \
         side that the bias delays switches with half the lead each time; of its cycles the most stable counts.",
        Axis::titled("bias (relay amplitudes)"),
        Panel::new(
            Axis::titled("deviation left after a cycle")
                .logarithmic()
                .spanning(LEFT.0, LEFT.1),
            vec![
                limit.hue(Hue::Reference),
                curve("bare relay", |summary| summary.bare.radius).hue(Hue::Input),
                curve("with trim", |summary| summary.trimmed_radius).hue(Hue::Model),
                curve("relay turning back", |summary| {
                    summary.turned_back.best_radius
                })
                .hue(Hue::Measured),
            ],
        ),
    )
}

fn corners(certified: &CertifiedSpace) -> String {
    let columns = [
        "T_prop, T_body, tau (s)",
        "period (s)",
        "describing function off by",
        "amplitude",
        "describing function off by",
        "left after a cycle",
    ];
    let rows = certified.corners.iter().map(|certificate| {
        let name = certificate.times_s.map(|time_s| time_s.to_string());
        let ratios = certificate.describing_function_ratios();
        let cells = match certificate.unbiased.zip(ratios) {
            Some((cycle, (period, amplitude))) => [
                significant(cycle.period_s()),
                error(period),
                significant(cycle.amplitude),
                error(amplitude),
                percent(cycle.spectral_radius),
            ],
            None => ["no limit cycle", "-", "-", "-", "-"].map(str::to_owned),
        };
        (name.join(", "), cells)
    });
    page::plain_table(
        "Exact limit cycles, velocity gain and relay amplitude 1",
        &columns,
        rows,
    )
}

fn biases(rows: &[BiasRow]) -> String {
    let processes = rows.first().map_or(0, |row| row.summary.processes);
    let columns = [
        "bias",
        "bare relay: stable",
        "unstable",
        "no cycle",
        "periods",
        "turning back: cycles",
        "periods",
        "trim: stable",
        "left after a cycle",
        "simulation settled",
        "with trim",
    ];
    let rows = rows.iter().map(|row| {
        let summary = &row.summary;
        let cells = [
            (summary.bare.stable + summary.bare.coexisting).to_string(),
            summary.bare.unstable.to_string(),
            summary.bare.no_cycle.to_string(),
            stretch(&summary.bare),
            cycle_count(summary),
            stretch(&summary.turned_back),
            summary.trimmed.to_string(),
            summary.trimmed_radius.map_or("-".to_owned(), percent),
            row.settled[0].to_string(),
            row.settled[1].to_string(),
        ];
        (summary.bias.to_string(), cells)
    });
    let caption =
        format!("Counts of {processes} processes; stable periods over those without bias");
    page::plain_table(&caption, &columns, rows)
}
