//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
#[cfg(feature = "alloc")]
mod cycle;
mod dialect;
#[cfg(all(feature = "bytes", feature = "serde", feature = "tokio"))]
mod edges;
#[cfg(all(feature = "alloc", feature = "std"))]
mod examples;
mod figures;
#[cfg(feature = "tokio")]
mod give_up;
#[cfg(feature = "tokio")]
mod handle;
mod jobs;
mod layouts;
mod limits;
#[cfg(feature = "alloc")]
mod motion;
mod outcomes;
mod overtaking;
mod packet;
#[cfg(all(feature = "bytes", feature = "tokio"))]
mod properties;
#[cfg(feature = "alloc")]
mod resume;
#[cfg(feature = "tokio")]
mod robot_handle;
mod sizes;
#[cfg(feature = "tokio")]
mod tasks;
#[cfg(feature = "alloc")]
mod uart;
#[cfg(all(feature = "alloc", feature = "std"))]
mod wake;

/// Returns the bytes of a message with these texts.
fn wire(
    charset: kawasaki_msg::Charset,
    name: &str,
    header: &[&str],
    fields: &[&str],
) -> Result<Vec<u8>, kawasaki_msg::EncodeError> {
    let mut wire = vec![0; 5000];
    let mut writer = kawasaki_msg::Writer::new(&mut wire, charset, name);
    header.iter().for_each(|text| writer.text(text));
    writer.data();
    fields.iter().for_each(|text| writer.text(text));
    let length = writer.finish()?;
    wire.truncate(length);
    Ok(wire)
}

fn decoded(wire: &[u8], charset: kawasaki_msg::Charset) -> kawasaki_msg::Message<'_> {
    let (message, used) = kawasaki_msg::Message::decode(wire, charset).unwrap().unwrap();
    assert_eq!(used, wire.len());
    message
}
