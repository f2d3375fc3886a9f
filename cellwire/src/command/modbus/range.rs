//! A run of addresses of one of the four tables.

use core::str::FromStr;

use fanuc_hmi_modbus::{Frame, Reply, Request, Table, limit};
use serde_json::{Value, json};

/// The tables, with their names on the command line and in the output.
pub(super) const TABLES: [(Table, &str); 4] = [
    (Table::Coils, "coils"),
    (Table::DiscreteInputs, "discrete"),
    (Table::InputRegisters, "input"),
    (Table::HoldingRegisters, "holding"),
];

/// A run of addresses: `holding:0-36`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    pub(super) table: Table,
    /// The PDU address of the first item.
    pub(super) first: u16,
    /// The PDU address of the last item.
    pub(super) last: u16,
}

impl Range {
    /// Returns the name of the table.
    pub(super) fn name(&self) -> &'static str {
        TABLES.iter().find(|(table, _)| *table == self.table).map_or("", |(_, name)| name)
    }

    /// Returns the maximum number of values that one request reads.
    pub(super) fn most(&self) -> u16 {
        match self.table {
            Table::Coils | Table::DiscreteInputs => limit::READ_BITS,
            Table::InputRegisters | Table::HoldingRegisters => limit::READ_REGISTERS,
        }
    }

    /// Returns the number of values, at most 65536.
    pub(super) fn count(&self) -> u32 {
        u32::from(self.last) - u32::from(self.first) + 1
    }

    /// Returns the request that reads the whole range, if one request can.
    pub(super) fn request(&self) -> Option<Request<'static>> {
        let (address, quantity) = (self.first, u16::try_from(self.count()).ok()?);
        (quantity <= self.most()).then_some(match self.table {
            Table::Coils => Request::ReadCoils { address, quantity },
            Table::DiscreteInputs => Request::ReadDiscreteInputs { address, quantity },
            Table::InputRegisters => Request::ReadInputRegisters { address, quantity },
            Table::HoldingRegisters => Request::ReadHoldingRegisters { address, quantity },
        })
    }

    /// Splits the range into parts of at most this many addresses.
    pub(super) fn parts(self, most: u16) -> impl Iterator<Item = Self> {
        let step = usize::from(most.max(1));
        (self.first..=self.last).step_by(step).map(move |first| Self {
            first,
            last: first.saturating_add(most.max(1) - 1).min(self.last),
            ..self
        })
    }
}

impl FromStr for Range {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not TABLE:FIRST-LAST, such as holding:0-36, or coils:7");
        let (name, addresses) = text.split_once(':').ok_or_else(wrong)?;
        let found = TABLES.iter().find(|(_, known)| *known == name);
        let (table, _) =
            found.ok_or_else(|| format!("`{name}` is not a table: coils, discrete, input or holding"))?;
        let (first, last) = addresses.split_once('-').unwrap_or((addresses, addresses));
        let number = |text: &str| text.trim().parse::<u16>().map_err(|_| wrong());
        let (first, last) = (number(first)?, number(last)?);
        if first > last {
            return Err(format!("`{text}` ends before it begins"));
        }
        Ok(Self { table: *table, first, last })
    }
}

/// Returns the values in a reply, or a description of another reply.
pub(super) fn values(reply: Frame<Reply<'_>>) -> Result<Vec<Value>, String> {
    match reply.pdu {
        Reply::Coils(bits) | Reply::DiscreteInputs(bits) => Ok(bits.iter().map(|bit| json!(bit)).collect()),
        Reply::HoldingRegisters(words) | Reply::InputRegisters(words) => {
            Ok(words.iter().map(|word| json!(word)).collect())
        }
        Reply::Exception { exception, .. } => Err(exception.to_string()),
        _ => Err("the reply has no values".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_read_and_cut_into_requests() {
        let range: Range = "holding:100-349".parse().unwrap();
        assert_eq!((range.count(), range.request()), (250, None));
        let parts: Vec<(u16, u16)> = range.parts(range.most()).map(|part| (part.first, part.last)).collect();
        assert_eq!(parts, [(100, 224), (225, 349)]);
        let all: Range = "coils:0-65535".parse().unwrap();
        assert_eq!((all.count(), all.parts(2000).last().map(|part| part.last)), (65_536, Some(65_535)));
        let one: Range = "input:7".parse().unwrap();
        assert_eq!(one.request(), Some(Request::ReadInputRegisters { address: 7, quantity: 1 }));
        for (text, error) in [
            ("holding", "`holding` is not TABLE:FIRST-LAST, such as holding:0-36, or coils:7"),
            (
                "holding:0-65536",
                "`holding:0-65536` is not TABLE:FIRST-LAST, such as holding:0-36, or coils:7",
            ),
            ("bits:0", "`bits` is not a table: coils, discrete, input or holding"),
            ("coils:9-8", "`coils:9-8` ends before it begins"),
        ] {
            assert_eq!(text.parse::<Range>(), Err(error.into()));
        }
    }
}
