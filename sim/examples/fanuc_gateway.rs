//! Polls robots every 8 ms, and gives a PLC what they say: robot N has the 37 registers from 100 N on; what the PLC writes
//! there goes to the robot, unless that does not answer. The reply to a write comes before the robot's: the PLC's next reads
//! show whether it was executed. `cargo run -p cellwire-sim --all-features --example fanuc_gateway -- 0.0.0.0:5020
//! 192.168.0.10:502 192.168.0.11:502`

use core::time::Duration;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use fanuc_hmi_modbus::robot_session::tokio::{Tcp, serve};
use fanuc_hmi_modbus::tokio::{Client, client};
use fanuc_hmi_modbus::{ClientConfig, Exception, Registers, Server, ServerConfig, Words, WordsMut};
use tokio::net::TcpListener;
use tokio::time::{MissedTickBehavior, interval};

/// A robot, and its last reply; `None` while it does not answer.
#[derive(Clone)]
struct Robot {
    client: Client,
    said: Arc<Mutex<Option<Vec<u16>>>>,
}

/// The robots, as a PLC sees them.
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
        if robot.said.lock().unwrap_or_else(PoisonError::into_inner).is_none() {
            return Err(Exception::GatewayTargetFailedToRespond);
        }
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

async fn gateway(listener: TcpListener, addresses: Vec<String>) -> Result<(), Box<dyn core::error::Error>> {
    let mut robots = Vec::new();
    for address in addresses {
        let (client, task) = client(ClientConfig::tcp(), Tcp::new(&*address))?;
        tokio::spawn(task.run());
        let robot = Robot { client, said: Arc::default() };
        tokio::spawn(poll(address, robot.clone()));
        robots.push(robot);
    }
    let server = Server::<_, 16>::new(ServerConfig::tcp(), Robots(robots.into()))?;
    Ok(serve(listener, 16, |_| server.clone(), |_, _, _| {}).await?)
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let listener = TcpListener::bind(arguments.next().ok_or("usage: LISTEN ROBOT…")?).await?;
    gateway(listener, arguments.collect()).await
}

#[cfg(test)]
mod tests {
    use cellwire_sim::fanuc::Write;
    use cellwire_sim::{Fanuc, Fault, Script, Settings as _};
    use fanuc_hmi_modbus::tokio::Error;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpStream;
    use tokio::time::{sleep, timeout};

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Reads as a PLC's program does, until `is_so` returns true for the registers.
    async fn until(plc: &Client, from: u16, is_so: impl Fn(&Result<Vec<u16>, Error>) -> bool) {
        let wait = async {
            while !is_so(&plc.read_holding_registers(from..from + 37).await) {
                sleep(MS).await;
            }
        };
        timeout(Duration::from_secs(20), wait).await.unwrap();
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 1)]
    async fn robots_that_fail_fail_alone_and_what_is_written_arrives() {
        let robots: [_; 3] = core::array::from_fn(|_| Fanuc::default().listen("127.0.0.1:0").unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let names = robots.each_ref().map(|robot| robot.address().to_string()).to_vec();
        let run = gateway(listener, names);
        let test = async {
            let (plc, task) = client(ClientConfig::tcp(), Tcp::new(address.to_string())).unwrap();
            tokio::spawn(task.run());
            for robot in [0, 100, 200] {
                until(&plc, robot, Result::is_ok).await;
            }
            robots[0].faults().freeze(1500 * MS);
            robots[1]
                .faults()
                .follow(Script::new().every_answer(7, Fault::Cut).every_answer(5, Fault::Delay(3 * MS)));
            let fails =
                |said: &_| matches!(said, Err(Error::Exception(Exception::GatewayTargetFailedToRespond)));
            until(&plc, 0, fails).await;
            let refused = plc.write_registers(10, &[7, 8]).await;
            assert!(matches!(refused, Err(Error::Exception(Exception::GatewayTargetFailedToRespond))));
            assert!(plc.read_holding_registers(200..237).await.is_ok(), "the third robot has done nothing");
            until(&plc, 0, Result::is_ok).await;
            plc.write_registers(210, &[7, 8]).await.unwrap();
            assert!(tokio::task::block_in_place(|| robots[2].wait_for(1, Duration::from_secs(5))));
            assert_eq!(robots[2].executed()[0].work, Write::Registers(10, vec![7, 8]));
            assert!(robots[0].executed().is_empty(), "it was refused");
            until(&plc, 100, Result::is_ok).await;
            // A hundred requests at once are answered in their order.
            let mut stream = TcpStream::connect(address).await.unwrap();
            let requests = (0..100u8).flat_map(|n| [0, n, 0, 0, 0, 6, 1, 3, 0, 200, 0, 1]);
            stream.write_all(&requests.collect::<Vec<u8>>()).await.unwrap();
            let mut replies = [0; 1100];
            stream.read_exact(&mut replies).await.unwrap();
            assert!(
                replies.chunks(11).zip(0..100u8).all(|(reply, n)| reply[..9] == [0, n, 0, 0, 0, 5, 1, 3, 2])
            );
        };
        tokio::select! {
            ended = run => panic!("{ended:?}"),
            () = test => {}
        }
    }
}
