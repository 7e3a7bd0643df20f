//! `onecycle-lab pack`: show, verify, export and import the packs of identifiers, and change their margin.

use std::path::Path;
use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::learn::npz::{self, Column, Numbers};
use onecycle_lab::learn::onnx;
use onecycle_lab::learn::onnx::Normalisation;
use onecycle_lab::learn::pack::{PackContents, PackedWeights, Precision, layers, quantisation};
use onecycle_lab::learn::train::Network;
use onecycle_onboard::pack::{OUTPUTS, Pack};
use onecycle_onboard::signature::LENGTH;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

use crate::args::{self, PackAction};
use crate::output::{print, write_file};
use crate::reading::bytes_at_most;
use crate::report;
use crate::results::pack::{ImportedPack, VerifiedPack};

/// Largest size of a model file (bytes): the limit of its format.
const MOST_OF_A_MODEL: u64 = 1 << 31;

/// Number of random signatures, seed 1, that networks are compared on.
const SAMPLES: usize = 1000;
/// Range of the normalised random inputs: two standard deviations.
const SPREAD: f32 = 2.0;

pub(crate) fn run(arguments: &args::Pack) -> Result<ExitCode, Failure> {
    match &arguments.action {
        PackAction::Show(arguments) => show(arguments),
        PackAction::Verify(arguments) => verify(arguments),
        PackAction::Export(arguments) => export(arguments),
        PackAction::Import(arguments) => import(arguments),
        PackAction::Margin(arguments) => margin(arguments),
    }
}

fn show(arguments: &args::ShowPack) -> Result<ExitCode, Failure> {
    let bytes = arguments.pack.bytes()?;
    let pack = arguments.pack.read(&bytes)?;
    print(&if arguments.json {
        report::pack::json(&pack)
    } else {
        report::pack::text(&arguments.pack.to_string(), &pack)
    })?;
    Ok(ExitCode::from(exit::DONE))
}

fn verify(arguments: &args::VerifyPack) -> Result<ExitCode, Failure> {
    let bytes = arguments.pack.bytes()?;
    let pack = arguments.pack.read(&bytes)?;
    let verified = VerifiedPack {
        name: arguments.pack.to_string(),
        pack: &pack,
        worst: pack.self_test(),
    };
    print(&report::pack::verified(&verified))?;
    Ok(ExitCode::from(if verified.passes() {
        exit::DONE
    } else {
        exit::NO_PROCESS
    }))
}

fn export(arguments: &args::ExportPack) -> Result<ExitCode, Failure> {
    let bytes = arguments.pack.bytes()?;
    let pack = arguments.pack.read(&bytes)?;
    let failed = |reason: String| Failure::unreadable(&arguments.pack.path(), reason);
    let contents = PackContents::read(&pack).map_err(|error| failed(error.to_string()))?;
    let network = contents
        .network()
        .map_err(|error| failed(error.to_string()))?;
    let normalisation = Normalisation {
        offsets: contents.input_offsets.to_vec(),
        scales: contents.input_scales.to_vec(),
    };
    let model = onnx::export(&network, Some(&normalisation), &[])
        .map_err(|error| failed(error.to_string()))?;
    write_file(&arguments.onnx, |file| file.write_all(&model))?;
    if let Some(path) = &arguments.samples {
        let samples = samples_file(&pack);
        write_file(path, |file| file.write_all(&samples))?;
    }
    Ok(ExitCode::from(exit::DONE))
}

/// Random signatures and the outputs of the pack for them, as npz.
fn samples_file(pack: &Pack<'_>) -> Vec<u8> {
    let signatures = signatures(pack);
    let outputs = signatures
        .iter()
        .flat_map(|signature| pack.outputs(signature));
    let column = |name, width, numbers| Column {
        name,
        width: Some(width),
        numbers: Numbers::F32(numbers),
    };
    let outputs = column("outputs", OUTPUTS, outputs.collect());
    npz::write(&[
        column("inputs", LENGTH, signatures.into_flattened()),
        outputs,
    ])
}

/// Random signatures, within [`SPREAD`] after normalisation.
fn signatures(pack: &Pack<'_>) -> Vec<[f32; LENGTH]> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let scaling: Vec<_> = (pack.input_offsets().iter())
        .zip(pack.input_scales().iter())
        .collect();
    let signature = |_| {
        std::array::from_fn(|i| {
            let (offset, scale) = scaling[i];
            let normalised: f32 = rng.random_range(-SPREAD..=SPREAD);
            // The network ignores inputs with scale zero.
            if scale == 0.0 {
                offset
            } else {
                offset + normalised / scale
            }
        })
    };
    (0..SAMPLES).map(signature).collect()
}

fn import(arguments: &args::ImportPack) -> Result<ExitCode, Failure> {
    let like_bytes = arguments.like.bytes()?;
    let like = arguments.like.read(&like_bytes)?;
    let mut contents = PackContents::read(&like)
        .map_err(|error| Failure::unreadable(&arguments.like.path(), error.to_string()))?;
    let (normalisation, network) = learnt(&arguments.model)?;
    let failed = |reason: String| Failure::unreadable(&arguments.model, reason);

    let brings_normalisation = normalisation.is_some();
    if let Some(Normalisation { offsets, scales }) = normalisation {
        let row = |values: Vec<f32>| {
            <[f32; LENGTH]>::try_from(values).map_err(|values| {
                failed(format!(
                    "the network has {} inputs, not {LENGTH}",
                    values.len()
                ))
            })
        };
        contents.input_offsets = row(offsets)?;
        contents.input_scales = row(scales)?;
    }
    contents.layers =
        layers(&network, precision(&contents)).map_err(|error| failed(error.to_string()))?;
    contents.card = card(contents.card, arguments, like.content_hash());
    let made = contents
        .to_bytes()
        .map_err(|error| failed(error.to_string()))?;
    let pack = Pack::read(&made).map_err(|error| failed(error.to_string()))?;
    let changed = quantisation(&pack, &network, &signatures(&pack))
        .map_err(|error| failed(error.to_string()))?;
    write_file(&arguments.out, |file| file.write_all(&made))?;
    print(&report::pack::imported(&ImportedPack {
        model: arguments.model.clone(),
        like: arguments.like.to_string(),
        out: arguments.out.clone(),
        pack: &pack,
        brings_normalisation,
        changed,
        samples: SAMPLES,
    }))?;
    Ok(ExitCode::from(exit::DONE))
}

fn margin(arguments: &args::MarginPack) -> Result<ExitCode, Failure> {
    let failed = |reason: String| Failure::unreadable(&arguments.pack.path(), reason);
    let old = arguments.pack.bytes()?;
    let old = arguments.pack.read(&old)?;
    let contents = PackContents::read(&old)
        .and_then(|contents| {
            contents.with_phase_margin(arguments.phase_margin, arguments.extra_ise)
        })
        .map_err(|error| failed(error.to_string()))?;
    let made = contents
        .to_bytes()
        .map_err(|error| failed(error.to_string()))?;
    let pack = Pack::read(&made).map_err(|error| failed(error.to_string()))?;
    write_file(&arguments.out, |file| file.write_all(&made))?;
    print(&report::pack::margin(&arguments.out, &pack))?;
    Ok(ExitCode::from(exit::DONE))
}

/// The network of a file, and its normalisation if the file has one.
fn learnt(path: &Path) -> Result<(Option<Normalisation>, Network), Failure> {
    let imported = onnx::import(&bytes_at_most(path, MOST_OF_A_MODEL)?)
        .map_err(|error| Failure::unreadable(path, error.to_string()))?;
    Ok((imported.normalisation, imported.network))
}

/// The format in which the pack stores its weights.
fn precision(contents: &PackContents) -> Precision {
    let is_bytes = |weights: &PackedWeights| matches!(weights, PackedWeights::Bytes { .. });
    if contents.layers.iter().any(|layer| is_bytes(&layer.weights)) {
        Precision::Bytes
    } else {
        Precision::Floats
    }
}

/// The card of an imported pack: sources of the network and of everything else. The scores of the other network are left
/// out.
fn card(mut other: Value, arguments: &args::ImportPack, hash: u64) -> Value {
    if let Some(card) = other.as_object_mut() {
        card.remove("scores");
    }
    let model = arguments.model.file_name().unwrap_or_default();
    json!({
        "scores": null,
        "imported": {
            "network": model.to_string_lossy(),
            "onecycle": env!("CARGO_PKG_VERSION"),
            "all_else_from": { "hash": format!("{hash:016x}"), "card": other },
        },
    })
}
