//! The controller in the forms that it is entered in.

use onecycle_design::soiptd_pd::optimum::Optimum;

use super::significant;
use crate::pages::page::{self, Section};
use crate::report::text::Units;

/// `input_bias` is that of an identification, which a controller without an integral has to take away.
pub(super) fn section(optimum: &Optimum, units: &Units, input_bias: Option<f64>) -> Section {
    let pd = optimum.pd;
    let (gain, rate) = (units.controller(""), units.controller(" s"));
    let gains = format!(
        "Kp {}{gain}, Kd {}{rate}",
        significant(pd.kp),
        significant(pd.kd)
    );
    let forms = [
        ("PD", "u = Kp (r - y) - Kd dy/dt", gains.clone()),
        (
            "Cascade P/P",
            "rate wanted w = P_angle (r - y), u = P_rate (w - dy/dt)",
            format!(
                "P_angle {} 1/s, P_rate {}{rate}",
                significant(pd.angle_p()),
                significant(pd.rate_p())
            ),
        ),
        (
            "Parallel PID",
            "u = Kp e + Ki integral of e - Kd dy/dt",
            format!("{gains}, Ki 0"),
        ),
        (
            "Ideal PID",
            "u = Kp (e + 1/Ti integral of e - Td dy/dt)",
            format!(
                "Kp {}{gain}, Td {} s, Ti infinite",
                significant(pd.kp),
                significant(pd.kd / pd.kp)
            ),
        ),
    ];
    let forms = forms.map(|(name, law, values)| (name, format!("{values}: {law}")));
    let mut body = page::facts(&forms)
        + &page::paragraph(
            "source",
            "Four forms of the same controller; e is r - y. The rate is that of the measurement: a step of the reference then gives \
             no kick, and the predicted step holds. There is no integral action: a constant disturbance at the input \
             leaves an offset of its size over Kp.",
        );
    if let Some(bias) = input_bias {
        let (bias, offset) = (significant(bias), significant(bias / pd.kp));
        let unit = |unit: &str| {
            if unit.is_empty() {
                String::new()
            } else {
                format!(" {unit}")
            }
        };
        body += &page::paragraph(
            "note",
            &format!(
                "The process feels an input of {bias}{} besides the recorded one: subtract it from u, or the output \
                 stands {offset}{} off.",
                unit(&units.input),
                unit(&units.output)
            ),
        );
    }
    Section {
        id: "controller".to_owned(),
        title: "Controller".to_owned(),
        body,
    }
}
