use super::data::{Bits, Words};
use super::exception::Exception;
use super::function::{self, MEI, Row};
use super::identification::DeviceIdentification;
use super::limit;
use super::pdu::{Pdu, sealed};
use super::records::{FileRecord, Records};
use super::request::Request;
use super::wire::{check_run, exactly, pair, put_other, put_pair, room, room_for, run};
use crate::error::{DecodeError, EncodeError, Mismatch};

/// A reply of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Reply<'a> {
    /// 1: 8 coils in each byte; the last byte is filled up with 0.
    Coils(Bits<'a>),
    /// 2: 8 discrete inputs in each byte; the last byte is filled up with 0.
    DiscreteInputs(Bits<'a>),
    /// 3: 1 to 125 holding registers.
    HoldingRegisters(Words<'a>),
    /// 4: 1 to 125 input registers.
    InputRegisters(Words<'a>),
    /// 5: repeats the request.
    WriteCoil {
        /// The PDU address of the coil, from 0.
        address: u16,
        /// Whether the coil was switched on.
        value: bool,
    },
    /// 6: repeats the request.
    WriteRegister {
        /// The PDU address of the register, from 0.
        address: u16,
        /// The value that was written.
        value: u16,
    },
    /// 7: eight outputs of the device.
    ExceptionStatus(u8),
    /// 8: the result of a diagnostic of the serial line.
    Diagnostics {
        /// The subfunction of the request; 0 returns the request's words.
        subfunction: u16,
        /// For subfunction 0 the words of the request, for the others one word.
        data: Words<'a>,
    },
    /// 11: the counter of executed requests.
    CommEventCounter {
        /// FFFFh if the device is still busy with an earlier request, otherwise 0.
        status: u16,
        /// The number of requests that the device has executed, modulo 65536.
        events: u16,
    },
    /// 12: the counters and the last events.
    CommEventLog {
        /// FFFFh if the device is still busy with an earlier request, otherwise 0.
        status: u16,
        /// The number of requests that the device has executed, modulo 65536.
        events: u16,
        /// The number of messages that the device has received, modulo 65536.
        messages: u16,
        /// The events, 0 to 64 bytes, the last one first.
        log: &'a [u8],
    },
    /// 15: coils were written.
    WriteCoils {
        /// The PDU address of the first coil, from 0.
        address: u16,
        /// The number of coils that were written, 1 to 1968.
        quantity: u16,
    },
    /// 16: registers were written.
    WriteRegisters {
        /// The PDU address of the first register, from 0.
        address: u16,
        /// The number of registers that were written, 1 to 123.
        quantity: u16,
    },
    /// Function 17: 1 to 250 bytes that the device chooses: an id, FF if the device runs or 00, further bytes.
    ServerId(&'a [u8]),
    /// 20: the registers of each run.
    FileRecords(Records<'a, Words<'a>>),
    /// 21: repeats the request.
    WriteFileRecord(Records<'a, FileRecord<'a>>),
    /// 22: repeats the request.
    MaskWriteRegister {
        /// The PDU address of the register, from 0.
        address: u16,
        /// The bits of the register that were not changed.
        and: u16,
        /// The new values of the other bits.
        or: u16,
    },
    /// 23: the 1 to 125 registers that were read after the write.
    ReadWriteRegisters(Words<'a>),
    /// 24: the 0 to 31 registers of the queue.
    FifoQueue(Words<'a>),
    /// 43, MEI type 14: objects of the device's identification.
    DeviceIdentification(DeviceIdentification<'a>),
    /// The server refuses the request.
    Exception {
        /// The function code of the request, 1 to 127.
        function: u8,
        /// The reason of the refusal.
        exception: Exception,
    },
    /// The reply of a function without a variant.
    Other {
        /// The function code, 1 to 127.
        function: u8,
        /// The 0 to 252 bytes after the function code.
        data: &'a [u8],
    },
}

impl<'a> Reply<'a> {
    /// Decodes the reply in a PDU.
    ///
    /// # Errors
    /// If the bytes are not a reply that the specification allows.
    #[inline(always)] // small: the code that uses the registers is inlined after it
    pub fn decode(pdu: &'a [u8]) -> Result<Self, DecodeError> {
        let (&function, body) = pdu.split_first().ok_or(DecodeError::Empty)?;
        match function {
            function::READ_HOLDING_REGISTERS => words(function, body).map(Self::HoldingRegisters),
            _ => Self::decode_other(function, body),
        }
    }

    /// Decodes every other reply: apart, so that the reply of every cycle is small enough to be inlined where it is decoded.
    fn decode_other(function: u8, body: &'a [u8]) -> Result<Self, DecodeError> {
        Ok(match function {
            function::READ_COILS | function::READ_DISCRETE_INPUTS => {
                Self::of_bits(function, Bits::from_wire(counted(function, body)?, usize::MAX))
            }
            function::READ_INPUT_REGISTERS | function::READ_WRITE_REGISTERS => {
                Self::of_words(function, words(function, body)?)
            }
            function::WRITE_COIL
            | function::WRITE_REGISTER
            | function::DIAGNOSTICS
            | function::WRITE_FILE_RECORD
            | function::MASK_WRITE_REGISTER => {
                let request = Request::decode_other(function, body)?;
                return Self::repeating(&request).ok_or(DecodeError::Function { found: function });
            }
            function::READ_EXCEPTION_STATUS => {
                let [status] = *exactly(function, body)?;
                Self::ExceptionStatus(status)
            }
            function::GET_COMM_EVENT_COUNTER => {
                let (status, events) = pair(function, body)?;
                Self::CommEventCounter { status, events }
            }
            function::GET_COMM_EVENT_LOG => match counted(function, body)? {
                &[a, b, c, d, e, f, ref log @ ..] => {
                    let [status, events, messages] = [[a, b], [c, d], [e, f]].map(u16::from_be_bytes);
                    Self::CommEventLog { status, events, messages, log }
                }
                short => {
                    let found = u8::try_from(short.len()).unwrap_or_default();
                    return Err(DecodeError::ReplyByteCount { function, found });
                }
            },
            function::READ_FILE_RECORD => Self::FileRecords(Records::decode(body)?),
            function::READ_FIFO_QUEUE => Self::FifoQueue(queue(body)?),
            function::WRITE_COILS => {
                let (address, quantity) = run(function, body, Row::of(function).writes)?;
                Self::WriteCoils { address, quantity }
            }
            function::WRITE_REGISTERS => {
                let (address, quantity) = run(function, body, Row::of(function).writes)?;
                Self::WriteRegisters { address, quantity }
            }
            function::REPORT_SERVER_ID => Self::ServerId(counted(function, body)?),
            function::READ_DEVICE_IDENTIFICATION if body.first() == Some(&MEI) => {
                Self::DeviceIdentification(DeviceIdentification::decode(body)?)
            }
            0 | function::EXCEPTION => return Err(DecodeError::Function { found: function }),
            function::EXCEPTION.. => {
                let [code] = *exactly(function, body)?;
                Self::Exception { function: function & !function::EXCEPTION, exception: code.into() }
            }
            function => Self::Other { function, data: body },
        })
    }

    /// Returns the reply to a read of function 3, 4 or 23.
    pub(crate) const fn of_words(function: u8, words: Words<'a>) -> Self {
        match function {
            function::READ_HOLDING_REGISTERS => Self::HoldingRegisters(words),
            function::READ_INPUT_REGISTERS => Self::InputRegisters(words),
            _ => Self::ReadWriteRegisters(words),
        }
    }

    /// Returns the reply to a read of function 1 or 2.
    pub(crate) const fn of_bits(function: u8, bits: Bits<'a>) -> Self {
        match function {
            function::READ_COILS => Self::Coils(bits),
            _ => Self::DiscreteInputs(bits),
        }
    }

    /// Returns the reply that repeats a request, or its writes; `None` if the request reads, or has no type of its own.
    pub(crate) fn repeating(request: &Request<'a>) -> Option<Self> {
        let count = |written: usize| u16::try_from(written).unwrap_or(u16::MAX);
        Some(match *request {
            Request::WriteCoil { address, value } => Self::WriteCoil { address, value },
            Request::WriteRegister { address, value } => Self::WriteRegister { address, value },
            Request::WriteCoils { address, values } => {
                Self::WriteCoils { address, quantity: count(values.len()) }
            }
            Request::WriteRegisters { address, values } => {
                Self::WriteRegisters { address, quantity: count(values.len()) }
            }
            Request::MaskWriteRegister { address, and, or } => Self::MaskWriteRegister { address, and, or },
            Request::Diagnostics { subfunction, data } => Self::Diagnostics { subfunction, data },
            Request::WriteFileRecord(records) => Self::WriteFileRecord(records),
            _ => return None,
        })
    }

    /// Returns the request that the reply repeats as a whole, with the same encoding.
    pub(crate) const fn repeated(&self) -> Option<Request<'a>> {
        Some(match *self {
            Self::WriteCoil { address, value } => Request::WriteCoil { address, value },
            Self::WriteRegister { address, value } => Request::WriteRegister { address, value },
            Self::MaskWriteRegister { address, and, or } => Request::MaskWriteRegister { address, and, or },
            Self::Diagnostics { subfunction, data } => Request::Diagnostics { subfunction, data },
            Self::WriteFileRecord(records) => Request::WriteFileRecord(records),
            _ => return None,
        })
    }

    /// Returns the function code of the request that the reply answers.
    pub const fn function(&self) -> u8 {
        match self {
            Self::Coils(_) => function::READ_COILS,
            Self::DiscreteInputs(_) => function::READ_DISCRETE_INPUTS,
            Self::HoldingRegisters(_) => function::READ_HOLDING_REGISTERS,
            Self::InputRegisters(_) => function::READ_INPUT_REGISTERS,
            Self::WriteCoil { .. } => function::WRITE_COIL,
            Self::WriteRegister { .. } => function::WRITE_REGISTER,
            Self::ExceptionStatus(_) => function::READ_EXCEPTION_STATUS,
            Self::Diagnostics { .. } => function::DIAGNOSTICS,
            Self::CommEventCounter { .. } => function::GET_COMM_EVENT_COUNTER,
            Self::CommEventLog { .. } => function::GET_COMM_EVENT_LOG,
            Self::WriteCoils { .. } => function::WRITE_COILS,
            Self::WriteRegisters { .. } => function::WRITE_REGISTERS,
            Self::ServerId(_) => function::REPORT_SERVER_ID,
            Self::FileRecords(_) => function::READ_FILE_RECORD,
            Self::WriteFileRecord(_) => function::WRITE_FILE_RECORD,
            Self::MaskWriteRegister { .. } => function::MASK_WRITE_REGISTER,
            Self::ReadWriteRegisters(_) => function::READ_WRITE_REGISTERS,
            Self::FifoQueue(_) => function::READ_FIFO_QUEUE,
            Self::DeviceIdentification(_) => function::READ_DEVICE_IDENTIFICATION,
            Self::Exception { function, .. } | Self::Other { function, .. } => *function,
        }
    }

    /// Checks that this can be the answer to `request`: its function, the requested number of values, the same echo.
    ///
    /// # Errors
    /// The first difference.
    #[inline]
    pub fn answers(&self, request: &Request<'_>) -> Result<(), Mismatch> {
        let function = self.function();
        if request.function() != function {
            return Err(Mismatch::Function { expected: request.function(), found: function });
        }
        let (expected, found) = match (*request, *self) {
            (
                Request::ReadCoils { quantity, .. } | Request::ReadDiscreteInputs { quantity, .. },
                Self::Coils(bits) | Self::DiscreteInputs(bits),
            ) => (usize::from(quantity).div_ceil(8), bits.byte_len()),
            (
                Request::ReadHoldingRegisters { quantity, .. }
                | Request::ReadInputRegisters { quantity, .. }
                | Request::ReadWriteRegisters { quantity, .. },
                Self::HoldingRegisters(words) | Self::InputRegisters(words) | Self::ReadWriteRegisters(words),
            ) => (2 * usize::from(quantity), 2 * words.len()),
            _ => return self.repeats(request),
        };
        if expected == found { Ok(()) } else { Err(Mismatch::Quantity { expected, found }) }
    }

    /// Checks the repeated parts of the request, unless it is a read.
    #[inline(never)]
    fn repeats(&self, request: &Request<'_>) -> Result<(), Mismatch> {
        let is_same = match (*self, *request) {
            // Another MEI type.
            (Self::Other { .. }, Request::ReadDeviceIdentification { .. }) => false,
            // The device's own bytes, and a function that only the caller supports.
            (
                Self::Exception { .. }
                | Self::Other { .. }
                | Self::ServerId(_)
                | Self::ExceptionStatus(_)
                | Self::CommEventCounter { .. }
                | Self::CommEventLog { .. }
                | Self::FifoQueue(_),
                _,
            ) => true,
            (Self::FileRecords(groups), Request::ReadFileRecord(asked)) => groups
                .iter()
                .map(|words| words.len())
                .eq(asked.iter().map(|range| usize::from(range.quantity))),
            (
                Self::Diagnostics { subfunction, data },
                Request::Diagnostics { subfunction: asked, data: sent },
            ) => subfunction == asked && (subfunction != 0 || data == sent),
            (Self::DeviceIdentification(it), Request::ReadDeviceIdentification { category, .. }) => {
                it.category == category
            }
            _ => Reply::repeating(request).is_some_and(|reply| reply == *self),
        };
        if is_same { Ok(()) } else { Err(Mismatch::Echo) }
    }
}

impl Reply<'_> {
    /// Returns the same reply with this many bits, if it has bits: the last byte of a reply does not show how many of its
    /// bits were requested.
    pub(crate) fn with_bits(self, bits: u16) -> Self {
        match self {
            Self::Coils(values) => Self::Coils(values.truncated(bits.into())),
            Self::DiscreteInputs(values) => Self::DiscreteInputs(values.truncated(bits.into())),
            reply => reply,
        }
    }
}

impl sealed::Sealed for Reply<'_> {}

impl Pdu for Reply<'_> {
    #[inline]
    fn encoded_len(&self) -> usize {
        match self {
            Self::Coils(bits) | Self::DiscreteInputs(bits) => 2 + bits.byte_len(),
            Self::HoldingRegisters(words) | Self::InputRegisters(words) | Self::ReadWriteRegisters(words) => {
                2 + 2 * words.len()
            }
            Self::ServerId(data) => 2 + data.len(),
            Self::CommEventLog { log, .. } => 8 + log.len(),
            Self::FileRecords(groups) => groups.encoded_len(),
            Self::FifoQueue(words) => 5 + 2 * words.len(),
            Self::DeviceIdentification(identification) => identification.encoded_len(),
            Self::Exception { .. } | Self::ExceptionStatus(_) => 2,
            Self::Other { data, .. } => 1 + data.len(),
            _ => self.repeated().map_or(5, |request| request.encoded_len()),
        }
    }

    #[inline]
    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let function = self.function();
        match *self {
            Self::Coils(bits) | Self::DiscreteInputs(bits) => put_bits(out, function, bits),
            Self::HoldingRegisters(words) | Self::InputRegisters(words) | Self::ReadWriteRegisters(words) => {
                put_words(out, function, words)
            }
            Self::WriteCoils { address, quantity } | Self::WriteRegisters { address, quantity } => {
                check_run(function, address, quantity.into(), Row::of(function).writes)?;
                put_pair(out, function, address, quantity)
            }
            Self::ExceptionStatus(status) => {
                *room_for(out)? = [function, status];
                Ok(2)
            }
            Self::CommEventCounter { status, events } => put_pair(out, function, status, events),
            Self::CommEventLog { status, events, messages, log } => {
                let count = 6 + log.len();
                check_run(function, 0, count, Row::of(function).reads)?;
                let (head, to) = put_head(out, function, count)?.split_at_mut(6);
                Words::from(&[status, events, messages]).write(head);
                to.copy_from_slice(log);
                Ok(2 + count)
            }
            Self::FileRecords(groups) => groups.encode(out),
            Self::FifoQueue(words) => {
                let (found, max) = (words.len(), Row::of(function).reads);
                let Ok(count @ 0..=limit::FIFO) = u16::try_from(found) else {
                    return Err(EncodeError::Quantity { function, found, max });
                };
                let (first, rest) = room(out, 5 + 2 * found)?.split_at_mut(1);
                first.copy_from_slice(&[function]);
                let (head, data) = rest.split_at_mut(4);
                Words::from(&[2 + 2 * count, count]).write(head);
                words.write(data);
                Ok(5 + 2 * found)
            }
            Self::ServerId(data) => {
                check_run(function, 0, data.len(), Row::of(function).reads)?;
                put_head(out, function, data.len())?.copy_from_slice(data);
                Ok(2 + data.len())
            }
            Self::DeviceIdentification(identification) => identification.encode(out),
            Self::Exception { function, exception } => {
                if function == 0 || function >= function::EXCEPTION {
                    return Err(EncodeError::Function { found: function });
                }
                *room_for(out)? = [function | function::EXCEPTION, exception.into()];
                Ok(2)
            }
            Self::Other { function, data } => put_other(out, function, data),
            repeats => repeats.repeated().map_or(Ok(0), |request| request.encode(out)),
        }
    }
}

/// Returns exactly the data that a byte count announces.
#[inline]
fn counted(function: u8, body: &[u8]) -> Result<&[u8], DecodeError> {
    let Some((&count, data)) = body.split_first() else {
        return Err(DecodeError::PduLength { function, expected: 2, found: 1 });
    };
    let row = Row::of(function);
    if !(1..=row.bytes(row.reads)).contains(&count.into()) {
        return Err(DecodeError::ReplyByteCount { function, found: count });
    }
    if data.len() != usize::from(count) {
        return Err(DecodeError::PduLength {
            function,
            expected: 2 + usize::from(count),
            found: 2 + data.len(),
        });
    }
    Ok(data)
}

#[inline]
fn words(function: u8, body: &[u8]) -> Result<Words<'_>, DecodeError> {
    if let Some(&found) = body.first()
        && found % 2 == 1
    {
        return Err(DecodeError::ReplyByteCount { function, found });
    }
    counted(function, body).map(Words::from_wire)
}

/// Decodes the registers of a queue, after a byte count and their number.
fn queue(body: &[u8]) -> Result<Words<'_>, DecodeError> {
    let (function, max) = (function::READ_FIFO_QUEUE, limit::FIFO);
    let length = |expected| DecodeError::PduLength { function, expected, found: 1 + body.len() };
    let (&[a, b, c, d], data) = body.split_first_chunk().ok_or(length(5))?;
    let [count, quantity] = [[a, b], [c, d]].map(u16::from_be_bytes);
    if quantity > max {
        return Err(DecodeError::Quantity { function, found: quantity, max });
    }
    let expected = 2 + 2 * quantity;
    if count != expected {
        return Err(DecodeError::ByteCount { function, expected, found: count });
    }
    match data.len() == usize::from(2 * quantity) {
        true => Ok(Words::from_wire(data)),
        false => Err(length(3 + usize::from(count))),
    }
}

fn put_bits(out: &mut [u8], function: u8, bits: Bits<'_>) -> Result<usize, EncodeError> {
    check_run(function, 0, bits.len(), Row::of(function).reads)?;
    bits.write(put_head(out, function, bits.byte_len())?);
    Ok(2 + bits.byte_len())
}

fn put_words(out: &mut [u8], function: u8, words: Words<'_>) -> Result<usize, EncodeError> {
    check_run(function, 0, words.len(), Row::of(function).reads)?;
    words.write(put_head(out, function, 2 * words.len())?);
    Ok(2 + 2 * words.len())
}

fn put_head(out: &mut [u8], function: u8, count: usize) -> Result<&mut [u8], EncodeError> {
    let (head, data) = room(out, 2 + count)?.split_at_mut(2);
    head.copy_from_slice(&[function, u8::try_from(count).unwrap_or(u8::MAX)]); // at most 250: checked
    Ok(data)
}
