//! What a variant of an event carries without a name, under one: `#[serde(serialize_with = "robot_session::under::message")]` before
//! the variant.

use serde::ser::{Serialize, SerializeStruct as _, Serializer};

/// Under a name.
///
/// # Errors
/// Those of the serializer.
pub fn name<S: Serializer>(
    name: &'static str,
    value: &impl Serialize,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_struct(name, 1)?;
    object.serialize_field(name, value)?;
    object.end()
}

/// Under `message`.
///
/// # Errors
/// Those of the serializer.
pub fn message<S: Serializer>(value: &impl Serialize, serializer: S) -> Result<S::Ok, S::Error> {
    name("message", value, serializer)
}

/// Under `error`.
///
/// # Errors
/// Those of the serializer.
pub fn error<S: Serializer>(value: &impl Serialize, serializer: S) -> Result<S::Ok, S::Error> {
    name("error", value, serializer)
}

/// Under `byte`.
///
/// # Errors
/// Those of the serializer.
pub fn byte<S: Serializer>(value: &u8, serializer: S) -> Result<S::Ok, S::Error> {
    name("byte", value, serializer)
}
