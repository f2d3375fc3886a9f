//! The queue against other rings of one writer and one reader.
//!
//! Both threads are pinned, and every body is inlined. Before each sample of two threads the round trip of a cache line is measured:
//! if it is too fast, the two processors are hyper-threads of one core at that time, as a virtual machine's may be. Such samples are
//! used only where there are not enough others, and the table says so.

mod cores;
mod rings;

use std::hint::{black_box, spin_loop};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Instant;

use benches::{median, table};
use ringbuf::traits::Split as _;

use cores::Cores;
use rings::{Batches, Checked, LowWater, MAX_NUMBER, Read, Write};

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
    RoundTrip,
    /// Two threads, jobs in one direction without a pause; the capacity.
    Stream(usize),
    /// One thread, one job in and out.
    Pair,
}

const COURSES: [(Course, &str); 4] = [
    (Course::RoundTrip, "round trip"),
    (Course::Stream(64), "stream, capacity 64"),
    (Course::Stream(1024), "stream, capacity 1024"),
    (Course::Pair, "one thread"),
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
        ("rtrb", |course, cores| sample::<J, _, _>(course, cores, rtrb::RingBuffer::new)),
        ("– chunks of 16", |course, cores| {
            batches::<J, _, _>(course, cores, |n| {
                let (writer, reader) = rtrb::RingBuffer::new(n);
                (Batches(writer), Batches(reader))
            })
        }),
        ("robot-work-queue", |course, cores| sample::<J, _, _>(course, cores, ours)),
        ("– each number checked", |course, cores| {
            sample::<J, _, _>(course, cores, |n| {
                let (writer, reader) = ours(n);
                (Checked { writer, next: 1 }, reader)
            })
        }),
        ("– batches of 16", |course, cores| {
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
            Course::Stream(1024) => sample::<J, _, _>(course, cores, |_| heapless::<J, 1025>()),
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

pub(crate) fn race() {
    let Some(cores) = Cores::find() else {
        println!("queue: no race, because there are not two processors");
        return;
    };
    println!(
        "queue: time for each job, divided by rtrb's median; medians of {ROUNDS} samples, and quartiles"
    );
    race_of("u64", contenders::<u64>(), &cores);
    race_of("56 bytes", contenders::<[u64; 7]>(), &cores);
    race_of("64 bytes", contenders::<[u64; 8]>(), &cores);
}

fn race_of<const N: usize>(job: &str, contenders: [(&str, Sample); N], cores: &Cores) {
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
    let mut table = table([job, COURSES[0].1, COURSES[1].1, COURSES[2].1, COURSES[3].1]);
    for ((name, _), row) in contenders.iter().zip(&times) {
        let cells = row.iter().zip(&times[0]).map(|cell| match cell {
            (Some(time), Some(rtrb)) => time.divided_by(rtrb.median),
            _ => "–".into(),
        });
        table.add_row(std::iter::once((*name).to_owned()).chain(cells));
    }
    println!("{table}");
    if times.iter().flatten().flatten().any(|time| time.on_one_core) {
        println!("* The two processors were threads of one core most of the time.");
    }
    let mut probes = cores.probes.borrow_mut();
    println!("A bare cache line there and back: {:.0} ns\n", median(&mut probes).unwrap_or(f64::NAN));
    probes.clear();
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

    fn divided_by(&self, rtrb: f64) -> String {
        let mark = if self.on_one_core { " *" } else { "" };
        let [lower, median, upper] = [self.lower, self.median, self.upper].map(|time| time / rtrb);
        format!("{median:.2} ({lower:.2}–{upper:.2}), {:.1} ns{mark}", self.median)
    }
}

fn sample<J: Job, W: Write<J>, R: Read<J>>(
    course: Course,
    cores: &Cores,
    ring: impl Fn(usize) -> (W, R),
) -> Option<(f64, bool)> {
    match course {
        Course::RoundTrip => {
            let are_two = cores.are_two();
            Some((round_trip(cores, ring(64), ring(64)), are_two))
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
        Course::RoundTrip => None,
        Course::Stream(capacity) => {
            let are_two = cores.are_two();
            Some((stream(cores, ring(capacity)), are_two))
        }
        Course::Pair => Some((pair(ring(64)), true)),
    }
}

fn round_trip<J: Job, W: Write<J>, R: Read<J>>(cores: &Cores, there: (W, R), back: (W, R)) -> f64 {
    let (mut ping, mut there) = there;
    let (mut pong, mut back) = back;
    let echo = cores.second(move || {
        for n in 0..ROUND_TRIPS {
            while there.read(|job| assert_eq!(job.sum(), J::make(n).sum())) == 0 {
                spin_loop();
            }
            pong.write(|| J::make(n));
        }
    });
    let start = Instant::now();
    for n in 0..ROUND_TRIPS {
        ping.write(|| J::make(n));
        while back.read(|job| assert_eq!(job.sum(), J::make(n).sum())) == 0 {
            spin_loop();
        }
    }
    let time = start.elapsed();
    echo.join().unwrap();
    time.as_nanos() as f64 / ROUND_TRIPS as f64
}

fn stream<J: Job, W: Write<J>, R: Read<J>>(cores: &Cores, (mut writer, mut reader): (W, R)) -> f64 {
    let writing = cores.second(move || {
        let mut n = 0;
        while n < STREAMED {
            match writer.write_from(n, STREAMED, J::make) {
                0 => writer.wait(),
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
            spin_loop();
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
