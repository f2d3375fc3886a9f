use core::marker::PhantomData;
use std::io;

use bytes::{Buf, BytesMut};

use crate::{Command, DecodeError, Decoder, Dialect, EncodeError, Line, Pose, Reply};

/// The controller's end over a `tokio_util` framed transport: commands out, replies in. A malformed reply is an item of the
/// stream and does not end it.
#[derive(Debug, Clone)]
pub struct ControllerCodec<P>(Lines, PhantomData<P>);

/// The device's end over a `tokio_util` framed transport: replies out, commands in. A malformed command is an item of the
/// stream and does not end it.
#[derive(Debug, Clone)]
pub struct DeviceCodec<P>(Lines, PhantomData<P>);

impl<P> ControllerCodec<P> {
    /// A codec at the beginning of a stream.
    pub const fn new(dialect: Dialect) -> Self {
        Self(Lines { decoder: Decoder::new(dialect), dialect }, PhantomData)
    }
}

impl<P> DeviceCodec<P> {
    /// A codec at the beginning of a stream.
    pub const fn new(dialect: Dialect) -> Self {
        Self(Lines { decoder: Decoder::new(dialect), dialect }, PhantomData)
    }
}

impl<P: Pose> tokio_util::codec::Decoder for ControllerCodec<P> {
    type Item = Result<Reply<P>, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        Ok(self.0.next(src, Reply::decode))
    }

    fn decode_eof(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        Ok(self.0.last(src, Reply::decode))
    }
}

impl<P: Pose> tokio_util::codec::Decoder for DeviceCodec<P> {
    type Item = Result<Command<P>, DecodeError>;
    type Error = io::Error;

    fn decode(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        Ok(self.0.next(src, Command::decode))
    }

    fn decode_eof(&mut self, src: &mut BytesMut) -> io::Result<Option<Self::Item>> {
        Ok(self.0.last(src, Command::decode))
    }
}

impl<P: Pose> tokio_util::codec::Encoder<Command<P>> for ControllerCodec<P> {
    type Error = io::Error;

    fn encode(&mut self, command: Command<P>, out: &mut BytesMut) -> io::Result<()> {
        command.append_to(out).map_err(invalid_input)
    }
}

impl<P: Pose> tokio_util::codec::Encoder<Reply<P>> for DeviceCodec<P> {
    type Error = io::Error;

    fn encode(&mut self, reply: Reply<P>, out: &mut BytesMut) -> io::Result<()> {
        reply.append_to(out).map_err(invalid_input)
    }
}

#[derive(Debug, Clone)]
struct Lines {
    decoder: Decoder,
    dialect: Dialect,
}

type Parse<M> = fn(Line<'_>, &Dialect) -> Result<M, DecodeError>;

impl Lines {
    fn next<M>(&mut self, src: &mut BytesMut, parse: Parse<M>) -> Option<Result<M, DecodeError>> {
        loop {
            if let Some(line) = self.decoder.next_frame() {
                return Some(line.and_then(|line| parse(line, &self.dialect)));
            }
            if src.is_empty() {
                return None;
            }
            let taken = self.decoder.push(src);
            src.advance(taken);
        }
    }

    fn last<M>(&mut self, src: &mut BytesMut, parse: Parse<M>) -> Option<Result<M, DecodeError>> {
        self.next(src, parse).or_else(|| {
            self.decoder.finish();
            self.next(src, parse)
        })
    }
}

fn invalid_input(error: EncodeError) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, error)
}

#[cfg(test)]
mod tests {
    use std::{string::ToString, vec::Vec};

    use tokio_util::codec::{Decoder as _, Encoder as _};

    use super::*;
    use crate::PlatformPose;

    #[test]
    fn both_ends_understand_each_other_and_go_on_behind_damage() {
        let mut controller = ControllerCodec::<PlatformPose>::new(Dialect::STRICT);
        let mut device = DeviceCodec::<PlatformPose>::new(Dialect::STRICT);
        let mut wire = BytesMut::new();
        controller.encode(Command::Status, &mut wire).unwrap();
        wire.extend_from_slice(b"what?\r\n");
        controller.encode(Command::Stop, &mut wire).unwrap();
        wire.extend_from_slice(b"ST");
        let heard: Vec<_> = core::iter::from_fn(|| device.decode_eof(&mut wire).unwrap()).take(9).collect();
        let unknown = DecodeError::UnknownCommand { found: *b"wha" };
        assert_eq!(
            heard,
            [Ok(Command::Status), Err(unknown), Ok(Command::Stop), Err(DecodeError::Incomplete)]
        );
        device.encode(Reply::Ok, &mut wire).unwrap();
        assert_eq!(controller.decode(&mut wire).unwrap(), Some(Ok(Reply::Ok)));
        assert_eq!(controller.decode(&mut wire).unwrap(), None);
        let refused = controller.encode(Command::Override { percent: 101 }, &mut wire).unwrap_err();
        assert_eq!(refused.to_string(), "the override 101 % is above 100 %");
        assert!(wire.is_empty());
    }
}
