//! The loop of the server: messages in sequence, cancelled requests, diagnostics when there is no other work.

use core::fmt;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use fanuc_ls::{CheckContext, Rules};
use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response, ResponseError};
use lsp_types::notification::{
    Cancel, DidChangeTextDocument, DidChangeWatchedFiles, DidChangeWorkspaceFolders, DidCloseTextDocument,
    DidOpenTextDocument, Exit, Initialized, Notification as _, PublishDiagnostics, ShowMessage,
};
use lsp_types::request::{ExecuteCommand, Initialize, RegisterCapability, Request as _, Shutdown};
use lsp_types::{
    CancelParams, ClientCapabilities, DidChangeTextDocumentParams, DidChangeWatchedFilesParams,
    DidChangeWatchedFilesRegistrationOptions, DidChangeWorkspaceFoldersParams, DidCloseTextDocumentParams,
    DidOpenTextDocumentParams, ExecuteCommandParams, FileSystemWatcher, GlobPattern, InitializeParams,
    InitializeResult, MessageType, NumberOrString, PublishDiagnosticsParams, Registration,
    RegistrationParams, ResourceOperationKind, ServerInfo, ShowMessageParams, Uri, WatchKind,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::answer::{Answer, Failure};
use crate::answers::diagnostics;
use crate::folder::{Client, Folder};
use crate::position::Encoding;
use crate::wire::{self, Incoming};
use crate::{requests, uri};

/// Runs a program in a simulation and returns its output; ends early when the flag is set.
pub type Simulate = Arc<dyn Fn(&Path, &AtomicBool) -> Result<String, String> + Send + Sync>;

/// The settings of a server.
#[derive(Clone, Default)]
pub struct Options {
    /// The rules of program names.
    pub rules: Rules,
    /// The macros and instructions that the user has named; programs and files are those of the workspace.
    pub around: CheckContext,
    /// The command `cellwire.ls.run`. None: it is refused.
    pub simulate: Option<Simulate>,
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options")
            .field("rules", &self.rules)
            .field("around", &self.around)
            .finish_non_exhaustive()
    }
}

/// The time without a message after which diagnostics are published: requests that follow a key press come first.
const SETTLE_TIME: Duration = Duration::from_millis(20);
/// Messages that wait for the server.
const MAX_WAITING: usize = 1024;

/// Serves a client until it sends `exit`, or its end of the connection is closed. Returns whether it has sent `shutdown` before.
///
/// # Errors
/// If the input has no more separable messages, or the client does not read.
pub fn serve(input: impl BufRead + Send + 'static, output: impl Write, options: Options) -> io::Result<bool> {
    let (sender, receiver) = sync_channel(64);
    let of_jobs = sender.clone();
    thread::Builder::new().name("input".into()).spawn(move || read_all(input, &sender))?;
    let mut server = Server {
        folder: Folder::new(options.rules, options.around),
        output,
        simulate: options.simulate,
        sender: of_jobs,
        waiting: VecDeque::new(),
        state: State::Waiting,
        roots: Vec::new(),
        watches: false,
        unpublished: BTreeSet::new(),
        jobs: BTreeMap::new(),
    };
    server.run(&receiver)
}

/// An event that the server handles.
enum Event {
    Incoming(Incoming),
    /// The input has ended, or cannot be read.
    Closed(io::Result<()>),
    /// The simulation of a request has ended.
    Simulated(RequestId, Result<String, String>),
}

fn read_all(mut input: impl BufRead, sender: &SyncSender<Event>) {
    loop {
        let (event, is_last) = match wire::read(&mut input) {
            Ok(Some(incoming)) => (Event::Incoming(incoming), false),
            Ok(None) => (Event::Closed(Ok(())), true),
            Err(error) => (Event::Closed(Err(error)), true),
        };
        if sender.send(event).is_err() || is_last {
            return;
        }
    }
}

/// The stage of the connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Before `initialize`.
    Waiting,
    Running,
    /// After `shutdown`.
    Down,
}

struct Server<W> {
    folder: Folder,
    output: W,
    simulate: Option<Simulate>,
    sender: SyncSender<Event>,
    waiting: VecDeque<Event>,
    state: State,
    /// The folders of the workspace, read after `initialized`.
    roots: Vec<PathBuf>,
    /// Whether the client watches files when it is asked to.
    watches: bool,
    /// The documents whose diagnostics are out of date.
    unpublished: BTreeSet<Uri>,
    /// Simulations that run, each with the flag that ends it.
    jobs: BTreeMap<RequestId, Arc<AtomicBool>>,
}

impl<W: Write> Server<W> {
    fn run(&mut self, receiver: &Receiver<Event>) -> io::Result<bool> {
        let ended = self.handle_all(receiver);
        self.jobs.values().for_each(|flag| flag.store(true, Ordering::Relaxed));
        ended
    }

    fn handle_all(&mut self, receiver: &Receiver<Event>) -> io::Result<bool> {
        loop {
            while self.waiting.len() < MAX_WAITING
                && let Ok(event) = receiver.try_recv()
            {
                self.waiting.push_back(event);
            }
            self.cancel_waiting()?;
            let event = match self.waiting.pop_front() {
                Some(event) => event,
                None if !self.unpublished.is_empty() => match receiver.recv_timeout(SETTLE_TIME) {
                    Ok(event) => {
                        self.waiting.push_back(event);
                        continue;
                    }
                    Err(_) => {
                        self.publish_one()?;
                        continue;
                    }
                },
                None => match receiver.recv() {
                    Ok(event) => {
                        self.waiting.push_back(event);
                        continue;
                    }
                    Err(_) => return Ok(false),
                },
            };
            match event {
                Event::Incoming(Incoming::Malformed(code, message)) => {
                    wire::write_malformed(&mut self.output, code, &message)?;
                }
                Event::Incoming(Incoming::Message(Message::Request(request))) => self.request(request)?,
                Event::Incoming(Incoming::Message(Message::Notification(it)))
                    if it.method == Exit::METHOD =>
                {
                    return Ok(self.state == State::Down);
                }
                Event::Incoming(Incoming::Message(Message::Notification(it))) => self.notification(it)?,
                Event::Incoming(Incoming::Message(Message::Response(_))) => {}
                Event::Simulated(id, result) => self.simulated(id, result)?,
                Event::Closed(result) => return result.map(|()| false),
            }
        }
    }

    /// Answers the waiting requests that a waiting message cancels, and ends simulations.
    fn cancel_waiting(&mut self) -> io::Result<()> {
        let cancelled: Vec<RequestId> = { self.waiting.iter() }
            .filter_map(|event| match event {
                Event::Incoming(Incoming::Message(Message::Notification(it)))
                    if it.method == Cancel::METHOD =>
                {
                    let params = serde_json::from_value::<CancelParams>(it.params.clone()).ok()?;
                    Some(match params.id {
                        NumberOrString::Number(id) => id.into(),
                        NumberOrString::String(id) => id.into(),
                    })
                }
                _ => None,
            })
            .collect();
        for id in cancelled {
            if let Some(flag) = self.jobs.get(&id) {
                flag.store(true, Ordering::Relaxed);
            }
            let is_meant = |event: &Event| matches!(event, Event::Incoming(Incoming::Message(Message::Request(request))) if request.id == id);
            if let Some(at) = self.waiting.iter().position(is_meant) {
                self.waiting.remove(at);
                self.respond(id, Err(cancelled_failure()))?;
            }
        }
        self.waiting.retain(|event| {
            !matches!(event, Event::Incoming(Incoming::Message(Message::Notification(it))) if it.method == Cancel::METHOD)
        });
        Ok(())
    }

    fn request(&mut self, request: Request) -> io::Result<()> {
        let Request { id, method, params } = request;
        let answer = match (self.state, method.as_str()) {
            (State::Waiting, Initialize::METHOD) => self.initialize(params),
            (State::Waiting, _) => Err(Failure {
                code: ErrorCode::ServerNotInitialized as i32,
                message: "send initialize first".into(),
            }),
            (State::Down, _) | (_, Initialize::METHOD) => Err(Failure {
                code: ErrorCode::InvalidRequest as i32,
                message: format!("{method} is not expected now"),
            }),
            (State::Running, Shutdown::METHOD) => {
                self.state = State::Down;
                Ok(Value::Null)
            }
            (State::Running, ExecuteCommand::METHOD) => match self.execute(&id, params) {
                Ok(()) => return Ok(()),
                Err(failure) => Err(failure),
            },
            (State::Running, _) => requests::answer(&self.folder, &method, params).unwrap_or_else(|| {
                Err(Failure {
                    code: ErrorCode::MethodNotFound as i32,
                    message: format!("there is no method {method}"),
                })
            }),
        };
        self.respond(id, answer)
    }

    fn initialize(&mut self, params: Value) -> Answer<Value> {
        let params: InitializeParams = serde_json::from_value(params).map_err(Failure::params)?;
        let ClientCapabilities { general, workspace, .. } = &params.capabilities;
        let offered = general.as_ref().and_then(|general| general.position_encodings.as_deref());
        self.folder.encoding = Encoding::choose(offered.unwrap_or(&[]));
        let watched = workspace.as_ref().and_then(|workspace| workspace.did_change_watched_files);
        self.watches = watched.and_then(|watched| watched.dynamic_registration).unwrap_or(false);
        let edits = workspace.as_ref().and_then(|workspace| workspace.workspace_edit.as_ref());
        let operations = edits.and_then(|edits| edits.resource_operations.as_deref()).unwrap_or(&[]);
        self.folder.client = Client {
            versions: edits.and_then(|edits| edits.document_changes).unwrap_or(false),
            renames: operations.contains(&ResourceOperationKind::Rename),
        };
        let folders = params.workspace_folders.unwrap_or_default();
        self.roots = folders.iter().filter_map(|folder| uri::to_path(folder.uri.as_str())).collect();
        #[expect(deprecated, reason = "older clients have nothing else")]
        if let Some(root) = params.root_uri.filter(|_| self.roots.is_empty()) {
            self.roots.extend(uri::to_path(root.as_str()));
        }
        self.state = State::Running;
        let info = ServerInfo { name: "cellwire".into(), version: Some(env!("CARGO_PKG_VERSION").into()) };
        let capabilities = requests::capabilities(self.folder.encoding, self.simulate.is_some());
        serde_json::to_value(InitializeResult { capabilities, server_info: Some(info) })
            .map_err(Failure::refused)
    }

    /// Starts a command; its answer comes when it has ended.
    fn execute(&mut self, id: &RequestId, params: Value) -> Answer<()> {
        let params: ExecuteCommandParams = serde_json::from_value(params).map_err(Failure::params)?;
        if params.command != requests::RUN {
            return Err(Failure::params(format_args!("there is no command {}", params.command)));
        }
        let simulate =
            self.simulate.clone().ok_or_else(|| Failure::refused("there is no simulation here"))?;
        let argument = params.arguments.first().and_then(Value::as_str);
        let path = argument.and_then(uri::to_path);
        let path =
            path.ok_or_else(|| Failure::params("the first argument is the URI of a program's file"))?;
        if !self.jobs.is_empty() {
            return Err(Failure::refused("a program runs already: cancel it first"));
        }
        let flag = Arc::new(AtomicBool::new(false));
        let (sender, id, of_job) = (self.sender.clone(), id.clone(), Arc::clone(&flag));
        self.jobs.insert(id.clone(), flag);
        let job = move || {
            let result = simulate(&path, &of_job);
            // The server has ended if nothing receives it.
            let _ = sender.send(Event::Simulated(id, result));
        };
        thread::Builder::new().name("simulation".into()).spawn(job).map(drop).map_err(Failure::refused)
    }

    fn simulated(&mut self, id: RequestId, result: Result<String, String>) -> io::Result<()> {
        let flag = self.jobs.remove(&id);
        let is_cancelled = flag.is_some_and(|flag| flag.load(Ordering::Relaxed));
        let answer = match result {
            _ if is_cancelled => Err(cancelled_failure()),
            Ok(text) => Ok(Value::String(text)),
            Err(error) => Err(Failure::refused(error)),
        };
        self.respond(id, answer)
    }

    fn notification(&mut self, notification: Notification) -> io::Result<()> {
        let Notification { method, params } = notification;
        if self.state != State::Running {
            return Ok(());
        }
        let error = match method.as_str() {
            Initialized::METHOD => return self.initialized(),
            DidOpenTextDocument::METHOD => read(params).map(|it: DidOpenTextDocumentParams| {
                let it = it.text_document;
                self.folder.open(it.uri, it.version, it.text);
                self.all_changed();
            }),
            DidChangeTextDocument::METHOD => read(params).map(|it: DidChangeTextDocumentParams| {
                let (uri, version) = (it.text_document.uri, it.text_document.version);
                if let Some(document) =
                    self.folder.get_mut(&uri).filter(|document| document.version().is_some())
                {
                    document.change(version, it.content_changes);
                    self.unpublished.insert(document.uri().clone());
                }
            }),
            DidCloseTextDocument::METHOD => match read(params) {
                Ok(DidCloseTextDocumentParams { text_document }) => {
                    self.folder.close(&text_document.uri);
                    self.all_changed();
                    let uri = text_document.uri;
                    let empty = PublishDiagnosticsParams { uri, diagnostics: Vec::new(), version: None };
                    return self.notify::<PublishDiagnostics>(empty);
                }
                Err(error) => Err(error),
            },
            DidChangeWatchedFiles::METHOD => read(params).map(|it: DidChangeWatchedFilesParams| {
                let paths = it.changes.iter().filter_map(|change| uri::to_path(change.uri.as_str()));
                if self.folder.read(paths.collect()) {
                    self.all_changed();
                }
            }),
            DidChangeWorkspaceFolders::METHOD => read(params).map(|it: DidChangeWorkspaceFoldersParams| {
                for folder in it.event.removed {
                    uri::to_path(folder.uri.as_str()).iter().for_each(|path| self.folder.remove_root(path));
                }
                for folder in it.event.added {
                    uri::to_path(folder.uri.as_str()).iter().for_each(|path| self.folder.add_root(path));
                }
                self.all_changed();
            }),
            _ => Ok(()),
        };
        match error {
            Ok(()) => Ok(()),
            Err(error) => self.show(&format!("{method} was not understood: {error}")),
        }
    }

    /// Reads the workspace, and asks the client to report changes of its files.
    fn initialized(&mut self) -> io::Result<()> {
        for root in core::mem::take(&mut self.roots) {
            self.folder.add_root(&root);
        }
        if self.folder.is_cut() {
            self.show("the workspace has more programs than are read: 24 MB, in 200000 files and folders")?;
        }
        if !self.watches {
            return Ok(());
        }
        let glob = "**/*.{ls,LS,Ls,va,VA,Va,dg,DG,Dg}".to_owned();
        let files = FileSystemWatcher { glob_pattern: GlobPattern::String(glob), kind: None };
        // A folder that is created or removed is reported alone, without its contents, and only a pattern for all files
        // matches it.
        let all = GlobPattern::String("**/*".to_owned());
        let folders =
            FileSystemWatcher { glob_pattern: all, kind: Some(WatchKind::Create | WatchKind::Delete) };
        let watchers = vec![files, folders];
        let options = serde_json::to_value(DidChangeWatchedFilesRegistrationOptions { watchers })?;
        let method = DidChangeWatchedFiles::METHOD.to_owned();
        let registrations =
            vec![Registration { id: "files".into(), method, register_options: Some(options) }];
        let params = serde_json::to_value(RegistrationParams { registrations })?;
        let request =
            Request { id: "files".to_owned().into(), method: RegisterCapability::METHOD.into(), params };
        wire::write(&mut self.output, &request.into())
    }

    /// Marks the diagnostics of every open document as unpublished, because they depend on the programs of the folder.
    fn all_changed(&mut self) {
        let open = self.folder.documents().filter(|document| document.version().is_some());
        self.unpublished.extend(open.map(|document| document.uri().clone()));
    }

    /// Publishes the diagnostics of one document.
    fn publish_one(&mut self) -> io::Result<()> {
        let Some(uri) = self.unpublished.pop_first() else { return Ok(()) };
        let Some(document) = self.folder.get(&uri).filter(|document| document.version().is_some()) else {
            return Ok(());
        };
        let params = diagnostics::published(&self.folder, document);
        self.notify::<PublishDiagnostics>(params)
    }

    /// Shows a warning to the user.
    fn show(&mut self, message: &str) -> io::Result<()> {
        self.notify::<ShowMessage>(ShowMessageParams {
            typ: MessageType::WARNING,
            message: message.to_owned(),
        })
    }

    fn notify<N: lsp_types::notification::Notification<Params: Serialize>>(
        &mut self,
        params: N::Params,
    ) -> io::Result<()> {
        let params = serde_json::to_value(params)?;
        wire::write(&mut self.output, &Notification { method: N::METHOD.to_owned(), params }.into())
    }

    fn respond(&mut self, id: RequestId, answer: Answer<Value>) -> io::Result<()> {
        let response_result =
            answer.map_err(|Failure { code, message }| ResponseError { code, message, data: None });
        wire::write(&mut self.output, &Response { id, response_result }.into())
    }
}

fn read<P: DeserializeOwned>(params: Value) -> serde_json::Result<P> {
    serde_json::from_value(params)
}

fn cancelled_failure() -> Failure {
    Failure { code: ErrorCode::RequestCanceled as i32, message: "cancelled".into() }
}
