//! A communication task and a motion task in two threads: `cargo run -p robot-work-queue --example two_threads`

use core::error::Error;
use core::time::Duration;
use std::thread;

use robot_work_queue::WorkQueue;

/// A straight line to draw, in tenths of a millimetre.
#[derive(Debug, PartialEq)]
struct Line {
    from: [i16; 2],
    to: [i16; 2],
}

const JOBS: i16 = 40;
const LOW_WATER: usize = 2;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let mut queue: WorkQueue<Line, 8> = WorkQueue::new(1000)?;
    let (mut writer, mut reader) = queue.split();

    thread::scope(|scope| {
        let communication = scope.spawn(move || {
            let mut refills = 0;
            for n in 0..JOBS {
                if writer.is_full() {
                    refills += 1;
                    while !writer.drained(LOW_WATER) && !writer.is_abandoned() {
                        thread::sleep(Duration::from_millis(1)); // a real task does its other work here
                    }
                }
                let claim = writer.claim()?;
                let number = claim.number(); // a real task receives it from the peer
                claim.commit_with(number, || Line { from: [n, 0], to: [n + 1, 10] })?;
            }
            println!(
                "queued {JOBS} jobs, the last one is {:?}, after {refills} refills",
                writer.last_number()
            );
            Ok::<(), Box<dyn Error + Send + Sync>>(())
        });

        let mut executed = 0;
        loop {
            let last_look = reader.is_abandoned(); // before `take`: then an empty queue stays empty
            match reader.take() {
                Some(job) => {
                    assert_eq!(*job, Line { from: [executed, 0], to: [executed + 1, 10] });
                    thread::sleep(Duration::from_micros(200)); // the robot moves
                    executed += 1;
                    job.complete();
                }
                None if last_look => break,
                None => thread::yield_now(),
            }
        }
        println!("executed {executed} jobs, each once and in order");
        communication.join().map_err(|_| "the communication task panicked")?
    })
}
