//! Strings, alarms and program names: the registers of an assignment with `$MULTIPLY` −1.

pub use crate::error::TextError;

/// The number of registers of one string register SR\[n\]: 80 characters. An assignment of more registers continues with
/// SR\[n + 1\]. (From public notes; not verified on a controller.)
pub const REGISTERS: usize = QUANTITY as usize;
/// [`REGISTERS`] as the quantity of a request, or to count addresses.
pub const QUANTITY: u16 = 40;

/// Reads a string from registers, high byte first, up to the first NUL or the end; returns the number of its bytes.
/// Bytes that do not fit `out`, two per register, are dropped.
///
/// ```
/// assert_eq!(fanuc_hmi_modbus::text::read(&[0x5041, 0x5254, 0x0041], &mut [0; 6]), 4); // PART, then NUL
/// ```
pub fn read(registers: &[u16], out: &mut [u8]) -> usize {
    let bytes = registers.iter().flat_map(|word| word.to_be_bytes()).take_while(|byte| *byte != 0);
    out.iter_mut().zip(bytes).map(|(out, byte)| *out = byte).count()
}

/// Fills the registers of a string: its bytes, then NULs.
///
/// # Errors
/// If the text is longer than two bytes per register, or contains a NUL. Nothing is written then.
pub fn write(text: &[u8], registers: &mut [u16]) -> Result<(), TextError> {
    let most = 2 * registers.len();
    if text.len() > most {
        return Err(TextError::Length { found: text.len(), most });
    }
    if let Some(offset) = text.iter().position(|byte| *byte == 0) {
        return Err(TextError::Nul { offset });
    }
    let mut bytes = text.iter().copied().chain(core::iter::repeat(0));
    let mut next = || bytes.next().unwrap_or(0);
    for register in registers {
        *register = u16::from_be_bytes([next(), next()]);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_string_fills_its_registers_and_ends_at_a_nul_or_with_them() {
        let mut registers = [0xFFFF; 3];
        for (text, words) in
            [(&b"PART7"[..], [0x5041, 0x5254, 0x3700]), (b"", [0; 3]), (b"ABCDEF", [0x4142, 0x4344, 0x4546])]
        {
            write(text, &mut registers).unwrap();
            assert_eq!(registers, words);
            let mut out = [0; 6];
            let length = read(&registers, &mut out);
            assert_eq!(&out[..length], text);
        }
        assert_eq!(read(&[0x4142], &mut [0; 1]), 1, "no more than there is room for");
    }

    #[test]
    fn what_cannot_be_held_changes_nothing() {
        let mut registers = [7; 2];
        assert_eq!(write(b"ABCDE", &mut registers), Err(TextError::Length { found: 5, most: 4 }));
        assert_eq!(write(b"A\0B", &mut registers), Err(TextError::Nul { offset: 1 }));
        assert_eq!(registers, [7; 2]);
    }
}
