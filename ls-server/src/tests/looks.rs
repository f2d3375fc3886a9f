//! Requests without edits.

use lsp_types::{DiagnosticSeverity, NumberOrString};
use serde_json::{Value, json};

use super::{Cell, places, program};
use crate::answers::diagnostics::published;

fn hover(cell: &Cell) -> String {
    cell.ask("textDocument/hover", json!({}))["contents"]["value"]
        .as_str()
        .unwrap_or("")
        .replace("\n\n", "\n")
}

fn labels(answer: &Value) -> Vec<&str> {
    answer.as_array().unwrap().iter().map(|item| item["label"].as_str().unwrap()).collect()
}

#[test]
fn hover_says_what_a_person_would_look_up() {
    let text = hover(&Cell::of("  R[1:count]=R[|1]+1\nJ P[1] 5% FINE"));
    assert_eq!(text, "**R[1]**: numeric register, 1 to 32767\nComment: count\nUses in lines: 3\n");
    let text = hover(&Cell::of("J P[|1] 5% FINE\nJ P[1] 5% FINE"));
    assert_eq!(
        text,
        "**P[1]**: position, 1 to 32767\nComment: home\nGroup 1, user frame 0, tool 1\n\
         X 100.000 mm, Y -20.500 mm, Z 0.500 mm, W 180.000 °, P 0.000 °, R not taught\n\
         wrist not flipped, elbow up, arm in front; turns 0, 0, 0\nUses in lines: 3, 4\n"
    );
    let text = hover(&Cell::of("  LBL[|7:again]\n  JMP LBL[7]"));
    assert_eq!(text, "**LBL[7]**: label, 1 to 32767\nComment: again\nDefined in line 3\nJumps in lines: 4\n");
    assert_eq!(hover(&Cell::of("  UA|LM[1]")), "`UALM[n]`, n from 1 to 9999");
    assert_eq!(hover(&Cell::of("L P[1] 5mm/sec FINE A|CC50")), "`ACCn`, n from 0 to 500, or a register");
    assert_eq!(
        hover(&Cell::of("  SOFTFLOAT E|ND")),
        "`SOFTFLOAT END …`, as the manual of its option describes"
    );
    assert!(
        hover(&Cell::of("|L P[1] 5mm/sec FINE"))
            .starts_with("`L P[n] speed FINE|CNTn options`: a straight line")
    );
    assert_eq!(hover(&Cell::of("  ! UA|LM")), "");
    let cell = Cell::new(&[("A.LS", &program("A", "  CALL B|")), ("B.LS", &program("B", "  ABORT"))]);
    assert_eq!(hover(&cell), "**B**: program, lines: 1, positions: 1\n");
    assert_eq!(hover(&Cell::of("  CALL C|")), "**C**: no program has this name here\n");
}

#[test]
fn a_name_of_a_file_is_not_markup() {
    assert!(hover(&Cell::of("  R[1:<b>_*x]=R[|1]")).contains("Comment: \\<b\\>\\_\\*x\n"));
}

#[test]
fn completion_has_the_names_of_the_folder() {
    let other = program("B", "  R[3:speed]=1");
    let ask = |statement: &str| {
        let cell = Cell::new(&[("A.LS", &program("A", statement)), ("B.LS", &other)]);
        let answer = cell.ask("textDocument/completion", json!({}));
        labels(&answer).join(" ")
    };
    assert_eq!(ask("  LBL[7:x]\n  JMP LBL[|"), "LBL[7]");
    assert_eq!(ask("  R[1:n]=1\n  R[2]=R[|]"), "R[1:n] R[2] R[3:speed]");
    assert_eq!(ask("J P[|"), "P[1]");
    assert_eq!(ask("  CALL |"), "A B");
    assert_eq!(ask("  UF|"), "UFRAME_NUM UFRAME[");
    assert_eq!(ask("L P[1] 5mm/sec FINE AC|"), "ACC ACCUTRIG".split(' ').next().unwrap());
    assert_eq!(ask("  ! R[|"), "R[3:speed]");
    // A text that is not finished, and one that is not a program.
    let cell = Cell::new(&[("A.LS", "/PROG A\n/MN\n1: UALM|")]);
    assert_eq!(labels(&cell.ask("textDocument/completion", json!({}))), ["UALM"]);
    assert_eq!(Cell::new(&[("A.LS", "UAL|")]).ask("textDocument/completion", json!({})), Value::Null);
}

#[test]
fn places_of_an_item_are_those_of_its_controller() {
    let files = [
        (
            "A.LS",
            program("A", "  R[1]=R[2]\n  IF R[1]>|5,R[2]=1\n  LBL[1]\n  !R[1]").replace("R[1]>|", "R[|1]>"),
        ),
        ("B.LS", program("B", "  R[1]=5\n  JMP LBL[1]\n  CALL A")),
    ];
    let cell = Cell::new(&[(files[0].0, &files[0].1), (files[1].0, &files[1].1)]);
    let everywhere = json!({"context": {"includeDeclaration": true}});
    assert_eq!(
        places(&cell.ask("textDocument/references", everywhere.clone())),
        ["A.LS:3:7-10", "A.LS:4:10-13", "B.LS:3:7-10"]
    );
    assert_eq!(places(&cell.ask("textDocument/definition", json!({}))), ["A.LS:3:7-10", "B.LS:3:7-10"]);
    let highlights = cell.ask("textDocument/documentHighlight", json!({}));
    assert_eq!(places(&highlights), [":3:7-10", ":4:10-13"]);
    assert_eq!([&highlights[0]["kind"], &highlights[1]["kind"]], [3, 2]);
    // A label is one program's.
    let label = Cell::new(&[("A.LS", &program("A", "  LBL[1]\n  JMP LBL[|1]")), ("B.LS", &files[1].1)]);
    assert_eq!(
        places(&label.ask("textDocument/references", everywhere.clone())),
        ["A.LS:3:7-12", "A.LS:4:11-16"]
    );
    assert_eq!(places(&label.ask("textDocument/definition", json!({}))), ["A.LS:3:7-12"]);
    let used = json!({"context": {"includeDeclaration": false}});
    assert_eq!(places(&label.ask("textDocument/references", used)), ["A.LS:4:11-16"]);
    let position = Cell::of("J P[|1] 5% FINE");
    assert_eq!(places(&position.ask("textDocument/definition", json!({}))), ["A.LS:5:0-3"]);
    let call = Cell::new(&[("B.LS", &files[1].1.replace("CALL A", "CALL |A")), ("A.LS", &program("A", ""))]);
    assert_eq!(places(&call.ask("textDocument/definition", json!({}))), ["A.LS:1:6-7"]);
    assert_eq!(places(&call.ask("textDocument/references", everywhere)), ["A.LS:1:6-7", "B.LS:5:12-13"]);
    assert_eq!(Cell::of("  ABO|RT").ask("textDocument/definition", json!({})), Value::Null);
}

#[test]
fn the_call_hierarchy_goes_both_ways() {
    let cell = Cell::new(&[
        ("A.LS", &program("A", "  CALL |B\n  RUN B\n  CALL NONE")),
        ("B.LS", &program("B", "  CALL C")),
        ("C.LS", &program("C", "  ABORT")),
    ]);
    let item = cell.ask("textDocument/prepareCallHierarchy", json!({}))[0].clone();
    assert_eq!(item["name"], "B");
    let calls = cell.ask("callHierarchy/incomingCalls", json!({"item": item}));
    assert_eq!((calls.as_array().unwrap().len(), &calls[0]["from"]["name"]), (1, &json!("A")));
    assert_eq!(calls[0]["fromRanges"].as_array().unwrap().len(), 2);
    let calls = cell.ask("callHierarchy/outgoingCalls", json!({"item": item}));
    assert_eq!((calls.as_array().unwrap().len(), &calls[0]["to"]["name"]), (1, &json!("C")));
}

#[test]
fn symbols_are_programs_labels_and_positions() {
    let cell = Cell::of("  LBL[7:again]");
    let answer = cell.ask("textDocument/documentSymbol", json!({}));
    let names: Vec<String> = { answer[0]["children"].as_array().unwrap().iter() }
        .map(|child| {
            format!("{} {}", child["name"].as_str().unwrap(), child["detail"].as_str().unwrap_or(""))
        })
        .collect();
    assert_eq!(
        (answer[0]["name"].as_str(), names),
        (Some("A"), vec!["LBL[7] again".to_owned(), "P[1] home".to_owned()])
    );
    let of = |query: &str| cell.ask("workspace/symbol", json!({"query": query})).as_array().unwrap().len();
    assert_eq!([of(""), of("a"), of("b")], [1, 1, 0]);
}

#[test]
fn blocks_sections_and_comments_fold() {
    let cell = Cell::of(
        "  !a\n  !b\n  IF (R[1]=1) THEN\n  FOR R[1]=1 TO 5\n  ABORT\n  ENDFOR\n  ELSE\n  ABORT\n  ENDIF\n  SELECT R[1]=1,ABORT\n         =2,ABORT\n         ELSE,ABORT\n  END",
    );
    let answer = cell.ask("textDocument/foldingRange", json!({}));
    let folds: Vec<String> = { answer.as_array().unwrap().iter() }
        .map(|fold| format!("{}-{}", fold["startLine"], fold["endLine"]))
        .collect();
    assert_eq!(folds, ["1-14", "2-3", "4-7", "5-6", "8-9", "11-13", "15-21"]);
}

#[test]
fn words_have_kinds() {
    let cell = Cell::of(
        "  R[1:n]=5\nL P[1] 5mm/sec CNT100\n  ! R[1]\n  CALL B('x')\n  MESSAGE[CALL C]\n  $A.$B=DI[R[2]]",
    );
    let answer = cell.ask("textDocument/semanticTokens/full", json!({}));
    let (mut line, mut column, mut shown) = (0usize, 0usize, Vec::new());
    let text = cell.folder.documents().next().unwrap().text().to_owned();
    for token in answer["data"].as_array().unwrap().chunks(5) {
        let number = |at: usize| usize::try_from(token[at].as_u64().unwrap()).unwrap();
        column = if number(0) == 0 { column + number(1) } else { number(1) };
        line += number(0);
        let word = &text.lines().nth(line).unwrap()[column..column + number(2)];
        shown.push(format!("{word}:{}", number(3)));
    }
    assert_eq!(
        shown.join(" "),
        "/PROG:0 A:1 /MN:0 R:2 1:8 n:7 5:8 L:0 P:4 1:8 5:8 CNT:0 100:8 ! R[1]:6 CALL:0 B:1 'x':7 MESSAGE:0 CALL C:7 $A.$B:2 DI:3 R:2 2:8 \
         /POS:0 P:4 1:8 home:7 UF:4 0:8 UT:4 1:8 /END:0"
    );
    let range = json!({"range": {"start": {"line": 3, "character": 0}, "end": {"line": 4, "character": 0}}});
    let part = cell.ask("textDocument/semanticTokens/range", range);
    assert_eq!(part["data"].as_array().unwrap().len(), 6 * 5);
}

#[test]
fn hints_have_the_names_that_are_left_out() {
    let other = program("B", "  R[3:speed]=1");
    let cell = Cell::new(&[
        ("A.LS", &program("A", "  R[3]=R[3:speed]\n  LBL[1:x]\n  JMP LBL[1]\nJ P[1] 5% FINE")),
        ("B.LS", &other),
    ]);
    let range = json!({"range": {"start": {"line": 0, "character": 0}, "end": {"line": 99, "character": 0}}});
    let answer = cell.ask("textDocument/inlayHint", range);
    let shown: Vec<String> = { answer.as_array().unwrap().iter() }
        .map(|hint| {
            format!(
                "{}:{}{}",
                hint["position"]["line"],
                hint["position"]["character"],
                hint["label"].as_str().unwrap()
            )
        })
        .collect();
    assert_eq!(shown, ["2:10:speed", "4:16:x", "5:10:home"]);
}

#[test]
fn findings_have_codes_places_and_the_other_label() {
    let cell = Cell::of("  LBL[1]\n  LBL[1]\n  FRO R[1]=1 TO 2\n  CALL X\nJ P[1] 5mm/sec FINE");
    let document = cell.folder.documents().next().unwrap();
    let found = serde_json::to_value(published(&cell.folder, document).diagnostics).unwrap();
    let shown: Vec<String> = { found.as_array().unwrap().iter() }
        .zip(places(&found))
        .map(|(finding, place)| {
            format!("{} {} {}", finding["severity"], finding["code"].as_str().unwrap(), &place[1..])
        })
        .collect();
    assert_eq!(
        shown,
        [
            "1 repeated-label 4:7-13",
            "1 misspelled 5:7-22",
            "4 missing-program 6:7-13",
            "1 speed-unit 7:5-24",
            "2 untaught-position 9:0-12"
        ]
    );
    let related = &found[0]["relatedInformation"][0];
    assert_eq!(
        (&related["message"], places(&json!([related["location"]]))),
        (&json!("the other label"), vec!["A.LS:3:7-12".to_owned()])
    );
    assert_eq!(
        found[1]["message"],
        "unknown instruction or option: did you mean `FOR`?\ncorrect it: a controller would not take it"
    );
    // A log of the controller is not a program.
    let log = Cell::new(&[("ERRALL.LS", "ERRALL.LS   Robot Name\n 1\" SRVO-001\n")]);
    assert_eq!(published(&log.folder, log.folder.documents().next().unwrap()).diagnostics, []);
}

#[test]
fn a_lost_letter_is_a_warning() {
    let lost = |text: &str| {
        let cell = Cell::new(&[("A.LS", text)]);
        let found = published(&cell.folder, cell.folder.documents().next().unwrap()).diagnostics;
        let found =
            found.into_iter().find(|it| it.code == Some(NumberOrString::String("lost-letter".into())));
        found.map(|it| (it.severity, it.range.start.line, it.range.start.character, it.range.end.character))
    };
    let place = Some((Some(DiagnosticSeverity::WARNING), 2, 11, 12));
    let text = "/PROG A\n/MN\n   1:  R[1:Z\u{fffd}hler]=1 ;\n   2:  !\u{fffd} ;\n/END\n";
    assert_eq!(lost(&text.replace('Z', "")), place);
    // A text that is not a program is reported too; a letter that was read correctly is not.
    assert_eq!(lost("1\n2\n           \u{fffd}"), place);
    assert_eq!(lost(&text.replace('\u{fffd}', "\u{e4}")), None);
}
