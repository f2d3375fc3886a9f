//! The commands of the keys.

use std::time::Duration;

use ratatui::crossterm::event::{KeyCode, KeyEvent};
use val2_alter::{HostState, Policy};

use super::keys::{Stop, stop};
use super::model::{Model, Test, View};
use crate::alter::{Axes, Order, PortConfig, Profile};

/// The duration of the tests of ball and workstation.
const TEST: Duration = Duration::from_secs(3);
/// The command of a key.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Command {
    Order(Order),
    Probe,
}

impl Model {
    /// Handles a key; returns its command.
    pub(super) fn key(&mut self, key: KeyEvent, now: Duration) -> Option<Command> {
        self.now = now;
        if let Some(stop) = stop(key) {
            // The robot's thread has the stop already, from the thread that reads the keys.
            self.stopped(stop);
            return None;
        }
        match (self.view, key.code) {
            (View::Options, KeyCode::Char(key @ ('1'..='5' | 'f' | 'd' | '+' | '-'))) => self.option(key),
            (View::Options | View::Keys, _) => {
                self.view = View::Main;
                None
            }
            (View::Debug(line), KeyCode::Tab) => {
                self.view = View::Debug((line + 1) % 3);
                None
            }
            (View::Debug(_), KeyCode::Char('m' | 'M')) => {
                self.view = View::Main;
                None
            }
            (View::Main | View::Debug(_), KeyCode::Enter) => Some(Command::Order(Order::Confirm)),
            (View::Main | View::Debug(_), KeyCode::Char(letter)) => self.letter(letter.to_ascii_lowercase()),
            _ => None,
        }
    }

    fn letter(&mut self, letter: char) -> Option<Command> {
        match letter {
            'w' if self.ports.viewer.is_none() => {
                self.show("workstation test: there is none; use --viewer PORT".into());
                None
            }
            'w' => self.begin_test("workstation"),
            'k' => self.begin_test("ball"),
            't' if !matches!(self.state, HostState::Disconnected | HostState::Idle) => {
                self.show("port test: not while ALTER runs".into());
                None
            }
            't' => {
                self.show("port test: listening, some seconds".into());
                Some(Command::Probe)
            }
            'a' => {
                self.policy = Policy::Accept;
                (self.refused, self.lost) = (None, None);
                self.show("waiting for the robot; space or Esc stops".into());
                if let Some(advice) = self.advice.clone() {
                    self.show(advice);
                }
                Some(Command::Order(Order::Policy(Policy::Accept)))
            }
            'v' => {
                self.policy = Policy::Refuse;
                self.show("ALTER will be refused".into());
                Some(Command::Order(Order::Policy(Policy::Refuse)))
            }
            '?' => {
                self.view = View::Keys;
                None
            }
            'o' => {
                self.view = View::Options;
                None
            }
            'q' => {
                self.stopped(Stop::End);
                Some(Command::Order(Order::End))
            }
            _ => None,
        }
    }

    fn option(&mut self, digit: char) -> Option<Command> {
        self.view = View::Main;
        match digit {
            '1' => {
                let port = |name, p: &PortConfig| format!("{name}: {} at {} baud", p.path, p.baud);
                let mut lines = vec![port("robot", &self.ports.robot), self.ports.input.name()];
                lines.extend(self.ports.viewer.as_ref().map(|viewer| port("viewer", viewer)));
                lines.into_iter().for_each(|line| self.show(line));
            }
            '2' => return Some(self.profile(|profile| profile.filter.dominant ^= true)),
            'f' => {
                return Some(self.profile(|profile| {
                    profile.filter.axes = match profile.filter.axes {
                        Axes::All => Axes::Translation,
                        Axes::Translation => Axes::Rotation,
                        Axes::Rotation => Axes::All,
                    };
                }));
            }
            '+' => {
                return Some(self.profile(|profile| profile.speed = (profile.speed + 5).min(100)));
            }
            '-' => {
                return Some(self.profile(|profile| profile.speed = profile.speed.saturating_sub(5).max(5)));
            }
            'd' => {
                return Some(self.profile(|profile| profile.dead_zone = (profile.dead_zone + 2) % 22));
            }
            '3' => self.view = View::Debug(0),
            '4' => self.show(format!(
                "{} pictures, own thread; replies p99 {:.2} ms",
                self.drawn,
                self.thinking.at(0.99).as_secs_f64() * 1e3
            )),
            _ => {
                self.clamp = !self.clamp;
                let state = if self.clamp { "on: the program must name a subroutine" } else { "off" };
                self.show(format!("clamp {state}"));
                return Some(Command::Order(Order::GripperKeys(self.clamp)));
            }
        }
        None
    }

    fn stopped(&mut self, stop: Stop) {
        (self.view, self.policy) = (View::Main, Policy::Ignore);
        self.show(match stop {
            Stop::Stop => "STOP: coming to rest; A answers the robot again".into(),
            Stop::End => "coming to rest, then the end".into(),
        });
    }

    /// Changes the meaning of the hand's values: the arm comes to rest first.
    fn profile(&mut self, change: impl FnOnce(&mut Profile)) -> Command {
        self.view = View::Options;
        change(&mut self.profile);
        let Profile { filter, dead_zone, speed, .. } = self.profile;
        let axes = match filter.axes {
            Axes::All => "all axes",
            Axes::Translation => "TRA",
            Axes::Rotation => "ROT",
        };
        let dominant = if filter.dominant { " DOM" } else { "" };
        self.show(format!("profile: {axes}{dominant}, speed {speed} %, dead zone {dead_zone} %"));
        Command::Order(Order::Profile(Box::new(self.profile)))
    }

    fn begin_test(&mut self, what: &'static str) -> Option<Command> {
        let counts = &self.counts;
        self.tests.push(Test {
            what,
            until: self.now + TEST,
            packets: counts.packets,
            missed: counts.ball_missed,
            corrupt: counts.ball_corrupt,
            asked: counts.asked,
            poses: counts.poses,
        });
        self.show(format!("{what} test: {} s", TEST.as_secs()));
        None
    }
}
