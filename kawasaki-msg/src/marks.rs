//! The bytes that no name and no field may hold.

/// The mark that begins a message.
pub const START: u8 = b'<';
/// The mark that ends a message.
pub const END: u8 = b'>';
/// The mark between two values.
pub const SEPARATOR: u8 = b'$';
/// The mark before and after the data part.
pub const DATA: u8 = b'#';

/// Returns whether names and fields must not contain this byte.
pub(crate) const fn is_mark(byte: u8) -> bool {
    matches!(byte, START | END | SEPARATOR | DATA)
}
