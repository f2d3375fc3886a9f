//! Every CRC of whole bytes up to 32 bits that the catalogue of parametrised CRC algorithms has.

use crc_catalog::{Algorithm, Width};

/// A CRC of the catalogue.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crc {
    pub(super) name: &'static str,
    pub(super) bits: u8,
    poly: u32,
    init: u32,
    refin: bool,
    refout: bool,
    xorout: u32,
    #[cfg(test)]
    check: u32,
}

impl Crc {
    const fn of<W: Width>(name: &'static str, it: &Algorithm<W>, values: [u32; 4]) -> Self {
        let [poly, init, xorout, _check] = values;
        Self {
            name,
            bits: it.width,
            poly,
            init,
            refin: it.refin,
            refout: it.refout,
            xorout,
            #[cfg(test)]
            check: _check,
        }
    }

    /// Returns the CRC of bytes.
    pub(super) fn of_bytes(&self, bytes: &[u8]) -> u32 {
        let top = 1 << (self.bits - 1);
        let mask = u32::MAX >> (32 - self.bits);
        let mut value = self.init;
        for byte in bytes {
            let byte = if self.refin { byte.reverse_bits() } else { *byte };
            value ^= u32::from(byte) << (self.bits - 8);
            for _ in 0..8 {
                value = if value & top == 0 { value << 1 } else { value << 1 ^ self.poly } & mask;
            }
        }
        let value = if self.refout { value.reverse_bits() >> (32 - self.bits) } else { value };
        value ^ self.xorout
    }
}

macro_rules! catalogue {
    ($($name:ident)*) => {
        /// All of them.
        pub(super) static ALL: &[Crc] = &[$({
            let it = &crc_catalog::$name;
            // `into` is not const; no value is cut off, for none has more than 32 bits.
            Crc::of(stringify!($name), it, [it.poly as u32, it.init as u32, it.xorout as u32, it.check as u32])
        }),*];
    };
}

catalogue! {
    CRC_16_MODBUS CRC_16_ARC CRC_16_XMODEM CRC_16_IBM_3740 CRC_16_KERMIT CRC_16_IBM_SDLC CRC_16_USB CRC_16_GENIBUS
    CRC_16_CDMA2000 CRC_16_CMS CRC_16_DDS_110 CRC_16_DECT_R CRC_16_DECT_X CRC_16_DNP CRC_16_EN_13757 CRC_16_GSM
    CRC_16_ISO_IEC_14443_3_A CRC_16_LJ1200 CRC_16_M17 CRC_16_MAXIM_DOW CRC_16_MCRF4XX CRC_16_NRSC_5
    CRC_16_OPENSAFETY_A CRC_16_OPENSAFETY_B CRC_16_PROFIBUS CRC_16_RIELLO CRC_16_SPI_FUJITSU CRC_16_T10_DIF
    CRC_16_TELEDISK CRC_16_TMS37157 CRC_16_UMTS
    CRC_8_SMBUS CRC_8_MAXIM_DOW CRC_8_AUTOSAR CRC_8_BLUETOOTH CRC_8_CDMA2000 CRC_8_DARC CRC_8_DVB_S2 CRC_8_GSM_A
    CRC_8_GSM_B CRC_8_HITAG CRC_8_I_432_1 CRC_8_I_CODE CRC_8_LTE CRC_8_MIFARE_MAD CRC_8_NRSC_5 CRC_8_OPENSAFETY
    CRC_8_ROHC CRC_8_SAE_J1850 CRC_8_TECH_3250 CRC_8_WCDMA
    CRC_32_ISO_HDLC CRC_32_ISCSI CRC_32_BZIP2 CRC_32_MPEG_2 CRC_32_CKSUM CRC_32_JAMCRC CRC_32_AIXM CRC_32_AUTOSAR
    CRC_32_BASE91_D CRC_32_CD_ROM_EDC CRC_32_MEF CRC_32_XFER
    CRC_24_BLE CRC_24_FLEXRAY_A CRC_24_FLEXRAY_B CRC_24_INTERLAKEN CRC_24_LTE_A CRC_24_LTE_B CRC_24_OPENPGP
    CRC_24_OS_9
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The catalogue has the CRC of nine digits.
    #[test]
    fn each_is_what_the_catalogue_says() {
        for crc in ALL {
            assert_eq!(crc.of_bytes(b"123456789"), crc.check, "{}", crc.name);
        }
    }
}
