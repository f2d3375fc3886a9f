//! What a session has to tell, until somebody asks.

/// A short queue of events. What finds no place is dropped and counted.
#[derive(Debug)]
pub(crate) struct Events<E> {
    ring: [Option<E>; CAPACITY],
    first: usize,
    count: usize,
    pub(crate) missed: u64,
}

const CAPACITY: usize = 32;
/// Places that reports of damage may not take: what happens to an order finds room after a packet of nothing but damage.
const RESERVED: usize = 12;

impl<E: Copy> Events<E> {
    pub(crate) const fn new() -> Self {
        Self { ring: [None; CAPACITY], first: 0, count: 0, missed: 0 }
    }

    /// Something that happened to the connection or to an order.
    pub(crate) fn push(&mut self, event: E) {
        self.push_within(event, CAPACITY);
    }

    /// Something wrong with the bytes or with a message: there may be many of them in one read.
    pub(crate) fn push_report(&mut self, event: E) {
        self.push_within(event, CAPACITY - RESERVED);
    }

    pub(crate) fn pop(&mut self) -> Option<E> {
        let event = self.ring.get_mut(self.first)?.take()?;
        self.first = (self.first + 1) % CAPACITY;
        self.count -= 1;
        Some(event)
    }

    fn push_within(&mut self, event: E, limit: usize) {
        let place = (self.first + self.count) % CAPACITY;
        match self.ring.get_mut(place) {
            Some(place) if self.count < limit => {
                *place = Some(event);
                self.count += 1;
            }
            _ => self.missed += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_leaves_room_for_what_matters() {
        let mut events = Events::new();
        for i in 0..40 {
            events.push_report(i);
        }
        assert_eq!(events.missed, 20);
        (100..112).for_each(|i| events.push(i));
        events.push(200);
        assert_eq!(events.missed, 21);
        assert_eq!(events.pop(), Some(0));
        events.push(201);
        let rest: std::vec::Vec<_> = core::iter::from_fn(|| events.pop()).collect();
        assert_eq!((rest.len(), rest[18], rest[19], rest[31]), (32, 19, 100, 201));
    }
}
