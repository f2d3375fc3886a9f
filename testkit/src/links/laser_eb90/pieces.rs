//! The bytes that a host sends without a pause between them, and those that the controller's decoder then holds.

use laser_eb90::controller::machine::Fault;

use super::{CUT, SWITCH};

/// The number of bytes of a head with its flag, and no tag after it.
pub(super) const EMPTY_HEAD: u8 = 4;
/// The number of bytes of the frame that is found in the middle of another one.
pub(super) const INNER_FRAME: u8 = 11;

/// Head, flag and command word.
const BEGINNING: [u8; 8] = [0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 1];
/// Items that leave the sum as it is, and the last one of a payload whose sum is F0 and whose last byte is EB.
const ITEM: [u8; 4] = [0xF2, 2, 0x0C, 0];
const SHORT_ITEM: [u8; 3] = [0xF2, 1, 0x0D];
const FALSE_HEAD: [u8; 9] = [0xF2, 7, 0x18, 0, 0, 0, 0, 0, 0xEB];
/// Tail and check.
const END: [u8; 3] = [0x90, 0x82, 0xF4];
/// Instructions in the longest frame: the queue has one place less.
pub(super) const BATCH: usize = 7;

/// As many bytes are not followed by more without a head; the longest payload is much longer.
const LONGEST: u8 = 2 * Fault::MIN_BYTES;

/// The controller's decision about a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// The controller queues it.
    Queued,
    /// The controller's queue is full.
    Full,
    /// The controller executes it.
    Immediate,
    /// It has an immediate instruction, and another one after that.
    Mixed,
}

/// Bytes without a pause between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Piece {
    /// A good frame.
    Whole(Verdict),
    /// A frame whose check is wrong.
    Bad,
    /// A frame that has lost a byte, so that one is found in its middle; its head may be lost, too.
    Inner {
        /// Whether the head is lost.
        headless: bool,
    },
    /// So many bytes of the beginning of a frame.
    Begun(u8),
    /// Bytes of the middle of a frame.
    Middle {
        /// As many as the shortest frame has.
        many: bool,
    },
    /// Bytes that are not of a frame, or of one whose head is corrupt. None come within a frame: that one is bad.
    Noise {
        /// As many as the shortest frame has.
        many: bool,
    },
    /// The rest of a frame.
    Rest {
        /// As much as the shortest frame.
        many: bool,
    },
    /// A long rest that ends in EB 90 82: data and tail.
    FalseHead,
}

use Piece::{Bad, Begun, FalseHead, Inner, Middle, Noise, Rest, Whole};

/// A head and no item, a part of an item, and as many bytes as the shortest frame has.
pub(super) const HEAD: Piece = Begun(EMPTY_HEAD);
const PART: Piece = Begun(6);
const WORD: Piece = Begun(8);
pub(super) const MANY: Piece = Middle { many: true };
pub(super) const FEW: Piece = Middle { many: false };
const REST: Piece = Rest { many: true };
const TAIL: Piece = Rest { many: false };

/// A transmission: pieces between which the port may pause, and whether its head comes.
pub(super) const SHAPES: &[(&[Piece], bool)] = &[
    (&[Whole(Verdict::Queued)], true),
    (&[Whole(Verdict::Full)], true),
    (&[Whole(Verdict::Immediate)], true),
    (&[Whole(Verdict::Mixed)], true),
    (&[Bad], true),
    (&[Inner { headless: false }], true),
    (&[WORD, REST], true),
    (&[WORD, TAIL], true),
    (&[WORD, FalseHead], true),
    (&[WORD, MANY, REST], true),
    (&[WORD, MANY, TAIL], true),
    (&[HEAD, REST], true),
    (&[HEAD, MANY, REST], true),
    (&[HEAD, FalseHead], true),
    (&[PART, REST], true),
    (&[PART, MANY, REST], true),
    (&[PART, FalseHead], true),
    // It is cut.
    (&[WORD], true),
    // A byte of its middle reads as the tail.
    (&[Bad, MANY], true),
    // A little noise.
    (&[Noise { many: false }, Whole(Verdict::Queued)], true),
    // The head of the frame is corrupt.
    (&[Noise { many: true }], false),
    (&[Noise { many: true }, MANY], false),
    (&[Noise { many: true }, FEW], false),
    (&[Noise { many: false }, MANY], false),
    // The head of the frame is lost.
    (&[MANY], false),
    (&[MANY, MANY], false),
    (&[MANY, FEW], false),
    (&[FEW, MANY], false),
    (&[Inner { headless: true }], false),
    // It is lost.
    (&[], false),
];

pub(super) const PIECES: &[Piece] = &[
    Whole(Verdict::Queued),
    Whole(Verdict::Full),
    Whole(Verdict::Immediate),
    Whole(Verdict::Mixed),
    Bad,
    Inner { headless: false },
    Inner { headless: true },
    WORD,
    HEAD,
    PART,
    MANY,
    FEW,
    Noise { many: true },
    Noise { many: false },
    REST,
    TAIL,
    FalseHead,
];

/// The bytes that the decoder holds, and their number: exact up to the length of the shortest frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum DecoderContents {
    Nothing,
    Headless(u8),
    Begun(u8),
}

impl DecoderContents {
    pub(super) fn bytes(self) -> u8 {
        match self {
            Self::Nothing => 0,
            Self::Headless(bytes) | Self::Begun(bytes) => bytes,
        }
    }

    /// More bytes. When there are enough for a frame, each piece counts as so many.
    pub(super) fn and(self, bytes: u8) -> Self {
        let held = self.bytes();
        let more = if held < Fault::MIN_BYTES {
            (held + bytes).min(Fault::MIN_BYTES)
        } else {
            held + Fault::MIN_BYTES
        };
        match self {
            Self::Begun(_) => Self::Begun(more),
            Self::Nothing | Self::Headless(_) => Self::Headless(more),
        }
    }

    /// Returns whether a host that does anything may send a piece after these bytes.
    pub(super) fn goes_on_with(self, piece: Piece) -> bool {
        match piece {
            Whole(_) | Bad | Inner { .. } | Begun(_) => true,
            Middle { .. } | Rest { .. } | FalseHead => self.bytes() < LONGEST,
            Noise { .. } => self.bytes() < LONGEST && !matches!(self, Self::Begun(_)),
        }
    }
}

/// The frame of a payload without a 90h.
pub(super) fn frame(payload: &[u8]) -> Vec<u8> {
    let sum = payload.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    [&BEGINNING[..usize::from(EMPTY_HEAD)], payload, &[0x90, 0x82, sum]].concat()
}

/// An instruction without parameters, or an answer.
pub(super) fn instruction(word: u16) -> [u8; 4] {
    let [low, high] = word.to_le_bytes();
    [0xF1, 1, low, high]
}

/// The bytes of a piece after those that the decoder holds.
pub(super) fn spell(piece: Piece, held: DecoderContents) -> Vec<u8> {
    // The command word of a frame that has begun comes first.
    let rest = match held {
        DecoderContents::Begun(begun) => BEGINNING.get(usize::from(begun)..).unwrap_or_default(),
        DecoderContents::Nothing | DecoderContents::Headless(_) => &[],
    };
    match piece {
        Piece::Whole(Verdict::Queued) => frame(&instruction(CUT)),
        Piece::Whole(Verdict::Full) => frame(&instruction(CUT).repeat(BATCH)),
        Piece::Whole(Verdict::Immediate) => frame(&instruction(SWITCH)),
        Piece::Whole(Verdict::Mixed) => frame(&[instruction(SWITCH), instruction(CUT)].concat()),
        Piece::Bad => {
            let mut bytes = frame(&instruction(CUT));
            bytes[10] ^= 0x04;
            bytes
        }
        // The inner head has lost one of its two 90h, and the outer frame has its tail and its check.
        Piece::Inner { headless } => {
            let mut bytes = frame(&[instruction(CUT), ITEM].concat());
            bytes.splice(12.., [0xF2, 8].into_iter().chain(frame(&instruction(CUT))));
            if headless { bytes.split_off(usize::from(EMPTY_HEAD)) } else { bytes }
        }
        Piece::Begun(bytes) => BEGINNING[..usize::from(bytes)].to_vec(),
        Piece::Middle { many: true } => [rest, &ITEM, &ITEM].concat(),
        Piece::Middle { many: false } => match rest {
            [] => ITEM.to_vec(),
            [_, _, _, _] => rest.to_vec(),
            _ => [rest, &SHORT_ITEM].concat(),
        },
        Piece::Noise { many } => vec![0x55; if many { 8 } else { 4 }],
        Piece::Rest { many: true } => [rest, &ITEM, &ITEM, &END].concat(),
        Piece::Rest { many: false } if rest.is_empty() => [ITEM.as_slice(), &END].concat(),
        Piece::Rest { many: false } => [rest, &END].concat(),
        Piece::FalseHead => [rest, &FALSE_HEAD, &[0x90, 0x82, 0xF0]].concat(),
    }
}
