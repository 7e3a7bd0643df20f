//! The structures that were fitted, with their BIC.

use onecycle::{Innovations, Structure};
use onecycle_identify::Alternative;

use super::significant;
use crate::pages::page::{self, Section};
use crate::report::units::Units;

pub(super) fn section(chosen: Structure, found: &Innovations, units: &Units) -> Section {
    let least = found.alternatives.first().map_or(0.0, |best| best.bic);
    let rows = found.alternatives.iter().map(|alternative| {
        let structure = alternative.model.structure();
        let mark = if structure == chosen { " (chosen)" } else { "" };
        (
            format!("{}{mark}", structure.name()),
            [
                format!("{:+.1}", alternative.bic - least),
                alternative.noise.kind(),
            ],
        )
    });
    let table = page::plain_table(
        "Best fit of each structure. BIC: above the least; the simplest structure within 6 of it is chosen, with \
         damping where the recording shows damping.",
        &["structure", "BIC", "noise"],
        rows,
    );
    let values: Vec<(&str, String)> = (found.alternatives.iter())
        .map(|alternative| {
            // The formulas are too wide for a column on a phone; here they wrap.
            let structure = alternative.model.structure();
            let formula = structure.transfer_function();
            let values = parameters(alternative, units);
            (structure.name(), format!("{formula}: {values}"))
        })
        .collect();
    Section::new("structures", "Structures", table + &page::facts(&values))
}

/// Symbols with their values and units.
fn parameters(of: &Alternative, units: &Units) -> String {
    let structure = of.model.structure();
    let one = |&parameter: &onecycle::Parameter| {
        let value = of
            .model
            .parameter(parameter)
            .filter(|value| value.is_finite());
        let value = value.map_or("infinite".to_owned(), significant);
        let unit = units.parameter(structure, parameter);
        format!("{} {value} {unit}", parameter.symbol_in(structure))
            .trim_end()
            .to_owned()
    };
    let all: Vec<String> = structure.parameters().iter().map(one).collect();
    all.join(", ")
}
