use robot_session::Encode;

use crate::envelope::{DATA_LEN, OVERHEAD, envelope};
use crate::error::EncodeError;
use crate::keys::Keys;

/// One measurement of the ball: forces, moments and keys (§4.2).
///
/// The source gives neither units nor the signs of the axes: the values are the raw −128..=127 of the sensor. Which way the
/// robot goes is for the caller to decide, and to try out slowly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Packet {
    /// The sensor type, 0 to 7.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = three_bits))]
    pub sensor_type: u8,
    /// The sensor number, 0 to 7.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = three_bits))]
    pub sensor: u8,
    /// Whether the values are new since the last packet.
    pub status: Status,
    /// The force along X, Y, Z, −128 to 127 each, in units of the sensor.
    pub force: [i8; 3],
    /// The moment about X, Y, Z, −128 to 127 each, in units of the sensor.
    pub moment: [i8; 3],
    /// The keys that are down.
    pub keys: Keys,
}

impl Packet {
    /// ID byte, three forces, three moments, keys.
    pub const DATA_LEN: usize = DATA_LEN;
    /// The bytes on the wire.
    pub const LEN: usize = DATA_LEN + OVERHEAD;

    /// Returns the packet in its envelope.
    ///
    /// # Errors
    /// [`EncodeError::SensorType`], [`EncodeError::Sensor`].
    pub fn to_bytes(&self) -> Result<[u8; Self::LEN], EncodeError> {
        self.to_data().map(|data| envelope(&data))
    }

    /// Appends the packet in its envelope.
    ///
    /// # Errors
    /// [`EncodeError::SensorType`], [`EncodeError::Sensor`], [`EncodeError::BufferTooSmall`].
    #[cfg(feature = "bytes")]
    pub fn append_to(&self, out: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let bytes = self.to_bytes()?;
        if out.remaining_mut() < Self::LEN {
            return Err(EncodeError::BufferTooSmall { needed: Self::LEN, available: out.remaining_mut() });
        }
        out.put_slice(&bytes);
        Ok(())
    }

    /// Returns X, Y, Z, MX, MY, MZ.
    pub fn axes(&self) -> [i8; 6] {
        let ([x, y, z], [mx, my, mz]) = (self.force, self.moment);
        [x, y, z, mx, my, mz]
    }

    #[inline]
    pub(crate) fn from_data(&[id, fx, fy, fz, mx, my, mz, keys]: &[u8; DATA_LEN]) -> Self {
        Self {
            sensor_type: id >> 4 & 7,
            sensor: id & 7,
            status: Status::from_id(id),
            force: [fx.cast_signed(), fy.cast_signed(), fz.cast_signed()],
            moment: [mx.cast_signed(), my.cast_signed(), mz.cast_signed()],
            keys: Keys(keys),
        }
    }

    fn to_data(self) -> Result<[u8; DATA_LEN], EncodeError> {
        if self.sensor_type > 7 {
            return Err(EncodeError::SensorType { found: self.sensor_type });
        }
        if self.sensor > 7 {
            return Err(EncodeError::Sensor { found: self.sensor });
        }
        let id = self.status as u8 | self.sensor_type << 4 | self.sensor;
        let [fx, fy, fz, mx, my, mz] = self.axes().map(i8::cast_unsigned);
        Ok([id, fx, fy, fz, mx, my, mz, self.keys.0])
    }
}

/// Always 12 bytes.
impl Encode for Packet {
    /// [`EncodeError::SensorType`], [`EncodeError::Sensor`], [`EncodeError::BufferTooSmall`].
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        Self::LEN
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let bytes = self.to_bytes()?;
        let available = out.len();
        let Some(out) = out.first_chunk_mut() else {
            return Err(EncodeError::BufferTooSmall { needed: Self::LEN, available });
        };
        *out = bytes;
        Ok(Self::LEN)
    }
}

/// The bits ab1 and ab0 of the ID byte (§4.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
#[repr(u8)]
pub enum Status {
    /// 00: requested correctly, and the values are new.
    Fresh = 0x00,
    /// 01: the source gives it no meaning.
    Reserved = 0x08,
    /// 10: the ball's processor was not ready with new values and sends the ones before.
    Old = 0x80,
    /// 11: the source gives it no meaning. Its `serde` form is `"reserved"` too, which reads back as 01.
    #[cfg_attr(feature = "serde", serde(rename(serialize = "reserved", deserialize = "reserved_11")))]
    Reserved11 = 0x88,
}

impl Status {
    /// Returns whether the values are new. The values of an unknown status are not.
    pub fn is_fresh(self) -> bool {
        self == Self::Fresh
    }

    fn from_id(id: u8) -> Self {
        match id & 0x88 {
            0x00 => Self::Fresh,
            0x08 => Self::Reserved,
            0x80 => Self::Old,
            _ => Self::Reserved11,
        }
    }
}

#[cfg(feature = "arbitrary")]
fn three_bits(u: &mut arbitrary::Unstructured<'_>) -> arbitrary::Result<u8> {
    u.int_in_range(0..=7)
}
