use std::net::ToSocketAddrs;

use robot_session::Session;

use crate::bench::Bench;
use crate::device::{Device, Error};
use crate::running::RunningDevice;
use crate::simulator::Simulator;

/// The settings of a device, from which it is made.
pub trait Settings: Clone {
    /// The device that is made of them.
    type Device: Device;

    /// Creates the device, just switched on.
    ///
    /// # Errors
    /// Settings that cannot work.
    fn device(&self) -> Result<Self::Device, Error>;

    /// Creates the device with its faults, for a loop of the caller.
    ///
    /// # Errors
    /// Settings that cannot work.
    fn simulator(&self) -> Result<Simulator<Self::Device>, Error> {
        Ok(Simulator::new(self.device()?))
    }

    /// Creates a bench of the device and a session that talks to it, on a virtual clock.
    ///
    /// # Errors
    /// Settings that cannot work.
    fn bench<S: Session>(&self, session: S) -> Result<Bench<S, Self::Device>, Error> {
        Ok(Bench::new(session, self.simulator()?))
    }

    /// Runs the device at a TCP address, in a thread; port 0 is any free port.
    ///
    /// # Errors
    /// Settings that cannot work, or the system's.
    fn listen(&self, address: impl ToSocketAddrs) -> Result<RunningDevice<Self::Device>, Error>
    where
        Self::Device: Send + 'static,
    {
        RunningDevice::listen(self.simulator()?, address)
    }

    /// Runs the device as a TCP client, in a thread: a robot that connects to its PC.
    ///
    /// # Errors
    /// Settings that cannot work, or the system's.
    fn connect(&self, address: impl ToSocketAddrs) -> Result<RunningDevice<Self::Device>, Error>
    where
        Self::Device: Send + 'static,
    {
        RunningDevice::connect(self.simulator()?, address)
    }

    /// Runs the device on a pseudo-terminal, in a thread: [`RunningDevice::path`] is opened as a serial port.
    ///
    /// # Errors
    /// Settings that cannot work, or the system's.
    #[cfg(unix)]
    fn pty(&self) -> Result<RunningDevice<Self::Device>, Error>
    where
        Self::Device: Send + 'static,
    {
        RunningDevice::pty(self.simulator()?)
    }

    /// Runs the device on a serial port of this computer, in a thread.
    ///
    /// # Errors
    /// Settings that cannot work, or the system's.
    #[cfg(feature = "serialport")]
    fn port(&self, path: &str, baud: u32) -> Result<RunningDevice<Self::Device>, Error>
    where
        Self::Device: Send + 'static,
    {
        RunningDevice::port(self.simulator()?, path, baud)
    }
}
