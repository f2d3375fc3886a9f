//! The simulated third device: camera trigger and valves behind a controller of their own (§4.9, §4.10).

use mmacell_proto::{BLOW, Command, Decoder, Dialect, ErrorCode, NoPose, Reply, VACUUM};

/// What came of some bytes.
#[derive(Debug, Default)]
pub(super) struct Heard {
    pub(super) replies: Vec<u8>,
    /// Valves that were set: which, and whether open.
    pub(super) valves: Vec<(i32, bool)>,
    pub(super) closed: bool,
}

/// Reads commands for cameras and valves, and answers each line once.
#[derive(Debug, Default)]
pub(super) struct Periphery {
    decoder: Decoder,
}

impl Periphery {
    pub(super) fn connect(&mut self) {
        self.decoder = Decoder::default();
    }

    pub(super) fn hear(&mut self, mut bytes: &[u8]) -> Heard {
        let mut heard = Heard::default();
        while !bytes.is_empty() {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while let Some(line) = self.decoder.next_frame() {
                let command = line.and_then(|line| Command::<NoPose>::decode(line, &Dialect::STRICT));
                let done = match command {
                    Ok(Command::Acquire { camera: 1 | 2 }) => true,
                    Ok(Command::Grip { gripper: gripper @ (VACUUM | BLOW), open }) => {
                        heard.valves.push((gripper, open));
                        true
                    }
                    Ok(Command::Close) => {
                        heard.closed = true;
                        true
                    }
                    _ => false,
                };
                let reply: Reply<NoPose> =
                    if done { Reply::Ok } else { Reply::Error { error: ErrorCode::Generic } };
                let mut buffer = [0; 16];
                // Neither reply can fail to fit.
                let len = reply.encode(&mut buffer).unwrap_or_default();
                heard.replies.extend_from_slice(buffer.get(..len).unwrap_or_default());
            }
        }
        heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_knows_cameras_and_valves_and_refuses_the_rest() {
        let mut periphery = Periphery::default();
        let heard = periphery.hear(b"ACQ+00002\r\nHND+00000OPEN\r\nHND+00007OPEN\r\nSTA\r\nRST\r\nCLO\r\n");
        assert_eq!(
            String::from_utf8(heard.replies).unwrap(),
            "OK\r\nOK\r\nER+00001\r\nER+00001\r\nER+00001\r\nOK\r\n"
        );
        assert_eq!(heard.valves, [(VACUUM, true)]);
        assert!(heard.closed);
    }
}
