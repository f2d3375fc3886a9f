//! The HTTP server for whoever looks after the bridge: hyper, on one thread, with limits that a stranger cannot exceed.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use http_body_util::Full;
use hyper::body::{Body as _, Bytes, Incoming};
use hyper::header::{CONTENT_TYPE, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::TokioIo;
use tokio::runtime::Builder;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

/// So many connections at once; one more takes the place of the oldest.
const MOST: usize = 16;
/// The longest head of a request, in bytes.
const HEAD: usize = 8 * 1024;
/// A connection lasts so long at most: one request and its answer.
const LONGEST: Duration = Duration::from_secs(5);
/// Where the system has no descriptor for another connection it is asked again so often.
const RETRY: Duration = Duration::from_millis(100);

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
pub fn serve(
    listener: TcpListener,
    reply: impl Fn(&str) -> Reply + Send + Sync + 'static,
) -> Result<SocketAddr> {
    let place = listener.local_addr()?;
    listener.set_nonblocking(true)?;
    let runtime =
        Builder::new_current_thread().enable_all().build().context("cannot start the HTTP server")?;
    let run = move || runtime.block_on(accept(listener, Arc::new(reply)));
    thread::Builder::new().name("health".into()).spawn(run).context("cannot start the HTTP server")?;
    Ok(place)
}

async fn accept(listener: TcpListener, reply: Arc<impl Fn(&str) -> Reply + Send + Sync + 'static>) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    let mut open: VecDeque<JoinHandle<()>> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            sleep(RETRY).await;
            continue;
        };
        open.retain(|connection| !connection.is_finished());
        if open.len() >= MOST
            && let Some(oldest) = open.pop_front()
        {
            oldest.abort();
        }
        let reply = Arc::clone(&reply);
        open.push_back(tokio::spawn(async move {
            let service = service_fn(move |request| {
                let response = answer(&request, &*reply);
                async { Ok::<_, Infallible>(response) }
            });
            let connection = http1::Builder::new()
                .keep_alive(false)
                .max_buf_size(HEAD)
                .serve_connection(TokioIo::new(stream), service);
            // What a stranger sends, or does not read, is nobody's error.
            let _ = timeout(LONGEST, connection).await;
        }));
    }
}

fn answer(request: &Request<Incoming>, reply: &impl Fn(&str) -> Reply) -> Response<Full<Bytes>> {
    let plain = |status, body: &str| Reply { status, kind: "text/plain", body: body.into() };
    let Reply { status, kind, body } = if !request.body().is_end_stream() {
        plain(413, "a request has no body here\n")
    } else if request.method() == Method::GET || request.method() == Method::HEAD {
        reply(request.uri().path())
    } else {
        plain(405, "only GET\n")
    };
    let mut response = Response::new(Full::from(body));
    *response.status_mut() = StatusCode::from_u16(status).unwrap_or_default();
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}
