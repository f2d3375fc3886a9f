//! The location of each signal of the robot in the Modbus tables (the source's Table 1), in both directions.
//!
//! Table 1 counts addresses from 1, Modbus counts PDU addresses from 0. Everything here is in PDU addresses, and names the
//! numbers of Table 1 where it cites them.

/// One of the four tables of Modbus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Table {
    /// Bits that a client reads: function 2.
    DiscreteInputs,
    /// Bits that a client reads and writes: functions 1, 5 and 15.
    Coils,
    /// Registers that a client reads: function 4.
    InputRegisters,
    /// Registers that a client reads and writes: functions 3, 6, 16, 22 and 23.
    HoldingRegisters,
}

/// A signal of the robot, by the number that the teach pendant shows.
///
/// ```
/// use fanuc_hmi_modbus::{Signal, Table};
///
/// assert_eq!(Signal::Ri(3).place(), Some((Table::DiscreteInputs, 10002)));
/// assert_eq!(Signal::at(Table::DiscreteInputs, 10002), Some(Signal::Ri(3)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Signal {
    /// Digital input DI\[1\] to DI\[10000\].
    Di(u16),
    /// Robot input RI\[1\] to RI\[10000\].
    Ri(u16),
    /// Input of the user operator panel, UI\[1\] to UI\[1000\].
    Ui(u16),
    /// Output of the user operator panel, UO\[1\] to UO\[999\]. Read only: a controller owns it.
    Uo(u16),
    /// Input of the standard operator panel, SI\[0\] to SI\[999\].
    Si(u16),
    /// Output of the standard operator panel, SO\[0\] to SO\[1000\]. Read only.
    So(u16),
    /// Input of the weld interface, WI\[1\] to WI\[1000\].
    Wi(u16),
    /// Output of the weld interface, WO\[1\] to WO\[1000\]. Read only.
    Wo(u16),
    /// Wire stick detection input, WSI\[1\] to WSI\[1000\]. The source prints "soldering" for "stick".
    Wsi(u16),
    /// Wire stick detection output, WSO\[1\] to WSO\[1000\]. Read only.
    Wso(u16),
    /// Digital output DO\[1\] to DO\[10000\].
    Do(u16),
    /// Robot output RO\[1\] to RO\[10000\].
    Ro(u16),
    /// Flag F\[1\] to F\[10000\].
    Flag(u16),
    /// Group input GI\[1\] to GI\[1000\], 16 bits.
    Gi(u16),
    /// Group output GO\[1\] to GO\[1000\]. Read only.
    Go(u16),
    /// Analog input AI\[1\] to AI\[1000\].
    Ai(u16),
    /// Analog output AO\[1\] to AO\[1000\]. Read only.
    Ao(u16),
    /// Numeric register R\[1\] to R\[16384\], one signed 16-bit register each, unless the area is assigned otherwise: see
    /// [`Assignment`](crate::Assignment). The factory's assignment ends at R\[10000\].
    R(u16),
    /// Register 0 to 63 of the area for "dynamic assignment", 16385 to 16448 in Table 1. The use of this area is documented
    /// nowhere.
    Dynamic(u16),
}

impl Signal {
    /// Returns the signal's table and PDU address; `None` if the number is outside its range.
    pub fn place(self) -> Option<(Table, u16)> {
        let number = self.number();
        let row = ROWS.iter().find(|row| (row.signal)(number) == self)?;
        let offset = number.checked_sub(row.number)?;
        (offset <= row.last - row.first).then_some((row.table, row.first - 1 + offset))
    }

    /// Returns the signal at a PDU address; `None` if Table 1 has "not used" there.
    pub fn at(table: Table, address: u16) -> Option<Self> {
        let address = address.checked_add(1)?;
        let row = ROWS.iter().find(|row| row.table == table && (row.first..=row.last).contains(&address))?;
        Some((row.signal)(row.number + (address - row.first)))
    }

    #[rustfmt::skip]
    const fn number(self) -> u16 {
        let (Self::Di(n) | Self::Ri(n) | Self::Ui(n) | Self::Uo(n) | Self::Si(n) | Self::So(n) | Self::Wi(n) | Self::Wo(n)
            | Self::Wsi(n) | Self::Wso(n) | Self::Do(n) | Self::Ro(n) | Self::Flag(n) | Self::Gi(n) | Self::Go(n)
            | Self::Ai(n) | Self::Ao(n) | Self::R(n) | Self::Dynamic(n)) = self;
        n
    }
}

/// A row of Table 1.
struct Row {
    signal: fn(u16) -> Signal,
    table: Table,
    /// The first address, counted from 1.
    first: u16,
    /// The last address, counted from 1.
    last: u16,
    /// The number of the signal at the first address.
    number: u16,
}

const fn row(signal: fn(u16) -> Signal, table: Table, first: u16, last: u16, number: u16) -> Row {
    Row { signal, table, first, last, number }
}

/// Table 1.
static ROWS: [Row; 19] = [
    row(Signal::Di, Table::DiscreteInputs, 1, 10_000, 1),
    row(Signal::Ri, Table::DiscreteInputs, 10_001, 20_000, 1),
    row(Signal::Ui, Table::DiscreteInputs, 20_001, 21_000, 1),
    row(Signal::Uo, Table::DiscreteInputs, 21_001, 21_999, 1),
    row(Signal::Si, Table::DiscreteInputs, 22_000, 22_999, 0),
    row(Signal::So, Table::DiscreteInputs, 23_000, 24_000, 0),
    row(Signal::Wi, Table::DiscreteInputs, 24_001, 25_000, 1),
    row(Signal::Wo, Table::DiscreteInputs, 25_001, 26_000, 1),
    row(Signal::Wsi, Table::DiscreteInputs, 26_001, 27_000, 1),
    row(Signal::Wso, Table::DiscreteInputs, 27_001, 28_000, 1),
    row(Signal::Do, Table::Coils, 1, 10_000, 1),
    row(Signal::Ro, Table::Coils, 10_001, 20_000, 1),
    row(Signal::Flag, Table::Coils, 20_001, 30_000, 1),
    row(Signal::Gi, Table::InputRegisters, 1, 1000, 1),
    row(Signal::Go, Table::InputRegisters, 1001, 2000, 1),
    row(Signal::Ai, Table::InputRegisters, 2001, 3000, 1),
    row(Signal::Ao, Table::InputRegisters, 3001, 4000, 1),
    row(Signal::R, Table::HoldingRegisters, 1, 16_384, 1),
    row(Signal::Dynamic, Table::HoldingRegisters, 16_385, 16_448, 0),
];

#[cfg(test)]
mod tests {
    use super::Signal::*;
    use super::*;

    /// Every border of Table 1, in its own numbers, counted from 1.
    #[test]
    fn every_border_of_the_table_is_where_the_source_puts_it() {
        use Table::{Coils, DiscreteInputs, HoldingRegisters, InputRegisters};
        for (table, address, signal) in [
            (DiscreteInputs, 1, Some(Di(1))),
            (DiscreteInputs, 10_000, Some(Di(10_000))),
            (DiscreteInputs, 10_001, Some(Ri(1))),
            (DiscreteInputs, 20_000, Some(Ri(10_000))),
            (DiscreteInputs, 20_001, Some(Ui(1))),
            (DiscreteInputs, 21_000, Some(Ui(1000))),
            (DiscreteInputs, 21_001, Some(Uo(1))),
            (DiscreteInputs, 21_999, Some(Uo(999))),
            (DiscreteInputs, 22_000, Some(Si(0))),
            (DiscreteInputs, 22_999, Some(Si(999))),
            (DiscreteInputs, 23_000, Some(So(0))),
            (DiscreteInputs, 24_000, Some(So(1000))),
            (DiscreteInputs, 24_001, Some(Wi(1))),
            (DiscreteInputs, 25_000, Some(Wi(1000))),
            (DiscreteInputs, 25_001, Some(Wo(1))),
            (DiscreteInputs, 26_000, Some(Wo(1000))),
            (DiscreteInputs, 26_001, Some(Wsi(1))),
            (DiscreteInputs, 27_000, Some(Wsi(1000))),
            (DiscreteInputs, 27_001, Some(Wso(1))),
            (DiscreteInputs, 28_000, Some(Wso(1000))),
            (DiscreteInputs, 28_001, None),
            (DiscreteInputs, 65_536, None),
            (Coils, 1, Some(Do(1))),
            (Coils, 10_000, Some(Do(10_000))),
            (Coils, 10_001, Some(Ro(1))),
            (Coils, 20_000, Some(Ro(10_000))),
            (Coils, 20_001, Some(Flag(1))),
            (Coils, 30_000, Some(Flag(10_000))),
            (Coils, 30_001, None),
            (InputRegisters, 1, Some(Gi(1))),
            (InputRegisters, 1000, Some(Gi(1000))),
            (InputRegisters, 1001, Some(Go(1))),
            (InputRegisters, 2000, Some(Go(1000))),
            (InputRegisters, 2001, Some(Ai(1))),
            (InputRegisters, 3000, Some(Ai(1000))),
            (InputRegisters, 3001, Some(Ao(1))),
            (InputRegisters, 4000, Some(Ao(1000))),
            (InputRegisters, 4001, None),
            (HoldingRegisters, 1, Some(R(1))),
            (HoldingRegisters, 16_384, Some(R(16_384))),
            (HoldingRegisters, 16_385, Some(Dynamic(0))),
            (HoldingRegisters, 16_448, Some(Dynamic(63))),
            (HoldingRegisters, 16_449, None),
        ] {
            let address = u16::try_from(address - 1u32).unwrap();
            assert_eq!(Signal::at(table, address), signal, "{table:?} {address}");
            if let Some(signal) = signal {
                assert_eq!(signal.place(), Some((table, address)));
            }
        }
    }

    #[test]
    fn every_address_and_its_signal_agree_and_no_number_beyond_its_range_has_a_place() {
        let mut used = 0;
        for table in [Table::DiscreteInputs, Table::Coils, Table::InputRegisters, Table::HoldingRegisters] {
            for address in 0..=u16::MAX {
                if let Some(signal) = Signal::at(table, address) {
                    assert_eq!(signal.place(), Some((table, address)));
                    used += 1;
                }
            }
        }
        assert_eq!(used, 28_000 + 30_000 + 4000 + 16_448);
        for outside in
            [Di(0), Di(10_001), Uo(1000), Si(1000), So(1001), Wso(1001), R(16_385), R(0), Dynamic(64)]
        {
            assert_eq!(outside.place(), None, "{outside:?}");
        }
    }
}
