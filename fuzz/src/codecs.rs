//! What every decoder promises, whatever the bytes are, and that its `tokio_util` codec gives the same items.

use core::fmt::Debug;

use bytes::{Buf, BytesMut};
use robot_session::Decoder;
use robot_session::tokio::Codec;
use tokio_util::codec::Decoder as _;

use crate::{fanuc_hmi_modbus, isra_ball, kawasaki_msg, laser_eb90, mmacell_proto, val2_alter, val2_viewer};

/// What one side of a link sends.
pub(crate) trait Side {
    /// Its decoder.
    type Decoder: Decoder<Error: PartialEq> + 'static;

    /// A frame that is kept.
    type Frame: PartialEq + Debug;

    /// A decoder without bytes.
    fn decoder(&self) -> Self::Decoder;

    /// A frame, kept.
    fn keep(&self, frame: <Self::Decoder as Decoder>::Frame<'_>) -> Self::Frame;

    /// Panics when an accepted frame is not what its bytes say, or, where one way of writing it is right, is written otherwise.
    fn check(&self, frame: &Self::Frame, before: &[u8], bytes: &[u8]);

    /// A frame, and its bytes at this place.
    fn good(&self, at: usize) -> (Self::Frame, Vec<u8>);
}

/// A frame or an error.
pub(crate) type Item<S> = Result<<S as Side>::Frame, <<S as Side>::Decoder as Decoder>::Error>;

/// The body of a decoder's target: how the stream is cut changes nothing, every byte is in one item, and frames are what their
/// bytes say.
pub(crate) fn decoder<S: Side>(side: &S, stream: &[u8], size: u8) {
    let found = items(side, stream, usize::from(size).max(1));
    assert_eq!(found, items(side, stream, usize::MAX), "how the stream is cut changes nothing");
    let mut at = 0;
    for (item, end) in found {
        assert!(end > at, "the decoder stands still at byte {at}");
        if let Ok(frame) = item {
            side.check(&frame, &stream[..at], &stream[at..end]);
        }
        at = end;
    }
    assert_eq!(at, stream.len(), "every byte is in one item");
}

/// The items of a stream that is read in pieces of this size, each with the place where it ends.
pub(crate) fn items<S: Side>(side: &S, stream: &[u8], size: usize) -> Vec<(Item<S>, usize)> {
    let (mut decoder, mut items) = (side.decoder(), Vec::new());
    let drain = |decoder: &mut S::Decoder, items: &mut Vec<(Item<S>, usize)>| {
        loop {
            let Some(item) = decoder.next_frame() else { return };
            let item = item.map(|frame| side.keep(frame));
            items.push((item, decoder.position() as usize));
        }
    };
    for mut piece in stream.chunks(size) {
        while !piece.is_empty() {
            let (taken, before) = (decoder.push(piece), decoder.position());
            piece = &piece[taken..];
            drain(&mut decoder, &mut items);
            assert!(taken > 0 || decoder.position() > before, "a full decoder makes progress");
        }
    }
    decoder.finish();
    drain(&mut decoder, &mut items);
    let (good, bytes) = side.good(stream.len());
    assert_eq!(decoder.push(&bytes), bytes.len());
    let next = decoder.next_frame().map(|item| item.map(|frame| side.keep(frame)));
    assert_eq!(next, Some(Ok(good)), "what follows the end is read");
    items
}

/// Three bytes select the link, its options, and the length of the reads; the rest is the stream.
pub fn tokio_codecs(data: &[u8]) {
    let [link, options, size, stream @ ..] = data else { return };
    let (second, size) = (options & 1, usize::from(*size).max(1));
    match link % 7 {
        0 => framed(&fanuc_hmi_modbus::Sent::new(!options), stream, size),
        1 => framed(&isra_ball::Sent, stream, size),
        2 => framed(&kawasaki_msg::Sent::new(second << 7), stream, size),
        3 => framed(&laser_eb90::Sent::new(0), stream, size),
        4 => framed(&mmacell_proto::Lines::new(0, |_, _| {}), stream, size),
        6 => framed(&val2_viewer::Sent, stream, size),
        _ if second == 1 => framed(&val2_alter::Sent::host(0), stream, size),
        _ => framed(&val2_alter::Sent::robot(0), stream, size),
    }
}

/// The items of a codec, called as by a framed transport, are those of the decoder.
fn framed<S: Side>(side: &S, stream: &[u8], size: usize) {
    let keep = |frame: <S::Decoder as Decoder>::Frame<'_>| side.keep(frame);
    let (mut codec, mut buffer, mut found) = (Codec::new(side.decoder(), keep), BytesMut::new(), Vec::new());
    for piece in stream.chunks(size) {
        buffer.extend_from_slice(piece);
        found.extend(core::iter::from_fn(|| codec.decode(&mut buffer).unwrap()));
        assert!(!buffer.has_remaining(), "the codec takes all bytes, and keeps those of an incomplete frame");
    }
    found.extend(core::iter::from_fn(|| codec.decode_eof(&mut buffer).unwrap()));
    let expected: Vec<_> = items(side, stream, usize::MAX).into_iter().map(|(item, _)| item).collect();
    assert_eq!(found, expected);
}
