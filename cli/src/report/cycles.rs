//! Cycles of one run, each identified alone: cost of each controller on the processes of the other cycles.

use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_identify::cycles::Cycles;

use super::number::percent;

/// One row for the controller of each cycle, one cell for the process of each cycle.
pub fn cross_table(cycles: &Cycles) -> Vec<Vec<String>> {
    let cells = |i: usize, row: &[Deterioration]| -> Vec<String> {
        (row.iter().enumerate())
            .map(|(j, cost)| {
                if i == j {
                    "-".to_owned()
                } else {
                    cost_cell(Some(*cost))
                }
            })
            .collect()
    };
    (cycles.cross().iter().enumerate())
        .map(|(i, row)| cells(i, row))
        .collect()
}

/// The deterioration `J` of a method as a cell of a table.
pub fn cost_cell(judged: Option<Deterioration>) -> String {
    match judged {
        Some(Deterioration::Stable { relative, .. }) => percent(relative),
        Some(Deterioration::Unstable) => "unstable".to_owned(),
        None => "no answer".to_owned(),
    }
}
