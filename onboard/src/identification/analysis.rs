//! From windows of cycles to a process and its controller, in slices.

use super::desk::{Desk, Note, Order};
use super::{BINS, Refusal, Stage, TuningResult};
use crate::amplitude;
use crate::classify::{Classifier, Familiarity};
use crate::control::Pd;
use crate::cycle::Cycle;
use crate::judgement::{
    COORDINATES, HALF_90_PERCENT, MOST_MISFIT, Spread, largest_response_error, misfit,
};
use crate::pack::Pack;
use crate::process::Soiptd;
use crate::refine::{PriorKnowledge, Refined, Refiner, ShapePrior};

/// Controller whose uncertainty is being computed: number of coordinates already followed.
#[derive(Clone, Copy, Debug)]
struct Design {
    /// The process with the delay of the rate added to its own.
    process: Soiptd,
    pd: Pd,
    spread: Spread,
    followed: usize,
}

/// Memory of the analysis beside the [`Desk`], nothing in it between two orders.
pub struct Bench {
    classifier: Classifier,
    refiner: Refiner<BINS>,
}

impl Bench {
    /// A bench for any axis, all zeros.
    pub const NEW: Self = Self {
        classifier: Classifier::new(),
        refiner: Refiner::new(),
    };
}

type Parts<'p> = (&'p Desk, &'p mut Bench);

/// Analysis of one axis. Every call must be given the same [`Bench`].
pub struct Analysis<'a> {
    pack: Pack<'a>,
    /// The order in work.
    order: Option<Order>,
    score: f64,
    /// Whether the pack knows the last cycle.
    is_known: bool,
    refined: Option<Refined>,
    design: Option<Design>,
    gain_deviation: f64,
    stage: Stage,
}

impl<'a> Analysis<'a> {
    /// An analysis with this pack.
    #[must_use]
    pub fn new(pack: Pack<'a>) -> Self {
        Self {
            pack,
            order: None,
            score: f64::INFINITY,
            is_known: false,
            refined: None,
            design: None,
            gain_deviation: 0.0,
            stage: Stage::Wait,
        }
    }

    /// The next step; [`Stage::Wait`] without an order.
    #[must_use]
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Does at most this number of slices of the work that is ordered. Returns whether some is left; if not, and there was an
    /// order, its outcome lies on the desk.
    pub fn work(&mut self, desk: &mut Desk, bench: &mut Bench, slices: u16) -> bool {
        for _ in 0..slices {
            let Note::Order(order) = desk.note else {
                self.stage = Stage::Wait;
                return false;
            };
            if self.order.is_none_or(|known| known.number != order.number) {
                self.order = Some(order);
                bench.classifier.begin_signing();
                self.stage = Stage::Sign;
            }
            if let Some(outcome) = self.advance(&order, (desk, bench)) {
                desk.note = Note::Outcome(outcome);
            }
        }
        desk.is_ordered()
    }

    /// Does one slice of the work. `None` if it is not finished.
    fn advance(
        &mut self,
        order: &Order,
        parts: Parts<'_>,
    ) -> Option<Result<TuningResult, Refusal>> {
        let cycle = &order.cycle;
        let outcome = match self.stage {
            Stage::Sign if order.is_confirming => {
                self.begin_comparison(parts, cycle).map(|()| None)
            }
            Stage::Sign => self.sign(parts, cycle).map(|()| None),
            Stage::Classify => self.classify(parts, cycle).map(|()| None),
            Stage::Refine => self.refine(parts, order).map(|()| None),
            Stage::Judge => self.judge(parts.0).map(|()| None),
            Stage::Gains => self.gains(order).map(|()| None),
            Stage::Design => self.design(cycle),
            Stage::Wait | Stage::Collect => Err(Refusal::NoFit),
        };
        let outcome = outcome.transpose()?;
        self.stage = Stage::Wait;
        Some(outcome)
    }

    fn sign(&mut self, (desk, bench): Parts<'_>, cycle: &Cycle) -> Result<(), Refusal> {
        let Some(signature) = bench.classifier.sign(&desk.fine, cycle) else {
            return Ok(());
        };
        let signature = signature.map_err(|_| Refusal::NoSignature)?;
        let noise_sigma = desk.fine.noise_sigma();
        bench
            .classifier
            .begin(&self.pack, &signature, cycle.period_s, noise_sigma)
            .map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        self.stage = Stage::Classify;
        Ok(())
    }

    fn classify(&mut self, (desk, bench): Parts<'_>, cycle: &Cycle) -> Result<(), Refusal> {
        let Some(read) = bench.classifier.advance(&self.pack) else {
            return Ok(());
        };
        let read = read.map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        self.is_known = read.familiarity != Familiarity::Unknown;
        self.score = read.score;
        let prior_knowledge = PriorKnowledge {
            starts: &read.starts(cycle.period_s),
            prior: ShapePrior::of_pack(&self.pack),
            may_walk: true,
        };
        bench
            .refiner
            .begin(&desk.coarse, cycle.period_s, &prior_knowledge)
            .map_err(|_| Refusal::NoFit)?;
        self.stage = Stage::Refine;
        Ok(())
    }

    fn refine(&mut self, (desk, bench): Parts<'_>, order: &Order) -> Result<(), Refusal> {
        let Some(refined) = bench.refiner.advance(&desk.coarse) else {
            return Ok(());
        };
        let refined = refined.map_err(|_| Refusal::NoFit)?;
        if order.is_confirming {
            return self.compare((desk, bench), &refined);
        }
        // The score supposes white noise, so a cycle under another noise is unknown to the pack; what is found there is judged
        // by its fit alone.
        if !self.is_known && refined.walk.is_none() {
            return Err(Refusal::Unknown(self.score));
        }
        self.refined = Some(refined);
        self.gain_deviation = bench.refiner.gain_deviation();
        self.stage = Stage::Judge;
        Ok(())
    }

    fn judge(&mut self, desk: &Desk) -> Result<(), Refusal> {
        let refined = self.refined.ok_or(Refusal::NoFit)?;
        let misfit = misfit(&refined, &desk.coarse);
        let table = self.pack.gains_table().ok_or(Refusal::NoGains)?;
        let most_error = largest_response_error(table.phase_margin_rad());
        if misfit > MOST_MISFIT || refined.response_error > most_error {
            return Err(Refusal::Misfit(misfit.max(refined.response_error)));
        }
        if let Some(edge) = refined.edge {
            return Err(Refusal::Edge(edge));
        }
        self.stage = Stage::Gains;
        Ok(())
    }

    fn gains(&mut self, order: &Order) -> Result<(), Refusal> {
        let refined = self.refined.ok_or(Refusal::NoFit)?;
        let table = self.pack.gains_table().ok_or(Refusal::NoGains)?;
        let process = (refined.process)
            .delayed(order.rate_delay_s)
            .map_err(|_| Refusal::NoGains)?;
        let pd = table.pd(&process).map_err(|_| Refusal::NoGains)?;
        self.design = Some(Design {
            process,
            pd,
            spread: Spread::new(&process, &pd).ok_or(Refusal::NoGains)?,
            followed: 0,
        });
        self.stage = Stage::Design;
        Ok(())
    }

    fn design(&mut self, cycle: &Cycle) -> Result<Option<TuningResult>, Refusal> {
        let (Some(refined), Some(design)) = (&self.refined, &mut self.design) else {
            return Ok(None);
        };
        let Design {
            process,
            pd,
            spread,
            followed,
        } = design;
        if *followed < COORDINATES {
            spread
                .follow(*followed, process, pd)
                .ok_or(Refusal::NoGains)?;
            *followed += 1;
            return Ok(None);
        }
        let phase_margin_rad = spread.phase_margin_rad();
        let uncertain = |sigma| Refusal::TooUncertain(phase_margin_rad, sigma);
        let covariance = refined.covariance.ok_or(uncertain(f64::INFINITY))?;
        let deviations = spread.deviations(&covariance);
        let is_sure = phase_margin_rad > HALF_90_PERCENT * deviations.phase_margin_rad;
        if !is_sure {
            return Err(uncertain(deviations.phase_margin_rad));
        }
        Ok(Some(TuningResult {
            process: refined.process,
            deviations,
            pd: *pd,
            phase_margin_rad,
            input_bias: refined.input_bias,
            score: self.score,
            period_s: cycle.period_s,
            amplitude: cycle.amplitude,
            noise_sigma: refined.noise_sigma,
        }))
    }

    fn begin_comparison(&mut self, (desk, bench): Parts<'_>, cycle: &Cycle) -> Result<(), Refusal> {
        let found = self.refined.as_ref().ok_or(Refusal::NoFit)?;
        (bench.refiner)
            .begin_gain(&desk.coarse, cycle.period_s, found)
            .map_err(|_| Refusal::NoFit)?;
        self.stage = Stage::Refine;
        Ok(())
    }

    /// Accepts or refuses the fit at the second amplitude. The design, which is complete, leads to the result again.
    fn compare(&mut self, (desk, bench): Parts<'_>, refined: &Refined) -> Result<(), Refusal> {
        let found = self.refined.as_ref().ok_or(Refusal::NoFit)?;
        let ratio = refined.process.k_over_t_body() / found.process.k_over_t_body();
        let deviations = [self.gain_deviation, bench.refiner.gain_deviation()];
        if !amplitude::is_alike(ratio, deviations) {
            return Err(Refusal::AmplitudeDependent(ratio));
        }
        let misfit = misfit(refined, &desk.coarse);
        if misfit > MOST_MISFIT {
            return Err(Refusal::Misfit(misfit));
        }
        self.stage = Stage::Design;
        Ok(())
    }
}
