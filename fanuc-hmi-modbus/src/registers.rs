//! The tables of a server, and the execution of a request on them: a PDU in, a PDU out.

use crate::error::DecodeError;
use crate::message::function::{self, Row};
use crate::message::{
    Bits, BitsMut, Exception, FileRange, HEAD, Pdu as _, Reply, Request, Words, WordsMut, limit, run,
};

/// The coils, inputs and registers of a server. Every method has a default that refuses, so that an implementation names only
/// its own tables.
///
/// An address is that of the first item, and all items are within 0 to 65535. A method that returns an exception, with which
/// the request is answered, makes no change. The specification has functions 7, 8, 11 and 12 for serial lines alone; over TCP
/// they are answered too.
///
/// Function 23 reads before and after the write, so nothing is written if the read fails; the reply has the values after
/// the write.
///
/// ```
/// use fanuc_hmi_modbus::{Exception, Registers, WordsMut};
///
/// struct Numbers([u16; 100]);
///
/// impl Registers for Numbers {
///     fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
///         let first = usize::from(address);
///         out.copy_from(self.0.get(first..first + out.len()).ok_or(Exception::IllegalDataAddress)?);
///         Ok(())
///     }
/// }
/// ```
pub trait Registers {
    /// Reads coils (function 1).
    fn read_coils(&mut self, _address: u16, _out: &mut BitsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Reads discrete inputs (function 2).
    fn read_discrete_inputs(&mut self, _address: u16, _out: &mut BitsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Reads holding registers (function 3, and the reading half of 23).
    fn read_holding_registers(&mut self, _address: u16, _out: &mut WordsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Reads input registers (function 4).
    fn read_input_registers(&mut self, _address: u16, _out: &mut WordsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Functions 5 (one value) and 15.
    fn write_coils(&mut self, _address: u16, _values: Bits<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Functions 6 (one value) and 16, and the writing half of 22 and 23.
    fn write_registers(&mut self, _address: u16, _values: Words<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Returns the exception status (function 7, of a serial line): eight outputs that the device chooses.
    fn exception_status(&mut self) -> Result<u8, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Functions 11 and 12, of a serial line: the counters of the device. The log is for function 12: at most 64 events, the
    /// last one first.
    fn comm_events(&mut self, _log: &mut [u8]) -> Result<CommEvents, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Performs a diagnostic of the serial line (function 8). `out` has the words of the request, which are the reply unless
    /// they are changed.
    fn diagnose(&mut self, _subfunction: u16, _out: &mut WordsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Writes the 1 to 250 bytes of the device's description of itself (function 17): an id, FF if the device runs, further
    /// bytes. Returns their number.
    fn server_id(&mut self, _out: &mut [u8]) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Reads a run of records (function 20). The specification has the files 1 to 65535 and the records 0 to 9999: others
    /// are refused here, with [`IllegalDataAddress`](Exception::IllegalDataAddress).
    fn read_file(&mut self, _file: u16, _record: u16, _out: &mut WordsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Writes a run of records (function 21). If one of several runs is refused, those before it are written.
    fn write_file(&mut self, _file: u16, _record: u16, _values: Words<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Reads the queue whose count has this address (function 24): its registers, the oldest first; they stay in the queue.
    /// Returns their number: more than 31, which do not fit `out`, are answered with exception 3.
    fn read_fifo(&mut self, _address: u16, _out: &mut WordsMut<'_>) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Writes the value of an object of the device's identification (function 43, MEI type 14), at most 244 bytes, and
    /// returns its length. 0 is the name of its vendor, 1 the code of the product, 2 the revision, all in ASCII; 3 to 6 are
    /// the vendor's address in the web, the names of product, model and application; those from 128 on are the device's own.
    /// `None` if there is no such object; without object 0 the answer is exception 1.
    fn device_object(&mut self, _id: u8, _out: &mut [u8]) -> Option<usize> {
        None
    }

    /// Executes a function without a type of its own: writes the bytes after the function code, at most 252, and returns
    /// their number.
    fn other(&mut self, _function: u8, _data: &[u8], _out: &mut [u8]) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }
}

/// The counters of a device on a serial line: functions 11 and 12.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CommEvents {
    /// FFFF if the device is still busy with an earlier request, otherwise 0.
    pub status: u16,
    /// The number of requests that the device has executed, without those of function 11 and those that were refused.
    pub events: u16,
    /// The number of messages that the device has received.
    pub messages: u16,
    /// The number of events that were written to the log.
    pub logged: usize,
}

/// Executes a request and writes its reply; returns the length of the reply.
///
/// A PDU that is not a request is answered too: exception 1 for its function code, exception 3 for the rest of it, exception
/// 2 when it reaches beyond address 65535.
#[inline(always)] // the read that a client repeats in every cycle is little enough to be built in where the registers are known
pub fn serve<R: Registers + ?Sized>(pdu: &[u8], registers: &mut R, out: &mut [u8; limit::PDU]) -> usize {
    let served = match pdu {
        [function @ function::READ_HOLDING_REGISTERS, body @ ..] => {
            match run(*function, body, Row::of(*function).reads) {
                Ok((address, quantity)) => read_holding_registers(address, quantity, registers, out),
                Err(_) => Err(Exception::IllegalDataValue),
            }
        }
        _ => serve_other(pdu, registers, out),
    };
    served.unwrap_or_else(|exception| refuse(pdu, exception, out))
}

#[inline(always)] // with `serve`
fn read_holding_registers<R: Registers + ?Sized>(
    address: u16,
    quantity: u16,
    registers: &mut R,
    out: &mut [u8; limit::PDU],
) -> Result<usize, Exception> {
    let (mut words, len) = words(function::READ_HOLDING_REGISTERS, address, quantity, out)?;
    registers.read_holding_registers(address, &mut words)?;
    Ok(len)
}

#[cold]
fn refuse(pdu: &[u8], exception: Exception, out: &mut [u8; limit::PDU]) -> usize {
    let function = pdu.first().copied().unwrap_or_default();
    if let Some(reply) = out.first_chunk_mut() {
        *reply = [function | function::EXCEPTION, exception.into()];
    }
    2
}

/// Executes any request and writes its reply; returns the length of the reply, or the exception to answer with.
#[inline(never)]
pub(crate) fn serve_other<R: Registers + ?Sized>(
    pdu: &[u8],
    registers: &mut R,
    out: &mut [u8; limit::PDU],
) -> Result<usize, Exception> {
    let request = Request::decode(pdu).map_err(|error| match error {
        DecodeError::Function { .. } | DecodeError::Empty => Exception::IllegalFunction,
        DecodeError::ReferenceType { .. } => Exception::IllegalDataAddress,
        _ => Exception::IllegalDataValue,
    })?;
    let function = request.function();
    match request {
        Request::ReadHoldingRegisters { address, quantity } => {
            read_holding_registers(address, quantity, registers, out)
        }
        Request::ReadInputRegisters { address, quantity } => {
            let (mut words, len) = words(function, address, quantity, out)?;
            registers.read_input_registers(address, &mut words)?;
            Ok(len)
        }
        Request::ReadCoils { address, quantity } => {
            let (mut bits, len) = bits(function, address, quantity, out)?;
            registers.read_coils(address, &mut bits)?;
            Ok(len)
        }
        Request::ReadDiscreteInputs { address, quantity } => {
            let (mut bits, len) = bits(function, address, quantity, out)?;
            registers.read_discrete_inputs(address, &mut bits)?;
            Ok(len)
        }
        Request::WriteCoil { address, value } => {
            registers.write_coils(address, Bits::from(&[value]))?;
            repeat::<5>(pdu, out)
        }
        Request::WriteRegister { address, value } => {
            registers.write_registers(address, Words::from(&[value]))?;
            repeat::<5>(pdu, out)
        }
        Request::Diagnostics { subfunction, .. } => {
            let out = out.get_mut(..pdu.len()).ok_or(Exception::ServerDeviceFailure)?;
            out.copy_from_slice(pdu);
            let words = out.get_mut(3..).unwrap_or_default();
            registers.diagnose(subfunction, &mut WordsMut::from_wire(words))?;
            Ok(pdu.len())
        }
        Request::WriteCoils { address, values } => {
            in_table(address, values.len())?;
            registers.write_coils(address, values)?;
            repeat::<5>(pdu, out)
        }
        Request::WriteRegisters { address, values } => {
            in_table(address, values.len())?;
            registers.write_registers(address, values)?;
            repeat::<5>(pdu, out)
        }
        Request::ReportServerId => {
            let mut id = [0; limit::SERVER_ID as usize];
            let length = registers.server_id(&mut id)?;
            put(&Reply::ServerId(id.get(..length).unwrap_or_default()), out)
        }
        Request::ReadExceptionStatus => put(&Reply::ExceptionStatus(registers.exception_status()?), out),
        Request::GetCommEventCounter => {
            let CommEvents { status, events, .. } = registers.comm_events(&mut [])?;
            put(&Reply::CommEventCounter { status, events }, out)
        }
        Request::GetCommEventLog => {
            let mut log = [0; limit::EVENT_LOG as usize];
            let CommEvents { status, events, messages, logged } = registers.comm_events(&mut log)?;
            let log = log.get(..logged).ok_or(Exception::ServerDeviceFailure)?;
            put(&Reply::CommEventLog { status, events, messages, log }, out)
        }
        Request::ReadFileRecord(ranges) => {
            let mut len = 2;
            for FileRange { file, record, quantity } in ranges.iter() {
                in_table(record, quantity.into())?;
                let end = len + 2 + 2 * usize::from(quantity);
                let group = out.get_mut(len..end).and_then(<[u8]>::split_first_chunk_mut);
                let (head, words) = group.ok_or(Exception::ServerDeviceFailure)?;
                *head = [u8::try_from(1 + words.len()).unwrap_or(u8::MAX), function::REFERENCE]; // at most 243
                registers.read_file(file, record, &mut WordsMut::from_wire(words))?;
                len = end;
            }
            if let Some(head) = out.first_chunk_mut() {
                *head = [function, u8::try_from(len - 2).unwrap_or(u8::MAX)]; // at most 245
            }
            Ok(len)
        }
        Request::WriteFileRecord(records) => {
            records.iter().try_for_each(|it| in_table(it.record, it.values.len()))?;
            records.iter().try_for_each(|it| registers.write_file(it.file, it.record, it.values))?;
            put(&Reply::WriteFileRecord(records), out)
        }
        Request::ReadFifoQueue { address } => {
            let mut bytes = [0; 2 * limit::FIFO as usize];
            let quantity = registers.read_fifo(address, &mut WordsMut::from_wire(&mut bytes))?;
            let words = bytes.get(..2 * quantity).ok_or(Exception::IllegalDataValue)?;
            put(&Reply::FifoQueue(Words::from_wire(words)), out)
        }
        Request::MaskWriteRegister { address, and, or } => {
            let mut word = [0; 2];
            registers.read_holding_registers(address, &mut WordsMut::from_wire(&mut word))?;
            let masked = u16::from_be_bytes(word) & and | or & !and;
            registers.write_registers(address, Words::from(&[masked]))?;
            repeat::<7>(pdu, out)
        }
        Request::ReadWriteRegisters { address, quantity, write_address, values } => {
            in_table(write_address, values.len())?;
            let (mut words, len) = words(function, address, quantity, out)?;
            registers.read_holding_registers(address, &mut words)?;
            registers.write_registers(write_address, values)?;
            registers.read_holding_registers(address, &mut words)?;
            Ok(len)
        }
        Request::ReadDeviceIdentification { category, object } => identify(category, object, registers, out),
        Request::Other { function, data } => {
            let (first, rest) = out.split_first_mut().ok_or(Exception::ServerDeviceFailure)?;
            let len = registers.other(function, data, rest)?;
            *first = function;
            if len < limit::PDU { Ok(1 + len) } else { Err(Exception::ServerDeviceFailure) }
        }
    }
}

fn put(reply: &Reply<'_>, out: &mut [u8; limit::PDU]) -> Result<usize, Exception> {
    reply.encode(out).map_err(|_| Exception::ServerDeviceFailure)
}

/// Writes objects of the device from one on, as many as fit.
fn identify<R: Registers + ?Sized>(
    category: u8,
    object: u8,
    registers: &mut R,
    out: &mut [u8; limit::PDU],
) -> Result<usize, Exception> {
    let mut value = [0; limit::DEVICE_OBJECT];
    let mut has = |from: u8, to: u8| (from..=to).any(|id| registers.device_object(id, &mut value).is_some());
    if !has(0, 0) {
        return Err(Exception::IllegalFunction);
    }
    let last = match category {
        1 => 2,
        2 => 0x7F,
        3 => 0xFF,
        4 if has(object, object) => object,
        4 => return Err(Exception::IllegalDataAddress),
        _ => return Err(Exception::IllegalDataValue),
    };
    let conformity = 0x80 + 1 + u8::from(has(3, 0xFF)) + u8::from(has(0x80, 0xFF));
    let first = if object <= last && has(object, object) { object } else { 0 };
    let (head, list) = out.split_first_chunk_mut::<HEAD>().ok_or(Exception::ServerDeviceFailure)?;
    let (mut at, mut count, mut rest) = (0, 0, [0, 0]);
    for id in first..=last {
        let Some(length) = registers.device_object(id, &mut value) else { continue };
        let value = value.get(..length).ok_or(Exception::ServerDeviceFailure)?;
        let Some([to_id, to_length, to @ ..]) = list.get_mut(at..at + 2 + length) else {
            rest = [0xFF, id];
            break;
        };
        (*to_id, *to_length) = (id, u8::try_from(length).unwrap_or(u8::MAX)); // at most 244
        to.copy_from_slice(value);
        (at, count) = (at + 2 + length, count + 1);
    }
    let [more, next] = rest;
    *head = [function::READ_DEVICE_IDENTIFICATION, function::MEI, category, conformity, more, next, count];
    Ok(HEAD + at)
}

/// Writes the reply that repeats the beginning of its request: the address of the write, and the value or the quantity.
#[inline]
fn repeat<const N: usize>(pdu: &[u8], out: &mut [u8; limit::PDU]) -> Result<usize, Exception> {
    let from = pdu.first_chunk::<N>().ok_or(Exception::ServerDeviceFailure)?;
    *out.first_chunk_mut().ok_or(Exception::ServerDeviceFailure)? = *from;
    Ok(N)
}

/// Checks that this many items from the address on are within 0 to 65535.
#[inline]
fn in_table(address: u16, quantity: usize) -> Result<(), Exception> {
    if usize::from(address) + quantity <= 1 << 16 { Ok(()) } else { Err(Exception::IllegalDataAddress) }
}

/// Writes the head of a reply; returns its registers and its length.
#[inline(always)] // with `serve`
fn words(
    function: u8,
    address: u16,
    quantity: u16,
    out: &mut [u8; limit::PDU],
) -> Result<(WordsMut<'_>, usize), Exception> {
    let data = reply_data(function, address, quantity, out)?;
    let len = 2 + data.len();
    Ok((WordsMut::from_wire(data), len))
}

/// Writes the head of a reply; returns its bits and its length.
#[inline]
fn bits(
    function: u8,
    address: u16,
    quantity: u16,
    out: &mut [u8; limit::PDU],
) -> Result<(BitsMut<'_>, usize), Exception> {
    let data = reply_data(function, address, quantity, out)?;
    let len = 2 + data.len();
    Ok((BitsMut::from_wire(data, quantity.into()), len))
}

/// Writes a function code and a byte count, and returns the bytes after them.
#[inline(always)] // with `words`
fn reply_data(
    function: u8,
    address: u16,
    quantity: u16,
    out: &mut [u8; limit::PDU],
) -> Result<&mut [u8], Exception> {
    in_table(address, quantity.into())?;
    let count = Row::of(function).bytes(quantity);
    let (head, data) = out.split_first_chunk_mut().ok_or(Exception::ServerDeviceFailure)?;
    *head = [function, u8::try_from(count).map_err(|_| Exception::ServerDeviceFailure)?];
    data.get_mut(..count.into()).ok_or(Exception::ServerDeviceFailure)
}
