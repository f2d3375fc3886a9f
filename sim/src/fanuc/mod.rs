//! A FANUC controller over Modbus: the tables of the source's Table 1, and the background task of its Fig. 8.

mod background;
mod controller;
mod faults;
mod tables;

use core::time::Duration;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fanuc_hmi_modbus::{
    Bits, BitsMut, Exception, Registers, Server, ServerConfig, ServerEvent, Table, WordOrder, Words, WordsMut,
};
use robot_session::end::End as _;

pub use self::background::{PERIOD, Pose, background_task};
pub use self::controller::{Controller, Motion, Program, circle};
pub use self::faults::{NoFault, TelemetryFault, TelemetryFaults};
pub use self::tables::Tables;
use crate::device::{Device, Error, Notes};
use crate::settings::Settings;

/// A FANUC controller's settings. Its robot goes around a circle; one with another robot is made by [`FanucController::new`].
#[derive(Debug, Clone, Default)]
pub struct Fanuc {
    /// Its end of each connection.
    pub config: ServerConfig,
    /// The order of the words of wide values.
    pub word_order: WordOrder,
    /// Implausible telemetry, with times.
    pub faults: TelemetryFaults,
}

impl Settings for Fanuc {
    type Device = FanucController;

    fn device(&self) -> Result<FanucController, Error> {
        let controller = Controller::new(Box::new(circle), self.word_order).with_faults(self.faults.clone());
        FanucController::new(self.config, Arc::new(Mutex::new(controller)))
    }
}

/// Who a controller is shared between: every connection sees the same registers.
pub type Shared = Arc<Mutex<Controller>>;

/// What a client wrote.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Write {
    /// Outputs, from this address on.
    Coils(u16, Vec<bool>),
    /// Holding registers, from this address on.
    Registers(u16, Vec<u16>),
}

/// An event of a FANUC controller.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum FanucEvent {
    /// An event of the server: a request, corrupt bytes.
    Server(ServerEvent),
    /// A client has read values.
    Read {
        /// The table.
        table: Table,
        /// The PDU address of the first value.
        address: u16,
        /// The number of values.
        count: u16,
    },
    /// A client has written values.
    Written(Write),
}

/// A FANUC controller on one connection; [another](Device::another) has the same registers.
#[allow(missing_debug_implementations, reason = "a motion is a function")]
pub struct FanucController {
    server: Server<Connection>,
}

impl FanucController {
    /// One connection to a controller.
    ///
    /// # Errors
    /// A configuration that cannot work.
    pub fn new(config: ServerConfig, controller: Shared) -> Result<Self, Error> {
        let connection = Connection { controller, accesses: Vec::new() };
        Ok(Self { server: Server::new(config, connection).map_err(Error::settings)? })
    }

    /// The controller behind all its connections.
    pub fn controller(&self) -> MutexGuard<'_, Controller> {
        self.server.registers().lock()
    }
}

impl Device for FanucController {
    type Session = Server<Connection>;
    type Event = FanucEvent;
    type Work = Write;

    fn session(&self) -> &Self::Session {
        &self.server
    }

    fn session_mut(&mut self) -> &mut Self::Session {
        &mut self.server
    }

    fn take(&mut self, _: Duration, event: ServerEvent, notes: &mut Notes<FanucEvent, Write>) {
        if matches!(event, ServerEvent::OutOfStep(_)) {
            notes.close("the client is out of step");
        }
        notes.event(FanucEvent::Server(event));
    }

    fn advance(&mut self, now: Duration, notes: &mut Notes<FanucEvent, Write>) {
        for access in self.server.registers_mut().accesses.drain(..) {
            if let FanucEvent::Written(write) = &access {
                notes.executed(now, write.clone());
            }
            notes.event(access);
        }
        let mut controller = self.controller();
        controller.tick(now);
        if controller.is_away(now) {
            notes.close("the fault `disconnect`");
        }
    }

    fn due(&self) -> Option<Duration> {
        None
    }

    fn restart(&mut self, now: Duration) {
        let (config, shared) = (*self.server.config(), Arc::clone(&self.server.registers().controller));
        // The same configuration has worked before.
        if let Ok(device) = Self::new(config, shared) {
            *self = device;
        }
        let mut controller = self.controller();
        controller.restart();
        controller.tick(now);
    }

    /// What clients have written is gone.
    fn forget(&mut self, now: Duration) {
        let mut controller = self.controller();
        controller.restart();
        controller.tick(now);
    }

    fn another(&self) -> Option<Self> {
        let shared = Arc::clone(&self.server.registers().controller);
        Self::new(*self.server.config(), shared).ok()
    }
}

/// The controller as one connection reaches it.
#[allow(missing_debug_implementations, reason = "a motion is a function")]
pub struct Connection {
    controller: Shared,
    /// Reads and writes that the device has not reported yet.
    accesses: Vec<FanucEvent>,
}

impl Connection {
    fn lock(&self) -> MutexGuard<'_, Controller> {
        self.controller.lock().unwrap_or_else(PoisonError::into_inner)
    }

    #[expect(clippy::cast_possible_truncation, reason = "a request reads 2000 values at most")]
    fn read(&mut self, table: Table, address: u16, count: usize) {
        self.accesses.push(FanucEvent::Read { table, address, count: count as u16 });
    }
}

impl Registers for Connection {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.lock().read_coils(address, out)?;
        self.read(Table::Coils, address, out.len());
        Ok(())
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.lock().read_discrete_inputs(address, out)?;
        self.read(Table::DiscreteInputs, address, out.len());
        Ok(())
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.lock().read_holding_registers(address, out)?;
        self.read(Table::HoldingRegisters, address, out.len());
        Ok(())
    }

    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.lock().read_input_registers(address, out)?;
        self.read(Table::InputRegisters, address, out.len());
        Ok(())
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        self.lock().write_coils(address, values)?;
        let write = Write::Coils(address, values.iter().collect());
        self.accesses.push(FanucEvent::Written(write));
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        self.lock().write_registers(address, values)?;
        let write = Write::Registers(address, values.iter().collect());
        self.accesses.push(FanucEvent::Written(write));
        Ok(())
    }
}
