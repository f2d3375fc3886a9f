//! The bytes of a message.

#[cfg(feature = "arbitrary")]
use kawasaki_msg::{Bounds, Dialect, Job, Line};
use kawasaki_msg::{Charset, Message, Writer};

/// Generates the bytes of a message of a table; half of the messages are jobs.
#[cfg(feature = "arbitrary")]
pub(super) fn arbitrary_of(
    dialect: Dialect,
    u: &mut arbitrary::Unstructured<'_>,
) -> arbitrary::Result<Vec<u8>> {
    let mut wire = vec![0; Message::MAX_LEN];
    let length = if u.arbitrary()? {
        dialect.write_job(&u.arbitrary::<Job<Line>>()?, &Bounds::WIDEST, &mut wire)
    } else {
        let (role, params) = dialect.arbitrary(u)?;
        dialect.write(role, &params, &mut wire)
    };
    wire.truncate(length.map_err(|_| arbitrary::Error::IncorrectFormat)?);
    Ok(wire)
}

/// Returns the bytes of a message with these texts.
pub(super) fn written(
    charset: Charset,
    name: &str,
    header: &[impl AsRef<str>],
    fields: &[impl AsRef<str>],
) -> Result<Vec<u8>, kawasaki_msg::EncodeError> {
    let mut wire = vec![0; Message::MAX_LEN];
    let mut writer = Writer::new(&mut wire, charset, name);
    header.iter().for_each(|text| writer.text(text.as_ref()));
    writer.data();
    fields.iter().for_each(|text| writer.text(text.as_ref()));
    let length = writer.finish()?;
    wire.truncate(length);
    Ok(wire)
}
