//! Messages as the ends of other makers write and read them, without the crate's codec.

use core::fmt::Write as _;

/// Removes and returns the first whole message in the buffer: its name, and its fields, `None` where one is empty.
pub(super) fn take(held: &mut Vec<u8>) -> Option<(String, Vec<Option<i32>>)> {
    let end = held.windows(2).position(|pair| pair == b"#>")? + 2;
    let text = String::from_utf8(held.drain(..end).collect()).expect("TCP corrupts nothing");
    let (head, data) = text.trim_end_matches("#>").split_once('#').expect("a header and a data part");
    let name = head.trim_start_matches('<').split('$').next().unwrap_or_default();
    let fields = data.split('$').map(|field| field.trim().parse().ok());
    Some((name.into(), fields.collect()))
}

/// Appends a message.
pub(super) fn push(packet: &mut String, name: &str, fields: &[Option<i32>]) {
    let fields: Vec<_> = fields.iter().map(|field| field.map_or(String::new(), |n| n.to_string())).collect();
    let data = fields.join("$");
    let _ = write!(packet, "<{name}${}#{data}#>", data.len());
}

/// Returns the number of the job with this count, from 1.
pub(super) fn number(count: u32, max_number: u16) -> Option<i32> {
    let number = count.checked_sub(1)? % u32::from(max_number) + 1;
    Some(number as i32)
}

/// Returns the count of a job with this number, in a window that begins with `from` (KM-44).
pub(super) fn count(from: u32, number: i32, max_number: u16) -> u32 {
    let max = u32::from(max_number);
    from + (number as u32 % max + max - from % max) % max
}
