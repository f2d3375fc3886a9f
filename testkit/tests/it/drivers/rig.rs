//! A session under each driver, turn by turn.

use core::future::{Future, pending};
use core::ops::ControlFlow;
use core::pin::pin;
use core::task::Context;
use std::io;
use std::time::Duration;

use robot_session::{Clock, Driver, EndReason, Session, embedded_io_async as waiting, tokio as asynchronous};
use tokio::runtime::Runtime;
use tokio::task::yield_now;
use tokio::time::timeout;

use crate::drivers::pipe::Pipe;

/// The kinds of drivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Std,
    Tokio,
    Embedded,
}

pub const KINDS: [Kind; 3] = [Kind::Std, Kind::Tokio, Kind::Embedded];

/// A turn is called again after this.
const TURN: Duration = Duration::from_millis(5);

/// A driver of one connection.
pub enum Rig {
    Std(Driver<Pipe>),
    Tokio(Runtime, asynchronous::Driver<Pipe>),
    Embedded(Runtime, Box<waiting::Driver<Pipe, Pipe, Process, 512, 512>>),
}

/// The way in which a connection is over.
#[derive(Debug, PartialEq, Eq)]
pub enum Over {
    ByPeer,
    Stalled,
    Failed(io::ErrorKind),
}

pub struct Process;

impl Clock for Process {
    fn now(&self) -> Duration {
        robot_session::now()
    }

    async fn sleep_until(&self, at: Duration) {
        tokio::time::sleep(at.saturating_sub(self.now())).await;
    }
}

impl Rig {
    pub fn new(kind: Kind, pipe: Pipe, stall: Duration) -> Self {
        let runtime = || tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        match kind {
            Kind::Std => Self::Std(Driver::new(pipe).stall(stall)),
            Kind::Tokio => Self::Tokio(runtime(), asynchronous::Driver::new(pipe).stall(stall)),
            Kind::Embedded => {
                let driver = waiting::Driver::new(pipe.clone(), pipe, Process).stall(stall);
                Self::Embedded(runtime(), Box::new(driver))
            }
        }
    }

    /// Runs one turn. With `polls` the future of an asynchronous driver is dropped after this many polls, otherwise after
    /// [`TURN`]. `keep` is called before anything is written, after an `.await` of its own.
    pub fn turn<S: Session>(
        &mut self,
        session: &mut S,
        polls: Option<u32>,
        mut keep: impl FnMut(&mut S) -> io::Result<()>,
        mut handler: impl FnMut(&mut S, S::Event),
    ) -> Result<(), Over> {
        let handle = |session: &mut S, event| {
            handler(session, event);
            ControlFlow::<()>::Continue(())
        };
        let keep_later = async |session: &mut S| {
            yield_now().await;
            keep(session)
        };
        let turned = match self {
            Self::Std(driver) => driver.turn_with(session, Some(TURN), keep, handle),
            Self::Tokio(runtime, driver) => {
                dropped(runtime, polls, driver.turn_with(session, keep_later, handle))
            }
            Self::Embedded(runtime, driver) => {
                dropped(runtime, polls, driver.turn_with(session, pending(), keep_later, handle))
            }
        };
        match turned {
            Ok(ControlFlow::Continue(()) | ControlFlow::Break(EndReason::ByHandler(()))) => Ok(()),
            Ok(ControlFlow::Break(EndReason::ByPeer)) => Err(Over::ByPeer),
            Ok(ControlFlow::Break(EndReason::Stalled)) => Err(Over::Stalled),
            Err(error) => Err(Over::Failed(error.kind())),
        }
    }
}

type Turned = io::Result<ControlFlow<EndReason<()>>>;

fn dropped(runtime: &Runtime, polls: Option<u32>, turn: impl Future<Output = Turned>) -> Turned {
    let Some(polls) = polls else {
        return runtime
            .block_on(async { timeout(TURN, turn).await })
            .unwrap_or(Ok(ControlFlow::Continue(())));
    };
    runtime.block_on(async {
        let mut turn = pin!(turn);
        for _ in 0..polls {
            let polled = core::future::poll_fn(|context: &mut Context<'_>| {
                core::task::Poll::Ready(turn.as_mut().poll(context))
            });
            if let core::task::Poll::Ready(turned) = polled.await {
                return turned;
            }
        }
        // The peer's thread may wait for this processor, or for the line's lock.
        std::thread::yield_now();
        Ok(ControlFlow::Continue(()))
    })
}
