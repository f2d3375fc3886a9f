//! One list of requests, for each server the same: instructions from a request to its reply, and the deepest stack.
//!
//! Of the tables a server has 200 holding registers, and it is unit 1. A request is in memory as a whole, its reply goes
//! into memory.
#![no_std]

pub mod modbus_core;
pub mod ours;
pub mod rmodbus;

use core::hint::black_box;
use core::panic::PanicInfo;
use core::ptr::{addr_of, read_volatile};

use cortex_m::Peripherals;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::STACK_PAINT_VALUE;
use cortex_m_semihosting::{debug, hio};

/// The unit that every server is.
pub const UNIT: u8 = 1;
/// The number of holding registers.
pub const REGISTERS: usize = 200;
/// The length of the longest frame, in bytes.
pub const BUFFER_LEN: usize = 260;

/// The number of times that each request is served.
const ROUNDS: u32 = 500;

/// A request: unit, PDU, and the number of data bytes after it.
struct Case {
    name: &'static str,
    unit: u8,
    pdu: &'static [u8],
    data: u8,
    is_damaged: bool,
}

const fn case(name: &'static str, pdu: &'static [u8], data: u8) -> Case {
    Case { name, unit: UNIT, pdu, data, is_damaged: false }
}

/// The first requests write the registers that the later ones read.
const CASES: [Case; 9] = [
    case("write one", &[6, 0, 7, 0x12, 0x34], 0),
    case("write 10", &[16, 0, 8, 0, 10, 20], 20),
    case("read 1", &[3, 0, 7, 0, 1], 0),
    case("read 10", &[3, 0, 7, 0, 10], 0),
    case("read 125", &[3, 0, 7, 0, 125], 0),
    case("write 123", &[16, 0, 7, 0, 123, 246], 246),
    case("beyond the registers", &[3, 0, 190, 0, 20], 0),
    Case { unit: 2, ..case("another unit", &[3, 0, 7, 0, 10], 0) },
    Case { is_damaged: true, ..case("a wrong CRC", &[3, 0, 7, 0, 10], 0) },
];

/// A frame in memory.
struct Frame {
    bytes: [u8; BUFFER_LEN],
    length: usize,
}

impl Frame {
    fn of(case: &Case, is_tcp: bool) -> Self {
        let mut frame = Self { bytes: [0; BUFFER_LEN], length: 0 };
        let pdu = case.pdu.len() as u8 + case.data;
        if is_tcp {
            [0, 1, 0, 0, 0, pdu + 1].into_iter().for_each(|byte| frame.push(byte));
        }
        frame.push(case.unit);
        case.pdu.iter().copied().chain(0..case.data).for_each(|byte| frame.push(byte));
        if !is_tcp {
            let crc = crc(&frame.bytes[..frame.length]) ^ u16::from(case.is_damaged);
            crc.to_le_bytes().into_iter().for_each(|byte| frame.push(byte));
        }
        frame
    }

    fn push(&mut self, byte: u8) {
        self.bytes[self.length] = byte;
        self.length += 1;
    }
}

/// Serves every request, and prints of each its name, the ticks that all rounds took, and the reply's length and a checksum;
/// then how many bytes of stack were used.
pub fn run(is_tcp: bool, mut serve: impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize) -> ! {
    let Some(peripherals) = Peripherals::take() else { fail() };
    let mut clock = peripherals.SYST;
    clock.set_clock_source(SystClkSource::Core);
    clock.set_reload(0x00FF_FFFF);
    clock.enable_counter();
    for case in &CASES {
        if is_tcp && case.is_damaged {
            continue;
        }
        let (request, mut reply, mut length) = (Frame::of(case, is_tcp), [0; BUFFER_LEN], 0);
        clock.clear_current();
        let begin = cortex_m::peripheral::SYST::get_current();
        for _ in 0..ROUNDS {
            length = once(&mut serve, black_box(&request.bytes[..request.length]), black_box(&mut reply));
        }
        let ticks = begin.wrapping_sub(cortex_m::peripheral::SYST::get_current()) & 0x00FF_FFFF;
        if clock.has_wrapped() {
            print("wrapped ");
        }
        print(case.name);
        for number in [ticks, length as u32, checksum(&reply[..length])] {
            print("\t");
            print_number(number);
        }
        print("\n");
    }
    print("stack\t");
    print_number(stack());
    print("\n");
    debug::exit(debug::EXIT_SUCCESS);
    fail()
}

/// Makes one call, in the same way for each server.
#[inline(never)]
fn once(
    serve: &mut impl FnMut(&[u8], &mut [u8; BUFFER_LEN]) -> usize,
    request: &[u8],
    reply: &mut [u8; BUFFER_LEN],
) -> usize {
    serve(request, reply)
}

/// Returns the number of bytes of stack that are no longer painted.
fn stack() -> u32 {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let (start, mut at) = (addr_of!(_stack_start), addr_of!(_stack_end));
    // SAFETY: all words between these symbols of the linker are RAM, and the lowest ones are not in use.
    while at < start && unsafe { read_volatile(at) } == STACK_PAINT_VALUE {
        at = at.wrapping_add(1);
    }
    (start as usize - at as usize) as u32
}

/// Computes the CRC-16 of RTU bit by bit.
fn crc(bytes: &[u8]) -> u16 {
    let bit = |crc: u16, _| if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 };
    bytes.iter().fold(0xFFFF, |crc, byte| (0..8).fold(crc ^ u16::from(*byte), bit))
}

/// Returns a checksum of a reply: the CRC of a frame with its CRC would be 0.
fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |sum: u32, byte| sum.wrapping_mul(31).wrapping_add((*byte).into()))
}

/// Prints without `core::fmt`, which would hide the parts of `core::fmt` that a server links.
fn print(text: &str) {
    if let Ok(mut out) = hio::hstdout() {
        let _ = out.write_all(text.as_bytes());
    }
}

fn print_number(number: u32) {
    if number > 9 {
        print_number(number / 10);
    }
    let digit = (number % 10) as usize;
    print(&"0123456789"[digit..digit + 1]);
}

/// Ends with an error.
pub fn fail() -> ! {
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    fail()
}
