//! The four tables of a simulated controller, as the source's Table 1 has them.

use fanuc_hmi_modbus::{Bits, BitsMut, Exception, Registers, Signal, Table, Words, WordsMut};

/// Every address that Table 1 uses.
#[derive(Debug, Clone)]
pub struct Tables {
    discrete_inputs: Vec<bool>,
    coils: Vec<bool>,
    input_registers: Vec<u16>,
    /// The holding registers, from PDU address 0 on. A test puts a position register there by
    /// [`PositionRegister::to_registers`](fanuc_hmi_modbus::PositionRegister::to_registers).
    pub holding_registers: Vec<u16>,
}

impl Tables {
    /// Returns the number of addresses of a table, from 0 on.
    pub fn len(table: Table) -> usize {
        used(table)
    }

    /// Creates tables in which input signal n is on if n is a multiple of 3, an input register contains its address as Table
    /// 1 counts it, and R\[n\] contains n: so an address that is off by one shows at once.
    pub fn numbered() -> Self {
        let numbers = |table| (1..=used(table)).map(|n| u16::try_from(n).unwrap_or_default());
        Self {
            discrete_inputs: numbers(Table::DiscreteInputs).map(|n| n % 3 == 0).collect(),
            coils: vec![false; used(Table::Coils)],
            input_registers: numbers(Table::InputRegisters).collect(),
            holding_registers: numbers(Table::HoldingRegisters)
                .map(|n| match Signal::at(Table::HoldingRegisters, n - 1) {
                    Some(Signal::R(n)) => n,
                    _ => 0,
                })
                .collect(),
        }
    }

    /// Creates tables with all signals off and all registers 0.
    pub fn empty() -> Self {
        Self {
            discrete_inputs: vec![false; used(Table::DiscreteInputs)],
            coils: vec![false; used(Table::Coils)],
            input_registers: vec![0; used(Table::InputRegisters)],
            holding_registers: vec![0; used(Table::HoldingRegisters)],
        }
    }

    /// Returns the value of a signal, 0 or 1 for a bit.
    pub fn signal(&self, signal: Signal) -> Option<u16> {
        let (table, address) = signal.place()?;
        let address = usize::from(address);
        match table {
            Table::DiscreteInputs => self.discrete_inputs.get(address).map(|bit| u16::from(*bit)),
            Table::Coils => self.coils.get(address).map(|bit| u16::from(*bit)),
            Table::InputRegisters => self.input_registers.get(address).copied(),
            Table::HoldingRegisters => self.holding_registers.get(address).copied(),
        }
    }

    /// Gives a signal a value, 0 or 1 to a bit.
    pub fn set_signal(&mut self, signal: Signal, value: u16) -> Option<()> {
        let (table, address) = signal.place()?;
        let address = usize::from(address);
        match table {
            Table::DiscreteInputs => *self.discrete_inputs.get_mut(address)? = value != 0,
            Table::Coils => *self.coils.get_mut(address)? = value != 0,
            Table::InputRegisters => *self.input_registers.get_mut(address)? = value,
            Table::HoldingRegisters => *self.holding_registers.get_mut(address)? = value,
        }
        Some(())
    }
}

/// Returns the number of used addresses of a table, which begin at 0.
fn used(table: Table) -> usize {
    match table {
        Table::DiscreteInputs => 28_000,
        Table::Coils => 30_000,
        Table::InputRegisters => 4000,
        Table::HoldingRegisters => 16_448,
    }
}

fn run<T>(all: &[T], address: u16, len: usize) -> Result<&[T], Exception> {
    all.get(address.into()..usize::from(address) + len).ok_or(Exception::IllegalDataAddress)
}

fn run_mut<T>(all: &mut [T], address: u16, len: usize) -> Result<&mut [T], Exception> {
    all.get_mut(address.into()..usize::from(address) + len).ok_or(Exception::IllegalDataAddress)
}

fn show(bits: &[bool], out: &mut BitsMut<'_>) {
    for (index, bit) in bits.iter().enumerate() {
        out.set(index, *bit);
    }
}

impl Registers for Tables {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        show(run(&self.coils, address, out.len())?, out);
        Ok(())
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        show(run(&self.discrete_inputs, address, out.len())?, out);
        Ok(())
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(run(&self.holding_registers, address, out.len())?);
        Ok(())
    }

    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(run(&self.input_registers, address, out.len())?);
        Ok(())
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        values.copy_to(run_mut(&mut self.coils, address, values.len())?);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(run_mut(&mut self.holding_registers, address, values.len())?);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_end_where_table_1_says_not_used() {
        for table in [Table::DiscreteInputs, Table::Coils, Table::InputRegisters, Table::HoldingRegisters] {
            let end = u16::try_from(used(table)).unwrap();
            assert!(Signal::at(table, end - 1).is_some(), "{table:?}");
            assert_eq!(Signal::at(table, end), None, "{table:?}");
        }
    }
}
