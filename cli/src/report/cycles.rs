//! Cycles of one run, each identified alone: cost of each controller on the processes of the other cycles.

use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_lab::judge::evaluate::Cycles;

use super::number::percent;
use crate::results::reproduction::Row;

/// One row for the controller of each cycle, one cell for the process of each cycle.
pub(crate) fn cross_table(cycles: &Cycles) -> Vec<Row> {
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
        .map(|(i, row)| Row::new((i + 1).to_string(), cells(i, row)))
        .collect()
}

/// The deterioration `J` of a method as a cell of a table.
pub(crate) fn cost_cell(judged: Option<Deterioration>) -> String {
    match judged {
        Some(Deterioration::Stable { relative, .. }) => percent(relative),
        Some(Deterioration::Unstable) => "unstable".to_owned(),
        None => "no answer".to_owned(),
    }
}
