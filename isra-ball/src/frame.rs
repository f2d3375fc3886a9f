use robot_session::Encode;

use crate::envelope::{OVERHEAD, check_header, checksum, envelope, header, open};
use crate::error::{DecodeError, EncodeError};
use crate::message::Packet;

/// A packet in its envelope: `n  −n  n⊕55h  data…  checksum`, n being the number of data bytes.
///
/// The ball of the source sends n = 8, and [`Frame::packet`] reads those. Other settings of its DIP switches change n in ways
/// the source does not give: such packets are decoded and their data left as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    data: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Length byte, its complement, its XOR, and the checksum.
    pub const OVERHEAD: usize = OVERHEAD;
    /// The longest packet on the wire.
    pub const MAX_LEN: usize = 255 + Self::OVERHEAD;

    /// Reads the packet that begins at the first byte. `None`: more bytes are needed.
    ///
    /// # Errors
    /// [`DecodeError::Header`] as soon as one of the first three bytes is wrong, [`DecodeError::Checksum`].
    #[inline]
    pub fn decode(bytes: &'a [u8]) -> Result<Option<(Self, usize)>, DecodeError> {
        // The packets of the source, that is nearly all: their header and length are constants.
        if let Some(packet) = bytes.first_chunk()
            && let Some(data) = open(packet)
        {
            return Ok(Some((Self { data }, Packet::LEN)));
        }
        Self::decode_any(bytes)
    }

    #[cold]
    fn decode_any(bytes: &'a [u8]) -> Result<Option<(Self, usize)>, DecodeError> {
        let Some((head, rest)) = bytes.split_first_chunk::<3>() else {
            return check_header(bytes).map(|()| None);
        };
        let [n, ..] = *head;
        if *head != header(n) {
            return check_header(head).map(|()| None);
        }
        let Some((data, [found, ..])) = rest.split_at_checked(n.into()) else {
            return Ok(None);
        };
        let expected = checksum(data);
        if expected != *found {
            return Err(DecodeError::Checksum { offset: 3 + data.len(), expected, found: *found });
        }
        Ok(Some((Self { data }, data.len() + Self::OVERHEAD)))
    }

    /// Creates a frame around data bytes; at most 255 fit.
    pub fn new(data: &'a [u8]) -> Option<Self> {
        u8::try_from(data.len()).is_ok().then_some(Self { data })
    }

    /// Returns the data bytes: ID, forces, moments and keys if there are 8 of them.
    pub fn data(&self) -> &'a [u8] {
        self.data
    }

    /// Returns the typed view.
    ///
    /// # Errors
    /// [`DecodeError::Layout`] unless there are 8 data bytes.
    #[inline]
    pub fn packet(&self) -> Result<Packet, DecodeError> {
        match self.data.try_into() {
            Ok(data) => Ok(Packet::from_data(data)),
            Err(_) => Err(DecodeError::Layout { expected: Packet::DATA_LEN, found: self.data.len() }),
        }
    }
}

/// Only frames of 8 data bytes are written.
impl Encode for Frame<'_> {
    /// [`EncodeError::Layout`], [`EncodeError::BufferTooSmall`].
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.data.len() + Self::OVERHEAD
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let Ok(data) = <&[u8; Packet::DATA_LEN]>::try_from(self.data) else {
            return Err(EncodeError::Layout { expected: Packet::DATA_LEN, found: self.data.len() });
        };
        let available = out.len();
        let Some(out) = out.first_chunk_mut() else {
            return Err(EncodeError::BufferTooSmall { needed: self.encoded_len(), available });
        };
        *out = envelope(data);
        Ok(out.len())
    }
}

/// The packet's object, or `{"data":[…]}` when the layout is unknown.
#[cfg(feature = "serde")]
impl serde::Serialize for Frame<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        if let Ok(packet) = self.packet() {
            return packet.serialize(serializer);
        }
        let mut object = serializer.serialize_struct("Frame", 1)?;
        object.serialize_field("data", self.data)?;
        object.end()
    }
}
