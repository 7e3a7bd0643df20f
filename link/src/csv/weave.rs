//! Weaves signals with stamps of their own into rows at the stamps of the output.
//!
//! The input is held between its own samples. Its value in a row is the mean of the held input from that sample of the
//! output to the next, so a change in between acts with the right area. A row without a known input is left out.

/// A row at a sample of the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Woven {
    pub(super) line: u64,
    pub(super) time_s: f64,
    pub(super) input: f64,
    pub(super) output: f64,
    pub(super) set_point: Option<f64>,
}

/// The signals up to now. Times must not decrease; at one time, the input comes before the output.
#[derive(Debug, Default)]
pub(super) struct Weave {
    input: Option<f64>,
    set_point: Option<f64>,
    open: Option<Open>,
    pub(super) inputs: u64,
    pub(super) outputs: u64,
}

/// The newest sample of the output, with the integral of the input since.
#[derive(Debug)]
struct Open {
    row: Woven,
    area: f64,
    since_s: f64,
}

impl Weave {
    pub(super) fn input(&mut self, time_s: f64, value: f64) {
        self.inputs += 1;
        self.hold_until(time_s);
        self.input = Some(value);
    }

    pub(super) fn set_point(&mut self, value: f64) {
        self.set_point = Some(value);
    }

    /// Adds a sample of the output; returns the row of the one before.
    pub(super) fn output(&mut self, line: u64, time_s: f64, value: f64) -> Option<Woven> {
        self.outputs += 1;
        self.hold_until(time_s);
        let before = self.open.take().map(|open| {
            let length_s = time_s - open.row.time_s;
            let mean = open.area / length_s;
            Woven {
                input: if length_s > 0.0 && mean.is_finite() {
                    mean
                } else {
                    open.row.input
                },
                ..open.row
            }
        });
        self.open = self.input.map(|input| Open {
            row: Woven {
                line,
                time_s,
                input,
                output: value,
                set_point: self.set_point,
            },
            area: 0.0,
            since_s: time_s,
        });
        before
    }

    /// The last row, with the input held.
    pub(super) fn finish(&mut self) -> Option<Woven> {
        self.open.take().map(|open| open.row)
    }

    fn hold_until(&mut self, time_s: f64) {
        if let (Some(open), Some(input)) = (&mut self.open, self.input) {
            // Equal inputs keep their value exactly.
            open.area += input * (time_s - open.since_s);
            open.since_s = time_s;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Output at 0, 2, 4 s; the input is 1 from 0 s and 3 from 3.5 s: means 1 and (1.5 + 1.5)/2 = 1.5.
    #[test]
    fn the_input_is_averaged_between_outputs() {
        let mut weave = Weave::default();
        assert_eq!(weave.output(1, -1.0, 9.0), None);
        weave.input(0.0, 1.0);
        weave.set_point(7.0);
        assert_eq!(weave.output(2, 0.0, 10.0), None);
        let first = weave.output(3, 2.0, 11.0).unwrap();
        assert_eq!(
            (first.line, first.time_s, first.input, first.output),
            (2, 0.0, 1.0, 10.0)
        );
        assert_eq!(first.set_point, Some(7.0));
        weave.input(3.5, 3.0);
        assert_eq!(weave.output(5, 4.0, 12.0).unwrap().input, 1.5);
        assert_eq!(weave.finish().unwrap().input, 3.0);
    }
}
