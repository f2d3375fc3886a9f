//! A toy link: lines of up to seven bytes. The caller asks, the peer answers with the same line.
#![allow(dead_code, unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

pub mod echo;

use core::time::Duration;
use std::collections::VecDeque;

use robot_session::end::EventQueue;
use robot_session::{Decoder, Encode, Session};

const MAX_MESSAGE_LEN: usize = 8;

/// A line without its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line(pub String);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooLong;

impl core::fmt::Display for TooLong {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("a line has at most 7 bytes")
    }
}

impl core::error::Error for TooLong {}

impl Encode for Line {
    type Error = TooLong;

    fn encoded_len(&self) -> usize {
        self.0.len() + 1
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, TooLong> {
        if self.encoded_len() > MAX_MESSAGE_LEN.min(out.len()) {
            return Err(TooLong);
        }
        out[..self.0.len()].copy_from_slice(self.0.as_bytes());
        out[self.0.len()] = b'\n';
        Ok(self.encoded_len())
    }
}

#[derive(Debug, Default)]
pub struct Lines {
    held: Vec<u8>,
    consumed: u64,
    finished: bool,
}

impl Lines {
    fn take(&mut self, len: usize) -> Vec<u8> {
        self.consumed += len as u64;
        self.held.drain(..len).collect()
    }
}

impl Decoder for Lines {
    type Frame<'a> = Line;
    type Error = TooLong;

    fn push(&mut self, bytes: &[u8]) -> usize {
        let taken = bytes.len().min(MAX_MESSAGE_LEN - self.held.len());
        self.held.extend(&bytes[..taken]);
        taken
    }

    fn next_frame(&mut self) -> Option<Result<Line, TooLong>> {
        if let Some(end) = self.held.iter().position(|byte| *byte == b'\n') {
            let mut line = self.take(end + 1);
            line.pop();
            return Some(Ok(Line(String::from_utf8_lossy(&line).into_owned())));
        }
        if self.held.len() < MAX_MESSAGE_LEN && (!self.finished || self.held.is_empty()) {
            return None;
        }
        self.clear();
        Some(Err(TooLong))
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.consumed
    }

    fn clear(&mut self) {
        self.take(self.held.len());
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    Connected,
    Answer(String),
    NoAnswer(String),
    Disconnected,
}

/// Sends one request after the other; each has an outcome.
#[derive(Debug)]
pub struct Asker {
    pub requests: VecDeque<String>,
    pub timeout: Duration,
    asked: Option<(String, Duration)>,
    decoder: Lines,
    events: EventQueue<Event, 4>,
    pub transmitted: u32,
}

impl Asker {
    pub fn new(requests: &[&str]) -> Self {
        Self {
            requests: requests.iter().map(|text| (*text).into()).collect(),
            timeout: Duration::from_secs(20),
            asked: None,
            decoder: Lines::default(),
            events: EventQueue::new(),
            transmitted: 0,
        }
    }

    fn fail(&mut self) {
        if let Some((text, _)) = self.asked.take() {
            self.events.push_outcome(Event::NoAnswer(text)).unwrap();
        }
    }
}

impl Session for Asker {
    type Event = Event;
    type Statistics = u32;
    const MAX_INPUT: usize = 64;
    const MAX_TRANSMIT: usize = MAX_MESSAGE_LEN;

    fn handle_connected(&mut self, _: Duration) {
        self.decoder.clear();
        self.events.push_notice(Event::Connected);
    }

    fn handle_disconnected(&mut self, _: Duration) {
        self.fail();
        self.events.push_notice(Event::Disconnected);
    }

    fn handle_input(&mut self, _: Duration, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = &bytes[taken..];
            while let Some(line) = self.decoder.next_frame() {
                if let (Ok(line), Some(_)) = (line, &self.asked) {
                    self.asked = None;
                    self.events.push_outcome(Event::Answer(line.0)).unwrap();
                }
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        if self.asked.as_ref().is_some_and(|(_, due)| now >= *due) {
            self.fail();
        }
    }

    fn handle_transmitted(&mut self, _: Duration) {
        self.transmitted += 1;
    }

    fn poll_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if self.asked.is_some() || !self.events.has_room(1) {
            return None;
        }
        let len = Line(self.requests.front()?.clone()).encode(out).ok()?;
        let text = self.requests.pop_front()?;
        self.asked = Some((text, now.saturating_add(self.timeout)));
        Some(len)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.asked.as_ref().map(|(_, due)| *due)
    }

    fn discards_after(&self) -> Option<Duration> {
        Some(self.timeout)
    }

    fn statistics(&self) -> u32 {
        self.transmitted
    }
}
