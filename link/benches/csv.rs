//! Throughput of the CSV reader in rows and bytes per second.

use std::fmt::Write;

use divan::counter::{BytesCount, ItemsCount};
use onecycle_link::{CsvOptions, read_from};

fn main() {
    divan::main();
}

/// A relay test at 1 kHz with nine decimals in the output.
fn file(rows: u32) -> String {
    let mut text = String::from("t,pv,u\n");
    for row in 0..rows {
        let t = f64::from(row) / 1000.0;
        let u = if (3.0 * t).sin() > 0.0 { 0.25 } else { -0.25 };
        writeln!(text, "{t:.3},{:.9},{u}", 0.1 * (3.0 * t).cos()).expect("a string takes all");
    }
    text
}

#[divan::bench(args = [8_000, 1_000_000])]
fn read(bencher: divan::Bencher<'_, '_>, rows: u32) {
    let text = file(rows);
    bencher
        .counter(ItemsCount::new(rows))
        .counter(BytesCount::of_str(&text))
        .bench(|| read_from(text.as_bytes(), &CsvOptions::default()));
}
