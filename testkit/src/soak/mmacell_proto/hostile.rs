//! Ends that keep no rule: a central controller that does not wait for answers, and one of either kind that sends anything.

use core::time::Duration;
use std::collections::VecDeque;

use robot_session::contract::Rng;

/// The commands that are not answered, oldest first, and the beginning of an answer.
#[derive(Default)]
pub(super) struct Pipeline {
    pub(super) open: VecDeque<&'static [u8]>,
    answer: Vec<u8>,
    /// When something was sent or answered.
    pub(super) moved: Duration,
}

impl Pipeline {
    /// Up to 300 commands, however many are not answered.
    pub(super) fn write(&mut self, now: Duration, rng: &mut Rng) -> Vec<u8> {
        const ALL: [&[u8]; 6] =
            [b"STA", b"SRVON", b"MOVA+010.000-002.000+005.999-01.2322", b"STP", b"OVR+00050", b"?"];
        let most = [1, 10, 300][rng.below(3)];
        let commands: Vec<_> = (0..1 + rng.below(most)).map(|_| ALL[rng.below(ALL.len())]).collect();
        self.open.extend(&commands);
        self.moved = now;
        commands.iter().flat_map(|command| [command, &b"\r\n"[..]].concat()).collect()
    }

    /// Whether each answer is one that its command may have.
    pub(super) fn reads(&mut self, now: Duration, bytes: &[u8]) -> bool {
        self.moved = now;
        self.answer.extend(bytes);
        while let Some(end) = self.answer.iter().position(|byte| *byte == b'\n') {
            let answer: Vec<u8> = self.answer.drain(..=end).collect();
            let is_error = answer.starts_with(b"ER");
            let fits = match self.open.pop_front() {
                Some(b"STA") => is_error || answer.len() > b"OK\r\n".len(),
                Some(b"?") => is_error,
                Some(_) => is_error || answer == b"OK\r\n",
                None => false,
            };
            if !fits {
                return false;
            }
        }
        true
    }
}

pub(super) fn any_command(rng: &mut Rng) -> &'static [u8] {
    const ALL: [&[u8]; 9] = [
        b"STA\r\n",
        b"SRVON\r\nSTA\r\n",
        b"MOVA+010.000-002.000+005.999-01.2322\r\n",
        b"MOVR+900.000",
        b"RST\r\nCLO\r\nSTP\r\n",
        b"ACQ+00001\r\n\r\n",
        b"OVR+00101\r\n",
        b"\r",
        b"OK\r\n",
    ];
    ALL[rng.below(ALL.len())]
}

pub(super) fn any_reply(rng: &mut Rng) -> &'static [u8] {
    const ALL: [&[u8]; 6] = [
        b"OK\r\n",
        b"OKF+010.000-002.000+005.999-01.2322T+00080+00000\r\n",
        b"OKT+010.000-002.000+005.999-01.2322F+00080+00002\r\n",
        b"ER+00077\r\n",
        b"ER+00000\r\n",
        b"O",
    ];
    ALL[rng.below(ALL.len())]
}
