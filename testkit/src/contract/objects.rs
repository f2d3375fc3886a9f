//! A codec of the table as a decoder.

use std::io;

use cellwire_links::codec::{Codec, Kind};
use robot_session::Decoder;

/// A codec as a decoder of objects, and of errors that are objects.
#[allow(missing_debug_implementations, reason = "not every codec implements it")]
pub struct Objects(pub Box<dyn Codec>);

impl Decoder for Objects {
    type Frame<'a> = String;
    type Error = io::Error;

    fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    fn next_frame(&mut self) -> Option<Result<String, io::Error>> {
        let mut json = Vec::new();
        let kind = self.0.next(&mut json)?;
        let json = String::from_utf8(json).unwrap();
        Some(if kind == Kind::Message { Ok(json) } else { Err(io::Error::other(json)) })
    }

    fn finish(&mut self) {
        self.0.finish();
    }

    fn position(&self) -> u64 {
        self.0.position()
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}
