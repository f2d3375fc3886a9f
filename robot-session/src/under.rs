//! Serializes the unnamed value of an event's variant under a name:
//! `#[serde(serialize_with = "robot_session::under::message")]` before the variant.

use serde::ser::{Serialize, SerializeStruct as _, Serializer};

/// Serializes a value under `name`.
///
/// # Errors
/// The errors of the serializer.
pub fn name<S: Serializer>(
    name: &'static str,
    value: &impl Serialize,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_struct(name, 1)?;
    object.serialize_field(name, value)?;
    object.end()
}

/// Serializes a value under `message`.
///
/// # Errors
/// The errors of the serializer.
pub fn message<S: Serializer>(value: &impl Serialize, serializer: S) -> Result<S::Ok, S::Error> {
    name("message", value, serializer)
}

/// Serializes a value under `error`.
///
/// # Errors
/// The errors of the serializer.
pub fn error<S: Serializer>(value: &impl Serialize, serializer: S) -> Result<S::Ok, S::Error> {
    name("error", value, serializer)
}

/// Serializes a byte under `byte`.
///
/// # Errors
/// The errors of the serializer.
pub fn byte<S: Serializer>(value: &u8, serializer: S) -> Result<S::Ok, S::Error> {
    name("byte", value, serializer)
}
