//! Both ends on a faulty link with a virtual clock, and every rule by itself.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation
)]

use core::fmt::Write;
use core::time::Duration;
use std::collections::BTreeMap;

use fanuc_hmi_modbus::client::{self, Event, Failure, Ticket};
use fanuc_hmi_modbus::state::{self, State};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Client, DecodeError, Exception, Frame, Mismatch, Registers, Reply, Request, Server,
    SessionError, Words, WordsMut, function, limit, serve, server,
};
use testkit::link::{Delivery, End, Faults, Link};

const MS: Duration = Duration::from_millis(1);

/// 100 of everything from address 0; coils and holding registers can be written.
struct Bank {
    coils: [bool; 100],
    holding: [u16; 100],
    writes: Vec<(u16, u16)>,
}

impl Bank {
    fn new() -> Self {
        Self {
            coils: core::array::from_fn(|i| i % 3 == 0),
            holding: core::array::from_fn(|i| i as u16 * 7),
            writes: Vec::new(),
        }
    }
}

fn slice<T>(all: &mut [T], address: u16, len: usize) -> Result<&mut [T], Exception> {
    all.get_mut(usize::from(address)..usize::from(address) + len).ok_or(Exception::IllegalDataAddress)
}

impl Registers for Bank {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = slice(&mut self.coils, address, out.len())?;
        out.fill_with(|i| bits[i]);
        Ok(())
    }
    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = slice(&mut self.coils, address, out.len())?;
        out.fill_with(|i| !bits[i]);
        Ok(())
    }
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(slice(&mut self.holding, address, out.len())?);
        Ok(())
    }
    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let words = slice(&mut self.holding, address, out.len())?;
        out.fill_with(|i| !words[i]);
        Ok(())
    }
    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        values.copy_to(slice(&mut self.coils, address, values.len())?);
        Ok(())
    }
    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(slice(&mut self.holding, address, values.len())?);
        self.writes.extend((address..).zip(values.iter()));
        Ok(())
    }
    fn other(&mut self, function: u8, data: &[u8], out: &mut [u8]) -> Result<usize, Exception> {
        if function != 65 {
            return Err(Exception::IllegalFunction);
        }
        out[..data.len()].copy_from_slice(data);
        Ok(data.len())
    }
}

/// What a client's event says, without its borrow.
#[derive(Debug, Clone, PartialEq)]
enum Told {
    Registers(Ticket, Vec<u16>),
    Written(Ticket),
    Exception(Ticket, Exception),
    Announced(Ticket),
    Failed(Ticket, Failure),
    Stray { function: u8, late: Option<Ticket>, mismatch: Option<Mismatch> },
    Damaged(DecodeError),
}

fn told(event: Event<'_>) -> Told {
    match event {
        Event::Reply { ticket, reply: Reply::HoldingRegisters(words), .. } => {
            Told::Registers(ticket, words.iter().collect())
        }
        Event::Reply { ticket, reply: Reply::Exception { exception, .. }, .. } => {
            Told::Exception(ticket, exception)
        }
        Event::Reply { ticket, .. } => Told::Written(ticket),
        Event::Announced { ticket } => Told::Announced(ticket),
        Event::Failed { ticket, failure } => Told::Failed(ticket, failure),
        Event::Stray { function, late, mismatch, .. } => Told::Stray { function, late, mismatch },
        Event::Damaged(error) => Told::Damaged(error),
        event => panic!("{event:?}"),
    }
}

fn all<const N: usize>(client: &mut Client<N>) -> Vec<Told> {
    core::iter::from_fn(|| client.poll_event().map(told)).collect()
}

fn sent<const N: usize>(client: &mut Client<N>, now: Duration) -> Vec<Vec<u8>> {
    let mut out = [0; 260];
    core::iter::from_fn(|| client.poll_transmit(now, &mut out).map(|len| out[..len].to_vec())).collect()
}

fn read(address: u16, quantity: u16) -> Request<'static> {
    Request::ReadHoldingRegisters { address, quantity }
}

fn tcp(in_flight: usize) -> client::Config {
    let mut config = client::Config::tcp();
    config.in_flight = in_flight;
    config
}

fn bytes<P: fanuc_hmi_modbus::Pdu>(transaction: Option<u16>, unit: u8, pdu: P) -> Vec<u8> {
    let mut out = [0; 260];
    let len = Frame { transaction, unit, pdu }.encode(&mut out).unwrap();
    out[..len].to_vec()
}

#[test]
fn the_state_matrix() {
    let mut matrix = String::new();
    for state in State::ALL {
        for event in state::Event::ALL {
            if let Some(next) = state::next(state, event) {
                writeln!(matrix, "{state:?} + {event:?} = {next:?}").unwrap();
            }
        }
    }
    assert_eq!(
        matrix,
        "Free + Request = Queued\n\
         Queued + Transmit = Sent\n\
         Queued + Announce = Announced\n\
         Queued + Disconnect = NotSent\n\
         Sent + Reply = Free\n\
         Sent + Deadline = TimedOut\n\
         Sent + Disconnect = Lost\n\
         Announced + Report = Free\n\
         TimedOut + Reply = Free\n\
         TimedOut + Report = Expired\n\
         Lost + Report = Free\n\
         NotSent + Report = Free\n\
         Expired + Request = Queued\n\
         Expired + Reply = Free\n\
         Expired + Disconnect = Free\n"
    );
}

#[test]
fn a_late_reply_is_dropped_and_told_and_shifts_nothing() {
    let mut client: Client = Client::new(tcp(1));
    let first = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    assert_eq!(client.poll_timeout(), Some(1001 * MS));
    client.handle_timeout(1000 * MS);
    assert_eq!(all(&mut client), []);
    client.handle_timeout(1001 * MS);
    assert_eq!(all(&mut client), [Told::Failed(first, Failure::TimedOut)]);

    let second = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 1001 * MS).len(), 1);
    client.handle_input(1100 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[111]))));
    client.handle_input(1101 * MS, &bytes(Some(2), 1, Reply::HoldingRegisters(Words::from(&[222]))));
    let late = Told::Stray { function: 3, late: Some(first), mismatch: None };
    assert_eq!(all(&mut client), [late, Told::Registers(second, vec![222])]);
    client.handle_input(1102 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[111]))));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: None, mismatch: None }]);
}

#[test]
fn a_transaction_that_may_still_be_answered_is_not_given_again() {
    let mut client: Client<2> = Client::new(tcp(1));
    let late = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS)[0][..2], [0, 1]);
    client.handle_timeout(2000 * MS);
    assert_eq!(all(&mut client), [Told::Failed(late, Failure::TimedOut)]);
    for _ in 0..=u16::MAX {
        client.request(1, &read(0, 1)).unwrap();
        let out = sent(&mut client, 2000 * MS);
        let transaction = u16::from_be_bytes([out[0][0], out[0][1]]);
        assert_ne!(transaction, 1);
        let reply = bytes(Some(transaction), 1, Reply::HoldingRegisters((&[7]).into()));
        client.handle_input(2000 * MS, &reply);
        assert!(matches!(all(&mut client)[..], [Told::Registers(..)]));
    }
    client.handle_input(3000 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: Some(late), mismatch: None }]);
}

#[test]
fn a_reply_that_arrived_before_the_timeout_was_told_is_taken() {
    let mut client: Client = Client::new(tcp(1));
    let ticket = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(1000 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[5]))));
    client.handle_timeout(2000 * MS);
    assert_eq!(all(&mut client), [Told::Registers(ticket, vec![5])]);
}

#[test]
fn several_requests_are_out_at_once_and_their_replies_may_change_places() {
    let mut client: Client<4> = Client::new(tcp(3));
    let tickets: Vec<_> = (0..4).map(|i| client.request(1, &read(i, 1)).unwrap()).collect();
    assert_eq!(client.request(1, &read(0, 1)), Err(SessionError::Full { places: 4 }));
    let out = sent(&mut client, MS);
    assert_eq!(out.iter().map(|frame| frame[1]).collect::<Vec<_>>(), [1, 2, 3]);
    for transaction in [3, 1, 2] {
        let words = [transaction * 10];
        client.handle_input(2 * MS, &bytes(Some(transaction), 1, Reply::HoldingRegisters((&words).into())));
    }
    let expected: Vec<_> =
        [(2, 30), (0, 10), (1, 20)].map(|(i, word)| Told::Registers(tickets[i], vec![word])).into();
    assert_eq!(all(&mut client), expected);
    assert_eq!(sent(&mut client, MS)[0][1], 4);
}

#[test]
fn a_reply_of_another_unit_function_length_or_echo_is_refused() {
    let words = |n: usize| Reply::HoldingRegisters(Words::from(&[0; 9][..n]));
    let write = Request::WriteRegister { address: 1, value: 2 };
    let coils = Request::WriteCoils { address: 1, values: (&[true, false]).into() };
    let registers = Request::WriteRegisters { address: 1, values: (&[1, 2]).into() };
    let cases: [(Request<'_>, u8, Reply<'_>, Mismatch); 12] = [
        (read(0, 2), 2, words(2), Mismatch::Unit { expected: 1, found: 2 }),
        (
            read(0, 2),
            1,
            Reply::InputRegisters((&[0, 0]).into()),
            Mismatch::Function { expected: 3, found: 4 },
        ),
        (read(0, 2), 1, words(3), Mismatch::Quantity { expected: 4, found: 6 }),
        (
            Request::ReadCoils { address: 0, quantity: 9 },
            1,
            Reply::Coils(Bits::from(&[true; 8])),
            Mismatch::Quantity { expected: 2, found: 1 },
        ),
        (write, 1, Reply::WriteRegister { address: 1, value: 3 }, Mismatch::Echo),
        (write, 1, Reply::WriteRegister { address: 2, value: 2 }, Mismatch::Echo),
        (
            Request::WriteCoil { address: 1, value: true },
            1,
            Reply::WriteCoil { address: 1, value: false },
            Mismatch::Echo,
        ),
        (coils, 1, Reply::WriteCoils { address: 1, quantity: 3 }, Mismatch::Echo),
        (registers, 1, Reply::WriteRegisters { address: 2, quantity: 2 }, Mismatch::Echo),
        (registers, 1, Reply::WriteRegisters { address: 1, quantity: 1 }, Mismatch::Echo),
        (
            Request::MaskWriteRegister { address: 1, and: 2, or: 3 },
            1,
            Reply::MaskWriteRegister { address: 1, and: 2, or: 4 },
            Mismatch::Echo,
        ),
        (
            read(0, 2),
            1,
            Reply::Exception { function: 4, exception: Exception::Acknowledge },
            Mismatch::Function { expected: 3, found: 4 },
        ),
    ];
    for (request, unit, reply, mismatch) in cases {
        let mut client: Client = Client::new(tcp(1));
        let ticket = client.request(1, &request).unwrap();
        sent(&mut client, MS);
        client.handle_input(2 * MS, &bytes(Some(1), unit, reply));
        assert_eq!(all(&mut client), [Told::Failed(ticket, Failure::Refused(mismatch))], "{request:?}");
        assert_eq!(client.in_flight(), 0);
    }
}

#[test]
fn a_gateway_may_answer_with_another_unit_where_that_is_allowed() {
    let mut config = tcp(1);
    config.any_unit = true;
    let mut client: Client = Client::new(config);
    let ticket = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(2 * MS, &bytes(Some(1), 255, Reply::HoldingRegisters((&[9]).into())));
    assert_eq!(all(&mut client), [Told::Registers(ticket, vec![9])]);
}

#[test]
fn a_malformed_reply_ends_its_request_at_once() {
    let mut client: Client = Client::new(tcp(1));
    let ticket = client.request(1, &read(0, 2)).unwrap();
    sent(&mut client, MS);
    client.handle_input(2 * MS, &[0, 1, 0, 0, 0, 5, 1, 3, 4, 0, 0]);
    let error = DecodeError::PduLength { function: 3, expected: 6, found: 4 };
    assert_eq!(all(&mut client), [Told::Failed(ticket, Failure::Malformed(error))]);
}

#[test]
fn damage_on_tcp_is_told_at_once_and_once() {
    let mut client: Client = Client::new(tcp(1));
    client.handle_input(MS, &[0, 1, 0, 0, 0xFF, 0xFF]);
    assert_eq!(all(&mut client), [Told::Damaged(DecodeError::MbapLength { found: 0xFFFF })]);
    client.handle_input(MS, &[0xFF; 300]);
    client.handle_input(MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[9]).into())));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: None, mismatch: None }]);
    client.handle_input(MS, &[0xEE; 6]);
    assert_eq!(all(&mut client), [Told::Damaged(DecodeError::Protocol { found: 0xEEEE })]);
}

#[test]
fn a_broadcast_waits_for_nobody_and_reads_nothing() {
    let mut client: Client = Client::new(client::Config::rtu(19_200));
    let error = SessionError::BroadcastRead { function: 3 };
    assert_eq!(client.request(0, &read(0, 1)), Err(error));
    let ticket = client.request(0, &Request::WriteRegister { address: 1, value: 2 }).unwrap();
    let next = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 10 * MS).len(), 1);
    assert_eq!(all(&mut client), [Told::Announced(ticket)]);
    assert_eq!(client.poll_timeout(), Some(110 * MS));
    assert_eq!(sent(&mut client, 109 * MS).len(), 0);
    assert_eq!(sent(&mut client, 110 * MS).len(), 1);
    client.handle_input(120 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[4]).into())));
    assert_eq!(all(&mut client), [Told::Registers(next, vec![4])]);

    // On TCP unit 0 is often the server itself.
    let mut client: Client = Client::new(tcp(1));
    let ticket = client.request(0, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(MS, &bytes(Some(1), 0, Reply::HoldingRegisters((&[4]).into())));
    assert_eq!(all(&mut client), [Told::Registers(ticket, vec![4])]);
}

#[test]
fn on_a_serial_line_a_late_reply_has_time_to_settle_and_another_unit_is_no_answer() {
    let mut client: Client = Client::new(client::Config::rtu(19_200));
    let first = client.request(1, &read(0, 1)).unwrap();
    let second = client.request(2, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 10 * MS).len(), 1, "one at a time");
    client.handle_timeout(1010 * MS);
    assert_eq!(all(&mut client), [Told::Failed(first, Failure::TimedOut)]);
    assert_eq!(sent(&mut client, 1109 * MS).len(), 0);
    client.handle_input(1109 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: Some(first), mismatch: None }]);
    assert_eq!(sent(&mut client, 1110 * MS).len(), 0, "the line is not silent yet");
    assert_eq!(sent(&mut client, 1112 * MS).len(), 1);
    client.handle_input(1120 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    client.handle_input(1121 * MS, &bytes(None, 2, Reply::HoldingRegisters((&[8]).into())));
    let mismatch = Some(Mismatch::Unit { expected: 2, found: 1 });
    let stray = Told::Stray { function: 3, late: None, mismatch };
    assert_eq!(all(&mut client), [stray, Told::Registers(second, vec![8])]);
}

#[test]
fn a_break_says_what_was_out_and_sends_nothing_of_it_again() {
    let mut client: Client = Client::new(tcp(1));
    let out = client.request(1, &Request::WriteRegister { address: 1, value: 2 }).unwrap();
    let queued = client.request(1, &Request::WriteRegister { address: 2, value: 2 }).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(MS, &[0, 1, 0, 0]);
    client.handle_disconnect();
    assert_eq!(
        all(&mut client),
        [Told::Failed(out, Failure::Disconnected), Told::Failed(queued, Failure::NotSent)]
    );
    assert_eq!(sent(&mut client, 2 * MS).len(), 0);
    let again = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 2 * MS)[0][..2], [0, 3], "a new transaction");
    client.handle_input(3 * MS, &bytes(Some(3), 1, Reply::HoldingRegisters((&[1]).into())));
    assert_eq!(all(&mut client), [Told::Registers(again, vec![1])]);
}

#[test]
fn only_as_many_bits_are_given_as_were_asked_for() {
    let mut client: Client = Client::new(tcp(1));
    client.request(1, &Request::ReadCoils { address: 0, quantity: 10 }).unwrap();
    sent(&mut client, MS);
    client.handle_input(MS, &[0, 1, 0, 0, 0, 5, 1, 1, 2, 0xFF, 0xFF]);
    let Some(Event::Reply { reply: Reply::Coils(bits), .. }) = client.poll_event() else { panic!() };
    assert_eq!(bits, Bits::from(&[true; 10]));
}

#[test]
fn what_the_specification_forbids_is_not_sent() {
    let mut client: Client = Client::new(tcp(1));
    let error = client.request(1, &read(0, 126)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the request cannot be sent: quantity 126 in function 3 is not within 1 to 125"
    );
    let words = [0; 124];
    let request = Request::WriteRegisters { address: 0, values: (&words).into() };
    assert!(matches!(client.request(1, &request), Err(SessionError::Encode(_))));
    assert_eq!(sent(&mut client, MS).len(), 0);
}

/// The reply PDU to a request PDU.
fn answer(bank: &mut Bank, pdu: &[u8]) -> Vec<u8> {
    let mut out = [0xAA; limit::PDU];
    let len = serve(pdu, bank, &mut out);
    out[..len].to_vec()
}

#[test]
fn every_function_is_served() {
    let bank = &mut Bank::new();
    assert_eq!(answer(bank, &[1, 0, 0, 0, 10]), [1, 2, 0b0100_1001, 0b10]);
    assert_eq!(answer(bank, &[2, 0, 0, 0, 10]), [2, 2, 0b1011_0110, 0b01]);
    assert_eq!(answer(bank, &[3, 0, 1, 0, 2]), [3, 4, 0, 7, 0, 14]);
    assert_eq!(answer(bank, &[4, 0, 1, 0, 1]), [4, 2, 0xFF, 0xF8]);
    assert_eq!(answer(bank, &[5, 0, 1, 0xFF, 0]), [5, 0, 1, 0xFF, 0]);
    assert_eq!(answer(bank, &[6, 0, 1, 0x12, 0x34]), [6, 0, 1, 0x12, 0x34]);
    assert_eq!(answer(bank, &[15, 0, 2, 0, 3, 1, 0b101]), [15, 0, 2, 0, 3]);
    assert_eq!(bank.coils[1..5], [true, true, false, true]);
    assert_eq!(answer(bank, &[16, 0, 2, 0, 2, 4, 0, 1, 0, 2]), [16, 0, 2, 0, 2]);
    assert_eq!(bank.holding[1..4], [0x1234, 1, 2]);
    assert_eq!(answer(bank, &[22, 0, 1, 0xFF, 0, 0, 0x56]), [22, 0, 1, 0xFF, 0, 0, 0x56]);
    assert_eq!(bank.holding[1], 0x1256);
    assert_eq!(answer(bank, &[23, 0, 1, 0, 2, 0, 2, 0, 1, 2, 0xAB, 0xCD]), [23, 4, 0x12, 0x56, 0xAB, 0xCD]);
    assert_eq!(answer(bank, &[65, 1, 2, 3]), [65, 1, 2, 3]);
}

#[test]
fn what_cannot_be_served_gets_its_exception() {
    let bank = &mut Bank::new();
    for (pdu, reply) in [
        (&[7][..], [0x87, 1]),
        (&[0x83, 2], [0x83, 1]),
        (&[0, 1], [0x80, 1]),
        (&[3, 0, 99, 0, 2], [0x83, 2]),
        (&[3, 0xFF, 0xFF, 0, 2], [0x83, 2]),
        (&[1, 0xFF, 0xFF, 0, 2], [0x81, 2]),
        (&[16, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0], [0x90, 2]),
        (&[15, 0xFF, 0xFF, 0, 2, 1, 0], [0x8F, 2]),
        (&[23, 0, 0, 0, 1, 0, 99, 0, 2, 4, 0, 0, 0, 0], [0x97, 2]),
        (&[23, 0, 99, 0, 2, 0, 0, 0, 1, 2, 0xEE, 0xEE], [0x97, 2]),
        (&[3, 0, 0, 0, 0], [0x83, 3]),
        (&[3, 0, 0, 0, 126], [0x83, 3]),
        (&[3, 0, 0], [0x83, 3]),
        (&[5, 0, 0, 0, 1], [0x85, 3]),
        (&[16, 0, 0, 0, 5, 2, 0, 1], [0x90, 3]),
        (&[22, 0, 100, 0, 0, 0, 0], [0x96, 2]),
    ] {
        assert_eq!(answer(bank, pdu), reply, "{pdu:x?}");
    }
    assert_eq!(bank.writes, [], "a refused request changes nothing");
    // Registers are never asked for what lies beyond 65535.
    struct Everything;
    impl Registers for Everything {
        fn read_holding_registers(&mut self, _: u16, _: &mut WordsMut<'_>) -> Result<(), Exception> {
            Ok(())
        }
        fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
            panic!("{address} {values:?}")
        }
    }
    let mut out = [0; limit::PDU];
    for pdu in
        [&[23, 0, 0, 0, 1, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0][..], &[16, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0]]
    {
        assert_eq!(serve(pdu, &mut Everything, &mut out), 2);
        assert_eq!(out[..2], [pdu[0] | function::EXCEPTION, 2]);
    }
    assert_eq!(serve(&[3, 0xFF, 0xFF, 0, 1], &mut Everything, &mut out), 4, "the last address is one");
    struct Nothing;
    impl Registers for Nothing {}
    for code in [1, 2, 3, 4, 5, 6, 22] {
        let pdu: &[u8] = if code == 22 { &[22, 0, 0, 0, 0, 0, 0] } else { &[code, 0, 0, 0, 1] };
        let pdu = if code == 5 { &[5, 0, 0, 0, 0][..] } else { pdu };
        let mut out = [0; limit::PDU];
        assert_eq!(serve(pdu, &mut Nothing, &mut out), 2);
        assert_eq!(out[..2], [code | function::EXCEPTION, 1]);
    }
}

#[test]
fn a_server_answers_in_order_and_only_what_is_meant_for_it() {
    let mut server = Server::new(server::Config::rtu_over_tcp(5));
    let bank = &mut Bank::new();
    let mut out = [0; 260];
    let mut stream = Vec::new();
    for unit in [5, 6, 0, 5] {
        stream.extend(bytes(None, unit, Request::WriteRegister { address: unit.into(), value: 9 }));
    }
    assert_eq!(server.handle_input(MS, &stream), stream.len());
    assert_eq!(server.poll_transmit(MS, bank, &mut [0; 259]), None, "too little room: nothing is done");
    assert_eq!(server.poll_transmit(MS, bank, &mut out), Some(8));
    assert_eq!(out[..6], [5, 6, 0, 5, 0, 9]);
    assert_eq!(server.poll_transmit(MS, bank, &mut out), Some(8));
    assert_eq!(server.poll_transmit(MS, bank, &mut out), None);
    assert_eq!(bank.writes, [(5, 9), (0, 9), (5, 9)]);
    let served: Vec<_> = core::iter::from_fn(|| server.poll_event()).collect();
    let units: Vec<_> = served
        .iter()
        .map(|event| match event {
            server::Event::Served { unit, .. } => *unit,
            event => panic!("{event:?}"),
        })
        .collect();
    assert_eq!(units, [5, 0, 5]);
}

#[test]
fn a_server_on_a_serial_line_answers_after_the_silence() {
    let mut server = Server::new(server::Config::rtu(1, 9600));
    let bank = &mut Bank::new();
    let mut out = [0; 260];
    let request = bytes(None, 1, read(0, 1));
    server.handle_input(MS, &[0x55]);
    assert_eq!(server.poll_timeout(), Some(Duration::from_micros(5010)));
    server.handle_input(6 * MS, &request);
    assert_eq!(server.poll_transmit(10 * MS, bank, &mut out), None);
    assert_eq!(server.poll_transmit(11 * MS, bank, &mut out), Some(7));
    let error = DecodeError::Cut { expected: 4, found: 1 };
    assert_eq!(server.poll_event(), Some(server::Event::Damaged(error)));
    // A function that only the server knows ends with the silence.
    server.handle_input(20 * MS, &bytes(None, 1, Request::Other { function: 65, data: &[1, 2] }));
    assert_eq!(server.poll_transmit(25 * MS, bank, &mut out), Some(6));
    assert_eq!(out[..4], [1, 65, 1, 2]);
}

#[test]
fn a_server_keeps_the_last_eight_events_and_says_when_a_client_is_out_of_step() {
    let mut server = Server::new(server::Config::tcp());
    let bank = &mut Bank::new();
    let mut out = [0; 260];
    for transaction in 0..20 {
        server.handle_input(MS, &bytes(Some(transaction), 1, read(90, transaction + 1)));
        assert!(server.poll_transmit(MS, bank, &mut out).is_some());
    }
    server.handle_input(MS, b"GET / HTTP/1.1\r\n\r\n");
    assert_eq!(server.poll_transmit(MS, bank, &mut out), None);
    let events: Vec<_> = core::iter::from_fn(|| server.poll_event()).collect();
    assert_eq!(events.len(), 8);
    let event = |transaction| server::Event::Served {
        transaction: Some(transaction),
        unit: 1,
        function: 3,
        exception: Some(Exception::IllegalDataAddress),
    };
    assert_eq!(events[0], event(13));
    assert_eq!(events[7], server::Event::Damaged(DecodeError::Protocol { found: 0x5420 }));
}

/// How a run over a faulty link ended.
#[derive(Debug, Default)]
struct Outcome {
    replies: usize,
    failed: usize,
    strays: usize,
    damaged: usize,
    made: usize,
}

/// Both ends until `requests` have ended. Every write has a value of its own; every read is checked against what its register
/// holds for ever.
fn run(
    seed: u64,
    faults: Faults,
    client: client::Config,
    server: server::Config,
    requests: usize,
) -> Outcome {
    let mut link = Link::new(seed, faults);
    let (mut client, mut server) = (Client::<4>::new(client), Server::new(server));
    let mut bank = Bank::new();
    let mut open: BTreeMap<Ticket, Option<u16>> = BTreeMap::new();
    let mut outcome = Outcome::default();
    let mut certain = Vec::new();
    let mut value = 0;
    let mut now = MS;
    let mut out = [0; 260];
    for step in 0.. {
        assert!(step < 200_000, "{outcome:?} stands still at {now:?} with {open:?}");
        while outcome.made < requests {
            let writes = outcome.made % 3 == 0;
            let words = [value + 1; 1];
            let request = if writes {
                Request::WriteRegisters { address: 50, values: (&words).into() }
            } else {
                read((outcome.made % 40) as u16, 3)
            };
            let Ok(ticket) = client.request(1, &request) else { break };
            value += u16::from(writes);
            open.insert(ticket, writes.then_some(value));
            outcome.made += 1;
        }
        if open.is_empty() && outcome.made == requests {
            break;
        }
        while let Some(len) = client.poll_transmit(now, &mut out) {
            link.send(End::A, now, &out[..len]);
        }
        while let Some(len) = server.poll_transmit(now, &mut bank, &mut out) {
            link.send(End::B, now, &out[..len]);
        }
        let next =
            [link.next_delivery(), client.poll_timeout(), server.poll_timeout()].into_iter().flatten().min();
        now = next.unwrap_or(now).max(now + Duration::from_micros(1));
        let mut closed = false;
        while let Some(delivery) = link.receive(End::B, now) {
            match delivery {
                Delivery::Bytes(bytes) => assert_eq!(server.handle_input(now, &bytes), bytes.len()),
                Delivery::Closed => server.reset(),
            }
        }
        while let Some(delivery) = link.receive(End::A, now) {
            match delivery {
                Delivery::Bytes(bytes) => assert_eq!(client.handle_input(now, &bytes), bytes.len()),
                Delivery::Closed => closed = true,
            }
        }
        client.handle_timeout(now);
        server.handle_timeout(now);
        if closed {
            client.handle_disconnect();
        }
        while let Some(event) = client.poll_event() {
            let ticket = match told(event) {
                Told::Registers(ticket, words) => {
                    assert!(words.windows(2).all(|w| w[1] == w[0] + 7), "{words:?} were never side by side");
                    outcome.replies += 1;
                    ticket
                }
                Told::Written(ticket) => {
                    outcome.replies += 1;
                    certain.push(open[&ticket].expect("a write"));
                    ticket
                }
                Told::Failed(ticket, _) => {
                    outcome.failed += 1;
                    ticket
                }
                Told::Stray { .. } => {
                    outcome.strays += 1;
                    continue;
                }
                Told::Damaged(_) => {
                    outcome.damaged += 1;
                    continue;
                }
                other => panic!("{other:?}"),
            };
            assert!(open.remove(&ticket).is_some(), "{ticket:?} ended twice");
        }
        if closed {
            server.reset();
            link.reconnect();
        }
    }
    let mut written: Vec<u16> = bank.writes.iter().map(|(_, value)| *value).collect();
    assert!(certain.iter().all(|value| written.contains(value)), "an acknowledged write was lost");
    let all = written.len();
    written.dedup();
    assert_eq!(written.len(), all, "a write was carried out twice");
    outcome
}

#[test]
fn without_faults_every_request_has_its_reply() {
    for (client, server) in [
        (tcp(4), server::Config::tcp()),
        (client::Config::rtu(19_200), server::Config::rtu(1, 19_200)),
        (client::Config::rtu_over_tcp(), server::Config::rtu_over_tcp(1)),
    ] {
        let outcome = run(1, Faults::NONE, client, server, 200);
        assert_eq!((outcome.replies, outcome.failed, outcome.strays, outcome.damaged), (200, 0, 0, 0));
    }
}

#[test]
fn over_what_tcp_can_commit_nothing_is_shifted_and_nothing_done_twice() {
    let (mut replies, mut failed, mut strays) = (0, 0, 0);
    for seed in 0..60 {
        let faults = Faults { max_delay: 1500 * MS, ..Faults::TCP };
        let outcome = run(seed, faults, tcp(4), server::Config::tcp(), 60);
        assert_eq!(outcome.damaged, 0, "seed {seed}: TCP damages nothing");
        replies += outcome.replies;
        failed += outcome.failed;
        strays += outcome.strays;
    }
    assert!(replies > 2000 && failed > 50 && strays > 10, "{replies} {failed} {strays}");
}

#[test]
fn over_what_a_serial_line_can_commit_every_request_ends_and_the_line_recovers() {
    let (mut replies, mut failed) = (0, 0);
    for seed in 0..60 {
        let faults = Faults::SERIAL.at_baud(19_200);
        let outcome = run(seed, faults, client::Config::rtu(19_200), server::Config::rtu(1, 19_200), 60);
        replies += outcome.replies;
        failed += outcome.failed;
    }
    assert_eq!(replies + failed, 60 * 60);
    assert!(replies > 3200 && failed > 50, "{replies} {failed}");
}
