//! The picture that is drawn: each job is a line of it.

use kawasaki_msg::{JobKind, JobSource, Line, Point, Supply};

use robot_session::contract::Rng;

/// Returns the line of a job, which encodes its number.
pub(super) fn line(job: usize) -> Line {
    let kind = if job.is_multiple_of(3) { JobKind::Move } else { JobKind::Draw };
    let x = job as i32;
    Line { kind, start: Point::new(x, 7 - x), end: Point::new(x * 3, -x) }
}

/// An order: this many jobs of the session from `first` on. Sometimes the next one is still being worked out.
#[derive(Debug, Clone)]
pub(super) struct Picture {
    pub(super) first: usize,
    pub(super) jobs: u32,
    pub(super) later: f64,
    pub(super) rng: Rng,
}

impl JobSource for Picture {
    type Work = Line;

    fn job(&mut self, index: u32) -> Supply<Line> {
        match index {
            _ if index >= self.jobs => Supply::End,
            _ if self.rng.chance(self.later) => Supply::Later,
            _ => Supply::Job(line(self.first + index as usize)),
        }
    }
}
