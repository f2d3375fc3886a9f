//! Outcomes are never dropped, of too many notices the oldest is, and the order stays.

use robot_session::end::EventQueue;

/// The queue's required behaviour, in the plainest form.
#[derive(Default)]
struct Plain {
    events: Vec<(u32, bool)>,
    dropped: u64,
}

impl Plain {
    fn drop_notice(&mut self) -> bool {
        let Some(oldest) = self.events.iter().position(|(_, is_notice)| *is_notice) else { return false };
        self.events.remove(oldest);
        self.dropped += 1;
        true
    }

    fn push(&mut self, event: u32, is_notice: bool, capacity: usize) -> bool {
        if self.events.len() == capacity && !self.drop_notice() {
            self.dropped += u64::from(is_notice);
            return is_notice;
        }
        self.events.push((event, is_notice));
        true
    }
}

/// Every string of nine operations on queues of up to three events.
#[test]
fn every_string_of_operations_does_what_the_plain_queue_does() {
    fn all<const N: usize>() {
        for string in 0..3u32.pow(9) {
            let (mut queue, mut plain) = (EventQueue::<u32, N>::new(), Plain::default());
            for step in 0..9 {
                match string / 3u32.pow(step) % 3 {
                    0 => assert_eq!(queue.push_outcome(step).is_ok(), plain.push(step, false, N)),
                    1 => {
                        queue.push_notice(step);
                        assert!(plain.push(step, true, N));
                    }
                    _ => {
                        let first = (!plain.events.is_empty()).then(|| plain.events.remove(0).0);
                        assert_eq!(queue.pop(), first, "{string}");
                    }
                }
                let outcomes = plain.events.iter().filter(|(_, is_notice)| !is_notice).count();
                assert!(queue.has_room(N - outcomes) && !queue.has_room(N - outcomes + 1));
                assert_eq!(queue.dropped_notices(), plain.dropped, "{string}");
                assert_eq!(queue.is_empty(), plain.events.is_empty());
            }
        }
    }
    all::<1>();
    all::<2>();
    all::<3>();
}

#[test]
fn an_outcome_that_finds_no_room_is_returned() {
    let mut queue = EventQueue::<&str, 1>::default();
    assert_eq!(queue.push_outcome("first"), Ok(()));
    assert_eq!(queue.push_outcome("second"), Err("second"));
    queue.push_notice("third");
    assert_eq!((queue.pop(), queue.pop(), queue.dropped_notices()), (Some("first"), None, 1));
}
