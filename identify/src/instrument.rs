//! Identification of a process in a closed loop by its set-point: the instrumental variable, at many frequencies.
//!
//! Whatever the output has beside the response to the input, noise or wind, has nothing to do with the set-point. So the
//! response `G` that leaves nothing in `y - G u` that is correlated with the set-point is the process, whatever the
//! controller and the noise are, and however unsteady the noise is. Steps:
//!
//! 1. [`spectra`]: cross-spectra with the set-point over some sixty short segments.
//! 2. [`fit`]: each structure at the least sum of squared errors; the deviation of each error comes from its scatter over
//!    the segments. A further parameter is taken if it lowers the sum by 2.7.
//!    Twice: the first fit tells the noise of each segment, which weights the set-point for the second.
//! 3. The sum is chi-squared for the right structure: a larger one refuses it, or widens the intervals.
//! 4. Posterior by a chain, controller, result.
//!
//! Reference: T. Soderstrom, P. Stoica, "Instrumental variable methods for system identification" (1983), and those of
//! [`fit`].

mod fit;
mod spectra;

use num_complex::Complex64;
use onecycle_design::{Linear, LowPass, Model, Parameter, Structure};

use self::fit::{Candidate, Problem};
use self::spectra::Spectra;
use crate::assumed::{RecordedLoop, recorded_filter};
use crate::checks;
use crate::conclusion::conclude;
use crate::excitation::{Excitation, Recorded};
use crate::innovations::{self, Hold, gain_of};
use crate::outcome::{Evidence, Fit, Identification, Identified, ResponsePoint, SetPointResponse};
use crate::posterior::{self, Posterior};
use crate::remark::Remark;
use crate::remarks;
use crate::settings::Options;
use crate::signals::{Signals, range};
use crate::thresholds::{CONTRADICTED, MOST_COST};
use crate::verdict::Verdict;

/// Decrease of the sum of squares from which a lag or damping shows: one chance in ten. A parameter that is missing makes the
/// others wrong and their intervals too narrow; one that is not needed only widens these.
const SHOWN: f64 = 2.7;
/// Golden ratio, whose multiples' fractions are even.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Least share of the posterior on each side of the best fit.
const LEAST_SIDE: f64 = 0.05;

/// Identifies the process from a record with its set-point, one value for each point.
///
/// `recorded`: what the likelihood found out about the record, if it was fitted before.
#[must_use]
pub fn identify_by_set_point(
    signals: &Signals<'_>,
    set_point: &[f64],
    options: &Options,
    recorded: Option<Recorded>,
) -> Identification {
    let mut search = Search {
        recorded: recorded.or_else(|| innovations::recorded(signals, options)),
        remarks: vec![],
    };
    let outcome = search.run(signals, set_point, options);
    match &outcome {
        Ok(identified) => remarks::of_controller(identified, &mut search.remarks),
        Err(_) => search.remarks.clear(),
    }
    let mut found = Identification {
        excitation: search.recorded.map(Excitation::Recorded),
        outcome,
        refused: None,
        steady: None,
        switching: None,
        amplitudes: None,
        remarks: search.remarks,
    };
    checks::check(signals, options, None, &mut found);
    found
}

/// Whether the response to the set-point asks for more than twice the gain of a model of another estimator, or for less than
/// half of it. `None`: the record has too few frequencies.
#[must_use]
pub fn contradicts_set_point(
    signals: &Signals<'_>,
    set_point: &[f64],
    options: &Options,
    model: &Model,
) -> Option<bool> {
    let spectra = spectra_of(signals, set_point, options)?;
    let problem = Problem {
        around: around(&spectra, signals, options),
        spectra: &spectra,
    };
    let process = model.linear();
    let least = |steps: &mut dyn Iterator<Item = i32>| {
        let costs = steps.map(|k| {
            let factor = (0.5 * f64::from(k)).exp2();
            problem.cost(&process.with_gain(process.gain() * factor))
        });
        costs.fold(f64::INFINITY, f64::min)
    };
    let near = least(&mut (-2..=2));
    let far = least(&mut (-14..-2).chain(3..15));
    Some(near > far + CONTRADICTED)
}

struct Search {
    recorded: Option<Recorded>,
    remarks: Vec<Remark>,
}

impl Search {
    fn run(
        &mut self,
        signals: &Signals<'_>,
        set_point: &[f64],
        options: &Options,
    ) -> Result<Identified, Verdict> {
        (options.specification.check()).map_err(Verdict::NoController)?;
        let spectra =
            spectra_of(signals, set_point, options).ok_or(Verdict::NotExcited { share: 0.0 })?;
        let around = around(&spectra, signals, options);
        let spectra = weighted(&spectra, &around, options.structure).ok_or(Verdict::NoFit)?;
        let problem = Problem {
            around,
            spectra: &spectra,
        };
        let (best, wider) = chosen(&problem, options.structure).ok_or(Verdict::NoFit)?;
        let ratio = best.cost / best.freedom(&spectra).max(1.0);
        if ratio > MOST_COST {
            return Err(Verdict::SetPointLeft { ratio });
        }
        if !has_delay(&best.point.process(), spectra.sample_s) {
            return Err(Verdict::AtBound(Parameter::Tau));
        }
        let band_rad_per_s = spectra.band_rad_per_s();
        self.remarks.push(Remark::BySetPoint {
            segments: spectra.segments,
            band_rad_per_s,
        });
        if let Some(recorded) = &mut self.recorded {
            recorded.informative_rad_per_s = Some(band_rad_per_s);
            recorded.excited_rad_per_s = Some(band_rad_per_s.1);
        }
        let widened = ratio.max(1.0);
        let process = best.point.process();
        // A response does not tell whether the input is held or runs straight from sample to sample: the dead time differs
        // by half a sample, of which the model takes the middle.
        let late_s = match options.hold {
            None => 0.5 * spectra.sample_s,
            Some(_) => 0.0,
        };
        let process = process.with_tau_s((process.tau_s() + 0.5 * late_s).max(0.0));
        let mut draws = problem.draws(&wider, widened, posterior::DRAWS);
        for (index, draw) in draws.iter_mut().enumerate() {
            let share = (index as f64 * GOLDEN).fract();
            *draw = draw.with_tau_s(draw.tau_s() + share * late_s);
        }
        if !is_amid(&best, &draws) {
            return Err(no_information(&best, None, band_rad_per_s));
        }
        let posterior = Posterior::of_draws(&process, &draws);
        let evidence = evidence(&problem, &best, widened.sqrt());
        let (low, high) = range(signals.input);
        let model = Model::from(process);
        let filter = (options.output_filter_hz)
            .filter(|hz| *hz > 0.0)
            .map(LowPass::second_order);
        let recorded = RecordedLoop {
            sigma: evidence.noise_sigma,
            output_size: self.recorded.map_or(0.0, |found| found.output_deviation),
            input_amplitude: 0.5 * (high - low),
            sample_s: signals.sample_period_s,
            hold: options.hold.unwrap_or(Hold::Held),
            excited_rad_per_s: Some(band_rad_per_s.1),
            filter: recorded_filter(filter, &model),
        };
        conclude(
            (model, posterior),
            recorded.complete(&options.specification),
            &mut self.remarks,
            |width| no_information(&best, width, band_rad_per_s),
            || {
                Some(Fit {
                    misfit: evidence.unexplained.sqrt(),
                    points: vec![],
                    evidence: Evidence::SetPoint(evidence),
                })
            },
        )
    }
}

/// The spectra with less weight on loud segments, by what a first fit leaves of the output. `None` if there is no fit.
fn weighted(
    spectra: &Spectra,
    around: &[Complex64],
    structure: Option<Structure>,
) -> Option<Spectra> {
    let problem = Problem {
        around: around.to_vec(),
        spectra,
    };
    let (first, _) = chosen(&problem, structure)?;
    Some(spectra.weighted(&first.point.process(), around))
}

/// Whether a process answers later than half a sample after its input. A loop that is faster than its log hides its delay, and
/// a controller for none would be too fast.
fn has_delay(process: &Linear, sample_s: f64) -> bool {
    let lags = process.structure().stages().lags;
    let lags_s: f64 = process.lags_s()[..lags].iter().sum();
    process.tau_s() + lags_s > 0.5 * sample_s
}

/// Whether the best fit lies amid the draws: otherwise the response has two explanations.
fn is_amid(best: &Candidate, draws: &[Linear]) -> bool {
    let gain = best.point.process().gain().abs();
    let below = draws.iter().filter(|draw| draw.gain().abs() < gain).count();
    let share = below as f64 / draws.len() as f64;
    (LEAST_SIDE..1.0 - LEAST_SIDE).contains(&share)
}

fn no_information(best: &Candidate, width: Option<f64>, band_rad_per_s: (f64, f64)) -> Verdict {
    Verdict::NoInformation {
        parameter: gain_of(best.structure()),
        deviation: width,
        informative_rad_per_s: Some(band_rad_per_s),
        needed_rad_per_s: band_rad_per_s.1,
    }
}

fn spectra_of(signals: &Signals<'_>, set_point: &[f64], options: &Options) -> Option<Spectra> {
    let (from_s, to_s) = options.span_s;
    let first = from_s.map_or(0, |from| signals.time_s.partition_point(|t| *t < from));
    let last = to_s.map_or(signals.time_s.len(), |to| {
        signals.time_s.partition_point(|t| *t <= to)
    });
    let earlier = (options.input_late_s).map(|late_s| signals.input_earlier(late_s));
    let corrected = Signals {
        input: earlier.as_deref().unwrap_or(signals.input),
        ..*signals
    };
    Spectra::new(&corrected, set_point, first..last.max(first))
}

/// Response of what lies between the process and the signals at each frequency: the input's hold, the mean over the samples
/// of a point, and a known filter of the output without its delay, which belongs to the dead time.
fn around(spectra: &Spectra, signals: &Signals<'_>, options: &Options) -> Vec<Complex64> {
    let count = signals.samples_per_point.max(1);
    let sample_s = signals.sample_period_s;
    let filter_rad_per_s = (options.output_filter_hz)
        .filter(|hz| *hz > 0.0)
        .map(|hz| std::f64::consts::TAU * hz);
    let at = |omega: f64| {
        let half = 0.5 * omega * spectra.sample_s;
        let sinc = half.sin() / half;
        let held = match options.hold.unwrap_or(Hold::Held) {
            Hold::Interpolated => Complex64::new(sinc * sinc, 0.0),
            _ => Complex64::from_polar(sinc, -half),
        };
        let turns = (0..count).map(|k| Complex64::cis(omega * sample_s * f64::from(k)));
        let mean = turns.sum::<Complex64>() / f64::from(count);
        let filter = filter_rad_per_s.map_or(Complex64::ONE, |cutoff| {
            let s = Complex64::new(0.0, omega / cutoff);
            let root = std::f64::consts::SQRT_2;
            (s * root).exp() / (s * s + s * root + 1.0)
        });
        held * mean * filter
    };
    let bins = spectra.bins.iter();
    bins.map(|bin| at(bin.omega_rad_per_s)).collect()
}

/// The structure that explains the response, and the fit with its damping as a further unknown.
fn chosen(problem: &Problem<'_>, asked: Option<Structure>) -> Option<(Candidate, Candidate)> {
    let spectra = problem.spectra;
    let has_few = |structure: &Structure| structure.stages().pairs == 0;
    let tried = (Structure::ALL.into_iter())
        .filter(|structure| asked.map_or_else(|| has_few(structure), |asked| asked == *structure));
    let mut candidates: Vec<Candidate> = Vec::new();
    for structure in tried {
        let found = problem.fit(structure, &candidates);
        candidates.extend(found);
    }
    let penalised = |candidate: &Candidate| candidate.cost - SHOWN * candidate.freedom(spectra);
    let simplest = (candidates.iter()).min_by(|a, b| penalised(a).total_cmp(&penalised(b)))?;
    let with_pole = match simplest.structure() {
        Structure::Iptd => Structure::Foptd,
        Structure::IntegratorLag => Structure::Soptd,
        _ => return Some((simplest.clone(), simplest.clone())),
    };
    let of_pole = (candidates.iter()).find(|candidate| candidate.structure() == with_pole);
    let damped = (of_pole.cloned()).or_else(|| problem.fit(with_pole, &candidates));
    let Some(damped) = damped else {
        return Some((simplest.clone(), simplest.clone()));
    };
    let shows = asked.is_none() && simplest.cost - damped.cost > SHOWN;
    let best = if shows { &damped } else { simplest };
    Some((best.clone(), damped.clone()))
}

fn evidence(problem: &Problem<'_>, best: &Candidate, widened: f64) -> SetPointResponse {
    let spectra = problem.spectra;
    let process = best.point.process();
    let mut squares = [0.0; 2];
    let points = (spectra.bins.iter().zip(&problem.around))
        .map(|(bin, around)| {
            let fitted = process.frequency_response(bin.omega_rad_per_s);
            let error = bin.output - fitted * around * bin.input;
            squares[0] += error.norm_sqr();
            squares[1] += bin.output.norm_sqr();
            let (response, deviation) = bin.response();
            ResponsePoint {
                omega_rad_per_s: bin.omega_rad_per_s,
                measured: response / around,
                deviation,
                fitted,
            }
        })
        .collect();
    SetPointResponse {
        points,
        segments: spectra.segments,
        chi_squared: best.cost,
        freedom: best.freedom(spectra),
        unexplained: squares[0] / squares[1],
        widened,
        noise_sigma: spectra.noise_sigma(&process, &problem.around),
    }
}
