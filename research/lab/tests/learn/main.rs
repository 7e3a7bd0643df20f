//! Training: examples, networks, packs, exchange with other programs.

// The lint exempts test functions, but not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod dataset;
mod lead_table;
mod onnx;
mod pack;
mod shards;
mod train;

use onecycle_lab::learn::train::Network;

/// The network with other numbers: `change` gets the name and the numbers of each array.
fn changed(network: Network, mut change: impl FnMut(&str, &mut [f32])) -> Network {
    let mut numbers = network.numbers();
    let mut rest = &mut numbers[..];
    for (name, matrix) in network.arrays() {
        let (own, after) = rest.split_at_mut(matrix.values().len());
        rest = after;
        change(&name, own);
    }
    network.with_numbers(&numbers).unwrap()
}
