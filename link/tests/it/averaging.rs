//! Long recordings: bounded memory, averages, gaps and jitter.

use onecycle_link::{
    Column, Columns, CsvOptions, Note, Position, Recording, RecordingBuilder, RecordingError,
    read_from,
};
use proptest::prelude::*;

fn columns() -> Columns {
    Columns::new(Column::named("t"), Column::named("u"), Column::named("y"))
}

/// Builds a recording of at most `max_points` from `(time, input, output)`.
fn build(
    samples: impl IntoIterator<Item = (f64, f64, f64)>,
    max_points: usize,
) -> Result<Recording, RecordingError> {
    let mut builder = RecordingBuilder::new(columns()).with_max_points(max_points);
    for (index, (time_s, input, output)) in (0..).zip(samples) {
        builder.push(Position::Sample(index), time_s, input, output)?;
    }
    builder.finish()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Integral of a held input from `time_s[0]` to `end_s`.
fn integral(time_s: &[f64], input: &[f64], end_s: f64) -> f64 {
    let ends = time_s[1..].iter().chain([&end_s]);
    time_s
        .iter()
        .zip(ends)
        .zip(input)
        .map(|((start, end), input)| (end - start) * input)
        .sum()
}

#[test]
fn averaging_starts_when_the_points_are_full() {
    let samples = |count: u32| (0..count).map(|i| (f64::from(i), 1.0, f64::from(i)));
    let full = build(samples(64), 64).unwrap();
    assert_eq!((full.len(), full.samples_per_point()), (64, 1));
    let averaged = build(samples(65), 64).unwrap();
    assert_eq!((averaged.len(), averaged.samples_per_point()), (32, 2));
    assert_eq!(averaged.time_s()[..3], [0.0, 2.0, 4.0]);
    assert_eq!(averaged.output()[..3], [0.5, 2.5, 4.5]);
    assert_eq!(averaged.output_delay_s(), 0.5);
    assert_eq!(
        averaged.notes(),
        [Note::Averaged {
            samples_per_point: 2,
            dropped: 1
        }]
    );
}

#[test]
fn a_million_rows_within_a_bound() {
    let mut text = String::from("t,pv,u\n");
    for i in 0..1_000_000 {
        let u = if i / 1000 % 2 == 0 { 0.25 } else { -0.25 };
        text += &format!("{:.3},{i},{u}\n", f64::from(i) / 1000.0);
    }
    let options = CsvOptions::default().max_points(1000);
    let recording = read_from(text.as_bytes(), &options).unwrap();
    // 1000 points of 2^n samples: the first power of two with 1e6 / 2^n <= 1000 is 1024.
    assert_eq!(
        (recording.len(), recording.samples_per_point()),
        (976, 1024)
    );
    // Samples i .. i + 1023 have the mean i + 511.5.
    for (point, &output) in recording.output().iter().enumerate() {
        let expected = 1024.0 * point as f64 + 511.5;
        assert!(
            (output - expected).abs() < 1e-9 * expected,
            "{point}: {output}"
        );
    }
    assert!((recording.sample_period_s() - 1e-3).abs() < 1e-15);
    assert!((recording.output_delay_s() - 0.5115).abs() < 1e-12);
    assert!(recording.jitter() < 1e-6);
    assert_eq!(recording.gaps(), []);
}

#[test]
fn no_average_across_a_gap() {
    // A gap of 50 s after every 101 samples at 1 Hz; the output counts the stretches.
    let samples: Vec<(f64, f64, f64)> = (0..1010)
        .map(|i| {
            (
                f64::from(i + 50 * (i / 101)),
                f64::from(i % 2),
                f64::from(i / 101),
            )
        })
        .collect();
    let recording = build(samples.iter().copied(), 256).unwrap();
    // In groups of 4, each stretch has 25 points and drops 1 sample.
    assert_eq!((recording.len(), recording.samples_per_point()), (250, 4));
    assert!(
        recording
            .output()
            .iter()
            .all(|output| output.fract() == 0.0)
    );
    assert!(recording.input().iter().all(|&input| input == 0.5));
    assert_eq!(recording.gaps().len(), 9);
    for (gap, stretch) in recording.gaps().iter().zip(1..) {
        assert_eq!(gap.index, 25 * stretch);
        assert_eq!(gap.end_s, recording.time_s()[gap.index]);
        // The dropped sample is the last before the gap.
        assert_eq!(gap.start_s, gap.end_s - 51.0);
    }
    assert_eq!(recording.sample_period_s(), 1.0);
    assert_eq!(recording.jitter(), 0.0);
    let expected = "averaged the recording in groups of 4 samples; dropped 10 samples";
    assert!(
        recording.notes()[0].to_string().contains(expected),
        "{}",
        recording.notes()[0]
    );
}

#[test]
fn a_recording_of_nothing_but_gaps_is_refused() {
    // 1 Hz at first, then 0.1 Hz: after the rhythm is known, every increment is a gap.
    let samples = (0..1000).map(|i| (f64::from(if i < 100 { i } else { 10 * i }), 1.0, 1.0));
    let refusal = build(samples, 64).unwrap_err();
    let expected = matches!(refusal, RecordingError::TooManyGaps { .. });
    assert!(expected, "{refusal}");
}

#[test]
fn gaps_and_jitter_of_a_short_recording() {
    // Increments 0.9 and 1.1 s in turn, and one gap of 7 s: jitter 0.1 around 1 s.
    let mut time_s = vec![0.0];
    for i in 0..100 {
        let increment = if i == 40 { 7.0 } else { [0.9, 1.1][i % 2] };
        time_s.push(time_s[i] + increment);
    }
    let recording = Recording::from_samples(&time_s, &[1.0; 101], &[1.0; 101]).unwrap();
    let [gap] = recording.gaps() else {
        unreachable!("one gap")
    };
    assert_eq!(
        (gap.index, gap.start_s, gap.end_s),
        (41, time_s[40], time_s[41])
    );
    // 49 increments of 0.9 and 50 of 1.1: mean 1.00101, standard deviation 0.099995.
    assert!((recording.sample_period_s() - 99.1 / 99.0).abs() < 1e-12);
    assert!((recording.jitter() - 0.099_995 / 1.001_01).abs() < 1e-6);
    assert!(
        recording.notes()[0]
            .to_string()
            .contains("found 1 gap, the longest of 7.0 s")
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Averaging keeps the mean of the output and the integral of the input.
    #[test]
    fn averages_are_exact(
        samples in prop::collection::vec((0.2..1.8_f64, -1.0..1.0_f64, -1.0..1.0_f64), 2..2000),
    ) {
        let mut now_s = 0.0;
        let samples: Vec<_> = samples.into_iter().map(|(step_s, input, output)| {
            now_s += step_s;
            (now_s, input, output)
        }).collect();
        let recording = build(samples.iter().copied(), 64).unwrap();
        prop_assert!(recording.len() <= 64);
        prop_assert!(recording.gaps().is_empty());

        // All samples but those of an incomplete last group; the first of these ends the last point.
        let used = recording.len() * recording.samples_per_point();
        prop_assert!(samples.len() - used < recording.samples_per_point());
        let output: Vec<f64> = samples[..used].iter().map(|sample| sample.2).collect();
        prop_assert!((mean(recording.output()) - mean(&output)).abs() < 1e-12);
        if let Some(&(end_s, ..)) = samples.get(used) {
            let time_s: Vec<f64> = samples[..used].iter().map(|sample| sample.0).collect();
            let input: Vec<f64> = samples[..used].iter().map(|sample| sample.1).collect();
            let expected = integral(&time_s, &input, end_s);
            let found = integral(recording.time_s(), recording.input(), end_s);
            prop_assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
    }

    /// With gaps: every point is the mean of consecutive samples of one stretch.
    #[test]
    fn points_keep_to_their_stretch(
        stretches in prop::collection::vec(1..60_usize, 1..40),
        max_points in 8..64_usize,
    ) {
        let mut samples = Vec::new();
        let mut now_s = 0.0;
        for (stretch, &length) in stretches.iter().enumerate() {
            for _ in 0..length {
                samples.push((now_s, stretch as f64, stretch as f64));
                now_s += 1.0;
            }
            now_s += 100.0;
        }
        // Where more than a quarter of the steps that fill the store first are of 101 s, these are the sampling and not gaps.
        let steps = samples.windows(2).take(max_points & !1);
        let pauses = steps.clone().filter(|pair| pair[1].0 - pair[0].0 > 1.0).count();
        prop_assume!(4 * pauses <= steps.count());
        let Ok(recording) = build(samples.iter().copied(), max_points) else { return Ok(()) };
        let mut starts = vec![0];
        starts.extend(recording.gaps().iter().map(|gap| gap.index));
        for (index, &output) in recording.output().iter().enumerate() {
            prop_assert_eq!(output.fract(), 0.0);
            prop_assert_eq!(recording.input()[index], output);
            let changes = index > 0 && recording.output()[index - 1] != output;
            prop_assert!(!changes || starts.contains(&index));
        }
        for gap in recording.gaps() {
            prop_assert!(gap.start_s < gap.end_s);
            prop_assert!(recording.time_s()[gap.index - 1] <= gap.start_s);
            prop_assert_eq!(recording.time_s()[gap.index], gap.end_s);
        }
    }
}
