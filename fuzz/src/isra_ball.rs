//! The ISRA ball: its stream decoder, and the host on any line at any time.

use core::time::Duration;

use isra_ball::{Config, DecodeError, Decoder, Frame, Host, HostEvent, timing};

/// A frame's data or an error, and the stream offset behind it.
type Item = (Result<Vec<u8>, DecodeError>, u64);

/// The first byte is how long the reads are, the rest the stream.
pub fn isra_ball_decoder(data: &[u8]) {
    let Some((&size, stream)) = data.split_first() else { return };
    let items = decode(stream, usize::from(size).max(1));
    assert_eq!(items, decode(stream, usize::MAX), "how the stream is cut changes nothing");
    let mut at = 0;
    for (item, end) in items {
        let bytes = &stream[at..usize::try_from(end).unwrap()];
        assert!(!bytes.is_empty(), "the decoder stands still at byte {at}");
        if let Ok(data) = item {
            let frame = Frame::new(&data).unwrap();
            assert_eq!(Frame::decode(bytes), Ok(Some((frame, bytes.len()))));
            if let Ok(packet) = frame.packet() {
                assert_eq!(packet.to_bytes().unwrap(), bytes, "an accepted packet encodes to its bytes");
            }
        }
        at += bytes.len();
    }
    assert_eq!(at, stream.len(), "every byte is in one item");
}

/// Steps of a pause in milliseconds, a length, and so many bytes from the line.
pub fn isra_ball_session(mut data: &[u8]) {
    let mut host = Host::new(Config::default()).unwrap();
    let (mut now, mut last_poll, mut out) = (Duration::ZERO, None, [0; 16]);
    while let [pause, length, rest @ ..] = data {
        let (bytes, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        data = rest;
        now += Duration::from_millis((*pause).into());
        host.handle_timeout(now);
        host.handle_input(now, bytes);
        if host.poll_transmit(now, &mut out).is_some() {
            assert_eq!(out[0], isra_ball::ENQ);
            assert!(last_poll.is_none_or(|last| now - last >= timing::min_period(9600)), "polled too fast");
            last_poll = Some(now);
        }
        assert_eq!(host.poll_transmit(now, &mut out), None, "one poll at a time");
        let mut events = 0;
        while let Some(event) = host.poll_event() {
            events += 1;
            assert!(events <= 8, "the queue is bounded");
            if let HostEvent::Packet(packet) | HostEvent::Unasked(packet) = event {
                packet.to_bytes().unwrap();
            }
        }
        assert!(host.poll_timeout().unwrap() > now || !host.is_alive());
    }
}

fn decode(stream: &[u8], size: usize) -> Vec<Item> {
    fn drain(decoder: &mut Decoder, items: &mut Vec<Item>) {
        while let Some(item) = decoder.next_frame() {
            let item = item.map(|frame| frame.data().to_vec());
            items.push((item, decoder.position()));
        }
    }
    let (mut decoder, mut items) = (Decoder::new(), Vec::new());
    for mut chunk in stream.chunks(size) {
        while !chunk.is_empty() {
            chunk = &chunk[decoder.push(chunk)..];
            drain(&mut decoder, &mut items);
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut items);
    items
}
