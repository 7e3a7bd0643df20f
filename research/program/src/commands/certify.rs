//! `onecycle-lab certify`: exact limit cycles of the relay on every process of a space, and their stability.

use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::experiments::{Campaign, Measure};
use onecycle_lab::judge::outcome::relay_outcome;
use onecycle_lab::space::Space;
use onecycle_lab::space::certificate::{Certificate, CertificateSummary};
use onecycle_lab::space::limit_cycle::sampled::{motion, symmetric_cycles};
use onecycle_lab::space::surface::Direction;
use onecycle_onboard::Soiptd;

use crate::args::Certify;
use crate::output::{Waiting, print, write_text};
use crate::report::certificate;
use crate::results::certify::{BiasRow, CertifiedProcess, CertifiedSpace, SampledRelay};
use crate::settings;
use crate::workers::Workers;

pub(crate) fn run(arguments: &Certify) -> Result<ExitCode, Failure> {
    let space = settings::space(arguments.space.as_deref())?;
    if !arguments.process.is_empty() {
        let waiting = Waiting::on("computing limit cycles");
        let processes = (arguments.process.iter())
            .map(|times| process(arguments, times.0, space.beta))
            .collect::<Result<Vec<_>, Failure>>()?;
        drop(waiting);
        print(&certificate::processes(&processes))?;
        return Ok(ExitCode::from(exit::DONE));
    }
    let certified = certify(arguments, space)?;
    if let Some(path) = &arguments.report {
        write_text(path, &certificate::html(&certified))?;
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

/// Ratio of the start points of the search for the least stable process to the shapes, along each coordinate.
const FINER: usize = 2;

fn certify(arguments: &Certify, space: Space) -> Result<CertifiedSpace, Failure> {
    let side = arguments.shapes as usize;
    let shapes = space.shapes(side, side);
    let biases = arguments.biases();
    // One certificate of each shape without bias; one and two simulations under each bias.
    let workers = Workers::new(None)?;
    workers.expect((1 + 3 * biases.len()) * shapes.len(), 0);
    let least_stable = space
        .least_stable(FINER * side, FINER * side)
        .ok_or_else(|| Failure::usage("there is no process in this space"))?;
    let certified = CertifiedSpace {
        space,
        least_stable,
        unbiased: certificates(&space, &shapes, 0.0, &workers)?,
        corners: corners(&space)?,
        rows: biases
            .iter()
            .map(|&bias| row(&space, &shapes, bias, &workers))
            .collect::<Result<_, _>>()?,
    };
    workers.finish();
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

fn row(
    space: &Space,
    shapes: &[Direction],
    bias: f64,
    workers: &Workers,
) -> Result<BiasRow, Failure> {
    let certificates = certificates(space, shapes, bias, workers)?;
    let mut settled = [0; 2];
    for (settled, trim) in settled.iter_mut().zip([false, true]) {
        let all = workers.run(certificates.len(), |k| {
            settles(space, &certificates[k], trim).map(usize::from)
        });
        *settled = all.into_iter().sum::<Result<usize, Failure>>()?;
    }
    Ok(BiasRow {
        summary: CertificateSummary::of(bias, &certificates),
        settled,
    })
}

fn certificates(
    space: &Space,
    shapes: &[Direction],
    bias: f64,
    workers: &Workers,
) -> Result<Vec<Certificate>, Failure> {
    let middles = shapes
        .iter()
        .filter_map(|&shape| space.middle_of_ray(shape));
    let times_s: Vec<[f64; 3]> = middles.collect();
    let certificates = workers.run(times_s.len(), |k| {
        Certificate::new(times_s[k], space.beta, bias).map_err(Failure::usage)
    });
    certificates.into_iter().collect()
}

/// Period that a simulated oscillation is scaled to (s): 400 samples at the 1 kHz of campaigns.
const SIMULATED_PERIOD_S: f64 = 0.4;
/// Noise of the simulation, as a fraction of the amplitude: that of a good sensor.
const SIMULATED_SIGMA: f64 = 0.01;

/// Whether the simulated on-board relay, from rest, reaches a steady oscillation within the 40 periods of a campaign.
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

/// A process under every bias.
fn process(arguments: &Certify, times_s: [f64; 3], beta: f64) -> Result<CertifiedProcess, Failure> {
    let [t_prop_s, t_body_s, tau_s] = times_s;
    let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).map_err(Failure::usage)?;
    let under = |bias: f64| -> Result<_, Failure> {
        let certificate = Certificate::new(times_s, beta, bias).map_err(Failure::usage)?;
        let sampled =
            (arguments.sample_rate).map(|rate_hz| sampled(&process, beta, bias, 1.0 / rate_hz));
        Ok((certificate, sampled))
    };
    Ok(CertifiedProcess {
        times_s,
        beta,
        biases: (arguments.biases().into_iter())
            .map(under)
            .collect::<Result<_, _>>()?,
    })
}

fn sampled(process: &Soiptd, beta: f64, bias: f64, sample_s: f64) -> SampledRelay {
    SampledRelay {
        sample_s,
        cycles: if bias == 0.0 {
            symmetric_cycles(process, beta, sample_s)
        } else {
            vec![]
        },
        motion: motion(process, [beta; 2], bias, sample_s),
    }
}
