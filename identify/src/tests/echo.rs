//! Lines that return the bytes of one end.

use core::time::Duration;

use super::*;

const RTU: &str = r#"{"framing": "rtu"}"#;

/// Returns the bytes of the client and of the server in a conversation, exchange by exchange.
fn exchanges(writes: bool) -> Vec<[Vec<u8>; 2]> {
    let given: Value = serde_json::from_str(RTU).unwrap();
    let one = |side: &str, message: Value| sent("fanuc-hmi-modbus", side, &given, &[message]);
    let write = |value: usize| json!({"unit": 1, "function": 6, "address": 10, "value": value});
    (0..12)
        .map(|at| {
            if writes || at % 3 == 0 {
                [one("client", write(at)), one("server", write(at))]
            } else {
                let request = json!({"unit": 1, "function": 3, "address": at, "quantity": 2});
                let reply = json!({"unit": 1, "function": 3, "registers": [at, 7]});
                [one("client", request), one("server", reply)]
            }
        })
        .collect()
}

/// Returns both streams as the client's adapter receives them: with the client's bytes before each reply, in one piece or in
/// two.
fn conversation(exchanges: &[[Vec<u8>; 2]], echo: Option<bool>) -> Vec<Stream> {
    let stream = || Stream { sender: Sender::Unknown, parts: vec![Vec::new()], arrivals: Vec::new() };
    let mut streams = [stream(), stream()];
    let mut now = Duration::ZERO;
    let mut arrive = |streams: &mut [Stream; 2], at: usize, bytes: &[u8]| {
        now += Duration::from_millis(5);
        let begin = streams[at].size();
        streams[at].arrivals.push((begin, now));
        streams[at].parts[0].extend_from_slice(bytes);
    };
    for [request, reply] in exchanges {
        arrive(&mut streams, 0, request);
        match echo {
            Some(true) => {
                let (head, tail) = request.split_at(3);
                arrive(&mut streams, 1, head);
                arrive(&mut streams, 1, tail);
                arrive(&mut streams, 1, reply);
            }
            Some(false) => arrive(&mut streams, 1, &[&request[..], reply].concat()),
            None => arrive(&mut streams, 1, reply),
        }
    }
    streams.into()
}

fn judged(streams: &[Stream]) -> Finding {
    identify(Link::by_name("fanuc-hmi-modbus").unwrap(), streams).unwrap()
}

#[test]
fn a_line_that_returns_what_is_sent_is_found() {
    let exchanges = exchanges(false);
    let plain = judged(&conversation(&exchanges, None));
    assert!(!plain.settings.contains_key("echo"), "{plain:?}");
    assert_eq!(plain.messages, [24, 24]);
    for in_pieces in [true, false] {
        let mut streams = conversation(&exchanges, Some(in_pieces));
        for _ in 0..2 {
            let finding = judged(&streams);
            assert_eq!((finding.messages, finding.bytes[0]), (plain.messages, plain.bytes[0]), "{finding:?}");
            assert_eq!(option(&finding, "echo").value, true);
            assert_eq!(finding.settings["echo"], true);
            // The order of the directions shows nothing.
            streams.reverse();
        }
    }
}

/// The replies to writes are equal to them, and one piece shows nothing.
#[test]
fn replies_that_are_equal_to_requests_are_no_echo() {
    let writes = exchanges(true);
    assert!(!judged(&conversation(&writes, None)).settings.contains_key("echo"));
    assert_eq!(judged(&conversation(&writes, Some(true))).settings["echo"], true);
    let mut changed = writes;
    changed[5][1][4] ^= 1;
    assert!(!judged(&conversation(&changed, None)).settings.contains_key("echo"));
    let one = &exchanges(false)[1..2];
    assert!(!judged(&conversation(one, Some(true))).settings.contains_key("echo"));
}
