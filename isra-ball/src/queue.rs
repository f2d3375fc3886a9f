const CAPACITY: usize = 8;

/// A few events in order; a full queue gives up its oldest.
#[derive(Debug, Clone)]
pub(crate) struct Queue<T> {
    items: [Option<T>; CAPACITY],
    dropped: u64,
}

impl<T: Copy> Queue<T> {
    pub(crate) const fn new() -> Self {
        Self { items: [None; CAPACITY], dropped: 0 }
    }

    pub(crate) fn push(&mut self, item: T) {
        if self.items.iter().all(Option::is_some) {
            self.pop();
            self.dropped += 1;
        }
        if let Some(free) = self.items.iter_mut().find(|place| place.is_none()) {
            *free = Some(item);
        }
    }

    pub(crate) fn pop(&mut self) -> Option<T> {
        let item = self.items.first_mut()?.take();
        self.items.rotate_left(1);
        item
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}
