//! `$SNPX_ASG`: which variables the holding registers show.

use core::ops::Range;

use anyhow::{Context, Result, bail};
use fanuc_hmi_modbus::assignment::Slots;
use fanuc_hmi_modbus::typed::{Kind, Number};
use fanuc_hmi_modbus::{Assignment, Multiply, PositionRegister, WordOrder, text};

use super::program::{Memory, RobotPosition};

/// The assignments of a controller that runs a program.
#[derive(Debug, Clone)]
pub struct Mapping {
    areas: Vec<Area>,
    order: WordOrder,
}

/// A slot.
#[derive(Debug, Clone)]
struct Area {
    registers: Range<usize>,
    variable: Variable,
    /// The number of the first.
    first: u32,
}

#[derive(Debug, Clone, Copy)]
enum Variable {
    /// R\[n\].
    Number(Kind, Multiply),
    /// PR\[n\], 50 registers each.
    Position,
    /// SR\[n\], 40 registers each.
    Text,
    /// `POS[0]`: where the robot is.
    Here,
}

impl Mapping {
    /// Returns the mapping with the telemetry block of a task whose registers begin with `R[first]`, followed by R\[n\] as
    /// 16-bit integers at PDU address n - 1, the factory's default.
    ///
    /// # Errors
    /// None.
    pub fn telemetry(first: u16, order: WordOrder) -> Result<Self> {
        let mut lines = String::new();
        let names = [
            format!("R[{first}]"),
            format!("R[{}]@1.1", first + 1),
            format!("R[{}]", first + 2),
            "R[38]@1.1".into(),
        ];
        let rest = Assignment { address: 38, size: 16_347, ..Assignment::FACTORY };
        for ((slot, name), assignment) in
            (1..).zip(&names).zip(Assignment::TELEMETRY.into_iter().chain([rest]))
        {
            Assignment { var_name: name, ..assignment }.print(slot, &mut lines)?;
        }
        Self::parse(&lines, order)
    }

    /// Reads a listing of `$SNPX_ASG`: lines of SYSTEM.VA, or `SETVAR` lines.
    ///
    /// # Errors
    /// A line that cannot be read, a slot out of range, a variable that is not modelled, or two slots with the same register.
    pub fn parse(listing: &str, order: WordOrder) -> Result<Self> {
        let slots = Slots::parse(listing)?;
        let (mut areas, mut earlier): (Vec<Area>, Vec<_>) = (Vec::new(), Vec::new());
        for (slot, assignment) in slots.used() {
            assignment.check().with_context(|| format!("slot {slot}"))?;
            let range = assignment.pdu_range();
            let overlap = earlier.iter().find_map(|(other, of): &(u8, &Assignment<'_>)| {
                let (start, end) = (range.start.max(of.pdu_range().start), range.end.min(of.pdu_range().end));
                (start < end).then_some((other, of.var_name, start + 1))
            });
            if let Some((other, name, address)) = overlap {
                bail!(
                    "slots {other} ({name}) and {slot} ({}) overlap from $ADDRESS {address}: a controller shows one of them",
                    assignment.var_name
                );
            }
            areas.push(Area::of(assignment).with_context(|| format!("slot {slot}"))?);
            earlier.push((slot, assignment));
        }
        if areas.is_empty() {
            bail!("there is no assignment; expected lines such as `SETVAR $SNPX_ASG[1].$ADDRESS 1`");
        }
        Ok(Self { areas, order })
    }

    /// Returns the first of these registers that no assignment covers.
    pub fn first_unassigned(&self, mut registers: Range<usize>) -> Option<usize> {
        registers.find(|register| !self.areas.iter().any(|area| area.registers.contains(register)))
    }

    /// Returns the register that shows R\[n\] as a whole number of 16 bits.
    pub fn register(&self, number: u16) -> Option<u16> {
        self.areas.iter().find_map(|area| {
            let Variable::Number(Kind::Int16, _) = area.variable else { return None };
            let behind = u32::from(number).checked_sub(area.first)?;
            let register = area.registers.start.checked_add(usize::try_from(behind).ok()?)?;
            area.registers.contains(&register).then(|| u16::try_from(register).ok()).flatten()
        })
    }

    /// Puts the variables into the registers.
    pub fn show(&self, memory: &Memory, here: &RobotPosition, registers: &mut [u16]) {
        for area in &self.areas {
            if let Some(words) = registers.get_mut(area.registers.clone()) {
                area.show(memory, here, self.order, words);
            }
        }
    }

    /// Copies the values that a client has written to some registers into the variables.
    pub fn take(&self, written: Range<usize>, registers: &[u16], memory: &mut Memory) {
        for area in &self.areas {
            if let Some(words) = registers.get(area.registers.clone()) {
                area.take(&written, words, self.order, memory);
            }
        }
    }
}

impl Area {
    fn of(assignment: &Assignment<'_>) -> Result<Self> {
        let Assignment { var_name, multiply, .. } = *assignment;
        let range = assignment.pdu_range();
        let registers = usize::try_from(range.start)?..usize::try_from(range.end)?;
        let (name, part) =
            var_name.split_once('@').map_or((var_name, None), |(name, part)| (name, Some(part)));
        let number = |letters: &str| -> Option<u32> {
            name.trim().strip_prefix(letters)?.strip_prefix('[')?.strip_suffix(']')?.parse().ok()
        };
        let (variable, first) = if let Some(n) = number("R") {
            let kind = match (part, multiply) {
                (Some("1.1"), Multiply::Scale(_)) => Kind::Int16,
                (None, Multiply::Scale(_)) => Kind::Int32,
                (None, Multiply::Real) => Kind::Float32,
                _ => bail!("{var_name} with this multiply is not modelled"),
            };
            (Variable::Number(kind, multiply), n)
        } else if let (Some(n), Multiply::Real, None) = (number("PR"), multiply, part) {
            (Variable::Position, n)
        } else if let (Some(n), Multiply::Text, None) = (number("SR"), multiply, part) {
            (Variable::Text, n)
        } else if let (Some(0), Multiply::Real, None) = (number("POS"), multiply, part) {
            (Variable::Here, 0)
        } else {
            bail!(
                "{var_name} is not modelled: supported are R[n], R[n]@1.1, PR[n] and POS[0] with multiply 0, SR[n] with multiply -1"
            )
        };
        Ok(Self { registers, variable, first })
    }

    /// Returns the number of registers that one variable takes.
    fn each(&self) -> usize {
        match self.variable {
            Variable::Number(kind, _) => kind.registers().into(),
            Variable::Position | Variable::Here => PositionRegister::QUANTITY.into(),
            Variable::Text => text::REGISTERS,
        }
    }

    fn show(&self, memory: &Memory, here: &RobotPosition, order: WordOrder, words: &mut [u16]) {
        let each = self.each();
        match self.variable {
            Variable::Number(kind, multiply) => {
                // Most of an area's thousands of registers were never written.
                words.fill(0);
                let number = Number { kind, multiply, order };
                for (n, value) in memory.numbers.range(self.first..) {
                    let Some(words) = words.chunks_mut(each).nth((n - self.first) as usize) else { break };
                    words.iter_mut().zip(encoded(number, *value)).for_each(|(word, shown)| *word = shown);
                }
            }
            Variable::Position | Variable::Here => {
                for (n, words) in (self.first..).zip(words.chunks_mut(each)) {
                    let place = match self.variable {
                        Variable::Here => Some(here),
                        _ => memory.positions.get(&n),
                    };
                    let register = place.map_or(PositionRegister::default(), RobotPosition::register);
                    words
                        .iter_mut()
                        .zip(register.to_registers(order))
                        .for_each(|(word, shown)| *word = shown);
                }
            }
            Variable::Text => {
                for (n, words) in (self.first..).zip(words.chunks_mut(each)) {
                    let bytes = memory.strings.get(&n).map_or(&[][..], |string| string.as_bytes());
                    let room = bytes.len().min(2 * words.len());
                    if text::write(bytes.get(..room).unwrap_or_default(), words).is_err() {
                        words.fill(0);
                    }
                }
            }
        }
    }

    fn take(&self, written: &Range<usize>, words: &[u16], order: WordOrder, memory: &mut Memory) {
        let each = self.each();
        for ((n, words), at) in
            (self.first..).zip(words.chunks(each)).zip((self.registers.start..).step_by(each))
        {
            if at >= written.end || at + words.len() <= written.start {
                continue;
            }
            match self.variable {
                Variable::Number(kind, multiply) => {
                    let word = |index| words.get(index).copied().unwrap_or(0);
                    let value = Number { kind, multiply, order }.read([word(0), word(1)]);
                    memory.numbers.insert(n, value);
                }
                Variable::Position => {
                    let register =
                        words.first_chunk().map(|words| PositionRegister::from_registers(words, order));
                    if let Some(place) = register.as_ref().and_then(RobotPosition::of_register) {
                        memory.positions.insert(n, place);
                    }
                }
                Variable::Text => {
                    let mut bytes = vec![0; 2 * words.len()];
                    let length = text::read(words, &mut bytes);
                    bytes.truncate(length);
                    memory.strings.insert(n, String::from_utf8_lossy(&bytes).into_owned());
                }
                Variable::Here => {} // where the robot is cannot be written
            }
        }
    }
}

/// Returns a number in its registers; for a number that is too large, its low bits, as in a controller with 16-bit
/// registers.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "that is the case")]
fn encoded(number: Number, value: f64) -> [u16; 2] {
    number.write(value).unwrap_or_else(|_| match number.kind {
        Kind::Int16 => [(value * f64::from(number.multiply.value())) as i64 as u16, 0],
        Kind::Int32 => number.order.split((value * f64::from(number.multiply.value())) as i64 as u32),
        Kind::Float32 => number.order.split((value as f32).to_bits()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTING: &str = "\
SETVAR $SNPX_ASG[1].$ADDRESS 1
SETVAR $SNPX_ASG[1].$SIZE 2
SETVAR $SNPX_ASG[1].$VAR_NAME 'R[5]'
SETVAR $SNPX_ASG[1].$MULTIPLY 0
SETVAR $SNPX_ASG[2].$ADDRESS 3
SETVAR $SNPX_ASG[2].$SIZE 98
SETVAR $SNPX_ASG[2].$VAR_NAME 'R[3]@1.1'
SETVAR $SNPX_ASG[2].$MULTIPLY 10
SETVAR $SNPX_ASG[3].$ADDRESS 101
SETVAR $SNPX_ASG[3].$SIZE 100
SETVAR $SNPX_ASG[3].$VAR_NAME 'PR[2]'
SETVAR $SNPX_ASG[3].$MULTIPLY 0
SETVAR $SNPX_ASG[4].$ADDRESS 201
SETVAR $SNPX_ASG[4].$SIZE 5
SETVAR $SNPX_ASG[4].$VAR_NAME 'SR[1]'
SETVAR $SNPX_ASG[4].$MULTIPLY -1
";

    #[test]
    fn variables_are_shown_and_taken_where_the_slots_say() {
        let mapping = Mapping::parse(LISTING, WordOrder::LowFirst).unwrap();
        let mut memory = Memory::default();
        memory.numbers.extend([(3, 12.3), (4, 5000.0), (5, 0.5)]);
        memory.positions.insert(3, RobotPosition::Joints([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        memory.strings.insert(1, "PART".into());
        let mut registers = vec![0; 300];
        mapping.show(&memory, &RobotPosition::default(), &mut registers);
        assert_eq!(registers[..5], [0, 0x3F00, 123, 50_000, 5]);
        assert_eq!(registers[150 + 44], 1, "PR[3] has joints");
        assert_eq!(registers[200..203], [0x5041, 0x5254, 0]);
        // A client writes R[4], and writes PR[2] with the value of PR[3].
        registers[3] = (-25_i16).cast_unsigned();
        mapping.take(3..4, &registers, &mut memory);
        assert_eq!((memory.numbers[&4], memory.numbers[&3]), (-2.5, 12.3));
        registers.copy_within(150..200, 100);
        mapping.take(100..150, &registers, &mut memory);
        assert_eq!(memory.positions[&2], memory.positions[&3]);
        registers[1] = 0x4000; // 2.0
        mapping.take(0..2, &registers, &mut memory);
        assert_eq!(memory.numbers[&5], 2.0);
        assert_eq!(mapping.first_unassigned(0..200), None);
        assert_eq!(mapping.first_unassigned(199..300), Some(205));
    }

    #[test]
    fn two_slots_with_the_same_register_are_refused_by_their_names() {
        let overlap = LISTING.replace("[4].$ADDRESS 201", "[4].$ADDRESS 200");
        let error = Mapping::parse(&overlap, WordOrder::LowFirst).unwrap_err().to_string();
        assert_eq!(
            error,
            "slots 3 (PR[2]) and 4 (SR[1]) overlap from $ADDRESS 200: a controller shows one of them"
        );
    }

    /// `$SIZE` 85: all of SR[3] and SR[4], and the first ten characters of SR[5].
    #[test]
    fn a_string_takes_forty_registers_and_the_next_one_follows() {
        let listing = "SETVAR $SNPX_ASG[1].$ADDRESS 1\nSETVAR $SNPX_ASG[1].$SIZE 85\n\
                       SETVAR $SNPX_ASG[1].$VAR_NAME 'SR[3]'\nSETVAR $SNPX_ASG[1].$MULTIPLY -1\n";
        let mapping = Mapping::parse(listing, WordOrder::LowFirst).unwrap();
        let mut memory = Memory::default();
        let strings = [(3, "A".repeat(81)), (4, "PART".into()), (5, "0123456789AB".into()), (6, "NO".into())];
        memory.strings.extend(strings);
        let mut registers = vec![0; 300];
        mapping.show(&memory, &RobotPosition::default(), &mut registers);
        assert_eq!(registers[..40], [0x4141; 40]);
        assert_eq!(registers[40..43], [0x5041, 0x5254, 0]);
        assert_eq!(registers[80..86], [0x3031, 0x3233, 0x3435, 0x3637, 0x3839, 0]);
        registers[41] = 0x4500; // a client writes "PAE" into SR[4]
        mapping.take(41..42, &registers, &mut memory);
        assert_eq!((memory.strings[&4].as_str(), memory.strings[&5].len()), ("PAE", 12));
    }

    #[test]
    fn what_is_not_modelled_is_refused_with_its_slot() {
        let other = LISTING.replace("'SR[1]'", "'ALM[1]'");
        let error = format!("{:#}", Mapping::parse(&other, WordOrder::LowFirst).unwrap_err());
        assert!(error.starts_with("slot 4: ALM[1] is not modelled: supported are R[n], "), "{error}");
        let error = format!(
            "{:#}",
            Mapping::parse("\nSETVAR $SNPX_ASG[99].$SIZE 1", WordOrder::LowFirst).unwrap_err()
        );
        assert_eq!(error, "line 2: the slot is not within 1 to 80");
        let other_file = Mapping::parse("/PROG MOVE\n/END\n", WordOrder::LowFirst).unwrap_err().to_string();
        assert!(other_file.starts_with("there is no assignment; expected lines such as"), "{other_file}");
        let telemetry = Mapping::telemetry(1, WordOrder::LowFirst).unwrap();
        let mut memory = Memory::default();
        memory.numbers.extend([(1, 100_000.0), (2, 100.0), (3, 1.0), (40, 7.0)]);
        let mut registers = vec![0; 16_448];
        telemetry.show(&memory, &RobotPosition::default(), &mut registers);
        assert_eq!(registers[..5], [0x86A0, 1, 100, 0, 0x3F80]);
        assert_eq!(registers[39], 7);
    }
}
