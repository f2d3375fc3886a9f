//! The queue against other rings of one writer and one reader.
//!
//! Both threads are pinned, and every body is inlined. A thread that waits asks again at once ("bare"), or after the processor's
//! instruction for such loops ("pause"). Before each sample of two threads the round trip of a cache line is measured:
//! if it is too fast, the two processors are hyper-threads of one core at that time, as a virtual machine's may be. Such samples are
//! used only where there are not enough others, and the table says so.

mod cores;
mod rings;

use std::hint::black_box;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Instant;

use benches::{median, table};
use ringbuf::traits::Split as _;

use cores::Cores;
use rings::{Batches, Checked, LowWater, MAX_NUMBER, Read, Write, wait};

const ROUNDS: usize = 51;
const ROUND_TRIPS: u64 = 5_000;
const STREAMED: u64 = 50_000;
const PAIRS: u64 = 50_000;
/// Of fewer samples there is no median.
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

#[derive(Clone, Copy)]
enum Course {
    /// Two threads, one job there and back.
    RoundTrip { pause: bool },
    /// Two threads, jobs in one direction.
    Stream { capacity: usize, pause: bool },
    /// One thread, one job or batch in and out.
    Pair,
}

const COURSES: [(Course, &str); 6] = [
    (Course::RoundTrip { pause: false }, "round trip, bare"),
    (Course::RoundTrip { pause: true }, "… pause"),
    (Course::Stream { capacity: 64, pause: false }, "stream, 64 slots, bare"),
    (Course::Stream { capacity: 64, pause: true }, "… pause"),
    (Course::Stream { capacity: 1024, pause: true }, "1024 slots, pause"),
    (Course::Pair, "one thread"),
];

const RTRB: &str = "rtrb";
const CHUNKS: &str = "– chunks of 16";
const NUMBERED: &str = "robot-work-queue";
const CHECKED: &str = "– each number checked";
const BATCHES: &str = "– batches of 16";

/// What is compared with what, on which courses, and the highest ratio of the medians. Of 56 bytes a stream has another goal.
const GOALS: [(&str, &str, &[usize], f64); 5] = [
    (BATCHES, CHUNKS, &[2, 3], 1.0),
    (NUMBERED, RTRB, &[2, 3], 1.0),
    (CHECKED, RTRB, &[2, 3], 1.1),
    (NUMBERED, RTRB, &[0, 1], 0.9),
    (NUMBERED, RTRB, &[5], 1.0),
];

/// Nanoseconds for each job, and whether the processors were two cores; `None` if it does not run on this course.
type Sample = fn(Course, &Cores) -> Option<(f64, bool)>;

fn contenders<J: Job>() -> [(&'static str, Sample); 11] {
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
        ("ringbuf", |course, cores| sample::<J, _, _>(course, cores, |n| ringbuf::HeapRb::new(n).split())),
        ("heapless", |course, cores| match course {
            Course::Stream { capacity: 1024, .. } => {
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

/// Returns how many goals are missed.
pub(crate) fn race() -> usize {
    let Some(cores) = Cores::find() else {
        println!("queue: no race, because there are not two processors");
        return 0;
    };
    println!(
        "queue: time for each job, divided by rtrb's median; medians of {ROUNDS} samples, and quartiles"
    );
    race_of("u64", contenders::<u64>(), 1.0, &cores)
        + race_of("56 bytes", contenders::<[u64; 7]>(), 0.6, &cores)
        + race_of("64 bytes", contenders::<[u64; 8]>(), 1.0, &cores)
}

fn race_of<const N: usize>(
    job: &str,
    contenders: [(&str, Sample); N],
    streamed: f64,
    cores: &Cores,
) -> usize {
    let mut samples = vec![vec![Vec::new(); COURSES.len()]; N];
    for round in 0..ROUNDS {
        for turn in 0..N {
            let contender = (round + turn) % N;
            for (course, samples) in COURSES.iter().zip(&mut samples[contender]) {
                samples.extend(contenders[contender].1(course.0, cores));
            }
        }
    }
    let times: Vec<Vec<Option<Quartiles>>> =
        samples.iter().map(|courses| courses.iter().map(|course| Quartiles::of(course)).collect()).collect();
    let [first, second, third, fourth, fifth, sixth] = COURSES.map(|(_, name)| name);
    let mut races = table([job, first, second, third, fourth, fifth, sixth]);
    for (row, ((name, _), times_of)) in contenders.iter().zip(&times).enumerate() {
        let cells = times_of.iter().zip(&times[0]).map(|cell| match cell {
            (Some(time), _) if row == 0 => format!("{} ns", time.divided_by(1.0, 1)),
            (Some(time), Some(rtrb)) => time.divided_by(rtrb.median, 2),
            _ => "–".into(),
        });
        races.add_row(std::iter::once((*name).to_owned()).chain(cells));
    }
    println!("{races}");
    let median = |name: &str, course: usize| {
        let row = contenders.iter().position(|(contender, _)| *contender == name)?;
        times[row][course].as_ref().map(|time| time.median)
    };
    let mut missed = 0;
    let mut goals = table(["goal", "beside", "course", "ratio", "at most", ""]);
    for (ours, peer, courses, most) in GOALS {
        let most = if ours == NUMBERED && courses[0] == 2 { streamed } else { most };
        for &course in courses {
            let ratio = median(ours, course).zip(median(peer, course)).map(|(ours, peer)| ours / peer);
            let is_met = ratio.is_some_and(|ratio| ratio <= most);
            missed += usize::from(!is_met);
            let ratio = ratio.map_or("–".into(), |ratio| format!("{ratio:.2}"));
            let name = match COURSES[course].0 {
                Course::RoundTrip { pause } => format!("round trip, {}", waits(pause)),
                Course::Stream { pause, .. } => format!("stream, 64 slots, {}", waits(pause)),
                Course::Pair => "one thread".into(),
            };
            let verdict = if is_met { "met" } else { "MISSED" };
            goals.add_row([ours, peer, &name, &ratio, &format!("{most:.1}"), verdict]);
        }
    }
    println!("{goals}");
    if times.iter().flatten().flatten().any(|time| time.on_one_core) {
        println!("* The two processors were threads of one core most of the time.");
    }
    let mut probes = cores.probes.borrow_mut();
    println!(
        "A bare cache line there and back: {:.0} ns\n",
        benches::median(&mut probes).unwrap_or(f64::NAN)
    );
    probes.clear();
    missed
}

fn waits(pause: bool) -> &'static str {
    if pause { "pause" } else { "bare" }
}

/// Of the samples that were taken on two cores, if these are enough.
struct Quartiles {
    lower: f64,
    median: f64,
    upper: f64,
    on_one_core: bool,
}

impl Quartiles {
    fn of(samples: &[(f64, bool)]) -> Option<Self> {
        let on_two = samples.iter().filter(|(_, on_two)| *on_two).count();
        let on_one_core = on_two < FEWEST;
        let chosen = samples.iter().filter(|(_, on_two)| on_one_core || *on_two);
        let mut times: Vec<f64> = chosen.map(|(time, _)| *time).collect();
        let median = median(&mut times)?; // sorts them
        let (lower, upper) = (times[times.len() / 4], times[times.len() * 3 / 4]);
        Some(Quartiles { lower, median, upper, on_one_core })
    }

    fn divided_by(&self, time: f64, decimals: usize) -> String {
        let mark = if self.on_one_core { " *" } else { "" };
        let [lower, median, upper] = [self.lower, self.median, self.upper].map(|own| own / time);
        format!("{median:.decimals$} ({lower:.decimals$}–{upper:.decimals$}){mark}")
    }
}

fn sample<J: Job, W: Write<J>, R: Read<J>>(
    course: Course,
    cores: &Cores,
    ring: impl Fn(usize) -> (W, R),
) -> Option<(f64, bool)> {
    match course {
        Course::RoundTrip { pause } => {
            let are_two = cores.are_two();
            Some((round_trip(cores, pause, ring(64), ring(64)), are_two))
        }
        _ => batches(course, cores, ring),
    }
}

/// One job there and back is no batch.
fn batches<J: Job, W: Write<J>, R: Read<J>>(
    course: Course,
    cores: &Cores,
    ring: impl Fn(usize) -> (W, R),
) -> Option<(f64, bool)> {
    match course {
        Course::RoundTrip { .. } => None,
        Course::Stream { capacity, pause } => {
            let are_two = cores.are_two();
            Some((stream(cores, pause, ring(capacity)), are_two))
        }
        Course::Pair => Some((pair(ring(64)), true)),
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
