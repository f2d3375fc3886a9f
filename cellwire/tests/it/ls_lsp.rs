//! `ls lsp`: the program as an editor starts it.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdout, Command, Stdio};

use serde_json::{Value, json};

fn read(output: &mut BufReader<ChildStdout>) -> Option<Value> {
    let mut length = 0;
    loop {
        let mut line = String::new();
        if output.read_line(&mut line).unwrap() == 0 {
            return None;
        }
        match line.trim().split_once(": ") {
            Some((_, value)) => length = value.parse().unwrap(),
            None => break,
        }
    }
    let mut body = vec![0; length];
    output.read_exact(&mut body).unwrap();
    Some(serde_json::from_slice(&body).unwrap())
}

fn framed(message: &Value) -> Vec<u8> {
    let body = message.to_string();
    format!("Content-Length: {}\r\n\r\n{body}", body.len()).into_bytes()
}

/// No request has this id.
const PUBLISHED: i32 = 0;

#[test]
fn an_editor_starts_it_and_has_findings_and_the_simulation() {
    let folder = tempfile::tempdir().unwrap();
    let text = "/PROG A\n/MN\n   1:  R[1]=R[1]+1 ;\n   2:  IF R[1]<3,JMP LBL[1] ;\n/END\n";
    std::fs::write(folder.path().join("A.LS"), text).unwrap();
    std::fs::write(folder.path().join("B.LS"), "/PROG B\n/MN\n   1:  R[1:parts]=5 ;\n/END\n").unwrap();
    let uri = |name: &str| format!("file://{}/{name}", folder.path().display());
    let mut server = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["ls", "lsp"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = server.stdin.take().unwrap();
    let mut output = BufReader::new(server.stdout.take().unwrap());
    let mut send = |message: Value| input.write_all(&framed(&message)).unwrap();
    // Diagnostics come when nothing else is asked: with `PUBLISHED` they are waited for.
    let mut until = |id: i32| {
        let (mut found, mut published) = (Value::Null, Value::Null);
        while if id == PUBLISHED { published.is_null() } else { found.is_null() } {
            let message = read(&mut output).unwrap();
            match message["method"].as_str() {
                Some("textDocument/publishDiagnostics") => {
                    published = message["params"]["diagnostics"].clone()
                }
                _ if message["id"] == id => found = message,
                _ => {}
            }
        }
        (found, published)
    };
    let request = |id: i32, method: &str, params: Value| json!({"jsonrpc": "2.0", "id": id, "method": method, "params": params});
    let root = format!("file://{}", folder.path().display());
    send(request(1, "initialize", json!({"processId": null, "rootUri": root, "capabilities": {}})));
    assert_eq!(until(1).0["result"]["serverInfo"]["name"], "cellwire");
    send(json!({"jsonrpc": "2.0", "method": "initialized", "params": {}}));
    let document = json!({"uri": uri("A.LS"), "languageId": "fanuc-ls", "version": 1, "text": text});
    send(json!({"jsonrpc": "2.0", "method": "textDocument/didOpen", "params": {"textDocument": document}}));
    let at = json!({"textDocument": {"uri": uri("A.LS")}, "position": {"line": 2, "character": 9}});
    send(request(2, "textDocument/hover", at));
    let (answer, mut published) = until(2);
    assert!(answer["result"]["contents"]["value"].as_str().unwrap().contains("Comment: parts"), "{answer}");
    let run = |name: &str| json!({"command": "cellwire.ls.run", "arguments": [uri(name)]});
    send(request(3, "workspace/executeCommand", run("B.LS")));
    let (answer, later) = until(3);
    if published.is_null() {
        published = later;
    }
    if published.is_null() {
        published = until(PUBLISHED).1;
    }
    assert_eq!(published[0]["code"], "undefined-label");
    let text = answer["result"].as_str().unwrap();
    assert!(text.starts_with("{\"event\":\"program_ended\"") && text.ends_with(" s, 0.0 mm\n"), "{text}");
    send(request(4, "workspace/executeCommand", run("C.LS")));
    let (answer, _) = until(4);
    assert!(answer["error"]["message"].as_str().unwrap().contains("C.LS"), "{answer}");
    send(request(5, "shutdown", Value::Null));
    assert_eq!(until(5).0["result"], Value::Null);
    send(json!({"jsonrpc": "2.0", "method": "exit", "params": null}));
    assert!(server.wait().unwrap().success());
}

#[test]
fn an_editor_that_is_gone_ends_it() {
    let mut server = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["ls", "lsp", "--name-limit", "8"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = server.stdin.take().unwrap();
    input.write_all(b"Content-Length: 99\r\n\r\n{\"jsonrpc\"").unwrap();
    drop(input);
    assert_eq!(server.wait().unwrap().code(), Some(1));
}
