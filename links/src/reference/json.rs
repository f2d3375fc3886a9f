//! JSON with its keys in the order of writing, one object a line.

use core::fmt::Write as _;

use anyhow::Result;
use serde::Serialize;

/// An object that is being written.
#[derive(Debug)]
pub struct Object(String);

impl Default for Object {
    fn default() -> Self {
        Self::new()
    }
}

impl Object {
    /// Creates an empty object.
    pub fn new() -> Self {
        Self("{".into())
    }

    /// Adds a key and a value that is JSON already.
    #[must_use]
    pub fn raw(mut self, key: &str, json: impl core::fmt::Display) -> Self {
        let comma = if self.0.len() > 1 { ", " } else { "" };
        // Writing to a string cannot fail.
        let _ = write!(self.0, "{comma}\"{key}\": {json}");
        self
    }

    /// Adds a key and a value.
    ///
    /// # Errors
    /// If the value cannot be JSON.
    pub fn value(self, key: &str, value: &(impl Serialize + ?Sized)) -> Result<Self> {
        let json = text(value)?;
        Ok(self.raw(key, json))
    }

    /// Adds a key and a value, if there is one.
    ///
    /// # Errors
    /// If the value cannot be JSON.
    pub fn optional(self, key: &str, value: Option<&(impl Serialize + ?Sized)>) -> Result<Self> {
        match value {
            Some(value) => self.value(key, value),
            None => Ok(self),
        }
    }

    /// Adds a list of values that are JSON already, unless it is empty.
    #[must_use]
    pub fn list(self, key: &str, items: &[String]) -> Self {
        if items.is_empty() { self } else { self.raw(key, format_args!("[{}]", items.join(", "))) }
    }

    /// Returns the text.
    pub fn end(self) -> String {
        self.0 + "}"
    }
}

/// Returns a value as JSON, with a space after each comma and colon outside its strings.
///
/// # Errors
/// If the value cannot be JSON.
pub fn text(value: &(impl Serialize + ?Sized)) -> Result<String> {
    Ok(spaced(&serde_json::to_string(value)?))
}

/// Returns JSON with a space after each comma and colon outside its strings.
pub fn spaced(dense: &str) -> String {
    let (mut text, mut in_string, mut escaped) = (String::with_capacity(dense.len()), false, false);
    for c in dense.chars() {
        text.push(c);
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => in_string = !in_string,
            ',' | ':' if !in_string => text.push(' '),
            _ => {}
        }
    }
    text
}

/// Returns the head of a file and its list, one item per line.
pub fn file(schema: &str, head: &[(&str, String)], list: &str, items: &[String]) -> String {
    let mut text = format!("{{\n  \"$schema\": \"../{schema}\",\n");
    for (key, json) in head {
        let _ = writeln!(text, "  \"{key}\": {json},");
    }
    let _ = write!(text, "  \"{list}\": [\n    {}\n  ]\n}}\n", items.join(",\n    "));
    text
}

/// Returns bytes as upper-case hex digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02X}");
        text
    })
}
