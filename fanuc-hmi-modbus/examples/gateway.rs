//! Polls robots every 8 ms, and gives a PLC what they say: robot N has the 37 registers from 100 N on; what the PLC writes there goes to
//! the robot. `cargo run -p fanuc-hmi-modbus --features tokio --example gateway -- 0.0.0.0:5020 192.168.0.10:502 192.168.0.11:502`
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "the program has the socket and the pace"
)]

use core::time::Duration;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use fanuc_hmi_modbus::robot_session::tokio::{Tcp, serve};
use fanuc_hmi_modbus::tokio::{Client, client};
use fanuc_hmi_modbus::{ClientConfig, Exception, Registers, Server, ServerConfig, Words, WordsMut};
use tokio::net::TcpListener;
use tokio::time::{MissedTickBehavior, interval};

/// A robot, and what it said last; nothing while it does not answer.
#[derive(Clone)]
struct Robot {
    client: Client,
    said: Arc<Mutex<Option<Vec<u16>>>>,
}

/// What a PLC sees.
#[derive(Clone)]
struct Robots(Arc<[Robot]>);

impl Robots {
    fn robot(&self, address: u16) -> Result<(&Robot, u16), Exception> {
        let robot = self.0.get(usize::from(address / 100)).ok_or(Exception::IllegalDataAddress)?;
        Ok((robot, address % 100))
    }
}

impl Registers for Robots {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let (robot, from) = self.robot(address)?;
        let from = usize::from(from);
        let said = robot.said.lock().unwrap_or_else(PoisonError::into_inner);
        let said = said.as_ref().ok_or(Exception::GatewayTargetFailedToRespond)?;
        out.copy_from(said.get(from..from + out.len()).ok_or(Exception::IllegalDataAddress)?);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        let (robot, to) = self.robot(address)?;
        let (client, values) = (robot.client.clone(), values.iter().collect::<Vec<_>>());
        tokio::spawn(async move {
            client.write_registers(to, &values).await.inspect_err(|error| println!("{error}"))
        });
        Ok(())
    }
}

async fn poll(name: String, robot: Robot) {
    let mut cycle = interval(Duration::from_millis(8));
    cycle.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut last, mut gaps) = (Instant::now(), Vec::new());
    loop {
        cycle.tick().await;
        let said = robot.client.read_holding_registers(0..37).await;
        gaps.push(last.elapsed());
        last = Instant::now();
        if let Err(error) = &said {
            println!("{name}: {error}");
        }
        *robot.said.lock().unwrap_or_else(PoisonError::into_inner) = said.ok();
        if gaps.len() == 1000 {
            gaps.sort_unstable();
            let [middle, most] = [500, 990].map(|at| gaps.get(at).copied().unwrap_or_default());
            println!("{name}: from one reply to the next {middle:?}, 99 % within {most:?}");
            gaps.clear();
        }
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let listener = TcpListener::bind(arguments.next().ok_or("usage: LISTEN ROBOT…")?).await?;
    let mut robots = Vec::new();
    for address in arguments {
        let (client, task) = client(ClientConfig::tcp(), Tcp::new(&*address))?;
        tokio::spawn(task.run());
        let robot = Robot { client, said: Arc::default() };
        tokio::spawn(poll(address, robot.clone()));
        robots.push(robot);
    }
    let all = Robots(robots.into());
    let server = Server::<_, 16>::new(ServerConfig::tcp(), all)?;
    Ok(serve(listener, 16, |_| server.clone(), |_, _, _| {}).await?)
}
