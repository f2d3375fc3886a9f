//! Measures the server: a folder of 1,000 programs, key presses in a file of 5,000 lines, its memory.
//!
//! `cargo run --release -p cellwire-ls-server --example measure`
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a program for developers"
)]

use core::fmt::Write as _;
use core::time::Duration;
use std::io::BufReader;
use std::process::{Command, Stdio};
use std::time::Instant;

use cellwire_ls_server::{Options, serve};
use client::Client;
use serde_json::{Value, json};

#[allow(dead_code, reason = "the tests call more of it")]
#[path = "../tests/it/client.rs"]
mod client;

fn main() {
    if std::env::args().nth(1).as_deref() == Some("serve") {
        serve(BufReader::new(std::io::stdin()), std::io::stdout(), Options::default())
            .expect("the client reads");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut bytes = 0;
    for number in 0..1000 {
        let text = program(&format!("P{number}"), 300, 20);
        bytes += text.len();
        std::fs::write(folder.path().join(format!("P{number}.LS")), text).expect("written");
    }
    let mut listing =
        String::from("[*NUMREG*]$NUMREG  Storage: SHADOW  Access: RW  : ARRAY[999] OF Numeric Reg\n");
    (1..1000).for_each(|number| {
        writeln!(listing, "  [{number}] = {number}  'register {number}'").expect("a string")
    });
    std::fs::write(folder.path().join("NUMREG.VA"), listing).expect("written");
    println!("1,000 programs of 300 lines, {:.1} MB", bytes as f64 / 1e6);

    let path = std::env::current_exe().expect("a path");
    let mut server = Command::new(path)
        .arg("serve")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("started");
    let mut client = Client::new(server.stdout.take().expect("piped"), server.stdin.take().expect("piped"));
    let begin = Instant::now();
    client.initialize(Some(&cellwire_ls_server::uri(folder.path())), &["utf-8", "utf-16"]);
    let symbols = client.request("workspace/symbol", json!({"query": "P999"}));
    assert_eq!(symbols.as_array().map(Vec::len), Some(1));
    println!("folder open, every program found by name: {} ms", begin.elapsed().as_millis());
    println!("memory: {}", memory(server.id()));

    let uri = format!("{}/LONG.LS", cellwire_ls_server::uri(folder.path()));
    let text = program("LONG", 5000, 300);
    client.open(&uri, &text);
    client.notification("textDocument/publishDiagnostics");
    let document = json!({"uri": uri});
    let screen = json!({"start": {"line": 2480, "character": 0}, "end": {"line": 2540, "character": 0}});
    let at = json!({"line": 2497, "character": 8}); // of a register
    let requests: [(&str, Value); 5] = [
        ("textDocument/completion", json!({"textDocument": document, "position": at})),
        ("textDocument/hover", json!({"textDocument": document, "position": at})),
        ("textDocument/semanticTokens/range", json!({"textDocument": document, "range": screen})),
        ("textDocument/inlayHint", json!({"textDocument": document, "range": screen})),
        ("textDocument/semanticTokens/full", json!({"textDocument": document})),
    ];
    let others = [("alone", Value::Null), ("diagnostics", Value::Null)];
    for (name, params) in others.into_iter().chain(requests) {
        let mut times: Vec<Duration> = Vec::new();
        let busy = busy(server.id());
        for key in 0..100 {
            let begin = Instant::now();
            press(&mut client, &uri, key);
            match name {
                "alone" => drop(client.request("$/none", Value::Null)),
                "diagnostics" => drop(client.notification("textDocument/publishDiagnostics")),
                _ => drop(client.request(name, params.clone())),
            }
            times.push(begin.elapsed());
            if name != "diagnostics" {
                client.notification("textDocument/publishDiagnostics");
            }
        }
        times.sort();
        let busy = (self::busy(server.id()) - busy) / 100.0;
        println!(
            "key press and {name}: median {:.1} ms, worst {:.1} ms; the processor's time with diagnostics {busy:.1} ms",
            ms(times[50]),
            ms(times[99])
        );
    }
    for method in ["textDocument/references", "textDocument/rename", "textDocument/codeAction"] {
        let begin = Instant::now();
        let params = json!({"textDocument": document, "position": at, "range": {"start": at, "end": at}, "newName": "other",
            "context": {"includeDeclaration": true, "diagnostics": []}});
        let answer = client.request(method, params).to_string();
        println!("{method} over the folder: {:.1} ms, {} kB", ms(begin.elapsed()), answer.len() / 1000);
    }
    println!("memory: {}", memory(server.id()));
    let long = program("HUGE", 400_000, 10);
    println!("a document of {:.0} MB beside it:", long.len() as f64 / 1e6);
    client.open("file:///tmp/HUGE.LS", &long);
    client.request("workspace/symbol", json!({"query": "none"}));
    println!("memory: {}", memory(server.id()));
    client.exit();
    server.wait().expect("it ends");
}

/// Writes a letter into a comment in the middle of the file, or deletes it again.
fn press(client: &mut Client<std::process::ChildStdout, std::process::ChildStdin>, uri: &str, key: usize) {
    let position = |character| json!({"line": 2494, "character": character});
    let (end, text) = if key.is_multiple_of(2) { (12, "x") } else { (13, "") };
    let range = json!({"start": position(12), "end": position(end)});
    let document = json!({"uri": uri, "version": key + 2});
    client.notify(
        "textDocument/didChange",
        json!({"textDocument": document, "contentChanges": [{"range": range, "text": text}]}),
    );
}

/// Returns a program in the form of controllers.
fn program(name: &str, lines: usize, positions: usize) -> String {
    let mut text =
        format!("/PROG  {name}\n/ATTR\nCOMMENT\t\t= \"measured\";\nDEFAULT_GROUP\t= 1,*,*,*,*;\n/MN\n");
    for line in 1..=lines {
        let body = match line % 10 {
            0 => "  ! a comment of this program".to_owned(),
            1 => format!("  LBL[{line}:part {line}]"),
            2 => format!("L P[{}] 250mm/sec CNT50 ACC80    ", line % positions + 1),
            3 => format!("  R[{}]=R[{}]+1", line % 900 + 1, line % 700 + 1),
            4 => format!("  IF (DI[{}:gate] AND !F[9]),JMP LBL[{}]", line % 300 + 1, line - 3),
            5 => format!("  DO[{}]=ON", line % 300 + 1),
            6 => format!("  CALL P{}", line % 1000),
            7 => format!("J P[{}] 50% FINE    ", line % positions + 1),
            8 => format!("  WAIT DI[{}]=ON TIMEOUT,LBL[{}]", line % 300 + 1, line - 7),
            _ => format!("  PR[{},1]=PR[{}:home],2", line % 50 + 1, line % 60 + 1).replace(",2", ""),
        };
        writeln!(text, "{line:4}:{body} ;").expect("a string");
    }
    text.push_str("/POS\n");
    for number in 1..=positions {
        writeln!(
            text,
            "P[{number}]{{\n   GP1:\n\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX =   100.000  mm,\tY =   200.000  mm,\tZ =   300.000  mm,\n\
             \tW =   180.000 deg,\tP =     0.000 deg,\tR =     0.000 deg\n}};"
        )
        .expect("a string");
    }
    text + "/END\n"
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Returns the time that the server's thread has run, in ms, on Linux.
fn busy(id: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{id}/schedstat")).unwrap_or_default();
    text.split(' ').next().and_then(|time| time.parse::<f64>().ok()).unwrap_or(0.0) / 1e6
}

/// Returns the memory that the process uses and its maximum, on Linux.
fn memory(id: u32) -> String {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let lines = status.lines().filter(|line| line.starts_with("VmHWM") || line.starts_with("VmRSS"));
    lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>().join(", ")
}
