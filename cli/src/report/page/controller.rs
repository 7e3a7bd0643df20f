//! The controller in the forms that autopilots and plant controllers ask for.

use onecycle::Design;

use super::significant;
use crate::pages::page::{self, Section};
use crate::report::units::Units;

/// `input_bias`: constant to subtract from `u` (input unit), for the controller has no integral.
pub(super) fn section(design: &Design, units: &Units, input_bias: Option<f64>) -> Section {
    let (kp, kd) = (design.controller.kp(), design.controller.kd());
    let (gain, rate) = (units.controller(""), units.controller(" s"));
    let gains = format!("Kp {}{gain}, Kd {}{rate}", significant(kp), significant(kd));
    let forms = [
        ("PD", design.controller.form().law(), gains.clone()),
        (
            "Cascade P/P",
            "rate wanted w = P_angle (r - y), u = P_rate (w - dy/dt)",
            format!(
                "P_angle {} 1/s, P_rate {}{rate}",
                significant(kp / kd),
                significant(kd)
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
                significant(kp),
                significant(kd / kp)
            ),
        ),
    ];
    let forms = forms.map(|(name, law, values)| (name, format!("{values}: {law}")));
    let mut body = page::facts(&forms)
        + &page::paragraph(
            "source",
            "Four forms of the same controller, with e = r - y. The derivative acts on the measurement: a step of the \
             reference gives no kick. There is no integral action: a constant disturbance at the input leaves an \
             offset of its size divided by Kp.",
        );
    if let Some(bias) = input_bias {
        let (bias, offset) = (significant(bias), significant(bias / kp));
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
                "The input bias is {bias}{}: subtract it from u, or the output stays {offset}{} off the reference.",
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
