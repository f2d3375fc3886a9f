//! Messages and jobs of the feature `arbitrary`: the encoder accepts each of them.

use std::collections::HashSet;

use arbitrary::{Arbitrary, Error, Unstructured};
use kawasaki_msg::{
    Charset, Dialect, Entry, Field, FieldVisitor, Job, JobKind, Line, Message, Role, Text, Unfit, Work,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

use super::decoded;

/// Returns a fuzzer's bytes, of which as many as one in two are digits and separators.
fn inputs() -> impl Iterator<Item = Vec<u8>> {
    let byte = prop_oneof![any::<u8>(), prop::sample::select(&b"0123456789$"[..])];
    let (mut runner, bytes) = (TestRunner::deterministic(), prop::collection::vec(byte, 0..100));
    (0..5000).map(move |_| bytes.new_tree(&mut runner).unwrap().current())
}

#[test]
fn any_bytes_are_a_message_that_decodes() {
    let mut kinds = HashSet::new();
    for bytes in inputs() {
        let wire = Message::arbitrary(&mut Unstructured::new(&bytes)).unwrap();
        let message = decoded(&wire, Charset::Ascii);
        let name = message.name.to_string();
        let is_known = Dialect::DEFAULT.entries().iter().any(|entry| message.name == *entry.name);
        kinds.insert(if is_known { name } else { "another name".to_owned() });
        kinds.insert(format!("{} values in the header", message.header.count().min(3)));
        kinds.insert(format!("{} fields", message.fields.count().min(3)));
    }
    assert_eq!(kinds.len(), 11 + 1 + 4 + 4, "{kinds:?}");
}

#[test]
fn a_message_of_many_bytes_fits_a_packet() {
    for length in [4095, 4096, 4097, 9000] {
        // Whichever parts the first and the last bytes choose: each part is as long as it can be.
        for byte in 0..=255 {
            let bytes = [&[byte; 8][..], &vec![b'7'; length], &[byte; 24]].concat();
            decoded(&Message::arbitrary(&mut Unstructured::new(&bytes)).unwrap(), Charset::Ascii);
        }
    }
}

#[test]
fn any_bytes_are_a_message_of_the_table_that_is_read_as_itself() {
    let command = Entry {
        role: Role::Command(7),
        name: "Nopeus",
        header: &[Field::Constant("solu"), Field::Order],
        fields: &[Field::Unused, Field::Value],
    };
    let table = [Dialect::DEFAULT.entries(), &[command]].concat();
    let dialect = Dialect::new(table.leak()).unwrap();
    let mut kinds = HashSet::new();
    for bytes in inputs() {
        let (role, params) = dialect.arbitrary(&mut Unstructured::new(&bytes)).unwrap();
        let mut wire = [0; 256];
        let length = dialect.write(role, &params, &mut wire).unwrap();
        assert_eq!(dialect.read(&decoded(&wire[..length], Charset::Ascii)), Ok((role, params)));
        let is_there = |field| params.get(field).is_some();
        kinds.insert((role, [Field::Queued, Field::Executed, Field::Ended].map(is_there)));
    }
    // Three values of a status may be missing, one of a pause, and two of the acknowledgement of an end.
    let roles = 12 - 1;
    assert_eq!(kinds.len(), roles - 3 + 8 + 2 + 4, "{kinds:?}");
}

/// A job with a field of every kind.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Mixed {
    kind: JobKind,
    angle: i32,
    tool: Text<8>,
}

impl Work for Mixed {
    type Ranges = i32;

    fn fields<F: FieldVisitor>(&mut self, most: &i32, fields: &mut F) -> Result<(), Unfit> {
        fields.whole("kind", &mut self.kind, JobKind::Draw..=JobKind::Move)?;
        fields.decimal("angle", &mut self.angle, 3, -2..=*most)?;
        fields.text("tool", &mut self.tool, 1..=9)
    }
}

fn job<W: Work + PartialEq + core::fmt::Debug>(bytes: &[u8], ranges: &W::Ranges) -> Job<W> {
    let job = Job::arbitrary_within(&mut Unstructured::new(bytes), ranges).unwrap();
    let mut wire = [0; 256];
    let length = Dialect::DEFAULT.write_job(&job, ranges, &mut wire).unwrap();
    assert_eq!(Dialect::DEFAULT.read_job(&decoded(&wire[..length], Charset::Ascii), ranges), Ok(job));
    job
}

#[test]
fn any_bytes_are_a_job_that_is_read_as_itself() {
    let mut kinds = HashSet::new();
    for bytes in inputs() {
        let line = job::<Line>(&bytes, &<Line as Work>::Ranges::default());
        assert_eq!(Job::arbitrary(&mut Unstructured::new(&bytes)), Ok(line));
        let Job { work: Mixed { kind, angle, tool }, .. } = job(&bytes, &2);
        kinds.insert(format!("{:?}", line.work.kind));
        kinds.extend([format!("{kind:?}, {angle}"), format!("{} characters", tool.as_bytes().len())]);
    }
    assert_eq!(kinds.len(), 2 + 2 * 5 + 8, "{kinds:?}");
    let job = Job::<Mixed>::arbitrary_within(&mut Unstructured::new(&[0; 9]), &-3);
    assert_eq!(job, Err(Error::IncorrectFormat), "no angle is in the range");
}
