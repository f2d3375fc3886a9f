//! The errors: in the bytes of the peer, in a message of the caller, in a reply to a request.

use crate::message::Exception;

/// The peer's fault: bytes that are not a Modbus frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// The protocol identifier of the MBAP header is not 0: this is not Modbus TCP, or the stream is out of step.
    #[error("protocol identifier is {found:#06x}, not 0 (at byte 2)")]
    Protocol {
        /// The protocol identifier of the header.
        found: u16,
    },
    /// The length field of the MBAP header counts the unit identifier and a PDU of 1 to 253 bytes.
    #[error("length field is {found}, it must be 2 to 254 (at byte 4)")]
    MbapLength {
        /// The length field of the header.
        found: u16,
    },
    /// The length field of an exception over TCP is not 3, though its unit identifier and PDU have 3 bytes.
    #[error("{exception} for function {function} with the length field {found}, not {expected} (at byte 4)")]
    ExceptionLength {
        /// The transaction identifier, which is that of the request.
        transaction: u16,
        /// The unit that refuses the request.
        unit: u8,
        /// The function code of the request.
        function: u8,
        /// The reason of the refusal.
        exception: Exception,
        /// The length of an exception, 3.
        expected: u16,
        /// The length field of the header.
        found: u16,
    },
    /// The checksum of an RTU frame does not fit its bytes.
    #[error("CRC is {found:#06x}, the {length} bytes of the frame make {expected:#06x}")]
    Crc {
        /// The checksum of the bytes.
        expected: u16,
        /// The checksum in the last two bytes, low byte first.
        found: u16,
        /// The bytes of the frame, with the CRC.
        length: usize,
    },
    /// The stream ended, or the line fell silent, within a frame.
    #[error("the input ends after {found} of at least {expected} bytes")]
    Cut {
        /// The number of bytes of the frame, as far as its beginning shows.
        expected: usize,
        /// The number of bytes that have come.
        found: usize,
    },
    /// An RTU frame would be longer than 256 bytes.
    #[error("a frame of {found} bytes is longer than 256")]
    TooLong {
        /// The number of bytes that the frame has, or that its length field gives.
        found: usize,
    },
    /// More bytes without a frame than one error covers: they belong to the corruption before them.
    #[error("{length} more bytes without a frame")]
    Noise {
        /// The number of these further bytes.
        length: usize,
    },
    /// A PDU without a function code.
    #[error("the PDU is empty")]
    Empty,
    /// A function code that this side cannot send: 0, or above 127 in a request, or 128 in a reply.
    #[error("function code {found} is invalid here (at byte 0 of the PDU)")]
    Function {
        /// The invalid function code, 0 to 255.
        found: u8,
    },
    /// The PDU's length is not the one that its function code and byte count require.
    #[error("a PDU of function {function} has {found} bytes here, not {expected}")]
    PduLength {
        /// The function code of the PDU.
        function: u8,
        /// The required number of bytes, including the function code.
        expected: usize,
        /// The number of bytes of the PDU.
        found: usize,
    },
    /// A quantity of coils or registers outside the limits of the specification.
    #[error("quantity {found} in function {function} is not within 1 to {max}")]
    Quantity {
        /// The function code of the PDU.
        function: u8,
        /// The invalid quantity of coils or registers.
        found: u16,
        /// The maximum that the function allows.
        max: u16,
    },
    /// The byte count contradicts the quantity after or before it.
    #[error("byte count {found} in function {function} contradicts the quantity, which needs {expected}")]
    ByteCount {
        /// The function code of the PDU.
        function: u8,
        /// The byte count that the quantity requires.
        expected: u16,
        /// The byte count in the PDU.
        found: u16,
    },
    /// The byte count of a reply, or of a group in it, is 0, odd before registers, or above the maximum of the function.
    #[error("byte count {found} is invalid in a reply of function {function}")]
    ReplyByteCount {
        /// The function code of the PDU.
        function: u8,
        /// The byte count in the PDU.
        found: u8,
    },
    /// A device identification continues (`FF`) or not (`00`); no other value is allowed.
    #[error("more follows is {found:#04x}, neither 0xff nor 0 (at byte 4 of the PDU)")]
    MoreFollows {
        /// The invalid byte.
        found: u8,
    },
    /// A group of a message about files has the reference type 6; no other value is allowed.
    #[error("reference type {found} in function {function} is not 6")]
    ReferenceType {
        /// The function code of the PDU: 20 or 21.
        function: u8,
        /// The invalid reference type.
        found: u8,
    },
    /// A single coil is written with `FF00` (on) or `0000` (off); no other value is allowed.
    #[error("coil value is {found:#06x}, neither 0xff00 nor 0 (at byte 3 of the PDU)")]
    CoilValue {
        /// The invalid 16-bit value.
        found: u16,
    },
}

/// The caller's fault: a message that the specification does not allow, or that does not fit the buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// The buffer is too small.
    #[error("{needed} bytes are needed, the buffer has {available}")]
    Space {
        /// The number of bytes of the whole frame or PDU.
        needed: usize,
        /// The number of bytes of the buffer.
        available: usize,
    },
    /// A quantity outside the limits of the specification.
    #[error("quantity {found} in function {function} is not within 1 to {max}")]
    Quantity {
        /// The function code of the message.
        function: u8,
        /// The invalid quantity of coils or registers.
        found: usize,
        /// The maximum that the function allows.
        max: u16,
    },
    /// The last coil or register would lie beyond PDU address 65535.
    #[error("{quantity} items from address {address} exceed address 65535")]
    Address {
        /// The PDU address of the first coil or register, from 0.
        address: u16,
        /// The number of coils or registers.
        quantity: u16,
    },
    /// `Other` has a code that is 0, above 127, or one of those that have a type of their own.
    #[error("function code {found} cannot be sent as a raw PDU")]
    Function {
        /// The function code that was given.
        found: u8,
    },
    /// A PDU of 0 or more than 253 bytes.
    #[error("a PDU of {found} bytes is not within 1 to 253")]
    PduLength {
        /// The number of bytes of the PDU.
        found: usize,
    },
}

/// The reason that a well-formed reply does not answer the request that it seems to belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Mismatch {
    /// Another unit answers. Some gateways do: see [`ClientConfig::any_unit`](crate::ClientConfig::any_unit).
    #[error("unit {found} answers a request to unit {expected}")]
    Unit {
        /// The unit that the request was sent to.
        expected: u8,
        /// The unit that answers.
        found: u8,
    },
    /// A reply of another function.
    #[error("function {found} answers a request of function {expected}")]
    Function {
        /// The code of the request.
        expected: u8,
        /// The code of the reply, without the bit that marks an exception.
        found: u8,
    },
    /// The number of data bytes differs from the requested one.
    #[error("{found} data bytes answer a request for {expected}")]
    Quantity {
        /// The number of data bytes that the request requires.
        expected: usize,
        /// The number of data bytes of the reply.
        found: usize,
    },
    /// The reply to a write does not repeat the written values.
    #[error("the reply does not repeat what was written")]
    Echo,
}

/// The caller's fault: a request that a [`Client`](crate::Client) does not accept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum SessionError {
    /// Every request slot is occupied: wait for an event.
    #[error("all {places} request slots are in use")]
    Full {
        /// The number of request slots.
        places: usize,
    },
    /// A broadcast has no reply, so it cannot read.
    #[error("function {function} reads, but a broadcast has no reply")]
    BroadcastRead {
        /// The function code of the request.
        function: u8,
    },
    /// The specification does not allow the request.
    #[error("the request cannot be sent: {0}")]
    #[cfg_attr(feature = "serde", serde(untagged))]
    Encode(#[from] EncodeError),
}

/// The caller's fault: a configuration that cannot work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConfigError {
    /// The number of requests in flight at once is invalid.
    #[error("{found} requests in flight at once are not within 1 to {most}")]
    InFlight {
        /// The configured number of requests in flight at once.
        found: usize,
        /// The number of request slots of the client; 1 if frames have no transaction.
        most: usize,
    },
    /// `echo` is set over TCP: a TCP connection does not return bytes as an adapter for two wires does.
    #[error("over TCP the line returns nothing: echo is for RTU frames")]
    Echo,
    /// The timeout is zero: every request would time out as it is sent.
    #[error("the timeout is zero")]
    Timeout,
    /// The unit is invalid for a server: unit 0 is the broadcast in this configuration.
    #[error("unit {found} is invalid for a server")]
    Unit {
        /// The configured unit.
        found: u8,
    },
}

/// A line of a listing that cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[error("line {line}: {error}")]
#[non_exhaustive]
pub struct ListingError {
    /// The number of the line, counted from 1.
    pub line: usize,
    /// The error in the line.
    pub error: AssignmentError,
}

/// The reason that an assignment is invalid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum AssignmentError {
    /// There are more assignments than slots.
    #[error("{found} assignments exceed the 80 slots")]
    Slots {
        /// The number of assignments, above 80.
        found: usize,
    },
    /// The number of the slot is invalid.
    #[error("the slot is not within 1 to 80")]
    Slot,
    /// A field that a slot does not have, or a value that is not a number where a number is required.
    #[error("slot {slot} has no such field, or the value is invalid")]
    Value {
        /// The number of the slot, 1 to 80.
        slot: u8,
    },
    /// The first register, `$ADDRESS`, is out of range.
    #[error("address {found} is not within 1 to 16384")]
    Address {
        /// The address, counted from 1.
        found: u16,
    },
    /// The number of registers, `$SIZE`, is 0, or reaches beyond the last register.
    #[error("{found} registers from {address} do not lie within 1 to 16384")]
    Size {
        /// The first register, counted from 1.
        address: u16,
        /// The number of registers.
        found: u16,
    },
    /// The variable's name, `$VAR_NAME`, does not have 1 to 37 printable characters.
    #[error("a variable's name has 1 to 37 printable characters, this has {length}")]
    Name {
        /// The length of the name in bytes.
        length: usize,
    },
    /// The factor, `$MULTIPLY`, is neither 0 nor -1, and out of range.
    #[error("multiply {found} is neither 0, -1 nor within 0.0001 to 10000")]
    Multiply {
        /// The factor that was given.
        found: f32,
    },
    /// Two assignments share registers: the one with the lower number hides the other.
    #[error("assignment {first} hides assignment {second} at register {address}")]
    Overlap {
        /// The visible assignment, counted from 1.
        first: usize,
        /// The hidden assignment, counted from 1.
        second: usize,
        /// The first register that both assignments share, counted from 1.
        address: u16,
    },
}

/// A string that its registers cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum TextError {
    /// The string is too long.
    #[error("a string of {found} bytes does not fit registers for {most}")]
    Length {
        /// The number of bytes of the string.
        found: usize,
        /// The maximum, two bytes per register.
        most: usize,
    },
    /// The string contains a NUL, at which it would end.
    #[error("a string cannot hold a NUL (at byte {offset})")]
    Nul {
        /// The offset of the NUL, from 0.
        offset: usize,
    },
}
