//! The contents of the holding registers: the assignments of `$SNPX_ASG`, as data.
//!
//! A controller has 80 slots. Each puts a variable into a run of holding registers; where two overlap, the one with the lower
//! number hides the other. The factory's first slot covers 1 to 10000 with `R[1]@1.1`, so any further one below 10000 has no
//! effect until the first is made smaller. A change needs a restart, and `$SNPX_PARAM.$NUM_MODBUS` must not be 0.
//! (From public notes and programs; the source does not show its own assignments.)

use core::fmt;

pub use crate::error::{AssignmentError, ListingError};
use crate::typed::Multiply;

/// The number of slots of a controller.
pub const SLOTS: usize = 80;
/// The last holding register that can be assigned, counted from 1.
pub const LAST_ADDRESS: u16 = 16_384;
/// The length of the longest name of a variable, in characters.
pub const MAX_NAME: usize = 37;

/// One slot of `$SNPX_ASG`.
///
/// ```
/// use fanuc_hmi_modbus::{Assignment, Multiply};
///
/// assert_eq!(Assignment::FACTORY.var_name, "R[1]@1.1");
/// let counter = Assignment { address: 1, size: 2, var_name: "R[1]", multiply: Multiply::new(1.0)? };
/// assert_eq!(counter.check(), Ok(()));
/// assert_eq!(counter.pdu_range(), 0..2);
/// # Ok::<(), fanuc_hmi_modbus::assignment::AssignmentError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Assignment<'a> {
    /// `$ADDRESS`: the first holding register, counted from 1.
    pub address: u16,
    /// `$SIZE`: the number of registers, 1 to 16384.
    pub size: u16,
    /// `$VAR_NAME`: the first variable, at most 37 characters. `R[1]` takes two registers a variable, `R[1]@1.1` one.
    pub var_name: &'a str,
    /// `$MULTIPLY`: the form of a variable in its registers.
    pub multiply: Multiply,
}

impl Assignment<'static> {
    /// The factory's assignment of the first slot: R\[n\] as one signed 16-bit register at PDU address n − 1.
    pub const FACTORY: Self =
        Self { address: 1, size: 10_000, var_name: "R[1]@1.1", multiply: Multiply::Scale(1.0) };

    /// The assignments of the source's Table 2, as public programs suggest: it does not show its own. A life counter of two
    /// registers, an override of one, and seventeen reals.
    pub const TELEMETRY: [Self; 3] = [
        Self { address: 1, size: 2, var_name: "R[1]", multiply: Multiply::Scale(1.0) },
        Self { address: 3, size: 1, var_name: "R[2]@1.1", multiply: Multiply::Scale(1.0) },
        Self { address: 4, size: 34, var_name: "R[3]", multiply: Multiply::Real },
    ];
}

impl Assignment<'_> {
    /// Returns the PDU addresses of the assignment.
    pub const fn pdu_range(&self) -> core::ops::Range<u32> {
        let start = (self.address as u32).saturating_sub(1);
        start..start + self.size as u32
    }

    /// Checks every field separately.
    ///
    /// # Errors
    /// The first field outside its range.
    pub fn check(&self) -> Result<(), AssignmentError> {
        let Self { address, size, var_name, .. } = *self;
        if !(1..=LAST_ADDRESS).contains(&address) {
            return Err(AssignmentError::Address { found: address });
        }
        if !(1..=LAST_ADDRESS).contains(&size) || self.pdu_range().end > LAST_ADDRESS.into() {
            return Err(AssignmentError::Size { address, found: size });
        }
        let printable = var_name.bytes().all(|byte| (b' '..=b'~').contains(&byte) && byte != b'\'');
        if !(1..=MAX_NAME).contains(&var_name.len()) || !printable {
            return Err(AssignmentError::Name { length: var_name.len() });
        }
        self.multiply.check()
    }

    /// Prints the four lines of a slot as the commands that set it: `SETVAR $SNPX_ASG[1].$ADDRESS 1`.
    ///
    /// # Errors
    /// If `out` cannot take them.
    pub fn print(&self, slot: u8, out: &mut impl fmt::Write) -> fmt::Result {
        let Self { address, size, var_name, multiply } = self;
        writeln!(out, "SETVAR $SNPX_ASG[{slot}].$ADDRESS {address}")?;
        writeln!(out, "SETVAR $SNPX_ASG[{slot}].$SIZE {size}")?;
        writeln!(out, "SETVAR $SNPX_ASG[{slot}].$VAR_NAME '{var_name}'")?;
        writeln!(out, "SETVAR $SNPX_ASG[{slot}].$MULTIPLY {}", multiply.value())
    }
}

/// Checks each assignment and that no two overlap, in the order of their slots.
///
/// # Errors
/// The first fault, with the slots, counted from 1, that it concerns.
pub fn check(assignments: &[Assignment<'_>]) -> Result<(), AssignmentError> {
    if assignments.len() > SLOTS {
        return Err(AssignmentError::Slots { found: assignments.len() });
    }
    for (index, assignment) in assignments.iter().enumerate() {
        assignment.check()?;
        let mine = assignment.pdu_range();
        for (earlier, other) in assignments.iter().take(index).enumerate() {
            let theirs = other.pdu_range();
            if mine.start < theirs.end && theirs.start < mine.end {
                let address = u16::try_from(mine.start.max(theirs.start) + 1).unwrap_or(u16::MAX);
                return Err(AssignmentError::Overlap { first: earlier + 1, second: index + 1, address });
            }
        }
    }
    Ok(())
}

/// One line of a listing of `$SNPX_ASG`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting<'a> {
    /// The slot, 1 to 80.
    pub slot: u8,
    /// The field and its value.
    pub field: Field<'a>,
}

/// A field of a slot and its value.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Field<'a> {
    /// `$ADDRESS`: the first holding register, counted from 1.
    Address(u16),
    /// `$SIZE`: the number of registers.
    Size(u16),
    /// `$VAR_NAME`: the first variable; empty in a slot that is not used.
    VarName(&'a str),
    /// `$MULTIPLY`: the form of a variable in its registers.
    Multiply(Multiply),
}

impl<'a> Setting<'a> {
    /// Reads a line of `SYSTEM.VA` (`Field: $SNPX_ASG[1].$ADDRESS Access: RW: SHORT = 1`), or its form as a command (`SETVAR
    /// $SNPX_ASG[1].$ADDRESS 1`, `$SNPX_ASG[1].$ADDRESS = 1`). `None` if the line is about another variable, or the value is
    /// `Uninitialized`.
    ///
    /// # Errors
    /// If the slot, the field or the value does not exist on a controller.
    pub fn parse(line: &'a str) -> Result<Option<Self>, AssignmentError> {
        let Some((_, rest)) = line.split_once("$SNPX_ASG[") else { return Ok(None) };
        let Some((slot, rest)) = rest.split_once("].$") else { return Ok(None) };
        let slot = match slot.trim().parse() {
            Ok(slot @ 1..=80) => slot,
            _ => return Err(AssignmentError::Slot),
        };
        let rest = rest.trim();
        let (name, rest) = rest.split_once(|c: char| c.is_whitespace() || c == '=').unwrap_or((rest, ""));
        // A name in quotes may have a `=` of its own.
        let value = match rest.split_once('=') {
            Some((before, value)) if !before.contains(QUOTES) => value.trim(),
            _ => rest.trim(),
        };
        if value == "Uninitialized" {
            return Ok(None);
        }
        let number = || value.parse::<u16>().map_err(|_| AssignmentError::Value { slot });
        let field = match name {
            "ADDRESS" => Field::Address(number()?),
            "SIZE" => Field::Size(number()?),
            "VAR_NAME" => Field::VarName(unquoted(value)),
            "MULTIPLY" => {
                let value = value.parse::<f32>().map_err(|_| AssignmentError::Value { slot })?;
                Field::Multiply(Multiply::new(value)?)
            }
            _ => return Err(AssignmentError::Value { slot }),
        };
        Ok(Some(Self { slot, field }))
    }
}

/// The quotation marks around the name of a variable, by a controller or a person.
const QUOTES: [char; 2] = ['\'', '"'];

/// Returns a value without one pair of quotes around it.
fn unquoted(value: &str) -> &str {
    QUOTES.iter().find_map(|&quote| value.strip_prefix(quote)?.strip_suffix(quote)).unwrap_or(value)
}

/// All slots, as a listing fills them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slots<'a> {
    slots: [Assignment<'a>; SLOTS],
}

impl<'a> Slots<'a> {
    /// Reads a listing; lines about other variables are skipped.
    ///
    /// # Errors
    /// The first line about `$SNPX_ASG` that cannot be read.
    pub fn parse(text: &'a str) -> Result<Self, ListingError> {
        let mut all = Self::default();
        for (line, text) in (1..).zip(text.lines()) {
            if let Some(Setting { slot, field }) =
                Setting::parse(text).map_err(|error| ListingError { line, error })?
                && let Some(slot) = all.slots.get_mut(usize::from(slot) - 1)
            {
                match field {
                    Field::Address(address) => slot.address = address,
                    Field::Size(size) => slot.size = size,
                    Field::VarName(name) => slot.var_name = name,
                    Field::Multiply(multiply) => slot.multiply = multiply,
                }
            }
        }
        Ok(all)
    }

    /// Returns the used slots, with their numbers.
    pub fn used(&self) -> impl Iterator<Item = (u8, &Assignment<'a>)> {
        (1..).zip(&self.slots).filter(|(_, slot)| slot.size > 0 && !slot.var_name.is_empty())
    }
}

impl Default for Slots<'_> {
    fn default() -> Self {
        let empty = Assignment { address: 0, size: 0, var_name: "", multiply: Multiply::Scale(1.0) };
        Self { slots: [empty; SLOTS] }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::String;

    use super::*;

    const LISTING: &str = "\
[*SYSTEM*]$SNPX_ASG  Storage: CMOS  Access: RW  : ARRAY[80] OF SNPX_ASG_T
     Field: $SNPX_ASG[1].$ADDRESS Access: RW: SHORT = 1
     Field: $SNPX_ASG[1].$SIZE Access: RW: SHORT = 10000
     Field: $SNPX_ASG[1].$VAR_NAME Access: RW: STRING[37] = 'R[1]@1.1'
     Field: $SNPX_ASG[1].$MULTIPLY Access: RW: REAL = 1.000000e+00
     Field: $SNPX_ASG[2].$ADDRESS Access: RW: SHORT = 0
     Field: $SNPX_ASG[2].$SIZE Access: RW: SHORT = 0
     Field: $SNPX_ASG[2].$VAR_NAME Access: RW: STRING[37] = ''
     Field: $SNPX_ASG[2].$MULTIPLY Access: RW: REAL = Uninitialized

[*SYSTEM*]$SNPX_PARAM  Storage: CMOS  Access: FP  : SNPX_PARAM_T =
   Field: $SNPX_PARAM.$TIMEOUT Access: RW: INTEGER = 5000
";

    #[test]
    fn a_listing_of_a_controller_is_read_and_printed_as_commands() {
        let slots = Slots::parse(LISTING).unwrap();
        let used: std::vec::Vec<_> = slots.used().collect();
        assert_eq!(used, [(1, &Assignment::FACTORY)]);
        let mut printed = String::new();
        Assignment::FACTORY.print(1, &mut printed).unwrap();
        assert_eq!(
            printed,
            "SETVAR $SNPX_ASG[1].$ADDRESS 1\nSETVAR $SNPX_ASG[1].$SIZE 10000\n\
             SETVAR $SNPX_ASG[1].$VAR_NAME 'R[1]@1.1'\nSETVAR $SNPX_ASG[1].$MULTIPLY 1\n"
        );
        assert_eq!(Slots::parse(&printed).unwrap().used().collect::<std::vec::Vec<_>>(), used);
    }

    #[test]
    fn a_slot_is_used_when_it_has_a_size_and_a_name() {
        let lines = "$SNPX_ASG[1].$SIZE=2\n$SNPX_ASG[2].$VAR_NAME='R[1]'\n\
                     $SNPX_ASG[3].$SIZE=1\n$SNPX_ASG[3].$VAR_NAME='R[1]'";
        let slots = Slots::parse(lines).unwrap();
        assert!(slots.used().map(|(slot, _)| slot).eq([3]));
    }

    #[test]
    fn a_line_may_be_written_as_it_is_set() {
        for line in ["SETVAR $SNPX_ASG[2].$ADDRESS 2001", "$SNPX_ASG[2].$ADDRESS=2001"] {
            assert_eq!(
                Setting::parse(line),
                Ok(Some(Setting { slot: 2, field: Field::Address(2001) })),
                "{line}"
            );
        }
        let line = "SETVAR $SNPX_ASG[80].$VAR_NAME \"SR[1]\"";
        assert_eq!(Setting::parse(line), Ok(Some(Setting { slot: 80, field: Field::VarName("SR[1]") })));
        assert_eq!(Setting::parse("SETVAR $SNPX_PARAM.$NUM_MODBUS 4"), Ok(None));
        assert_eq!(Setting::parse("SETVAR $SNPX_ASG[81].$SIZE 1"), Err(AssignmentError::Slot));
        assert_eq!(Setting::parse("SETVAR $SNPX_ASG[0].$SIZE 1"), Err(AssignmentError::Slot));
        assert_eq!(Setting::parse("SETVAR $SNPX_ASG[3].$SIZE -1"), Err(AssignmentError::Value { slot: 3 }));
        assert_eq!(Setting::parse("SETVAR $SNPX_ASG[3].$COLOR 1"), Err(AssignmentError::Value { slot: 3 }));
        let error = Slots::parse("\nSETVAR $SNPX_ASG[3].$MULTIPLY 0.00001").unwrap_err();
        assert_eq!(error, ListingError { line: 2, error: AssignmentError::Multiply { found: 0.00001 } });
    }

    #[test]
    fn a_name_keeps_what_is_within_its_quotes() {
        for name in ["R[1] = 2", "\"R[1]\"", "\"", "=", " R[1]"] {
            let slot = Assignment { var_name: name, ..Assignment::FACTORY };
            let mut printed = String::new();
            slot.print(1, &mut printed).unwrap();
            let listed = std::format!("Field: $SNPX_ASG[1].$VAR_NAME Access: RW: STRING[37] = '{name}'");
            assert_eq!(Slots::parse(&printed).unwrap().used().next(), Some((1, &slot)));
            assert_eq!(Setting::parse(&listed).unwrap().unwrap().field, Field::VarName(name));
        }
    }

    #[test]
    fn every_range_is_checked_at_its_border() {
        let one = Assignment { address: 16_384, size: 1, ..Assignment::FACTORY };
        assert_eq!(one.check(), Ok(()));
        let size = |address, found| Err(AssignmentError::Size { address, found });
        assert_eq!(Assignment { size: 2, ..one }.check(), size(16_384, 2));
        assert_eq!(Assignment { size: 0, ..one }.check(), size(16_384, 0));
        assert_eq!(Assignment { address: 1, size: 16_384, ..one }.check(), Ok(()));
        assert_eq!(Assignment { address: 1, size: 16_385, ..one }.check(), size(1, 16_385));
        assert_eq!(Assignment { address: 0, ..one }.check(), Err(AssignmentError::Address { found: 0 }));
        let address = Err(AssignmentError::Address { found: 16_385 });
        assert_eq!(Assignment { address: 16_385, ..one }.check(), address);
        let name = |length| Err(AssignmentError::Name { length });
        let long = "N".repeat(38);
        assert_eq!(Assignment { var_name: &long[..37], ..one }.check(), Ok(()));
        assert_eq!(Assignment { var_name: &long, ..one }.check(), name(38));
        assert_eq!(Assignment { var_name: "", ..one }.check(), name(0));
        assert_eq!(Assignment { var_name: "it's", ..one }.check(), name(4));
    }

    #[test]
    fn the_factory_slot_hides_what_comes_after_it() {
        let [counter, ..] = Assignment::TELEMETRY;
        let error = check(&[Assignment::FACTORY, counter]).unwrap_err();
        assert_eq!(error, AssignmentError::Overlap { first: 1, second: 2, address: 1 });
        assert_eq!(std::format!("{error}"), "assignment 1 hides assignment 2 at register 1");
        assert_eq!(check(&Assignment::TELEMETRY), Ok(()));
        let rest = Assignment { address: 38, size: 16_347, ..Assignment::FACTORY };
        let [a, b, c] = Assignment::TELEMETRY;
        assert_eq!(check(&[a, b, c, rest]), Ok(()));
        assert_eq!(check(&[rest, c, b, a]), Ok(()), "in any order");
        let touching = Assignment { address: 37, ..rest };
        assert_eq!(check(&[c, touching]), Err(AssignmentError::Overlap { first: 1, second: 2, address: 37 }));
        assert_eq!(check(&[rest; 81]), Err(AssignmentError::Slots { found: 81 }));
    }

    #[test]
    fn the_telemetry_assignments_cover_its_37_registers_without_a_hole() {
        let mut next = 0;
        for assignment in Assignment::TELEMETRY {
            assert_eq!(assignment.pdu_range().start, next);
            next = assignment.pdu_range().end;
        }
        assert_eq!(next, 37);
    }
}
