//! From a process to its controllers: `cargo run -p onecycle --example design`.
//!
//! The paper's altitude at three phase margins: what more margin costs in squared error and speed, and what it buys in
//! overshoot and in delay that the loop can bear.

#![expect(clippy::print_stdout, reason = "an example reports")]

use std::error::Error;

use onecycle::{Soiptd, step_response, tune};

fn main() -> Result<(), Box<dyn Error>> {
    // K, T_prop (s), T_body (s), delay (s).
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
    println!("margin   Kp      Kd      ISE (s)  rise (s)  settling (s)  overshoot  delay margin");
    for phase_margin_deg in [20.0_f64, 45.0, 60.0] {
        let best = tune(&process, phase_margin_deg.to_radians())?;
        let step = step_response(&process, best.pd)?.metrics;
        println!(
            "{phase_margin_deg:>3.0} deg  {:<6.2}  {:<6.3}  {:<7.4}  {:<8.3}  {:<12.3}  {:>5.1} %    {:>5.1} ms",
            best.pd.kp,
            best.pd.kd,
            best.ise,
            step.rise_time_s,
            step.settling_time_s,
            100.0 * step.overshoot,
            1e3 * best.margins.delay_margin_s
        );
    }
    Ok(())
}
