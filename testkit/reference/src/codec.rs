//! Decodes vectors and streams with the links' codecs.

use anyhow::{Result, ensure};
use cellwire_links::Link;
use cellwire_links::codec::{Codec, StreamItem, items};
use robot_session::contract::chunkings;
use serde_json::{Map, Value};

/// Returns the codec of the side `from`.
pub(crate) fn codec(link: &str, from: Option<&str>, options: &Map<String, Value>) -> Result<Box<dyn Codec>> {
    let link = Link::by_name(link)?;
    (link.codec)(link.side(from)?, options)
}

/// Returns the items of a stream, which are equal for every division into reads. The stream ends after each part.
pub(crate) fn read_every_way(
    make: &dyn Fn() -> Result<Box<dyn Codec>>,
    parts: &[Vec<u8>],
) -> Result<Vec<StreamItem>> {
    let whole: Vec<Vec<&[u8]>> = parts.iter().map(|part| vec![part.as_slice()]).collect();
    let expected = items(make()?, &whole)?;
    for (index, part) in parts.iter().enumerate() {
        for pieces in chunkings(part).take(2 + 200) {
            let lengths: Vec<usize> = pieces.iter().map(|piece| piece.len()).collect();
            let mut cut = whole.clone();
            cut.splice(index..=index, [pieces]);
            let found = items(make()?, &cut)?;
            ensure!(found == expected, "cut into {lengths:?} bytes: {found:?}");
        }
    }
    Ok(expected)
}
