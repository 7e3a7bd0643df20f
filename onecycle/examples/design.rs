//! Design a controller for a process model: `cargo run -p onecycle --example design`.
//!
//! The altitude of the paper's hexacopter: the paper's PD at three phase margins. A larger phase margin gives less overshoot and a
//! larger delay margin, but a larger squared error and a slower rise.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{Model, Soiptd, Specification, design, step_response};

fn main() -> Result<(), Box<dyn Error>> {
    // K, T_prop (s), T_body (s), tau (s).
    let model = Model::from(Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?);
    println!("margin   Kp      Kd      ISE (s)  rise (s)  settling (s)  overshoot  delay margin");
    for phase_margin_deg in [20.0_f64, 45.0, 60.0] {
        let asked = Specification::paper().with_phase_margin_rad(phase_margin_deg.to_radians());
        let best = design(&model, &asked)?;
        let step = step_response(&model, &best.controller)?.metrics;
        println!(
            "{phase_margin_deg:>3.0} deg  {:<6.2}  {:<6.3}  {:<7.4}  {:<8.3}  {:<12.3}  {:>5.1} %    {:>5.1} ms",
            best.controller.kp(),
            best.controller.kd(),
            best.ise,
            step.rise_time_s,
            step.settling_time_s,
            100.0 * step.overshoot,
            1e3 * best.margins.delay_margin_s
        );
    }
    Ok(())
}
