//! Detects a line that returns the sent bytes, unknown to a session.

/// The messages in succession that come back before a line is known to return them.
const PROOF: u32 = 3;

/// Compares the read bytes with the last message sent.
#[derive(Debug, Default)]
pub(super) struct EchoDetector {
    sent: Vec<u8>,
    /// The bytes of the message that have come back, if no other bytes came before them.
    come: Option<usize>,
    /// The number of consecutive messages that came back whole, before other bytes.
    count: u32,
}

impl EchoDetector {
    pub(super) fn sent(&mut self, message: &[u8]) {
        if self.come.is_some() {
            self.count = 0; // the message before did not come back
        }
        self.sent.clear();
        self.sent.extend_from_slice(message);
        self.come = Some(0);
    }

    pub(super) fn read(&mut self, bytes: &[u8]) {
        let Some(come) = self.come else { return };
        let rest = self.sent.get(come..).unwrap_or_default();
        let length = rest.len().min(bytes.len());
        if !bytes.starts_with(rest.get(..length).unwrap_or_default()) {
            (self.come, self.count) = (None, 0);
        } else if length == rest.len() {
            (self.come, self.count) = (None, self.count + 1);
        } else {
            self.come = Some(come + length);
        }
    }

    /// Returns whether the line returns the sent bytes.
    pub(super) fn is_proved(&self) -> bool {
        self.count >= PROOF
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sends `message`, and reads each of `pieces`.
    fn exchange(line: &mut EchoDetector, message: &[u8], pieces: &[&[u8]]) -> bool {
        line.sent(message);
        pieces.iter().for_each(|piece| line.read(piece));
        line.is_proved()
    }

    #[test]
    fn three_messages_that_come_back_first_prove_it() {
        let mut line = EchoDetector::default();
        let returns = |line: &mut EchoDetector| exchange(line, b"abc", &[b"a", b"bcxyz", b"abc"]);
        assert_eq!([0; 3].map(|_| returns(&mut line)), [false, false, true]);
        assert!(returns(&mut line));
        for other in [&[&b"abx"[..]][..], &[], &[b"ab"]] {
            exchange(&mut line, b"abc", other);
            assert_eq!([0; 3].map(|_| returns(&mut line)), [false, false, true], "after {other:?}");
        }
    }
}
