//! modbus-core: its codec. The unit, the registers and the exceptions, which it does not have, are added here.

use modbus_core::{
    Data, Exception, ExceptionResponse, FunctionCode, Request, RequestPdu, Response, ResponsePdu, rtu, tcp,
};

use crate::{BUFFER_LEN, REGISTERS, UNIT};

/// Returns a server of frames that are known to be whole: the crate's `decode_request` searches for a frame, and takes byte
/// 4 for the byte count of function 16, which is byte 6.
pub fn serve_rtu() -> impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize {
    let mut registers = [0; REGISTERS];
    move |request, reply| {
        let Some(length) = request.len().checked_sub(3) else { return 0 };
        let Ok(Some(frame)) = rtu::extract_frame(request, length) else { return 0 };
        if frame.slave != UNIT {
            return 0;
        }
        let mut data = [0; BUFFER_LEN];
        let pdu = answer(&mut registers, Request::try_from(frame.pdu), frame.pdu, &mut data);
        let hdr = rtu::Header { slave: frame.slave };
        rtu::server::encode_response(rtu::ResponseAdu { hdr, pdu }, reply).unwrap_or(0)
    }
}

/// Returns a server of the frame at the beginning of a stream.
pub fn serve_tcp() -> impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize {
    let mut registers = [0; REGISTERS];
    move |request, reply| {
        let Ok(Some(adu)) = tcp::server::decode_request(request) else { return 0 };
        if adu.hdr.unit_id != UNIT {
            return 0;
        }
        let mut data = [0; BUFFER_LEN];
        let RequestPdu(pdu) = adu.pdu;
        let pdu = answer(&mut registers, Ok(pdu), &[], &mut data);
        tcp::server::encode_response(tcp::ResponseAdu { hdr: adu.hdr, pdu }, reply).unwrap_or(0)
    }
}

#[inline]
fn answer<'a>(
    registers: &mut [u16; REGISTERS],
    request: Result<Request<'_>, modbus_core::Error>,
    pdu: &[u8],
    data: &'a mut [u8; BUFFER_LEN],
) -> ResponsePdu<'a> {
    let refuse = |function, exception| ResponsePdu(Err(ExceptionResponse { function, exception }));
    let Ok(request) = request else {
        let function = FunctionCode::new(pdu.first().copied().unwrap_or_default());
        return refuse(function, Exception::IllegalDataValue);
    };
    let function = FunctionCode::from(request);
    let beyond = refuse(function, Exception::IllegalDataAddress);
    let wrong = refuse(function, Exception::IllegalDataValue);
    match request {
        Request::ReadHoldingRegisters(_, 0 | 126..) => wrong,
        Request::ReadHoldingRegisters(address, quantity) => {
            let first = usize::from(address);
            let Some(words) = registers.get(first..first + usize::from(quantity)) else { return beyond };
            match Data::from_words(words, data) {
                Ok(data) => ResponsePdu(Ok(Response::ReadHoldingRegisters(data))),
                Err(_) => refuse(function, Exception::ServerDeviceFailure),
            }
        }
        Request::WriteSingleRegister(address, value) => match registers.get_mut(usize::from(address)) {
            Some(register) => {
                *register = value;
                ResponsePdu(Ok(Response::WriteSingleRegister(address, value)))
            }
            None => beyond,
        },
        Request::WriteMultipleRegisters(address, words) => {
            if !(1..=123).contains(&words.len()) || words.payload().len() != 2 * words.len() {
                return wrong;
            }
            let first = usize::from(address);
            let Some(to) = registers.get_mut(first..first + words.len()) else { return beyond };
            to.iter_mut().zip(words).for_each(|(to, word)| *to = word);
            ResponsePdu(Ok(Response::WriteMultipleRegisters(address, words.len() as u16)))
        }
        _ => refuse(function, Exception::IllegalFunction),
    }
}
