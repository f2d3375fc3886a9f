//! CRC-16 of RTU frames: polynomial A001 (reflected 8005), start FFFF, low byte first on the wire.

/// Returns the CRC of these bytes.
///
/// ```
/// assert_eq!(fanuc_hmi_modbus::crc::crc16(b"123456789"), 0x4B37);
/// ```
#[inline]
pub const fn crc16(bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF;
    let mut rest = bytes;
    while let Some((&byte, tail)) = rest.split_first() {
        crc = step(crc, byte);
        rest = tail;
    }
    crc
}

#[inline]
#[expect(clippy::indexing_slicing, reason = "the index is masked to the table's 256 entries")]
const fn step(crc: u16, byte: u8) -> u16 {
    crc >> 8 ^ TABLE[((crc ^ byte as u16) & 0xFF) as usize]
}

static TABLE: [u16; 256] = table();

#[expect(clippy::indexing_slicing, reason = "the index runs over the table")]
const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut index = 0u16;
    while index < 256 {
        let mut crc = index;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
            bit += 1;
        }
        table[index as usize] = crc;
        index += 1;
    }
    table
}
