//! The events that wait for the caller.

/// A ring of `N`: when it is full, the oldest makes room, and is counted.
#[derive(Debug, Clone)]
pub(crate) struct Queue<T, const N: usize> {
    places: [Option<T>; N],
    first: usize,
    len: usize,
}

impl<T: Copy, const N: usize> Queue<T, N> {
    pub(crate) fn new() -> Self {
        Self { places: [None; N], first: 0, len: 0 }
    }

    pub(crate) fn push(&mut self, item: T) {
        if self.len == N {
            self.pop();
        }
        if let Some(place) = self.places.get_mut((self.first + self.len) % N) {
            *place = Some(item);
            self.len += 1;
        }
    }

    pub(crate) fn pop(&mut self) -> Option<T> {
        let item = self.places.get_mut(self.first)?.take()?;
        self.first = (self.first + 1) % N;
        self.len -= 1;
        Some(item)
    }
}
