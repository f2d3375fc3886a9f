//! Requests and replies that the specification allows. Their data is borrowed from the bytes that they are made of.

use arbitrary::{Arbitrary, Error, Result, Unstructured};

use crate::message::{Bits, Exception, Reply, Request, Words, function, limit};

impl<'a> Arbitrary<'a> for Request<'a> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(match u.int_in_range(0..=10u8)? {
            0 => {
                let (address, quantity) = run(u, limit::READ_BITS)?;
                Self::ReadCoils { address, quantity }
            }
            1 => {
                let (address, quantity) = run(u, limit::READ_BITS)?;
                Self::ReadDiscreteInputs { address, quantity }
            }
            2 => {
                let (address, quantity) = run(u, limit::READ_REGISTERS)?;
                Self::ReadHoldingRegisters { address, quantity }
            }
            3 => {
                let (address, quantity) = run(u, limit::READ_REGISTERS)?;
                Self::ReadInputRegisters { address, quantity }
            }
            4 => Self::WriteCoil { address: u.arbitrary()?, value: u.arbitrary()? },
            5 => Self::WriteRegister { address: u.arbitrary()?, value: u.arbitrary()? },
            6 => {
                let (address, quantity) = run(u, limit::WRITE_BITS)?;
                let data = data(u, usize::from(quantity).div_ceil(8))?;
                Self::WriteCoils { address, values: Bits::from_wire(data, quantity.into()) }
            }
            7 => {
                let (address, quantity) = run(u, limit::WRITE_REGISTERS)?;
                Self::WriteRegisters { address, values: words(u, quantity)? }
            }
            8 => Self::MaskWriteRegister { address: u.arbitrary()?, and: u.arbitrary()?, or: u.arbitrary()? },
            9 => {
                let (address, quantity) = run(u, limit::READ_REGISTERS)?;
                let (write_address, written) = run(u, limit::READ_WRITE_REGISTERS)?;
                Self::ReadWriteRegisters { address, quantity, write_address, values: words(u, written)? }
            }
            _ => {
                let (function, data) = other(u)?;
                Self::Other { function, data }
            }
        })
    }
}

/// Bits fill their last byte: a reply does not show how many of them were asked for.
impl<'a> Arbitrary<'a> for Reply<'a> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(match u.int_in_range(0..=11u8)? {
            0 => Self::Coils(bits(u)?),
            1 => Self::DiscreteInputs(bits(u)?),
            2 => Self::HoldingRegisters(registers(u)?),
            3 => Self::InputRegisters(registers(u)?),
            4 => Self::WriteCoil { address: u.arbitrary()?, value: u.arbitrary()? },
            5 => Self::WriteRegister { address: u.arbitrary()?, value: u.arbitrary()? },
            6 => {
                let (address, quantity) = run(u, limit::WRITE_BITS)?;
                Self::WriteCoils { address, quantity }
            }
            7 => {
                let (address, quantity) = run(u, limit::WRITE_REGISTERS)?;
                Self::WriteRegisters { address, quantity }
            }
            8 => Self::MaskWriteRegister { address: u.arbitrary()?, and: u.arbitrary()?, or: u.arbitrary()? },
            9 => Self::ReadWriteRegisters(registers(u)?),
            10 => Self::Exception { function: u.int_in_range(1..=127)?, exception: u.arbitrary()? },
            _ => {
                let (function, data) = other(u)?;
                Self::Other { function, data }
            }
        })
    }
}

/// One of the codes that the specification names, or any.
impl<'a> Arbitrary<'a> for Exception {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let code: u8 = if u.arbitrary()? { u.int_in_range(1..=11)? } else { u.arbitrary()? };
        Ok(code.into())
    }
}

/// An address, and a quantity that a function allows from there.
fn run(u: &mut Unstructured<'_>, most: u16) -> Result<(u16, u16)> {
    let address: u16 = u.arbitrary()?;
    let quantity = u.int_in_range(1..=most.min((u16::MAX - address).saturating_add(1)))?;
    Ok((address, quantity))
}

/// This many registers, or as many as there are bytes for.
fn words<'a>(u: &mut Unstructured<'a>, quantity: u16) -> Result<Words<'a>> {
    data(u, (2 * usize::from(quantity)).min(u.len() & !1)).map(Words::from_wire)
}

fn registers<'a>(u: &mut Unstructured<'a>) -> Result<Words<'a>> {
    let quantity = u.int_in_range(1..=limit::READ_REGISTERS)?;
    words(u, quantity)
}

fn bits<'a>(u: &mut Unstructured<'a>) -> Result<Bits<'a>> {
    let quantity = u.int_in_range(1..=limit::READ_BITS)?;
    data(u, usize::from(quantity).div_ceil(8)).map(|data| Bits::from_wire(data, usize::MAX))
}

/// A function without a type of its own, and its bytes.
fn other<'a>(u: &mut Unstructured<'a>) -> Result<(u8, &'a [u8])> {
    let function = u.int_in_range(7..=127)?;
    // The typed ones come in pairs.
    let function = if function::is_typed(function) { function + 2 } else { function };
    let length = u.int_in_range(0..=limit::PDU - 1)?;
    Ok((function, u.bytes(length.min(u.len()))?))
}

/// This many bytes, or as many as there are, if there is one.
fn data<'a>(u: &mut Unstructured<'a>, length: usize) -> Result<&'a [u8]> {
    match length.min(u.len()) {
        0 => Err(Error::NotEnoughData),
        length => u.bytes(length),
    }
}
