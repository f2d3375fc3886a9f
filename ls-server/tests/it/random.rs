//! Random edits: the server's text is that of the editor, in each encoding, and every request is answered meanwhile.

use fastrand::Rng;
use serde_json::{Value, json};

use crate::protocol::{Piped, ready};

/// The pieces that random texts are made of.
const PIECES: [&str; 34] = [
    "\n",
    "\n",
    "\r\n",
    "\r",
    " ;\n",
    "   1:  ",
    "   7:",
    "/PROG A",
    "/MN\n",
    "/POS\n",
    "/END\n",
    "R[1:count]=R[2]",
    "LBL[7:\u{e9}]",
    "JMP LBL[7]",
    "IF (DI[1]) THEN",
    "ENDIF",
    "CALL A",
    "J P[1] 5% FINE",
    "P[1]{\n   GP1:\n\tUF : 0, UT : 1,\n\tJ1= 1 deg\n};\n",
    "!",
    "'",
    "[",
    "]",
    ":",
    ";",
    "\u{e9}",
    "\u{1f600}",
    "\u{65e5}\u{672c}",
    "\t",
    "5",
    "R[",
    "a",
    "\u{feff}",
    "\u{0}",
];

/// A text in units of the encoding, as an editor has it.
struct Model {
    units: Vec<u32>,
    encoding: &'static str,
}

impl Model {
    fn encoded(text: &str, encoding: &str) -> Vec<u32> {
        match encoding {
            "utf-8" => text.bytes().map(u32::from).collect(),
            "utf-16" => text.encode_utf16().map(u32::from).collect(),
            _ => text.chars().map(u32::from).collect(),
        }
    }

    fn text(&self) -> String {
        let units = self.units.iter();
        match self.encoding {
            "utf-8" => String::from_utf8(units.map(|unit| u8::try_from(*unit).unwrap()).collect()).unwrap(),
            "utf-16" => {
                String::from_utf16(&units.map(|unit| u16::try_from(*unit).unwrap()).collect::<Vec<_>>())
                    .unwrap()
            }
            _ => units.map(|unit| char::from_u32(*unit).unwrap()).collect(),
        }
    }

    /// Returns the index of a position, as the protocol defines it.
    fn index(&self, line: usize, character: usize) -> usize {
        let unit = |at: usize| self.units.get(at).copied();
        let (lf, cr) = (Some(u32::from(b'\n')), Some(u32::from(b'\r')));
        let mut start = 0;
        for _ in 0..line {
            loop {
                let here = unit(start);
                if here.is_none() {
                    return start;
                }
                start += 1;
                if here == lf || here == cr && unit(start) != lf {
                    break;
                }
            }
        }
        let mut end = start;
        while unit(end).is_some() && unit(end) != lf && unit(end) != cr {
            end += 1;
        }
        let mut at = (start + character).min(end);
        let is_inner = |unit: u32| match self.encoding {
            "utf-8" => unit & 0xC0 == 0x80,
            "utf-16" => (0xDC00..0xE000).contains(&unit),
            _ => false,
        };
        while unit(at).is_some_and(is_inner) {
            at -= 1;
        }
        at
    }

    /// Makes a random change of this text, and returns it as the editor sends it.
    fn change(&mut self, random: &mut Rng) -> Value {
        let text: String = (0..random.usize(..4)).map(|_| *random.choice(&PIECES).unwrap()).collect();
        if self.units.len() > 3000 || random.usize(..200) == 0 {
            self.units = Self::encoded(&text, self.encoding);
            return json!({"text": text});
        }
        let lines = self.units.iter().filter(|unit| **unit == 10 || **unit == 13).count();
        let spot =
            |random: &mut Rng| (random.usize(..lines + 3), random.usize(..random.clone().usize(1..60)));
        let (mut from, mut to) = (spot(random), spot(random));
        // Mostly a key or a word, seldom much of the text.
        if random.usize(..4) > 0 {
            to = (from.0, from.1 + random.usize(..4));
        }
        if from > to {
            (from, to) = (to, from);
        }
        let (start, end) = (self.index(from.0, from.1), self.index(to.0, to.1));
        self.units.splice(start..end.max(start), Self::encoded(&text, self.encoding));
        let position = |(line, character)| json!({"line": line, "character": character});
        json!({"range": {"start": position(from), "end": position(to)}, "text": text})
    }
}

/// Returns the replies that depend on a document's text, except diagnostics, which need no request.
fn seen(client: &mut Piped, uri: &str) -> Vec<Value> {
    let document = json!({"textDocument": {"uri": uri}});
    let all =
        ["textDocument/semanticTokens/full", "textDocument/documentSymbol", "textDocument/foldingRange"];
    all.iter().map(|method| client.request(method, document.clone())).collect()
}

/// Makes changes, in messages of one to three, and compares with a document that is opened with the same text.
fn edit(encoding: &'static str, seed: u64, messages: usize) {
    let mut random = Rng::with_seed(seed);
    let (mut client, server) = ready(None, encoding);
    let start = "/PROG A\n/MN\n   1:  R[1:\u{e9}]=5 ;\n/POS\n/END\n";
    let mut model = Model { units: Model::encoded(start, encoding), encoding };
    client.open("file:///w/A.LS", start);
    for message in 0..messages {
        let changes: Vec<Value> = (0..random.usize(1..4)).map(|_| model.change(&mut random)).collect();
        let document = json!({"uri": "file:///w/A.LS", "version": message + 2});
        client.notify("textDocument/didChange", json!({"textDocument": document, "contentChanges": changes}));
        if message % 20 == 19 {
            client.open("file:///w/B.LS", &model.text());
            assert_eq!(
                seen(&mut client, "file:///w/A.LS"),
                seen(&mut client, "file:///w/B.LS"),
                "seed {seed}: {:?}",
                model.text()
            );
        }
    }
    client.exit();
    assert!(server.join().unwrap().unwrap());
}

#[test]
fn the_text_is_that_of_the_editor() {
    for (encoding, seed) in [("utf-16", 1), ("utf-8", 2), ("utf-32", 3)] {
        edit(encoding, seed, 400);
    }
}

#[test]
#[ignore = "takes five minutes: cargo test --release -p cellwire-ls-server -- --ignored"]
fn the_text_is_that_of_the_editor_for_minutes() {
    let begin = std::time::Instant::now();
    let (mut seed, mut count) = (fastrand::u64(..), 0);
    while begin.elapsed().as_secs() < 300 {
        for encoding in ["utf-16", "utf-8", "utf-32"] {
            edit(encoding, seed, 2000);
            count += 2000;
        }
        seed = seed.wrapping_add(1);
    }
    println!("{count} messages, the last seed {seed}");
}
