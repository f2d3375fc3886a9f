//! The `tokio_util` codecs give the same items as the decoders, for any division of the stream into reads.

use core::fmt::Debug;
use std::io;

use bytes::{Buf, BytesMut};
use tokio_util::codec::Decoder as Codec;
use val2_alter::Message;

/// Three bytes select the link, its options, and the length of the reads; the rest is the stream.
pub fn tokio_codecs(data: &[u8]) {
    let [link, options, size, stream @ ..] = data else { return };
    let size = usize::from(*size).max(1);
    let second = options & 1 == 1;
    match link % 7 {
        0 => modbus(second, options & 2 != 0, stream, size),
        1 => {
            use isra_ball::Decoder;
            use isra_ball::robot_session::{Decoder as _, tokio::Codec};
            let mut decoder = Decoder::new();
            let expected = items(stream, &mut decoder, Decoder::push, Decoder::finish, |d| {
                d.next_frame().map(|frame| frame.map(|frame| frame.data().to_vec()))
            });
            let mut codec = Codec::new(Decoder::new(), |frame: isra_ball::Frame<'_>| frame.data().to_vec());
            assert_eq!(read(&mut codec, stream, size), expected);
        }
        2 => {
            use kawasaki_msg::robot_session::{self, Decoder as _, tokio::Codec};
            use kawasaki_msg::{Charset, Decoder, Message};
            let charset = if second { Charset::Latin1 } else { Charset::Ascii };
            let written = |message: Message<'_>| {
                let mut out = vec![0; message.encoded_len()];
                message.encode(charset, &mut out).unwrap();
                out
            };
            let mut decoder = Decoder::new(charset);
            let (push, finish) = (robot_session::Decoder::push, robot_session::Decoder::finish);
            let expected = items(stream, &mut decoder, push, finish, |d| {
                d.next_frame().map(|message| message.map(written))
            });
            assert_eq!(read(&mut Codec::new(Decoder::new(charset), written), stream, size), expected);
        }
        3 => {
            use laser_eb90::robot_session::Decoder as _;
            use laser_eb90::{Decoder, Frame, Profile};
            let new = || Decoder::new(&Profile::default());
            let own = |frame: Frame<'_>| frame.payload().to_vec();
            let expected = items(stream, &mut new(), Decoder::push, Decoder::finish, |decoder| {
                decoder.next_frame().map(|frame| frame.map(own))
            });
            assert_eq!(
                read(&mut laser_eb90::robot_session::tokio::Codec::new(new(), own), stream, size),
                expected
            );
        }
        4 => mmacell(second, stream, size),
        6 => {
            use val2_viewer::robot_session::{Decoder as _, tokio::Codec};
            use val2_viewer::{Decoder, PosePacket};
            let expected =
                items(stream, &mut Decoder::new(), Decoder::push, Decoder::finish, Decoder::next_frame);
            let own = |packet: PosePacket| packet;
            assert_eq!(read(&mut Codec::new(Decoder::new(), own), stream, size), expected);
        }
        _ if second => alter::<val2_alter::HostMessage>(stream, size),
        _ => alter::<val2_alter::RobotMessage>(stream, size),
    }
}

fn modbus(tcp: bool, client: bool, stream: &[u8], size: usize) {
    use fanuc_hmi_modbus::{Decoder, Frame, Framing, Side};
    use robot_session::Decoder as _;
    use robot_session::tokio::Codec;
    let framing = if tcp { Framing::Tcp } else { Framing::RTU_OVER_TCP };
    let side = if client { Side::Client } else { Side::Server };
    let own = |frame: Frame<&[u8]>| frame.to_buf().unwrap();
    let mut decoder = Decoder::new(framing, side);
    let expected = items(stream, &mut decoder, Decoder::push, Decoder::finish, |d| {
        d.next_frame().map(|frame| frame.map(own))
    });
    assert_eq!(read(&mut Codec::new(Decoder::new(framing, side), own), stream, size), expected);
}

fn mmacell(device: bool, stream: &[u8], size: usize) {
    use mmacell_proto::robot_session::Decoder as _;
    use mmacell_proto::robot_session::tokio::Codec;
    use mmacell_proto::{Command, Decoder, Dialect, Line, Reply, RobotPose};
    let dialect = Dialect::STRICT;
    let mut decoder = Decoder::new(dialect);
    if device {
        let command = |line: Line<'_>| Command::<RobotPose>::decode(line, &dialect);
        let expected = items(stream, &mut decoder, Decoder::push, Decoder::finish, |d| {
            d.next_frame().map(|line| line.map(command))
        });
        assert_eq!(read(&mut Codec::new(Decoder::new(dialect), command), stream, size), expected);
    } else {
        let reply = |line: Line<'_>| Reply::<RobotPose>::decode(line, &dialect);
        let expected = items(stream, &mut decoder, Decoder::push, Decoder::finish, |d| {
            d.next_frame().map(|line| line.map(reply))
        });
        assert_eq!(read(&mut Codec::new(Decoder::new(dialect), reply), stream, size), expected);
    }
}

fn alter<M: Message + 'static>(stream: &[u8], size: usize) {
    use robot_session::Decoder as _;
    use val2_alter::{Decoder, Framing, Received};
    let mut decoder = Decoder::<M>::new(Framing::DEFAULT);
    let expected = items(stream, &mut decoder, Decoder::push, Decoder::finish, Decoder::next_frame);
    let own = |received: Received<M>| received;
    let mut codec = robot_session::tokio::Codec::new(Decoder::<M>::new(Framing::DEFAULT), own);
    assert_eq!(read(&mut codec, stream, size), expected);
}

/// The items of a decoder.
fn items<D, T>(
    mut stream: &[u8],
    decoder: &mut D,
    push: fn(&mut D, &[u8]) -> usize,
    finish: fn(&mut D),
    mut next: impl FnMut(&mut D) -> Option<T>,
) -> Vec<T> {
    let mut items = Vec::new();
    while !stream.is_empty() {
        stream = &stream[push(decoder, stream)..];
        items.extend(core::iter::from_fn(|| next(decoder)));
    }
    finish(decoder);
    items.extend(core::iter::from_fn(|| next(decoder)));
    items
}

/// The items of a codec, called as by a framed transport.
fn read<C>(codec: &mut C, stream: &[u8], size: usize) -> Vec<C::Item>
where
    C: Codec<Error = io::Error>,
    C::Item: Debug,
{
    let (mut buffer, mut items) = (BytesMut::new(), Vec::new());
    for chunk in stream.chunks(size) {
        buffer.extend_from_slice(chunk);
        items.extend(core::iter::from_fn(|| codec.decode(&mut buffer).unwrap()));
        assert!(!buffer.has_remaining(), "the codec takes all bytes, and keeps those of an incomplete frame");
    }
    items.extend(core::iter::from_fn(|| codec.decode_eof(&mut buffer).unwrap()));
    items
}
