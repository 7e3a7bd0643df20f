//! What a pack holds, whether it is whole, and what became of a network in it.

use std::fmt::Write;

use onecycle_onboard::network::{Activation, Dense, Weights};
use onecycle_onboard::pack::{Pack, SELF_TEST_TOLERANCE, Sizes, VERSION};
use serde_json::{Value, json};

use super::json::to_text;
use super::number::significant;
use crate::results::pack::{ImportedPack, VerifiedPack};
use crate::style::{headed, verdict};

/// Changes with every change that a reader of the report could notice.
const SCHEMA: &str = "onecycle.pack/1";

/// A pack for programs.
pub(crate) fn json(pack: &Pack<'_>) -> String {
    let layers = pack.layers().map(|layer| {
        json!({
            "inputs": layer.inputs(),
            "outputs": layer.outputs(),
            "activation": activation(layer),
            "weights": weights(layer),
        })
    });
    let (domain, scaling, table) = (pack.domain(), pack.output_scaling(), pack.lead_table());
    let sizes = pack.sizes();
    to_text(&json!({
        "schema": SCHEMA,
        "version": VERSION,
        "hash": format!("{:016x}", pack.content_hash()),
        "layers": layers.collect::<Vec<_>>(),
        "input_offsets": numbers(pack.input_offsets().iter()),
        "input_scales": numbers(pack.input_scales().iter()),
        "outputs": {
            "scales": numbers(scaling.scales),
            "temperatures": numbers(scaling.temperatures),
            "lowest": numbers(scaling.lowest),
            "highest": numbers(scaling.highest),
        },
        "domain": {
            "ln_samples": numbers(domain.ln_samples),
            "duty": numbers(domain.duty),
            "beta": numbers(domain.beta),
            "phase_margin_deg": degrees(domain.phase_margin_rad),
        },
        "unknown": {
            "threshold": number(pack.unknown_threshold()),
            "calibration": numbers(pack.calibration().iter()),
        },
        "lead_table": {
            "n": table.n,
            "m": table.m,
            "fields": table.fields,
            "axes": numbers(table.axes),
        },
        "self_tests": pack.self_tests().count(),
        "bytes": {
            "weights": sizes.weights,
            "table": sizes.table,
            "card": sizes.card,
            "total": sizes.total,
        },
        "card": card(pack),
    }))
}

/// A pack for people.
pub(crate) fn text(name: &str, pack: &Pack<'_>) -> String {
    let mut text = String::new();
    let domain = pack.domain();
    let scaling = pack.output_scaling();
    let table = pack.lead_table();
    let tests = pack.self_tests().count();
    let Sizes {
        weights,
        table: table_bytes,
        card: card_bytes,
        total,
    } = pack.sizes();
    let rest = total - weights - table_bytes - card_bytes;
    let _ = writeln!(
        text,
        "Pack     {name}, version {VERSION} of the format, hash {hash:016x}\n\
         Network  {network}\n\
         Outputs  means over {scales}; deviations times {temperatures}\n         \
         values from {lowest} to {highest}\n\
         Domain   ln(T/dt) {ln_samples}, duty {duty}, beta {beta}\n\
         Margin   {margin} deg\n\
         Unknown  from a score of {threshold}; calibration {calibration}\n\
         Table    {n} x {m} points of {fields} numbers, axes {axes}\n\
         Test     {tests} signatures with the outputs they must give\n\
         Bytes    weights {weights}, table {table_bytes}, card {card_bytes}, the rest {rest}; \
         {total} in all\n",
        hash = pack.content_hash(),
        network = network(pack),
        scales = row(&scaling.scales),
        temperatures = row(&scaling.temperatures),
        lowest = row(&scaling.lowest),
        highest = row(&scaling.highest),
        ln_samples = range(domain.ln_samples),
        duty = range(domain.duty),
        beta = range(domain.beta),
        margin = significant(degrees(domain.phase_margin_rad)),
        threshold = pack.unknown_threshold(),
        calibration = match pack.calibration().iter().collect::<Vec<_>>() {
            values if values.is_empty() => "none".to_owned(),
            values => row(&values),
        },
        n = table.n,
        m = table.m,
        fields = table.fields,
        axes = row(&table.axes),
    );
    headed(&text) + &headed("Card\n") + &to_text(&card(pack))
}

/// Whether a pack is whole and gives the outputs it must.
pub(crate) fn verified(verified: &VerifiedPack<'_>) -> String {
    let VerifiedPack { name, pack, worst } = verified;
    let head = format!(
        "{name}: {} bytes, hash {:016x} as it must be\n",
        pack.sizes().total,
        pack.content_hash()
    );
    let tests = pack.self_tests().count();
    head + &match *worst {
        None => "It holds no signature to test its outputs with.\n".to_owned(),
        Some(worst) if verified.passes() => verdict(
            true,
            &format!(
                "{tests} signatures give the outputs they must, the largest difference {}.\n",
                significant(f64::from(worst))
            ),
        ),
        Some(worst) => verdict(
            false,
            &format!(
                "Its outputs are not those they must be: of {tests} signatures the largest \
                 difference is {}, where {} is allowed.\n\
                 Do not use it: make it again, or update onecycle.\n",
                significant(f64::from(worst)),
                significant(f64::from(SELF_TEST_TOLERANCE))
            ),
        ),
    }
}

/// What became of a network.
pub(crate) fn imported(imported: &ImportedPack<'_>) -> String {
    let ImportedPack {
        model,
        like,
        out,
        pack,
        changed,
        samples,
        ..
    } = imported;
    let [largest, rms, size] = [changed.largest, changed.rms, changed.size].map(significant);
    format!(
        "Pack     {out}, {total} bytes, hash {hash:016x}\n\
         Network  {network}, of {model}\n\
         Inputs   normalised as {normalisation} says\n\
         Rounding changes an output by {largest} at most, rms {rms}, where outputs are {size} \
         ({samples} random signatures)\n\
         Scores   cleared: those of {like} were its network's\n\
         The domain, output scaling, temperatures, threshold of the unknown and table are those of\n\
         {like}; none of them was fitted to this network.\n",
        out = out.display(),
        total = pack.sizes().total,
        hash = pack.content_hash(),
        network = network(pack),
        model = model.display(),
        normalisation = if imported.brings_normalisation {
            model.display().to_string()
        } else {
            like.clone()
        },
    )
}

/// Such as `34-48-48-14, tanh tanh none, a byte a weight`.
fn network(pack: &Pack<'_>) -> String {
    let mut widths = String::new();
    let (mut activations, mut kinds) = (Vec::new(), Vec::new());
    for layer in pack.layers() {
        if widths.is_empty() {
            widths = layer.inputs().to_string();
        }
        let _ = write!(widths, "-{}", layer.outputs());
        activations.push(activation(layer));
        kinds.push(weights(layer));
    }
    let kinds = match &kinds[..] {
        kinds if kinds.iter().all(|&kind| kind == "bytes") => "a byte a weight".to_owned(),
        kinds if kinds.iter().all(|&kind| kind == "f32") => "weights of f32".to_owned(),
        kinds => format!("weights of {}", kinds.join(" ")),
    };
    format!("{widths}, {}, {kinds}", activations.join(" "))
}

fn activation(layer: &Dense<'_>) -> &'static str {
    match layer.activation() {
        Activation::None => "none",
        Activation::Relu => "relu",
        Activation::Tanh => "tanh",
    }
}

fn weights(layer: &Dense<'_>) -> &'static str {
    match layer.weights() {
        Weights::Floats(_) => "f32",
        Weights::Bytes { .. } => "bytes",
    }
}

/// The card, or its text where it is no JSON.
fn card(pack: &Pack<'_>) -> Value {
    serde_json::from_str(pack.card()).unwrap_or_else(|_| Value::from(pack.card()))
}

/// With the digits that tell it from any other f32, not those of its f64: 0.73, not
/// 0.7300000190734863.
fn number(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

fn numbers(values: impl IntoIterator<Item = f32>) -> Vec<f64> {
    values.into_iter().map(number).collect()
}

fn degrees(angle_rad: f32) -> f64 {
    f64::from(angle_rad).to_degrees()
}

fn range([low, high]: [f32; 2]) -> String {
    format!("{low} to {high}")
}

fn row(values: &[f32]) -> String {
    let values: Vec<_> = values.iter().map(ToString::to_string).collect();
    values.join(" ")
}
