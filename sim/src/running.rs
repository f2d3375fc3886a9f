//! A device in a thread, on a socket or a port.

use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::net::{Shutdown, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use robot_session::{Driver, Ended, Received, Sent, Session as _, Transport, Wait};

use crate::device::{Device, Error, Executed};
use crate::faults::Faults;
use crate::simulator::{Remote, Simulator, Told};

/// How often a fault that was asked for, a new connection and the end are looked for.
const LOOK: Duration = Duration::from_millis(5);
/// How long an answer to a call is waited for.
const CALL: Duration = Duration::from_secs(1);

/// A device in a thread, which ends when this is dropped.
#[derive(Debug)]
pub struct Running<D: Device> {
    address: SocketAddr,
    path: String,
    remote: Remote<D>,
    shared: Shared<D>,
    thread: Option<JoinHandle<()>>,
}

type Shared<D> = Arc<Record<<D as Device>::Event, <D as Device>::Work>>;

/// What a thread has to say.
#[derive(Debug)]
struct Record<E, W> {
    done: Mutex<Done<E, W>>,
    changed: Condvar,
    ends: AtomicBool,
    clock: Instant,
}

#[derive(Debug)]
struct Done<E, W> {
    executed: Vec<Executed<W>>,
    told: Vec<(Duration, Told<E>)>,
}

impl<E, W> Record<E, W> {
    fn lock(&self) -> MutexGuard<'_, Done<E, W>> {
        self.done.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ends(&self) -> bool {
        self.ends.load(Ordering::Relaxed)
    }
}

impl<D: Device + Send + 'static> Running<D> {
    /// Behind a TCP address. One client at a time, the newest, unless the device serves [several](Simulator::another).
    ///
    /// # Errors
    /// The system's.
    pub fn listen(simulator: Simulator<D>, address: impl ToSocketAddrs) -> Result<Self, Error> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        Self::start(simulator, address, String::new(), move |simulator, shared| {
            serve(simulator, shared, &listener);
        })
    }

    /// As a TCP client: it connects when it wants to, and tries again when that fails.
    ///
    /// # Errors
    /// The system's.
    pub fn connect(simulator: Simulator<D>, address: impl ToSocketAddrs) -> Result<Self, Error> {
        let unknown = || io::Error::new(io::ErrorKind::InvalidInput, "no such address");
        let address = address.to_socket_addrs()?.next().ok_or_else(unknown)?;
        Self::start(simulator, address, String::new(), move |simulator, shared| {
            dial(simulator, shared, address);
        })
    }

    /// On a pseudo-terminal. A program that opens its other end makes a connection, and ends it by closing that.
    ///
    /// # Errors
    /// The system's.
    #[cfg(unix)]
    pub fn pty(simulator: Simulator<D>) -> Result<Self, Error> {
        let (pty, path) = crate::pty::Pty::open()?;
        Self::start(simulator, NOWHERE, path, move |simulator, shared| attend(simulator, shared, pty))
    }

    /// On a serial port of this machine.
    ///
    /// # Errors
    /// The system's.
    #[cfg(feature = "serialport")]
    pub fn port(simulator: Simulator<D>, path: &str, baud: u32) -> Result<Self, Error> {
        let port = serialport::new(path, baud).open().map_err(io::Error::from)?;
        let port = robot_session::Serial(port);
        Self::start(simulator, NOWHERE, path.into(), move |simulator, shared| stay(simulator, shared, port))
    }

    fn start(
        mut simulator: Simulator<D>,
        address: SocketAddr,
        path: String,
        run: impl FnOnce(&mut Simulator<D>, &Shared<D>) + Send + 'static,
    ) -> Result<Self, Error> {
        let shared = Arc::new(Record {
            done: Mutex::new(Done { executed: Vec::new(), told: Vec::new() }),
            changed: Condvar::new(),
            ends: AtomicBool::new(false),
            clock: Instant::now(),
        });
        let (remote, record) = (simulator.remote(), Arc::clone(&shared));
        let thread = thread::Builder::new().name("simulator".into());
        let thread = Some(thread.spawn(move || run(&mut simulator, &record))?);
        Ok(Self { address, path, remote, shared, thread })
    }
}

#[cfg(any(unix, feature = "serialport"))]
const NOWHERE: SocketAddr = SocketAddr::new(core::net::IpAddr::V4(core::net::Ipv4Addr::UNSPECIFIED), 0);

impl<D: Device> Running<D> {
    /// Where it listens, or what it connects to.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The serial port to open: the other end of the pseudo-terminal.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// What goes wrong with it.
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

    /// What was executed, in this order.
    pub fn executed(&self) -> Vec<Executed<D::Work>> {
        self.shared.lock().executed.clone()
    }

    /// What it has told, and when.
    pub fn told(&self) -> Vec<(Duration, Told<D::Event>)> {
        self.shared.lock().told.clone()
    }

    /// Waits until so much was executed, and says whether it was; no longer than `within`.
    pub fn wait_for(&self, count: usize, within: Duration) -> bool {
        let waited = self
            .shared
            .changed
            .wait_timeout_while(self.shared.lock(), within, |done| done.executed.len() < count);
        waited.unwrap_or_else(PoisonError::into_inner).0.executed.len() >= count
    }
}

impl<D: Device> Drop for Running<D> {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join)
            && !thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

/// What carries the bytes, by the clock of the device.
struct Wire<T> {
    transport: Option<T>,
    clock: Instant,
}

impl<T: Transport> Transport for Wire<T> {
    fn now(&self) -> Duration {
        self.clock.elapsed()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        match &mut self.transport {
            Some(transport) => transport.receive(buffer, wait),
            None => wait.pause().map(|()| Received::Nothing),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.transport.as_mut().map_or(Ok(Sent::Buffered), |transport| transport.send(bytes))
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        self.transport.as_mut().map_or(Ok(()), |transport| transport.wait_for_room(wait))
    }
}

/// What a turn has led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    Goes,
    /// The connection is over.
    Ends,
    /// The device wants one.
    Connect,
}

/// A device's loop over one connection after the other.
struct Loop<'a, D: Device, T> {
    simulator: &'a mut Simulator<D>,
    shared: &'a Shared<D>,
    driver: Driver<Wire<T>>,
}

impl<'a, D: Device, T: Transport> Loop<'a, D, T> {
    fn new(simulator: &'a mut Simulator<D>, shared: &'a Shared<D>) -> Self {
        let driver = Driver::new(Wire { transport: None, clock: shared.clock });
        Self { simulator, shared, driver }
    }

    fn now(&self) -> Duration {
        self.shared.clock.elapsed()
    }

    fn connect(&mut self, transport: T) {
        self.driver = Driver::new(Wire { transport: Some(transport), clock: self.shared.clock });
        self.simulator.handle_connected(self.now());
    }

    /// Ends the connection; what carried it.
    fn disconnect(&mut self) -> Option<T> {
        let transport = self.driver.transport_mut().transport.take()?;
        self.driver = Driver::new(Wire { transport: None, clock: self.shared.clock });
        self.simulator.handle_disconnected(self.now());
        Some(transport)
    }

    fn turn(&mut self) -> Turn {
        let Self { simulator, shared, driver } = self;
        let turn = driver.turn(&mut **simulator, Some(LOOK), |simulator, told| {
            note(simulator, shared, Some(told.clone()));
            match told {
                Told::Close(_) => ControlFlow::Break(Turn::Ends),
                Told::Connect => ControlFlow::Break(Turn::Connect),
                Told::Device(_) | Told::Fault(_) => ControlFlow::Continue(()),
            }
        });
        note(simulator, shared, None);
        match turn {
            Ok(ControlFlow::Continue(())) => Turn::Goes,
            Ok(ControlFlow::Break(Ended::ByHandler(turn))) => turn,
            Ok(ControlFlow::Break(Ended::ByPeer | Ended::Stalled)) | Err(_) => Turn::Ends,
        }
    }
}

/// Takes over what was executed before it is told of.
fn note<D: Device>(simulator: &mut Simulator<D>, shared: &Shared<D>, told: Option<Told<D::Event>>) {
    let mut executed = core::iter::from_fn(|| simulator.poll_executed()).peekable();
    if told.is_none() && executed.peek().is_none() {
        return;
    }
    let mut done = shared.lock();
    done.executed.extend(executed);
    done.told.extend(told.map(|told| (shared.clock.elapsed(), told)));
    drop(done);
    shared.changed.notify_all();
}

fn serve<D: Device + Send + 'static>(
    simulator: &mut Simulator<D>,
    shared: &Shared<D>,
    listener: &TcpListener,
) {
    let mut others = Vec::new();
    let mut device = Loop::<D, TcpStream>::new(simulator, shared);
    while !shared.ends() {
        let arrival = if device.simulator.accepts(device.now()) { accept(listener) } else { None };
        match arrival.map(|stream| (stream, device.simulator.another())) {
            Some((stream, Some(another))) => {
                let shared = Arc::clone(shared);
                others.push(thread::spawn(move || converse(another, &shared, stream)));
            }
            Some((stream, None)) => {
                close(device.disconnect());
                device.connect(stream);
            }
            None => {}
        }
        if device.turn() == Turn::Ends {
            close(device.disconnect());
        }
    }
    close(device.disconnect());
    for other in others {
        if let Err(panic) = other.join() {
            std::panic::resume_unwind(panic);
        }
    }
}

/// One connection of several.
fn converse<D: Device>(mut simulator: Simulator<D>, shared: &Shared<D>, stream: TcpStream) {
    let mut device = Loop::new(&mut simulator, shared);
    device.connect(stream);
    while !shared.ends() && device.turn() != Turn::Ends {}
    close(device.disconnect());
}

fn dial<D: Device>(simulator: &mut Simulator<D>, shared: &Shared<D>, address: SocketAddr) {
    let mut device = Loop::<D, TcpStream>::new(simulator, shared);
    while !shared.ends() {
        match device.turn() {
            Turn::Goes => {}
            Turn::Connect => match TcpStream::connect_timeout(&address, CALL) {
                Ok(stream) if stream.set_nodelay(true).is_ok() => device.connect(stream),
                // It was asked to connect, and says when it tries again.
                _ => device.simulator.handle_disconnected(device.now()),
            },
            Turn::Ends => close(device.disconnect()),
        }
    }
    close(device.disconnect());
}

/// On a pseudo-terminal, where a program that opens the other end makes a connection.
#[cfg(unix)]
fn attend<D: Device>(simulator: &mut Simulator<D>, shared: &Shared<D>, pty: crate::pty::Pty) {
    let mut device = Loop::new(simulator, shared);
    let mut line = Some(pty);
    while !shared.ends() {
        if line.as_ref().is_some_and(crate::pty::Pty::is_open)
            && device.simulator.accepts(device.now())
            && let Some(line) = line.take()
        {
            device.connect(line);
        }
        if device.turn() == Turn::Ends {
            line = device.disconnect();
            line.iter().for_each(crate::pty::Pty::discard);
        }
    }
}

/// On a line, which no end of a connection closes.
#[cfg(feature = "serialport")]
fn stay<D: Device, T: Transport>(simulator: &mut Simulator<D>, shared: &Shared<D>, line: T) {
    let mut device = Loop::new(simulator, shared);
    device.connect(line);
    let mut line = None;
    while !shared.ends() {
        if device.turn() == Turn::Ends {
            line = device.disconnect();
        }
        if device.simulator.accepts(device.now())
            && let Some(line) = line.take()
        {
            device.connect(line);
        }
    }
}

fn accept(listener: &TcpListener) -> Option<TcpStream> {
    let (stream, _) = listener.accept().ok()?;
    // A client that has gone already is none.
    stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true)).ok()?;
    Some(stream)
}

fn close(stream: Option<TcpStream>) {
    if let Some(stream) = stream {
        // It may be closed already.
        let _ = stream.shutdown(Shutdown::Both);
    }
}
