/// Bytes that wait until the reply to the command before has been sent.
#[derive(Debug, Clone)]
pub(super) struct Backlog<const N: usize> {
    bytes: [u8; N],
    start: usize,
    end: usize,
}

impl<const N: usize> Backlog<N> {
    pub(super) const fn new() -> Self {
        Self { bytes: [0; N], start: 0, end: 0 }
    }

    /// Takes as many bytes as there is room for beside those that the decoder holds, and returns how many.
    pub(super) fn fill(&mut self, held: usize, bytes: &[u8]) -> usize {
        self.bytes.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        let limit = N.saturating_sub(held).max(self.end);
        let room = self.bytes.get_mut(self.end..limit).unwrap_or_default();
        let taken = room.len().min(bytes.len());
        room.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.end += taken;
        taken
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.start == self.end
    }

    pub(super) fn bytes(&self) -> &[u8] {
        self.bytes.get(self.start..self.end).unwrap_or_default()
    }

    pub(super) fn drop_first(&mut self, count: usize) {
        self.start = self.end.min(self.start + count);
    }

    pub(super) fn clear(&mut self) {
        self.start = self.end;
    }
}
