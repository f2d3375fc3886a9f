//! A read of 37 registers over TCP by our client and by those of others.
//!
//! `clients serve MS` is the server for all, which takes so many milliseconds for a reply, and prints its address. `clients
//! NAME ADDRESS ROUNDS` reads so often, to be counted. `clients race ADDRESS` prints the times of all, which take turns.

use std::future::Future;
use std::io::{Read, Write};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use fanuc_hmi_modbus::robot_session::tokio::{Driver, Tcp};
use fanuc_hmi_modbus::robot_session::{Session as _, now};
use fanuc_hmi_modbus::tokio::client;
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Reply, Request};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_modbus::client::Reader as _;
use voltage_modbus::{ModbusClient as _, ModbusTcpClient};

const N: u16 = 37;
const TIMEOUT: Duration = Duration::from_secs(1);
const CALLERS: u64 = 16;
const NAMES: [&str; 5] = ["tokio-modbus", "voltage_modbus", "driver", "handle", "handle-16"];

fn serve(delay: Duration) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    println!("{}", listener.local_addr().unwrap());
    for stream in listener.incoming() {
        std::thread::spawn(move || {
            let mut stream = stream.unwrap();
            stream.set_nodelay(true).unwrap();
            let (mut bytes, mut held) = ([0; 4096], 0);
            while let Ok(length @ 1..) = stream.read(&mut bytes[held..]) {
                held += length;
                let mut replies = Vec::new();
                for request in bytes[..held].chunks_exact(12) {
                    replies.extend([
                        request[0],
                        request[1],
                        0,
                        0,
                        0,
                        3 + 2 * N as u8,
                        request[6],
                        3,
                        2 * N as u8,
                    ]);
                    replies.extend([7; 2 * N as usize]);
                }
                bytes.copy_within(held / 12 * 12..held, 0);
                held %= 12;
                if !delay.is_zero() {
                    std::thread::sleep(delay);
                }
                stream.write_all(&replies).unwrap();
            }
        });
    }
}

async fn dial(address: &str) -> TcpStream {
    let stream = TcpStream::connect(address).await.unwrap();
    stream.set_nodelay(true).unwrap();
    stream
}

/// Reads `rounds` times; returns the time without that of connecting.
async fn run(name: &str, address: &str, rounds: u64) -> Duration {
    match name {
        "tokio-modbus" => {
            let mut client =
                tokio_modbus::client::tcp::attach_slave(dial(address).await, tokio_modbus::Slave(1));
            let mut read = async || {
                let words = timeout(TIMEOUT, client.read_holding_registers(0, N)).await;
                words.unwrap().unwrap().unwrap()
            };
            read().await;
            timed(async {
                for _ in 0..rounds {
                    assert_eq!(read().await.len(), 37);
                }
            })
            .await
        }
        "voltage_modbus" => {
            let mut client = ModbusTcpClient::from_address(address, TIMEOUT).await.unwrap();
            let mut read = async || client.read_03(1, 0, N).await.unwrap();
            read().await;
            timed(async {
                for _ in 0..rounds {
                    assert_eq!(read().await.len(), 37);
                }
            })
            .await
        }
        "driver" => {
            let mut driver = Driver::new(dial(address).await);
            let mut session = Client::<1>::new(ClientConfig::tcp()).unwrap();
            session.handle_connected(now());
            let mut read = async || {
                session.request(1, &Request::ReadHoldingRegisters { address: 0, quantity: N }).unwrap();
                let mut words: Vec<u16> = Vec::new();
                while words.is_empty() {
                    let turn = driver.turn(&mut session, |session, event| {
                        if let ClientEvent::Replied { ticket, .. } = event
                            && let Some(Reply::HoldingRegisters(found)) = session.reply(ticket)
                        {
                            words = found.iter().collect();
                        }
                        ControlFlow::<()>::Continue(())
                    });
                    assert!(turn.await.unwrap().is_continue());
                }
                words
            };
            read().await;
            timed(async {
                for _ in 0..rounds {
                    assert_eq!(read().await.len(), 37);
                }
            })
            .await
        }
        "handle" | "handle-16" => {
            let callers = if name == "handle" { 1 } else { CALLERS };
            let config = ClientConfig { in_flight: if callers == 1 { 1 } else { 8 }, ..ClientConfig::tcp() };
            let (client, task) = client(config, Tcp::new(address)).unwrap();
            let task = tokio::spawn(task.run());
            client.read_holding_registers(0..N).await.unwrap();
            let taken = timed(async {
                let callers: Vec<_> = (0..callers)
                    .map(|caller| {
                        let client = client.clone();
                        tokio::spawn(async move {
                            for _ in (caller..rounds).step_by(callers as usize) {
                                assert_eq!(client.read_holding_registers(0..N).await.unwrap().len(), 37);
                            }
                        })
                    })
                    .collect();
                for caller in callers {
                    caller.await.unwrap();
                }
            });
            let taken = taken.await;
            client.handle().shutdown().await;
            task.await.unwrap();
            taken
        }
        _ => panic!("no such client: {name}"),
    }
}

async fn timed(work: impl Future<Output = ()>) -> Duration {
    let begin = Instant::now();
    work.await;
    begin.elapsed()
}

/// Runs in a task: the main future of a runtime is woken through its port, which costs more.
fn in_a_task(name: &'static str, address: &str, rounds: u64) -> Duration {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let address = address.to_owned();
    let task = runtime.spawn(async move { run(name, &address, rounds).await });
    runtime.block_on(task).unwrap()
}

fn race(address: &str) {
    const ROUNDS: u64 = 200;
    let mut samples = NAMES.map(|_| Vec::new());
    for round in 0..151 {
        for turn in 0..NAMES.len() {
            let at = (round + turn) % NAMES.len();
            samples[at].push(in_a_task(NAMES[at], address, ROUNDS).as_secs_f64() * 1e6 / ROUNDS as f64);
        }
    }
    let medians = samples.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    for (name, time) in NAMES.iter().zip(medians) {
        println!("{name:15} {time:6.1} µs {:5.2} ×", time / medians[0]);
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["serve", ms] => serve(Duration::from_millis(ms.parse().unwrap())),
        ["race", address] => race(address),
        [name, address, rounds] => {
            let name = NAMES.into_iter().find(|known| known == name).expect("a client");
            in_a_task(name, address, rounds.parse().unwrap());
        }
        _ => panic!("clients serve MS | race ADDRESS | NAME ADDRESS ROUNDS"),
    }
}
