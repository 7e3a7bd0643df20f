//! Tables V and VI: one process, for several start values of the fit and several input biases.

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Marks, Series};
use onecycle_cli::report::cycles::cost_cell;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_identify::Signals;
use onecycle_lab::experiments::{Campaign, Recorded, RelayTest, Truth, signals_of};
use onecycle_lab::judge::baselines::pem;
use onecycle_lab::judge::baselines::pem::Data;
use onecycle_lab::judge::evaluate::{Contender, Judge, PHASE_MARGIN_DEG, Seen};
use onecycle_lab::paper::network::PaperNetwork;
use onecycle_onboard::Soiptd;
use onecycle_plant::Trace;
use serde::Deserialize;

use crate::results::reproduction::{Numbers, Row};
use crate::workers::Workers;

/// Sample period of the paper (s).
pub(super) const SAMPLE_S: f64 = 1e-3;

/// A process and its relay test.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Setup {
    /// `T_prop`, `T_body`, `tau` (s).
    times_s: [f64; 3],
    /// Standard deviation of the noise, as a fraction of the amplitude of the noise-free oscillation.
    sigma: f64,
    /// Seed of the noise.
    seed: u64,
    /// Whether the relay trims the bias.
    is_trimmed: bool,
    /// Duration, in periods of the oscillation.
    periods: f64,
}

impl Setup {
    /// Runs the relay test with an input bias (fraction of the relay's amplitude); returns the truth and the trace.
    pub(super) fn run(&self, input_bias: f64) -> Result<(Truth, Trace), Failure> {
        let [t_prop_s, t_body_s, tau_s] = self.times_s;
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).map_err(Failure::usage)?;
        let campaign = Campaign {
            seed: self.seed,
            bias: input_bias.abs(),
            sigma: self.sigma,
            trim: self.is_trimmed,
            ..Campaign::QUIET
        };
        let experiment = campaign.quiet_experiment(process, self.seed);
        let mut experiment = experiment.map_err(Failure::usage)?;
        experiment.input_bias = input_bias;
        experiment.noise_sigma = self.sigma * experiment.oscillation.amplitude;
        let (trace, _) = experiment.run(self.periods).map_err(Failure::usage)?;
        let truth = Truth {
            number: 1,
            process,
            input_bias,
            noise_sigma: experiment.noise_sigma,
            seed: self.seed,
            is_trimmed: self.is_trimmed,
        };
        Ok((truth, trace))
    }
}

/// Settings of Table V.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Starts {
    setup: Setup,
    /// Input bias, as a fraction of the relay's amplitude.
    input_bias: f64,
    /// Start values: `T_prop`, `T_body`, `tau` (s).
    starts_s: Vec<[f64; 3]>,
}

/// One process with both relay tests, and the judge of the answers.
struct Bench {
    judge: Judge,
    /// The test whose last cycle is set I.
    trace: Trace,
    /// Set II: the swept relay test.
    swept: Recorded,
}

impl Bench {
    fn new(setup: &Setup, input_bias: f64) -> Result<Self, Failure> {
        let (truth, trace) = setup.run(input_bias)?;
        let swept = truth.recorded_by(RelayTest::Swept);
        Ok(Self {
            judge: Judge::new(&truth.process).map_err(Failure::usage)?,
            trace,
            swept: swept
                .map_err(Failure::usage)?
                .ok_or_else(|| Failure::usage("there is no swept recording"))?,
        })
    }

    fn one(&self) -> Signals<'_> {
        signals_of(&self.trace, SAMPLE_S)
    }

    /// Cost of the answer of PEM from a start value: on set I, on set II, and on set I with the bias in the model.
    fn by_pem(&self, start_s: [f64; 3]) -> [Option<Deterioration>; 3] {
        let cases = [
            (self.one(), pem::PemSettings::paper(Data::LastCycle)),
            (self.swept.signals(), pem::PemSettings::paper(Data::Whole)),
            (self.one(), pem::PemSettings::fair()),
        ];
        cases.map(|(signals, settings)| {
            let settings = pem::PemSettings {
                starts_s: vec![start_s],
                ..settings
            };
            let rival = pem::identify(&signals, &settings, PHASE_MARGIN_DEG.to_radians());
            Some(self.judge.deterioration(rival.ok()?.pd))
        })
    }

    fn by(&self, contender: Contender) -> Option<Deterioration> {
        let answer = contender.answer(&Seen::of(self.one())).ok()?;
        Some(self.judge.deterioration(answer.feedback))
    }

    fn by_network(&self, network: &PaperNetwork) -> Option<Deterioration> {
        let answer = network.answer(&self.one()).ok()?;
        Some(self.judge.deterioration(answer.feedback))
    }
}

/// Table V: one row for each start value; set I, set II, set I with the bias in the model, and onecycle without start.
pub(super) fn starts(settings: &Starts, workers: &Workers) -> Result<Numbers, Failure> {
    let bench = Bench::new(&settings.setup, settings.input_bias)?;
    let ours = bench.by(Contender::OneCycle(1));
    let rows = workers.map(settings.starts_s.len(), |index| {
        let start_s = settings.starts_s[index];
        let cells = bench.by_pem(start_s).into_iter().chain([ours]);
        Row::new(name(start_s), cells.map(cost_cell))
    });
    Ok(Numbers {
        tables: vec![rows],
        figures: vec![],
    })
}

/// The name of a start value in the sheet.
fn name([t_prop_s, t_body_s, tau_s]: [f64; 3]) -> String {
    format!("{t_prop_s}, {t_body_s}, {tau_s}")
}

/// Settings of Table VI.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Biases {
    setup: Setup,
    /// Input biases, as fractions of the relay's amplitude.
    input_biases: Vec<f64>,
    /// Start value of PEM: `T_prop`, `T_body`, `tau` (s).
    start_s: [f64; 3],
}

/// Names of the columns of Table VI in its figure.
const METHODS: [&str; 6] = [
    "PEM, set I",
    "PEM, set II",
    "our network of the paper's size",
    "onecycle, one cycle",
    "PEM, set I, bias in the model",
    "PEM, set I, done with care",
];

/// Table VI: one row for each bias, one column for each method.
pub(super) fn biases(
    settings: &Biases,
    network: &PaperNetwork,
    workers: &Workers,
) -> Result<Numbers, Failure> {
    let judged = workers.map(settings.input_biases.len(), |index| {
        let bench = Bench::new(&settings.setup, settings.input_biases[index])?;
        let [one, two, with_bias] = bench.by_pem(settings.start_s);
        let papers = bench.by_network(network);
        let ours = bench.by(Contender::OneCycle(1));
        let careful = bench.by(Contender::PemFair);
        Ok([one, two, papers, ours, with_bias, careful])
    });
    let judged: Vec<[Option<Deterioration>; 6]> =
        judged.into_iter().collect::<Result<_, Failure>>()?;
    let both = || settings.input_biases.iter().zip(&judged);
    let rows = both().map(|(bias, judged)| Row::new(format!("{bias:.1} h"), judged.map(cost_cell)));
    let series = METHODS.iter().enumerate().map(|(number, label)| {
        let points = both().filter_map(|(bias, judged)| {
            let relative = judged[number]?.relative()?;
            Some((*bias, 100.0 * relative))
        });
        Series::of_points(label, Marks::LineAndPoints, points)
    });
    Ok(Numbers {
        tables: vec![rows.collect()],
        figures: vec![series.collect()],
    })
}
