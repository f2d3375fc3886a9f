//! A robot and a PC, as their packets show them.

mod packet;

use core::time::Duration;

use anyhow::Result;
use kawasaki_msg::{Dialect, Field, Numbering, Params, PcConfig, RobotConfig, Role, Takeover};

use serde_json::Value;

use self::packet::{Packet, read};
use crate::kawasaki_msg::ends::plant;
use crate::kawasaki_msg::options::CodecSettings;
use crate::settings;
use crate::shadow::{JITTER, LineEvent, Report, Setup, Shadow, UNSEEN, ms};

const ROBOT: &str = "robot";
const PC: &str = "pc";

/// After such a pause, bytes of the same end begin a new packet.
const PAUSE: Duration = Duration::from_millis(20);

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let (pc, robot) = configs(setup)?;
    let dialect = pc.dialect;
    Ok(Box::new(Orders {
        dialect,
        numbers: Numbering::new(pc.max_number),
        datagrams: pc.datagrams,
        reply_timeout: robot.reply_timeout,
        exchange: robot.exchange,
        silence: pc.silence,
        talk: Turn::Unknown,
        packet: None,
        has_bytes: false,
        asked: Requested::default(),
        starts: Starts::default(),
        is_whole: false,
        order: None,
        heard: None,
    }))
}

struct Orders {
    dialect: Dialect,
    numbers: Numbering,
    datagrams: bool,
    reply_timeout: Duration,
    exchange: Duration,
    silence: Duration,
    talk: Turn,
    /// The packet whose messages are coming.
    packet: Option<Packet>,
    /// The PC has sent bytes since the robot's packet: they end the robot's wait, even if they are not a message.
    has_bytes: bool,
    /// The robot's messages since the PC's last answer.
    asked: Requested,
    starts: Starts,
    /// The connection was seen from its beginning, or the robot without an order: which order it is in is known.
    is_whole: bool,
    order: Option<Order>,
    /// The time of the robot's last bytes; `None` once its silence was reported.
    heard: Option<Duration>,
}

/// The end whose turn it is to send.
#[derive(Debug, Clone, Copy)]
enum Turn {
    Unknown,
    /// The robot's; its last packet.
    Robot(Option<Duration>),
    /// The PC's, since the robot's packet.
    Pc {
        since: Duration,
        is_missed: bool,
    },
}

#[derive(Debug, Clone, Copy, Default)]
struct Requested {
    status: bool,
    /// The number of the requested job.
    job: Option<u16>,
    is_damaged: bool,
}

/// The start of an order on this connection.
#[derive(Debug, Clone, Copy, Default)]
struct Starts {
    /// Sent, and not answered yet.
    open: bool,
    /// Sent in the PC's last answer.
    last: bool,
}

/// The progress of an order, in jobs.
#[derive(Debug, Clone, Copy)]
struct Order {
    number: u16,
    executed: u32,
    /// The highest that was acknowledged.
    acked: u32,
    sent: u32,
}

impl Shadow for Orders {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened | LineEvent::Closed | LineEvent::Missed { .. } => {
                self.close(report);
                let is_open = matches!(seen, LineEvent::Opened);
                self.talk = if is_open { Turn::Robot(None) } else { Turn::Unknown };
                self.heard = is_open.then_some(report.now);
                self.is_whole = is_open;
                (self.asked, self.starts) = (Requested::default(), Starts::default());
                if !is_open {
                    self.order = None;
                }
            }
            LineEvent::Message { from, message, .. } => {
                let read = read(&self.dialect, message);
                let packet = self.packet(from, report);
                match read {
                    Some(read) => packet.messages.push(read),
                    None => packet.is_damaged = true,
                }
            }
            LineEvent::Corrupt { from, .. } => self.packet(from, report).is_damaged = true,
            LineEvent::Bytes { from: PC, .. } => {
                if self.packet.as_ref().is_some_and(|packet| packet.from == ROBOT) {
                    self.close(report);
                }
                self.has_bytes = true;
            }
            LineEvent::Bytes { .. } => {}
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let now = report.now;
        if self.packet.as_ref().is_some_and(|packet| now >= packet.last.saturating_add(PAUSE)) {
            self.close(report);
        }
        let limit = self.reply_timeout;
        if let Turn::Pc { since, is_missed } = &mut self.talk
            && !*is_missed
            && now > since.saturating_add(limit)
        {
            *is_missed = true;
            let text = format!("no answer within reply_timeout ({})", ms(limit));
            report.assumption(PC, "KM-51", text);
        }
        if self.heard.is_some_and(|heard| now > heard.saturating_add(self.silence)) {
            self.heard = None;
            let text = format!("the robot says nothing for silence ({})", ms(self.silence));
            report.assumption(ROBOT, "KM-87", text);
        }
    }

    fn state(&self) -> String {
        let turn = match self.talk {
            Turn::Unknown => UNSEEN,
            Turn::Robot(_) => "the robot's turn",
            Turn::Pc { is_missed: false, .. } => "the PC's turn",
            Turn::Pc { is_missed: true, .. } => "the PC has not answered",
        };
        match self.order {
            Some(Order { number, executed, sent, .. }) => {
                format!("{turn}; order {number}: {sent} jobs sent, {executed} executed")
            }
            None => turn.into(),
        }
    }
}

impl Orders {
    /// Returns the packet to which a message of an end belongs.
    fn packet(&mut self, from: &'static str, report: &mut Report<'_>) -> &mut Packet {
        let now = report.now;
        if self.packet.as_ref().is_some_and(|packet| packet.from != from) {
            self.close(report);
        }
        let begin = || Packet { from, begun: now, last: now, messages: Vec::new(), is_damaged: false };
        let packet = self.packet.get_or_insert_with(begin);
        packet.last = now;
        packet
    }

    /// Called when a packet has ended.
    fn close(&mut self, report: &mut Report<'_>) {
        let Some(packet) = self.packet.take() else { return };
        packet.judge(report);
        match packet.from {
            ROBOT => self.told(&packet, report),
            _ => self.answered(&packet, report),
        }
    }

    /// Checks a packet of the robot.
    fn told(&mut self, packet: &Packet, report: &mut Report<'_>) {
        let begun = packet.begun;
        match self.talk {
            Turn::Pc { since, .. }
                if begun.saturating_add(JITTER) < since.saturating_add(self.reply_timeout)
                    && !self.has_bytes =>
            {
                let waited = ms(begun.saturating_sub(since));
                report.rule(ROBOT, "KM-50", format!("a packet {waited} after one that is not answered"));
            }
            Turn::Pc { since, .. } | Turn::Robot(Some(since))
                if begun.saturating_add(JITTER) < since.saturating_add(self.exchange) =>
            {
                let since = ms(begun.saturating_sub(since));
                report.budget(ROBOT, "KM-50", format!("a packet {since} after the one before"));
            }
            _ => {}
        }
        let has_answer = packet.has(Role::OrderAck);
        if !self.datagrams && !matches!(self.talk, Turn::Unknown) && !packet.is_damaged {
            if has_answer && !self.starts.open && self.is_whole {
                report.rule(ROBOT, "KM-52", "an answer to a start that was not sent on this connection");
            }
            // Acknowledgements of jobs come first, and may fill the packet.
            if self.starts.last && !has_answer && !packet.has(Role::JobAck) {
                report.rule(ROBOT, "KM-56", "no answer to the start of an order");
            }
        }
        self.starts.last = false;
        for (role, params) in &packet.messages {
            self.progress(*role, params, report);
        }
        self.asked.status |= packet.has(Role::Status);
        // The first packet that is seen may lack its beginning.
        self.asked.is_damaged |= packet.is_damaged || matches!(self.talk, Turn::Unknown);
        if let Some((_, params)) = packet.messages.iter().find(|(role, _)| *role == Role::JobRequest) {
            self.asked.job = params.number(Field::Number);
        }
        (self.talk, self.heard) = (Turn::Pc { since: packet.last, is_missed: false }, Some(packet.last));
        self.has_bytes = false;
    }

    /// Follows the order in a message of the robot.
    fn progress(&mut self, role: Role, params: &Params, report: &mut Report<'_>) {
        let number = params.number(Field::Order);
        match role {
            Role::OrderAck => {
                self.starts.open = false;
                if self.order.is_some_and(|order| number != Some(order.number)) {
                    self.order = None;
                }
            }
            Role::EndAck => {
                (self.order, self.starts.open) = (None, false);
                self.is_whole |= number == Some(0);
            }
            Role::Status if self.order.is_some_and(|order| number == Some(order.number)) => {
                self.starts.open = false;
            }
            Role::Status if !self.starts.open => {
                self.order = None;
                self.is_whole |= number == Some(0);
            }
            _ => {}
        }
        let numbers = self.numbers;
        let Some(order) = self.order.as_mut().filter(|order| number == Some(order.number)) else { return };
        let count = |number: u16| order.executed.saturating_add(numbers.ahead(order.executed, number));
        let sent = order.sent;
        let mut check = |what: &str, count: u32, clause| {
            if count > sent {
                let text = format!("{what} the job of count {count}, and {sent} were sent");
                report.rule(ROBOT, clause, text);
            }
            count <= sent
        };
        match role {
            Role::JobRequest => {
                if let Some(number) = params.number(Field::Number) {
                    let before = numbers.ahead(order.executed, number).checked_sub(1);
                    let from = order.executed + before.unwrap_or(u32::from(numbers.max()) - 1);
                    check("asks for the jobs after", from, "KM-67");
                }
            }
            Role::Pause => {
                if let Some(queued) = params.number(Field::Queued) {
                    check("has queued", count(queued), "KM-68");
                }
            }
            Role::Status | Role::JobAck => {
                let field = if role == Role::Status { Field::Executed } else { Field::Number };
                if role == Role::Status
                    && let Some(queued) = params.number(Field::Queued)
                {
                    check("has queued", count(queued), "KM-68");
                }
                if let Some(executed) = params.number(field).map(count)
                    && check("has executed", executed, "KM-54")
                {
                    order.acked = order.acked.max(executed);
                    if role == Role::Status {
                        order.executed = executed;
                    }
                }
            }
            _ => {}
        }
    }

    /// Checks an answer of the PC.
    fn answered(&mut self, packet: &Packet, report: &mut Report<'_>) {
        match self.talk {
            Turn::Robot(_) => report.rule(PC, "KM-92", "an answer, and the robot has said nothing"),
            Turn::Pc { since, is_missed: true } => {
                let late = ms(packet.begun.saturating_sub(since));
                report.assumption(PC, "KM-51", format!("an answer after {late}: reply_timeout is too short"));
            }
            _ => {}
        }
        let asked = core::mem::take(&mut self.asked);
        let is_known = !matches!(self.talk, Turn::Unknown) && !asked.is_damaged && !packet.is_damaged;
        if is_known && asked.status != packet.has(Role::Status) {
            let text = if asked.status { "no status answers a status" } else { "an unsolicited status" };
            report.rule(PC, "KM-92", text);
        }
        if let Some(start) = packet.of(Role::OrderStart).next() {
            let number = start.number(Field::Order).unwrap_or_default();
            if self.is_whole && self.order.is_none_or(|order| order.number != number) {
                self.order = Some(Order { number, executed: 0, acked: 0, sent: 0 });
            }
            if self.starts.open && !self.datagrams && self.is_whole {
                report.rule(PC, "KM-93", "a start again before the answer to the one before");
            }
            (self.starts.open, self.starts.last) = (true, true);
        }
        let jobs: Vec<&Params> = packet.of(Role::Job).collect();
        let numbers: Vec<u16> = jobs.iter().filter_map(|job| job.number(Field::Number)).collect();
        if let Some(first) = numbers.first().filter(|_| is_known) {
            match asked.job {
                None => report.rule(PC, "KM-95", format!("the job {first}, and none was asked for")),
                Some(wanted)
                    if wanted != *first && self.order.is_some() && !self.is_behind_executed(*first) =>
                {
                    report.rule(PC, "KM-95", format!("the job {first}, and {wanted} was asked for"));
                }
                Some(_) => {}
            }
        }
        let is_next = |pair: &[u16]| match pair {
            [before, next] => self.numbers.ahead(u32::from(*before), *next) == 1,
            _ => true,
        };
        if !numbers.windows(2).all(is_next) {
            report.rule(PC, "KM-42", format!("jobs with the numbers {numbers:?}"));
        }
        if let (Some(order), Some(last)) = (&mut self.order, numbers.last()) {
            let count = order.executed.saturating_add(self.numbers.ahead(order.executed, *last));
            order.sent = order.sent.max(count);
            if jobs.iter().any(|job| job.number(Field::Order).is_some_and(|it| it != order.number)) {
                report.rule(PC, "KM-95", format!("a job of another order than {}", order.number));
            }
        }
        let since = match self.talk {
            Turn::Pc { since, .. } => Some(since),
            Turn::Robot(since) => since,
            Turn::Unknown => None,
        };
        self.talk = Turn::Robot(since);
    }

    /// Returns whether a job follows the last acknowledged one; jobs before it are not sent again.
    fn is_behind_executed(&self, number: u16) -> bool {
        self.order.is_some_and(|order| self.numbers.next(order.acked) == number)
    }
}

/// Returns the configurations of both ends: with the plant that is set, or the plant in the configuration of an end.
fn configs(setup: &Setup<'_>) -> Result<(PcConfig, RobotConfig)> {
    let (mut pc, mut robot) = (setup.given(PC), setup.given(ROBOT));
    robot.take::<Value>("queue")?;
    let (is_pc, is_robot) = (!pc.0.is_empty(), !robot.0.is_empty());
    if !is_pc && !is_robot {
        let CodecSettings { plant, .. } =
            settings::read("kawasaki", CodecSettings::default(), setup.settings)?;
        let pc = PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() };
        return Ok((plant.pc(pc)?, plant.robot(RobotConfig::tcp())?));
    }
    let (dialect, _) = plant(if is_pc { &mut pc } else { &mut robot })?;
    let pc = pc.configure(PcConfig { dialect, ..PcConfig::tcp() })?;
    let robot = robot.configure(RobotConfig::tcp())?;
    let (max_number, datagrams) =
        if is_pc { (pc.max_number, pc.datagrams) } else { (robot.max_number, robot.datagrams) };
    Ok((PcConfig { max_number, datagrams, ..pc }, robot))
}
