//! The exchanges of the sessions by the codec alone, from a stream.

use std::hint::black_box;

use fanuc_hmi_modbus::robot_session::{Decoder as _, Encode as _};
use fanuc_hmi_modbus::{Decoder, Frame, Framing, Reply, Request, Side};

use super::work::{Bank, N, answer, reply_bytes, request_bytes};

pub(super) fn exchange(rounds: u64) {
    let mut decoder = Decoder::new(Framing::Tcp, Side::Server);
    let mut reply = reply_bytes();
    let (mut out, mut words) = ([0; 260], [0u16; N]);
    for transaction in (0..=u16::MAX).cycle().take(rounds as usize) {
        let pdu = Request::ReadHoldingRegisters { address: 0, quantity: N as u16 };
        let request = Frame { transaction: Some(transaction), unit: 1, pdu: black_box(pdu) };
        let len = request.encode(&mut out).expect("a request");
        answer(&mut reply, out.get(..len));
        assert_eq!(decoder.push(black_box(&reply)), reply.len());
        let frame = decoder.next_frame().expect("whole").expect("good").reply().expect("good");
        assert_eq!((frame.transaction, frame.unit), (request.transaction, 1));
        assert_eq!(frame.pdu.answers(&request.pdu), Ok(()));
        let Reply::HoldingRegisters(read) = frame.pdu else { panic!("another reply") };
        assert_eq!(read.copy_to(&mut words), N);
        black_box(&words);
        assert_eq!(decoder.next_frame(), None);
    }
}

pub(super) fn serve(rounds: u64) {
    let mut decoder = Decoder::new(Framing::Tcp, Side::Client);
    let (request, mut bank, mut out) = (request_bytes(), Bank([7; 100]), [0; Frame::MAX_LEN]);
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(&request)), request.len());
        let frame = decoder.next_frame().expect("whole").expect("good");
        assert_eq!(frame.serve(&mut bank, &mut out), Some(9 + 2 * N));
        black_box(&out);
        assert_eq!(decoder.next_frame(), None);
    }
}
