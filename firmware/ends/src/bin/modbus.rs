//! A Modbus server, RTU on a serial line: the interrupt of the session carries requests out on the registers, the main loop
//! is the machine.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::sync::atomic::{AtomicU16, Ordering};
use core::time::Duration;

use board::{Driver, Link, Uart};
use fanuc_hmi_modbus::{Exception, Registers, Server, ServerConfig, Words, WordsMut};
use robot_session::Session as _;
use static_cell::StaticCell;

/// The registers: 0 counts, 1 is the increment, the others are memory.
static REGISTERS: [AtomicU16; 64] = [const { AtomicU16::new(0) }; 64];
static LINK: StaticCell<Modbus> = StaticCell::new();

const BAUD: u32 = 9_600;
const UNIT: u8 = 1;

struct Machine;

fn of(address: u16, length: usize) -> Result<&'static [AtomicU16], Exception> {
    let first = usize::from(address);
    REGISTERS.get(first..first + length).ok_or(Exception::IllegalDataAddress)
}

impl Registers for Machine {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let registers = of(address, out.len())?;
        (0..).zip(registers).for_each(|(index, register)| out.set(index, register.load(Ordering::Relaxed)));
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        let registers = of(address, values.len())?;
        registers
            .iter()
            .zip(values.iter())
            .for_each(|(register, value)| register.store(value, Ordering::Relaxed));
        Ok(())
    }
}

type Session = Server<Machine, 1>;

/// The link of the session's interrupt.
struct Modbus {
    driver: Driver<64, { Session::MAX_TRANSMIT }>,
    session: Session,
}

impl Link for Modbus {
    fn poll(&mut self) -> Option<Duration> {
        let Ok(turn) = self.driver.poll(&mut self.session, |server, event| {
            defmt::debug!("{}", event);
            let statistics = server.statistics();
            if statistics.served % 100 == 1 {
                defmt::info!("served {}", statistics.served);
            }
            ControlFlow::<()>::Continue(())
        });
        turn.continue_value().flatten()
    }
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart) {
    let link = LINK.init_with(|| {
        let Ok(session) = Server::new(ServerConfig::rtu(UNIT, BAUD), Machine) else { panic!("it works") };
        Modbus { driver: Driver::new(uart, board::now), session }
    });
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(BAUD);
    start(uart);
    defmt::info!("modbus");
    let [count, step, ..] = &REGISTERS;
    step.store(1, Ordering::Relaxed);
    loop {
        board::pause(Duration::from_millis(100));
        count.store(
            count.load(Ordering::Relaxed).wrapping_add(step.load(Ordering::Relaxed)),
            Ordering::Relaxed,
        );
    }
}
