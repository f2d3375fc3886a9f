//! Long random strings of operations, with batches and resets among them, against a plain `VecDeque`.

use std::collections::VecDeque;
use std::rc::Rc;

use proptest::prelude::*;
use robot_work_queue::{Full, NumberError, Reader, Writer, boxed};

#[derive(Debug, Clone, Copy)]
enum Op {
    Queue,
    Batch { count: usize, publish: bool },
    Execute { overtakes: usize },
    ExecuteBatch { most: usize },
    Clear,
    Reset,
}

fn op() -> impl Strategy<Value = Op> {
    prop_oneof![
        6 => Just(Op::Queue),
        4 => (0..7_usize, any::<bool>()).prop_map(|(count, publish)| Op::Batch { count, publish }),
        7 => (0..4_usize).prop_map(|overtakes| Op::Execute { overtakes }),
        3 => (0..7_usize).prop_map(|most| Op::ExecuteBatch { most }),
        1 => Just(Op::Clear),
        1 => Just(Op::Reset),
    ]
}

type Job = (u32, Rc<()>);

/// A slot, from the oldest that is not free.
#[derive(Debug, Clone, Copy)]
struct Slot {
    number: u16,
    serial: u32,
    completed: bool,
}

#[derive(Debug)]
struct Model {
    capacity: usize,
    max: u16,
    slots: VecDeque<Slot>,
    last: Option<u16>,
    serial: u32,
    /// The number of slots for which a reset waits.
    cleared: usize,
    alive: Rc<()>,
}

impl Model {
    fn after(&self, number: Option<u16>) -> u16 {
        number.filter(|number| *number < self.max).map_or(1, |number| number + 1)
    }

    fn job(&mut self) -> Job {
        self.serial += 1;
        (self.serial, self.alive.clone())
    }

    fn queued(&mut self, number: u16, serial: u32) {
        self.slots.push_back(Slot { number, serial, completed: false });
        self.last = Some(number);
    }

    /// Lets the reader look: resets take effect, and completed slots become free.
    fn settle(&mut self) {
        self.slots.drain(..core::mem::take(&mut self.cleared));
        while self.slots.front().is_some_and(|slot| slot.completed) {
            self.slots.pop_front();
        }
    }

    fn waiting(&self) -> impl Iterator<Item = (usize, Slot)> {
        self.slots.iter().copied().enumerate().skip(self.cleared).filter(|(_, slot)| !slot.completed)
    }

    fn write(&mut self, writer: &mut Writer<'_, Job>, op: Op) {
        let next = self.after(self.last);
        match op {
            Op::Queue if self.slots.len() == self.capacity => assert_eq!(writer.claim().err(), Some(Full)),
            Op::Queue => {
                let found = self.after(Some(next));
                let error = match self.last {
                    Some(last) if last == found => NumberError::Repeated { number: found },
                    _ => NumberError::Unexpected { expected: next, found },
                };
                assert_eq!(writer.claim().unwrap().commit_with(found, || panic!("decoded")), Err(error));
                let job = self.job();
                self.queued(next, job.0);
                writer.claim().unwrap().commit(next, job).unwrap();
            }
            Op::Batch { count, publish } => {
                let Ok(mut batch) = writer.claim_batch(count) else {
                    return assert!(self.slots.len() + count > self.capacity);
                };
                let mut number = next;
                for made in 0..count {
                    let job = self.job();
                    if publish {
                        self.queued(number, job.0);
                    }
                    match made % 2 {
                        0 => batch.claim().unwrap().commit(number, job).unwrap(),
                        _ => batch.fill([job]),
                    }
                    number = self.after(Some(number));
                }
                if publish {
                    assert_eq!(batch.publish(), count);
                }
            }
            Op::Clear | Op::Reset => {
                self.cleared = self.slots.len();
                match op {
                    Op::Clear => writer.clear(),
                    _ => {
                        writer.reset();
                        self.last = None;
                    }
                }
            }
            Op::Execute { .. } | Op::ExecuteBatch { .. } => {}
        }
    }

    fn read(&mut self, reader: &mut Reader<'_, Job>, op: Op) {
        match op {
            Op::Execute { overtakes } => {
                self.settle();
                let mut seen = 0;
                let job = match overtakes {
                    0 => reader.take(),
                    _ => reader.take_where(|_, _| {
                        seen += 1;
                        seen > overtakes
                    }),
                };
                let expected = self.waiting().nth(overtakes);
                let found = job.as_ref().map(|job| (job.number(), job.0));
                assert_eq!(found, expected.map(|(_, slot)| (slot.number, slot.serial)));
                if let (Some(job), Some((at, _))) = (job, expected) {
                    job.complete();
                    self.slots[at].completed = true;
                    self.settle();
                }
            }
            Op::ExecuteBatch { most: 0 } => assert!(reader.take_batch(0).is_none()),
            Op::ExecuteBatch { most } => {
                self.settle();
                let Some(mut batch) = reader.take_batch(most) else { return assert!(self.slots.is_empty()) };
                let jobs: Vec<_> = batch.iter_mut().map(|(number, job)| (number, job.0)).collect();
                assert!((1..=most).contains(&jobs.len()));
                let slots = self.slots.drain(..jobs.len());
                assert!(slots.map(|slot| (slot.number, slot.serial)).eq(jobs));
                batch.complete();
                self.settle();
            }
            Op::Queue | Op::Batch { .. } | Op::Clear | Op::Reset => {}
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5000))]

    #[test]
    fn as_a_plain_queue(capacity in 1..7_usize, above in 1..4_u16, ops in prop::collection::vec(op(), 1..120)) {
        let max = u16::try_from(capacity).unwrap() + above;
        let alive = Rc::new(());
        let mut model = Model {
            capacity, max, slots: VecDeque::new(), last: None, serial: 0, cleared: 0, alive: alive.clone(),
        };
        let (mut writer, mut reader) = boxed::<Job>(capacity, max).unwrap();
        for op in ops {
            model.write(&mut writer, op);
            model.read(&mut reader, op);
            let waiting: Vec<_> = model.waiting().map(|(_, slot)| (slot.number, slot.serial)).collect();
            let found: Vec<_> = reader.iter().map(|(number, job)| (number, job.0)).collect();
            prop_assert_eq!(&found, &waiting);
            prop_assert_eq!((writer.len(), reader.len(), writer.last_number()), (model.slots.len(), waiting.len(), model.last));
            prop_assert_eq!(writer.is_settled(), model.cleared == 0);
            let jobs = model.slots.iter().filter(|slot| !slot.completed).count();
            prop_assert_eq!(Rc::strong_count(&alive) - 2, jobs);
        }
        drop((writer, reader));
        prop_assert_eq!(Rc::strong_count(&alive), 2);
    }
}
