//! A serial line as the bits that it carries, and the reading of a receiver that samples at another rate, or in another
//! format.
//!
//! Times are in bits of the sender's: a receiver at twice its rate samples every half.

/// The format of characters on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    /// Bits a second.
    pub baud: u32,
    /// 7 or 8.
    pub data_bits: u8,
    /// Whether there is a parity bit, and whether it makes the number of ones odd.
    pub odd: Option<bool>,
    /// 1 or 2.
    pub stop_bits: u8,
}

/// A character as it was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received {
    /// The data bits of the character.
    pub byte: u8,
    /// Whether its parity is wrong, or its stop bit is low.
    pub is_broken: bool,
}

impl Format {
    /// Returns the bits of bytes that follow each other without a pause, true for high.
    pub fn bits(&self, bytes: &[u8]) -> Vec<bool> {
        let mut bits = Vec::new();
        for byte in bytes {
            let data = (0..self.data_bits).map(|bit| byte >> bit & 1 == 1);
            let ones = data.clone().filter(|bit| *bit).count();
            bits.push(false);
            bits.extend(data);
            bits.extend(self.odd.map(|odd| ones.is_multiple_of(2) == odd));
            bits.extend((0..self.stop_bits).map(|_| true));
        }
        bits
    }

    /// Returns the time of bytes on the line, in seconds.
    pub fn seconds(&self, bytes: usize) -> f64 {
        let bits = 1 + self.data_bits + u8::from(self.odd.is_some()) + self.stop_bits;
        f64::from(bits) * f64::from(u32::try_from(bytes).unwrap_or(u32::MAX)) / f64::from(self.baud)
    }

    /// Returns the characters that a receiver with this format reads from bits at a sender's rate. The line is high
    /// before and after them.
    ///
    /// As a 16550: if the stop bit is low, it is the start bit of the next character, unless all bits were low.
    pub fn receive(&self, bits: &[bool], baud: u32) -> Vec<Received> {
        // In units of a bit of the sender.
        let step = f64::from(baud) / f64::from(self.baud);
        let end = bits.len();
        let is_high = |at: f64| place(at).and_then(|at| bits.get(at)).is_none_or(|bit| *bit);
        let falls = |from: f64| {
            let first = place(from).unwrap_or_default();
            (first + 1..end)
                .find(|at| at.checked_sub(1).is_none_or(|it| is_high(real(it))) && !is_high(real(*at)))
        };
        let (mut received, mut start) =
            (Vec::new(), if bits.first() == Some(&false) { Some(0.0) } else { None });
        start = start.or_else(|| falls(0.0).map(real));
        while let Some(begin) = start {
            if is_high(begin + step / 2.0) {
                // Shorter than half a bit: noise.
                start = falls(begin + step / 2.0).map(real);
                continue;
            }
            let sample = |number: u8| is_high(begin + step * (f64::from(number) + 0.5));
            let byte = (0..self.data_bits).fold(0, |byte, bit| byte | u8::from(sample(1 + bit)) << bit);
            let parity = 1 + self.data_bits;
            let is_even = byte.count_ones().is_multiple_of(2);
            let parity_fails = self.odd.is_some_and(|odd| sample(parity) != (is_even == odd));
            let stop = parity + u8::from(self.odd.is_some());
            let stops = sample(stop);
            received.push(Received { byte, is_broken: parity_fails || !stops });
            let at = begin + step * (f64::from(stop) + 0.5);
            start = match (stops, byte) {
                (false, 1..) => Some(at - step / 2.0),
                _ => falls(at).map(real),
            };
        }
        received
    }
}

/// Returns the bytes that a program reads from a port that marks errors, as termios describes PARMRK.
pub fn marked(received: &[Received]) -> Vec<u8> {
    let of = |it: &Received| match it {
        Received { byte, is_broken: true } => vec![0xFF, 0, *byte],
        Received { byte: 0xFF, .. } => vec![0xFF, 0xFF],
        Received { byte, .. } => vec![*byte],
    };
    received.iter().flat_map(of).collect()
}

fn real(at: usize) -> f64 {
    u32::try_from(at).map_or(f64::MAX, f64::from)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place among some bits")]
fn place(at: f64) -> Option<usize> {
    (at >= 0.0).then_some(at as usize)
}
