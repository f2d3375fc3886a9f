//! tokio-modbus as a server to race against, on a free port that the first line of output names: `tokio-server THREADS`.

use std::future::{Ready, ready};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Builder;
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};
use tokio_modbus::{ExceptionCode, Request, Response};

#[derive(Clone)]
struct Registers(Arc<Mutex<Vec<u16>>>);

impl Service for Registers {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Self::Request) -> Self::Future {
        let Request::ReadHoldingRegisters(first, count) = request else {
            return ready(Err(ExceptionCode::IllegalFunction));
        };
        let range = usize::from(first)..usize::from(first) + usize::from(count);
        let registers = self.0.lock().unwrap();
        let found = registers.get(range).map(|words| Response::ReadHoldingRegisters(words.to_vec()));
        ready(found.ok_or(ExceptionCode::IllegalDataAddress))
    }
}

fn main() {
    let threads = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(1);
    let runtime = if threads > 1 {
        Builder::new_multi_thread().worker_threads(threads).enable_io().build()
    } else {
        Builder::new_current_thread().enable_io().build()
    };
    runtime.unwrap().block_on(async {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        println!("{}", listener.local_addr().unwrap().port());
        let registers = Registers(Arc::new(Mutex::new(vec![0; 16448])));
        let connected = |stream: TcpStream, peer: SocketAddr| {
            let registers = registers.clone();
            async move {
                stream.set_nodelay(true)?;
                accept_tcp_connection(stream, peer, move |_| Ok(Some(registers.clone())))
            }
        };
        Server::new(listener).serve(&connected, |error| eprintln!("{error}")).await.unwrap();
    });
}
