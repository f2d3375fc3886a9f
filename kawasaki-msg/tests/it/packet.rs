//! The packet builder beside the source's own program.

use kawasaki_msg::{
    AddResult, Charset, Dialect, EncodeError, Field, FieldVisitor, Job, Limits, Packet, Text, Unfit, Work,
    Writer,
};

/// The program of figure 3, a line a line: the lengths of `x.send_data`, and `.retval`.
struct Figure3 {
    max_packet: usize,
    strings: Vec<usize>,
}

impl Figure3 {
    fn new(max_packet: usize) -> Self {
        Self { max_packet, strings: vec![0] }
    }

    fn push(&mut self, message: usize) -> i32 {
        let last = self.strings.len() - 1;
        if self.strings[last] + message < 255 {
            self.strings[last] += message;
            return 0;
        }
        let length: usize = self.strings.iter().sum::<usize>() + message;
        if length > self.max_packet {
            return -100;
        }
        let fits = (255 - self.strings[last]).min(message);
        self.strings[last] += fits;
        self.strings.push(message - fits);
        0
    }

    fn total(&self) -> usize {
        self.strings.iter().sum()
    }
}

/// Returns the longest packet that messages of these lengths make in the figure, and in this crate.
fn longest(limits: Limits, first: usize, then: &[usize]) -> (usize, usize) {
    let mut theirs = Figure3::new(limits.packet);
    let mut buffer = [0; 5000];
    let mut ours = Packet::new(&mut buffer, limits, fillings());
    for length in [first; 20].iter().chain(then) {
        theirs.push(*length);
        let _ = push_length(&mut ours, *length).unwrap();
    }
    (theirs.total(), ours.as_bytes().len())
}

/// A job whose own fields have this many bytes, a `$` before each after the first counted.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Filling(usize);

impl Work for Filling {
    type Ranges = ();

    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
        let mut rest = self.0;
        loop {
            let length = rest.min(255);
            fields.text("x", &mut Text::<255>::new(&"x".repeat(length)).unwrap(), 0..=255)?;
            match rest.checked_sub(256) {
                Some(after) => rest = after,
                None => return Ok(()),
            }
        }
    }
}

/// Returns a table whose jobs are `<X$n#1$…#>`.
pub(super) fn fillings() -> Dialect {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    (table[0].name, table[0].fields) = ("X", &[Field::Number, Field::Work]);
    Dialect::new(table.leak()).unwrap()
}

pub(super) fn push(packet: &mut Packet<'_>, own: usize) -> Result<AddResult, EncodeError> {
    packet.push_job(&Job { order: 0, number: 1, work: Filling(own) }, &())
}

/// Adds a message of this length.
fn push_length(packet: &mut Packet<'_>, length: usize) -> Result<AddResult, EncodeError> {
    // `<X$n#1$…#>` with as many digits as it takes.
    let digits = (1..5).find(|digits| (length - 6 - digits).to_string().len() == *digits).unwrap();
    push(packet, length - 6 - digits - "1$".len())
}

#[test]
fn the_two_overruns_of_the_figure_cannot_happen() {
    // Sixteen full strings and 16 bytes are 4096; then one message of 238 goes unchecked into the last string.
    let (theirs, ours) = longest(Limits::TCP, 255, &[16, 238]);
    assert_eq!((theirs, ours), (4334, 4096));
    // Five full strings and 197 bytes are 1472; then one of 57.
    let (theirs, ours) = longest(Limits::UDP, 255, &[197, 57]);
    assert_eq!((theirs, ours), (1529, 1472));
    // No other sequence of two lengths does worse in the figure, and none of them exceeds the limit in ours.
    for limits in [Limits::TCP, Limits::UDP] {
        let mut worst = 0;
        for then in (10..255).step_by(3) {
            let (theirs, ours) = longest(limits, 255, &[then, 254, 238, 57, 100, 20]);
            worst = worst.max(theirs);
            assert!(ours <= limits.packet, "{ours}");
        }
        assert!(worst > limits.packet, "the figure's program does exceed it: {worst}");
    }
}

#[test]
fn the_empty_string_of_the_figure_cannot_happen() {
    let mut theirs = Figure3::new(4096);
    theirs.push(255);
    assert_eq!(theirs.strings, [255, 0]);
    let mut buffer = [0; 4096];
    let mut ours = Packet::new(&mut buffer, Limits::TCP, fillings());
    assert!(ours.is_empty() && ours.elements().next().is_none());
    assert_eq!(push_length(&mut ours, 255), Ok(AddResult::Added));
    assert_eq!(ours.elements().map(<[u8]>::len).collect::<Vec<_>>(), [255]);
}

#[test]
fn a_full_packet_is_a_value_and_an_impossible_message_an_error() {
    let mut buffer = [0; 4096];
    let mut packet = Packet::new(&mut buffer, Limits::UDP, fillings());
    assert_eq!(push_length(&mut packet, 1400), Ok(AddResult::Added));
    assert_eq!(push_length(&mut packet, 73), Ok(AddResult::Full));
    assert_eq!(push_length(&mut packet, 72), Ok(AddResult::Added), "a shorter one still fits");
    assert_eq!(push_length(&mut packet, 1473), Err(EncodeError::TooLong { length: 1473, limit: 1472 }));
    assert_eq!(push_length(&mut packet, 4097), Err(EncodeError::TooLong { length: 4097, limit: 1472 }));
    assert_eq!(packet.as_bytes().len(), 1472);
}

#[test]
fn a_short_buffer_is_a_lower_limit() {
    let mut buffer = [0; 30];
    let mut packet = Packet::new(&mut buffer, Limits::TCP, fillings());
    assert_eq!(push_length(&mut packet, 31), Err(EncodeError::TooLong { length: 31, limit: 30 }));
    assert_eq!(push_length(&mut packet, 20), Ok(AddResult::Added));
    assert_eq!(push_length(&mut packet, 11), Ok(AddResult::Full));
    assert_eq!(push_length(&mut packet, 30), Ok(AddResult::Full), "an empty packet would hold it");
}

#[test]
fn errors_read_as_sentences() {
    let message = |error: EncodeError| error.to_string();
    assert_eq!(message(EncodeError::Forbidden { found: b'$' }), "'$' is not allowed in a name or field");
    assert_eq!(message(EncodeError::Character { found: 'ä' }), "character 'ä' is not in the character set");
    assert_eq!(
        message(EncodeError::TooLong { length: 5000, limit: 4096 }),
        "the message has 5000 bytes, the maximum of a packet is 4096"
    );
    assert_eq!(
        message(EncodeError::BufferTooSmall { needed: 21, available: 20 }),
        "the message needs 21 bytes, the buffer has 20"
    );
    let written = |charset| {
        let mut out = [0; 20];
        let mut writer = Writer::new(&mut out, charset, "X");
        writer.data();
        writer.text("ä");
        writer.finish()
    };
    assert_eq!(written(Charset::Ascii), Err(EncodeError::Character { found: 'ä' }));
    assert_eq!(written(Charset::Latin1), Ok(8));
}
