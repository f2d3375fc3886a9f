//! The timing of a server during a scan: its lost requests, and the settings that help.

use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use fanuc_hmi_modbus::Failure;

use crate::devices::fanuc_hmi_modbus::client::{Client, RequestOutcome};
use cellwire_io::interrupt;
use cellwire_io::output::{counted, remark};

/// A request that is lost after a connection was opened is made again this long after that.
const AFTER_OPENING: Duration = Duration::from_secs(1);
/// A request that is lost after a reply is made again this long after the reply.
const AFTER_REPLY: Duration = Duration::from_millis(500);
/// The connections that a server may close in a row before its first reply.
const MAX_CLOSED: u64 = 8;
/// An interrupt is seen after this time at the latest.
const INTERRUPT_CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// The exchange before a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PrecedingExchange {
    /// The connection was opened.
    Opened,
    /// The server replied at this time.
    Replied(Instant),
    /// A request was lost.
    Lost,
}

/// Statistics of the requests that a server answers only when they are made again.
#[derive(Debug)]
pub(super) struct RetryStatistics {
    before: PrecedingExchange,
    /// The time at which the connection of the last request was opened.
    opened: Option<Instant>,
    /// All replies.
    replies: u64,
    /// Requests that were lost after a connection was opened, and answered later.
    lost_after_opening: u64,
    /// Requests that were lost after a reply, and answered later.
    lost_after_reply: u64,
}

impl RetryStatistics {
    pub(super) fn new() -> Self {
        let before = PrecedingExchange::Opened;
        Self { before, opened: None, replies: 0, lost_after_opening: 0, lost_after_reply: 0 }
    }

    /// Makes a request, and makes it again when it has no reply and was the first of its connection or followed a reply.
    ///
    /// # Errors
    /// The errors of `ask`.
    pub(super) fn ask<T>(
        &mut self,
        client: &mut Client,
        mut ask: impl FnMut(&mut Client) -> Result<Option<RequestOutcome<T>>>,
    ) -> Result<Option<RequestOutcome<T>>> {
        let answer = ask(client)?;
        if self.opened.replace(client.opened()) != Some(client.opened()) {
            self.before = PrecedingExchange::Opened;
        }
        let before = core::mem::replace(&mut self.before, PrecedingExchange::Lost);
        if !matches!(answer, Some(RequestOutcome::Failed(Failure::TimedOut))) {
            self.note(&answer);
            return Ok(answer);
        }
        let (again, count) = match before {
            PrecedingExchange::Opened => (client.opened() + AFTER_OPENING, &mut self.lost_after_opening),
            PrecedingExchange::Replied(at) => (at + AFTER_REPLY, &mut self.lost_after_reply),
            PrecedingExchange::Lost => return Ok(answer),
        };
        while Instant::now() < again {
            if interrupt::requested() {
                return Ok(answer);
            }
            thread::sleep(again.saturating_duration_since(Instant::now()).min(INTERRUPT_CHECK_INTERVAL));
        }
        let answer = ask(client)?;
        *count += u64::from(matches!(answer, Some(RequestOutcome::Replied(_))));
        self.opened = Some(client.opened());
        self.note(&answer);
        Ok(answer)
    }

    fn note<T>(&mut self, answer: &Option<RequestOutcome<T>>) {
        if matches!(answer, Some(RequestOutcome::Replied(_))) {
            self.replies += 1;
            self.before = PrecedingExchange::Replied(Instant::now());
        }
    }

    /// Returns whether the server closes every connection, so that no unit replies.
    pub(super) fn closes_all(&self, client: &Client) -> bool {
        self.replies == 0 && client.lost_connections() >= MAX_CLOSED
    }

    /// Reports the lost requests, late replies and closed connections, with the settings that help.
    pub(super) fn report(&self, client: &Client) {
        let requests = |count, were: &str| match count {
            1 => format!("1 request {were} was answered only when it was made again"),
            _ => format!("{count} requests {were} were answered only when they were made again"),
        };
        if self.lost_after_opening > 0 {
            remark(&format!(
                "warning: {}: the server loses the first bytes of a connection; --set connect_pause={}",
                requests(self.lost_after_opening, "at the start of a connection"),
                humantime::format_duration(AFTER_OPENING)
            ));
        }
        if self.lost_after_reply > 0 {
            remark(&format!(
                "warning: {}: the server needs a pause between requests; --set pause={}",
                requests(self.lost_after_reply, "right after a reply"),
                humantime::format_duration(AFTER_REPLY)
            ));
        }
        if client.late_replies() > 0 {
            let replies = if client.late_replies() == 1 { "reply" } else { "replies" };
            remark(&format!(
                "warning: {} {replies} came after the timeout: --set timeout=1s waits longer",
                client.late_replies()
            ));
        }
        if client.lost_connections() == 0 {
            return;
        }
        let closed = counted(client.lost_connections(), "connection");
        remark(&if self.replies == 0 {
            format!(
                "warning: the server closed {closed} and has not replied: it may have room for one client, which is another \
                 program, need --set connect_pause=1s, or expect --set framing=rtu"
            )
        } else {
            format!(
                "warning: the server closed {closed}: it may need --set pause=500ms, or close each connection after a reply"
            )
        });
    }
}
