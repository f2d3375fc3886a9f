/// Bytes on their way out, taken in as many pieces as the caller likes.
#[derive(Debug, Clone)]
pub(crate) struct Outgoing<const N: usize> {
    bytes: [u8; N],
    start: usize,
    end: usize,
}

impl<const N: usize> Outgoing<N> {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; N], start: 0, end: 0 }
    }

    /// Replaces what is there by what `write` writes, unless it fails.
    pub(crate) fn fill<E>(&mut self, write: impl FnOnce(&mut [u8]) -> Result<usize, E>) -> Result<(), E> {
        self.end = 0;
        self.start = 0;
        self.end = write(&mut self.bytes)?.min(N);
        Ok(())
    }

    pub(crate) fn take(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let waiting = self.bytes.get(self.start..self.end).filter(|waiting| !waiting.is_empty())?;
        let len = waiting.len().min(buffer.len());
        buffer.iter_mut().zip(waiting).for_each(|(to, from)| *to = *from);
        self.start += len;
        (len > 0).then_some(len)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.start == self.end
    }

    pub(crate) fn clear(&mut self) {
        self.end = self.start;
    }
}
