//! The controller of a laser robot for a board: the session over any `embedded-io-async` port, and the motion beside it. On
//! a board the hooks set an `embassy_sync` signal and the queue is a static; here it all runs on a computer, whose port is a
//! TCP connection: `cargo run -p cellwire-sim --all-features --example laser_board -- 192.168.0.20:4001`

use core::cell::Cell;
use core::ops::ControlFlow;
use core::time::Duration;
use std::sync::Arc;

use embedded_io_async::{Read, Write};
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Instruction, Item, Refusal};
use robot_session::embedded_io_async::Driver;
use robot_session::{Clock, Session as _};
use robot_work_queue::{Reader, Wake, Writer, boxed_with};
use tokio::sync::Notify;

/// Immediate instructions of this robot, and its query.
const HALT: u16 = 0x0201;
const GO_ON: u16 = 0x0202;
const CLEAR: u16 = 0x0203;
const STATUS: u16 = 0x0301;

/// The capacity of the queue in instructions.
const QUEUE: usize = 32;

/// An instruction of the motion: its command word, and where the tool goes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cut {
    word: u16,
    to: [f32; 2],
}

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
        match instruction.parameters.next() {
            Some(Ok(Item::F32(values))) => Ok(Self { word: instruction.word, to: values.array().ok_or(())? }),
            _ => Err(()),
        }
    }
}

/// One end of the queue wakes the other.
#[derive(Debug, Clone, Default)]
struct Signal(Arc<Notify>);

impl Wake for Signal {
    fn wake(&self) {
        self.0.notify_one();
    }
}

struct Process;

impl Clock for Process {
    fn now(&self) -> Duration {
        robot_session::now()
    }

    async fn sleep_until(&self, at: Duration) {
        tokio::time::sleep(at.saturating_sub(self.now())).await;
    }
}

type Queue = Writer<'static, Cut, Signal>;

/// Runs the session until the port is gone.
async fn link<P, W>(reader: P, writer: W, queue: Queue, done: Signal, motion: &Motion) -> Result<(), P::Error>
where
    P: Read,
    W: Write<Error = P::Error>,
{
    let Ok(mut controller) = Controller::new(ControllerConfig::default(), queue) else { return Ok(()) };
    let mut driver: Driver<_, _, _, 256, { Controller::<Cut, Signal>::MAX_TRANSMIT }> =
        Driver::new(reader, writer, Process);
    controller.handle_connected(Process.now());
    loop {
        let turn = driver.turn(&mut controller, done.0.notified(), |controller, event| {
            let ControllerEvent::Execute { word, .. } = event else { return ControlFlow::Continue(()) };
            let (now, held) = (Process.now(), controller.queue_mut().len());
            let answered = match word {
                HALT | GO_ON => {
                    motion.halt(word == HALT);
                    controller.answer(now, |_| Ok(()))
                }
                CLEAR => {
                    controller.queue_mut().clear();
                    controller.answer(now, |_| Ok(()))
                }
                STATUS => {
                    let numbers = [1, QUEUE, held].map(|number| i16::try_from(number).unwrap_or(i16::MAX));
                    controller.answer(now, |values| values.i16(&numbers).map(drop))
                }
                _ => controller.refuse(now, Refusal::UnknownCommand),
            };
            if answered.is_err() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        if turn.await?.is_break() {
            return Ok(());
        }
    }
}

/// Whether the robot moves.
#[derive(Debug, Default)]
struct Motion {
    is_halted: Cell<bool>,
    changed: Signal,
}

impl Motion {
    fn halt(&self, halts: bool) {
        self.is_halted.set(halts);
        self.changed.wake();
    }

    /// Executes one instruction after the other; while halted, takes none, but notices that the queue was emptied.
    async fn run(&self, mut queue: Reader<'static, Cut, Signal>, mut cut: impl AsyncFnMut(Cut)) {
        loop {
            let halted = self.is_halted.get();
            match if halted { queue.take_where(|_, _| false) } else { queue.take() } {
                Some(job) => {
                    cut(*job).await;
                    job.complete();
                }
                None => self.changed.0.notified().await,
            }
        }
    }
}

async fn board<P, W>(reader: P, writer: W, cut: impl AsyncFnMut(Cut)) -> Result<(), P::Error>
where
    P: Read,
    W: Write<Error = P::Error>,
{
    let (motion, done) = (Motion::default(), Signal::default());
    let Ok((queued, queue)) = boxed_with(QUEUE, 9999, motion.changed.clone(), done.clone()) else {
        return Ok(());
    };
    tokio::select! {
        ended = link(reader, writer, queued, done, &motion) => ended,
        () = motion.run(queue, cut) => Ok(()),
    }
}

/// A half of what tokio reads and writes as a port.
struct Half<T>(T);

impl<T> embedded_io_async::ErrorType for Half<T> {
    type Error = std::io::Error;
}

impl<T: tokio::io::AsyncRead + Unpin> Read for Half<T> {
    async fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        tokio::io::AsyncReadExt::read(&mut self.0, buffer).await
    }
}

impl<T: tokio::io::AsyncWrite + Unpin> Write for Half<T> {
    async fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        tokio::io::AsyncWriteExt::write(&mut self.0, bytes).await
    }

    async fn flush(&mut self) -> std::io::Result<()> {
        tokio::io::AsyncWriteExt::flush(&mut self.0).await
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: ADDRESS")?;
    let (reader, writer) = tokio::net::TcpStream::connect(address).await?.into_split();
    let cut = async |cut: Cut| {
        tokio::time::sleep(Duration::from_millis(20)).await;
        println!("{:04X} to {:?}", cut.word, cut.to);
    };
    Ok(board(Half(reader), Half(writer), cut).await?)
}

#[cfg(test)]
mod tests {
    use cellwire_sim::{Fault, LaserHost, Script, Settings as _};
    use laser_eb90::HostEvent;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[tokio::test]
    async fn nothing_is_cut_twice_and_what_is_acknowledged_is_cut() {
        let cuts = (0..200u8).map(|n| (0x0101, vec![f32::from(n), 1.0]));
        let instructions = [(HALT, vec![]), (GO_ON, vec![])].into_iter().chain(cuts).collect();
        let sim = LaserHost { instructions, ..LaserHost::default() }.listen("127.0.0.1:0").unwrap();
        let script = Script::new().answer(4, Fault::Corrupt).request(6, Fault::Drop).answer(8, Fault::Drop);
        sim.faults().follow(script.request(9, Fault::Freeze(300 * MS)).answer(11, Fault::Delay(40 * MS)));
        let stream = tokio::net::TcpStream::connect(sim.address()).await.unwrap();
        let (reader, writer) = stream.into_split();
        let mut done = Vec::new();
        let cut = async |cut: Cut| done.push(cut.to[0]);
        let _ = tokio::time::timeout(8000 * MS, board(Half(reader), Half(writer), cut)).await;
        let (mut acknowledged, mut unknown) = (0, 0);
        for outcome in sim.executed() {
            match outcome.work {
                HostEvent::Done { count, .. } => acknowledged += usize::from(count),
                HostEvent::Unknown { count, .. } => unknown += usize::from(count),
                _ => {}
            }
        }
        assert_eq!((acknowledged + unknown, sim.faults().happened().len()), (202, 5));
        assert!(done.windows(2).all(|two| two[0] < two[1]), "{done:?}");
        assert!(
            (acknowledged - 2..=200).contains(&done.len()) && unknown > 0,
            "{acknowledged} {unknown} {done:?}"
        );
    }
}
