//! Both ends of the link for any job, over TCP or UDP.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    dead_code,
    reason = "each program uses its part"
)]

use core::error::Error;
use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind};
use std::net::{TcpListener, TcpStream, UdpSocket};

use kawasaki_msg::robot_session::{
    Driver, EndReason, ReceiveOutcome, SendOutcome, Session as _, Transport, Wait, drive, now,
};
use kawasaki_msg::{Job, JobSource, Pc, PcConfig, PcEvent, Robot, RobotConfig, RobotEvent, Work, motion};

/// Runs an example: `--example NAME -- pc|robot tcp|udp [ADDRESS]`.
pub(crate) fn main<W: Work + Send + core::fmt::Debug + 'static>(jobs: &[W]) -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let address = arguments.get(2).unwrap_or(&"127.0.0.1:9105");
    match arguments.as_slice() {
        ["pc", "tcp", ..] => println!("{} executed", pc_tcp(&TcpListener::bind(address)?, jobs)?),
        ["pc", "udp", ..] => println!("{} executed", pc_udp(UdpSocket::bind(address)?, jobs)?),
        ["robot", "tcp", ..] => println!("{:#?}", robot::<W>(RobotConfig::tcp(), || tcp(address))?.last()),
        ["robot", "udp", ..] => println!("{:#?}", robot::<W>(RobotConfig::udp(), || udp(address))?.last()),
        _ => println!("arguments: pc|robot tcp|udp [ADDRESS]"),
    }
    Ok(())
}

/// Has the jobs executed as order 50; returns the number of executed jobs. Nothing is stored: a program that is started again
/// begins with the first job.
pub(crate) fn pc_tcp<S: JobSource>(listener: &TcpListener, jobs: S) -> Result<u32, Box<dyn Error>> {
    let mut pc = Pc::new(PcConfig::tcp())?;
    pc.start(50, jobs)?;
    // The order outlives a connection: with the next one it goes on.
    loop {
        let ended = drive(&mut pc, listener.accept()?.0, |_, event| until_over(&event))?;
        if let EndReason::ByHandler(Some(outcome)) = ended {
            return Ok(outcome?);
        }
    }
}

/// Has the jobs executed as order 50 over UDP, where there is no connection to accept; returns the number of executed jobs.
pub(crate) fn pc_udp<S: JobSource>(socket: UdpSocket, jobs: S) -> Result<u32, Box<dyn Error>> {
    let mut pc = Pc::new(PcConfig::udp())?;
    pc.start(50, jobs)?;
    let mut peer = Udp { socket, peer: None };
    loop {
        let ended = drive(&mut pc, &mut peer, |_, event| until_over(&event))?;
        if let EndReason::ByHandler(Some(outcome)) = ended {
            return Ok(outcome?);
        }
    }
}

/// Breaks the loop when the order has an outcome, or the connection is to be closed.
fn until_over(event: &PcEvent) -> ControlFlow<Option<Result<u32, String>>> {
    ControlFlow::Break(match *event {
        PcEvent::Disconnect => None,
        PcEvent::OrderOver { executed, .. } => Some(Ok(executed)),
        PcEvent::OutcomeUnknown { executed, sent, .. } => {
            Some(Err(format!("check the workpiece: jobs {executed} to {sent} are executed or not")))
        }
        PcEvent::OrderRefused { active, given_up: true, .. } => {
            Some(Err(format!("the robot is in order {active}")))
        }
        _ => return ControlFlow::Continue(()),
    })
}

/// Executes one order; returns its jobs in the sequence of their execution.
pub(crate) fn robot<W: Work + Send + 'static>(
    config: RobotConfig,
    connect: impl Fn() -> io::Result<Box<dyn Transport>>,
) -> Result<Vec<Job<W>>, Box<dyn Error>> {
    let (jobs, mut motion) = motion::boxed(64, config.max_number)?;
    let (mut robot, mut executed, mut is_over) = (Robot::new(config, jobs)?, Vec::new(), false);
    loop {
        // Wait for the session's event: it comes at once, and some time after a connection was lost.
        while robot.poll_event() != Some(RobotEvent::Connect) {
            std::thread::sleep(robot.poll_timeout().unwrap_or_default().saturating_sub(now()));
            robot.handle_timeout(now());
        }
        let mut transport = match connect() {
            Ok(transport) => transport,
            Err(_) if is_over => return Ok(executed),
            Err(_) => {
                robot.handle_disconnected(now());
                continue;
            }
        };
        robot.handle_connected(now());
        let (mut driver, mut since) = (Driver::new(&mut *transport), now());
        loop {
            // The motion task. On a controller it is a task of its own, and wakes the driver.
            let mut wait = None;
            while let Some(job) = motion.take() {
                executed.push(job.complete());
                wait = Some(Duration::ZERO);
            }
            if is_over {
                // The PC learns of it with the next packet.
                let until = since + 10 * kawasaki_msg::timing::EXCHANGE;
                if now() >= until {
                    return Ok(executed);
                }
                wait = Some(until.saturating_sub(now()));
            }
            let turn = driver.turn(&mut robot, wait, |_, event| match event {
                RobotEvent::Disconnect => ControlFlow::Break(false),
                RobotEvent::OrderOver { .. } => ControlFlow::Break(true),
                _ => ControlFlow::Continue(()),
            });
            match turn {
                Ok(ControlFlow::Continue(())) => {}
                Ok(ControlFlow::Break(kawasaki_msg::robot_session::EndReason::ByHandler(true))) => {
                    (is_over, since) = (true, now());
                }
                _ => break,
            }
        }
        robot.handle_disconnected(now());
    }
}

/// Returns a new connection.
pub(crate) fn tcp(address: &str) -> io::Result<Box<dyn Transport>> {
    Ok(Box::new(TcpStream::connect(address)?))
}

/// Returns a socket for datagrams to this address.
pub(crate) fn udp(address: &str) -> io::Result<Box<dyn Transport>> {
    let peer = address.parse().map_err(|_| io::Error::from(ErrorKind::InvalidInput))?;
    Ok(Box::new(Udp { socket: UdpSocket::bind("0.0.0.0:0")?, peer: Some(peer) }))
}

/// Datagrams to and from the peer that sent last.
struct Udp {
    socket: UdpSocket,
    peer: Option<SocketAddr>,
}

impl Transport for Udp {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        self.socket.set_read_timeout(wait.limit.map(|wait| wait.max(Duration::from_micros(1))))?;
        match self.socket.recv_from(buffer) {
            Ok((length, peer)) => {
                self.peer = Some(peer);
                Ok(ReceiveOutcome::Bytes(length))
            }
            // The peer does not listen yet, or nothing came in time.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Ok(ReceiveOutcome::Nothing),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(ReceiveOutcome::Nothing)
            }
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        if let Some(peer) = self.peer {
            // A datagram that is lost is sent again in the next cycle.
            let _ = self.socket.send_to(bytes, peer);
        }
        Ok(SendOutcome::Buffered)
    }
}
