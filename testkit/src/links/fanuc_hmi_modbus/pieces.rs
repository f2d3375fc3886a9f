//! The pieces in which bytes arrive, and the client's decoder.

/// A frame as the client's decoder finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    /// The slot of the request that the server answers with it, or [`NOBODY`], [`PROBE`], [`LINE`] or [`DATA`].
    pub(super) id: u8,
    pub(super) transaction: u16,
    pub(super) shape: Shape,
}

/// The contents of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shape {
    /// The reply to a read.
    Read,
    /// The exception to a read.
    ReadRefused,
    /// The reply to a write, which repeats it.
    Write,
    /// The exception to a write.
    WriteRefused,
    /// The reply of another unit.
    Foreign,
}

/// The frame answers a request that has ended.
pub(super) const NOBODY: u8 = u8::MAX;
/// The line has returned the bytes sent.
pub(super) const LINE: u8 = u8::MAX - 1;
/// The frame is data of a damaged reply.
pub(super) const DATA: u8 = u8::MAX - 2;

/// The frame answers the read before a request.
pub(super) const PROBE: u8 = u8::MAX - 3;

/// Bytes in the decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Piece {
    Frame(Frame),
    /// The beginning of a reply to the request in flight, without its last bytes.
    Part(Frame),
    /// The last bytes of it.
    Rest(Shape),
    /// Bytes that are not a frame.
    Noise,
    /// The beginning of a long frame, for whose rest the decoder waits.
    Long,
}

/// The most pieces that are held at once.
pub(super) const MOST: usize = 2;

/// The decoder's bytes that are not decoded yet.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(super) struct DecoderContents {
    pieces: Vec<Piece>,
    has_ended: bool,
    /// The frame that was put back waits for more.
    waits: bool,
}

/// A result of the decoder.
#[derive(Debug, Clone, Copy)]
pub(super) enum Found {
    Corrupt,
    Frame(Frame, Follows),
}

/// The input after a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Follows {
    /// Other bytes.
    More,
    /// Nothing yet.
    Nothing,
    /// The end of the input.
    Silence,
}

impl DecoderContents {
    pub(super) fn last(&self) -> Option<Piece> {
        self.pieces.last().copied()
    }

    pub(super) fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Returns whether more noise has no effect.
    pub(super) fn absorbs(&self) -> bool {
        self.last() == Some(Piece::Noise) || self.pieces == [Piece::Long]
    }

    /// The request in this place has ended.
    pub(super) fn forget(&mut self, slot: u8) {
        for piece in &mut self.pieces {
            if let Piece::Frame(frame) | Piece::Part(frame) = piece
                && frame.id == slot
            {
                frame.id = NOBODY;
            }
        }
    }

    /// The held bytes will not be continued.
    pub(super) fn end(&mut self) {
        self.has_ended = !self.pieces.is_empty();
    }

    /// Returns whether the bytes before an end are still to be decoded.
    pub(super) fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Takes the bytes back that were decoded last.
    pub(super) fn put_back(&mut self, frame: Frame) {
        self.pieces.insert(0, Piece::Frame(frame));
        self.waits = true;
    }

    pub(super) fn push(&mut self, piece: Piece) {
        self.waits = false;
        match (piece, self.last()) {
            (Piece::Noise | Piece::Long, Some(Piece::Noise)) => {}
            // With any of these bytes the frame is complete, and its check fails.
            (Piece::Noise | Piece::Long, Some(Piece::Part(_))) => {
                self.pieces.pop();
                self.push(Piece::Noise);
            }
            (Piece::Noise | Piece::Long, Some(Piece::Long)) => {}
            (Piece::Long, Some(Piece::Frame(_))) if self.pieces.first() == Some(&Piece::Long) => {
                self.pieces.push(Piece::Noise);
            }
            (Piece::Rest(_), Some(Piece::Part(part))) => {
                self.pieces.pop();
                self.pieces.push(Piece::Frame(part));
            }
            // Without their beginning, those of a read look like the beginning of a frame of an unknown function.
            (Piece::Rest(Shape::Read), _) => self.push(Piece::Long),
            (Piece::Rest(_), _) => self.push(Piece::Noise),
            _ => self.pieces.push(piece),
        }
    }

    pub(super) fn next(&mut self) -> Option<Found> {
        let is_frame = |piece: &Piece| matches!(piece, Piece::Frame(_));
        match self.pieces.first()? {
            Piece::Frame(_) if self.waits && !self.has_ended => return None,
            Piece::Frame(frame) => {
                let frame = *frame;
                self.waits = false;
                self.pieces.remove(0);
                let follows = match (self.pieces.is_empty(), self.has_ended) {
                    (false, _) => Follows::More,
                    (true, false) => Follows::Nothing,
                    (true, true) => Follows::Silence,
                };
                self.has_ended &= !self.pieces.is_empty();
                return Some(Found::Frame(frame, follows));
            }
            Piece::Long if !self.has_ended => return None,
            Piece::Part(_) | Piece::Rest(_) | Piece::Noise | Piece::Long => {}
        }
        match self.pieces.iter().position(is_frame) {
            Some(at) => drop(self.pieces.drain(..at)),
            None if self.has_ended => *self = Self::default(),
            None => return None,
        }
        Some(Found::Corrupt)
    }
}
