//! The `tokio_util` codecs give the same items as the decoders, for any division of the stream into reads.

use core::fmt::Debug;

use bytes::{Buf, BytesMut};
use kawasaki_msg::{Charset, Message};
use mmacell_proto::{Command, Dialect, Line, Reply, RobotPose};
use robot_session::Decoder;
use robot_session::tokio::Codec;
use tokio_util::codec::Decoder as _;
use val2_alter::{HostMessage, Received, RobotMessage};

use crate::stream::items;

/// Three bytes select the link, its options, and the length of the reads; the rest is the stream.
pub fn tokio_codecs(data: &[u8]) {
    let [link, options, size, stream @ ..] = data else { return };
    let (second, third) = (options & 1 == 1, options & 2 != 0);
    match link % 7 {
        0 => {
            use fanuc_hmi_modbus::{Decoder, Frame, Framing, Side};
            let framing = if second { Framing::Tcp } else { Framing::RTU_OVER_TCP };
            let side = if third { Side::Client } else { Side::Server };
            let own = |frame: Frame<&[u8]>| frame.to_buf().unwrap();
            compare(|| Decoder::new(framing, side), own, stream, *size);
        }
        1 => {
            use isra_ball::{Decoder, Frame};
            compare(Decoder::new, |frame: Frame<'_>| frame.data().to_vec(), stream, *size);
        }
        2 => {
            let charset = if second { Charset::Latin1 } else { Charset::Ascii };
            let written = |message: Message<'_>| {
                let mut out = vec![0; message.encoded_len()];
                message.encode(charset, &mut out).unwrap();
                out
            };
            compare(|| kawasaki_msg::Decoder::new(charset), written, stream, *size);
        }
        3 => {
            use laser_eb90::{Decoder, Frame, Profile};
            let own = |frame: Frame<'_>| frame.payload().to_vec();
            compare(|| Decoder::new(&Profile::default()), own, stream, *size);
        }
        4 => {
            let new = || mmacell_proto::Decoder::new(Dialect::STRICT);
            if second {
                let own = |line: Line<'_>| Command::<RobotPose>::decode(line, &Dialect::STRICT);
                compare(new, own, stream, *size);
            } else {
                let own = |line: Line<'_>| Reply::<RobotPose>::decode(line, &Dialect::STRICT);
                compare(new, own, stream, *size);
            }
        }
        6 => compare(val2_viewer::Decoder::new, |packet| packet, stream, *size),
        _ => {
            use val2_alter::{Decoder, Framing};
            if second {
                let own = |received: Received<HostMessage>| received;
                compare(|| Decoder::new(Framing::DEFAULT), own, stream, *size);
            } else {
                let own = |received: Received<RobotMessage>| received;
                compare(|| Decoder::new(Framing::DEFAULT), own, stream, *size);
            }
        }
    }
}

/// The items of a decoder, and of its codec called as by a framed transport.
fn compare<D: Decoder<Error: PartialEq>, T: Debug + PartialEq>(
    new: impl Fn() -> D,
    own: impl Fn(D::Frame<'_>) -> T,
    stream: &[u8],
    size: u8,
) {
    let decoded: Vec<_> =
        items(&mut new(), &own, stream, usize::MAX).into_iter().map(|(item, _)| item).collect();
    let mut codec = Codec::new(new(), own);
    let (mut buffer, mut read) = (BytesMut::new(), Vec::new());
    for chunk in stream.chunks(usize::from(size).max(1)) {
        buffer.extend_from_slice(chunk);
        read.extend(core::iter::from_fn(|| codec.decode(&mut buffer).unwrap()));
        assert!(!buffer.has_remaining(), "the codec takes all bytes, and keeps those of an incomplete frame");
    }
    read.extend(core::iter::from_fn(|| codec.decode_eof(&mut buffer).unwrap()));
    assert_eq!(read, decoded);
}
