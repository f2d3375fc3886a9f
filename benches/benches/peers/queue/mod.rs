//! The queue against other rings of one writer and one reader.
//!
//! Both threads are pinned, and every body is inlined. A thread that waits asks again at once ("bare"), or after the
//! processor's instruction for such loops ("pause"). In each round the contenders run one after the other on each course,
//! and each time is divided by rtrb's of the same round: a host may move the processors of a virtual machine to other cores
//! meanwhile. Before each sample of two threads the round trip of a cache line is measured, and the ratio counts only if it
//! was the same for both, within a half. If it is too fast, the two processors are hyper-threads of one core at that time;
//! such ratios are used only where there are not enough others, and the table states it.

mod cores;
mod rings;

use std::hint::black_box;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Instant;

use benches::{median, table};
use ringbuf::traits::Split as _;

use cores::{Cores, ONE_CORE};
use rings::{Batches, Checked, LowWater, MAX_NUMBER, Read, Write, wait};

const ROUNDS: usize = 51;
const ROUND_TRIPS: u64 = 5_000;
const STREAMED: u64 = 50_000;
const PAIRS: u64 = 50_000;
/// The number of samples on two cores below which those on one core are used.
const FEWEST: usize = 9;

/// A job: built from its number, and checked by its sum.
trait Job: Copy + Send + 'static {
    fn make(n: u64) -> Self;
    fn sum(&self) -> u64;
}

impl Job for u64 {
    #[inline(always)]
    fn make(n: u64) -> Self {
        n
    }

    #[inline(always)]
    fn sum(&self) -> u64 {
        *self
    }
}

impl<const WORDS: usize> Job for [u64; WORDS] {
    #[inline(always)]
    fn make(n: u64) -> Self {
        std::array::from_fn(|word| n + word as u64)
    }

    #[inline(always)]
    fn sum(&self) -> u64 {
        self.iter().fold(0, |sum, word| sum ^ word)
    }
}

/// A job that shares no cache line with another.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Lone<J>(J);

impl<J: Job> Job for Lone<J> {
    #[inline(always)]
    fn make(n: u64) -> Self {
        Lone(J::make(n))
    }

    #[inline(always)]
    fn sum(&self) -> u64 {
        self.0.sum()
    }
}

#[derive(Clone, Copy)]
enum Workload {
    /// Two threads, one job there and back.
    RoundTrip { pause: bool },
    /// Two threads, jobs in one direction.
    Stream { capacity: usize, pause: bool },
    /// One thread, one job or batch in and out.
    Pair,
}

const COURSES: [(Workload, &str); 6] = [
    (Workload::RoundTrip { pause: false }, "round trip, bare"),
    (Workload::RoundTrip { pause: true }, "… pause"),
    (Workload::Stream { capacity: 64, pause: false }, "stream, 64 slots, bare"),
    (Workload::Stream { capacity: 64, pause: true }, "… pause"),
    (Workload::Stream { capacity: 1024, pause: true }, "1024 slots, pause"),
    (Workload::Pair, "one thread"),
];

const RTRB: &str = "rtrb";
const CHUNKS: &str = "– chunks of 16";
const NUMBERED: &str = "robot-work-queue";
const CHECKED: &str = "– each number checked";
const BATCHES: &str = "– batches of 16";

/// The compared contenders, the courses, and the highest ratio of the medians. For 56 bytes a stream has another goal.
const GOALS: [(&str, &str, &[usize], f64); 5] = [
    (BATCHES, CHUNKS, &[2, 3], 1.0),
    (NUMBERED, RTRB, &[2, 3], 1.0),
    (CHECKED, RTRB, &[2, 3], 1.1),
    (NUMBERED, RTRB, &[0, 1], 0.9),
    (NUMBERED, RTRB, &[5], 1.0),
];

#[derive(Clone, Copy)]
struct Sample {
    /// Nanoseconds for each job.
    time: f64,
    /// Nanoseconds of a cache line's round trip just before; `None` for one thread.
    line: Option<f64>,
}

/// `None` if it does not run on this course.
type Run = fn(Workload, &Cores) -> Option<Sample>;

fn contenders<J: Job>() -> [(&'static str, Run); 13] {
    fn ours<J: Job>(
        n: usize,
    ) -> (robot_work_queue::Writer<'static, J>, robot_work_queue::Reader<'static, J>) {
        robot_work_queue::boxed(n, MAX_NUMBER).unwrap()
    }
    fn heapless<J: Job, const N: usize>()
    -> (heapless::spsc::Producer<'static, J>, heapless::spsc::Consumer<'static, J>) {
        Box::leak(Box::new(heapless::spsc::Queue::<J, N>::new())).split()
    }
    [
        (RTRB, |course, cores| sample::<J, _, _>(course, cores, rtrb::RingBuffer::new)),
        (CHUNKS, |course, cores| {
            batches::<J, _, _>(course, cores, |n| {
                let (writer, reader) = rtrb::RingBuffer::new(n);
                (Batches(writer), Batches(reader))
            })
        }),
        ("– aligned to lines", |course, cores| {
            sample::<Lone<J>, _, _>(course, cores, rtrb::RingBuffer::new)
        }),
        (NUMBERED, |course, cores| sample::<J, _, _>(course, cores, ours)),
        (CHECKED, |course, cores| {
            sample::<J, _, _>(course, cores, |n| {
                let (writer, reader) = ours(n);
                (Checked { writer, next: 1 }, reader)
            })
        }),
        (BATCHES, |course, cores| {
            batches::<J, _, _>(course, cores, |n| {
                let (writer, reader) = ours(n);
                (Batches(writer), Batches(reader))
            })
        }),
        ("– with low water", |course, cores| {
            sample::<J, _, _>(course, cores, |n| {
                let (writer, reader) = ours(n);
                (LowWater(writer), reader)
            })
        }),
        ("– aligned to lines", |course, cores| sample::<Lone<J>, _, _>(course, cores, ours)),
        ("ringbuf", |course, cores| sample::<J, _, _>(course, cores, |n| ringbuf::HeapRb::new(n).split())),
        ("heapless", |course, cores| match course {
            Workload::Stream { capacity: 1024, .. } => {
                sample::<J, _, _>(course, cores, |_| heapless::<J, 1025>())
            }
            _ => sample::<J, _, _>(course, cores, |_| heapless::<J, 65>()),
        }),
        ("crossbeam", |course, cores| {
            sample::<J, _, _>(course, cores, |n| {
                let queue = Arc::new(crossbeam_queue::ArrayQueue::new(n));
                (queue.clone(), queue)
            })
        }),
        ("gil", |course, cores| {
            sample::<J, _, _>(course, cores, |n| gil::spsc::channel(NonZeroUsize::new(n).unwrap()))
        }),
        ("nexus-queue", |course, cores| sample::<J, _, _>(course, cores, nexus_queue::spsc::ring_buffer)),
    ]
}

/// Returns the number of missed goals.
pub(crate) fn race() -> usize {
    let Some(cores) = Cores::find() else {
        println!("queue: no race, because there are not two processors");
        return 0;
    };
    println!(
        "queue: time for each job, divided by rtrb's of the same round; medians of {ROUNDS} rounds, and quartiles"
    );
    race_of("u64", contenders::<u64>(), 1.0, &cores)
        + race_of("56 bytes", contenders::<[u64; 7]>(), 0.6, &cores)
        + race_of("64 bytes", contenders::<[u64; 8]>(), 1.0, &cores)
}

fn race_of<const N: usize>(job: &str, contenders: [(&str, Run); N], streamed: f64, cores: &Cores) -> usize {
    let mut samples = vec![vec![Vec::new(); COURSES.len()]; N];
    for round in 0..ROUNDS {
        for (course, (kind, _)) in COURSES.iter().enumerate() {
            for turn in 0..N {
                let contender = (round + turn) % N;
                samples[contender][course].extend(contenders[contender].1(*kind, cores));
            }
        }
    }
    let [first, second, third, fourth, fifth, sixth] = COURSES.map(|(_, name)| name);
    let mut races = table([job, first, second, third, fourth, fifth, sixth]);
    let mut on_one_core = false;
    for (row, (name, _)) in contenders.iter().enumerate() {
        let cells = samples[row].iter().zip(&samples[0]).map(|(times, of_rtrb)| {
            let (spread, decimals, unit) = match row {
                0 => (Quartiles::of(times.iter().map(|sample| (sample.time, is_one_core(sample)))), 1, " ns"),
                _ => (Quartiles::of_ratios(times, of_rtrb), 2, ""),
            };
            on_one_core |= spread.as_ref().is_some_and(|spread| spread.on_one_core);
            spread.map_or("–".into(), |spread| spread.show(decimals, unit))
        });
        races.add_row(std::iter::once((*name).to_owned()).chain(cells));
    }
    println!("{races}");
    let row = |name: &str| contenders.iter().position(|(contender, _)| *contender == name).unwrap();
    let mut missed = 0;
    let mut goals = table(["goal", "beside", "course", "ratio", "at most", ""]);
    for (ours, peer, courses, most) in GOALS {
        let most = if ours == NUMBERED && courses[0] == 2 { streamed } else { most };
        for &course in courses {
            let ratio = Quartiles::of_ratios(&samples[row(ours)][course], &samples[row(peer)][course]);
            let is_met = ratio.as_ref().is_some_and(|ratio| ratio.median <= most);
            missed += usize::from(!is_met);
            let ratio = ratio.map_or("–".into(), |ratio| ratio.show(2, ""));
            let name = match COURSES[course].0 {
                Workload::RoundTrip { pause } => format!("round trip, {}", waits(pause)),
                Workload::Stream { pause, .. } => format!("stream, 64 slots, {}", waits(pause)),
                Workload::Pair => "one thread".into(),
            };
            let verdict = if is_met { "met" } else { "MISSED" };
            goals.add_row([ours, peer, &name, &ratio, &format!("{most:.1}"), verdict]);
        }
    }
    println!("{goals}");
    if on_one_core {
        println!("* The two processors were threads of one core most of the time.");
    }
    let mut lines: Vec<f64> = samples.iter().flatten().flatten().filter_map(|sample| sample.line).collect();
    let lines = Quartiles::of(lines.drain(..).map(|line| (line, false)));
    println!(
        "A bare cache line there and back: {}\n",
        lines.map_or("–".into(), |lines| lines.show(0, " ns"))
    );
    missed
}

fn waits(pause: bool) -> &'static str {
    if pause { "pause" } else { "bare" }
}

fn is_one_core(sample: &Sample) -> bool {
    sample.line.is_some_and(|line| line < ONE_CORE)
}

/// The quartiles of the values on two cores, or of those on one core if there are fewer than [`FEWEST`] on two.
struct Quartiles {
    lower: f64,
    median: f64,
    upper: f64,
    on_one_core: bool,
}

impl Quartiles {
    /// Returns the quartiles of values, each with whether it was measured on one core.
    fn of(values: impl Iterator<Item = (f64, bool)>) -> Option<Self> {
        let (one, two): (Vec<_>, Vec<_>) = values.partition(|(_, on_one_core)| *on_one_core);
        let on_one_core = two.len() < FEWEST;
        let mut chosen: Vec<f64> =
            if on_one_core { one } else { two }.iter().map(|(value, _)| *value).collect();
        let median = median(&mut chosen)?; // sorts them
        Some(Quartiles {
            lower: chosen[chosen.len() / 4],
            median,
            upper: chosen[chosen.len() * 3 / 4],
            on_one_core,
        })
    }

    /// Returns the quartiles of the ratios of two contenders, round by round, if the processors were as far apart for both.
    fn of_ratios(ours: &[Sample], peer: &[Sample]) -> Option<Self> {
        let rounds = ours.iter().zip(peer).filter(|(ours, peer)| {
            ours.line.zip(peer.line).is_none_or(|(ours, peer)| ours < peer * 1.5 && peer < ours * 1.5)
        });
        Self::of(rounds.map(|(ours, peer)| (ours.time / peer.time, is_one_core(ours))))
    }

    fn show(&self, decimals: usize, unit: &str) -> String {
        let mark = if self.on_one_core { " *" } else { "" };
        let Quartiles { lower, median, upper, .. } = self;
        format!("{median:.decimals$} ({lower:.decimals$}–{upper:.decimals$}){unit}{mark}")
    }
}

fn sample<J: Job, W: Write<J>, R: Read<J>>(
    course: Workload,
    cores: &Cores,
    ring: impl Fn(usize) -> (W, R),
) -> Option<Sample> {
    match course {
        Workload::RoundTrip { pause } => {
            let line = Some(cores.cache_line());
            Some(Sample { time: round_trip(cores, pause, ring(64), ring(64)), line })
        }
        _ => batches(course, cores, ring),
    }
}

/// Measures batches; `None` for the round trip of one job, which is not a batch.
fn batches<J: Job, W: Write<J>, R: Read<J>>(
    course: Workload,
    cores: &Cores,
    ring: impl Fn(usize) -> (W, R),
) -> Option<Sample> {
    match course {
        Workload::RoundTrip { .. } => None,
        Workload::Stream { capacity, pause } => {
            let line = Some(cores.cache_line());
            Some(Sample { time: stream(cores, pause, ring(capacity)), line })
        }
        Workload::Pair => Some(Sample { time: pair(ring(64)), line: None }),
    }
}

fn round_trip<J: Job, W: Write<J>, R: Read<J>>(
    cores: &Cores,
    pause: bool,
    there: (W, R),
    back: (W, R),
) -> f64 {
    let (mut ping, mut there) = there;
    let (mut pong, mut back) = back;
    let echo = cores.second(move || {
        for n in 0..ROUND_TRIPS {
            while there.read(|job| assert_eq!(job.sum(), J::make(n).sum())) == 0 {
                wait(pause);
            }
            pong.write(|| J::make(n));
        }
    });
    let start = Instant::now();
    for n in 0..ROUND_TRIPS {
        ping.write(|| J::make(n));
        while back.read(|job| assert_eq!(job.sum(), J::make(n).sum())) == 0 {
            wait(pause);
        }
    }
    let time = start.elapsed();
    echo.join().unwrap();
    time.as_nanos() as f64 / ROUND_TRIPS as f64
}

fn stream<J: Job, W: Write<J>, R: Read<J>>(
    cores: &Cores,
    pause: bool,
    (mut writer, mut reader): (W, R),
) -> f64 {
    let writing = cores.second(move || {
        let mut n = 0;
        while n < STREAMED {
            match writer.write_from(n, STREAMED, J::make) {
                0 => writer.wait(pause),
                count => n += count,
            }
        }
    });
    let start = Instant::now();
    let mut n = 0;
    while n < STREAMED {
        let mut next = n;
        let count = reader.read(|job| {
            assert_eq!(job.sum(), J::make(next).sum());
            next += 1;
        });
        if count == 0 {
            wait(pause);
        }
        n += count;
    }
    let time = start.elapsed();
    writing.join().unwrap();
    time.as_nanos() as f64 / STREAMED as f64
}

fn pair<J: Job, W: Write<J>, R: Read<J>>((mut writer, mut reader): (W, R)) -> f64 {
    let start = Instant::now();
    let mut n = 0;
    while n < PAIRS {
        let end = n + black_box(&mut writer).write_from(black_box(n), PAIRS, J::make);
        assert!(end > n);
        while n < end {
            n += black_box(&mut reader).read(|job| {
                black_box(job.sum());
            });
        }
    }
    start.elapsed().as_nanos() as f64 / PAIRS as f64
}
