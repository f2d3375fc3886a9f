//! The order of messages: before and after `initialize`, cancelled requests, files that change, the simulation.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io::{BufReader, PipeReader, PipeWriter, pipe};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use cellwire_ls_server::{Options, serve};
use serde_json::{Value, json};

use crate::client::Client;

pub(crate) type Piped = Client<PipeReader, PipeWriter>;

/// Starts a server in a thread, and a client of it.
pub(crate) fn start(options: Options) -> (Piped, JoinHandle<std::io::Result<bool>>) {
    let (input, of_client) = pipe().unwrap();
    let (of_server, output) = pipe().unwrap();
    let server = thread::spawn(move || serve(BufReader::new(input), output, options));
    (Client::new(of_server, of_client), server)
}

/// Starts a server that was initialized.
pub(crate) fn ready(root: Option<&str>, encoding: &str) -> (Piped, JoinHandle<std::io::Result<bool>>) {
    let (mut client, server) = start(Options::default());
    let answer = client.initialize(root, &[encoding]);
    assert_eq!(answer["capabilities"]["positionEncoding"], encoding);
    (client, server)
}

const PROGRAM: &str = "/PROG A\n/MN\n   1:  LBL[1] ;\n   2:  JMP LBL[2] ;\n/END\n";

fn place(uri: &str, line: u32, character: u32) -> Value {
    json!({"textDocument": {"uri": uri}, "position": {"line": line, "character": character}})
}

#[test]
fn a_session_has_its_order() {
    let (mut client, server) = start(Options::default());
    let code = |answer: &Value| answer["code"].as_i64();
    assert_eq!(code(&client.request("textDocument/hover", place("file:///A.LS", 0, 0))), Some(-32002));
    client.notify("textDocument/didOpen", json!({"textDocument": 5}));
    let answer = client.initialize(None, &[]);
    assert_eq!(answer["capabilities"]["positionEncoding"], "utf-16");
    assert_eq!(code(&client.request("initialize", json!({"capabilities": {}}))), Some(-32600));
    assert_eq!(code(&client.request("no/such", json!({}))), Some(-32601));
    assert_eq!(code(&client.request("textDocument/hover", json!({"position": 5}))), Some(-32602));
    let unknown = client.request("textDocument/hover", place("file:///no.LS", 0, 0));
    assert_eq!(unknown, json!({"code": -32602, "message": "file:///no.LS is not open"}));
    client.notify("$/other", json!({}));
    client.notify(
        "textDocument/didChange",
        json!({"textDocument": {"uri": "file:///no.LS", "version": 2}, "contentChanges": []}),
    );
    client.notify("textDocument/didOpen", json!({"textDocument": 5}));
    let shown = client.notification("window/showMessage");
    assert!(
        shown["message"].as_str().unwrap().starts_with("textDocument/didOpen was not understood: "),
        "{shown}"
    );
    assert_eq!(client.request("shutdown", Value::Null), Value::Null);
    assert_eq!(code(&client.request("textDocument/hover", place("file:///A.LS", 0, 0))), Some(-32600));
    client.notify("exit", Value::Null);
    assert!(server.join().unwrap().unwrap());
}

#[test]
fn findings_follow_the_text() {
    let (mut client, server) = ready(None, "utf-16");
    client.open("file:///A.LS", PROGRAM);
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!((&found["version"], &found["diagnostics"][0]["code"]), (&json!(1), &json!("undefined-label")));
    let range = json!({"start": {"line": 3, "character": 15}, "end": {"line": 3, "character": 16}});
    let change = json!({"textDocument": {"uri": "file:///A.LS", "version": 2}, "contentChanges": [{"range": range, "text": "1"}]});
    client.notify("textDocument/didChange", change);
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!(found, json!({"uri": "file:///A.LS", "version": 2, "diagnostics": []}));
    client.notify("textDocument/didClose", json!({"textDocument": {"uri": "file:///A.LS"}}));
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!(found, json!({"uri": "file:///A.LS", "diagnostics": []}));
    client.exit();
    assert!(server.join().unwrap().unwrap());
}

#[test]
fn a_workspace_has_programs_and_listings() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).unwrap();
    std::fs::create_dir(folder.path().join("other robot")).unwrap();
    write("A.LS", b"/PROG A\n/MN\n1:  R[1]=5 ;\n2:  CALL B ;\n/END\n");
    write("b.ls", b"/PROG B\n/ATTR\nCOMMENT = \"caf\xe9\";\n/MN\n1:  R[1:part]=6 ;\n/END\n");
    write("other robot/A.LS", b"/PROG A\n/MN\n1:  R[1]=5 ;\n/END\n");
    write("other robot/NUMREG.VA", b"[*NUMREG*]$NUMREG\r\n  [1] = 7  'count' \r\n");
    let root = cellwire_ls_server::uri(folder.path());
    let (mut client, server) = ready(Some(&root), "utf-8");
    let uri = format!("{root}/A.LS");
    client.open(&uri, &std::fs::read_to_string(folder.path().join("A.LS")).unwrap());
    let hover = client.request("textDocument/hover", place(&uri, 2, 6));
    let text = hover["contents"]["value"].as_str().unwrap();
    assert!(
        text.contains("Comment: part\n") && text.contains("In other programs: 1, used 1 times"),
        "{text}"
    );
    let other = format!("{root}/other%20robot/A.LS");
    let hover = client.request("textDocument/hover", place(&other, 2, 6));
    assert!(
        hover["contents"]["value"].as_str().unwrap().contains("Comment: count\n\nValue in NUMREG.VA: 7\n"),
        "{hover}"
    );
    let symbols = client.request("workspace/symbol", json!({"query": "caf\u{e9}"}));
    assert_eq!(symbols[0]["name"], "B");
    assert_eq!(client.notification("textDocument/publishDiagnostics")["diagnostics"], json!([]));
    // The file of the program that is called goes; its call is a finding.
    std::fs::remove_file(folder.path().join("b.ls")).unwrap();
    client.notify(
        "workspace/didChangeWatchedFiles",
        json!({"changes": [{"uri": format!("{root}/b.ls"), "type": 3}]}),
    );
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!(found["diagnostics"][0]["code"], "missing-program");
    // A closed document has the contents of its file.
    client.notify("textDocument/didClose", json!({"textDocument": {"uri": uri}}));
    let symbols = client.request("textDocument/documentSymbol", json!({"textDocument": {"uri": uri}}));
    assert_eq!(symbols[0]["name"], "A");
    let event = json!({"removed": [{"uri": root, "name": "w"}], "added": []});
    client.notify("workspace/didChangeWorkspaceFolders", json!({"event": event}));
    assert_eq!(client.request("workspace/symbol", json!({"query": ""})), json!([]));
    client.exit();
    assert!(server.join().unwrap().unwrap());
}

/// An editor reports a folder that comes or goes alone, without the files below it.
#[test]
fn a_folder_comes_and_goes() {
    let folder = tempfile::tempdir().unwrap();
    let make = |name: &str| {
        std::fs::create_dir_all(folder.path().join(name).join("deep")).unwrap();
        let text = "/PROG B\n/MN\n1:  R[1]=6 ;\n/END\n";
        std::fs::write(folder.path().join(name).join("deep/B.LS"), text).unwrap();
        std::fs::write(folder.path().join(name).join("NUMREG.VA"), b"[*NUMREG*]$NUMREG\n [1] = 7  'count'\n")
            .unwrap();
    };
    let root = cellwire_ls_server::uri(folder.path());
    let (mut client, server) = start(Options::default());
    let watched = json!({"workspace": {"didChangeWatchedFiles": {"dynamicRegistration": true}}});
    client.request("initialize", json!({"rootUri": root, "capabilities": watched}));
    client.notify("initialized", json!({}));
    let asked = client.notification("client/registerCapability");
    let watchers = asked["registrations"][0]["registerOptions"]["watchers"].clone();
    assert_eq!(watchers[1], json!({"globPattern": "**/*", "kind": 5}));
    let uri = format!("{root}/A.LS");
    client.open(&uri, "/PROG A\n/MN\n1:  CALL B ;\n/END\n");
    let findings = |client: &mut Piped| {
        let found = client.notification("textDocument/publishDiagnostics");
        found["diagnostics"].as_array().unwrap().iter().map(|it| it["code"].clone()).collect::<Vec<_>>()
    };
    let known = |client: &mut Piped| {
        let symbols = client.request("workspace/symbol", json!({"query": "B"}));
        symbols.as_array().unwrap().iter().map(|it| it["location"]["uri"].clone()).collect::<Vec<_>>()
    };
    let tell = |client: &mut Piped, changes: &[(&str, u8)]| {
        let change = |(name, kind): &(&str, u8)| json!({"uri": format!("{root}/{name}"), "type": kind});
        let changes: Vec<Value> = changes.iter().map(change).collect();
        client.notify("workspace/didChangeWatchedFiles", json!({"changes": changes}));
    };
    assert_eq!(findings(&mut client), ["missing-program"]);
    make("sub");
    tell(&mut client, &[("sub/deep", 1), ("sub", 1), ("sub/deep/B.LS", 1)]);
    // The folder has a listing, so it is another controller.
    assert_eq!(findings(&mut client), ["missing-program"]);
    assert_eq!(known(&mut client), [format!("{root}/sub/deep/B.LS")]);
    std::fs::remove_file(folder.path().join("sub/NUMREG.VA")).unwrap();
    tell(&mut client, &[("sub/NUMREG.VA", 3)]);
    assert!(findings(&mut client).is_empty());
    std::fs::rename(folder.path().join("sub"), folder.path().join("sub two")).unwrap();
    tell(&mut client, &[("sub", 3), ("sub%20two", 1)]);
    assert!(findings(&mut client).is_empty());
    assert_eq!(known(&mut client), [format!("{root}/sub%20two/deep/B.LS")]);
    // A file that is not a program has no effect, nor does a folder elsewhere with the same beginning.
    tell(&mut client, &[("notes.txt", 1), ("sub", 3), ("sub%20tw", 3)]);
    assert_eq!(known(&mut client).len(), 1);
    std::fs::remove_dir_all(folder.path().join("sub two")).unwrap();
    tell(&mut client, &[("sub%20two", 3)]);
    assert_eq!(findings(&mut client), ["missing-program"]);
    assert!(known(&mut client).is_empty());
    // A link to a folder is not followed, as when the workspace is read.
    #[cfg(unix)]
    {
        let outside = tempfile::tempdir().unwrap();
        std::fs::write(outside.path().join("B.LS"), "/PROG B\n/MN\n/END\n").unwrap();
        std::os::unix::fs::symlink(outside.path(), folder.path().join("link")).unwrap();
        tell(&mut client, &[("link", 1)]);
        assert!(known(&mut client).is_empty());
    }
    client.exit();
    assert!(server.join().unwrap().unwrap());
}

#[test]
fn a_request_is_cancelled_while_it_waits_and_while_it_runs() {
    let simulate = |path: &std::path::Path, stop: &AtomicBool| {
        if path.ends_with("B.LS") {
            return Err("no such program".to_owned());
        }
        while !stop.load(Ordering::Relaxed) && path.ends_with("LONG.LS") {
            thread::sleep(Duration::from_millis(1));
        }
        Ok(format!("{} has ended", path.display()))
    };
    let (mut client, server) = start(Options { simulate: Some(Arc::new(simulate)), ..Options::default() });
    client.initialize(None, &[]);
    let run = |name: &str| json!({"command": "cellwire.ls.run", "arguments": [format!("file:///w/{name}")]});
    assert_eq!(client.request("workspace/executeCommand", run("A.LS")), "/w/A.LS has ended");
    let failed = client.request("workspace/executeCommand", run("B.LS"));
    assert_eq!(failed, json!({"code": -32803, "message": "no such program"}));
    let long = client.ask("workspace/executeCommand", run("LONG.LS"));
    // Other requests are answered meanwhile, and a second simulation is refused.
    assert_eq!(client.request("workspace/symbol", json!({"query": ""})), json!([]));
    let busy = client.request("workspace/executeCommand", run("A.LS"));
    assert_eq!(busy["message"], "a program runs already: cancel it first");
    client.notify("$/cancelRequest", json!({"id": long}));
    assert_eq!(client.answer(long)["error"]["code"], -32800);
    for bad in [
        json!({"command": "no"}),
        json!({"command": "cellwire.ls.run"}),
        json!({"command": "cellwire.ls.run", "arguments": [5]}),
    ] {
        assert_eq!(client.request("workspace/executeCommand", bad)["code"], -32602);
    }
    // Requests and the cancellations of every other one arrive in one piece: each is answered once.
    let mut bytes = Vec::new();
    for id in 1000..1100 {
        let request =
            json!({"jsonrpc": "2.0", "id": id, "method": "workspace/symbol", "params": {"query": ""}})
                .to_string();
        bytes.extend(format!("Content-Length: {}\r\n\r\n{request}", request.len()).bytes());
    }
    for id in (1000..1100).step_by(2) {
        let cancel = json!({"jsonrpc": "2.0", "method": "$/cancelRequest", "params": {"id": id}}).to_string();
        bytes.extend(format!("Content-Length: {}\r\n\r\n{cancel}", cancel.len()).bytes());
    }
    client.write(&bytes);
    for id in 1000..1100 {
        let answer = client.answer(id);
        let code = answer["error"]["code"].as_i64();
        assert!(code.is_none() || code == Some(-32800) && id % 2 == 0, "{answer}");
    }
    client.exit();
    assert!(server.join().unwrap().unwrap());
}
