//! Who is compared, and how: in turn, round after round.

use std::hint::black_box;
use std::time::Instant;

use cpu_time::ThreadTime;

use crate::Failure;
use crate::networks::Case;

/// Most that an output may differ from the sum in f64, of the largest output.
const TOLERANCE: f64 = 1e-4;

type Run<'a> = Box<dyn FnMut(&[f32], &mut Vec<f32>) -> Result<(), Failure> + 'a>;

/// One of those compared.
pub(crate) struct Contender<'a> {
    name: String,
    /// From a sample to outputs, in the memory of those before.
    run: Run<'a>,
    /// Whether its outputs are those of the network.
    has_outputs: bool,
}

impl<'a> Contender<'a> {
    /// One that puts out what the network does.
    pub(crate) fn new(
        name: impl Into<String>,
        run: impl FnMut(&[f32], &mut Vec<f32>) -> Result<(), Failure> + 'a,
    ) -> Self {
        Self {
            name: name.into(),
            run: Box::new(run),
            has_outputs: true,
        }
    }

    /// One that is there for its time alone.
    pub(crate) fn without_outputs(self) -> Self {
        Self {
            has_outputs: false,
            ..self
        }
    }
}

/// How often.
pub(crate) struct Rounds {
    count: usize,
    /// Calls that are timed together: more where one call is hardly longer than reading a clock.
    calls: usize,
}

impl Rounds {
    /// Some three seconds.
    pub(crate) const PAPER: Self = Self {
        count: 300,
        calls: 1,
    };
    /// Some one second.
    pub(crate) const SHIPPED: Self = Self {
        count: 300,
        calls: 100,
    };

    /// Prints the table, without those that fail; whether all outputs agree.
    pub(crate) fn report(
        &self,
        title: &str,
        all: Vec<Contender<'_>>,
        case: &Case,
    ) -> Result<bool, Failure> {
        let (mut contenders, mut differences) = (Vec::new(), Vec::new());
        for mut contender in all {
            match difference(&mut contender, case) {
                Ok(difference) => {
                    contenders.push(contender);
                    differences.push(difference);
                }
                Err(error) => println!("{} is left out: {error}\n", contender.name),
            }
        }
        let times = self.times(&mut contenders, &case.samples)?;

        println!("{title}\n");
        println!(
            "| batch of one, one thread (us) | median | fastest | median of processor time | \
             largest difference |"
        );
        println!("|---|---|---|---|---|");
        for ((contender, difference), times) in contenders.iter().zip(&differences).zip(&times) {
            let (median, fastest) = (middle(&times.wall_us), least(&times.wall_us));
            let processor = middle(&times.processor_us);
            let difference = difference.map_or("-".to_owned(), |value| format!("{value:.1e}"));
            let name = &contender.name;
            println!("| {name} | {median:.1} | {fastest:.1} | {processor:.1} | {difference} |");
        }
        println!();
        // No number is not a small difference.
        let do_agree = differences
            .iter()
            .flatten()
            .all(|&value| value <= TOLERANCE);
        if !do_agree {
            println!("outputs differ by more than {TOLERANCE:.0e} of the largest\n");
        }
        Ok(do_agree)
    }

    fn times(
        &self,
        contenders: &mut [Contender<'_>],
        samples: &[Vec<f32>],
    ) -> Result<Vec<Times>, Failure> {
        let mut times = vec![Times::default(); contenders.len()];
        let mut outputs = Vec::new();
        let calls = self.calls as f64;
        for round in 0..self.count {
            for (contender, times) in contenders.iter_mut().zip(&mut times) {
                let (begin, processor) = (Instant::now(), ThreadTime::now());
                for call in 0..self.calls {
                    let sample = &samples[(round + call) % samples.len()];
                    (contender.run)(black_box(sample), &mut outputs)?;
                    black_box(&outputs);
                }
                let processor_s = processor.elapsed().as_secs_f64();
                let wall_s = begin.elapsed().as_secs_f64();
                times.wall_us.push(1e6 * wall_s / calls);
                times.processor_us.push(1e6 * processor_s / calls);
            }
        }
        Ok(times)
    }
}

/// Of a call, in every round: by the clock on the wall, and without what other programs took of the
/// thread's time.
#[derive(Clone, Default)]
struct Times {
    wall_us: Vec<f64>,
    processor_us: Vec<f64>,
}

fn middle(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn least(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The largest over all samples, of the sample's largest output.
fn difference(contender: &mut Contender<'_>, case: &Case) -> Result<Option<f64>, Failure> {
    let (mut worst, mut outputs) = (0.0, Vec::new());
    for (sample, expected) in case.samples.iter().zip(&case.expected) {
        (contender.run)(sample, &mut outputs)?;
        if !contender.has_outputs {
            continue;
        }
        if outputs.len() != expected.len() {
            let (found, expected) = (outputs.len(), expected.len());
            return Err(format!("it puts out {found} numbers, not {expected}").into());
        }
        let largest = (expected.iter()).fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (found, expected) in outputs.iter().zip(expected) {
            let difference = (f64::from(*found) - expected).abs() / largest;
            // No number is the worst of all differences.
            if !(difference <= worst) {
                worst = difference;
            }
        }
    }
    Ok(contender.has_outputs.then_some(worst))
}
