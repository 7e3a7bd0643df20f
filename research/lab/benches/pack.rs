//! Work of a board on one cycle with the built-in pack: outputs of the network, the whole
//! classification, gains from the table; and reading the pack.

use divan::{Bencher, black_box};
use onecycle_onboard::classify::classify_by;
use onecycle_onboard::pack::{DEFAULT, Pack};
use onecycle_onboard::signature::Signature;

fn main() {
    divan::main();
}

fn pack() -> Pack<'static> {
    Pack::embedded().expect("a pack is built in")
}

/// A cycle of the pack's self-test, with a period of 1 s.
fn signature() -> Signature {
    let (values, _) = pack()
        .self_tests()
        .next()
        .expect("the pack tests itself with a cycle");
    Signature {
        values,
        amplitude: 1.0,
        centre: 0.0,
        sign: 1.0,
    }
}

/// Noise of a sample, over the amplitude.
const NOISE: f64 = 0.01;

#[divan::bench]
fn outputs(bencher: Bencher) {
    let (pack, signature) = (pack(), signature());
    bencher.bench_local(|| pack.outputs(black_box(&signature.values)));
}

#[divan::bench]
fn classify(bencher: Bencher) {
    let (pack, signature) = (pack(), signature());
    bencher.bench_local(|| classify_by(&pack, black_box(&signature), 1.0, NOISE));
}

#[divan::bench]
fn gains(bencher: Bencher) {
    let pack = pack();
    let found = classify_by(&pack, &signature(), 1.0, NOISE).expect("the cycle is one");
    let process = found.candidates[0].process;
    let table = pack
        .gains_table()
        .expect("the built-in pack has a lead table");
    bencher.bench_local(|| table.pd(black_box(&process)));
}

#[divan::bench]
fn read(bencher: Bencher) {
    bencher.bench_local(|| Pack::read(black_box(DEFAULT)).map(|pack| pack.content_hash()));
}
