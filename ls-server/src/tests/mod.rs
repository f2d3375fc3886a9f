//! The answers of the server to requests about texts; `|` in a text is the cursor.

mod changes;
mod looks;
mod typing;

use core::str::FromStr;
use std::path::Path;

use lsp_types::{Position, Uri};
use serde_json::{Value, json};

use crate::folder::Folder;
use crate::requests;

/// The documents of a workspace, one of which has the cursor.
pub(crate) struct Cell {
    pub(crate) folder: Folder,
    uri: Uri,
    cursor: Position,
}

impl Cell {
    /// Opens the files in the folder `/w` of a workspace; the first with a `|` has the cursor.
    pub(crate) fn new(files: &[(&str, &str)]) -> Self {
        let mut folder = Folder::default();
        folder.add_root(Path::new("/w"));
        let mut found = None;
        for (version, (name, text)) in (1..).zip(files) {
            let uri = uri(name);
            let at = text.find('|').filter(|_| found.is_none());
            folder.open(
                uri.clone(),
                version,
                if at.is_some() { text.replacen('|', "", 1) } else { (*text).to_owned() },
            );
            if let Some(at) = at {
                found = Some((uri.clone(), folder.get(&uri).unwrap().converter().position(at)));
            }
        }
        let (uri, cursor) = found.unwrap_or_else(|| (uri(files[0].0), Position::default()));
        Self { folder, uri, cursor }
    }

    /// Creates a program with these statements, without their numbers.
    pub(crate) fn of(statements: &str) -> Self {
        Self::new(&[("A.LS", &program("A", statements))])
    }

    /// Sends a request about the cursor, with the additional parameters `others`; returns the answer.
    pub(crate) fn ask(&self, method: &str, others: Value) -> Value {
        self.try_ask(method, others).unwrap_or_else(|failure| panic!("{failure:?}"))
    }

    /// Sends a request about the cursor; returns the answer, or the text of its error.
    pub(crate) fn try_ask(&self, method: &str, others: Value) -> Result<Value, String> {
        let range = json!({"start": self.cursor, "end": self.cursor});
        let mut params = json!({"textDocument": {"uri": self.uri}, "position": self.cursor, "range": range});
        params.as_object_mut().unwrap().extend(others.as_object().unwrap().clone());
        requests::answer(&self.folder, method, params).unwrap().map_err(|failure| failure.message)
    }

    /// Returns the text of a file with the edits of an answer.
    pub(crate) fn edited(&self, name: &str, edits: &Value) -> String {
        let document = self.folder.get(&uri(name)).unwrap();
        let mut edits: Vec<lsp_types::TextEdit> = serde_json::from_value(edits.clone()).unwrap();
        edits.sort_by_key(|edit| edit.range.start);
        let (mut text, mut copied) = (String::new(), 0);
        for edit in edits {
            let place = document.converter().bytes(edit.range);
            text.push_str(&document.text()[copied..place.start]);
            text.push_str(&edit.new_text);
            copied = place.end;
        }
        text + &document.text()[copied..]
    }

    /// Returns the text of a file with the changes of a workspace's edit.
    pub(crate) fn changed(&self, name: &str, edit: &Value) -> String {
        self.edited(name, edit["changes"].get(uri(name).as_str()).unwrap_or(&json!([])))
    }
}

fn uri(name: &str) -> Uri {
    Uri::from_str(&format!("file:///w/{name}")).unwrap()
}

/// Returns a program whose lines are these statements.
pub(crate) fn program(name: &str, statements: &str) -> String {
    let lines = (1..).zip(statements.lines()).map(|(number, line)| format!("{number:4}:{line} ;\n"));
    format!("/PROG {name}\n/MN\n{}/POS\n{POSITION}/END\n", lines.collect::<String>())
}

const POSITION: &str = "P[1:\"home\"]{\n   GP1:\n\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX =   100.000  mm,\tY =   -20.500  mm,\tZ =      .500  mm,\n\
                        \tW =   180.000 deg,\tP =     0.000 deg,\tR =  ******** deg\n};\n";

/// Returns the places of an answer: file, line from 1, and columns.
pub(crate) fn places(answer: &Value) -> Vec<String> {
    let place = |location: &Value| {
        let (range, uri) = (&location["range"], location["uri"].as_str().unwrap_or("/"));
        let file = uri.rsplit('/').next().unwrap_or("");
        let line = range["start"]["line"].as_u64().unwrap() + 1;
        format!("{file}:{line}:{}-{}", range["start"]["character"], range["end"]["character"])
    };
    answer.as_array().map_or_else(Vec::new, |all| all.iter().map(place).collect())
}
