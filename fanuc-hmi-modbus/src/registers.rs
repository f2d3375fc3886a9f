//! What a server holds, and how a request is carried out on it: a PDU in, a PDU out.

use crate::error::DecodeError;
use crate::message::{Bits, BitsMut, Exception, Pdu, Reply, Request, Words, WordsMut, function, limit};

/// The coils, inputs and registers of a server. Every method has a default that refuses, so that an implementation names only
/// the tables that it has.
///
/// An address is that of the first item, and all items are within 0 to 65535. A method that gives an exception changes nothing.
/// Function 23 reads twice, so that a read that cannot be answered leaves no write; the reply has what is there after
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
    /// Function 1.
    ///
    /// # Errors
    /// The exception to answer with.
    fn read_coils(&mut self, _address: u16, _out: &mut BitsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Function 2.
    ///
    /// # Errors
    /// The exception to answer with.
    fn read_discrete_inputs(&mut self, _address: u16, _out: &mut BitsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Function 3, and the reading half of 23.
    ///
    /// # Errors
    /// The exception to answer with.
    fn read_holding_registers(&mut self, _address: u16, _out: &mut WordsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Function 4.
    ///
    /// # Errors
    /// The exception to answer with.
    fn read_input_registers(&mut self, _address: u16, _out: &mut WordsMut<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Functions 5 (one value) and 15.
    ///
    /// # Errors
    /// The exception to answer with.
    fn write_coils(&mut self, _address: u16, _values: Bits<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// Functions 6 (one value) and 16, and the writing half of 22 and 23.
    ///
    /// # Errors
    /// The exception to answer with.
    fn write_registers(&mut self, _address: u16, _values: Words<'_>) -> Result<(), Exception> {
        Err(Exception::IllegalFunction)
    }

    /// A function without a type of its own: writes the bytes after the function code, at most 252, and returns how many.
    ///
    /// # Errors
    /// The exception to answer with.
    fn other(&mut self, _function: u8, _data: &[u8], _out: &mut [u8]) -> Result<usize, Exception> {
        Err(Exception::IllegalFunction)
    }
}

/// Carries a request out and writes its reply; gives the length of the reply.
///
/// A PDU that is no request is answered too: exception 1 for its function code, exception 3 for the rest of it, exception 2 when
/// it reaches beyond address 65535.
#[inline(always)] // what is not built in is `serve_any`
pub fn serve<R: Registers + ?Sized>(pdu: &[u8], registers: &mut R, out: &mut [u8; limit::PDU]) -> usize {
    // The read that a client repeats in every cycle: little enough to be built in where the registers are known.
    if let [function @ function::READ_HOLDING_REGISTERS, a, b, c, d] = *pdu
        && let quantity = u16::from_be_bytes([c, d])
        && quantity.wrapping_sub(1) < limit::READ_REGISTERS
    {
        let address = u16::from_be_bytes([a, b]);
        let read = |out: &mut WordsMut<'_>| registers.read_holding_registers(address, out);
        let served = read_words(function, address, quantity, out, read);
        return served.unwrap_or_else(|exception| refuse(function, exception, out));
    }
    serve_any(pdu, registers, out)
}

#[inline(never)]
fn serve_any<R: Registers + ?Sized>(pdu: &[u8], registers: &mut R, out: &mut [u8; limit::PDU]) -> usize {
    match Request::decode(pdu).map_err(exception).and_then(|request| carry_out(request, registers, out)) {
        Ok(len) => len,
        Err(exception) => refuse(pdu.first().copied().unwrap_or_default(), exception, out),
    }
}

#[cold]
fn refuse(function: u8, exception: Exception, out: &mut [u8; limit::PDU]) -> usize {
    if let Some(reply) = out.first_chunk_mut() {
        *reply = [function | function::EXCEPTION, exception.into()];
    }
    2
}

fn exception(error: DecodeError) -> Exception {
    match error {
        DecodeError::Function { .. } | DecodeError::Empty => Exception::IllegalFunction,
        _ => Exception::IllegalDataValue,
    }
}

fn carry_out<R: Registers + ?Sized>(
    request: Request<'_>,
    registers: &mut R,
    out: &mut [u8; limit::PDU],
) -> Result<usize, Exception> {
    let reply = match request {
        Request::ReadHoldingRegisters { address, quantity } => {
            return read_words(request.function(), address, quantity, out, |out| {
                registers.read_holding_registers(address, out)
            });
        }
        Request::ReadInputRegisters { address, quantity } => {
            return read_words(request.function(), address, quantity, out, |out| {
                registers.read_input_registers(address, out)
            });
        }
        Request::ReadCoils { address, quantity } => {
            return read_bits(request.function(), address, quantity, out, |out| {
                registers.read_coils(address, out)
            });
        }
        Request::ReadDiscreteInputs { address, quantity } => {
            return read_bits(request.function(), address, quantity, out, |out| {
                registers.read_discrete_inputs(address, out)
            });
        }
        Request::WriteCoil { address, value } => {
            registers.write_coils(address, Bits::from(&[value]))?;
            Reply::WriteCoil { address, value }
        }
        Request::WriteRegister { address, value } => {
            registers.write_registers(address, Words::from(&[value]))?;
            Reply::WriteRegister { address, value }
        }
        Request::WriteCoils { address, values } => {
            let quantity = in_table(address, values.len())?;
            registers.write_coils(address, values)?;
            Reply::WriteCoils { address, quantity }
        }
        Request::WriteRegisters { address, values } => {
            let quantity = in_table(address, values.len())?;
            registers.write_registers(address, values)?;
            Reply::WriteRegisters { address, quantity }
        }
        Request::MaskWriteRegister { address, and, or } => {
            let mut word = [0; 2];
            registers.read_holding_registers(address, &mut WordsMut::from_wire(&mut word))?;
            let masked = u16::from_be_bytes(word) & and | or & !and;
            registers.write_registers(address, Words::from(&[masked]))?;
            Reply::MaskWriteRegister { address, and, or }
        }
        Request::ReadWriteRegisters { address, quantity, write_address, values } => {
            in_table(write_address, values.len())?;
            let mut read = |out: &mut WordsMut<'_>| registers.read_holding_registers(address, out);
            read_words(request.function(), address, quantity, out, &mut read)?;
            registers.write_registers(write_address, values)?;
            return read_words(request.function(), address, quantity, out, |out| {
                registers.read_holding_registers(address, out)
            });
        }
        Request::Other { function, data } => {
            let Some((first, rest)) = out.split_first_mut() else {
                return Err(Exception::ServerDeviceFailure);
            };
            let len = registers.other(function, data, rest)?;
            *first = function;
            return if len < limit::PDU { Ok(1 + len) } else { Err(Exception::ServerDeviceFailure) };
        }
    };
    reply.encode(out).map_err(|_| Exception::ServerDeviceFailure)
}

/// The quantity, if all of it is within 0 to 65535.
#[inline]
fn in_table(address: u16, quantity: usize) -> Result<u16, Exception> {
    match u16::try_from(quantity) {
        Ok(quantity) if usize::from(address) + usize::from(quantity) <= 1 << 16 => Ok(quantity),
        _ => Err(Exception::IllegalDataAddress),
    }
}

#[inline(always)] // with `serve`
fn read_words(
    function: u8,
    address: u16,
    quantity: u16,
    out: &mut [u8; limit::PDU],
    read: impl FnOnce(&mut WordsMut<'_>) -> Result<(), Exception>,
) -> Result<usize, Exception> {
    in_table(address, quantity.into())?;
    read(&mut WordsMut::from_wire(reply_data(function, 2 * quantity, out)?))?;
    Ok(2 + 2 * usize::from(quantity))
}

#[inline]
fn read_bits(
    function: u8,
    address: u16,
    quantity: u16,
    out: &mut [u8; limit::PDU],
    read: impl FnOnce(&mut BitsMut<'_>) -> Result<(), Exception>,
) -> Result<usize, Exception> {
    in_table(address, quantity.into())?;
    let count = quantity.div_ceil(8);
    let data = reply_data(function, count, out)?;
    read(&mut BitsMut::from_wire(data, quantity.into()))?;
    Ok(2 + usize::from(count))
}

/// Writes a function code and a byte count, and gives the bytes that follow them.
#[inline]
fn reply_data(function: u8, count: u16, out: &mut [u8; limit::PDU]) -> Result<&mut [u8], Exception> {
    let (head, data) = out.split_first_chunk_mut().ok_or(Exception::ServerDeviceFailure)?;
    *head = [function, u8::try_from(count).map_err(|_| Exception::ServerDeviceFailure)?];
    data.get_mut(..count.into()).ok_or(Exception::ServerDeviceFailure)
}
