//! Contents of a pack, its verification, and the import of a network.

use std::fmt::Write;
use std::path::Path;

use onecycle_cli::report::json::to_text;
use onecycle_cli::report::number::significant;
use onecycle_cli::style::{headed, verdict};
use onecycle_onboard::network::{Activation, Dense, Weights};
use onecycle_onboard::pack::{
    CONTROLLER_FORM, EXCITATION, Pack, SELF_TEST_TOLERANCE, STRUCTURE, Sizes, VERSION,
};
use serde_json::{Value, json};

use crate::results::pack::{ImportedPack, VerifiedPack};

/// Version of the JSON; raised with every change that a reader could notice.
const SCHEMA: &str = "onecycle.pack/1";

/// The contents as JSON.
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
        "structure": STRUCTURE,
        "excitation": EXCITATION,
        "controller": { "form": CONTROLLER_FORM },
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

/// The contents as text.
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
         For      structure {STRUCTURE}, excitation {EXCITATION}, controller {CONTROLLER_FORM}\n\
         Network  {network}\n\
         Outputs  means over {scales}; deviations times {temperatures}\n         \
         values from {lowest} to {highest}\n\
         Domain   ln(T/dt) {ln_samples}, duty {duty}, beta {beta}\n\
         Margin   {margin} deg\n\
         Unknown  above a score of {threshold}; calibration {calibration}\n\
         Table    {n} x {m} points of {fields} numbers, axes {axes}\n\
         Test     {tests} signatures with their outputs\n\
         Bytes    weights {weights}, table {table_bytes}, card {card_bytes}, other {rest}; \
         total {total}\n",
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

/// The result of the self-test.
pub(crate) fn verified(verified: &VerifiedPack<'_>) -> String {
    let VerifiedPack { name, pack, worst } = verified;
    let head = format!(
        "{name}: {} bytes, hash {:016x} is correct\n",
        pack.sizes().total,
        pack.content_hash()
    );
    let tests = pack.self_tests().count();
    head + &match *worst {
        None => "The pack has no self-test.\n".to_owned(),
        Some(worst) if verified.passes() => verdict(
            true,
            &format!(
                "Self-test passed: {tests} signatures, largest difference of an output {}.\n",
                significant(f64::from(worst))
            ),
        ),
        Some(worst) => verdict(
            false,
            &format!(
                "Self-test failed: {tests} signatures, largest difference of an output {}, limit {}.\n\
                 Do not use this pack: make it again, or update onecycle.\n",
                significant(f64::from(worst)),
                significant(f64::from(SELF_TEST_TOLERANCE))
            ),
        ),
    }
}

/// The result of an import.
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
         Network  {network}, from {model}\n\
         Inputs   normalisation from {normalisation}\n\
         Rounding changes an output by at most {largest}, RMS {rms}, of outputs of RMS {size} \
         ({samples} random signatures)\n\
         Scores   cleared: those of {like} belong to its network\n\
         The domain, output scaling, temperatures, threshold and table are those of {like};\n\
         they are not fitted to this network.\n",
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

pub(crate) fn margin(out: &Path, pack: &Pack<'_>) -> String {
    format!(
        "Pack     {out}, {total} bytes, hash {hash:016x}\n\
         Margin   {margin:.2} deg\n",
        out = out.display(),
        total = pack.sizes().total,
        hash = pack.content_hash(),
        margin = f64::from(pack.domain().phase_margin_rad).to_degrees(),
    )
}

/// The network in one line, such as `34-48-48-14, tanh tanh none, 8-bit weights`.
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
        kinds if kinds.iter().all(|&kind| kind == "bytes") => "8-bit weights".to_owned(),
        kinds if kinds.iter().all(|&kind| kind == "f32") => "f32 weights".to_owned(),
        kinds => format!("weights {}", kinds.join(" ")),
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

/// The card as JSON, or as text if it is not JSON.
fn card(pack: &Pack<'_>) -> Value {
    serde_json::from_str(pack.card()).unwrap_or_else(|_| Value::from(pack.card()))
}

/// An f32 with its own shortest digits: 0.73, not 0.7300000190734863.
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
