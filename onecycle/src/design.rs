//! From the requirements on a controller to the controllers of a known process.

use onecycle_design::{Design, Model, Pid};

use crate::error::Error;
use crate::in_force::InForce;
use crate::request::{Against, DesignRequest};
use crate::results::controllers::{Controllers, Source};
use crate::results::family::{Known, OfOscillation};
use crate::words::controllers::refusal;
use crate::words::oscillation::{none_agrees, refusal_of_family};

/// A process with its controllers.
#[non_exhaustive]
pub struct DesignReport {
    /// The process; of an oscillation the middle of those that agree with it.
    pub model: Model,
    /// Controllers to choose from, and the gains in force.
    pub choice: Controllers,
    /// The chosen one.
    pub best: Design,
    /// What is known of the process, if its parameters are not.
    pub oscillation: Option<OfOscillation>,
}

impl DesignRequest {
    /// The gains in force, if they are given or stand in the file that was named.
    ///
    /// # Errors
    /// One sentence: the file does not tell them.
    pub fn in_force(&self) -> Result<Option<Pid>, Error> {
        Ok(InForce::of(&self.requirements, None)?.against)
    }

    /// Designs for a known process.
    ///
    /// # Errors
    /// One sentence: the settings contradict each other, or there is no controller.
    pub fn design(&self, model: Model) -> Result<DesignReport, Error> {
        let in_force = InForce::of(&self.requirements, None)?;
        let asked = self.complete(in_force.law(self.requirements.specification()?))?;
        let choice = Controllers::of_model(&model, &asked, in_force.against);
        let choice = choice.in_plant(in_force.plant);
        Ok(DesignReport {
            best: chosen(&choice)?,
            model,
            choice,
            oscillation: None,
        })
    }

    /// Designs for all processes that agree with an oscillation.
    ///
    /// # Errors
    /// One sentence: no process agrees with it, or there is no controller.
    pub fn design_for_all(&self, known: Known) -> Result<DesignReport, Error> {
        let mut requirements = self.requirements.clone();
        // Gains that were typed are in the unit of the firmware, those of a file have been converted.
        if let (Some(rule), Some(Against::Gains(_))) = (known.rule, &requirements.against) {
            requirements.input_range = requirements.input_range.or(rule.full_output());
        }
        let in_force = InForce::of(&requirements, None)?;
        let asked = self.complete(in_force.law(self.requirements.specification()?))?;
        let family = (known.oscillation)
            .family(known.dead_time_share)
            .ok_or_else(|| Error::Request(none_agrees(&known)))?;
        let choice = Controllers::of_family(&family, &asked, in_force.against);
        let choice = choice.in_plant(in_force.plant);
        let best = chosen(&choice)?;
        Ok(DesignReport {
            model: family.middle,
            oscillation: Some(OfOscillation {
                margins: family.margins(&best.controller),
                known,
                family,
            }),
            choice,
            best,
        })
    }
}

fn chosen(choice: &Controllers) -> Result<Design, Error> {
    let error = match choice.chosen().map(|row| row.proposal.outcome) {
        Some(Ok(design)) => return Ok(design),
        Some(Err(error)) if choice.source == Source::Oscillation => refusal_of_family(&error),
        Some(Err(error)) => refusal(&error),
        None => "there is no such controller".to_owned(),
    };
    Err(Error::Request(error))
}
