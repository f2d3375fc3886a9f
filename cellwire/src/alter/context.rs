//! The common parts of the host's threads: the clock, the reports, the stop, the trace.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::time::Duration;

use super::messages::Notification;
use cellwire_io::clock::Clock;
use cellwire_io::trace::Trace;

/// The common parts of the host's threads.
#[derive(Clone)]
pub(super) struct Context {
    pub(super) clock: Clock,
    pub(super) notify: SyncSender<(Duration, Notification)>,
    pub(super) stop: Arc<AtomicBool>,
    /// Whether ALTER runs: a recording begins then.
    pub(super) runs: Arc<AtomicBool>,
    pub(super) trace: Trace,
    pub(super) ended_traces: Sender<(Trace, String)>,
}

impl Context {
    pub(super) fn notify(&self, notification: Notification) {
        let _ = self.notify.try_send((self.clock.now(), notification));
    }

    pub(super) fn runs(&self) -> bool {
        self.runs.load(Ordering::Relaxed)
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Writes the trace of a session that ended.
    pub(super) fn end_trace(&self, why: &str) {
        report_trace(&self.trace, why, &self.notify, self.clock);
    }

    /// Ends the trace while the next session may begin already, so that a slow file system does not block it.
    pub(super) fn end_trace_aside(&self, why: &str) {
        let _ = self.ended_traces.send((self.trace.clone(), why.into()));
    }
}

/// Writes traces of sessions that ended, until the host is gone.
pub(super) fn write_traces(
    ended: &Receiver<(Trace, String)>,
    clock: Clock,
    notify: &SyncSender<(Duration, Notification)>,
) {
    while let Ok((trace, why)) = ended.recv() {
        report_trace(&trace, &why, notify, clock);
    }
}

fn report_trace(trace: &Trace, why: &str, notify: &SyncSender<(Duration, Notification)>, clock: Clock) {
    let notification = match trace.session_ended(why) {
        Ok(Some(path)) => Notification::Trace(path),
        Ok(None) => return,
        Err(error) => Notification::PortLost("trace", format!("{error:#}")),
    };
    let _ = notify.try_send((clock.now(), notification));
}
