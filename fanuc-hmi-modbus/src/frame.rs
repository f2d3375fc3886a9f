//! The envelope: MBAP header on TCP, unit and CRC on a serial line.

use robot_session::Encode;

use crate::crc::crc16;
use crate::error::{DecodeError, EncodeError};
use crate::message::function::{self, Length, Row};
use crate::message::{Pdu, PduBuf, Reply, Request, limit};
use crate::registers::{Registers, serve};

/// A frame ("ADU"): a unit, and a PDU as raw bytes, a [`Request`], a [`Reply`] or a [`PduBuf`].
///
/// ```
/// use fanuc_hmi_modbus::robot_session::Encode as _;
/// use fanuc_hmi_modbus::{Frame, Request};
///
/// let pdu = Request::ReadHoldingRegisters { address: 0, quantity: 37 };
/// let mut out = [0; Frame::MAX_LEN];
/// let len = Frame { transaction: Some(1), unit: 1, pdu }.encode(&mut out)?;
/// assert_eq!(out[..len], [0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 37]);
///
/// let (frame, used) = Frame::decode_tcp(&out[..len])?.expect("a whole frame");
/// assert_eq!((frame.request()?.pdu, used), (pdu, len));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Frame<P> {
    /// The transaction identifier of a TCP frame, which its reply repeats. `None` makes an RTU frame.
    pub transaction: Option<u16>,
    /// The unit identifier ("slave address"): 1 to 247, 0 for a broadcast; 255 if TCP needs none.
    pub unit: u8,
    /// The request or the reply.
    pub pdu: P,
}

/// The end that sends the bytes: requests and replies of one function differ in shape, and on a serial line in length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The client ("master") sends requests.
    Client,
    /// The server ("slave") sends replies.
    Server,
}

/// Bytes of the MBAP header: transaction, protocol, length, unit.
const MBAP: usize = 7;
/// Bytes of an RTU frame around its PDU: unit and CRC.
pub(crate) const RTU: usize = 3;

impl Frame<&[u8]> {
    /// The longest TCP frame; an RTU frame has at most [`MAX_RTU_LEN`](Self::MAX_RTU_LEN).
    pub const MAX_LEN: usize = MBAP + limit::PDU;
    /// The longest RTU frame.
    pub const MAX_RTU_LEN: usize = RTU + limit::PDU;
}

impl<'a> Frame<&'a [u8]> {
    /// Decodes the TCP frame at the beginning of these bytes; returns it with the number of its bytes, or `None` if more are
    /// needed. Its length is that of its header; a [`Decoder`](crate::Decoder) of a server's frames also accepts an exception
    /// with a wrong length.
    ///
    /// # Errors
    /// If the header is not one of Modbus TCP.
    #[inline]
    pub fn decode_tcp(bytes: &'a [u8]) -> Result<Option<(Self, usize)>, DecodeError> {
        let len = match bytes.first_chunk() {
            Some(header) => Self::tcp_len(header)?,
            None => return Ok(None),
        };
        Ok(bytes.get(..len).and_then(Self::from_tcp_parts).map(|frame| (frame, len)))
    }

    /// Returns the length of the TCP frame that begins with these bytes.
    #[inline]
    pub(crate) fn tcp_len(header: &[u8; 6]) -> Result<usize, DecodeError> {
        let [_, _, p0, p1, l0, l1] = *header;
        // One number, in which a protocol other than 0 makes a length that is too great.
        match u32::from_be_bytes([p0, p1, l0, l1]) {
            length @ 2..=254 => Ok(6 + length as usize),
            _ => Err(bad_header(header)),
        }
    }

    /// Returns the parts of a TCP frame whose header was checked.
    #[inline]
    pub(crate) fn from_tcp_parts(bytes: &'a [u8]) -> Option<Self> {
        let (&[t0, t1, _, _, _, _, unit], pdu) = bytes.split_first_chunk()?;
        Some(Self { transaction: Some(u16::from_be_bytes([t0, t1])), unit, pdu })
    }

    /// Decodes the RTU frame of `side` at the beginning of these bytes; returns it with the number of its bytes, or `None` if
    /// more are needed. A function that has no type of its own ends with the silence alone: then this is `None` up to
    /// 256 bytes, and [`decode_rtu_whole`](Self::decode_rtu_whole) decodes it.
    ///
    /// # Errors
    /// If the CRC is wrong or the frame would be longer than 256 bytes.
    pub fn decode_rtu(bytes: &'a [u8], side: Side) -> Result<Option<(Self, usize)>, DecodeError> {
        match RtuLen::of(bytes, side) {
            RtuLen::Known(len) if len > Self::MAX_RTU_LEN => Err(DecodeError::TooLong { found: len }),
            RtuLen::Known(len) => match bytes.get(..len) {
                Some(frame) => Ok(Some((Self::decode_rtu_whole(frame)?, len))),
                None => Ok(None),
            },
            RtuLen::Silence if bytes.len() > Self::MAX_RTU_LEN => {
                // However many there are: the division into reads must have no effect.
                Err(DecodeError::TooLong { found: Self::MAX_RTU_LEN + 1 })
            }
            RtuLen::Silence | RtuLen::AtLeast(_) => Ok(None),
        }
    }

    /// Decodes all of these bytes as one RTU frame, which has a silence on both sides.
    ///
    /// # Errors
    /// If the CRC is wrong, or there are fewer than 4 or more than 256 bytes.
    pub fn decode_rtu_whole(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        let length = bytes.len();
        if length > Self::MAX_RTU_LEN {
            return Err(DecodeError::TooLong { found: length });
        }
        let parts = bytes.split_last_chunk().and_then(|(body, crc)| Some((body, body.split_first()?, crc)));
        let Some((body, (&unit, pdu @ [_, ..]), &crc)) = parts else {
            return Err(DecodeError::Cut { expected: RTU + 1, found: length });
        };
        let (expected, found) = (crc16(body), u16::from_le_bytes(crc));
        if expected == found {
            Ok(Self { transaction: None, unit, pdu })
        } else {
            Err(DecodeError::Crc { expected, found, length })
        }
    }

    /// Returns the parts of an RTU frame whose CRC was checked.
    #[inline]
    pub(crate) fn from_rtu_parts(bytes: &'a [u8]) -> Option<Self> {
        let (unit, pdu) = bytes.split_last_chunk::<2>()?.0.split_first()?;
        Some(Self { transaction: None, unit: *unit, pdu })
    }

    /// Returns the function code; 0 if the PDU is empty, which that of a decoder never is.
    #[inline]
    pub(crate) fn function(&self) -> u8 {
        self.pdu.first().copied().unwrap_or_default()
    }

    /// Returns the same frame with its request.
    ///
    /// # Errors
    /// As [`Request::decode`].
    #[inline]
    pub fn request(self) -> Result<Frame<Request<'a>>, DecodeError> {
        Ok(Frame { transaction: self.transaction, unit: self.unit, pdu: Request::decode(self.pdu)? })
    }

    /// Returns the same frame with its reply.
    ///
    /// # Errors
    /// As [`Reply::decode`].
    #[inline]
    pub fn reply(self) -> Result<Frame<Reply<'a>>, DecodeError> {
        Ok(Frame { transaction: self.transaction, unit: self.unit, pdu: Reply::decode(self.pdu)? })
    }

    /// Executes the request in this frame, and writes the frame that answers it to the beginning of `out`; returns its
    /// length, or `None` if the longest frame does not fit `out`: then nothing is done. See [`serve`](crate::serve).
    #[inline(always)] // with `serve`
    pub fn serve<R: Registers + ?Sized>(&self, registers: &mut R, out: &mut [u8]) -> Option<usize> {
        let Some(transaction) = self.transaction else { return self.serve_rtu(registers, out) };
        let (head, rest) = out.split_first_chunk_mut()?;
        let len = serve(self.pdu, registers, rest.first_chunk_mut()?);
        put_mbap(head, transaction, self.unit, len);
        Some(MBAP + len)
    }

    fn serve_rtu<R: Registers + ?Sized>(&self, registers: &mut R, out: &mut [u8]) -> Option<usize> {
        let out = out.get_mut(..Frame::MAX_RTU_LEN)?;
        let (unit, rest) = out.split_first_mut()?;
        *unit = self.unit;
        let len = serve(self.pdu, registers, rest.first_chunk_mut()?);
        seal(out, 1 + len)
    }

    /// Returns a copy that borrows nothing.
    ///
    /// # Errors
    /// If the PDU is empty or longer than 253 bytes, which a decoded one never is.
    pub fn to_buf(self) -> Result<Frame<PduBuf>, EncodeError> {
        Ok(Frame { transaction: self.transaction, unit: self.unit, pdu: PduBuf::new(&self.pdu)? })
    }
}

impl Frame<PduBuf> {
    /// Returns the frame as a borrow.
    pub fn as_ref(&self) -> Frame<&[u8]> {
        Frame { transaction: self.transaction, unit: self.unit, pdu: self.pdu.as_bytes() }
    }
}

impl<P: Pdu> Frame<P> {
    fn encode_rtu(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let available = out.len();
        let Some((unit, rest)) = out.split_first_mut() else {
            return Err(EncodeError::Space { needed: self.encoded_len(), available });
        };
        let len = self.pdu.encode(rest).map_err(|error| in_frame(error, RTU, available))?;
        *unit = self.unit;
        seal(out, 1 + len).ok_or(EncodeError::Space { needed: RTU + len, available })
    }

    /// Appends the frame.
    ///
    /// # Errors
    /// If the specification does not allow the message; then nothing is appended.
    ///
    /// # Panics
    /// As [`bytes::BufMut::put_slice`], when a buffer that cannot grow is full.
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let mut frame = [0; Frame::MAX_LEN];
        let len = self.encode(&mut frame)?;
        out.put_slice(frame.get(..len).unwrap_or_default());
        Ok(())
    }
}

/// A frame with a transaction is a TCP frame, one without is an RTU frame.
impl<P: Pdu> Encode for Frame<P> {
    type Error = EncodeError;

    #[inline]
    fn encoded_len(&self) -> usize {
        self.pdu.encoded_len() + if self.transaction.is_some() { MBAP } else { RTU }
    }

    #[inline(always)] // a message that is known where it is encoded costs its own few stores and no more
    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let Some(transaction) = self.transaction else { return self.encode_rtu(out) };
        let available = out.len();
        let Some((head, rest)) = out.split_first_chunk_mut() else {
            return Err(EncodeError::Space { needed: self.encoded_len(), available });
        };
        match self.pdu.encode(rest) {
            Ok(len) => {
                put_mbap(head, transaction, self.unit, len);
                Ok(MBAP + len)
            }
            Err(error) => Err(in_frame(error, MBAP, available)),
        }
    }
}

#[cold]
#[inline(never)]
fn bad_header(&[_, _, p0, p1, l0, l1]: &[u8; 6]) -> DecodeError {
    match u16::from_be_bytes([p0, p1]) {
        0 => DecodeError::MbapLength { found: u16::from_be_bytes([l0, l1]) },
        found => DecodeError::Protocol { found },
    }
}

/// Returns the error of a PDU as that of its frame, which takes `around` bytes more.
#[cold]
fn in_frame(error: EncodeError, around: usize, available: usize) -> EncodeError {
    match error {
        EncodeError::Space { needed, .. } => EncodeError::Space { needed: around + needed, available },
        error => error,
    }
}

/// Writes the header in front of a PDU of `pdu` bytes.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "a PDU has at most 253 bytes")]
fn put_mbap(head: &mut [u8; MBAP], transaction: u16, unit: u8, pdu: usize) {
    let [t0, t1, p0, p1, l0, l1, to_unit] = head;
    [*t0, *t1] = transaction.to_be_bytes();
    [*p0, *p1] = [0, 0];
    [*l0, *l1] = (1 + pdu as u16).to_be_bytes();
    *to_unit = unit;
}

/// Puts the CRC after the first `len` bytes, and returns the number of bytes with it; `None` if it does not fit.
#[inline]
fn seal(out: &mut [u8], len: usize) -> Option<usize> {
    let (body, rest) = out.split_at_mut_checked(len)?;
    *rest.first_chunk_mut()? = crc16(body).to_le_bytes();
    Some(len + 2)
}

/// The length of an RTU frame, as its first bytes show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RtuLen {
    /// The number of bytes.
    Known(usize),
    /// The byte count of the frame has not arrived: the number of bytes that show it.
    AtLeast(usize),
    /// Only the silence after the frame shows its length.
    Silence,
}

impl RtuLen {
    #[inline(never)]
    pub(crate) fn of(bytes: &[u8], side: Side) -> Self {
        let Some(&code) = bytes.get(1) else { return Self::AtLeast(RTU + 1) };
        match pdu_length(code, side) {
            Length::Fixed(pdu) => Self::Known(RTU + usize::from(pdu)),
            Length::Counted(at) => {
                let head = usize::from(at) + 1;
                match bytes.get(head) {
                    Some(&count) => Self::Known(RTU + head + usize::from(count)),
                    None => Self::AtLeast(RTU + head),
                }
            }
            Length::Unknown => Self::Silence,
        }
    }
}

/// Returns the length of a PDU with this function code.
#[inline]
pub(crate) const fn pdu_length(code: u8, side: Side) -> Length {
    match side {
        Side::Client => Row::of(code).request,
        Side::Server if code > function::EXCEPTION => Length::Fixed(2),
        Side::Server => Row::of(code).reply,
    }
}
