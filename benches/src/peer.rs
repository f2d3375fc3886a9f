//! The other end of a row's connection, in a program of its own: callgrind does not count it.

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread;

/// The work of a link's peer on one connection.
pub type Serve = fn(TcpStream);

/// A peer, which ends when this is dropped.
#[derive(Debug)]
pub struct Peer {
    /// The address at which it listens.
    pub address: SocketAddr,
    child: Child,
    _stdin: ChildStdin,
}

impl Peer {
    /// Starts this program as one of the [`peers`](crate::Link::peers) of a link.
    ///
    /// # Panics
    /// If it does not start.
    pub fn of(link: &str, number: usize) -> Self {
        let this = std::env::current_exe().expect("the path of this program");
        let mut command = Command::new(this);
        command.args(["--peer", link, &number.to_string()]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the peer starts");
        let stdin = child.stdin.take().expect("it was piped");
        let mut line = String::new();
        let stdout = child.stdout.take().expect("it was piped");
        BufReader::new(stdout).read_line(&mut line).expect("the address of the peer");
        Self { address: line.trim().parse().expect("an address"), child, _stdin: stdin }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs the program as a peer: prints its address, and serves each connection in a thread until standard input ends.
pub(crate) fn run(serve: Serve) -> io::Result<()> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("{}", listener.local_addr()?);
    io::stdout().flush()?;
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let _ = stream.set_nodelay(true);
            thread::spawn(move || serve(stream));
        }
    });
    io::stdin().read_to_end(&mut Vec::new())?;
    Ok(())
}
