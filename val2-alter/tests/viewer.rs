//! The link to the graphics workstation: a credit of one, and no pile of requests behind a restart.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::time::Duration;

use proptest::prelude::*;
use val2_alter::viewer::{ENQ, PoseFeed, PosePacket, Viewer, ViewerError};
use val2_alter::{EncodeError, Transform};

const MS: Duration = Duration::from_millis(1);
const POSE: Transform = Transform([16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16]);
const LINE: &[u8] = b"$POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";

#[test]
fn a_packet_is_a_line_of_text() {
    let packet = PosePacket { count: 7, pose: POSE };
    let mut out = [0; PosePacket::MAX_LEN];
    let len = packet.encode(&mut out).unwrap();
    assert_eq!(core::str::from_utf8(&out[..len]), core::str::from_utf8(LINE));
    assert_eq!(PosePacket::decode(LINE), Ok(Some((packet, LINE.len()))));
    for end in 0..LINE.len() {
        assert_eq!(PosePacket::decode(&LINE[..end]), Ok(None));
        let short = EncodeError::BufferTooSmall { needed: LINE.len(), available: end };
        assert_eq!(packet.encode(&mut vec![0; end]), Err(short));
    }
    let longest = PosePacket { count: 65535, pose: Transform([-32768; 12]) };
    assert_eq!(longest.encode(&mut out), Ok(PosePacket::MAX_LEN));
    assert_eq!(PosePacket::decode(&out), Ok(Some((longest, PosePacket::MAX_LEN))));
}

#[test]
fn every_digit_of_a_number_and_of_the_sum_is_written_as_it_is_read() {
    let zeros = [0; 12];
    let round = [0, 1, 9, 10, 99, 100, 999, 1000, 9999, 10_000, -10, -10_000];
    for (count, words, line) in [
        (78, zeros, "$POSE,78,0,0,0,0,0,0,0,0,0,0,0,0*2A\r\n"),
        (28, zeros, "$POSE,28,0,0,0,0,0,0,0,0,0,0,0,0*2F\r\n"),
        (10, zeros, "$POSE,10,0,0,0,0,0,0,0,0,0,0,0,0*24\r\n"),
        (0, round, "$POSE,0,0,1,9,10,99,100,999,1000,9999,10000,-10,-10000*24\r\n"),
    ] {
        let packet = PosePacket { count, pose: Transform(words) };
        let mut out = [0; PosePacket::MAX_LEN];
        let length = packet.encode(&mut out).unwrap();
        assert_eq!(core::str::from_utf8(&out[..length]), Ok(line));
        assert_eq!(PosePacket::decode(line.as_bytes()), Ok(Some((packet, line.len()))));
    }
}

#[test]
fn what_is_no_packet_is_refused() {
    let cases: [(&[u8], ViewerError); 9] = [
        (b"POSE,7\r\n", ViewerError::Format { offset: 0 }),
        (b"$POSE,\r\n", ViewerError::Number { offset: 6 }),
        (b"$POSE,65536,1", ViewerError::Number { offset: 6 }),
        (b"$POSE,-1,1", ViewerError::Number { offset: 6 }),
        (b"$POSE,07,1", ViewerError::Number { offset: 6 }),
        (b"$POSE,7,32768,", ViewerError::Number { offset: 8 }),
        (b"$POSE,7,-0,", ViewerError::Number { offset: 8 }),
        (b"$POSE,7,1,2;", ViewerError::Format { offset: 11 }),
        (b"$POSE,7,0,0,0,0,0,0,0,0,0,0,0,0*2g", ViewerError::Format { offset: 33 }),
    ];
    for (line, error) in cases {
        let line = [line, b"\n"].concat();
        assert_eq!(PosePacket::decode(&line), Err(error), "{}", line.escape_ascii());
    }
    let mut line = LINE.to_vec();
    line[9] = b'7';
    assert_eq!(PosePacket::decode(&line), Err(ViewerError::Checksum { expected: 0x31, found: 0x30 }));
    let limit = PosePacket::MAX_LEN;
    assert_eq!(PosePacket::decode(&[b'$'; 200]), Err(ViewerError::TooLong { limit }));
    let trailing = [&LINE[..LINE.len() - 1], b" \n"].concat();
    assert_eq!(PosePacket::decode(&trailing), Err(ViewerError::Format { offset: LINE.len() - 1 }));
}

/// "… daß außer beim ersten Aufruf ein ENQ immer nur dann gesendet wird, wenn vorher ein Nachrichtenpaket vom externen
/// Steuerrechner empfangen wurde" (§9.4)
#[test]
fn the_workstation_asks_first_and_then_only_after_an_answer() {
    let mut viewer = Viewer::default();
    let mut out = [0; 1];
    let mut asked = |viewer: &mut Viewer, at: u32| {
        viewer.draw(MS * at);
        let asked = viewer.poll_transmit(&mut out).is_some();
        assert!(!asked || out == [ENQ]);
        assert_eq!(viewer.poll_transmit(&mut out), None, "one byte a request");
        asked
    };
    assert!(asked(&mut viewer, 0));
    assert!(!asked(&mut viewer, 200));
    assert!(!asked(&mut viewer, 400));
    viewer.handle_input(&LINE[..30]);
    assert!(!asked(&mut viewer, 600));
    viewer.handle_input(&LINE[30..]);
    assert_eq!(viewer.poll_event(), Some(Ok(PosePacket { count: 7, pose: POSE })));
    assert!(asked(&mut viewer, 800));
    // The answer is lost. "… durch kurzes Unterbrechen (ca. zwei Sekunden) des Simulationsablaufes" (§9.4)
    assert!(!asked(&mut viewer, 2799));
    assert!(asked(&mut viewer, 4799));
    // A damaged answer was an answer.
    viewer.handle_input(b"#?$POSE,1,2\r\n");
    assert_eq!(viewer.poll_event(), Some(Err(ViewerError::Format { offset: 9 })));
    assert!(asked(&mut viewer, 5000));
    // A line that a new one cuts off.
    viewer.handle_input(&[&LINE[..20], LINE].concat());
    assert_eq!(viewer.poll_event(), Some(Err(ViewerError::Format { offset: 20 })));
    assert_eq!(viewer.poll_event(), Some(Ok(PosePacket { count: 7, pose: POSE })));
}

#[test]
fn the_host_answers_a_request_once_with_the_newest_pose() {
    let mut feed = PoseFeed::default();
    let mut out = [0; PosePacket::MAX_LEN];
    feed.handle_input(&[ENQ]);
    assert_eq!((feed.poll_timeout(), feed.poll_transmit(MS, &mut out)), (None, None));
    feed.set_pose(Transform([1; 12]));
    feed.set_pose(POSE);
    let len = feed.poll_transmit(MS, &mut out).unwrap();
    assert_eq!(PosePacket::decode(&out[..len]).unwrap().unwrap().0, PosePacket { count: 0, pose: POSE });
    assert_eq!(feed.poll_transmit(1000 * MS, &mut out), None);
    feed.handle_input(&[ENQ, b'?']);
    assert_eq!(feed.poll_timeout(), Some(151 * MS));
    assert_eq!(feed.poll_transmit(150 * MS, &mut out), None);
    assert!(feed.poll_transmit(151 * MS, &mut out).is_some());
    assert_eq!(feed.ignored(), 1);
}

/// "Der Steuerrechner empfängt jetzt in schneller Folge ENQ-Zeichen und antwortet dem Protokoll entsprechend mit ebenso vielen
/// Datenpaketen, was auf Apollo-Seite zu einem Pufferüberlauf … führt" (§9.4): not here.
#[test]
fn a_pile_of_requests_is_answered_once_behind_a_restart() {
    let mut feed = PoseFeed::default();
    let mut out = [0; PosePacket::MAX_LEN];
    feed.set_pose(Transform([1; 12]));
    feed.handle_input(&[ENQ; 100]);
    // ALTER begins again, and the driver lets go 200 requests, one every half millisecond.
    let restart = 60_000 * MS;
    feed.restart(restart);
    assert_eq!(feed.poll_transmit(restart, &mut out), None);
    let later = feed.clone().poll_transmit(restart + PoseFeed::INTERVAL, &mut out);
    assert_eq!(later, None, "the pose of before is not sent");
    feed.set_pose(POSE);
    let mut answers = Vec::new();
    for step in 0..1000 {
        let now = restart + MS / 2 * step;
        if step < 200 {
            feed.handle_input(&[ENQ]);
        }
        if let Some(len) = feed.poll_transmit(now, &mut out) {
            answers.push(PosePacket::decode(&out[..len]).unwrap().unwrap().0.pose);
        }
    }
    assert_eq!(answers, [POSE]);
}

#[test]
fn another_format_may_be_sent() {
    let mut feed = PoseFeed::new(Duration::ZERO);
    feed.set_pose(POSE);
    feed.handle_input(&[ENQ]);
    let mut out = [0; 8];
    assert_eq!(feed.poll_transmit(MS, &mut out), None, "no room: the request stays");
    let len = feed.poll_transmit_as(MS, &mut out, |packet, out| {
        out[..2].copy_from_slice(&packet.pose.0[9].to_be_bytes());
        Some(2)
    });
    assert_eq!((len, &out[..2]), (Some(2), &[0x32, 0x00][..]));
}

proptest! {
    #[test]
    fn a_packet_decodes_to_itself(count: u16, words: [i16; 12]) {
        let packet = PosePacket { count, pose: Transform(words) };
        let mut out = [0; PosePacket::MAX_LEN];
        let len = packet.encode(&mut out).unwrap();
        prop_assert_eq!(PosePacket::decode(&out[..len]), Ok(Some((packet, len))));
        prop_assert!(!out[..len].iter().any(|byte| [0x11, 0x13].contains(byte)), "XON, XOFF");
    }

    #[test]
    fn a_workstation_reads_anything(bytes in prop::collection::vec(any::<u8>(), 0..300), count: u16) {
        let mut viewer = Viewer::default();
        viewer.handle_input(&bytes);
        while viewer.poll_event().is_some() {}
        let packet = PosePacket { count, pose: POSE };
        let mut out = [0; PosePacket::MAX_LEN];
        let len = packet.encode(&mut out).unwrap();
        viewer.handle_input(&out[..len]);
        let last = core::iter::from_fn(|| viewer.poll_event()).last();
        prop_assert_eq!(last, Some(Ok(packet)));
    }
}

#[test]
fn each_part_of_a_pose_line_is_checked_in_its_place() {
    let mut line = [0; PosePacket::MAX_LEN];
    let packet = PosePacket { count: 65_535, pose: Transform([-32_768; 12]) };
    let length = packet.encode(&mut line).unwrap();
    assert_eq!(length, PosePacket::MAX_LEN, "the longest line there is");
    assert_eq!(PosePacket::decode(&line), Ok(Some((packet, length))));
    let with = |at: usize, byte: u8| {
        let mut line = line;
        line[at] = byte;
        PosePacket::decode(&line)
    };
    let star = length - 5;
    assert_eq!(with(star, b'+'), Err(ViewerError::Format { offset: star }));
    assert_eq!(with(star + 1, b'g'), Err(ViewerError::Format { offset: star + 1 }));
    assert_eq!(with(star + 2, b'G'), Err(ViewerError::Format { offset: star + 2 }));
    assert_eq!(with(star + 3, b' '), Err(ViewerError::Format { offset: star + 3 }));
    assert_eq!(with(star + 4, b' '), Err(ViewerError::TooLong { limit: PosePacket::MAX_LEN }));
    assert_eq!(with(6, b'7'), Err(ViewerError::Number { offset: 6 }), "75535 packets");
}
