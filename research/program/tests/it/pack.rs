//! `pack`: show, verify, export, import, margin; and files that are damaged, truncated, newer, or not packs.

use onecycle_lab::learn::npz::{self, Column, Numbers};
use onecycle_lab::learn::onnx;
use onecycle_lab::learn::onnx::Normalisation;
use onecycle_lab::learn::pack::{
    LeadTableContents, PackContents, PackedWeights, Precision, layers,
};
use onecycle_lab::learn::train::{Layer, Matrix, Network};
use onecycle_lab::workers::OneThread;
use onecycle_onboard::pack::{
    DEFAULT, Domain, HEADER, OUTPUTS, OutputScaling, Pack, Prior, content_hash,
};
use onecycle_onboard::signature::LENGTH;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

use crate::common::{NOT_WRITTEN, Outcome, Scratch, Table, UNREADABLE, run};

/// The exit code of a pack that fails its self-test.
const FAILED: i32 = 4;

fn network(hidden: usize, outputs: usize, seed: u64) -> Network {
    let kinds = [
        Layer::Dense { outputs: hidden },
        Layer::Tanh,
        Layer::Dense { outputs },
    ];
    Network::new(LENGTH, &kinds, &mut Pcg64Mcg::seed_from_u64(seed)).unwrap()
}

fn contents(precision: Precision) -> PackContents {
    PackContents {
        layers: layers(&network(10, OUTPUTS, 1), precision).unwrap(),
        input_offsets: std::array::from_fn(|i| 0.1 * i as f32),
        input_scales: [2.0; LENGTH],
        output_scaling: OutputScaling {
            scales: [1.0, 8.0, 8.0, 1.0],
            temperatures: [1.0, 1.1, 1.2, 1.3],
            lowest: [-4.0; 4],
            highest: [4.0; 4],
        },
        domain: Domain {
            ln_samples: [3.5, 8.0],
            duty: [0.1, 0.9],
            beta: [-0.73; 2],
            phase_margin_rad: std::f32::consts::PI / 9.0,
        },
        unknown_threshold: 3.25,
        prior: Prior::default(),
        calibration: vec![0.5, 0.25],
        lead_table: LeadTableContents {
            n: 2,
            m: 3,
            fields: 2,
            axes: [0.0, 1.0, -1.0, 1.0],
            values: (0..12_u8).map(f32::from).collect(),
        },
        self_tests: vec![[0.25; LENGTH], [0.75; LENGTH]],
        card: json!({ "seed": 7, "scores": { "worst": 0.01 } }),
    }
}

/// A folder with a pack, the path of the pack, and its bytes.
fn folder() -> (Scratch, String, Vec<u8>) {
    let folder = Scratch::new();
    let bytes = contents(Precision::Bytes).to_bytes().unwrap();
    let path = folder.write("a.pack", &bytes);
    (folder, path, bytes)
}

fn done(arguments: &[&str]) -> String {
    let outcome: Outcome = run(&[&["pack"], arguments].concat());
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    assert_eq!(outcome.stderr, "");
    outcome.stdout
}

// ---------------------------------------------------------------- show and verify

// Weights: 34 x 10 and 10 x 14 bytes, 24 scales and 24 biases of 4 bytes; table: 4 and 12 numbers of 4 bytes.
#[test]
fn a_pack_is_shown() {
    let (_folder, path, bytes) = folder();
    let text = done(&["show", &path]);
    let hash = format!("{:016x}", content_hash(&bytes[HEADER..]));
    let card = contents(Precision::Bytes).card.to_string().len();
    let sizes = format!("weights 672, table 64, card {card}, other");
    let total = format!("total {}", bytes.len());
    for words in [
        &hash[..],
        "34-10-14, tanh none, 8-bit weights",
        "ln(T/dt) 3.5 to 8, duty 0.1 to 0.9, beta -0.73 to -0.73",
        "20.00 deg",
        "above a score of 3.25; calibration 0.5 0.25",
        "2 x 3 points of 2 numbers, axes 0 1 -1 1",
        "2 signatures",
        &sizes,
        &total,
        "\"worst\": 0.01",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let report: Value = serde_json::from_str(&done(&["show", &path, "--json"])).unwrap();
    assert_eq!(report["schema"], "onecycle.pack/1");
    assert_eq!(report["hash"], hash);
    assert_eq!(report["layers"][1]["inputs"], 10);
    assert_eq!(report["domain"]["beta"], json!([-0.73, -0.73]));
    assert_eq!(report["layers"][0]["activation"], "tanh");
    assert_eq!(report["bytes"]["weights"], 672);
    assert_eq!(report["bytes"]["total"], bytes.len());
    assert_eq!(report["card"]["seed"], 7);
}

#[test]
fn a_whole_pack_passes() {
    let (_folder, path, bytes) = folder();
    let text = done(&["verify", &path]);
    assert!(text.contains(&format!("{} bytes", bytes.len())), "{text}");
    assert!(text.contains("Self-test passed: 2 signatures"), "{text}");
    let folder = Scratch::new();
    let mut without = contents(Precision::Bytes);
    without.self_tests.clear();
    let path = folder.write("b.pack", &without.to_bytes().unwrap());
    assert!(done(&["verify", &path]).contains("has no self-test"));
}

// The last output of the last test signature, right before the card, is changed, and the hash is corrected.
#[test]
fn a_pack_with_other_outputs_fails() {
    let (folder, _, mut bytes) = folder();
    let card = contents(Precision::Bytes).card.to_string().len();
    let last = bytes.len() - card - 8;
    bytes[last..last + 4].copy_from_slice(&100_f32.to_le_bytes());
    let hash = content_hash(&bytes[HEADER..]);
    bytes[16..HEADER].copy_from_slice(&hash.to_le_bytes());
    let path = folder.write("wrong.pack", &bytes);
    let outcome = run(&["pack", "verify", &path]);
    assert_eq!(outcome.code, Some(FAILED), "{outcome:?}");
    assert!(outcome.stdout.contains("Self-test failed"), "{outcome:?}");
    assert!(
        outcome.stdout.contains("Do not use this pack"),
        "{outcome:?}"
    );
    // Nobody can use it.
    let table = folder.write("test.csv", Table::clean().csv().as_bytes());
    run(&["identify", &table, "--pack", &path]).refused(UNREADABLE, &["wrong.pack", "self-test"]);
}

#[test]
fn the_built_in_pack_is_shown_or_said_to_be_absent() {
    for action in ["show", "verify"] {
        if DEFAULT.is_empty() {
            run(&["pack", action, "default"]).refused(UNREADABLE, &["default", "no bytes"]);
        } else {
            done(&[action, "default"]);
        }
    }
}

// ---------------------------------------------------------------- files that are no pack

#[test]
fn damaged_files_are_refused() {
    let (folder, path, bytes) = folder();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 4;
    let mut newer = bytes.clone();
    newer[8] = 9;
    let longer = [&bytes[..], b"more"].concat();
    let length = bytes.len();
    let cut_at = format!("cut off after {} of {length} bytes", length / 2);
    let onnx = onnx::export(&network(4, OUTPUTS, 1), None, &[]).unwrap();
    for (name, bytes, words) in [
        ("flipped", &flipped[..], "is damaged: its content hash"),
        ("newer", &newer, "made by a newer onecycle"),
        ("longer", &longer, "its header says"),
        ("cut", &bytes[..length / 2], &cut_at),
        ("header", &bytes[..10], "cut off"),
        ("empty", &[], "no bytes"),
        ("csv", b"time_s,pv,u\n0,1,2\n", "not a pack of onecycle"),
        ("onnx", &onnx, "not a pack of onecycle"),
    ] {
        let path = folder.write(name, bytes);
        let (onnx, out) = (folder.name("out.onnx"), folder.name("out.pack"));
        for arguments in [
            &["show", &path][..],
            &["verify", &path],
            &["export", &path, "--onnx", &onnx],
            &["import", "model.onnx", "--like", &path, "--out", &out],
        ] {
            run(&[&["pack"], arguments].concat()).refused(UNREADABLE, &[name, words]);
        }
        assert!(!folder.files().iter().any(|name| name.starts_with("out.")));
    }
    run(&["pack", "show", &folder.name("nosuch")]).refused(UNREADABLE, &["nosuch", "No such file"]);
    run(&["pack", "show", &folder.name("")]).refused(UNREADABLE, &["directory"]);
    run(&[
        "pack",
        "export",
        &path,
        "--onnx",
        &folder.name("nosuch/a.onnx"),
    ])
    .refused(NOT_WRITTEN, &["cannot write", "nosuch"]);
}

#[test]
fn bad_arguments() {
    for (arguments, words) in [
        (&[][..], "Usage"),
        (&["show"], "required arguments"),
        (&["look", "a.pack"], "unrecognized subcommand"),
        (&["export", "a.pack"], "--onnx"),
        (&["import", "a.onnx", "-o", "b.pack"], "--like"),
        (&["import", "a.onnx", "--like", "a.pack"], "--out"),
    ] {
        let outcome = run(&[&["pack"], arguments].concat());
        assert_eq!(outcome.code, Some(2), "{outcome:?}");
        assert!(outcome.stderr.contains(words), "{words}: {outcome:?}");
    }
    for action in [
        &[][..],
        &["show"],
        &["verify"],
        &["export"],
        &["import"],
        &["margin"],
    ] {
        let text = done(&[action, &["--help"]].concat());
        assert!(text.contains("Example"), "{text}");
    }
}

// ---------------------------------------------------------------- export and import

fn samples(path: &str) -> (Matrix, Vec<f32>) {
    const ROWS: usize = 1000;
    let column = |name, width| Column {
        name,
        width: Some(width),
        numbers: Numbers::F32(Vec::new()),
    };
    let like = [column("inputs", LENGTH), column("outputs", OUTPUTS)];
    let read = npz::read(&std::fs::read(path).unwrap(), &like, ROWS).unwrap();
    let [inputs, outputs] = [0, 1].map(|number| match &read[number].numbers {
        Numbers::F32(values) => values.clone(),
        _ => unreachable!("numbers are of single precision"),
    });
    (Matrix::from_rows(ROWS, LENGTH, inputs).unwrap(), outputs)
}

// The exported model is the network of the pack after its normalisation; outputs differ by rounding only.
#[test]
fn what_is_exported_computes_the_same() {
    let (folder, path, bytes) = folder();
    let (model, out) = (folder.name("a.onnx"), folder.name("a.npz"));
    assert_eq!(
        done(&["export", &path, "--onnx", &model, "--samples", &out]),
        ""
    );
    let imported = onnx::import(&std::fs::read(&model).unwrap()).unwrap();
    let Normalisation { offsets, scales } = imported.normalisation.unwrap();
    let (mut inputs, expected) = samples(&out);
    assert_eq!(inputs.rows(), 1000);
    let pack = Pack::read(&bytes).unwrap();
    let first: [f32; LENGTH] = inputs.row(0).try_into().unwrap();
    assert_eq!(pack.outputs(&first)[..], expected[..OUTPUTS]);
    for i in 0..inputs.rows() {
        for (j, value) in inputs.row_mut(i).iter_mut().enumerate() {
            *value = (*value - offsets[j]) * scales[j];
        }
    }
    let found = imported.network.evaluate(&inputs, &OneThread).unwrap();
    for (found, expected) in found.values().iter().zip(expected) {
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }
}

// 8-bit weights are the same after export and import: the largest of each row is 127 steps.
#[test]
fn a_network_comes_back_from_onnx() {
    let (folder, path, bytes) = folder();
    let (model, out) = (folder.name("a.onnx"), folder.name("b.pack"));
    done(&["export", &path, "--onnx", &model]);
    let text = done(&["import", &model, "--like", &path, "--out", &out]);
    assert!(text.contains("Scores   cleared"), "{text}");
    assert!(
        text.contains("Inputs   normalisation from ") && text.contains("a.onnx\n"),
        "{text}"
    );
    let made = std::fs::read(&out).unwrap();
    let (old, new) = (Pack::read(&bytes).unwrap(), Pack::read(&made).unwrap());
    let (old_contents, new_contents) = (
        PackContents::read(&old).unwrap(),
        PackContents::read(&new).unwrap(),
    );
    for (old, new) in old_contents.layers.iter().zip(&new_contents.layers) {
        let (PackedWeights::Bytes { rows: old, .. }, PackedWeights::Bytes { rows: new, .. }) =
            (&old.weights, &new.weights)
        else {
            unreachable!("both are of bytes");
        };
        assert_eq!(old, new);
    }
    assert_eq!(new_contents.input_offsets, old_contents.input_offsets);
    assert_eq!(new_contents.lead_table, old_contents.lead_table);
    assert_eq!(new_contents.card["scores"], Value::Null);
    assert_eq!(new_contents.card["imported"]["network"], "a.onnx");
    let other = &new_contents.card["imported"]["all_else_from"];
    assert_eq!(other["hash"], format!("{:016x}", old.content_hash()));
    assert_eq!(other["card"], json!({ "seed": 7 }));
    done(&["verify", &out]);
}

#[test]
fn a_network_of_other_widths_is_packed() {
    let (folder, path, _) = folder();
    let learnt = network(20, OUTPUTS, 9);
    let model = folder.write("learnt.onnx", &onnx::export(&learnt, None, &[]).unwrap());
    let out = folder.name("learnt.pack");
    let text = done(&["import", &model, "--like", &path, "-o", &out]);
    assert!(
        text.contains("34-20-14, tanh none, 8-bit weights"),
        "{text}"
    );
    assert!(text.contains("a.pack\nRounding"), "{text}");
    // The weights stay floats if the other pack has floats.
    let floats = contents(Precision::Floats).to_bytes().unwrap();
    let floats = folder.write("floats.pack", &floats);
    done(&["import", &model, "--like", &floats, "-o", &out]);
    let made = std::fs::read(&out).unwrap();
    let made = PackContents::read(&Pack::read(&made).unwrap()).unwrap();
    assert_eq!(made.network().unwrap(), learnt);
}

#[test]
fn networks_that_do_not_fit_are_refused() {
    let (folder, path, bytes) = folder();
    let out = folder.name("out.pack");
    let onnx_of = |network: &Network| onnx::export(network, None, &[]).unwrap();
    let narrow = Network::zeros(5, &[Layer::Dense { outputs: OUTPUTS }]).unwrap();
    for (name, bytes, words) in [
        ("a.txt", &b"text"[..], "not an ONNX model"),
        ("a.onnx", &bytes, "not an ONNX model"),
        (
            "b.onnx",
            &onnx_of(&network(9, 13, 1)),
            "14 outputs, but has 13",
        ),
        ("c.onnx", &onnx_of(&narrow), "5 inputs, but gets 34"),
        (
            "d.onnx",
            &onnx_of(&network(200, OUTPUTS, 1)),
            "1 to 128 wide",
        ),
    ] {
        let model = folder.write(name, bytes);
        run(&["pack", "import", &model, "--like", &path, "-o", &out])
            .refused(UNREADABLE, &[name, words]);
        assert!(!folder.files().contains(&"out.pack".to_owned()));
    }
    let missing = folder.name("nosuch.onnx");
    run(&["pack", "import", &missing, "--like", &path, "-o", &out])
        .refused(UNREADABLE, &["nosuch.onnx", "No such file"]);
    let nowhere = folder.name("nosuch/out.pack");
    let model = folder.write("g.onnx", &onnx_of(&network(9, OUTPUTS, 1)));
    run(&["pack", "import", &model, "--like", &path, "-o", &nowhere])
        .refused(NOT_WRITTEN, &["cannot write", "nosuch"]);
}

#[test]
fn a_pack_of_another_margin_keeps_all_else() {
    let folder = Scratch::new();
    let out = folder.name("calm.pack");
    let text = done(&["margin", "default", "--phase-margin", "45", "-o", &out]);
    assert!(text.contains("Margin   45.00 deg"), "{text}");
    done(&["verify", &out]);
    let bytes = std::fs::read(&out).unwrap();
    let calm = PackContents::read(&Pack::read(&bytes).unwrap()).unwrap();
    let usual = PackContents::read(&Pack::embedded().unwrap()).unwrap();
    assert_ne!(calm.lead_table, usual.lead_table);
    // Back at 20 degrees it is the pack built in, to the bit.
    let back = folder.name("back.pack");
    done(&["margin", &out, "--phase-margin", "20", "-o", &back]);
    assert_eq!(std::fs::read(&back).unwrap(), DEFAULT);

    // The packs of the autopilots.
    let flown = concat!(env!("CARGO_MANIFEST_DIR"), "/../../autopilots/");
    for (margin, extra, name) in [
        ("35", "0", "margin_35.pack"),
        ("25", "4%", "margin_25.pack"),
    ] {
        done(&[
            "margin",
            "default",
            "--phase-margin",
            margin,
            "--extra-ise",
            extra,
            "-o",
            &out,
        ]);
        assert_eq!(
            std::fs::read(&out).unwrap(),
            std::fs::read(format!("{flown}{name}")).unwrap()
        );
    }

    let nowhere = folder.name("nosuch/out.pack");
    run(&[
        "pack",
        "margin",
        "default",
        "--phase-margin",
        "30",
        "-o",
        &nowhere,
    ])
    .refused(NOT_WRITTEN, &["cannot write", "nosuch"]);
}
