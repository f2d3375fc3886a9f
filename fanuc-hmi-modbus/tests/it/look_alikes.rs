//! Bytes on a serial line that look like a part of a reply, or like a whole one.

use crate::common::{MS, Seen, all, bytes, connected, read, rtu, sent};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{Client, DecodeError, Exception, Reply, Words};

const REFUSED: Exception = Exception::IllegalDataAddress;

fn exception() -> Vec<u8> {
    bytes(None, 1, Reply::Exception { function: 3, exception: REFUSED })
}

/// The line pauses after data that are a whole exception.
#[test]
fn a_pause_after_an_exception_within_the_data_does_not_end_the_reply() {
    let data = [&[0][..], &exception(), &[0, 7]].concat();
    let words = Words::from_wire(&data);
    let reply = bytes(None, 1, Reply::HoldingRegisters(words));
    let mut client: Client = connected(rtu());
    let ticket = client.request(1, &read(0, 4)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    let (beginning, rest) = reply.split_at(9);
    client.handle_input(2 * MS, beginning);
    client.handle_timeout(50 * MS);
    assert_eq!(all(&mut client), []);
    client.handle_input(60 * MS, rest);
    assert_eq!(all(&mut client), [Seen::Registers(ticket, words.iter().collect())]);
}

/// Noise that hides a whole reply from the decoder, and within it the beginning of another one.
#[test]
fn a_whole_reply_behind_the_beginning_of_another_one_is_read_after_a_silence() {
    let mut client: Client = connected(rtu());
    let ticket = client.request(1, &read(0, 37)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(2 * MS, &[&[0x55, 3, 200, 1, 3, 74][..], &exception()].concat());
    assert_eq!(all(&mut client), []);
    client.handle_timeout(50 * MS);
    let cut = Seen::Corrupt(DecodeError::Cut { expected: 205, found: 11 });
    assert_eq!(all(&mut client), [cut, Seen::Exception(ticket, REFUSED)]);
}
