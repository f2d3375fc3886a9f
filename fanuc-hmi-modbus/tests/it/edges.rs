//! The borders: a server without tables, replies of every function, buffers that are one byte short, names of things.

use core::time::Duration;

use crate::common::{MS, all, bytes, connected, read, sent, tcp};
use fanuc_hmi_modbus::assignment::{AssignmentError, Setting, check};
use fanuc_hmi_modbus::robot_session::{Encode as _, Session};
use fanuc_hmi_modbus::{
    Assignment, Bits, BitsMut, Client, ClientConfig, DecodeError, EncodeError, Exception, Frame, Pdu,
    Registers, Reply, Request, TelemetryBlock, WordOrder, Words, WordsMut, limit, serve, timing,
};

/// A server that overrides no method.
struct Nothing;

impl Registers for Nothing {}

#[test]
fn a_server_without_tables_refuses_every_function() {
    for pdu in [
        &[1, 0, 0, 0, 1][..],
        &[2, 0, 0, 0, 1],
        &[3, 0, 0, 0, 1],
        &[4, 0, 0, 0, 1],
        &[5, 0, 0, 0xFF, 0],
        &[6, 0, 0, 0, 1],
        &[15, 0, 0, 0, 1, 1, 1],
        &[16, 0, 0, 0, 1, 2, 0, 0],
        &[22, 0, 0, 0, 1, 0, 0],
        &[23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0],
        &[100, 7],
    ] {
        let mut out = [0; limit::PDU];
        assert_eq!(serve(pdu, &mut Nothing, &mut out), 2);
        assert_eq!(out[..2], [pdu[0] | 0x80, 1], "{pdu:?}");
    }
}

/// One register that cannot be written, and a function of its own that writes `0` bytes or too many.
struct Stubborn(usize);

impl Registers for Stubborn {
    fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        assert!(!out.is_empty());
        out.set(0, 0x1234);
        out.set(out.len(), 0xFFFF);
        Ok(())
    }
    fn read_coils(&mut self, _: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        assert!(!out.is_empty());
        out.set(0, true);
        out.set(0, false);
        out.set(1, true);
        out.set(out.len(), true);
        Ok(())
    }
    fn write_registers(&mut self, _: u16, _: Words<'_>) -> Result<(), Exception> {
        Err(Exception::ServerDeviceBusy)
    }
    fn write_coils(&mut self, _: u16, _: Bits<'_>) -> Result<(), Exception> {
        Err(Exception::Other(0x42))
    }
    fn other(&mut self, _: u8, _: &[u8], _: &mut [u8]) -> Result<usize, Exception> {
        Ok(self.0)
    }
}

#[test]
fn what_a_method_refuses_is_the_exception_of_the_reply() {
    let answer = |pdu: &[u8], server: &mut Stubborn| {
        let mut out = [0; limit::PDU];
        let length = serve(pdu, server, &mut out);
        out[..length].to_vec()
    };
    let mut server = Stubborn(252);
    assert_eq!(answer(&[3, 0, 0, 0, 2], &mut server), [3, 4, 0x12, 0x34, 0, 0]);
    assert_eq!(answer(&[1, 0, 0, 0, 3], &mut server), [1, 1, 0b010]);
    for (pdu, exception) in [
        (&[5, 0, 0, 0, 0][..], 0x42),
        (&[6, 0, 0, 0, 0], 6),
        (&[15, 0, 0, 0, 1, 1, 0], 0x42),
        (&[16, 0, 0, 0, 1, 2, 0, 0], 6),
        (&[22, 0, 0, 0, 0, 0, 0], 6),
        (&[23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0], 6),
        (&[23, 0, 0, 0, 1, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0], 2),
        (&[3, 0xFF, 0xFF, 0, 2], 2),
        (&[1, 0xFF, 0xFF, 0, 2], 2),
    ] {
        assert_eq!(answer(pdu, &mut server), [pdu[0] | 0x80, exception], "{pdu:?}");
    }
    assert_eq!(answer(&[100], &mut server).len(), 253, "the longest");
    assert_eq!(answer(&[100], &mut Stubborn(253)), [0xE4, 4], "longer than there is room");
}

#[test]
fn a_reply_answers_its_request_alone() {
    let words = Words::from(&[1, 2]);
    let bits = Bits::from(&[true; 9]);
    for (request, reply, other) in [
        (Request::ReadCoils { address: 0, quantity: 9 }, Reply::Coils(bits), Reply::Coils(bits.truncated(8))),
        (
            Request::ReadDiscreteInputs { address: 0, quantity: 16 },
            Reply::DiscreteInputs(bits),
            Reply::DiscreteInputs(bits.truncated(8)),
        ),
        (
            Request::ReadInputRegisters { address: 0, quantity: 2 },
            Reply::InputRegisters(words),
            Reply::InputRegisters(Words::from(&[1])),
        ),
        (
            Request::ReadWriteRegisters {
                address: 0,
                quantity: 2,
                write_address: 9,
                values: Words::from(&[7]),
            },
            Reply::ReadWriteRegisters(words),
            Reply::ReadWriteRegisters(Words::from(&[1])),
        ),
        (
            Request::WriteCoil { address: 1, value: true },
            Reply::WriteCoil { address: 1, value: true },
            Reply::WriteCoil { address: 2, value: true },
        ),
        (
            Request::WriteRegister { address: 1, value: 2 },
            Reply::WriteRegister { address: 1, value: 2 },
            Reply::WriteRegister { address: 2, value: 2 },
        ),
        (
            Request::WriteCoils { address: 1, values: bits },
            Reply::WriteCoils { address: 1, quantity: 9 },
            Reply::WriteCoils { address: 2, quantity: 9 },
        ),
        (
            Request::WriteRegisters { address: 1, values: words },
            Reply::WriteRegisters { address: 1, quantity: 2 },
            Reply::WriteRegisters { address: 2, quantity: 2 },
        ),
        (
            Request::MaskWriteRegister { address: 1, and: 2, or: 3 },
            Reply::MaskWriteRegister { address: 1, and: 2, or: 3 },
            Reply::MaskWriteRegister { address: 1, and: 2, or: 4 },
        ),
    ] {
        assert_eq!(reply.answers(&request), Ok(()), "{request:?}");
        assert!(other.answers(&request).is_err(), "{request:?}");
        let refused = Reply::Exception { function: request.function(), exception: Exception::Acknowledge };
        assert_eq!(refused.answers(&request), Ok(()));
    }
    let other = Request::Other { function: 100, data: &[1] };
    assert_eq!(Reply::Other { function: 100, data: &[] }.answers(&other), Ok(()));
}

#[test]
fn what_the_specification_does_not_allow_is_not_written() {
    let mut out = [0; 300];
    let refused = |pdu: Reply<'_>, out: &mut [u8]| pdu.encode(out).unwrap_err();
    for function in [0, 3, 0x80] {
        let error = EncodeError::Function { found: function };
        assert_eq!(refused(Reply::Other { function, data: &[] }, &mut out), error);
        assert_eq!(Request::Other { function, data: &[] }.encode(&mut out), Err(error));
    }
    for function in [0, 0x80] {
        let exception = Reply::Exception { function, exception: Exception::ServerDeviceBusy };
        assert_eq!(refused(exception, &mut out), EncodeError::Function { found: function });
    }
    let long = [0; 253];
    let error = EncodeError::PduLength { found: 254 };
    assert_eq!(refused(Reply::Other { function: 100, data: &long }, &mut out), error);
    assert_eq!((&[][..]).encode(&mut out), Err(EncodeError::PduLength { found: 0 }));
    assert_eq!((&[0; 254][..]).encode(&mut out), Err(error));
    assert_eq!((&long[..]).encode(&mut out[..252]), Err(EncodeError::Space { needed: 253, available: 252 }));
    assert_eq!((&&long[..]).encoded_len(), 253);
}

#[test]
fn a_frame_needs_all_of_its_room() {
    let pdu = &[3, 0, 0, 0, 1][..];
    for (transaction, needed) in [(Some(7), 12), (None, 8)] {
        let frame = Frame { transaction, unit: 1, pdu };
        let mut out = [0; 12];
        for available in 0..needed {
            assert_eq!(frame.encode(&mut out[..available]), Err(EncodeError::Space { needed, available }));
        }
        assert_eq!(frame.encode(&mut out), Ok(needed));
        let longest = if transaction.is_some() { 260 } else { 256 };
        let mut reply = [0; 260];
        assert_eq!(frame.serve(&mut Stubborn(0), &mut reply[..longest - 1]), None, "no room for the longest");
        assert_eq!(
            frame.serve(&mut Stubborn(0), &mut reply[..longest]),
            Some(if longest == 260 { 11 } else { 7 })
        );
        assert_eq!(frame.serve(&mut Stubborn(0), &mut []), None);
        let owned = frame.to_buf().unwrap();
        assert_eq!(owned.as_ref(), frame);
    }
    assert_eq!((Frame::MAX_LEN, Frame::MAX_RTU_LEN), (260, 256));
    assert_eq!(Frame::decode_rtu_whole(&[0; 257]), Err(DecodeError::TooLong { found: 257 }));
    assert_eq!(Frame::decode_rtu_whole(&[0; 3]), Err(DecodeError::Cut { expected: 4, found: 3 }));
    assert_eq!(Frame::decode_rtu_whole(&[]), Err(DecodeError::Cut { expected: 4, found: 0 }));
}

#[test]
fn requests_that_are_cut_say_how_long_they_would_be() {
    for whole in
        [&[15, 0, 0, 0, 9, 2, 1, 1][..], &[16, 0, 0, 0, 1, 2, 0, 0], &[23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0]]
    {
        assert!(Request::decode(whole).is_ok());
        for length in 1..whole.len() {
            let error = Request::decode(&whole[..length]).unwrap_err();
            assert!(
                matches!(error, DecodeError::PduLength { found, .. } if found == length),
                "{length}: {error}"
            );
        }
    }
    assert_eq!(Reply::decode(&[5, 0, 0, 1, 0]), Err(DecodeError::CoilValue { found: 0x100 }));
}

#[test]
fn a_stray_reply_names_the_transaction_that_was_expected() {
    let mut client: Client = connected(tcp(1));
    let reply = |transaction| bytes(Some(transaction), 1, Reply::HoldingRegisters(Words::from(&[7])));
    let stray = |client: &mut Client| {
        client.handle_input(MS, &reply(9));
        client.poll_event().unwrap().to_string()
    };
    for expected in [1, 2] {
        client.request(1, &read(0, 1)).unwrap();
        assert_eq!(sent(&mut client, MS).len(), 1);
        let text = format!("a reply with transaction 9, expected {expected} (unit 1, function 3)");
        assert_eq!(stray(&mut client), text);
        client.handle_input(MS, &reply(expected));
        assert_eq!(all(&mut client).len(), 1);
    }
    assert_eq!(stray(&mut client), "a reply with transaction 9, expected none (unit 1, function 3)");
}

#[test]
fn a_client_discards_what_is_older_than_its_timeout() {
    let config = ClientConfig { timeout: 7 * MS, ..tcp(1) };
    assert_eq!(Session::discards_after(&Client::<1>::new(config).unwrap()), Some(7 * MS));
}

#[test]
fn exceptions_have_the_names_of_the_specification() {
    for (code, name) in [
        (1, "illegal function"),
        (2, "illegal data address"),
        (3, "illegal data value"),
        (4, "server device failure"),
        (5, "acknowledge"),
        (6, "server device busy"),
        (7, "unknown"),
        (8, "memory parity error"),
        (10, "gateway path unavailable"),
        (11, "gateway target device failed to respond"),
    ] {
        let exception = Exception::from(code);
        assert_eq!(exception.to_string(), format!("exception {code} ({name})"));
        assert_eq!(u8::from(exception), code);
    }
}

#[test]
fn runs_of_the_wire_and_of_memory_are_written_the_same() {
    let mut out = [0; 6];
    let reply = Reply::HoldingRegisters(Words::from_wire(&[1, 2, 3, 4]));
    assert_eq!((reply.encode(&mut out), out), (Ok(6), [3, 4, 1, 2, 3, 4]));
    assert_eq!((Words::from_wire(&[1]).is_empty(), Words::from(&[1]).is_empty()), (true, false));
    assert_eq!((Bits::from_wire(&[], 9).is_empty(), Bits::from(&[false]).is_empty()), (true, false));
    let reply = Reply::Coils(Bits::from_wire(&[0xFF, 0xFF], 10));
    assert_eq!((reply.encode(&mut out), out), (Ok(4), [1, 2, 0xFF, 0b11, 3, 4]), "the rest of the byte is 0");
    let bits = Bits::from_wire(&[0xFF, 0xFF], 10);
    assert_eq!((bits.get(9), bits.get(10)), (Some(true), None));
    let bits = Bits::from(&[true, false, true]);
    assert_eq!((bits.truncated(2), bits.truncated(4)), (Bits::from(&[true, false]), bits));
    assert_eq!((bits.get(2), bits.get(3), bits.byte_len()), (Some(true), None, 1));
    let mut truths = [false; 2];
    assert_eq!((bits.copy_to(&mut truths), truths), (2, [true, false]));
}

#[test]
fn every_message_says_how_many_bytes_it_takes() {
    let (bits, words) = (Bits::from(&[true; 25]), Words::from(&[1, 2, 3]));
    let (address, quantity) = (1, 2);
    for (request, length) in [
        (Request::ReadCoils { address, quantity }, 5),
        (Request::WriteCoil { address, value: true }, 5),
        (Request::WriteCoils { address, values: bits }, 10),
        (Request::WriteRegisters { address, values: words }, 12),
        (Request::MaskWriteRegister { address, and: 2, or: 3 }, 7),
        (Request::ReadWriteRegisters { address, quantity, write_address: 4, values: words }, 16),
        (Request::Other { function: 100, data: &[1, 2] }, 3),
    ] {
        assert_eq!(request.encoded_len(), length, "{request:?}");
        assert_eq!(request.encode(&mut [0; 20]), Ok(length), "{request:?}");
    }
    let exception = Exception::Acknowledge;
    for (reply, length) in [
        (Reply::Coils(bits), 6),
        (Reply::DiscreteInputs(bits), 6),
        (Reply::HoldingRegisters(words), 8),
        (Reply::InputRegisters(words), 8),
        (Reply::ReadWriteRegisters(words), 8),
        (Reply::WriteRegister { address, value: 2 }, 5),
        (Reply::WriteCoils { address, quantity }, 5),
        (Reply::MaskWriteRegister { address, and: 2, or: 3 }, 7),
        (Reply::Exception { function: 3, exception }, 2),
        (Reply::Other { function: 100, data: &[1, 2] }, 3),
    ] {
        assert_eq!(reply.encoded_len(), length, "{reply:?}");
        assert_eq!(reply.encode(&mut [0; 20]), Ok(length), "{reply:?}");
    }
}

#[test]
fn runs_are_the_same_when_every_value_is() {
    assert_eq!(Words::from(&[1, 0x203]), Words::from_wire(&[0, 1, 2, 3]));
    assert_eq!(Bits::from(&[true, false]), Bits::from_wire(&[0b01], 2));
    for other in [&[][..], &[1], &[2, 2], &[1, 3], &[1, 2, 3]] {
        assert_ne!(Words::from(&[1, 2]), Words::from(other));
    }
    for other in [&[][..], &[true], &[false, false], &[true, true], &[true, false, false]] {
        assert_ne!(Bits::from(&[true, false]), Bits::from(other));
    }
}

#[test]
fn what_a_reply_is_written_into_may_be_empty_and_takes_a_value_twice() {
    assert!(WordsMut::from_wire(&mut []).is_empty());
    assert!(WordsMut::from_wire(&mut [1]).is_empty(), "half a register");
    assert!(BitsMut::from_wire(&mut [], 0).is_empty());
    let mut wire = [0; 2];
    let mut bits = BitsMut::from_wire(&mut wire, 10);
    for (index, bit) in [(0, true), (0, true), (8, true), (8, true), (1, false), (9, true), (9, false)] {
        bits.set(index, bit);
    }
    assert_eq!(wire, [1, 1]);
}

#[test]
fn the_telemetry_block_is_one_request_and_its_reply() {
    let request = TelemetryBlock::request();
    assert_eq!(request, Request::ReadHoldingRegisters { address: 0, quantity: 37 });
    let block =
        TelemetryBlock { life_counter: 7, override_percent: -1, wpr: [1.0, 2.0, 3.0], ..Default::default() };
    let registers = block.to_registers(WordOrder::HighFirst);
    assert_eq!(TelemetryBlock::from_words(&Words::from(&registers), WordOrder::HighFirst), Some(block));
    assert_eq!(TelemetryBlock::from_words(&Words::from(&registers[..36]), WordOrder::HighFirst), None);
}

#[test]
fn a_serial_line_takes_eleven_bits_a_byte() {
    assert_eq!(timing::transmission_time(8, 9600), Duration::from_nanos(9_166_666));
    assert_eq!(timing::transmission_time(1, 0), Duration::from_secs(11));
    assert_eq!(
        (timing::silence(0), timing::silence(19_200)),
        (Duration::from_micros(1750), Duration::from_micros(2005))
    );
    // 8 bytes there and 9 back, 3.5 characters of silence after each.
    assert_eq!(timing::read_time(2, 9600), Duration::from_nanos(9_166_666 + 10_312_500 + 2 * 4_010_000));
}

#[cfg(feature = "serde")]
#[test]
fn a_multiply_is_a_number_in_json() {
    use fanuc_hmi_modbus::Multiply;
    for (multiply, json) in [(Multiply::Real, "0.0"), (Multiply::Text, "-1.0"), (Multiply::Scale(2.5), "2.5")]
    {
        assert_eq!(serde_json::to_string(&multiply).unwrap(), json);
        assert_eq!(serde_json::from_str::<Multiply>(json).unwrap(), multiply);
    }
    let error = serde_json::from_str::<Multiply>("-2").unwrap_err();
    assert_eq!(error.to_string(), "multiply -2 is neither 0, -1 nor within 0.0001 to 10000");
}

#[test]
fn assignments_are_checked_one_by_one_and_line_by_line() {
    let wrong = Assignment { size: 0, ..Assignment::FACTORY };
    assert_eq!(check(&[wrong]), Err(AssignmentError::Size { address: 1, found: 0 }));
    assert_eq!(Setting::parse("$SNPX_ASG[1] is a slot"), Ok(None));
    assert_eq!(Setting::parse("$SNPX_ASG[1].$ADDRESS = x"), Err(AssignmentError::Value { slot: 1 }));
    assert_eq!(Setting::parse("$SNPX_ASG[1].$MULTIPLY = x"), Err(AssignmentError::Value { slot: 1 }));
    /// A writer that takes this many characters.
    struct Short(usize);
    impl core::fmt::Write for Short {
        fn write_str(&mut self, text: &str) -> core::fmt::Result {
            self.0 = self.0.checked_sub(text.len()).ok_or(core::fmt::Error)?;
            Ok(())
        }
    }
    let mut whole = String::new();
    Assignment::FACTORY.print(1, &mut whole).unwrap();
    for room in 0..whole.len() {
        assert_eq!(Assignment::FACTORY.print(1, &mut Short(room)), Err(core::fmt::Error), "{room}");
    }
    assert_eq!(Assignment::FACTORY.print(1, &mut Short(whole.len())), Ok(()));
}

#[test]
fn times_of_the_line_overflow_nothing() {
    assert_eq!(timing::transmission_time(usize::MAX, 1), Duration::from_nanos(u64::MAX));
    assert_eq!(timing::transmission_time(1, 0), Duration::from_secs(11));
    assert_eq!(timing::silence(0), Duration::from_micros(1750));
    assert!(timing::read_time(u16::MAX, 0) > Duration::from_secs(1_000_000));
}
