//! The packet builder beside the source's own program.

use kawasaki_msg::{Charset, EncodeError, Limits, Message, Packet, Room, Value};

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

/// The longest packet that messages of these lengths make in the figure, and in ours.
fn longest(limits: Limits, first: usize, then: &[usize]) -> (usize, usize) {
    let mut theirs = Figure3::new(limits.packet);
    let mut buffer = [0; 5000];
    let mut ours = Packet::new(&mut buffer, limits, Charset::Ascii);
    for length in [first; 20].iter().chain(then) {
        theirs.push(*length);
        let _ = ours.push(&of_length(*length)).unwrap();
    }
    (theirs.total(), ours.as_bytes().len())
}

fn of_length(length: usize) -> Message<'static> {
    // `<X$n#…#>` with as many digits as it takes.
    for digits in 1..5 {
        let data = length - 6 - digits;
        if data.to_string().len() == digits {
            let fields: &'static [Value<'static>] =
                Box::leak(Box::new([Value::Text("x".repeat(data).leak())]));
            let message = Message::new("X", fields);
            assert_eq!(message.encoded_len(), length);
            return message;
        }
    }
    panic!("no message has {length} bytes")
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
    let mut ours = Packet::new(&mut buffer, Limits::TCP, Charset::Ascii);
    assert!(ours.is_empty() && ours.elements().next().is_none());
    assert_eq!(ours.push(&of_length(255)), Ok(Room::Added));
    assert_eq!(ours.elements().map(<[u8]>::len).collect::<Vec<_>>(), [255]);
}

#[test]
fn a_full_packet_is_a_value_and_an_impossible_message_an_error() {
    let mut buffer = [0; 4096];
    let mut packet = Packet::new(&mut buffer, Limits::UDP, Charset::Ascii);
    assert_eq!(packet.push(&of_length(1400)), Ok(Room::Added));
    assert_eq!(packet.push(&of_length(73)), Ok(Room::Full));
    assert_eq!(packet.push(&of_length(72)), Ok(Room::Added), "a shorter one still fits");
    assert_eq!(packet.push(&of_length(1473)), Err(EncodeError::TooLong { length: 1473, limit: 1472 }));
    assert_eq!(packet.push(&of_length(4097)), Err(EncodeError::TooLong { length: 4097, limit: 1472 }));
    assert_eq!(packet.push(&Message::new("", &[])), Err(EncodeError::NoName));
    assert_eq!(packet.as_bytes().len(), 1472);
}

#[test]
fn a_short_buffer_is_a_lower_limit() {
    let mut buffer = [0; 30];
    let mut packet = Packet::new(&mut buffer, Limits::TCP, Charset::Ascii);
    assert_eq!(packet.push(&of_length(31)), Err(EncodeError::TooLong { length: 31, limit: 30 }));
    assert_eq!(packet.push(&of_length(20)), Ok(Room::Added));
    assert_eq!(packet.push(&of_length(11)), Ok(Room::Full));
    assert_eq!(packet.push(&of_length(30)), Ok(Room::Full), "an empty packet would hold it");
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
    assert_eq!(
        Message::new("X", &[Value::Text("ä")]).encode(Charset::Ascii, &mut [0; 20]),
        Err(EncodeError::Character { found: 'ä' })
    );
    assert_eq!(Message::new("X", &[Value::Text("ä")]).encode(Charset::Latin1, &mut [0; 20]), Ok(8));
}
