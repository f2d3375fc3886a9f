//! A small HTTP server for whoever looks after a program.

use std::net::{SocketAddr, TcpListener};
use std::thread;

use anyhow::{Context, Result, anyhow};
use tiny_http::{Header, Method, Response, Server};

/// The answer to a request.
#[derive(Debug)]
pub struct Reply {
    /// Such as 200.
    pub status: u16,
    /// The content's type.
    pub kind: &'static str,
    /// The content.
    pub body: String,
}

/// Answers every `GET` with what `reply` makes of its path, until the process ends. Returns where it listens.
///
/// # Errors
/// When the system has no room for a thread.
pub fn serve(listener: TcpListener, reply: impl Fn(&str) -> Reply + Send + 'static) -> Result<SocketAddr> {
    let place = listener.local_addr()?;
    let server =
        Server::from_listener(listener, None).map_err(|error| anyhow!("the HTTP server: {error}"))?;
    let answer = move || {
        for request in server.incoming_requests() {
            let path = request.url().split('?').next().unwrap_or_default();
            let Reply { status, kind, body } = match request.method() {
                Method::Get | Method::Head => reply(path),
                _ => Reply { status: 405, kind: "text/plain", body: "only GET\n".into() },
            };
            let mut response = Response::from_string(body).with_status_code(status);
            if let Ok(header) = Header::from_bytes("Content-Type", kind) {
                response = response.with_header(header);
            }
            // Who has gone meanwhile needs no answer.
            let _ = request.respond(response);
        }
    };
    thread::Builder::new().name("health".into()).spawn(answer).context("cannot start the HTTP server")?;
    Ok(place)
}
