//! Requests and replies that the specification allows. Their data is borrowed from the fuzzer's bytes.

use arbitrary::{Arbitrary, Error, Result, Unstructured};

use crate::message::function::{self, Row};
use crate::message::{
    Bits, DeviceIdentification, DeviceObjects, Exception, FileRange, FileRecord, Group, HEAD, Records, Reply,
    Request, Words, limit,
};

/// The functions with a type, and 0 for another one.
const FUNCTIONS: [u8; 20] = [1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 15, 16, 17, 20, 21, 22, 23, 24, 43, 0];

impl<'a> Arbitrary<'a> for Request<'a> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let function = *u.choose(&FUNCTIONS)?;
        let Row { reads, writes, .. } = Row::of(function);
        Ok(match function {
            function::READ_COILS..=function::READ_INPUT_REGISTERS => {
                let (address, quantity) = run(u, reads)?;
                Self::read(function, address, quantity)
            }
            function::WRITE_COIL => Self::WriteCoil { address: u.arbitrary()?, value: u.arbitrary()? },
            function::WRITE_REGISTER => {
                Self::WriteRegister { address: u.arbitrary()?, value: u.arbitrary()? }
            }
            function::DIAGNOSTICS => {
                let quantity = u.int_in_range(1..=writes)?;
                Self::Diagnostics { subfunction: u.arbitrary()?, data: words(u, quantity)? }
            }
            function::READ_EXCEPTION_STATUS
            | function::GET_COMM_EVENT_COUNTER
            | function::GET_COMM_EVENT_LOG
            | function::REPORT_SERVER_ID => Self::bare(function),
            function::READ_FILE_RECORD => Self::ReadFileRecord(records(u, RANGES)?),
            function::WRITE_FILE_RECORD => Self::WriteFileRecord(records(u, RECORDS)?),
            function::READ_FIFO_QUEUE => Self::ReadFifoQueue { address: u.arbitrary()? },
            function::READ_DEVICE_IDENTIFICATION => {
                Self::ReadDeviceIdentification { category: u.arbitrary()?, object: u.arbitrary()? }
            }
            function::WRITE_COILS => {
                let (address, quantity) = run(u, writes)?;
                let data = data(u, usize::from(quantity).div_ceil(8))?;
                Self::WriteCoils { address, values: Bits::from_wire(data, quantity.into()) }
            }
            function::WRITE_REGISTERS => {
                let (address, quantity) = run(u, writes)?;
                Self::WriteRegisters { address, values: words(u, quantity)? }
            }
            function::MASK_WRITE_REGISTER => {
                Self::MaskWriteRegister { address: u.arbitrary()?, and: u.arbitrary()?, or: u.arbitrary()? }
            }
            function::READ_WRITE_REGISTERS => {
                let (address, quantity) = run(u, reads)?;
                let (write_address, written) = run(u, writes)?;
                Self::ReadWriteRegisters { address, quantity, write_address, values: words(u, written)? }
            }
            _ => {
                let (function, data) = other(u)?;
                Self::Other { function, data }
            }
        })
    }
}

/// Makes a reply. Bits fill the last byte: a reply does not show how many of them were requested.
impl<'a> Arbitrary<'a> for Reply<'a> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        if u.int_in_range(0..=11u8)? == 0 {
            return Ok(Self::Exception { function: u.int_in_range(1..=127)?, exception: u.arbitrary()? });
        }
        let request: Request<'_> = u.arbitrary()?;
        let function = request.function();
        Ok(match request {
            Request::ReadCoils { quantity, .. } | Request::ReadDiscreteInputs { quantity, .. } => {
                let data = data(u, usize::from(quantity).div_ceil(8))?;
                Self::of_bits(function, Bits::from_wire(data, usize::MAX))
            }
            Request::ReadHoldingRegisters { quantity, .. } | Request::ReadInputRegisters { quantity, .. } => {
                Self::of_words(function, words(u, quantity)?)
            }
            Request::ReadWriteRegisters { values, .. } => Self::ReadWriteRegisters(values),
            Request::ReadExceptionStatus => Self::ExceptionStatus(u.arbitrary()?),
            Request::GetCommEventCounter => {
                Self::CommEventCounter { status: u.arbitrary()?, events: u.arbitrary()? }
            }
            Request::GetCommEventLog => {
                let (status, events, messages) = u.arbitrary()?;
                let length = u.int_in_range(0..=limit::EVENT_LOG.into())?;
                Self::CommEventLog { status, events, messages, log: u.bytes(length.min(u.len()))? }
            }
            Request::ReadFileRecord(_) => Self::FileRecords(records(u, GROUPS)?),
            Request::ReadFifoQueue { .. } => {
                let length = 2 * usize::from(u.int_in_range(0..=limit::FIFO)?);
                Self::FifoQueue(Words::from_wire(u.bytes(length.min(u.len()))?))
            }
            Request::ReportServerId => {
                let length = u.int_in_range(1..=limit::SERVER_ID.into())?;
                Self::ServerId(data(u, length)?)
            }
            Request::ReadDeviceIdentification { category, .. } => {
                Self::DeviceIdentification(DeviceIdentification {
                    category,
                    conformity: u.arbitrary()?,
                    more: u.arbitrary()?,
                    next: u.arbitrary()?,
                    objects: objects(u)?,
                })
            }
            Request::Other { data, .. } => Self::Other { function, data },
            written => Self::repeating(&written).ok_or(Error::IncorrectFormat)?,
        })
    }
}

/// Makes one of the codes that the specification names, or any.
impl<'a> Arbitrary<'a> for Exception {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        let code: u8 = if u.arbitrary()? { u.int_in_range(1..=11)? } else { u.arbitrary()? };
        Ok(code.into())
    }
}

/// Returns an address, and a quantity that a function allows from that address.
fn run(u: &mut Unstructured<'_>, most: u16) -> Result<(u16, u16)> {
    let address: u16 = u.arbitrary()?;
    let quantity = u.int_in_range(1..=most.min((u16::MAX - address).saturating_add(1)))?;
    Ok((address, quantity))
}

/// Returns this many registers, or as many as there are bytes for.
fn words<'a>(u: &mut Unstructured<'a>, quantity: u16) -> Result<Words<'a>> {
    data(u, (2 * usize::from(quantity)).min(u.len() & !1)).map(Words::from_wire)
}

/// Objects in these bytes, as many as there are.
fn objects<'a>(u: &mut Unstructured<'a>) -> Result<DeviceObjects<'a>> {
    let most = limit::PDU - HEAD;
    Ok(DeviceObjects::from_wire(u.bytes(most.min(u.len()))?))
}

const RANGES: &[FileRange] = &[
    FileRange { file: 4, record: 1, quantity: 2 },
    FileRange { file: 3, record: 9, quantity: 1 },
    FileRange { file: 0xFFFF, record: 9999, quantity: 100 },
];
const GROUPS: &[Words<'_>] = &[Words::from_wire(&[1, 2, 3, 4]), Words::from_wire(&[5, 6])];
const RECORDS: &[FileRecord<'_>] = &[
    FileRecord { file: 4, record: 7, values: Words::from_wire(&[6, 0xAF, 4, 0xBE, 16, 13]) },
    FileRecord { file: 1, record: 0, values: Words::from_wire(&[0; 200]) },
];

/// Groups of a message about files: in these bytes if that is a valid message, otherwise the first ones of some others.
fn records<'a, T: Group<'a>>(u: &mut Unstructured<'a>, others: &'a [T]) -> Result<Records<'a, T>> {
    let count = u.int_in_range(1..=others.len())?;
    let records = Records::<T>::from_wire(u.peek_bytes(u.len().min(limit::PDU)).unwrap_or_default());
    match records.encode(&mut [0; limit::PDU]) {
        Ok(_) => Ok(records),
        Err(_) => Ok(others.get(..count).unwrap_or(others).into()),
    }
}

/// Returns a function without a type of its own, and its bytes.
fn other<'a>(u: &mut Unstructured<'a>) -> Result<(u8, &'a [u8])> {
    let function = u.int_in_range(7..=127)?;
    // None of the typed ones is 50 above another.
    let function = if function::is_typed(function) { function + 50 } else { function };
    let length = u.int_in_range(0..=limit::PDU - 1)?;
    Ok((function, u.bytes(length.min(u.len()))?))
}

/// Returns this many bytes, or as many as there are, if there is one.
fn data<'a>(u: &mut Unstructured<'a>, length: usize) -> Result<&'a [u8]> {
    match length.min(u.len()) {
        0 => Err(Error::NotEnoughData),
        length => u.bytes(length),
    }
}
