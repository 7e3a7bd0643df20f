//! Designs in the named styles on random processes of every structure.

use onecycle_design::{
    DesignError, Execution, Form, Linear, MeasurementNoise, Model, Specification, Structure, Style,
    design, margins, sensitivity,
};

/// Numbers of the splitmix64 sequence (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        low + (high - low) * (z >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Ten to the power of a uniform number.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.uniform(low, high))
    }

    fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.uniform(0.0, choices.len() as f64) as usize]
    }

    /// Process of any structure: gains of either sign over six decades, a time scale from 0.1 ms to 10^5 s, and times
    /// spread over four decades about it.
    fn process(&mut self) -> Model {
        let structure = self.one_of(&Structure::ALL);
        let scale_s = self.decades(-3.0, 4.0);
        let sign = self.one_of(&[1.0, 1.0, 1.0, -1.0]);
        let natural = 1.0 / scale_s;
        let damping = self.decades(-2.5, 0.7);
        Linear::new(structure)
            .with_gain(sign * self.decades(-3.0, 3.0))
            .with_lags_s([
                scale_s * self.decades(-3.0, 0.0),
                scale_s * self.decades(-3.0, 0.0),
            ])
            .with_pole_per_s(self.one_of(&[0.0, 1.0, 1.0, 1.0]) * self.decades(-2.0, 1.5) / scale_s)
            .with_pair(2.0 * damping * natural, natural * natural)
            .with_tau_s(scale_s * self.decades(-3.0, 1.0))
            .into()
    }

    fn specification(&mut self, model: &Model) -> Specification {
        let form = self.one_of(&Form::ALL);
        let style = self.one_of(&[Style::Sharp, Style::Balanced, Style::Calm]);
        let asked = Specification::new(form, style);
        let tau_s = model.linear().tau_s();
        let asked = match self.one_of(&[0, 0, 1, 2]) {
            1 => asked.with_execution(Execution::sampled(tau_s * self.decades(-2.0, 0.3))),
            _ => asked,
        };
        if self.uniform(0.0, 1.0) < 0.15 {
            let std = self.decades(-4.0, -1.0);
            asked.with_noise(MeasurementNoise::new(
                std,
                tau_s * self.decades(-2.0, 0.0),
                1.0,
            ))
        } else {
            asked
        }
    }
}

#[test]
fn every_design_is_stable_and_keeps_its_limits() {
    let mut random = Random(1);
    let mut count = std::collections::HashMap::new();
    let n: usize = std::env::var("N").map_or(600, |n| n.parse().unwrap());
    for i in 0..n {
        let model = random.process();
        let asked = random.specification(&model);
        let t = std::time::Instant::now();
        let found = design(&model, &asked);
        let el = t.elapsed().as_secs_f64();
        let name = match &found {
            Ok(_) => "ok".to_string(),
            Err(e) => format!("{e:?}").split('{').next().unwrap().to_string(),
        };
        *count
            .entry(format!(
                "{} {:?} {name}",
                if asked.noise.is_some() { "noise" } else { "" },
                asked.form
            ))
            .or_insert((0, 0.0)) = {
            let c = count
                .get(&format!(
                    "{} {:?} {name}",
                    if asked.noise.is_some() { "noise" } else { "" },
                    asked.form
                ))
                .copied()
                .unwrap_or((0, 0.0f64));
            (c.0 + 1, c.1 + el)
        };
        if el > 0.1
            || matches!(
                found,
                Err(DesignError::Infeasible { .. } | DesignError::Unbounded)
            )
        {
            let boring = model.linear().structure().stages().integrators
                + usize::from(
                    model.linear().structure().stages().poles > 0
                        && model.linear().pole_per_s() == 0.0,
                )
                > 1
                && matches!(asked.form, Form::P | Form::Pi);
            if !boring {
                println!(
                    "{i} {el:.3} s {:?} {:?} noise {} h {:.2e} -> {:?}",
                    model.linear(),
                    asked.form,
                    asked.noise.is_some(),
                    asked.execution.sample_period_s,
                    found.as_ref().map(|_| ())
                );
            }
        }
        if let Ok(found) = found {
            let peaks = sensitivity(&model, &found.controller).unwrap();
            assert!(peaks.ms < asked.ms * 1.001 && peaks.mt < asked.mt * 1.001);
            assert_eq!(margins(&model, &found.controller), Some(found.margins));
        }
    }
    let mut c: Vec<_> = count.into_iter().collect();
    c.sort_by(|a, b| a.0.cmp(&b.0));
    for (k, (n, s)) in c {
        println!("{k}: {n}, mean {:.2} ms", 1e3 * s / n as f64);
    }
}

fn posterior(n: usize, seed: u64, spread: [f64; 4]) -> Vec<Model> {
    let mut random = Random(seed);
    (0..n)
        .map(|_| {
            let mut normal = |scale: f64| {
                let u: f64 = random.uniform(1e-12, 1.0);
                let v = random.uniform(0.0, std::f64::consts::TAU);
                (scale * (-2.0 * u.ln()).sqrt() * v.cos() / 1.645).exp()
            };
            let [ratio, lag, body, tau] = spread;
            let body = normal(body);
            Linear::new(Structure::Soiptd)
                .with_gain(normal(ratio) / 1.6886)
                .with_lags_s([0.0321 * normal(lag), 1.0])
                .with_pole_per_s(1.0 / (1.6886 * body))
                .with_tau_s(0.0237 * normal(tau))
                .into()
        })
        .collect()
}

#[test]
fn robust_dbg() {
    let model = posterior(1, 1, [0.0; 4])[0];
    for spread in [[0.0075, 0.044, 0.2, 0.046], [0.1, 0.3, 0.3, 0.3]] {
        let draws = posterior(200, 3, spread);
        let fresh = posterior(400, 4, spread);
        for form in [Form::Pid, Form::CascadePi, Form::Pd, Form::CascadePid] {
            let asked = Specification::new(form, Style::Balanced);
            let asked = if form == Form::Pid {
                asked.with_filter_s(0.002)
            } else {
                asked
            };
            let t = std::time::Instant::now();
            let found = onecycle_design::design_over(&model, &draws, &asked);
            println!("{form:?} {:?}", t.elapsed());
            match found {
                Ok(found) => {
                    let kept = fresh
                        .iter()
                        .filter(|m| {
                            sensitivity(m, &found.controller)
                                .is_some_and(|s| s.ms < 1.6 && s.mt < 1.6)
                        })
                        .count();
                    println!("   {:?} fresh {}", found.robustness, kept as f64 / 400.0);
                }
                Err(e) => println!("   {e:?}"),
            }
        }
    }
}
