//! Parsing, checking and queueing allocates nothing: counted by this program's allocator.

#![cfg(feature = "alloc")]
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use core::time::Duration;
use std::alloc::System;

use kawasaki_msg::motion::boxed;
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    AddResult, Bounds, Dialect, Job, JobKind, Limits, Line, Packet, Pc, PcConfig, Point, Robot, RobotConfig,
    Supply,
};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory of the caller's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(f: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.get();
    f();
    ALLOCATIONS.get() - before
}

fn line(index: u32) -> Line {
    let at = |n: u32| Point::new(i32::try_from(n).unwrap() * 97 % 80_000, 500);
    Line { kind: JobKind::Draw, start: at(index), end: at(index + 1) }
}

#[test]
fn the_count_counts() {
    assert_eq!(allocations(|| drop(core::hint::black_box(Box::new(1)))), 1);
}

#[test]
fn a_packet_of_jobs_is_parsed_checked_and_queued_without_an_allocation() {
    let (writer, _reader) = boxed(128, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), writer).unwrap();
    let (mut buffer, mut queued) = ([0; 4096], 0);
    let count = allocations(|| {
        robot.handle_timeout(Duration::ZERO);
        robot.handle_connected(Duration::ZERO);
        robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
        robot.poll_transmit(Duration::ZERO, &mut buffer).unwrap();
        let mut packet = Packet::new(&mut buffer, Limits::TCP, Dialect::DEFAULT);
        for number in 1.. {
            let job = Job { order: 50, number, work: line(u32::from(number)) };
            match packet.push_job(&job, &Bounds::WIDEST) {
                Ok(AddResult::Added) => queued += 1,
                _ => break,
            }
        }
        robot.handle_input(Duration::ZERO, packet.as_bytes());
        // The general way too: corrupt bytes, an unknown name, blanks, the queue's end.
        robot.handle_input(Duration::ZERO, b"roskaa<Tyo$3#50#><X$0##><Tyo$ 16# 50$1$1$0$0$0$0 #>");
        while robot.poll_event().is_some() {}
    });
    assert!(queued > 90);
    assert_eq!((robot.queued(), count), (queued, 0));
}

#[test]
fn a_whole_order_between_both_ends_allocates_nothing() {
    let (jobs, mut motion) = boxed(16, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), jobs).unwrap();
    let source = |index| if index < 500 { Supply::Job(line(index)) } else { Supply::End };
    let mut pc = Pc::new(PcConfig::tcp()).unwrap();
    let mut executed = 0;
    let count = allocations(|| {
        pc.start(50, source).unwrap();
        let (mut now, mut out) = (Duration::ZERO, [0; 4096]);
        robot.handle_timeout(now);
        robot.handle_connected(now);
        pc.handle_connected(now);
        while pc.order().is_some() && now < Duration::from_secs(100) {
            now += Duration::from_millis(16);
            while let Some(job) = motion.take() {
                executed += 1;
                job.complete();
            }
            robot.handle_timeout(now);
            if let Some(length) = robot.poll_transmit(now, &mut out) {
                pc.handle_input(now, &out[..length]);
            }
            now += Duration::from_millis(16);
            if let Some(length) = pc.poll_transmit(now, &mut out) {
                robot.handle_input(now, &out[..length]);
            }
            while robot.poll_event().is_some() || pc.poll_event().is_some() {}
        }
    });
    assert_eq!((executed, count), (500, 0));
}
