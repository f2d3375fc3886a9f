use super::data::{Bits, Words};
use super::function::{self, Length, MEI, Row};
use super::limit;
use super::pdu::{Pdu, sealed};
use super::records::{FileRange, FileRecord, Records};
use super::wire::{check_run, exactly, pair, put_other, put_pair, room, room_for, run, within};
use crate::error::{DecodeError, EncodeError};

/// A request of a client. Addresses are PDU addresses: 0 is the first coil or register of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Request<'a> {
    /// 1: reads coils.
    ReadCoils {
        /// The PDU address of the first coil, from 0.
        address: u16,
        /// The number of coils, 1 to 2000.
        quantity: u16,
    },
    /// 2: reads discrete inputs.
    ReadDiscreteInputs {
        /// The PDU address of the first input, from 0.
        address: u16,
        /// The number of inputs, 1 to 2000.
        quantity: u16,
    },
    /// 3: reads holding registers.
    ReadHoldingRegisters {
        /// The PDU address of the first register, from 0.
        address: u16,
        /// The number of registers, 1 to 125.
        quantity: u16,
    },
    /// 4: reads input registers.
    ReadInputRegisters {
        /// The PDU address of the first register, from 0.
        address: u16,
        /// The number of registers, 1 to 125.
        quantity: u16,
    },
    /// 5: writes one coil.
    WriteCoil {
        /// The PDU address of the coil, from 0.
        address: u16,
        /// Whether the coil is switched on.
        value: bool,
    },
    /// 6: writes one holding register.
    WriteRegister {
        /// The PDU address of the register, from 0.
        address: u16,
        /// The value to write.
        value: u16,
    },
    /// 7, of a serial line: reads eight outputs of the device.
    ReadExceptionStatus,
    /// 8: runs a diagnostic of the serial line.
    Diagnostics {
        /// The subfunction; 0 returns the words.
        subfunction: u16,
        /// The words of the subfunction: 1 to 125 for subfunction 0, otherwise 1.
        data: Words<'a>,
    },
    /// 11, of a serial line: the counter of executed requests.
    GetCommEventCounter,
    /// 12, of a serial line: the counters and the last events.
    GetCommEventLog,
    /// 15: writes coils.
    WriteCoils {
        /// The PDU address of the first coil, from 0.
        address: u16,
        /// The 1 to 1968 coils to write.
        values: Bits<'a>,
    },
    /// 16: writes holding registers.
    WriteRegisters {
        /// The PDU address of the first register, from 0.
        address: u16,
        /// The 1 to 123 registers to write.
        values: Words<'a>,
    },
    /// 17: the device's description of itself.
    ReportServerId,
    /// 20: runs of registers in files: 1 to 35, whose reply has at most 245 bytes, 2 for each run and 2 for each register.
    ReadFileRecord(Records<'a, FileRange>),
    /// 21: registers in files: at most 251 bytes, 7 for each run and 2 for each register.
    WriteFileRecord(Records<'a, FileRecord<'a>>),
    /// 22: the register becomes (register AND `and`) OR (`or` AND NOT `and`).
    MaskWriteRegister {
        /// The PDU address of the register, from 0.
        address: u16,
        /// The bits of the register that are not changed.
        and: u16,
        /// The new values of the other bits.
        or: u16,
    },
    /// 23: writes registers, then reads some.
    ReadWriteRegisters {
        /// The PDU address of the first register to read, from 0.
        address: u16,
        /// The number of registers to read, 1 to 125.
        quantity: u16,
        /// The PDU address of the first register to write, from 0.
        write_address: u16,
        /// The 1 to 121 registers to write.
        values: Words<'a>,
    },
    /// 24: reads the registers of a queue, which stay in it.
    ReadFifoQueue {
        /// The PDU address of the queue's count, from 0.
        address: u16,
    },
    /// 43, MEI type 14: reads objects of the device's identification, from an id on.
    ReadDeviceIdentification {
        /// The category: 1 basic, 2 regular, 3 extended, 4 the object alone.
        category: u8,
        /// The id of the first object, 0 to 255.
        object: u8,
    },
    /// A function without a variant.
    Other {
        /// The function code, 1 to 127.
        function: u8,
        /// The 0 to 252 bytes after the function code.
        data: &'a [u8],
    },
}

impl<'a> Request<'a> {
    /// Decodes the request in a PDU.
    ///
    /// # Errors
    /// If the bytes are not a request that the specification allows. An address beyond the table is not an error
    /// here: the server answers it with exception 2.
    #[inline(always)] // small: the code that uses the request is inlined after it
    pub fn decode(pdu: &'a [u8]) -> Result<Self, DecodeError> {
        let (&function, body) = pdu.split_first().ok_or(DecodeError::Empty)?;
        match function {
            function::READ_HOLDING_REGISTERS => {
                let (address, quantity) = run(function, body, Row::of(function).reads)?;
                Ok(Self::ReadHoldingRegisters { address, quantity })
            }
            _ => Self::decode_other(function, body),
        }
    }

    /// Decodes every other request: apart, so that the request of every cycle is small enough to be inlined where it is
    /// decoded.
    pub(super) fn decode_other(function: u8, body: &'a [u8]) -> Result<Self, DecodeError> {
        Ok(match function {
            function::READ_COILS | function::READ_DISCRETE_INPUTS | function::READ_INPUT_REGISTERS => {
                let (address, quantity) = run(function, body, Row::of(function).reads)?;
                Self::read(function, address, quantity)
            }
            function::WRITE_COIL => {
                let (address, value) = match pair(function, body)? {
                    (address, COIL_ON) => (address, true),
                    (address, 0) => (address, false),
                    (_, found) => return Err(DecodeError::CoilValue { found }),
                };
                Self::WriteCoil { address, value }
            }
            function::WRITE_REGISTER => {
                let (address, value) = pair(function, body)?;
                Self::WriteRegister { address, value }
            }
            function::DIAGNOSTICS => {
                let found = 1 + body.len();
                match body.split_first_chunk() {
                    Some((subfunction, data @ [_, _, ..])) if data.len() % 2 == 0 => Self::Diagnostics {
                        subfunction: u16::from_be_bytes(*subfunction),
                        data: Words::from_wire(data),
                    },
                    _ => {
                        let expected = found.max(4) + 1; // an odd length, 5 at least
                        return Err(DecodeError::PduLength { function, expected, found });
                    }
                }
            }
            function::WRITE_COILS => {
                let (address, body) = word(function, 0, body)?;
                let (quantity, data) = data(function, 2, body)?;
                Self::WriteCoils { address, values: Bits::from_wire(data, quantity.into()) }
            }
            function::WRITE_REGISTERS => {
                let (address, body) = word(function, 0, body)?;
                let (_, data) = data(function, 2, body)?;
                Self::WriteRegisters { address, values: Words::from_wire(data) }
            }
            function::READ_EXCEPTION_STATUS
            | function::GET_COMM_EVENT_COUNTER
            | function::GET_COMM_EVENT_LOG
            | function::REPORT_SERVER_ID => {
                let [] = *exactly(function, body)?;
                Self::bare(function)
            }
            function::READ_FILE_RECORD => Self::ReadFileRecord(Records::decode(body)?),
            function::WRITE_FILE_RECORD => Self::WriteFileRecord(Records::decode(body)?),
            function::READ_FIFO_QUEUE => {
                Self::ReadFifoQueue { address: u16::from_be_bytes(*exactly(function, body)?) }
            }
            function::MASK_WRITE_REGISTER => {
                let [a, b, c, d, e, f] = *exactly(function, body)?;
                let [address, and, or] = [[a, b], [c, d], [e, f]].map(u16::from_be_bytes);
                Self::MaskWriteRegister { address, and, or }
            }
            function::READ_WRITE_REGISTERS => {
                let (address, body) = word(function, 0, body)?;
                let (quantity, body) = word(function, 2, body)?;
                let (write_address, body) = word(function, 4, body)?;
                let quantity = within(function, quantity, Row::of(function).reads)?;
                let (_, data) = data(function, 6, body)?;
                Self::ReadWriteRegisters { address, quantity, write_address, values: Words::from_wire(data) }
            }
            function::READ_DEVICE_IDENTIFICATION if body.first() == Some(&MEI) => {
                let [_, category, object] = *exactly(function, body)?;
                Self::ReadDeviceIdentification { category, object }
            }
            0 | function::EXCEPTION.. => return Err(DecodeError::Function { found: function }),
            function => Self::Other { function, data: body },
        })
    }

    /// Returns a read of function 1 to 4.
    pub(crate) const fn read(function: u8, address: u16, quantity: u16) -> Self {
        match function {
            function::READ_COILS => Self::ReadCoils { address, quantity },
            function::READ_DISCRETE_INPUTS => Self::ReadDiscreteInputs { address, quantity },
            function::READ_HOLDING_REGISTERS => Self::ReadHoldingRegisters { address, quantity },
            _ => Self::ReadInputRegisters { address, quantity },
        }
    }

    /// Returns the request of a function without data: 7, 11, 12 or 17.
    pub(crate) const fn bare(function: u8) -> Self {
        match function {
            function::READ_EXCEPTION_STATUS => Self::ReadExceptionStatus,
            function::GET_COMM_EVENT_COUNTER => Self::GetCommEventCounter,
            function::GET_COMM_EVENT_LOG => Self::GetCommEventLog,
            _ => Self::ReportServerId,
        }
    }

    /// Returns whether a reply may be equal to the request, or begin in the same way; for a function without a type that is
    /// unknown.
    pub(crate) fn is_mirrored(&self) -> bool {
        match *self {
            // The reply has the number of its bytes where the request has the high byte of its address.
            Self::ReadCoils { address, quantity }
            | Self::ReadDiscreteInputs { address, quantity }
            | Self::ReadHoldingRegisters { address, quantity }
            | Self::ReadInputRegisters { address, quantity }
            | Self::ReadWriteRegisters { address, quantity, .. } => {
                address >> 8 == Row::of(self.function()).bytes(quantity)
            }
            // The reply has its byte count there.
            Self::ReadFifoQueue { address } => address <= 2 + 2 * limit::FIFO,
            Self::WriteCoils { .. } | Self::WriteRegisters { .. } | Self::ReadFileRecord(_) => false,
            _ => true,
        }
    }

    /// Returns the function code.
    pub const fn function(&self) -> u8 {
        match self {
            Self::ReadCoils { .. } => function::READ_COILS,
            Self::ReadDiscreteInputs { .. } => function::READ_DISCRETE_INPUTS,
            Self::ReadHoldingRegisters { .. } => function::READ_HOLDING_REGISTERS,
            Self::ReadInputRegisters { .. } => function::READ_INPUT_REGISTERS,
            Self::WriteCoil { .. } => function::WRITE_COIL,
            Self::WriteRegister { .. } => function::WRITE_REGISTER,
            Self::ReadExceptionStatus => function::READ_EXCEPTION_STATUS,
            Self::Diagnostics { .. } => function::DIAGNOSTICS,
            Self::GetCommEventCounter => function::GET_COMM_EVENT_COUNTER,
            Self::GetCommEventLog => function::GET_COMM_EVENT_LOG,
            Self::WriteCoils { .. } => function::WRITE_COILS,
            Self::WriteRegisters { .. } => function::WRITE_REGISTERS,
            Self::ReportServerId => function::REPORT_SERVER_ID,
            Self::ReadFileRecord(_) => function::READ_FILE_RECORD,
            Self::WriteFileRecord(_) => function::WRITE_FILE_RECORD,
            Self::MaskWriteRegister { .. } => function::MASK_WRITE_REGISTER,
            Self::ReadWriteRegisters { .. } => function::READ_WRITE_REGISTERS,
            Self::ReadFifoQueue { .. } => function::READ_FIFO_QUEUE,
            Self::ReadDeviceIdentification { .. } => function::READ_DEVICE_IDENTIFICATION,
            Self::Other { function, .. } => *function,
        }
    }

    /// Returns the number of bits or registers that the request reads; 0 if it does not read.
    pub const fn quantity_read(&self) -> u16 {
        match self {
            Self::ReadCoils { quantity, .. }
            | Self::ReadDiscreteInputs { quantity, .. }
            | Self::ReadHoldingRegisters { quantity, .. }
            | Self::ReadInputRegisters { quantity, .. }
            | Self::ReadWriteRegisters { quantity, .. } => *quantity,
            _ => 0,
        }
    }

    /// Returns true if the request is useful only with a reply: such a request cannot be broadcast.
    pub const fn reads(&self) -> bool {
        matches!(self, Self::ReadDeviceIdentification { .. }) || Row::of(self.function()).reads > 0
    }
}

impl sealed::Sealed for Request<'_> {}

impl Pdu for Request<'_> {
    #[inline(always)] // with `encode`: one arm is left
    fn encoded_len(&self) -> usize {
        match self {
            Self::Diagnostics { data, .. } => 3 + 2 * data.len(),
            Self::ReadFileRecord(records) => records.encoded_len(),
            Self::WriteFileRecord(records) => records.encoded_len(),
            Self::ReadDeviceIdentification { .. } => 4,
            Self::WriteCoils { values, .. } => 6 + values.byte_len(),
            Self::WriteRegisters { values, .. } => 6 + 2 * values.len(),
            Self::ReadWriteRegisters { values, .. } => 10 + 2 * values.len(),
            Self::Other { data, .. } => 1 + data.len(),
            _ => match Row::of(self.function()).request {
                Length::Fixed(len) => len.into(),
                Length::Counted(_) | Length::Unknown => 5,
            },
        }
    }

    #[inline(always)] // the kind is mostly known where it is encoded: one arm is left of the match
    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let function = self.function();
        match *self {
            Self::ReadCoils { address, quantity } | Self::ReadDiscreteInputs { address, quantity } => {
                check_run(function, address, quantity.into(), limit::READ_BITS)?;
                put_pair(out, function, address, quantity)
            }
            Self::ReadHoldingRegisters { address, quantity }
            | Self::ReadInputRegisters { address, quantity } => {
                check_run(function, address, quantity.into(), limit::READ_REGISTERS)?;
                put_pair(out, function, address, quantity)
            }
            Self::WriteCoil { address, value } => {
                put_pair(out, function, address, if value { COIL_ON } else { 0 })
            }
            Self::WriteRegister { address, value } => put_pair(out, function, address, value),
            Self::MaskWriteRegister { address, and, or } => {
                let ([a, b], [c, d], [e, f]) = (address.to_be_bytes(), and.to_be_bytes(), or.to_be_bytes());
                *room_for(out)? = [function, a, b, c, d, e, f];
                Ok(7)
            }
            Self::Diagnostics { subfunction, data } => put_diagnostic(out, subfunction, data),
            Self::ReadExceptionStatus
            | Self::GetCommEventCounter
            | Self::GetCommEventLog
            | Self::ReportServerId => {
                *room_for(out)? = [function];
                Ok(1)
            }
            Self::ReadFileRecord(records) => records.encode(out),
            Self::WriteFileRecord(records) => records.encode(out),
            Self::ReadFifoQueue { address } => {
                let [high, low] = address.to_be_bytes();
                *room_for(out)? = [function, high, low];
                Ok(3)
            }
            Self::ReadDeviceIdentification { category, object } => {
                *room_for(out)? = [function, MEI, category, object];
                Ok(4)
            }
            Self::WriteCoils { address, values } => put_coils(out, address, values),
            Self::WriteRegisters { address, values } => put_words(out, &[address], values),
            Self::ReadWriteRegisters { address, quantity, write_address, values } => {
                check_run(function, address, quantity.into(), Row::of(function).reads)?;
                put_words(out, &[address, quantity, write_address], values)
            }
            Self::Other { function, data } => put_other(out, function, data),
        }
    }
}

/// The value of a coil that is switched on; 0 switches it off.
const COIL_ON: u16 = 0xFF00;

/// Reads the word at `offset` after the function code; returns it with the bytes after it.
#[inline]
fn word(function: u8, offset: usize, body: &[u8]) -> Result<(u16, &[u8]), DecodeError> {
    match body.split_first_chunk() {
        Some((word, rest)) => Ok((u16::from_be_bytes(*word), rest)),
        None => {
            Err(DecodeError::PduLength { function, expected: offset + 3, found: 1 + offset + body.len() })
        }
    }
}

/// Decodes a quantity, its byte count and exactly the data that they announce, `offset` after the function code.
#[inline]
fn data(function: u8, offset: usize, body: &[u8]) -> Result<(u16, &[u8]), DecodeError> {
    let row = Row::of(function);
    let (quantity, body) = word(function, offset, body)?;
    let quantity = within(function, quantity, row.writes)?;
    let head = 1 + offset + 2;
    let Some((&count, data)) = body.split_first() else {
        return Err(DecodeError::PduLength { function, expected: head + 1, found: head });
    };
    let expected = row.bytes(quantity);
    if u16::from(count) != expected {
        return Err(DecodeError::ByteCount { function, expected, found: count.into() });
    }
    if data.len() != usize::from(count) {
        let (expected, found) = (head + 1 + usize::from(count), head + 1 + data.len());
        return Err(DecodeError::PduLength { function, expected, found });
    }
    Ok((quantity, data))
}

// The messages of variable length are written by functions of their own, which are small enough to be inlined where a request
// is known; the rest then costs nothing.

fn put_diagnostic(out: &mut [u8], subfunction: u16, data: Words<'_>) -> Result<usize, EncodeError> {
    let function = function::DIAGNOSTICS;
    check_run(function, 0, data.len(), Row::of(function).writes)?;
    let (head, words) = room(out, 3 + 2 * data.len())?.split_at_mut(3);
    let [high, low] = subfunction.to_be_bytes();
    head.copy_from_slice(&[function, high, low]);
    data.write(words);
    Ok(3 + 2 * data.len())
}

fn put_coils(out: &mut [u8], address: u16, values: Bits<'_>) -> Result<usize, EncodeError> {
    let function = function::WRITE_COILS;
    let quantity = check_run(function, address, values.len(), Row::of(function).writes)?;
    let (data, len) = put_head(out, function, &[address, quantity], values.byte_len())?;
    values.write(data);
    Ok(len)
}

/// Encodes a write of registers, or a read and write: the last of `words` is the address of the first register written.
fn put_words<const N: usize>(
    out: &mut [u8],
    words: &[u16; N],
    values: Words<'_>,
) -> Result<usize, EncodeError> {
    let function = if N == 1 { function::WRITE_REGISTERS } else { function::READ_WRITE_REGISTERS };
    let address = words.last().copied().unwrap_or_default();
    let quantity = check_run(function, address, values.len(), Row::of(function).writes)?;
    let head = [quantity];
    let (data, len) = put_head(out, function, words.iter().chain(&head), 2 * values.len())?;
    values.write(data);
    Ok(len)
}

/// Writes the function, the words before a byte count and the count itself; returns the space for the data and the length of
/// the whole.
fn put_head<'o, 'w>(
    out: &'o mut [u8],
    function: u8,
    words: impl IntoIterator<Item = &'w u16, IntoIter: Clone>,
    count: usize,
) -> Result<(&'o mut [u8], usize), EncodeError> {
    let words = words.into_iter();
    let head = 2 + 2 * words.clone().count();
    let (head, data) = room(out, head + count)?.split_at_mut(head);
    let len = head.len() + data.len();
    if let [first, pairs @ .., last] = head {
        *first = function;
        for (pair, word) in pairs.as_chunks_mut().0.iter_mut().zip(words) {
            *pair = word.to_be_bytes();
        }
        *last = u8::try_from(count).unwrap_or(u8::MAX); // at most 246: the quantity was checked
    }
    Ok((data, len))
}
