//! The outcomes of the jobs: compares the sent jobs with the pen's drawing.

use std::sync::mpsc::Receiver;

use kawasaki_msg::Dialect;

use crate::demo::DemoOptions;
use crate::demo::operator::reported;
use crate::devices::kawasaki_msg::robot::Stroke;
use crate::io::journal::Outcome;
use cellwire_links::kawasaki_msg::layout::AnyWork;
use cellwire_sim::Ledger;
use cellwire_sim::ledger::Counts;

/// The outcomes of the jobs of all orders.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// The jobs that were executed as they were sent. Of a withdrawn job its order has ended; an unreported job was executed
    /// after that.
    pub jobs: Counts,
    /// Executed jobs that differ from those sent under their number.
    pub altered: u64,
    /// Executed jobs that did not follow the previous one.
    pub out_of_order: u64,
}

/// The orders of a run, counted as they end. It keeps the strokes of two orders, and those of the longest, however long the
/// run is.
#[derive(Debug)]
pub struct Orders<'a> {
    picture: &'a [AnyWork],
    options: &'a DemoOptions,
    strokes: Receiver<Stroke>,
    /// Strokes of orders that are not counted yet.
    held: Vec<Stroke>,
    /// The last order that was over: a stroke that comes late is one of its.
    last: Option<Vec<Outcome>>,
    /// Orders that are counted.
    counted: u32,
    /// Orders that were over with the whole picture drawn.
    complete: u32,
    longest: Vec<Stroke>,
    tally: Tally,
}

impl<'a> Orders<'a> {
    /// Creates a tally without drawn lines. Each order draws the picture from its first line on; `strokes` receives the
    /// motions of the pen.
    pub fn new(picture: &'a [AnyWork], options: &'a DemoOptions, strokes: Receiver<Stroke>) -> Self {
        Self {
            picture,
            options,
            strokes,
            held: Vec::new(),
            last: None,
            counted: 0,
            complete: 0,
            longest: Vec::new(),
            tally: Tally::default(),
        }
    }

    /// Called when an order is over, with the outcomes that the PC has noted of its jobs that were sent.
    pub fn over(&mut self, outcomes: &[Outcome]) {
        self.count_last();
        let done = outcomes.iter().filter(|outcome| **outcome == Outcome::Done).count();
        self.complete += u32::from(done == self.picture.len());
        self.last = Some(outcomes.to_vec());
    }

    /// Called when the run is over, and the pen has stopped.
    pub fn end(&mut self) {
        self.count_last();
        // Of no order at all.
        self.tally.altered += self.held.len() as u64;
    }

    /// Orders that are over.
    pub fn orders(&self) -> u32 {
        self.counted + u32::from(self.last.is_some())
    }

    /// Orders that were over with the whole picture drawn.
    pub fn complete(&self) -> u32 {
        self.complete
    }

    /// Returns the strokes of the order that got farthest: an incomplete picture is drawn only if there is no other.
    pub fn longest(&self) -> &[Stroke] {
        &self.longest
    }

    /// Returns the outcomes of the jobs of the counted orders.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    fn count_last(&mut self) {
        self.held.extend(self.strokes.try_iter());
        let Some(outcomes) = self.last.take() else { return };
        self.counted += 1;
        let order = self.counted;
        let (mut strokes, held) = self.held.drain(..).partition(|stroke: &Stroke| stroke.order <= order);
        self.held = held;
        if order == 1 {
            self.options.spoil(&mut strokes, |stroke| stroke.order == order);
        }
        self.tally.add(self.picture, &outcomes, order, &strokes);
        strokes.retain(|stroke| stroke.order == order);
        if strokes.len() > self.longest.len() {
            self.longest = strokes;
        }
    }
}

impl Tally {
    /// Adds an order by its number, counted from 1, and the strokes of the pen until it was counted.
    fn add(&mut self, picture: &[AnyWork], outcomes: &[Outcome], order: u32, strokes: &[Stroke]) {
        let (mut ledger, mut next) = (Ledger::default(), 0);
        for outcome in outcomes {
            let job = ledger.send(());
            ledger.report(job, reported(*outcome));
        }
        for stroke in strokes {
            if stroke.order != order {
                // The order of the stroke was counted without it.
                self.jobs.unreported += 1;
                continue;
            }
            let index = place(stroke.job.number, next);
            self.out_of_order += u64::from(index != Some(next));
            next = index.map_or(next, |index| index + 1);
            let job = index.filter(|index| picture.get(*index) == Some(&stroke.job.work));
            self.altered += u64::from(!job.is_some_and(|job| ledger.execute(job)));
        }
        self.jobs = self.jobs + ledger.count();
    }
}

/// Returns the index of the job with a number, counted from 0: the one nearest to the next expected job.
fn place(number: u16, next: usize) -> Option<usize> {
    let max = usize::from(Dialect::MAX_NUMBER);
    let ahead = (usize::from(number) + max - 1 - next % max) % max;
    if ahead <= max / 2 { Some(next + ahead) } else { (next + ahead).checked_sub(max) }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use cellwire_links::kawasaki_msg::layout::AnyValue;
    use kawasaki_msg::Job;

    fn line(x: i32) -> AnyWork {
        let mut work = AnyWork::default();
        [1, x, 0, x + 1, 0]
            .into_iter()
            .enumerate()
            .for_each(|(place, value)| work.set(place, AnyValue::Number(value)));
        work
    }

    fn stroke(order: u32, number: u16) -> Stroke {
        Stroke { order, job: Job { order: 50, number, work: line(i32::from(number)) } }
    }

    /// Returns the picture whose job with the number n is `line(n)`.
    fn picture(jobs: i32) -> Vec<AnyWork> {
        (1..=jobs).map(line).collect()
    }

    #[test]
    fn each_fate_is_counted() {
        let outcomes = [[Outcome::Done; 4].as_slice(), &[Outcome::NotSent; 2]].concat();
        let mut altered = stroke(1, 4);
        altered.job.work.set(4, AnyValue::Number(7));
        // 2 is lost, 3 comes twice, 4 is another line (and so lost), 5 was not to be executed, 6 is withdrawn.
        let strokes = [stroke(1, 1), stroke(1, 3), stroke(1, 3), altered, stroke(1, 5)];
        let mut tally = Tally::default();
        tally.add(&picture(9), &outcomes, 1, &strokes);
        let jobs = Counts {
            sent: 6,
            executed_once: 1,
            repeated: 1,
            lost: 2,
            withdrawn: 1,
            unreported: 1,
            ..Counts::default()
        };
        let expected = Tally { jobs, altered: 1, out_of_order: 2 };
        assert_eq!(tally, expected);
    }

    #[test]
    fn orders_are_distinguished_and_numbers_wrap() {
        let (options, picture) = (DemoOptions::quiet(), picture(2));
        let (sender, strokes) = channel();
        let mut orders = Orders::new(&picture, &options, strokes);
        // The last one is late: its order was counted when the next one was over.
        for (order, number) in [(1, 1), (1, 2), (2, 1), (2, 2), (3, 1), (3, 2), (1, 2)] {
            sender.send(stroke(order, number)).unwrap();
            if number == 2 && order > 1 {
                orders.over(&[Outcome::Done; 2]);
            }
        }
        orders.over(&[Outcome::Done; 2]);
        orders.end();
        let jobs = Counts { sent: 6, executed_once: 6, unreported: 1, ..Counts::default() };
        let expected = Tally { jobs, ..Tally::default() };
        assert_eq!((orders.tally(), orders.orders(), orders.complete()), (expected, 3, 3));
        assert_eq!((orders.longest().len(), orders.held.len()), (2, 0));
        assert_eq!(place(1, 9999), Some(9999));
        assert_eq!(place(9999, 9999), Some(9998));
        assert_eq!(place(9999, 0), None);
    }
}
