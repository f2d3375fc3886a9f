//! Programs of the feature `arbitrary`: each can be written, and reads as the same.

use core::fmt::Debug;
use std::collections::BTreeSet;

use arbitrary::{Arbitrary, Unstructured};
use fanuc_ls::{
    Attribute, AttributeValue, Configuration, Instruction, Motion, Position, Program, Rules, Speed,
    SpeedUnit, Termination,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

/// The kinds of parts that programs have, each once.
#[derive(Default)]
struct Kinds(BTreeSet<String>);

impl Kinds {
    fn add(&mut self, of: &str, kind: impl Debug) {
        self.0.insert(format!("{of}: {kind:?}"));
    }

    /// Adds the name of a variant alone.
    fn add_name(&mut self, of: &str, value: &impl Debug) {
        let debug = format!("{value:?}");
        self.0.insert(format!("{of}: {}", debug.split([' ', '(']).next().unwrap()));
    }

    fn add_instruction(&mut self, instruction: &Instruction) {
        self.add_name("instruction", instruction);
        match instruction {
            Instruction::Motion(motion) => self.add_motion(motion),
            Instruction::Comment(text) => {
                let (blank, end) = (text.starts_with(' '), text.ends_with(';'));
                self.add("comment", (blank, end, text.lines().count()));
            }
            Instruction::Other(text) => {
                self.add("statement", (text.split([' ', '[', '=']).next(), text.ends_with("(sec)")));
            }
            _ => {}
        }
    }

    fn add_motion(&mut self, motion: &Motion) {
        self.add("moves", motion.kind);
        self.add_name("target", &motion.target);
        motion.via.iter().for_each(|via| self.add_name("via", via));
        self.add("via options", motion.via_options.is_empty());
        self.add("options", motion.options.lines().count());
        for option in motion.each_option() {
            self.add("option", option.trim_end_matches(|c: char| c.is_ascii_digit() || c == ']'));
        }
        self.add_name("speed", &motion.speed);
        self.add("unit", motion.speed.unit());
        if let Speed::Fixed { value, unit } = motion.speed {
            let is_percent = unit == SpeedUnit::Percent;
            let most = if is_percent { 100.0 } else { 100_000.0 };
            self.add("speed", (is_percent, value.fract() == 0.0, value > most / 2.0));
        }
        match motion.termination {
            Some(Termination::Continuous(percent)) => self.add("ends", percent / 25),
            ref termination => {
                self.add_name("ends", &termination.as_ref().map(|it| format!("{it:?}").len() > 4))
            }
        }
    }

    fn add_position(&mut self, position: &Position) {
        self.add("position", position.name.as_ref().map(|name| name.chars().count()));
        self.add("groups", position.groups.len());
        for group in &position.groups {
            if let Some(Configuration { keyword, text }) = &group.configuration {
                self.add("configuration", (keyword, &text[..5]));
            }
            self.add("axes", group.axes.len());
            for axis in &group.axes {
                self.add("axis", axis.name);
                self.add("unit", axis.unit);
                let kind = |value: f64| {
                    let is_small = value.abs() < 10_000.0;
                    let is_printed = value.fract() != 0.0 && (value * 1000.0).round() / 1000.0 == value;
                    (value < 0.0, is_small, is_small && is_printed)
                };
                self.add("value", axis.value.map(kind));
            }
        }
    }

    fn add_attribute(&mut self, attribute: &Attribute) {
        const KNOWN: &str = "OWNER COMMENT PROG_SIZE CREATE LINE_COUNT PROTECT TCD DEFAULT_GROUP";
        self.add("attribute", KNOWN.split(' ').find(|name| *name == attribute.name));
        match &attribute.value {
            AttributeValue::Text(text) => self.add("text", text.starts_with('"')),
            AttributeValue::List(items) => self.add("items", items.len()),
        }
    }
}

#[test]
fn any_bytes_are_a_program_that_reads_as_it_was_written() {
    let inputs = prop::collection::vec(any::<u8>(), 0..1500);
    let (mut runner, mut kinds, mut names) = (TestRunner::deterministic(), Kinds::default(), BTreeSet::new());
    for _ in 0..2000 {
        let input = inputs.new_tree(&mut runner).unwrap().current();
        let program = Program::arbitrary(&mut Unstructured::new(&input)).unwrap();
        let text = program.to_text(&Rules::default()).unwrap_or_else(|error| panic!("{error}: {program:?}"));
        assert_eq!(Program::decode(&text).as_ref(), Ok(&program), "{text}");
        program.instructions.iter().for_each(|instruction| kinds.add_instruction(instruction));
        program.positions.iter().for_each(|position| kinds.add_position(position));
        program.attributes.iter().flatten().for_each(|attribute| kinds.add_attribute(attribute));
        kinds.add("name", program.name.len());
        kinds.add("kind", program.kind.is_some());
        kinds.add("/ATTR", program.attributes.is_some());
        kinds.add("/APPL", program.application.as_ref().map(Vec::len));
        kinds.add("/MN", program.instructions.len());
        kinds.add("/POS", program.positions.len());
        names.extend([program.name, program.kind.unwrap_or_default()]);
    }
    let sections = 36 + 2 + 2 + 6 + 33 + 9; // name, kind, /ATTR, /APPL, /MN, /POS
    let attributes = 8 + 1 + 2 + 6;
    let instructions = 7 + 5 + 10; // with comments and statements
    let motions = 5 + (3 + 3 + 2 + 4 + 4) + (3 + 8 + 8) + (5 + 2); // kinds; targets and options; speeds and units; ends
    let positions = 17 + 2 + 16 + 9 + (12 + 9 + 9 + 2 + 7); // names, groups, configurations, axes; those, units, values
    let expected = sections + attributes + instructions + motions + positions;
    assert_eq!(kinds.0.len(), expected, "{:#?}", kinds.0);
    assert!(names.len() > 2500, "{} words and phrases", names.len());
}
