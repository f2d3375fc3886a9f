//! Which signal of the robot is where in the Modbus tables (the source's Table 1), both ways.
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
    /// Register 0 to 63 of the area for "dynamic assignment", 16385 to 16448 in Table 1. What to do with it is documented nowhere.
    Dynamic(u16),
}

impl Signal {
    /// Its table and PDU address; `None` when the number is outside its range.
    pub const fn place(self) -> Option<(Table, u16)> {
        let (kind, number) = self.split();
        let range = kind.range();
        if number < range.first || number - range.first > range.last_address - range.first_address {
            return None;
        }
        Some((range.table, range.first_address + (number - range.first)))
    }

    /// The signal at a PDU address; `None` where Table 1 has "not used".
    pub fn at(table: Table, address: u16) -> Option<Self> {
        Kind::ALL.into_iter().find_map(|kind| {
            let range = kind.range();
            let here = range.table == table && (range.first_address..=range.last_address).contains(&address);
            here.then(|| kind.signal(range.first + (address - range.first_address)))
        })
    }

    const fn split(self) -> (Kind, u16) {
        match self {
            Self::Di(n) => (Kind::Di, n),
            Self::Ri(n) => (Kind::Ri, n),
            Self::Ui(n) => (Kind::Ui, n),
            Self::Uo(n) => (Kind::Uo, n),
            Self::Si(n) => (Kind::Si, n),
            Self::So(n) => (Kind::So, n),
            Self::Wi(n) => (Kind::Wi, n),
            Self::Wo(n) => (Kind::Wo, n),
            Self::Wsi(n) => (Kind::Wsi, n),
            Self::Wso(n) => (Kind::Wso, n),
            Self::Do(n) => (Kind::Do, n),
            Self::Ro(n) => (Kind::Ro, n),
            Self::Flag(n) => (Kind::Flag, n),
            Self::Gi(n) => (Kind::Gi, n),
            Self::Go(n) => (Kind::Go, n),
            Self::Ai(n) => (Kind::Ai, n),
            Self::Ao(n) => (Kind::Ao, n),
            Self::R(n) => (Kind::R, n),
            Self::Dynamic(n) => (Kind::Dynamic, n),
        }
    }
}

/// A row of Table 1.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Di,
    Ri,
    Ui,
    Uo,
    Si,
    So,
    Wi,
    Wo,
    Wsi,
    Wso,
    Do,
    Ro,
    Flag,
    Gi,
    Go,
    Ai,
    Ao,
    R,
    Dynamic,
}

struct Row {
    table: Table,
    first_address: u16,
    last_address: u16,
    /// The number of the signal at the first address.
    first: u16,
}

impl Kind {
    const ALL: [Self; 19] = [
        Self::Di,
        Self::Ri,
        Self::Ui,
        Self::Uo,
        Self::Si,
        Self::So,
        Self::Wi,
        Self::Wo,
        Self::Wsi,
        Self::Wso,
        Self::Do,
        Self::Ro,
        Self::Flag,
        Self::Gi,
        Self::Go,
        Self::Ai,
        Self::Ao,
        Self::R,
        Self::Dynamic,
    ];

    /// The numbers are those of Table 1: the first and last address, counted from 1, and the signal at the first.
    const fn range(self) -> Row {
        use Table::{Coils, DiscreteInputs, HoldingRegisters, InputRegisters};
        let (table, first_address, last_address, first) = match self {
            Self::Di => (DiscreteInputs, 1, 10_000, 1),
            Self::Ri => (DiscreteInputs, 10_001, 20_000, 1),
            Self::Ui => (DiscreteInputs, 20_001, 21_000, 1),
            Self::Uo => (DiscreteInputs, 21_001, 21_999, 1),
            Self::Si => (DiscreteInputs, 22_000, 22_999, 0),
            Self::So => (DiscreteInputs, 23_000, 24_000, 0),
            Self::Wi => (DiscreteInputs, 24_001, 25_000, 1),
            Self::Wo => (DiscreteInputs, 25_001, 26_000, 1),
            Self::Wsi => (DiscreteInputs, 26_001, 27_000, 1),
            Self::Wso => (DiscreteInputs, 27_001, 28_000, 1),
            Self::Do => (Coils, 1, 10_000, 1),
            Self::Ro => (Coils, 10_001, 20_000, 1),
            Self::Flag => (Coils, 20_001, 30_000, 1),
            Self::Gi => (InputRegisters, 1, 1000, 1),
            Self::Go => (InputRegisters, 1001, 2000, 1),
            Self::Ai => (InputRegisters, 2001, 3000, 1),
            Self::Ao => (InputRegisters, 3001, 4000, 1),
            Self::R => (HoldingRegisters, 1, 16_384, 1),
            Self::Dynamic => (HoldingRegisters, 16_385, 16_448, 0),
        };
        Row { table, first_address: first_address - 1, last_address: last_address - 1, first }
    }

    const fn signal(self, n: u16) -> Signal {
        match self {
            Self::Di => Signal::Di(n),
            Self::Ri => Signal::Ri(n),
            Self::Ui => Signal::Ui(n),
            Self::Uo => Signal::Uo(n),
            Self::Si => Signal::Si(n),
            Self::So => Signal::So(n),
            Self::Wi => Signal::Wi(n),
            Self::Wo => Signal::Wo(n),
            Self::Wsi => Signal::Wsi(n),
            Self::Wso => Signal::Wso(n),
            Self::Do => Signal::Do(n),
            Self::Ro => Signal::Ro(n),
            Self::Flag => Signal::Flag(n),
            Self::Gi => Signal::Gi(n),
            Self::Go => Signal::Go(n),
            Self::Ai => Signal::Ai(n),
            Self::Ao => Signal::Ao(n),
            Self::R => Signal::R(n),
            Self::Dynamic => Signal::Dynamic(n),
        }
    }
}

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
