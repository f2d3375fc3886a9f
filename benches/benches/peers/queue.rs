//! The queue against other rings of one writer and one reader.
//!
//! Both threads are pinned. Before each sample of two threads the round trip of a cache line is measured: if it is too fast, the
//! two processors are hyper-threads of one core at that time, as a virtual machine's may be, and the sample is discarded.

use std::cell::RefCell;
use std::hint::{black_box, spin_loop};
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Instant;

use benches::{median, table};
use core_affinity::CoreId;
use ringbuf::traits::{Consumer as _, Producer as _, Split as _};

const ROUNDS: usize = 51;
const ROUND_TRIPS: u64 = 5_000;
const STREAMED: u64 = 50_000;
const PAIRS: u64 = 50_000;
/// A median of fewer samples is not printed.
const FEWEST: usize = 9;

/// If the round trip of a cache line takes fewer nanoseconds than this, the two processors share a core.
const ONE_CORE: f64 = 120.0;

/// The end that queues what `job` returns. `write` returns whether there was space.
trait Write<T>: Send + 'static {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool;

    /// Called before the next attempt if there was no space.
    fn wait(&mut self) {
        spin_loop();
    }
}

/// The end that executes the oldest job. `read` returns whether there was one.
trait Read<T>: Send + 'static {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool;
}

impl<T: Send + 'static> Write<T> for robot_work_queue::Writer<'static, T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        let Ok(claim) = self.claim() else { return false };
        let number = claim.number();
        claim.commit_with(number, job).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for robot_work_queue::Reader<'static, T> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        let Some(job) = self.take() else { return false };
        execute(&job);
        job.complete();
        true
    }
}

/// The same, but after the queue was full it waits until half of it has drained, as a task should.
struct LowWater<T: 'static>(robot_work_queue::Writer<'static, T>);

impl<T: Send + 'static> Write<T> for LowWater<T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.0.write(job)
    }

    fn wait(&mut self) {
        while !self.0.drained(self.0.capacity() / 2) {
            for _ in 0..20 {
                spin_loop();
            }
        }
    }
}

impl<T: Send + 'static> Write<T> for rtrb::Producer<T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        !self.is_full() && self.push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for rtrb::Consumer<T> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        self.pop().map(|job| execute(&job)).is_ok()
    }
}

impl<T: Send + 'static> Write<T> for ringbuf::HeapProd<T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.try_push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for ringbuf::HeapCons<T> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        self.try_pop().map(|job| execute(&job)).is_some()
    }
}

impl<T: Send + 'static> Write<T> for heapless::spsc::Producer<'static, T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.enqueue(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for heapless::spsc::Consumer<'static, T> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        self.dequeue().map(|job| execute(&job)).is_some()
    }
}

impl<T: Send + 'static> Write<T> for Arc<crossbeam_queue::ArrayQueue<T>> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for Arc<crossbeam_queue::ArrayQueue<T>> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        self.pop().map(|job| execute(&job)).is_some()
    }
}

impl<T: Send + 'static> Write<T> for gil::spsc::Sender<T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.try_send(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for gil::spsc::Receiver<T> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        self.try_recv().map(|job| execute(&job)).is_some()
    }
}

impl<T: Send + 'static> Write<T> for nexus_queue::spsc::Producer<T> {
    fn write(&mut self, job: impl FnOnce() -> T) -> bool {
        self.push(job()).is_ok()
    }
}

impl<T: Send + 'static> Read<T> for nexus_queue::spsc::Consumer<T> {
    fn read(&mut self, execute: impl FnOnce(&T)) -> bool {
        self.pop().map(|job| execute(&job)).is_some()
    }
}

/// A job: built from its number, and checked by its sum.
trait Job: Copy + Send + 'static {
    fn make(n: u64) -> Self;
    fn sum(&self) -> u64;
}

impl Job for u64 {
    fn make(n: u64) -> Self {
        n
    }

    fn sum(&self) -> u64 {
        *self
    }
}

impl<const WORDS: usize> Job for [u64; WORDS] {
    fn make(n: u64) -> Self {
        std::array::from_fn(|word| n + word as u64)
    }

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

/// Nanoseconds for each job; `None` if the processors shared a core.
type Sample = fn(Course, &Cores) -> Option<f64>;

fn contenders<J: Job>() -> [(&'static str, Sample); 8] {
    fn heapless<J: Job, const N: usize>()
    -> (heapless::spsc::Producer<'static, J>, heapless::spsc::Consumer<'static, J>) {
        Box::leak(Box::new(heapless::spsc::Queue::<J, N>::new())).split()
    }
    [
        ("rtrb", |course, cores| sample::<J, _, _>(course, cores, rtrb::RingBuffer::new)),
        ("robot-work-queue", |course, cores| {
            sample::<J, _, _>(course, cores, |n| robot_work_queue::boxed(n, 9999).unwrap())
        }),
        ("– with low water", |course, cores| {
            sample::<J, _, _>(course, cores, |n| {
                let (writer, reader) = robot_work_queue::boxed(n, 9999).unwrap();
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
    println!("queue: time for each job, divided by rtrb's; medians of at most {ROUNDS} samples");
    race_of("u64", contenders::<u64>(), &cores);
    race_of("56 bytes", contenders::<[u64; 7]>(), &cores);
    race_of("64 bytes", contenders::<[u64; 8]>(), &cores);
}

fn race_of(job: &str, contenders: [(&str, Sample); 8], cores: &Cores) {
    let mut samples = vec![vec![Vec::new(); COURSES.len()]; contenders.len()];
    for round in 0..ROUNDS {
        for turn in 0..contenders.len() {
            let contender = (round + turn) % contenders.len();
            for (course, samples) in COURSES.iter().zip(&mut samples[contender]) {
                samples.extend(contenders[contender].1(course.0, cores));
            }
        }
    }
    let medians: Vec<Vec<Option<f64>>> = samples
        .iter_mut()
        .map(|courses| {
            let enough = |samples: &&mut Vec<f64>| samples.len() >= FEWEST;
            courses.iter_mut().map(|samples| Some(samples).filter(enough).and_then(|s| median(s))).collect()
        })
        .collect();
    let mut table = table([job, COURSES[0].1, COURSES[1].1, COURSES[2].1, COURSES[3].1]);
    for ((name, _), times) in contenders.iter().zip(&medians) {
        let cells = times.iter().zip(&medians[0]).map(|(time, rtrb)| match (time, rtrb) {
            (Some(time), Some(rtrb)) => format!("{:.2} ({time:.1} ns)", time / rtrb),
            _ => "–".into(),
        });
        table.add_row(std::iter::once((*name).to_owned()).chain(cells));
    }
    println!("{table}");
    let (probes, taken) = (&mut cores.probes.borrow_mut(), samples[0][0].len());
    println!(
        "{taken} of {ROUNDS} samples of rtrb's round trip were taken on two cores; a bare cache line there and back: {:.0} ns",
        median(probes).unwrap_or(f64::NAN)
    );
    if taken < FEWEST {
        println!(
            "The two processors are threads of one core at this time: there are no times for two threads. Run it again later."
        );
    }
    println!();
    probes.clear();
}

fn sample<J: Job, W: Write<J>, R: Read<J>>(
    course: Course,
    cores: &Cores,
    ring: impl Fn(usize) -> (W, R),
) -> Option<f64> {
    match course {
        Course::RoundTrip => cores.are_two().then(|| round_trip(cores, ring(64), ring(64))),
        Course::Stream(capacity) => cores.are_two().then(|| stream(cores, ring(capacity))),
        Course::Pair => Some(pair(cores, ring(64))),
    }
}

fn round_trip<J: Job, W: Write<J>, R: Read<J>>(cores: &Cores, there: (W, R), back: (W, R)) -> f64 {
    let (mut ping, mut there) = there;
    let (mut pong, mut back) = back;
    let echo = cores.second(move || {
        for n in 0..ROUND_TRIPS {
            while !there.read(|job| assert_eq!(job.sum(), J::make(n).sum())) {
                spin_loop();
            }
            pong.write(|| J::make(n));
        }
    });
    let start = Instant::now();
    for n in 0..ROUND_TRIPS {
        ping.write(|| J::make(n));
        while !back.read(|job| assert_eq!(job.sum(), J::make(n).sum())) {
            spin_loop();
        }
    }
    let time = start.elapsed();
    echo.join().unwrap();
    time.as_nanos() as f64 / ROUND_TRIPS as f64
}

fn stream<J: Job, W: Write<J>, R: Read<J>>(cores: &Cores, (mut writer, mut reader): (W, R)) -> f64 {
    let writing = cores.second(move || {
        for n in 0..STREAMED {
            while !writer.write(|| J::make(n)) {
                writer.wait();
            }
        }
    });
    let start = Instant::now();
    for n in 0..STREAMED {
        while !reader.read(|job| assert_eq!(job.sum(), J::make(n).sum())) {
            spin_loop();
        }
    }
    let time = start.elapsed();
    writing.join().unwrap();
    time.as_nanos() as f64 / STREAMED as f64
}

fn pair<J: Job, W: Write<J>, R: Read<J>>(_: &Cores, (mut writer, mut reader): (W, R)) -> f64 {
    let start = Instant::now();
    for n in 0..PAIRS {
        let n = black_box(n);
        assert!(black_box(&mut writer).write(|| J::make(n)));
        assert!(black_box(&mut reader).read(|job| {
            black_box(job.sum());
        }));
    }
    start.elapsed().as_nanos() as f64 / PAIRS as f64
}

/// Two processors; this thread is on the first.
struct Cores {
    second: CoreId,
    /// The round trips of a cache line while the two processors did not share a core.
    probes: RefCell<Vec<f64>>,
}

impl Cores {
    fn find() -> Option<Self> {
        let ids = core_affinity::get_core_ids()?;
        let (&first, &second) = (ids.first()?, ids.get(1)?);
        core_affinity::set_for_current(first);
        Some(Cores { second, probes: RefCell::default() })
    }

    /// Runs `run` on the other processor, and returns when it is about to begin.
    fn second<R: Send + 'static>(&self, run: impl FnOnce() -> R + Send + 'static) -> thread::JoinHandle<R> {
        let core = self.second;
        let (ready, wait) = mpsc::channel();
        let thread = thread::spawn(move || {
            core_affinity::set_for_current(core);
            ready.send(()).unwrap();
            run()
        });
        wait.recv().unwrap();
        thread
    }

    fn are_two(&self) -> bool {
        let probe = self.cache_line();
        let two = probe >= ONE_CORE;
        if two {
            self.probes.borrow_mut().push(probe);
        }
        two
    }

    fn cache_line(&self) -> f64 {
        const TURNS: u64 = 2_000;
        let line = Arc::new(AtomicU64::new(0));
        let echoed = line.clone();
        let echo = self.second(move || {
            for turn in 0..TURNS {
                while echoed.load(Ordering::Acquire) != 2 * turn + 1 {
                    spin_loop();
                }
                echoed.store(2 * turn + 2, Ordering::Release);
            }
        });
        let start = Instant::now();
        for turn in 0..TURNS {
            line.store(2 * turn + 1, Ordering::Release);
            while line.load(Ordering::Acquire) != 2 * turn + 2 {
                spin_loop();
            }
        }
        let time = start.elapsed();
        echo.join().unwrap();
        time.as_nanos() as f64 / TURNS as f64
    }
}
