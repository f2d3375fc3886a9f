//! A 3Dconnexion device through the socket of spacenavd, in version 0 of its protocol: eight native 32-bit words an event. The
//! daemon is one of Unix.

#[cfg(unix)]
pub(super) use unix::Spacenav;

#[cfg(not(unix))]
pub(super) use elsewhere::Spacenav;

#[cfg(unix)]
mod unix {
    use std::io::{ErrorKind, Read};
    use std::os::unix::net::UnixStream;
    use std::path::{Path, PathBuf};
    use std::time::Duration;

    use anyhow::{Context as _, Result};

    use crate::alter::context::Context;
    use crate::alter::input::device::{Input, InputEvent};
    use crate::alter::input::mouse::{MAX_AGE, PERIOD, looks_again, thousandths};
    use crate::alter::messages::Notification;
    use crate::alter::sample::Sample;

    /// The length of an event. `repeat-interval = 50` in the daemon's `spnavrc` makes it repeat unchanged values.
    const EVENT: usize = 32;

    pub(in super::super) struct Spacenav {
        path: PathBuf,
        context: Context,
        socket: Option<UnixStream>,
        bytes: Vec<u8>,
        axes: [i16; 6],
        buttons: u32,
        next: Duration,
    }

    impl Spacenav {
        /// # Errors
        /// If there is no daemon.
        pub(in super::super) fn open(path: &Path, context: Context) -> Result<Self> {
            let socket = UnixStream::connect(path).with_context(|| {
                format!(
                    "cannot reach spacenavd at {}: is it running? (apt install spacenavd)",
                    path.display()
                )
            })?;
            context.notify(Notification::PortOpen("spacenavd", path.display().to_string()));
            let path = path.into();
            let next = Duration::ZERO;
            Ok(Self {
                path,
                context,
                socket: Some(socket),
                bytes: Vec::new(),
                axes: [0; 6],
                buttons: 0,
                next,
            })
        }

        fn reopen(&mut self, wait: Duration) {
            if !looks_again(&self.context, &mut self.next, wait) {
                return;
            }
            if let Ok(socket) = UnixStream::connect(&self.path) {
                self.socket = Some(socket);
                self.context.notify(Notification::PortOpen("spacenavd", self.path.display().to_string()));
            }
        }

        fn lose(&mut self, why: String, events: &mut Vec<InputEvent>) {
            (self.socket, self.axes, self.buttons) = (None, [0; 6], 0);
            self.bytes.clear();
            self.context.notify(Notification::PortLost("spacenavd", why));
            events.push(InputEvent::Lost);
        }

        fn sample(&mut self) -> InputEvent {
            let now = self.context.clock.now();
            self.next = now + PERIOD;
            InputEvent::Sample(Sample { axes: self.axes, buttons: self.buttons, fresh_until: now + MAX_AGE })
        }

        /// Handles an event of the daemon: 0 motion, 1 and 2 a button that is pressed or released; others are of newer
        /// versions.
        fn take(&mut self, event: [i32; 8]) -> Option<InputEvent> {
            let [kind, number, ..] = event;
            let bit = u32::try_from(number).ok().and_then(|number| 1u32.checked_shl(number)).unwrap_or(0);
            match kind {
                0 => {
                    let [_, x, y, z, rx, ry, rz, _period] = event;
                    self.axes = [x, y, z, rx, ry, rz].map(thousandths);
                }
                1 => self.buttons |= bit,
                2 => self.buttons &= !bit,
                _ => return None,
            }
            Some(self.sample())
        }
    }

    impl Input for Spacenav {
        fn poll(&mut self, wait: Duration, events: &mut Vec<InputEvent>) {
            let Some(socket) = &mut self.socket else { return self.reopen(wait) };
            let mut buffer = [0; 16 * EVENT];
            let read = socket.set_read_timeout(Some(wait)).and_then(|()| socket.read(&mut buffer));
            match read {
                Ok(0) => return self.lose("spacenavd has ended".into(), events),
                Ok(length) => self.bytes.extend_from_slice(buffer.get(..length).unwrap_or_default()),
                Err(e)
                    if matches!(
                        e.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    ) => {}
                Err(e) => return self.lose(e.to_string(), events),
            }
            while let Some((event, rest)) = self.bytes.split_first_chunk::<EVENT>() {
                let mut words = [0; 8];
                for (word, bytes) in words.iter_mut().zip(event.as_chunks().0) {
                    *word = i32::from_ne_bytes(*bytes);
                }
                self.bytes = rest.to_vec();
                events.extend(self.take(words));
            }
            if self.axes == [0; 6] && self.context.clock.now() >= self.next {
                let rest = self.sample();
                events.push(rest);
            }
        }
    }
}

#[cfg(not(unix))]
mod elsewhere {
    use std::path::Path;
    use std::time::Duration;

    use crate::alter::context::Context;
    use crate::alter::input::device::{Input, InputEvent};

    pub(in super::super) enum Spacenav {}

    impl Spacenav {
        pub(in super::super) fn open(_: &Path, _: Context) -> anyhow::Result<Self> {
            anyhow::bail!("--spacenav needs spacenavd, a daemon of Unix")
        }
    }

    impl Input for Spacenav {
        fn poll(&mut self, _: Duration, _: &mut Vec<InputEvent>) {
            match *self {}
        }
    }
}
