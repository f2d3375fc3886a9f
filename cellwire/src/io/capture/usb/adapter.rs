//! USB serial adapters, and the settings that their drivers send: the requests of Linux's and the makers' own drivers.

use core::fmt;

use clap::ValueEnum;
use serde::Serialize;

/// The kinds of adapters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Adapter {
    /// FTDI: FT232, FT2232, FT4232, FT-X; two status bytes begin each of its packets
    Ftdi,
    /// WCH: CH340, CH341
    Ch340,
    /// Prolific: PL2303
    Pl2303,
    /// Silicon Labs: CP210x
    Cp210x,
    /// A device of the class for modems, such as a CH9102, an Arduino or a controller's own USB port
    CdcAcm,
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ftdi => "FTDI",
            Self::Ch340 => "CH340",
            Self::Pl2303 => "PL2303",
            Self::Cp210x => "CP210x",
            Self::CdcAcm => "CDC-ACM",
        })
    }
}

impl Adapter {
    /// Returns the adapter of these numbers of vendor and product.
    pub(super) fn of(vendor: u16, product: u16) -> Option<Self> {
        match (vendor, product) {
            (0x0403, _) => Some(Self::Ftdi),
            (0x1A86, 0x5523 | 0x7522 | 0x7523 | 0xE523) | (0x4348, 0x5523) | (0x2184, 0x0057) => {
                Some(Self::Ch340)
            }
            // 25xx is a disk.
            (0x067B, 0x0000..=0x24FF | 0x2600..) | (0x0557, 0x2008) => Some(Self::Pl2303),
            (0x10C4, 0x8000..) => Some(Self::Cp210x),
            _ => None,
        }
    }

    /// Returns the adapter whose driver makes this request; an FTDI's requests are too simple to be its alone.
    pub(super) fn asked(setup: [u8; 8]) -> Option<Self> {
        match setup {
            [0x40, 0x9A | 0xA1, .., 0, 0] => Some(Self::Ch340),
            [0x40, 0x01, .., 0, 0] | [0xC0, 0x01, .., 1, 0] => Some(Self::Pl2303),
            [0x41, 0x1E, ..] => Some(Self::Cp210x),
            [0x21, 0x20, .., 7, 0] => Some(Self::CdcAcm),
            _ => None,
        }
    }
}

/// The settings of a line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub(super) struct LineSettings {
    /// In bits a second, rounded to a usual rate that is as near as an adapter can be to it.
    pub baud: Option<u32>,
    /// Data bits.
    pub bits: Option<u8>,
    /// None, odd, even, mark, space.
    pub parity: Option<char>,
    /// Stop bits; 15 is one and a half.
    pub stop: Option<u8>,
}

impl fmt::Display for LineSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.baud {
            Some(baud) => write!(f, "{baud} baud"),
            None => f.write_str("unknown baud rate"),
        }?;
        if let (Some(bits), Some(parity), Some(stop)) = (self.bits, self.parity, self.stop) {
            write!(f, " {bits}{parity}{}", if stop == 15 { "1.5".into() } else { stop.to_string() })?;
        }
        Ok(())
    }
}

const PARITIES: [char; 5] = ['N', 'O', 'E', 'M', 'S'];

impl LineSettings {
    /// Takes a request to an adapter, with the bytes that go with it; false if it sets nothing. `release` is the device's
    /// own number of its version.
    pub(super) fn told(&mut self, kind: Adapter, release: Option<u16>, setup: [u8; 8], data: &[u8]) -> bool {
        let [request_type, request, low, high, index_low, index_high, ..] = setup;
        let (value, index) = (u16::from_le_bytes([low, high]), u16::from_le_bytes([index_low, index_high]));
        match (kind, request_type, request) {
            (Adapter::Ftdi, 0x40, 3) => self.baud = ftdi_baud(release, value, index),
            (Adapter::Ftdi, 0x40, 4) => {
                let stop = [1, 15, 2].get(usize::from(high >> 3 & 7));
                self.frame(low, high & 7, stop.copied());
            }
            (Adapter::Ch340, 0x40, 0x9A) if value == 0x1312 => self.baud = ch340_baud(index),
            (Adapter::Ch340, 0x40, 0x9A) if value == 0x2518 => self.ch340_frame(index_low),
            // The low byte shows which of the two the request sets.
            (Adapter::Ch340, 0x40, 0xA1) if low & 0x9C == 0x9C => {
                self.ch340_frame(high);
                self.baud = ch340_baud(index);
            }
            (Adapter::Cp210x, 0x41, 0x1E) => {
                self.baud = data.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
            }
            (Adapter::Cp210x, 0x41, 0x01) => self.baud = 3_686_400_u32.checked_div(value.into()).map(usual),
            (Adapter::Cp210x, 0x41, 0x03) => {
                let stop = [1, 15, 2].get(usize::from(low & 15));
                self.frame(high, low >> 4, stop.copied());
            }
            (Adapter::CdcAcm | Adapter::Pl2303, 0x21, 0x20) => {
                let &[a, b, c, d, stop, parity, bits, ..] = data else { return false };
                self.baud = match (kind, [a, b, c, d]) {
                    // Of a rate that is not in its table a PL2303 gets the divisor: of 9 bits, and a power of 4.
                    (Adapter::Pl2303, [a, b, 0, 0x80]) => {
                        let divisor = u32::from(u16::from_le_bytes([a, b]));
                        let whole = (divisor & 0x1FF) << (2 * (divisor >> 9 & 7));
                        (12_000_000_u32 * 32).checked_div(whole).map(usual)
                    }
                    (_, bytes) => Some(u32::from_le_bytes(bytes)),
                };
                self.frame(bits, parity, [1, 15, 2].get(usize::from(stop)).copied());
            }
            _ => return false,
        }
        true
    }

    fn frame(&mut self, bits: u8, parity: u8, stop: Option<u8>) {
        let parity = PARITIES.get(usize::from(parity)).copied();
        (self.bits, self.parity, self.stop) = (Some(bits), parity, stop);
    }

    /// Decodes the register of a 16550 with two more bits.
    fn ch340_frame(&mut self, register: u8) {
        let parity = match register & 0x38 {
            0x08 => 'O',
            0x18 => 'E',
            0x28 => 'M',
            0x38 => 'S',
            _ => 'N',
        };
        let stop = if register & 4 == 0 { 1 } else { 2 };
        (self.bits, self.parity, self.stop) = (Some(5 + (register & 3)), Some(parity), Some(stop));
    }
}

/// Returns the rate of an FTDI, whose divisor has eighths. With several ports, and in high-speed chips, the lower byte of
/// the index is the port; otherwise ambiguous values are resolved to the usual rate.
fn ftdi_baud(release: Option<u16>, value: u16, index: u16) -> Option<u32> {
    const FULL: u32 = 24_000_000;
    const HIGH: u32 = 96_000_000;
    let upper = match release {
        _ if index > 0xFF => vec![index >> 8],
        Some(0x0200..=0x0400 | 0x0600 | 0x1000) => vec![index],
        _ => vec![index, 0],
    };
    let rate = |upper: u16| {
        const EIGHTHS: [u32; 8] = [0, 4, 2, 1, 3, 5, 6, 7];
        let whole = u32::from(value & 0x3FFF);
        let code = value >> 14 | (upper & 1) << 2;
        let clock = if upper & 2 == 0 { FULL } else { HIGH };
        let divisor = match (whole, code) {
            (0, 0) => 8,
            (1, 0) => 12,
            _ => whole * 8 + EIGHTHS.get(usize::from(code)).copied().unwrap_or(0),
        };
        clock.checked_div(divisor)
    };
    let rates: Vec<u32> = upper.into_iter().filter_map(rate).collect();
    rates.iter().copied().map(usual).find(|rate| USUAL.contains(rate)).or_else(|| rates.first().copied())
}

/// Returns the rate of a CH340: a prescaler, and 256 minus the divisor.
fn ch340_baud(index: u16) -> Option<u32> {
    let [low, high] = index.to_le_bytes();
    let shift = 12_u32.checked_sub(3 * u32::from(low & 3))?.checked_sub(u32::from(low >> 2 & 1))?;
    let divisor = (256 - u32::from(high)) << shift;
    48_000_000_u32.checked_div(divisor).map(usual)
}

const USUAL: [u32; 22] = [
    110, 150, 300, 600, 1200, 1800, 2400, 4800, 7200, 9600, 14_400, 19_200, 28_800, 31_250, 38_400, 57_600,
    76_800, 115_200, 230_400, 460_800, 921_600, 1_000_000,
];

/// Returns the usual rate within 1.5 %, which is the accuracy of these adapters.
fn usual(rate: u32) -> u32 {
    USUAL.into_iter().find(|usual| usual.abs_diff(rate) * 200 <= usual * 3).unwrap_or(rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(kind: Adapter, release: Option<u16>, requests: &[([u8; 8], &[u8])]) -> String {
        let mut line = LineSettings::default();
        for (setup, data) in requests {
            assert!(line.told(kind, release, *setup, data), "{setup:02x?}");
        }
        line.to_string()
    }

    /// The requests of Linux's drivers for these settings.
    #[test]
    fn requests_of_drivers_are_read() {
        let ftdi = |release, value: u16, index: u16| {
            let ([a, b], [c, d]) = (value.to_le_bytes(), index.to_le_bytes());
            told(Adapter::Ftdi, release, &[([0x40, 3, a, b, c, d, 0, 0], &[])])
        };
        assert_eq!(ftdi(Some(0x600), 0x4138, 0), "9600 baud");
        assert_eq!(ftdi(Some(0x600), 0x001A, 0), "115200 baud");
        assert_eq!(ftdi(Some(0x600), 0xC04E, 0), "38400 baud");
        assert_eq!(ftdi(Some(0x600), 0x809C, 0), "19200 baud");
        assert_eq!(ftdi(Some(0x600), 0, 0), "3000000 baud");
        // Of high speed: the clock is another, and the second port.
        assert_eq!(ftdi(Some(0x700), 0x04E2, 0x0202), "9600 baud");
        assert_eq!(ftdi(None, 0x04E2, 0x0202), "9600 baud");
        assert_eq!(ftdi(None, 0x4138, 1), "9600 baud");
        let frame = [([0x40, 4, 7, 0x12, 0, 0, 0, 0], &[][..])];
        assert_eq!(told(Adapter::Ftdi, None, &frame), "unknown baud rate 7E2");

        let ch340 = |value: u16, index: u16| {
            let ([a, b], [c, d]) = (value.to_le_bytes(), index.to_le_bytes());
            ([0x40, 0x9A, a, b, c, d, 0, 0], &[][..])
        };
        let both = [ch340(0x1312, 0xB282), ch340(0x2518, 0x00DB)];
        assert_eq!(told(Adapter::Ch340, None, &both), "9600 baud 8E1");
        assert_eq!(told(Adapter::Ch340, None, &[ch340(0x1312, 0xCC83)]), "115200 baud");

        let coding = |bytes: &[u8]| -> Vec<u8> { bytes.to_vec() };
        let setup = [0x21, 0x20, 0, 0, 0, 0, 7, 0];
        let data = coding(&[0x00, 0x4B, 0, 0, 0, 2, 8]);
        assert_eq!(told(Adapter::CdcAcm, None, &[(setup, &data)]), "19200 baud 8E1");
        assert_eq!(told(Adapter::Pl2303, None, &[(setup, &data)]), "19200 baud 8E1");
        let divided = coding(&[0xA0, 0x04, 0, 0x80, 2, 0, 7]);
        assert_eq!(told(Adapter::Pl2303, None, &[(setup, &divided)]), "150000 baud 7N2");
        let requests: [([u8; 8], &[u8]); 2] =
            [([0x41, 0x1E, 0, 0, 0, 0, 4, 0], &[0x80, 0x25, 0, 0]), ([0x41, 3, 0x02, 8, 0, 0, 0, 0], &[])];
        assert_eq!(told(Adapter::Cp210x, None, &requests), "9600 baud 8N2");
    }
}
