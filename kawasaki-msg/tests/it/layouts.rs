//! Jobs of any layout: the values read from each form of a field, the errors of other forms, and the reactions of both ends.

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    Bounds, Charset, ConfigError, Decimal, DecodeError, Dialect, EncodeError, FieldError, FieldFault,
    FieldVisitor, Job, JobKind, LargeRobot, Line, Message, MessageError, Name, Pc, PcConfig, PcEvent, Point,
    Robot, RobotConfig, RobotEvent, Text, Unfit, Work,
};
use proptest::prelude::*;

/// A job with a field of every kind.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Mixed {
    whole: i32,
    angle: i32,
    speed: u8,
    tool: Text<8>,
    kind: JobKind,
}

impl Work for Mixed {
    type Ranges = ();

    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
        fields.whole("whole", &mut self.whole, i32::MIN..=i32::MAX)?;
        fields.decimal("angle", &mut self.angle, 3, -2_000_000..=2_000_000)?;
        fields.whole("speed", &mut self.speed, 1..=100)?;
        fields.text("tool", &mut self.tool, 1..=8)?;
        fields.whole("kind", &mut self.kind, JobKind::Draw..=JobKind::Move)
    }
}

const GOOD: [&str; 5] = ["-5", "1.500", "7", "grip", "2"];

/// Returns these fields with one replaced.
fn with(place: usize, value: &str) -> String {
    let mut fields = GOOD;
    fields[place] = value;
    fields.join("$")
}

fn wire(fields: &str) -> Vec<u8> {
    let data = format!("50$1${fields}");
    format!("<Tyo${}#{data}#>", data.len()).into_bytes()
}

/// Returns the job that a robot queues, or the error that it reports.
fn queued(dialect: Dialect, wire: &[u8]) -> Result<Job<Mixed>, MessageError> {
    queued_within(dialect, (), wire)
}

fn queued_within<W: Work>(dialect: Dialect, ranges: W::Ranges, wire: &[u8]) -> Result<Job<W>, MessageError> {
    let (writer, reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let config = RobotConfig { dialect, ..RobotConfig::tcp() };
    let mut robot = LargeRobot::with_ranges(config, writer, ranges).unwrap();
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
    robot.handle_input(Duration::ZERO, wire);
    let error = core::iter::from_fn(|| robot.poll_event()).find_map(|event| match event {
        RobotEvent::Rejected(error) => Some(error),
        _ => None,
    });
    reader.iter().next().map(|(_, job)| *job).ok_or_else(|| error.expect("a job or an error"))
}

fn read(fields: &str) -> Result<Mixed, MessageError> {
    let wire = wire(fields);
    let (message, _) = Message::decode(&wire, Charset::Ascii).unwrap().unwrap();
    let read = Dialect::DEFAULT.read_job::<Mixed>(&message, &());
    assert_eq!(read, queued(Dialect::DEFAULT, &wire), "{fields}: a robot reads the same");
    read.map(|job| job.work)
}

fn fault(place: usize, value: &str) -> FieldFault {
    match read(&with(place, value)) {
        Err(MessageError::Field(FieldError { field, fault })) => {
            assert_eq!(field, Name::of(["whole", "angle", "speed", "tool", "kind"][place]));
            fault
        }
        other => panic!("{value}: {other:?}"),
    }
}

#[test]
fn every_form_of_a_decimal() {
    for (text, units) in [
        ("1.500", 1500),
        ("1.5", 1500),
        ("1.50", 1500),
        ("1.5000", 1500),
        ("-.5", -500),
        (".5", 500),
        ("2.", 2000),
        ("2", 2000),
        ("-0.000", 0),
        (" 12.345 ", 12_345),
        ("0001.500", 1500),
        ("-2000.000", -2_000_000),
        ("1234.567", 1_234_567),
    ] {
        assert_eq!(read(&with(1, text)).map(|work| work.angle), Ok(units), "{text}");
    }
    let [min, max] = [-2_000_000, 2_000_000].map(|units| Decimal { units, places: 3 });
    for text in ["1e3", "+1", "", "-", ".", "1.5.0", "1,5", "0x1", "1 5", "99999999999", "--1"] {
        assert_eq!(fault(1, text), FieldFault::NotANumber { min, max }, "{text}");
    }
    assert_eq!(fault(1, "1.5001"), FieldFault::TooPrecise { places: 3 });
    let found = Decimal { units: 2_000_001, places: 3 };
    assert_eq!(fault(1, "2000.001"), FieldFault::OutOfRange { found, min, max });
    let sentence = FieldError { field: Name::of("angle"), fault: fault(1, "2000.001") }.to_string();
    assert_eq!(sentence, "field 'angle' is 2000.001, not from -2000.000 to 2000.000");
    let sentence = FieldError { field: Name::of("angle"), fault: fault(1, "1e3") }.to_string();
    assert_eq!(sentence, "field 'angle' is not a number from -2000.000 to 2000.000");
}

#[test]
fn every_form_of_a_whole_number() {
    for (text, number) in [
        ("0", 0),
        ("-0", 0),
        (" 7 ", 7),
        ("-0050", -50),
        ("12345678", 12_345_678),
        ("2147483647", i32::MAX),
        ("-2147483648", i32::MIN),
        ("00000000000000000001", 1),
    ] {
        assert_eq!(read(&with(0, text)).map(|work| work.whole), Ok(number), "{text}");
    }
    let [min, max] = [i32::MIN, i32::MAX].map(|units| Decimal { units, places: 0 });
    for text in ["5.0", "5.", "2147483648", "-2147483649", "4294967297", "1e3", "x"] {
        assert_eq!(fault(0, text), FieldFault::NotANumber { min, max }, "{text}");
    }
    let whole = |units| Decimal { units, places: 0 };
    let out =
        |found, min, max| FieldFault::OutOfRange { found: whole(found), min: whole(min), max: whole(max) };
    assert_eq!((fault(2, "0"), fault(2, "101")), (out(0, 1, 100), out(101, 1, 100)));
    assert_eq!((fault(2, "256"), fault(4, "3")), (out(256, 1, 100), out(3, 1, 2)));
}

#[test]
fn every_form_of_a_text() {
    for text in ["x", "12345678", " a b ", "grip.1-2"] {
        assert!(read(&with(3, text)).unwrap().tool == text, "{text}");
    }
    assert_eq!(fault(3, ""), FieldFault::Length { found: 0, min: 1, max: 8 });
    assert_eq!(fault(3, "123456789"), FieldFault::Length { found: 9, min: 1, max: 8 });
    let latin1 = Dialect::DEFAULT.with_charset(Charset::Latin1);
    let mut bytes = wire(&with(3, "ab"));
    let at = bytes.windows(2).position(|two| two == b"ab").unwrap();
    bytes[at] = 0xE9;
    assert!(queued(latin1, &bytes).unwrap().work.tool == "éb");
    assert_eq!(Text::<8>::new("a<b"), None);
    assert_eq!((Text::<2>::new("abc"), Text::<2>::new("\u{100}")), (None, None));
}

#[test]
fn a_job_has_all_its_fields_and_no_more() {
    let missing = FieldError { field: Name::of("kind"), fault: FieldFault::Missing };
    assert_eq!(read("-5$1.500$7$grip"), Err(MessageError::Field(missing)));
    assert_eq!(read("-5$1.500$7$grip$2$"), Err(MessageError::FieldCount { expected: 7, found: 8 }));
    let long = with(0, &"0".repeat(1100));
    assert_eq!(read(&long), Err(MessageError::JobTooLong { found: 1118, limit: 1024 }));
}

/// Returns the event that a robot reports for jobs 1 to 3, the second one wrong. The wrong job is not queued, the previous
/// one is not lost, and the next one comes again.
fn report_of(bad: &[u8]) -> RobotEvent {
    let (writer, reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<Mixed>::new(RobotConfig::tcp(), writer).unwrap();
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
    while robot.poll_event().is_some() {}
    let good = |number: u16| {
        let data = format!("50${number}${}", GOOD.join("$"));
        format!("<Tyo${}#{data}#>", data.len()).into_bytes()
    };
    robot.handle_input(Duration::ZERO, &[&good(1), bad, &good(3)].concat());
    let wrong = bad.escape_ascii();
    assert_eq!(robot.queued(), 1, "{wrong}");
    let report = robot.poll_event().expect("a report");
    let packet = [good(2), good(3)].concat();
    for cycle in 1..=3 {
        let now = Duration::from_secs(cycle);
        robot.handle_timeout(now);
        let mut out = [0; 4096];
        let length = robot.poll_transmit(now, &mut out).unwrap();
        let asks = out[..length].ends_with(b"<TyoPyynto$4#50$2#>");
        robot.handle_input(now, if asks { &packet } else { b"<Huuhaa$0##>" });
    }
    let numbers: Vec<_> = reader.iter().map(|(_, job)| job.number).collect();
    assert_eq!(numbers, [1, 2, 3], "after {wrong} the jobs are asked for again");
    report
}

#[test]
fn a_job_that_is_wrong_is_reported_and_costs_nothing_else() {
    let job = |fields: &str| {
        let data = format!("50$2${fields}");
        format!("<Tyo${}#{data}#>", data.len()).into_bytes()
    };
    let of_field =
        |name, fault| RobotEvent::Rejected(MessageError::Field(FieldError { field: Name::of(name), fault }));
    let number = |units, places| Decimal { units, places };
    let [min, max] = [-2_000_000, 2_000_000].map(|units| number(units, 3));
    let speed = |found| {
        let [found, min, max] = [found, 1, 100].map(|units| number(units, 0));
        FieldFault::OutOfRange { found, min, max }
    };
    let found = number(2_000_001, 3);
    for (fields, report) in [
        (with(1, "2000.001"), of_field("angle", FieldFault::OutOfRange { found, min, max })),
        (with(1, "1.5001"), of_field("angle", FieldFault::TooPrecise { places: 3 })),
        (with(1, "1,5"), of_field("angle", FieldFault::NotANumber { min, max })),
        (with(2, "101"), of_field("speed", speed(101))),
        (with(2, "0"), of_field("speed", speed(0))),
        (with(3, "123456789"), of_field("tool", FieldFault::Length { found: 9, min: 1, max: 8 })),
        (with(3, ""), of_field("tool", FieldFault::Length { found: 0, min: 1, max: 8 })),
        ("-5$1.500$7$grip".into(), of_field("kind", FieldFault::Missing)),
        (GOOD.join("$") + "$1", RobotEvent::Rejected(MessageError::FieldCount { expected: 7, found: 8 })),
        // A separator in a text makes two fields of it: the next one is not a number.
        (with(3, "gr$ip"), of_field("kind", FieldFault::NotANumber { min: number(1, 0), max: number(2, 0) })),
    ] {
        assert_eq!(report_of(&job(&fields)), report, "{fields}");
    }
    // Other marks, and a byte that is not a character: no message is whole.
    for (text, is_it) in [
        (&b"gr<ip"[..], |error| matches!(error, DecodeError::Mark { found: b'<', .. })),
        (b"gr>ip", |error| matches!(error, DecodeError::Mark { found: b'>', .. })),
        (b"gr#ip", |error| matches!(error, DecodeError::Length { .. })),
        (b"gr\xE9ip", |error| matches!(error, DecodeError::NotAscii { found: 0xE9, .. })),
    ] as [(&[u8], fn(DecodeError) -> bool); 4]
    {
        let mut wire = job(&with(3, "gr-ip"));
        let at = wire.windows(5).position(|five| five == b"gr-ip").unwrap();
        wire[at..at + 5].copy_from_slice(text);
        let report = report_of(&wire);
        assert!(matches!(report, RobotEvent::Corrupt(error) if is_it(error)), "{report:?}");
    }
}

/// A PC sends nothing of a job that does not fit, and all before it.
#[test]
fn a_pc_refuses_a_job_that_does_not_fit() {
    let line = |x| Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(x, 0) };
    let jobs = [line(1), line(2), line(1001), line(4)];
    let bounds = Bounds { min: Point::new(0, 0), max: Point::new(1000, 1000) };
    let mut pc = <Pc<_>>::with_ranges(PcConfig::tcp(), bounds).unwrap();
    pc.start(50, &jobs[..]).unwrap();
    pc.handle_connected(Duration::ZERO);
    let mut now = Duration::ZERO;
    let mut answer = |pc: &mut Pc<&[Line]>, message: &[u8]| {
        now += Duration::from_millis(40);
        pc.handle_input(now, message);
        let mut out = [0; 4096];
        let length = pc.poll_transmit(now + Duration::from_millis(2), &mut out).unwrap();
        String::from_utf8(out[..length].to_vec()).unwrap()
    };
    answer(&mut pc, b"<Tila$6#0$0$$$#>");
    while pc.poll_event().is_some() {}
    let jobs = answer(&mut pc, b"<TilausKuittaus$2#50#><Tila$7#50$2$$$#><TyoPyynto$4#50$1#>");
    assert!(jobs.ends_with("<Tyo$14#50$1$1$0$0$1$0#><Tyo$14#50$2$1$0$0$2$0#>"), "{jobs}");
    let events: Vec<_> = core::iter::from_fn(|| pc.poll_event()).collect();
    let [found, min, max] = [1001, 0, 1000].map(|units| Decimal { units, places: 0 });
    let error = FieldError { field: Name::of("x2"), fault: FieldFault::OutOfRange { found, min, max } };
    assert!(events.contains(&PcEvent::JobUnfit { order: 50, index: 2, error }), "{events:?}");
    let answer = answer(&mut pc, b"<TyoKuittaus$4#50$1#><TyoPyynto$4#50$3#>");
    assert_eq!(answer, "<TilausLoppuu$2#50#>", "the order ends, and no later job is sent");
    pc.handle_input(Duration::from_secs(1), b"<TyoKuittaus$4#50$2#><LoppuKuittaus$6#50$0$2#>");
    let events: Vec<_> = core::iter::from_fn(|| pc.poll_event()).collect();
    let over = PcEvent::OrderOver { order: 50, executed: 2, complete: false };
    assert!(events.contains(&over), "{events:?}");
    assert_eq!(events.iter().filter(|event| matches!(event, PcEvent::JobUnfit { .. })).count(), 0);
}

#[test]
fn what_cannot_be_written_says_why() {
    let good =
        Mixed { whole: -5, angle: 1500, speed: 7, tool: Text::new("grip").unwrap(), ..Mixed::default() };
    let written = |work: Mixed| {
        let mut out = [0; 100];
        let job = Job { order: 50, number: 1, work };
        let length = Dialect::DEFAULT.write_job(&job, &(), &mut out)?;
        Ok(String::from_utf8(out[..length].to_vec()).unwrap())
    };
    assert_eq!(written(good).as_deref(), Ok("<Tyo$22#50$1$-5$1.500$7$grip$1#>"));
    let field = |name, fault| Err(EncodeError::Field(FieldError { field: Name::of(name), fault }));
    let whole = |units| Decimal { units, places: 0 };
    let out = FieldFault::OutOfRange { found: whole(0), min: whole(1), max: whole(100) };
    assert_eq!(written(Mixed { speed: 0, ..good }), field("speed", out));
    let empty = FieldFault::Length { found: 0, min: 1, max: 8 };
    assert_eq!(written(Mixed { tool: Text::EMPTY, ..good }), field("tool", empty));
    let accent = Mixed { tool: Text::new("é").unwrap(), ..good };
    assert_eq!(written(accent), field("tool", FieldFault::Character { found: 'é' }));
    for (angle, text) in
        [(0, "0.000"), (-1, "-0.001"), (-999, "-0.999"), (1000, "1.000"), (-2_000_000, "-2000.000")]
    {
        let wire = written(Mixed { angle, ..good }).unwrap();
        assert!(wire.contains(&format!("$-5${text}$7$")), "{wire}");
    }
    let job = Job { order: 50, number: 1, work: good };
    for size in 0..32 {
        let needed = EncodeError::BufferTooSmall { needed: 32, available: size };
        assert_eq!(Dialect::DEFAULT.write_job(&job, &(), &mut vec![0; size]), Err(needed));
    }
}

#[test]
fn a_layout_is_checked() {
    #[derive(Debug, Clone, Copy, Default)]
    struct Long([Text<255>; 4]);
    impl Work for Long {
        type Ranges = ();

        fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
            self.0.iter_mut().try_for_each(|text| fields.text("text", text, 0..=255))
        }
    }
    let pc = Pc::<&[Long]>::new(PcConfig::tcp());
    assert_eq!(pc.err(), Some(ConfigError::JobTooLong { found: 1024, limit: 960 }));
}

/// A name that is too long to be compared at once.
const LONG_NAME: &str = "TyoJokaLuetaanYleisestiEikaNopeasti";

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// An expected name is read in one pass, a long name in the general way.
    #[test]
    fn both_ways_of_reading_are_one(
        whole: i32,
        angle in -2_000_000..=2_000_000,
        speed in 1u8..=100,
        tool in "[ -\"%-;=?-~]{1,8}",
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            3 => prop::sample::select(b"0123456789-.$#<> ".to_vec()),
            1 => any::<u8>(),
        ]), 0..3),
    ) {
        let work = Mixed { whole, angle, speed, tool: Text::new(&tool).unwrap(), kind: JobKind::Move };
        let mut out = [0; 100];
        let job = Job { order: 50, number: 1, work };
        let length = Dialect::DEFAULT.write_job(&job, &(), &mut out).unwrap();
        let mut data = out[..length].strip_suffix(b"#>").unwrap().to_vec();
        let begin = data.iter().position(|byte| *byte == b'#').unwrap() + 1;
        data.drain(..begin);
        for (at, byte) in &changes {
            let at = at.index(data.len());
            data[at] = *byte;
        }
        let message = |name: &str| [format!("<{name}${}#", data.len()).as_bytes(), &data, b"#>"].concat();
        let mut table = Dialect::DEFAULT.entries().to_vec();
        table[0].name = LONG_NAME;
        let dialect = Dialect::new(table.leak()).unwrap();
        let ways = [(Dialect::DEFAULT, message("Tyo")), (dialect, message(LONG_NAME))];
        let [short, long] = ways.map(|(dialect, wire)| {
            std::panic::catch_unwind(|| queued(dialect, &wire)).ok()
        });
        prop_assert_eq!(short, long);
        if changes.is_empty() {
            prop_assert_eq!(short, Some(Ok(job)));
        }
    }

    /// The same, of a number with any count of decimals in any form.
    #[test]
    fn both_ways_of_reading_a_number_are_one(
        places in 0u8..=9,
        text in prop_oneof!["-?[0-9]{0,8}\\.[0-9]{0,9}", "-?[0-9]{0,12}", "[-0-9. $#<>e+]{0,12}"],
    ) {
        let wires = ["Tyo", LONG_NAME].map(|name| {
            let data = format!("50$1${text}$0");
            format!("<{name}${}#{data}#>", data.len()).into_bytes()
        });
        let mut table = Dialect::DEFAULT.entries().to_vec();
        table[0].name = LONG_NAME;
        let dialect = Dialect::new(table.leak()).unwrap();
        let [short, long] = [(Dialect::DEFAULT, &wires[0]), (dialect, &wires[1])].map(|(dialect, wire)| {
            std::panic::catch_unwind(|| queued_within::<Numbers>(dialect, places, wire)).ok()
        });
        prop_assert_eq!(short, long);
    }

    /// Numbers of every width, into a buffer with more space than that and with less.
    #[test]
    fn a_job_is_written_as_it_is_printed(
        order in 1u16..=u16::MAX,
        number in 1u16..=9999,
        (whole, narrower) in (any::<i32>(), 0..32),
        (angle, shorter) in (-2_000_000..=2_000_000, 0..21),
        speed in 1u8..=100,
        tool in "[ -\"%-;=?-~]{1,8}",
        room in 0usize..80,
    ) {
        let (whole, angle) = (whole >> narrower, angle >> shorter);
        let work = Mixed { whole, angle, speed, tool: Text::new(&tool).unwrap(), kind: JobKind::Move };
        let job = Job { order, number, work };
        let sign = if angle < 0 { "-" } else { "" };
        let (units, decimals) = (angle.abs() / 1000, angle.abs() % 1000);
        let data = format!("{order}${number}${whole}${sign}{units}.{decimals:03}${speed}${tool}$2");
        let printed = format!("<Tyo${}#{data}#>", data.len());
        let mut out = vec![b'!'; room];
        let written = Dialect::DEFAULT.write_job(&job, &(), &mut out);
        if printed.len() <= room {
            prop_assert_eq!(written, Ok(printed.len()));
            prop_assert_eq!(core::str::from_utf8(&out[..printed.len()]), Ok(&*printed));
        } else {
            let (needed, available) = (printed.len(), room);
            prop_assert_eq!(written, Err(EncodeError::BufferTooSmall { needed, available }));
        }
    }
}

/// A number with this many decimals, and one without.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Numbers(i32, i32);

impl Work for Numbers {
    type Ranges = u8;

    fn fields<F: FieldVisitor>(&mut self, places: &u8, fields: &mut F) -> Result<(), Unfit> {
        fields.decimal("decimal", &mut self.0, *places, -1_000_000_000..=1_000_000_000)?;
        fields.whole("whole", &mut self.1, 0..=9)
    }
}

/// Text of every length, and a number with as many decimals as the range states.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Any([Text<255>; 2], i32);

impl Work for Any {
    type Ranges = u8;

    fn fields<F: FieldVisitor>(&mut self, places: &u8, fields: &mut F) -> Result<(), Unfit> {
        fields.text("first", &mut self.0[0], 0..=255)?;
        fields.decimal("number", &mut self.1, *places, i32::MIN..=i32::MAX)?;
        fields.text("last", &mut self.0[1], 0..=255)
    }
}

/// Data parts of every length, with a length field of one digit, two or three.
#[test]
fn jobs_of_any_length_and_number_are_read_as_they_are_written() {
    let text = |length| Text::new(&"x".repeat(length)).unwrap();
    let works = (0..=255).map(|length| (Any([text(length), text(length / 2)], -7), 0));
    let numbers = [0, 1, -1, 9, 10, -99, 100, 12_345, -999_999, 9_999_999, 10_000_000, i32::MIN, i32::MAX];
    let numbers = numbers.into_iter().flat_map(|number| (0..=9).map(move |places| (number, places)));
    for (work, places) in works.chain(numbers.map(|(number, places)| (Any([text(3); 2], number), places))) {
        let job = Job { order: 5, number: 1, work };
        let mut wire = [0; 1024];
        let length = Dialect::DEFAULT.write_job(&job, &places, &mut wire).unwrap();
        let (message, used) = Message::decode(&wire[..length], Charset::Ascii).unwrap().unwrap();
        assert_eq!((Dialect::DEFAULT.read_job(&message, &places), used), (Ok(job), length));
        // A buffer that is exactly as long is enough, and one byte less is not.
        assert_eq!(Dialect::DEFAULT.write_job(&job, &places, &mut wire[..length]), Ok(length));
        let small = EncodeError::BufferTooSmall { needed: length, available: length - 1 };
        assert_eq!(Dialect::DEFAULT.write_job(&job, &places, &mut wire[..length - 1]), Err(small));
    }
}
