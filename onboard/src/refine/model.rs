//! Model output over the rows for one combination of the linear unknowns, some bins per slice.

use super::LINEAR;
use super::domain::Shape;
use super::problem::Problem;
use crate::distortion;
use crate::process::Soiptd;
use crate::response::{self, Drive, Response};
use crate::transition::State;
use crate::window::Edge;

pub(super) struct Model {
    process: Option<Soiptd>,
    response: Response,
    /// The linear unknowns: y0, v0, w0, distortion, bias times gain, gain.
    of: [f64; LINEAR],
    drive: Drive,
    part: Part,
}

/// Part of the model that is being computed. The tag of the first variant is zero, so that an idle model is all
/// zeros and takes no space in flash.
#[repr(u8)]
enum Part {
    Response(response::Course),
    /// The distortion, before its first slice.
    Distorted,
    Distortion(distortion::DistortionCourse),
}

impl Model {
    /// All zeros: memory before the first use.
    pub(super) const NONE: Self = Self {
        process: None,
        response: Response::NONE,
        of: [0.0; LINEAR],
        drive: Drive::NONE,
        part: Part::Response(response::Course::NONE),
    };

    /// Sets the process of a shape; `None` if there is no such process.
    #[inline(never)]
    pub(super) fn set<const BINS: usize>(
        &mut self,
        problem: &Problem<BINS>,
        shape: &Shape,
    ) -> Option<()> {
        let process = problem.process(shape)?;
        self.response.set(&process, &problem.grid);
        self.process = Some(process);
        Some(())
    }

    /// Begins the rows of these linear unknowns.
    pub(super) fn begin<const BINS: usize>(
        &mut self,
        edges: &[Edge],
        of: &[f64; LINEAR],
        rows: &mut [f64; BINS],
    ) {
        rows.fill(0.0);
        let Some(process) = &self.process else {
            return;
        };
        let [y, v, w, _, constant, recorded] = *of;
        // The acceleration is used as a state because, unlike the force, it does not change when the lags are
        // exchanged, like K/(T_body T_prop) unlike K/T_body.
        let f = w + process.inv_t_body_per_s() * v;
        let unit = process.t_prop_s();
        self.of = *of;
        self.drive = Drive {
            initial: State { y, v, f },
            constant: unit * constant,
            recorded: unit * recorded,
        };
        self.part = if self.drive == Drive::NONE {
            Part::Distorted
        } else {
            Part::Response(response::Course::new(edges, &self.drive))
        };
    }

    /// Computes some bins: weighted means, and the rows of prior knowledge after them. True when the rows are
    /// complete; `even` is work memory.
    #[inline(never)]
    pub(super) fn follow<const BINS: usize>(
        &mut self,
        problem: &Problem<BINS>,
        edges: &[Edge],
        rows: &mut [f64; BINS],
        even: &mut [f64; BINS],
    ) -> bool {
        let bins = problem.bins();
        let [_, _, w, distortion, ..] = self.of;
        match (&mut self.part, &self.process) {
            (Part::Response(course), Some(_)) => {
                let offset_s = &problem.offset_s[..bins];
                let driven = (edges, &self.drive);
                if !(self.response).follow(driven, offset_s, &mut rows[..bins], course) {
                    return false;
                }
                if distortion != 0.0 {
                    self.part = Part::Distorted;
                    return false;
                }
            }
            (Part::Distorted, Some(process)) => {
                let course = distortion::DistortionCourse::new(process, &problem.grid, edges);
                self.part = Part::Distortion(course);
                return false;
            }
            (Part::Distortion(course), _) => {
                if !course.follow(edges, &mut even[..bins]) {
                    return false;
                }
                let scale = distortion * problem.fundamental.relay_acceleration;
                for (row, even) in rows[..bins].iter_mut().zip(&*even) {
                    *row += scale * even;
                }
            }
            (_, None) => {}
        }
        problem.weigh(&mut rows[..bins]);
        rows[bins] = problem.acceleration_row * w;
        rows[bins + 1] = problem.distortion_row * distortion;
        true
    }
}
