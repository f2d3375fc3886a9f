//! Modbus/TCP Security (MBTCP-Security, v21): Modbus in TLS with certificates of both ends, where the client's certificate
//! has its role.
//!
//! Port [`PORT`], TLS 1.2 or later: [`robot_session::tls`] and, for handles, `robot_session::tokio::tls`. A server gives
//! each connection registers that are [`GuardedRegisters`] by the [`role`] of its peer.

use core::str;

use crate::message::{Bits, BitsMut, Exception, Words, WordsMut, function};
use crate::registers::{CommEvents, Registers};

/// The port of Modbus in TLS.
pub const PORT: u16 = 802;

/// The extension of a certificate that has the role: 1.3.6.1.4.1.50316.802.1.
const ROLE: [u8; 11] = [0x2B, 6, 1, 4, 1, 0x83, 0x89, 0x0C, 0x86, 0x22, 1];

/// A certificate whose role cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RoleError {
    /// The bytes are not a certificate of X.509 in DER.
    #[error("not a certificate of X.509 in DER")]
    Certificate,
    /// The role of the certificate is not a UTF8String.
    #[error("the role in the certificate is not a UTF8String")]
    Role,
    /// The certificate has more than one role.
    #[error("the certificate has more than one role")]
    Several,
}

/// Returns the role in a certificate (DER), which must have been verified before; `None` if it has no role.
///
/// # Errors
/// The bytes are not a certificate, or its role is not one UTF8String.
pub fn role(certificate: &[u8]) -> Result<Option<&str>, RoleError> {
    let mut extensions = extensions(certificate).ok_or(RoleError::Certificate)?;
    let mut found = None;
    while !extensions.is_empty() {
        let mut extension = inside(&mut extensions, SEQUENCE).ok_or(RoleError::Certificate)?;
        if inside(&mut extension, OBJECT_IDENTIFIER).ok_or(RoleError::Certificate)? != ROLE {
            continue;
        }
        if found.is_some() {
            return Err(RoleError::Several);
        }
        found = Some(value(extension).ok_or(RoleError::Role)?);
    }
    Ok(found)
}

const BOOLEAN: u8 = 0x01;
const OCTET_STRING: u8 = 0x04;
const OBJECT_IDENTIFIER: u8 = 0x06;
const UTF8_STRING: u8 = 0x0C;
const SEQUENCE: u8 = 0x30;
/// `[3]`, in which a certificate has its extensions.
const EXTENSIONS: u8 = 0xA3;

/// Returns the extensions of a certificate; empty if it has no extensions.
fn extensions(mut certificate: &[u8]) -> Option<&[u8]> {
    let mut signed = inside(&mut certificate, SEQUENCE)?;
    let mut fields = inside(&mut signed, SEQUENCE)?;
    while !fields.is_empty() {
        let (tag, mut content) = element(&mut fields)?;
        if tag == EXTENSIONS {
            return inside(&mut content, SEQUENCE);
        }
    }
    Some(&[])
}

/// Returns the text in an extension, after the flag whether it is critical.
fn value(mut extension: &[u8]) -> Option<&str> {
    let (mut tag, mut content) = element(&mut extension)?;
    if tag == BOOLEAN {
        (tag, content) = element(&mut extension)?;
    }
    let text = inside(&mut content, UTF8_STRING).filter(|_| tag == OCTET_STRING && content.is_empty())?;
    str::from_utf8(text).ok()
}

/// Returns the content of the next element, if it has this tag.
fn inside<'a>(bytes: &mut &'a [u8], tag: u8) -> Option<&'a [u8]> {
    element(bytes).filter(|(found, _)| *found == tag).map(|(_, content)| content)
}

/// Returns the next element of DER: its tag, and its content.
fn element<'a>(bytes: &mut &'a [u8]) -> Option<(u8, &'a [u8])> {
    let (&[tag, short], mut rest) = bytes.split_first_chunk()?;
    let length = match short {
        0..=0x7F => short.into(),
        0x81..=0x83 => {
            let (length, content) = rest.split_at_checked((short & 3).into())?;
            rest = content;
            length.iter().fold(0, |length, byte| length << 8 | usize::from(*byte))
        }
        _ => return None,
    };
    let (content, rest) = rest.split_at_checked(length)?;
    *bytes = rest;
    Some((tag, content))
}

/// An access to registers: the function that stands for it, 15 for function 5 too, 16 for 6, and both halves of 22 and 23
/// separately.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Access {
    /// The function of the request, but 15 for function 5, 16 for 6 and 22, 3 and 16 for 23.
    pub function: u8,
    /// The first address; the subfunction of 8, the file of 20 and 21, the object of 43; 0 for a function that has none of
    /// these.
    pub address: u16,
    /// The number of bits or registers, words of 8, objects of 43; 0 for a function that has none of these, and for 24.
    pub quantity: u16,
}

/// Registers of which a client can access only those that `allows` permits: the server refuses other accesses with exception
/// 1, as the security protocol requires.
///
/// ```
/// use fanuc_hmi_modbus::Registers;
/// use fanuc_hmi_modbus::security::{Access, GuardedRegisters, role};
///
/// /// An operator reads; an engineer also writes from address 100 on.
/// fn guard<R: Registers>(registers: R, certificate: &[u8]) -> impl Registers + use<R> {
///     let is_engineer = role(certificate) == Ok(Some("engineer"));
///     let is_known = is_engineer || role(certificate) == Ok(Some("operator"));
///     GuardedRegisters::new(registers, move |access: Access| match access.function {
///         1..=4 => is_known,
///         _ => is_engineer && access.address >= 100,
///     })
/// }
/// ```
#[derive(Debug, Clone)]
pub struct GuardedRegisters<R, A> {
    registers: R,
    allows: A,
}

impl<R: Registers, A: FnMut(Access) -> bool> GuardedRegisters<R, A> {
    /// Guards these registers.
    pub const fn new(registers: R, allows: A) -> Self {
        Self { registers, allows }
    }

    fn check(&mut self, function: u8, address: u16, quantity: usize) -> Result<(), Exception> {
        let quantity = u16::try_from(quantity).unwrap_or(u16::MAX);
        match (self.allows)(Access { function, address, quantity }) {
            true => Ok(()),
            false => Err(Exception::IllegalFunction),
        }
    }
}

/// Defines the methods of [`Registers`] that the guard checks, with the access of each.
macro_rules! guarded {
    ($($name:ident($($argument:ident: $of:ty),*) -> $gives:ty: $function:expr, $address:expr, $quantity:expr;)*) => {
        $(fn $name(&mut self, $($argument: $of),*) -> Result<$gives, Exception> {
            self.check($function, $address, $quantity)?;
            self.registers.$name($($argument),*)
        })*
    };
}

impl<R: Registers, A: FnMut(Access) -> bool> Registers for GuardedRegisters<R, A> {
    guarded! {
        read_coils(address: u16, out: &mut BitsMut<'_>) -> (): function::READ_COILS, address, out.len();
        read_discrete_inputs(address: u16, out: &mut BitsMut<'_>) -> (): function::READ_DISCRETE_INPUTS, address, out.len();
        read_holding_registers(address: u16, out: &mut WordsMut<'_>) -> (): function::READ_HOLDING_REGISTERS, address, out.len();
        read_input_registers(address: u16, out: &mut WordsMut<'_>) -> (): function::READ_INPUT_REGISTERS, address, out.len();
        write_coils(address: u16, values: Bits<'_>) -> (): function::WRITE_COILS, address, values.len();
        write_registers(address: u16, values: Words<'_>) -> (): function::WRITE_REGISTERS, address, values.len();
        exception_status() -> u8: function::READ_EXCEPTION_STATUS, 0, 0;
        comm_events(log: &mut [u8]) -> CommEvents:
            if log.is_empty() { function::GET_COMM_EVENT_COUNTER } else { function::GET_COMM_EVENT_LOG }, 0, 0;
        diagnose(subfunction: u16, out: &mut WordsMut<'_>) -> (): function::DIAGNOSTICS, subfunction, out.len();
        server_id(out: &mut [u8]) -> usize: function::REPORT_SERVER_ID, 0, 0;
        read_file(file: u16, record: u16, out: &mut WordsMut<'_>) -> (): function::READ_FILE_RECORD, file, out.len();
        write_file(file: u16, record: u16, values: Words<'_>) -> (): function::WRITE_FILE_RECORD, file, values.len();
        read_fifo(address: u16, out: &mut WordsMut<'_>) -> usize: function::READ_FIFO_QUEUE, address, 0;
        other(function: u8, data: &[u8], out: &mut [u8]) -> usize: function, 0, 0;
    }

    fn device_object(&mut self, id: u8, out: &mut [u8]) -> Option<usize> {
        self.check(function::READ_DEVICE_IDENTIFICATION, id.into(), 1).ok()?;
        self.registers.device_object(id, out)
    }
}
