//! The `tokio_util` codec.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use bytes::BytesMut;
use tokio_util::codec::{Decoder as _, Encoder as _};
use val2_alter::{Codec, DecodeError, Framing, HostMessage, Mode, RobotMessage, Start, StartCode};

#[test]
fn damage_is_an_item_and_the_end_of_the_stream_breaks_off_what_is_not_complete() {
    let mut robot = Codec::<HostMessage>::new(Framing::DEFAULT);
    let mut host = Codec::<RobotMessage>::new(Framing::DEFAULT);
    let start = RobotMessage::Start(Start::new(Mode::CUMULATIVE_23, Default::default()));
    let mut line = BytesMut::new();
    line.extend_from_slice(b"noise");
    robot.encode(start, &mut line).unwrap();
    robot.encode(start, &mut line).unwrap();
    line.truncate(line.len() - 1);

    let noise = DecodeError::StartMark { offset: 0, length: 5 };
    assert_eq!(host.decode(&mut line).unwrap(), Some(Err(noise)));
    assert_eq!(host.decode(&mut line).unwrap().unwrap().unwrap().message, start);
    assert_eq!(host.decode(&mut line).unwrap(), None);
    let cut = DecodeError::Incomplete { offset: 13, length: 7 };
    assert_eq!(host.decode_eof(&mut line).unwrap(), Some(Err(cut)));
    assert_eq!(host.decode_eof(&mut line).unwrap(), None);

    host.encode(HostMessage::StartReply(StartCode::Refuse), &mut line).unwrap();
    assert_eq!(&line[..], b"\x10\x10\x02\xFF\x10\x03\xFF");
}
