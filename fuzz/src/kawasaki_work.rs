//! Kawasaki: the fields of a job, whatever they hold.

use core::time::Duration;
use std::sync::LazyLock;

use arbitrary::Arbitrary;
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    Charset, Dialect, FieldVisitor, Job, JobKind, LargeRobot, Message, RobotConfig, Role, Text, Unfit, Work,
};

use crate::Bytes;

/// The fields of a job as they are written, and where the message is cut.
#[derive(Debug, Arbitrary)]
pub(crate) struct WrittenFields {
    cut: u8,
    fields: Bytes,
}

/// Too long to be compared at once.
const WORDY: &str = "TyoJokaLuetaanYleisestiEikaNopeasti";

/// Returns a table in which a job has that name.
fn wordy() -> Dialect {
    static TABLE: LazyLock<Dialect> = LazyLock::new(|| {
        let mut table = Dialect::DEFAULT.entries().to_vec();
        table.iter_mut().filter(|entry| entry.role == Role::Job).for_each(|entry| entry.name = WORDY);
        Dialect::new(table.leak()).unwrap()
    });
    *TABLE
}

/// A job with a field of every kind.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct MixedJob {
    kind: JobKind,
    whole: i32,
    few: i32,
    many: i32,
    short: Text<3>,
    long: Text<20>,
}

impl Work for MixedJob {
    type Ranges = ();

    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
        fields.whole("kind", &mut self.kind, JobKind::Draw..=JobKind::Move)?;
        fields.whole("whole", &mut self.whole, i32::MIN..=i32::MAX)?;
        fields.decimal("few", &mut self.few, 1, -999..=9_999)?;
        fields.decimal("many", &mut self.many, 6, i32::MIN..=i32::MAX)?;
        fields.text("short", &mut self.short, 0..=3)?;
        fields.text("long", &mut self.long, 1..=20)
    }
}

/// Asserts that any fields of a job, read on the fast and on the general path, whole and split in two, are the same job or
/// none, and that a queued job is written and read again unchanged.
pub(crate) fn work(WrittenFields { cut, fields: Bytes(fields) }: WrittenFields) {
    let message = |name: &str| {
        let data = [b"50$1$", fields.as_slice()].concat();
        [format!("<{name}${}#", data.len()).as_bytes(), &data, b"#>"].concat()
    };
    let queue = |dialect: Dialect, wire: &[u8], cut: usize| {
        let (writer, reader) = robot_work_queue::boxed::<Job<MixedJob>>(4, 9999).unwrap();
        let mut robot =
            LargeRobot::with_ranges(RobotConfig { dialect, ..RobotConfig::tcp() }, writer, ()).unwrap();
        robot.handle_timeout(Duration::ZERO);
        robot.handle_connected(Duration::ZERO);
        robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
        let (first, second) = wire.split_at(cut.min(wire.len()));
        robot.handle_input(Duration::ZERO, first);
        robot.handle_input(Duration::ZERO, second);
        reader.iter().map(|(_, job)| *job).collect::<Vec<_>>()
    };
    let wire = message("Tyo");
    let queued = queue(Dialect::DEFAULT, &wire, usize::MAX);
    assert_eq!(queued, queue(Dialect::DEFAULT, &wire, usize::from(cut)), "how it is cut changes nothing");
    assert_eq!(queued, queue(wordy(), &message(WORDY), usize::MAX), "both ways of reading are one");
    if let [job] = queued.as_slice() {
        let mut out = [0; 4096];
        let length = Dialect::DEFAULT.write_job(job, &(), &mut out).unwrap();
        let (again, _) = Message::decode(&out[..length], Charset::Ascii).unwrap().unwrap();
        assert_eq!(Dialect::DEFAULT.read_job::<MixedJob>(&again, &()), Ok(*job));
        assert_eq!(queue(Dialect::DEFAULT, &out[..length], usize::MAX), queued);
    }
}
