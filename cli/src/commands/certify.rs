//! `onecycle certify`: does the relay make every process of a space oscillate, once and stably?

use std::process::ExitCode;

use indicatif::ProgressBar;
use onecycle_lab::experiments::{Campaign, Measure};
use onecycle_lab::judge::outcome::relay_outcome;
use onecycle_lab::space::Space;
use onecycle_lab::space::certificate::{Certificate, CertificateSummary, LeastStable};
use onecycle_lab::space::surface::Direction;
use onecycle_onboard::Soiptd;
use rayon::prelude::*;

use crate::args::Certify;
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print, progress_bar};
use crate::pictures::certify::draw;
use crate::report::certificate;
use crate::settings;

/// Under one bias: what is certified, and in how many cases a simulation of the relay of the board
/// came to a steady oscillation, without trim and with it.
pub(crate) struct Row {
    pub(crate) summary: CertificateSummary,
    pub(crate) settled: [usize; 2],
}

/// What is certified of a space.
pub(crate) struct Certified {
    pub(crate) space: Space,
    pub(crate) least_stable: LeastStable,
    /// Without bias, of every shape.
    pub(crate) unbiased: Vec<Certificate>,
    /// Without bias, at the corners of the box.
    pub(crate) corners: Vec<Certificate>,
    pub(crate) rows: Vec<Row>,
}

impl Certified {
    /// Whether every process has a stable cycle without bias and, within the trim's limit, with the
    /// trim under every bias.
    pub(crate) fn holds(&self) -> bool {
        self.least_stable.spectral_radius < 1.0
            && self
                .rows
                .iter()
                .all(|row| row.summary.trimmed == row.summary.processes)
    }
}

pub(crate) fn run(arguments: &Certify) -> Result<ExitCode, Failure> {
    let space = settings::space(arguments.space.as_deref())?;
    if !arguments.process.is_empty() {
        let waiting = Waiting::on("looking for limit cycles");
        let report = certificate::processes(arguments, &space)?;
        drop(waiting);
        print(&report)?;
        return Ok(ExitCode::from(exit::DONE));
    }
    let certified = certify(arguments, space)?;
    if let Some(path) = &arguments.picture {
        draw(path, &certified)?;
    }
    print(&if arguments.json {
        certificate::json(&certified)
    } else {
        certificate::text(&certified)
    })?;
    Ok(ExitCode::from(if certified.holds() {
        exit::DONE
    } else {
        exit::NO_PROCESS
    }))
}

/// Points of the climb's first lattice for each shape of the campaign's, along either coordinate.
const FINER: usize = 2;

fn certify(arguments: &Certify, space: Space) -> Result<Certified, Failure> {
    let side = arguments.shapes as usize;
    let shapes = space.shapes(side, side);
    let biases = arguments.biases();
    // A certificate of each without bias; under each bias one, and two simulations.
    let bar = progress_bar(((1 + 3 * biases.len()) * shapes.len()) as u64);
    let least_stable = space
        .least_stable(FINER * side, FINER * side)
        .ok_or_else(|| Failure::usage("the space has no process"))?;
    let certified = Certified {
        space,
        least_stable,
        unbiased: certificates(&space, &shapes, 0.0, &bar)?,
        corners: corners(&space)?,
        rows: biases
            .iter()
            .map(|&bias| row(&space, &shapes, bias, &bar))
            .collect::<Result<_, _>>()?,
    };
    bar.finish_and_clear();
    Ok(certified)
}

fn corners(space: &Space) -> Result<Vec<Certificate>, Failure> {
    let [t_prop_s, t_body_s, tau_s] = space.ranges_s().map(|(low, high)| [low, high]);
    let mut corners = Vec::new();
    for t_prop_s in t_prop_s {
        for t_body_s in t_body_s {
            for tau_s in tau_s {
                corners.push([t_prop_s, t_body_s, tau_s]);
            }
        }
    }
    corners.dedup();
    corners
        .into_iter()
        .map(|times_s| Certificate::new(times_s, space.beta, 0.0).map_err(Failure::usage))
        .collect()
}

fn row(space: &Space, shapes: &[Direction], bias: f64, bar: &ProgressBar) -> Result<Row, Failure> {
    let certificates = certificates(space, shapes, bias, bar)?;
    let mut settled = [0; 2];
    for (settled, trim) in settled.iter_mut().zip([false, true]) {
        *settled = certificates
            .par_iter()
            .map(|certificate| {
                let settles = settles(space, certificate, trim);
                bar.inc(1);
                settles.map(usize::from)
            })
            .sum::<Result<usize, Failure>>()?;
    }
    Ok(Row {
        summary: CertificateSummary::of(bias, &certificates),
        settled,
    })
}

fn certificates(
    space: &Space,
    shapes: &[Direction],
    bias: f64,
    bar: &ProgressBar,
) -> Result<Vec<Certificate>, Failure> {
    shapes
        .par_iter()
        .filter_map(|&shape| space.middle_of_ray(shape))
        .map(|times_s| {
            let certificate = Certificate::new(times_s, space.beta, bias).map_err(Failure::usage);
            bar.inc(1);
            certificate
        })
        .collect()
}

/// Period (s) that a simulated oscillation is scaled to: 400 samples at the campaign's 1 kHz.
const SIMULATED_PERIOD_S: f64 = 0.4;
/// Noise of the simulation, as a part of the amplitude: that of a good sensor.
const SIMULATED_SIGMA: f64 = 0.01;

/// Whether the relay of the board, from rest, comes to a steady oscillation within the campaign's 40
/// periods of the describing function.
fn settles(space: &Space, certificate: &Certificate, trim: bool) -> Result<bool, Failure> {
    let Some((period_s, _)) = certificate.describing_function else {
        return Ok(false);
    };
    let campaign = Campaign {
        measure: Measure::Relay,
        trim,
        beta: space.beta,
        ..Campaign::QUIET
    };
    let [t_prop_s, t_body_s, tau_s] = certificate
        .times_s
        .map(|time_s| time_s * SIMULATED_PERIOD_S / period_s);
    let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).map_err(Failure::usage)?;
    let mut experiment = campaign
        .quiet_experiment(process, campaign.seed)
        .map_err(Failure::usage)?;
    experiment.input_bias = certificate.bias;
    experiment.noise_sigma = SIMULATED_SIGMA * experiment.oscillation.amplitude;
    let outcome = relay_outcome(&experiment).map_err(Failure::usage)?;
    Ok(outcome.steady_at.is_some())
}
