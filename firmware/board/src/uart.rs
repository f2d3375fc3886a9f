//! The bytes of the UART, between its interrupt and the session.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;

use critical_section::{CriticalSection, Mutex};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use heapless::Deque;

use crate::{chip, session};

/// As many bytes as come within 5 ms at 115200 baud, and more.
const RECEIVED: usize = 128;
const TO_SEND: usize = 128;

static BYTES: Mutex<RefCell<Bytes>> =
    Mutex::new(RefCell::new(Bytes { received: Deque::new(), to_send: Deque::new() }));
static LOST: Mutex<Cell<u32>> = Mutex::new(Cell::new(0));

struct Bytes {
    received: Deque<u8, RECEIVED>,
    to_send: Deque<u8, TO_SEND>,
}

/// The UART: reads the bytes that its interrupt has received, and writes those that it will send. Neither waits.
#[derive(Debug)]
pub struct Uart(());

impl Uart {
    pub(crate) const fn new() -> Self {
        Self(())
    }

    /// Returns whether the UART has taken all that was written.
    #[cfg(feature = "embassy")]
    pub(crate) fn is_sent(&self) -> bool {
        critical_section::with(|cs| BYTES.borrow_ref(cs).to_send.is_empty())
    }
}

/// Returns the number of bytes lost since the last call, because the session has not run for too long.
pub(crate) fn take_lost() -> u32 {
    critical_section::with(|cs| LOST.borrow(cs).take())
}

/// Handles the interrupt of the UART.
pub(crate) fn interrupt() {
    critical_section::with(|cs| {
        let bytes = &mut *BYTES.borrow_ref_mut(cs);
        while !bytes.received.is_full()
            && let Some(byte) = chip::receive()
        {
            #[cfg(feature = "faults")]
            if crate::faults::loses_byte() {
                lose(cs);
                continue;
            }
            let _ = bytes.received.push_back(byte);
        }
        // When the buffer is full, bytes stay in the UART, which loses them if the session does not come soon, or
        // holds the line.
        chip::set_receiving(!bytes.received.is_full());
        if chip::take_overrun() {
            lose(cs);
        }
        send(bytes);
    });
    session::wake();
}

fn lose(cs: CriticalSection<'_>) {
    let lost = LOST.borrow(cs);
    lost.set(lost.get().saturating_add(1));
}

/// Gives the UART as many bytes as it accepts.
fn send(bytes: &mut Bytes) {
    while let Some(byte) = bytes.to_send.front() {
        if !chip::send(*byte) {
            return;
        }
        bytes.to_send.pop_front();
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(critical_section::with(|cs| !BYTES.borrow_ref(cs).received.is_empty()))
    }
}

impl Read for Uart {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        critical_section::with(|cs| {
            let received = &mut BYTES.borrow_ref_mut(cs).received;
            let length = buffer.len().min(received.len());
            for to in buffer.iter_mut().take(length) {
                *to = received.pop_front().unwrap_or_default();
            }
            chip::set_receiving(true);
            Ok(length)
        })
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(critical_section::with(|cs| !BYTES.borrow_ref(cs).to_send.is_full()))
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        critical_section::with(|cs| {
            let buffers = &mut *BYTES.borrow_ref_mut(cs);
            let length = bytes.len().min(TO_SEND - buffers.to_send.len());
            for byte in bytes.iter().take(length) {
                let _ = buffers.to_send.push_back(*byte);
            }
            send(buffers);
            Ok(length)
        })
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while critical_section::with(|cs| !BYTES.borrow_ref(cs).to_send.is_empty()) {}
        Ok(())
    }
}
