//! Datasets on disk: the same bytes in any order of work, exact reading, and damaged files refused.

use onecycle_lab::experiments::{Family, Recipe};
use onecycle_lab::learn::dataset::shards::{
    DatasetError, EXAMPLES_PER_SHARD, Entry, ExampleRecord, Manifest, file_name,
};
use onecycle_lab::workers::{OneThread, Workers};

/// Few samples per period, for speed.
fn recipe() -> Recipe {
    let mut families = vec![Family::default(), Family::NEAR_DOUBLE_INTEGRATORS];
    for family in &mut families {
        family.samples_per_period = (60.0, 100.0);
    }
    Recipe {
        families,
        ..Recipe::default()
    }
}

/// One thread that works from the last part to the first.
struct Backwards;

impl Workers for Backwards {
    fn count(&self) -> usize {
        1
    }

    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        (0..parts).rev().for_each(part);
    }
}

/// A dataset of one file.
fn made(examples: u64) -> (Manifest, Vec<u8>) {
    let mut manifest = Manifest::new(recipe(), examples);
    let (bytes, entry) = manifest.make(0, &OneThread).unwrap();
    manifest.shards[0] = Some(entry);
    (manifest, bytes)
}

// A record reads back as the recipe makes it: the process to rounding, because the file holds T_body
// and the process its inverse; all else to the last bit.
#[test]
fn records_come_back() {
    let (manifest, bytes) = made(60);
    let records = manifest.records(0, &bytes).unwrap();
    assert_eq!(records.len(), manifest.rows());
    let expected: Vec<ExampleRecord> = (0..60)
        .filter_map(|n| recipe().record(n).unwrap())
        .collect();
    assert_eq!(records.len(), expected.len());
    assert!(records.len() >= 57);
    for (mut found, expected) in records.into_iter().zip(expected) {
        let (a, b) = (found.example.process, expected.example.process);
        for (x, y) in [
            (a.k_over_t_body(), b.k_over_t_body()),
            (a.t_prop_s(), b.t_prop_s()),
            (a.inv_t_body_per_s(), b.inv_t_body_per_s()),
            (a.tau_s(), b.tau_s()),
        ] {
            assert!((x / y - 1.0).abs() < 1e-15, "{a:?} {b:?}");
        }
        found.example.process = b;
        assert_eq!(found, expected);
    }
}

#[test]
fn the_same_bytes_in_any_order() {
    let (manifest, bytes) = made(40);
    let (backwards, entry) = manifest.make(0, &Backwards).unwrap();
    assert!(bytes == backwards, "other bytes");
    assert_eq!(manifest.shards[0].as_ref(), Some(&entry));
    // The first 40 of 60 examples are the same.
    let more = made(60);
    let more = more.0.records(0, &more.1).unwrap();
    let few = manifest.records(0, &bytes).unwrap();
    assert_eq!(more[..few.len()], few);
    assert!(more[few.len()].number >= 40);
}

#[test]
fn only_its_own_bytes_are_read() {
    let (mut manifest, bytes) = made(3);
    let damaged = Err(DatasetError::Damaged(file_name(0)));
    for k in [0, 100, bytes.len() / 2, bytes.len() - 1] {
        let mut other = bytes.clone();
        other[k] ^= 1;
        assert_eq!(manifest.records(0, &other), damaged);
        assert_eq!(manifest.records(0, &bytes[..k]), damaged);
    }
    assert_eq!(
        manifest.records(1, &bytes),
        Err(DatasetError::Unfinished(file_name(1)))
    );
    // A correct hash does not excuse a wrong number of rows or a text.
    let entry = manifest.shards[0].clone().unwrap();
    manifest.shards[0] = Some(Entry {
        rows: entry.rows + 1,
        ..entry
    });
    assert_eq!(manifest.records(0, &bytes), damaged);
    // SHA-256 of an empty file.
    let sha256 = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855".to_owned();
    let entry = Entry { rows: 0, sha256 };
    assert!(entry.is_of(&[]) && !entry.is_of(&[0]));
    manifest.shards[0] = Some(entry);
    assert_eq!(manifest.records(0, &[]), damaged);
}

#[test]
fn a_manifest_is_its_text() {
    let (manifest, _) = made(5);
    assert_eq!(Manifest::read(&manifest.text()), Ok(manifest.clone()));
    let spoilt = |from: &str, to: &str| {
        let text = manifest.text().replacen(from, to, 1);
        Manifest::read(&text).unwrap_err().to_string()
    };
    for (from, to, sentence) in [
        (
            "dataset/1",
            "dataset/2",
            "must be \"onecycle.dataset/1\", but is \"onecycle.dataset/2\"",
        ),
        ("\"program\"", "\"author\"", "unknown field `author`"),
        (
            "\"bias\": 0.5",
            "\"bias\": 5.0",
            "bias must be 0 to 0.9, but is 5.0",
        ),
        (
            "\"examples\": 5",
            "\"examples\": 4097",
            "must list 2 files for its 4097 examples, but lists 1",
        ),
        ("{", "", "not the manifest of a dataset"),
    ] {
        let error = spoilt(from, to);
        assert!(error.contains(sentence), "{error}");
    }
}

// If more examples are asked for, full files stay and the last file is made again. Another recipe,
// another program and fewer examples are refused.
#[test]
fn a_dataset_grows() {
    let entry = |rows| {
        let sha256 = String::new();
        Some(Entry { rows, sha256 })
    };
    let mut manifest = Manifest::new(recipe(), EXAMPLES_PER_SHARD + 10);
    assert_eq!(
        manifest.numbers(1),
        EXAMPLES_PER_SHARD..EXAMPLES_PER_SHARD + 10
    );
    manifest.shards = vec![entry(4000), entry(9)];
    assert_eq!(manifest.rows(), 4009);
    let go_on = |examples| manifest.clone().go_on(&recipe(), examples);
    assert_eq!(go_on(EXAMPLES_PER_SHARD + 10).unwrap(), manifest);
    let grown = go_on(3 * EXAMPLES_PER_SHARD).unwrap();
    assert_eq!(grown.shards, [entry(4000), None, None]);
    assert_eq!(grown.numbers(2).end, 3 * EXAMPLES_PER_SHARD);
    let fewer = go_on(EXAMPLES_PER_SHARD).unwrap_err();
    assert!(matches!(
        fewer,
        DatasetError::Fewer {
            asked: EXAMPLES_PER_SHARD,
            ..
        }
    ));
    let other = Recipe {
        seed: 2,
        ..recipe()
    };
    let refused = manifest.clone().go_on(&other, 10_000).unwrap_err();
    assert_eq!(refused, DatasetError::OtherRecipe);
    let text = manifest.text().replacen("onecycle 0", "onecycle 999", 1);
    let stranger = Manifest::read(&text).unwrap();
    let refused = stranger.go_on(&recipe(), 10_000).unwrap_err();
    assert!(refused.to_string().contains("made by onecycle 999"));
}

// Written in three lots of 3, 0 and the remaining rows. 2 whole numbers, 34 inputs, 3 times 4 and 6
// single columns make 54 columns. Read by the crate that wrote them, not by the code under test: every
// number to the last bit.
#[test]
fn parquet_has_the_records() {
    use onecycle_lab::learn::dataset::parquet::Writer;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    let (manifest, bytes) = made(8);
    let mut records = manifest.records(0, &bytes).unwrap();
    // A number that a signed column would return as negative.
    records[4].number = u64::MAX;
    let path = concat!(env!("CARGO_TARGET_TMPDIR"), "/records.parquet");
    let mut writer = Writer::new(std::fs::File::create(path).unwrap()).unwrap();
    for lot in [&records[..3], &[], &records[3..]] {
        writer.add(lot).unwrap();
    }
    writer.finish().unwrap();

    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let groups = reader.metadata().row_groups().iter();
    let rows: Vec<i64> = groups.map(|group| group.num_rows()).collect();
    assert_eq!(rows, [3, 0, records.len() as i64 - 3]);
    let mut read = 0;
    for (row, record) in reader.get_row_iter(None).unwrap().zip(&records) {
        let row: Vec<(String, Field)> = row.unwrap().into_columns();
        assert_eq!(row.len(), 54);
        assert_eq!(row, parquet_row(record));
        read += 1;
    }
    assert_eq!(read, records.len());
    std::fs::remove_file(path).unwrap();
}

/// The columns of a record, in order.
fn parquet_row(record: &ExampleRecord) -> Vec<(String, parquet::record::Field)> {
    use parquet::record::Field;
    let whole = |name: &str, x: u64| vec![(name.to_owned(), Field::ULong(x))];
    let real = |name: &str, x: f64| vec![(name.to_owned(), Field::Double(x))];
    let four = |name: &str, x: [f64; 4]| {
        let columns = x.into_iter().enumerate();
        let named = columns.map(|(k, x)| (format!("{name}_{k}"), Field::Double(x)));
        named.collect::<Vec<_>>()
    };
    let (example, process) = (&record.example, &record.example.process);
    let signature = &example.signature;
    let inputs = (signature.values.iter().enumerate())
        .map(|(k, &x)| (format!("inputs_{k:02}"), Field::Float(x)));
    let process = [
        process.k().unwrap(),
        process.t_prop_s(),
        process.t_body_s().unwrap(),
        process.tau_s(),
    ];
    [
        whole("number", record.number),
        whole("family", example.family as u64),
        inputs.collect(),
        four("values", record.values),
        four("gradient", record.gradient),
        real("period_s", example.period_s),
        real("amplitude", signature.sign * signature.amplitude),
        real("centre", signature.centre),
        four("process", process),
        real("bias", example.bias),
        real("sigma", example.sigma),
        real("samples_per_period", example.samples_per_period),
    ]
    .concat()
}
