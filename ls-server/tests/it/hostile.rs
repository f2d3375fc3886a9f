//! Messages that are not messages, positions outside, documents that are too long, a client that is gone.

use serde_json::{Value, json};

use crate::protocol::ready;

const METHODS: [&str; 15] = [
    "textDocument/hover",
    "textDocument/completion",
    "textDocument/definition",
    "textDocument/references",
    "textDocument/documentHighlight",
    "textDocument/prepareRename",
    "textDocument/rename",
    "textDocument/codeAction",
    "textDocument/onTypeFormatting",
    "textDocument/formatting",
    "textDocument/documentSymbol",
    "textDocument/foldingRange",
    "textDocument/semanticTokens/full",
    "textDocument/semanticTokens/range",
    "textDocument/inlayHint",
];

/// Parameters that fit every method.
fn params(uri: &str, start: (u64, u64), end: (u64, u64)) -> Value {
    let position = |(line, character)| json!({"line": line, "character": character});
    json!({
        "textDocument": {"uri": uri}, "position": position(start), "range": {"start": position(start), "end": position(end)},
        "newName": "x", "ch": "\n", "options": {"tabSize": 4, "insertSpaces": true},
        "context": {"diagnostics": [], "includeDeclaration": true, "triggerKind": 1},
    })
}

#[test]
fn malformed_messages_are_answered_and_the_next_is_read() {
    let (mut client, server) = ready(None, "utf-16");
    let bodies = [
        "{",
        "",
        "null",
        "[]",
        "{\"jsonrpc\":\"2.0\"}",
        "\u{0}",
        "{\"id\":[],\"method\":\"x\"}",
        "\"\\ud800\"",
    ];
    for body in bodies {
        client.write(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
        let answer = client.read().unwrap();
        assert!(
            answer["id"].is_null() && answer["error"]["code"].as_i64() <= Some(-32600),
            "{body}: {answer}"
        );
    }
    client.write(b"Content-Length: 3\r\n\r\n\xff\xfe\xfd");
    assert_eq!(client.read().unwrap()["error"]["code"], -32700);
    for params in [
        json!(null),
        json!(5),
        json!([]),
        json!({}),
        json!({"textDocument": {"uri": "not a uri"}}),
        json!({"textDocument": {"uri": ""}}),
    ] {
        for method in METHODS {
            assert_eq!(client.request(method, params.clone())["code"], -32602, "{method} {params}");
        }
    }
    client.exit();
    assert!(server.join().unwrap().unwrap());
}

#[test]
fn a_head_that_is_not_one_ends_the_connection() {
    for head in
        ["Content-Length: x\r\n\r\n", "\r\n", "GET / HTTP/1.1\r\n\r\n", "Content-Length: 99999999999\r\n\r\n"]
    {
        let (mut client, server) = ready(None, "utf-16");
        client.write(head.as_bytes());
        assert_eq!(client.read(), None);
        assert!(server.join().unwrap().is_err());
    }
}

#[test]
fn a_client_that_is_gone_ends_the_server() {
    // At any byte of a message.
    let message = format!("Content-Length: {}\r\n\r\n{}", 33, r#"{"jsonrpc":"2.0","method":"exit"}"#);
    for length in 0..message.len() {
        let (mut client, server) = ready(None, "utf-16");
        client.write(&message.as_bytes()[..length]);
        client.leave();
        assert_eq!(client.read(), None);
        assert!(!server.join().unwrap().unwrap());
    }
    // A client that does not read: the server cannot write to it.
    let (mut client, server) = ready(None, "utf-16");
    client.ask("workspace/symbol", json!({"query": ""}));
    drop(client);
    let _ = server.join().unwrap();
}

#[test]
fn positions_outside_are_answered() {
    let texts = [
        "",
        "\u{feff}",
        "/PROG A\n/MN\n   1:  R[1:\u{e9}\u{1f600}]=R[2] ;\n   2:  CALL A ;\n   3:J P[1] 5% FINE ;\n/POS\nP[1]{\n   GP1:\n\tUF : 0, UT : 1,\n\tJ1= 1 deg\n};\n/END\n",
        "/PROG A\r/MN\r   1:  ABORT ;\r/END\r",
        "/PROG A\n/MN\n   1:  R[",
        "/PROG A\n/MN\n   1:  IF (R[1]=1) THEN\n\n\n   :  LBL[1\n/POS\nP[\n/END",
        "/PROG\n/MN\n/POS\nP[99999999999]{\n/END\n",
        "\u{0}\u{0}/PROG \u{0}\n/MN\n:\u{0};\n/END",
    ];
    for encoding in ["utf-16", "utf-8", "utf-32"] {
        let (mut client, server) = ready(None, encoding);
        for (number, text) in texts.iter().enumerate() {
            let uri = format!("file:///w/T{number}.LS");
            client.open(&uri, text);
            let lines = text.lines().count() as u64;
            let mut spots: Vec<(u64, u64)> =
                (0..lines + 2).flat_map(|line| [0, 5, 9, 12, 14, 99].map(|at| (line, at))).collect();
            spots.push((u32::MAX.into(), u32::MAX.into()));
            for spot in spots {
                for method in METHODS {
                    let answer = client.request(method, params(&uri, spot, (0, 0)));
                    let code = answer["code"].as_i64();
                    assert!(code.is_none() || code == Some(-32803), "{method} {spot:?} {text:?}: {answer}");
                }
            }
            // More than 32 bits are not a position.
            let answer = client.request("textDocument/hover", params(&uri, (1 << 40, 0), (0, 0)));
            assert_eq!(answer["code"], -32602);
        }
        client.exit();
        assert!(server.join().unwrap().unwrap());
    }
}

#[test]
fn a_document_that_is_too_long_is_not_analysed_until_it_is_shorter() {
    let (mut client, server) = ready(None, "utf-16");
    let uri = "file:///w/A.LS";
    let line = "   1:  R[1:\u{e9}]=R[2] ;\n";
    let text = format!("/PROG A\n/MN\n{}/END\n", line.repeat(50_000_000 / line.len()));
    client.open(uri, &text);
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!(found["diagnostics"][0]["message"], "the file is longer than 16 MB: it is not checked");
    for method in METHODS {
        client.request(method, params(uri, (5, 5), (9, 9)));
    }
    let edit = json!([{"range": {"start": {"line": 0, "character": 6}, "end": {"line": 9, "character": 0}}, "text": "x"}]);
    client.notify(
        "textDocument/didChange",
        json!({"textDocument": {"uri": uri, "version": 2}, "contentChanges": edit}),
    );
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!(found["diagnostics"].as_array().unwrap().len(), 1);
    let whole = json!([{"text": "/PROG A\n/MN\n/END\n"}]);
    client.notify(
        "textDocument/didChange",
        json!({"textDocument": {"uri": uri, "version": 3}, "contentChanges": whole}),
    );
    let found = client.notification("textDocument/publishDiagnostics");
    assert_eq!((&found["version"], &found["diagnostics"]), (&json!(3), &json!([])));
    client.exit();
    assert!(server.join().unwrap().unwrap());
}
