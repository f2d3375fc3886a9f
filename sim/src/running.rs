//! A device in a thread, on a socket or a port.

use core::net::SocketAddr;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::net::{Shutdown, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use crate::device::{Device, Error, ExecutedWork};
use crate::faults::Faults;
use crate::host::{Change, ConnectionEnd, Endpoint, Listener, Notice, Server, State, attend};
use crate::simulator::{Remote, Simulator, SimulatorReport};

/// The interval at which requested faults, new connections and the end are checked.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// The time for which an answer to a call is awaited.
const CALL: Duration = Duration::from_secs(1);

/// A device in a thread, which ends when this is dropped.
#[derive(Debug)]
pub struct RunningDevice<D: Device> {
    address: SocketAddr,
    path: String,
    remote: Remote<D>,
    shared: Shared<D>,
    thread: Option<JoinHandle<()>>,
}

type Shared<D> = Arc<Record<<D as Device>::Event, <D as Device>::Work>>;

/// The record of a device's thread.
#[derive(Debug)]
struct Record<E, W> {
    done: Mutex<ThreadRecord<E, W>>,
    changed: Condvar,
    ends: AtomicBool,
    clock: Instant,
}

#[derive(Debug)]
struct ThreadRecord<E, W> {
    executed: Vec<ExecutedWork<W>>,
    told: Vec<(Duration, SimulatorReport<E>)>,
}

impl<E, W> Record<E, W> {
    fn lock(&self) -> MutexGuard<'_, ThreadRecord<E, W>> {
        self.done.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ends(&self) -> bool {
        self.ends.load(Ordering::Relaxed)
    }

    /// Stores an event after the commands that were executed before it.
    fn note<D: Device<Event = E, Work = W>>(
        &self,
        simulator: &mut Simulator<D>,
        notice: Notice<'_, SimulatorReport<E>>,
    ) -> io::Result<()> {
        let told = match notice {
            Notice::Event(_, told) => Some(told),
            Notice::Settled => None,
            _ => return Ok(()),
        };
        let mut executed = core::iter::from_fn(|| simulator.poll_executed()).peekable();
        if told.is_none() && executed.peek().is_none() {
            return Ok(());
        }
        let mut done = self.lock();
        done.executed.extend(executed);
        done.told.extend(told.map(|told| (self.clock.elapsed(), told)));
        drop(done);
        self.changed.notify_all();
        Ok(())
    }
}

impl<D: Device + Send + 'static> RunningDevice<D> {
    /// Runs the device at a TCP address. The newest client is served, unless the device serves
    /// [several](Simulator::another).
    ///
    /// # Errors
    /// The system's.
    pub fn listen(simulator: Simulator<D>, address: impl ToSocketAddrs) -> Result<Self, Error> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let listener = Listener::new(listener)?;
        Self::start(simulator, address, String::new(), move |simulator, shared| {
            let clock = || shared.clock.elapsed();
            let server = Server { look: Some(POLL_INTERVAL), ..Server::new(listener, clock) };
            server.run(simulator, || !shared.ends(), |simulator, notice| shared.note(simulator, notice))
        })
    }

    /// Runs as a TCP client: it connects when the device requests it, and tries again after a failure.
    ///
    /// # Errors
    /// The system's.
    pub fn connect(simulator: Simulator<D>, address: impl ToSocketAddrs) -> Result<Self, Error> {
        let unknown = || io::Error::new(io::ErrorKind::InvalidInput, "no such address");
        let address = address.to_socket_addrs()?.next().ok_or_else(unknown)?;
        let find = move |device: State, _: &mut Option<TcpStream>| {
            device.connects.then(|| {
                let stream = TcpStream::connect_timeout(&address, CALL)?;
                stream.set_nodelay(true)?;
                Ok(stream)
            })
        };
        let release = |stream: TcpStream| {
            // It may be closed already.
            let _ = stream.shutdown(Shutdown::Both);
            None
        };
        Self::attend(simulator, address, String::new(), None, find, release)
    }

    /// Runs the device on a pseudo-terminal. A program connects when it opens the other end, and disconnects when it closes
    /// that end.
    ///
    /// # Errors
    /// The system's.
    #[cfg(unix)]
    pub fn pty(simulator: Simulator<D>) -> Result<Self, Error> {
        use crate::pty::Pty;
        let (pty, path) = Pty::open()?;
        let find = |device: State, pty: &mut Option<Pty>| {
            let is_open = device.accepts && pty.as_ref().is_some_and(Pty::is_open);
            if is_open { pty.take().map(Ok) } else { None }
        };
        let release = |pty: Pty| {
            pty.discard();
            Some(pty)
        };
        Self::attend(simulator, NOWHERE, path, Some(pty), find, release)
    }

    /// Runs the device on a serial port of this computer.
    ///
    /// # Errors
    /// The system's.
    #[cfg(feature = "serialport")]
    pub fn port(simulator: Simulator<D>, path: &str, baud: u32) -> Result<Self, Error> {
        let port = serialport::new(path, baud).open().map_err(io::Error::from)?;
        // The end of a connection does not close the port.
        let find = |device: State, port: &mut Option<robot_session::Serial>| {
            if device.accepts { port.take().map(Ok) } else { None }
        };
        let port = Some(robot_session::Serial(port));
        Self::attend(simulator, NOWHERE, path.into(), port, find, Some)
    }

    /// Runs the device on the transports that `find` creates or accepts, and `release` returns.
    fn attend<T: Transport + Send + 'static>(
        simulator: Simulator<D>,
        address: SocketAddr,
        path: String,
        idle: Option<T>,
        find: impl FnMut(State, &mut Option<T>) -> Option<io::Result<T>> + Send + 'static,
        release: fn(T) -> Option<T>,
    ) -> Result<Self, Error> {
        Self::start(simulator, address, path, move |mut simulator, shared| {
            let wire = Wire { transport: None, idle, find, release, clock: shared.clock };
            let observe = |simulator: &mut _, notice: Notice<'_, _>| shared.note(simulator, notice);
            attend(&mut simulator, wire, POLL_INTERVAL, || !shared.ends(), observe)
        })
    }

    fn start(
        mut simulator: Simulator<D>,
        address: SocketAddr,
        path: String,
        run: impl FnOnce(Simulator<D>, &Shared<D>) -> io::Result<()> + Send + 'static,
    ) -> Result<Self, Error> {
        let shared = Arc::new(Record {
            done: Mutex::new(ThreadRecord { executed: Vec::new(), told: Vec::new() }),
            changed: Condvar::new(),
            ends: AtomicBool::new(false),
            clock: Instant::now(),
        });
        let (remote, record) = (simulator.remote(), Arc::clone(&shared));
        let thread = thread::Builder::new().name("simulator".into());
        // A wait that the system refuses ends the device.
        let thread = Some(thread.spawn(move || drop(run(simulator, &record)))?);
        Ok(Self { address, path, remote, shared, thread })
    }
}

#[cfg(any(unix, feature = "serialport"))]
const NOWHERE: SocketAddr = SocketAddr::new(core::net::IpAddr::V4(core::net::Ipv4Addr::UNSPECIFIED), 0);

impl<D: Device> RunningDevice<D> {
    /// Returns the address at which it listens, or to which it connects.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the serial port to open: the other end of the pseudo-terminal.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Returns the faults of the device.
    pub fn faults(&self) -> &Faults {
        self.remote.faults()
    }

    /// Calls `call` in the thread of the device and returns its result, such as to set an input of a controller:
    ///
    /// ```
    /// # #[cfg(feature = "fanuc")] {
    /// # use cellwire_sim::{Device as _, Fanuc, Settings as _, robot_session::end::End as _};
    /// # use fanuc_hmi_modbus::Signal;
    /// let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    /// sim.call(|fanuc| fanuc.device().controller().tables_mut().set_signal(Signal::Di(1), 1));
    /// # let read = sim.call(|fanuc| fanuc.device().controller().tables_mut().signal(Signal::Di(1)));
    /// # assert_eq!(read, Some(Some(1))); }
    /// ```
    ///
    /// `None` if the thread has not begun the call within a second.
    pub fn call<R: Send + 'static>(
        &self,
        call: impl FnOnce(&mut Simulator<D>) -> R + Send + 'static,
    ) -> Option<R> {
        self.remote.call(CALL, call)
    }

    /// Returns the executed work, in sequence.
    pub fn executed(&self) -> Vec<ExecutedWork<D::Work>> {
        self.shared.lock().executed.clone()
    }

    /// Returns the device's reports, with their times.
    pub fn told(&self) -> Vec<(Duration, SimulatorReport<D::Event>)> {
        self.shared.lock().told.clone()
    }

    /// Waits until `count` units of work were executed, but no longer than `within`; returns whether they were.
    pub fn wait_for(&self, count: usize, within: Duration) -> bool {
        let waited = self
            .shared
            .changed
            .wait_timeout_while(self.shared.lock(), within, |done| done.executed.len() < count);
        waited.unwrap_or_else(PoisonError::into_inner).0.executed.len() >= count
    }
}

impl<D: Device> Drop for RunningDevice<D> {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join)
            && !thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

/// A transport, while the device is connected, by the clock of the device.
struct Wire<T, F> {
    transport: Option<T>,
    /// The transport of the next connection.
    idle: Option<T>,
    find: F,
    release: fn(T) -> Option<T>,
    clock: Instant,
}

impl<T: Transport, F> Transport for Wire<T, F> {
    fn now(&self) -> Duration {
        self.clock.elapsed()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        match &mut self.transport {
            Some(transport) => transport.receive(buffer, wait),
            None => wait.pause().map(|()| ReceiveOutcome::Nothing),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.transport.as_mut().map_or(Ok(SendOutcome::Buffered), |transport| transport.send(bytes))
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        self.transport.as_mut().map_or(Ok(()), |transport| transport.wait_for_room(wait))
    }
}

impl<T, F> Endpoint for Wire<T, F>
where
    T: Transport,
    F: FnMut(State, &mut Option<T>) -> Option<io::Result<T>>,
{
    type Error = io::Error;

    fn look(&mut self, device: State) -> io::Result<Option<Change>> {
        if device.is_connected {
            return Ok(None);
        }
        Ok((self.find)(device, &mut self.idle).map(|found| match found {
            Ok(transport) => {
                self.transport = Some(transport);
                Change::Connected(String::new())
            }
            Err(error) => Change::Disconnected(error.into()),
        }))
    }

    fn end(&mut self, _: &ConnectionEnd) -> bool {
        self.idle = self.transport.take().and_then(self.release);
        true
    }
}
