//! What the likelihood used, chose and checked, as rows of a name and a value, for the text and the page.

use onecycle::{Identification, Innovations, Recorded, SetPointResponse, Structure};
use onecycle_identify::{Alternative, InnovationTests, Noise, Prediction};

use super::number::{frequency, percent, seconds, significant};
use super::units::Units;

/// Name and value.
pub(super) type Fact = (&'static str, String);

/// Structures that are named beside the chosen one.
const MOST_NAMED: usize = 3;

/// The part of the recording that was used, and its input.
pub(super) fn of_recording(found: &Identification, record: &Recorded, units: &Units) -> Vec<Fact> {
    let mut facts = vec![
        ("used", used(record)),
        (
            "input",
            format!(
                "{} between samples, standard deviation {}",
                match record.hold {
                    onecycle::Hold::Interpolated => "straight lines",
                    _ => "held",
                },
                with_unit(record.input_deviation, &units.input)
            ),
        ),
        (
            "output",
            format!(
                "standard deviation {}",
                with_unit(record.output_deviation, &units.output)
            ),
        ),
    ];
    if let Some((low, high)) = record.informative_rad_per_s {
        let band = format!(
            "{} .. {} hold 90 % of the information on the gain",
            frequency(low),
            frequency(high)
        );
        facts.push(("excited", band));
    }
    facts.extend(of_relay(found));
    facts
}

/// How the relay switched, and what its two amplitudes show.
pub(super) fn of_relay(found: &Identification) -> Vec<Fact> {
    let mut facts = vec![];
    if let Some(switching) = found.switching {
        facts.push((
            "beta seen",
            format!("{:.2} ({} cycles)", switching.beta, switching.cycles),
        ));
    }
    if let Some(test) = found.amplitudes.filter(|test| test.is_alike) {
        let [first, second] = test.amplitudes.map(significant);
        facts.push((
            "amplitudes",
            format!(
                "{first} and {second}: the same process (gain {:+.1} %, phase {:+.1} deg)",
                100.0 * (test.gain_ratio - 1.0),
                test.phase_rad.to_degrees()
            ),
        ));
    }
    facts
}

fn used(record: &Recorded) -> String {
    let mut text = format!(
        "{:.3} to {:.3} s, {} samples every {}",
        record.start_s,
        record.end_s,
        record.samples,
        seconds(record.sample_s)
    );
    for (count, what) in [(record.absent, "absent"), (record.outliers, "outliers")] {
        if count > 0 {
            text += &format!(", {count} {what}");
        }
    }
    text
}

/// How the model was chosen, its noise and its checks.
pub(super) fn of_model(chosen: Structure, innovations: &Innovations, units: &Units) -> Vec<Fact> {
    vec![
        ("structure", choice(chosen, &innovations.alternatives)),
        ("noise", noise(&innovations.noise, &units.output)),
        ("prediction", prediction(innovations.prediction.as_ref())),
        (
            "innovations",
            tests(&innovations.whiteness, innovations.widened),
        ),
    ]
}

/// The response to a set-point that a model was fitted to.
pub(super) fn of_response(chosen: Structure, found: &SetPointResponse, units: &Units) -> Vec<Fact> {
    let band = match (found.points.first(), found.points.last()) {
        (Some(first), Some(last)) => format!(
            "{} frequencies from {} to {} over {} segments",
            found.points.len(),
            frequency(first.omega_rad_per_s),
            frequency(last.omega_rad_per_s),
            found.segments
        ),
        _ => "none".to_owned(),
    };
    let ratio = found.chi_squared / found.freedom;
    let widened = match found.widened > 1.0 {
        true => format!(
            "; the intervals are {} times wider for it",
            significant(found.widened)
        ),
        false => String::new(),
    };
    vec![
        ("structure", chosen.name().to_owned()),
        ("response", band),
        (
            "errors",
            format!(
                "mean square {} times that of the noise{widened}",
                significant(ratio)
            ),
        ),
        (
            "noise",
            format!(
                "standard deviation {} at the highest frequencies",
                with_unit(found.noise_sigma, &units.output)
            ),
        ),
    ]
}

/// The chosen structure, with the difference of the BIC of the others.
fn choice(chosen: Structure, alternatives: &[Alternative]) -> String {
    let structures: Vec<(Structure, f64)> = (alternatives.iter())
        .map(|alternative| (alternative.model.structure(), alternative.bic))
        .collect();
    chosen_of(chosen, &structures)
}

/// As [`choice`], of structures with their BIC.
fn chosen_of(chosen: Structure, alternatives: &[(Structure, f64)]) -> String {
    let of = |wanted| {
        let found = alternatives
            .iter()
            .find(|(structure, _)| *structure == wanted);
        found.map(|(_, bic)| *bic)
    };
    let Some(own) = of(chosen).filter(|_| alternatives.len() > 1) else {
        return format!("{}; no other was fitted or comes near", chosen.name());
    };
    let others: Vec<String> = (alternatives.iter())
        .filter(|(structure, _)| *structure != chosen)
        .take(MOST_NAMED)
        .map(|(structure, bic)| format!("{} {:+.1}", structure.name(), bic - own))
        .collect();
    let rank = if alternatives.iter().all(|(_, bic)| own <= *bic) {
        "has the least BIC"
    } else {
        "is the simplest of those as good"
    };
    format!(
        "{} {rank}; BIC of others: {}",
        chosen.name(),
        others.join(", ")
    )
}

/// The white noise and the disturbances.
fn noise(noise: &Noise, unit: &str) -> String {
    let kinds = [
        (
            noise.w1_rad_per_s,
            "random-walk disturbance at the process input",
        ),
        (noise.w0_rad_per_s, "white disturbance at the process input"),
        (noise.wy_rad_per_s, "random walk of the measured output"),
    ];
    let mut text = format!("{} white per sample", with_unit(noise.sigma, unit));
    for (w, what) in kinds {
        if let Some(w) = w {
            text += &format!("; {what}, dominant below {}", frequency(w));
        }
    }
    text
}

fn prediction(prediction: Option<&Prediction>) -> String {
    prediction.map_or("the record is too short to test one".to_owned(), |tested| {
        format!(
            "{} of the variance of the last third, {} ahead; error {:.1} times the expected",
            percent(tested.explained),
            seconds(tested.horizon_s),
            tested.error_ratio.max(0.0).sqrt()
        )
    })
}

fn tests(tests: &InnovationTests, widened: f64) -> String {
    let widened = if widened > 1.0 {
        format!("; intervals widened {widened:.1} times")
    } else {
        String::new()
    };
    format!(
        "autocorrelation up to {:.2}, Ljung-Box {:.2} (white: 1), {} explained by the input{widened}",
        tests.autocorrelation,
        tests.ljung_box,
        percent(tests.input_share)
    )
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", significant(value))
        .trim_end()
        .to_owned()
}

#[cfg(test)]
mod test {
    use super::*;

    // The differences are those to the chosen structure, with their signs.
    #[test]
    fn the_choice_names_the_next_structures() {
        let all = [
            (Structure::Soptd, -100.0),
            (Structure::IntegratorLag, -97.5),
            (Structure::Foptd, 20.0),
            (Structure::Iptd, 30.0),
            (Structure::Resonant, 40.0),
        ];
        assert_eq!(
            chosen_of(Structure::IntegratorLag, &all),
            "integrator_lag is the simplest of those as good; BIC of others: soptd -2.5, foptd +117.5, iptd +127.5"
        );
        assert_eq!(
            chosen_of(Structure::Soptd, &all[..2]),
            "soptd has the least BIC; BIC of others: integrator_lag +2.5"
        );
        assert_eq!(
            chosen_of(Structure::Iptd, &[(Structure::Iptd, 1.0)]),
            "iptd; no other was fitted or comes near"
        );
    }
}
