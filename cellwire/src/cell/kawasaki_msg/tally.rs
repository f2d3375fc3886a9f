//! What became of the jobs: what was sent, beside what the pen did.

use kawasaki_msg::{Dialect, Line};

use crate::cell::report::Jobs;
use crate::links::kawasaki_msg::robot::Stroke;

/// How an order has ended, as the PC knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// How many jobs were sent, from the first on.
    pub sent: u32,
    /// How many of them are executed, from the first on; the others will not be.
    pub executed: u32,
}

/// What became of the jobs of all orders.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Sent.
    pub sent: u64,
    /// Executed exactly once, as they were sent.
    pub executed_once: u64,
    /// Executed more than once.
    pub repeated: u64,
    /// Executed, as reported to the PC, and not executed in truth.
    pub lost: u64,
    /// Sent, and taken back with the end of the order: reported to the PC as not to be executed.
    pub withdrawn: u64,
    /// Executed, and reported to the PC as not executed.
    pub unreported: u64,
    /// Not what was sent under the number.
    pub altered: u64,
    /// Not after the job before it.
    pub out_of_order: u64,
}

impl Tally {
    /// Each order drew the picture from its first line on; `outcomes` are in the order of the orders.
    pub fn new(picture: &[Line], outcomes: &[Outcome], strokes: &[Stroke]) -> Self {
        let mut tally = Self::default();
        for (order, outcome) in (1..).zip(outcomes) {
            tally.add(picture, *outcome, strokes.iter().filter(|stroke| stroke.order == order));
        }
        tally
    }

    fn add<'a>(&mut self, picture: &[Line], outcome: Outcome, strokes: impl Iterator<Item = &'a Stroke>) {
        let (sent, executed) = (outcome.sent as usize, outcome.executed as usize);
        let (mut times, mut next) = (vec![0u32; sent], 0);
        for stroke in strokes {
            let index = place(stroke.job.number, next);
            self.out_of_order += u64::from(index != Some(next));
            next = index.map_or(next, |index| index + 1);
            match index.and_then(|index| Some((times.get_mut(index)?, picture.get(index)?))) {
                Some((times, line)) if *line == stroke.job.work => *times += 1,
                _ => self.altered += 1,
            }
        }
        self.sent += u64::from(outcome.sent);
        for (index, times) in times.iter().enumerate() {
            *match (times, index < executed) {
                (0, true) => &mut self.lost,
                (0, false) => &mut self.withdrawn,
                (1, true) => &mut self.executed_once,
                (1, false) => &mut self.unreported,
                _ => &mut self.repeated,
            } += 1;
        }
    }

    /// For the report.
    pub fn jobs(&self) -> Jobs {
        let Self { sent, executed_once, lost, repeated, .. } = *self;
        Jobs { sent, executed_once, lost, repeated, unknown: 0 }
    }
}

/// The place of the job of a number, counted from 0: the one nearest to where the next job is expected.
fn place(number: u16, next: usize) -> Option<usize> {
    let max = usize::from(Dialect::MAX_NUMBER);
    let ahead = (usize::from(number) + max - 1 - next % max) % max;
    if ahead <= max / 2 { Some(next + ahead) } else { (next + ahead).checked_sub(max) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kawasaki_msg::{Job, JobKind, Point};

    fn line(x: i32) -> Line {
        Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(x + 1, 0) }
    }

    fn stroke(order: u32, number: u16) -> Stroke {
        Stroke { order, job: Job { order: 50, number, work: line(i32::from(number)) } }
    }

    /// The picture whose job of number n is `line(n)`.
    fn picture(jobs: i32) -> Vec<Line> {
        (1..=jobs).map(line).collect()
    }

    #[test]
    fn each_fate_is_counted() {
        let outcome = Outcome { sent: 6, executed: 4 };
        let mut altered = stroke(1, 4);
        altered.job.work.end.y = 7;
        // 2 is lost, 3 comes twice, 4 is another line (and so lost), 5 was not to be executed, 6 is taken back.
        let strokes = [stroke(1, 1), stroke(1, 3), stroke(1, 3), altered, stroke(1, 5)];
        let tally = Tally::new(&picture(9), &[outcome], &strokes);
        let expected = Tally {
            sent: 6,
            executed_once: 1,
            repeated: 1,
            lost: 2,
            withdrawn: 1,
            unreported: 1,
            altered: 1,
            out_of_order: 2,
        };
        assert_eq!(tally, expected);
    }

    #[test]
    fn orders_are_distinguished_and_numbers_wrap() {
        let outcomes = [Outcome { sent: 2, executed: 2 }; 2];
        let strokes = [stroke(1, 1), stroke(1, 2), stroke(2, 1), stroke(2, 2)];
        let tally = Tally::new(&picture(2), &outcomes, &strokes);
        assert_eq!(tally, Tally { sent: 4, executed_once: 4, ..Tally::default() });
        assert_eq!(place(1, 9999), Some(9999));
        assert_eq!(place(9999, 9999), Some(9998));
        assert_eq!(place(9999, 0), None);
    }
}
