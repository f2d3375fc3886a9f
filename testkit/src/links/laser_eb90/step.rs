//! The effects of an act.

use core::time::Duration;

use laser_eb90::controller::machine::{Answer, ControllerMachine, Input as ControllerInput, Receiving};
use laser_eb90::host::machine::{Action, HostLink, HostMachine, Input as HostInput, Outcome};
use laser_eb90::{Class, Refusal};
use robot_session::end::Machine as _;

use super::world::{Act, Content, Fate, Found, Held, Reply, Reported, Setup, Transmission, World};
use crate::model::{Edges, age, drive};

/// More bytes than the shortest frame has, and fewer.
const MANY: u8 = 20;
const FEW: u8 = 4;

/// A world that an act changes.
pub(super) struct Step<'a> {
    pub(super) setup: &'a Setup,
    pub(super) world: World,
    pub(super) edges: Edges<'a>,
}

impl Step<'_> {
    pub(super) fn act(&mut self, act: Act) {
        let setup = self.setup;
        let is_fault = match act {
            Act::Send(fate) | Act::Reply(fate) => fate != Fate::Good,
            Act::Judge(verdict) => verdict.is_err(),
            Act::Finish(result) => result.is_err(),
            Act::LateTick | Act::Noise | Act::Crash { .. } | Act::Disconnect | Act::Restart => true,
            Act::Tick | Act::Connect | Act::Submit | Act::Timeout | Act::Resume => false,
        };
        self.world.faults -= u8::from(is_fault);
        match act {
            Act::Tick | Act::LateTick => self.tick(),
            Act::Connect => {
                self.world.connected = true;
                self.host(HostInput::Connected);
            }
            Act::Submit => {
                let job = self.world.submitted;
                self.world.submitted += 1;
                let interpreted = setup.jobs[usize::from(job)] == Content::Interpreted;
                let class = if interpreted { Class::Interpreted } else { Class::Immediate };
                self.host(HostInput::Submit { ticket: job.into(), word: setup.word(job), class });
            }
            Act::Send(fate) => {
                let line = setup.tick * u32::from(setup.line);
                self.host(HostInput::Sent { line });
                if let HostLink::Awaiting(sent) = self.world.host.link {
                    let job = sent.batch.first as u8;
                    self.world.down.push(Transmission { job, passed: 0, fate });
                }
            }
            Act::Timeout => self.host(HostInput::Timeout),
            Act::Resume => self.host(HostInput::Resume),
            Act::Judge(verdict) => self.judge(verdict),
            Act::Finish(result) => {
                self.world.executing = 0;
                self.controller(ControllerInput::Executed(result));
                self.read();
            }
            Act::Reply(fate) => {
                // The line has been silent while an instruction was executed.
                if self.world.controller.expires(Duration::ZERO) {
                    self.silence();
                }
                let due = self.world.controller.transmit(Duration::ZERO, &setup.controller);
                self.controller(ControllerInput::Sent);
                let late = if let Fate::Late { ticks } = fate { ticks } else { 0 };
                if let (Some(answer), true) = (due, fate != Fate::Lost) {
                    let corrupt = fate == Fate::Corrupt;
                    self.world.up.push(Reply { answer, ticks: setup.answer + late, corrupt });
                }
            }
            Act::Noise => {
                self.controller(ControllerInput::Bytes);
                self.world.held = Held::Noise;
                self.read();
            }
            Act::Crash { cut } => {
                if cut {
                    self.world.down.clear();
                }
                // The next process sends the unsent frame.
                self.world.submitted -= u8::from(self.world.host.next.is_some());
                let submitted = usize::from(self.world.submitted);
                for job in self.world.jobs.iter_mut().take(submitted) {
                    job.reported.get_or_insert(Reported::Abandoned);
                }
                self.world.connected = false;
                self.world.host = HostMachine::NEW;
            }
            Act::Disconnect => {
                self.world.connected = false;
                self.host(HostInput::Disconnected);
            }
            Act::Restart => {
                self.world.controller = ControllerMachine::NEW;
                (self.world.held, self.world.executing) = (Held::Nothing, 0);
                self.world.found.clear();
                self.controller(ControllerInput::Connected);
            }
        }
    }

    fn host(&mut self, input: HostInput) {
        let action = drive(&mut self.world.host, input, &self.setup.host, &mut self.edges);
        match action {
            Ok(Action::Report(batch, outcome)) => {
                let reported = match outcome {
                    Outcome::Done { unanswered, .. } => Reported::Done { unanswered: unanswered > 0 },
                    Outcome::Refused(_) => Reported::Refused,
                    Outcome::Unknown(_) => Reported::Unknown,
                };
                let job = &mut self.world.jobs[batch.first as usize];
                job.again |= job.reported.is_some();
                job.reported = Some(reported);
            }
            Ok(Action::Nothing | Action::Sent(_) | Action::Unasked { .. }) => {}
            Err(_) => self.world.unexpected = true,
        }
    }

    fn controller(&mut self, input: ControllerInput) {
        let action = drive(&mut self.world.controller, input, &self.setup.controller, &mut self.edges);
        self.world.unexpected |= action.is_err();
    }

    fn tick(&mut self) {
        age(&mut self.world.host, self.setup.tick);
        age(&mut self.world.controller, self.setup.tick);
        self.world.executing = self.world.executing.saturating_sub(1);
        self.carry_down();
        self.carry_up();
        if self.world.controller.expires(Duration::ZERO) {
            self.silence();
        }
    }

    /// Carries one tick's bytes of the first frame on the line.
    fn carry_down(&mut self) {
        let setup = self.setup;
        let Some(transmission) = self.world.down.first_mut() else { return };
        let Transmission { job, passed, fate } = *transmission;
        match &mut transmission.fate {
            Fate::Paused { after, ticks } if *after == passed && *ticks > 0 => {
                *ticks -= 1;
                if *ticks == 0 {
                    transmission.fate = Fate::Good;
                }
                return;
            }
            _ => transmission.passed += 1,
        }
        let (first, last) = (passed == 0, passed + 1 == setup.line);
        if last {
            self.world.down.remove(0);
            if setup.reports_transmitted && self.world.down.is_empty() && self.world.connected {
                self.host(HostInput::Transmitted);
            }
        }
        match fate {
            Fate::Lost => return,
            Fate::Cut { after } if passed >= after => return,
            _ => {}
        }
        self.controller(ControllerInput::Bytes);
        if first && fate != Fate::Headless {
            self.head(job);
        } else {
            self.world.held = match self.world.held {
                Held::Nothing | Held::Headless | Held::Noise => Held::Headless,
                // The rest of another frame, or a frame without its head, after a half that was kept.
                Held::Part(part) if part != job || fate == Fate::Headless => Held::Spoilt,
                held => held,
            };
        }
        if last && self.world.held != Held::Headless {
            let whole = self.world.held == Held::Part(job) && fate != Fate::Corrupt;
            let found =
                if whole { Found::Frame(job) } else { Found::Corrupt(Refusal::BadChecksum, MANY, true) };
            self.world.found.push(found);
            self.world.held = Held::Nothing;
        }
        self.read();
    }

    /// Called when a head comes.
    fn head(&mut self, job: u8) {
        let corrupt = match self.world.held {
            Held::Part(_) | Held::Spoilt if self.setup.reader.swallows => {
                self.world.held = Held::Spoilt;
                return;
            }
            Held::Part(_) | Held::Spoilt => Some((MANY, true)),
            Held::Headless => Some((MANY, false)),
            Held::Noise => Some((FEW, false)),
            Held::Nothing => None,
        };
        let corrupt = corrupt.map(|(bytes, begun)| Found::Corrupt(Refusal::BadFrame, bytes, begun));
        self.world.found.extend(corrupt);
        self.world.held = Held::Part(job);
    }

    /// Lets the controller read its items, up to a good frame: a separate act handles that frame.
    fn read(&mut self) {
        while !self.world.is_executing() {
            let trusts = self.world.controller.trusts(&self.setup.controller);
            let input = match self.world.found.first().copied() {
                Some(Found::Corrupt(refusal, bytes, begun)) => {
                    ControllerInput::Corrupt { refusal, bytes, begun }
                }
                Some(Found::Frame(_)) if !trusts => ControllerInput::Untrusted,
                Some(Found::Frame(_)) | None => break,
            };
            self.world.found.remove(0);
            self.controller(input);
        }
        let frame_waits = !self.world.found.is_empty() && !self.world.is_executing();
        if matches!(self.world.controller.line, Receiving::Bytes(_)) && !frame_waits {
            let partial = self.world.held != Held::Nothing || !self.world.found.is_empty();
            self.controller(ControllerInput::Read { partial });
        }
    }

    fn silence(&mut self) {
        let setup = self.setup;
        let corrupt = match self.world.held {
            Held::Nothing => None,
            Held::Noise => Some((FEW, false)),
            Held::Part(_) | Held::Spoilt => Some((MANY, true)),
            Held::Headless => setup.reader.answers_headless.then_some((MANY, false)),
        };
        let corrupt = corrupt.map(|(bytes, begun)| Found::Corrupt(Refusal::BadFrame, bytes, begun));
        self.world.found.extend(corrupt);
        if !(setup.reader.keeps && matches!(self.world.held, Held::Part(_) | Held::Spoilt)) {
            self.world.held = Held::Nothing;
        }
        self.read();
        if self.world.controller.expires(Duration::ZERO) {
            self.controller(ControllerInput::Timeout);
        }
    }

    fn carry_up(&mut self) {
        let blocked = self.world.is_blocked(self.setup);
        let Some(reply) = self.world.up.first_mut() else { return };
        if blocked && reply.ticks <= 1 {
            return;
        }
        reply.ticks -= 1;
        if reply.ticks > 0 {
            return;
        }
        let Reply { answer, corrupt, .. } = self.world.up.remove(0);
        if !self.world.connected {
            return;
        }
        if let (Answer::Echo(word), false) = (answer, corrupt) {
            self.note_echo(word);
        }
        self.host(match answer {
            _ if corrupt => HostInput::Corrupt,
            Answer::Echo(word) => HostInput::Answer { word, refusal: None },
            Answer::Error(refusal) => {
                let word = self.setup.host.words.errors().code(refusal);
                HostInput::Answer { word, refusal: Some(refusal) }
            }
        });
    }

    fn note_echo(&mut self, word: u16) {
        let batch = match self.world.host.link {
            HostLink::Awaiting(sent) => sent.batch,
            HostLink::Resending { batch, .. } | HostLink::AwaitingRest { batch, .. } => batch,
            HostLink::Disconnected { .. } | HostLink::Idle { .. } | HostLink::Held { .. } => return,
        };
        self.world.jobs[batch.first as usize].echoed |= batch.word == word;
    }

    fn judge(&mut self, verdict: Result<(), Refusal>) {
        let setup = self.setup;
        let Found::Frame(job) = self.world.found.remove(0) else { return };
        let (content, word) = (setup.jobs[usize::from(job)], setup.word(job));
        let record = &mut self.world.jobs[usize::from(job)];
        let input = match (verdict, content) {
            (Err(refusal), _) => ControllerInput::Refused(refusal),
            (Ok(()), Content::Mixed) if setup.reader.refuses_mixed => {
                ControllerInput::Refused(Refusal::BadBatch)
            }
            (Ok(()), Content::Interpreted) => {
                record.executed = (record.executed + 1).min(2);
                ControllerInput::Queued { word }
            }
            (Ok(()), Content::Immediate | Content::Mixed) => {
                record.executed = (record.executed + 1).min(2);
                record.swallowed |= content == Content::Mixed;
                self.world.executing = setup.execution;
                ControllerInput::Immediate { word }
            }
        };
        self.controller(input);
        self.read();
    }
}
