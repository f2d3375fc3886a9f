//! The HTTP server for monitoring: hyper, on one thread, with limits for every client.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Poll, ready};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use hyper::header::{self, HeaderName, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::TokioIo;
use socket2::SockRef;
use tokio::runtime::Builder;
use tokio::task::JoinHandle;
use tokio::time::{Interval, interval, sleep};

/// The maximum number of connections; another one takes the place of the oldest.
const MAX_CONNECTIONS: usize = 16;
/// The longest head of a request, in bytes.
const HEAD: usize = 8 * 1024;
/// The longest time of a connection: one request and its answer.
const CONNECTION_TIMEOUT: Duration = Duration::from_secs(5);
/// The interval at which live data is sent, until the client goes; a client that has not read anything for
/// [`CONNECTION_TIMEOUT`] is dropped.
const EVERY: Duration = Duration::from_secs(1);
/// The bytes that the system buffers for a client that does not read.
const UNREAD: usize = 64 * 1024;
/// A page loads everything from here, and must not be embedded elsewhere.
const HEADERS: [(HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
];
/// The interval at which a connection is retried when the system has no descriptor for it.
const RETRY: Duration = Duration::from_millis(100);

/// The answer to a request.
#[derive(Debug)]
pub struct Reply {
    /// The status code, such as 200.
    pub status: u16,
    /// The media type of the content.
    pub kind: &'static str,
    /// The content, as text.
    pub body: String,
    /// Whether the content is an event, and followed by others for as long as the client reads.
    pub is_live: bool,
}

impl Reply {
    /// Makes an answer that is there at once.
    pub fn new(status: u16, kind: &'static str, body: impl Into<String>) -> Self {
        Self { status, kind, body: body.into(), is_live: false }
    }
}

/// Answers every `GET` with the result of `reply` for its path, until the process ends. Returns the address that it listens at.
///
/// # Errors
/// If the system has no room for a thread.
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
        if open.len() >= MAX_CONNECTIONS
            && let Some(oldest) = open.pop_front()
        {
            oldest.abort();
        }
        let _ = SockRef::from(&stream).set_send_buffer_size(UNREAD);
        let reply = Arc::clone(&reply);
        open.push_back(tokio::spawn(async move {
            let taken = Arc::new(Mutex::new(Instant::now()));
            let service = service_fn(|request| {
                let response = answer(&request, &reply, &taken);
                async { Ok::<_, Infallible>(response) }
            });
            let connection = http1::Builder::new()
                .keep_alive(false)
                .max_buf_size(HEAD)
                .serve_connection(TokioIo::new(stream), service);
            let silent = async {
                loop {
                    let left = CONNECTION_TIMEOUT.saturating_sub(lock(&taken).elapsed());
                    if left.is_zero() {
                        break;
                    }
                    sleep(left).await;
                }
            };
            // A client that sends invalid data, or does not read, is not an error.
            tokio::select! { _ = connection => {}, () = silent => {} }
        }));
    }
}

fn answer<R: Fn(&str) -> Reply>(
    request: &Request<Incoming>,
    reply: &Arc<R>,
    taken: &Arc<Mutex<Instant>>,
) -> Response<Content<R>> {
    let plain = |status, body: &str| Reply::new(status, "text/plain", body);
    let path = request.uri().path();
    let Reply { status, kind, body, is_live } = if !request.body().is_end_stream() {
        plain(413, "requests must not have a body\n")
    } else if request.method() == Method::GET || request.method() == Method::HEAD {
        reply(path)
    } else {
        plain(405, "only GET\n")
    };
    let live = is_live.then(|| LiveBody {
        every: interval(EVERY),
        path: path.to_owned(),
        reply: Arc::clone(reply),
        taken: Arc::clone(taken),
    });
    let mut response = Response::new(Content { first: Some(body.into()), live });
    *response.status_mut() = StatusCode::from_u16(status).unwrap_or_default();
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    response.headers_mut().extend(HEADERS.map(|(name, value)| (name, HeaderValue::from_static(value))));
    response
}

/// The content of an answer.
struct Content<R> {
    first: Option<Bytes>,
    live: Option<LiveBody<R>>,
}

/// A body that is rendered again at each interval, after the previous content was written.
struct LiveBody<R> {
    every: Interval,
    path: String,
    reply: Arc<R>,
    taken: Arc<Mutex<Instant>>,
}

impl<R: Fn(&str) -> Reply> Body for Content<R> {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut core::task::Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let content = &mut *self;
        let data = match &mut content.live {
            None => content.first.take(),
            Some(live) => {
                *lock(&live.taken) = Instant::now();
                ready!(live.every.poll_tick(context));
                Some(content.first.take().unwrap_or_else(|| (live.reply)(&live.path).body.into()))
            }
        };
        Poll::Ready(data.map(|data| Ok(Frame::data(data))))
    }

    fn is_end_stream(&self) -> bool {
        self.live.is_none() && self.first.is_none()
    }

    fn size_hint(&self) -> SizeHint {
        match (&self.live, &self.first) {
            (None, first) => SizeHint::with_exact(first.as_ref().map_or(0, |first| first.len() as u64)),
            (Some(_), _) => SizeHint::default(),
        }
    }
}

fn lock(taken: &Mutex<Instant>) -> MutexGuard<'_, Instant> {
    taken.lock().unwrap_or_else(PoisonError::into_inner)
}
