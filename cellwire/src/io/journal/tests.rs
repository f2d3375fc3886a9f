use super::*;

fn head(work: &str, parts: usize) -> Head {
    Head { robot: "press".into(), work: work.into(), parts }
}

#[test]
fn a_journal_is_read_again_but_for_a_torn_line_and_by_one_process_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plate.journal");
    let open = |parts, again| Journal::<Vec<Outcome>>::open(&path, "plate", head("5a", parts), again);
    let span = |outcome, first, count| Span { outcome, first, count };
    let mut journal = open(4, false).unwrap();
    journal.note(&span(Outcome::Unknown, 0, 3)).unwrap();
    journal.note(&span(Outcome::Done, 0, 1)).unwrap();
    let error = open(4, false).unwrap_err().to_string();
    assert_eq!(error, format!("another process is running this plate: it has locked {}", path.display()));
    drop(journal);

    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, [&whole, &b"{\"outcome\":\"done\",\"fir"[..]].concat()).unwrap();
    let journal = open(4, false).unwrap();
    assert_eq!(*journal.outcomes(), [Outcome::Done, Outcome::Unknown, Outcome::Unknown, Outcome::NotSent]);
    assert_eq!((journal.unknown(), journal.count(Outcome::Unknown)), (Some((1, 2)), 2));
    assert_eq!(std::fs::read(&path).unwrap(), whole);
    drop(journal);

    let error = format!("{:#}", open(5, false).unwrap_err());
    assert!(error.contains("it belongs to another plate, of which it has 1 part as done"), "{error}");
    assert_eq!(*open(5, true).unwrap().outcomes(), [Outcome::NotSent; 5]);
    std::fs::write(&path, "none\n").unwrap();
    let error = format!("{:#}", open(5, false).unwrap_err());
    let what = "line 1 is damaged, or not a line of a journal: nothing is known of what was done. ";
    assert!(error.contains(what) && error.contains("finished parts too"), "{error}");
}

/// A journal of seven parts, and its lines.
struct Written(tempfile::TempDir, Vec<String>);

impl Written {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plate.journal");
        let mut journal = Journal::<Vec<Outcome>>::open(&path, "plate", head("5a", 7), false).unwrap();
        for (outcome, first, count) in
            [(Outcome::Unknown, 0, 3), (Outcome::Done, 0, 3), (Outcome::Unknown, 3, 4), (Outcome::Done, 3, 4)]
        {
            journal.note(&Span { outcome, first, count }).unwrap();
        }
        drop(journal);
        let lines = std::fs::read_to_string(&path).unwrap().lines().map(str::to_owned).collect();
        Self(folder, lines)
    }

    /// Opens it again with other lines.
    fn open(&self, lines: &[String]) -> Result<Vec<Outcome>, String> {
        let path = self.0.path().join("plate.journal");
        std::fs::write(&path, lines.join("\n") + "\n").unwrap();
        let journal = Journal::<Vec<Outcome>>::open(&path, "plate", head("5a", 7), false);
        journal.map(|journal| journal.outcomes().into_owned()).map_err(|error| format!("{error:#}"))
    }
}

#[test]
fn every_changed_character_and_every_line_that_is_missing_or_in_another_place_is_damage() {
    let written = Written::new();
    let lines = &written.1;
    assert_eq!(written.open(lines), Ok(vec![Outcome::Done; 7]));
    for (at, line) in lines.iter().enumerate() {
        for place in 0..line.len() {
            let mut changed = lines.clone();
            let mut bytes = line.clone().into_bytes();
            bytes[place] ^= 1;
            changed[at] = String::from_utf8(bytes).unwrap();
            let error = written.open(&changed).expect_err(&changed[at]);
            assert!(error.contains(&format!("line {} is damaged", at + 1)), "{}: {error}", changed[at]);
        }
    }
    for at in 1..lines.len() - 1 {
        let (mut without, mut swapped) = (lines.clone(), lines.clone());
        without.remove(at);
        swapped.swap(at, at + 1);
        for changed in [without, swapped] {
            let error = written.open(&changed).unwrap_err();
            let known = if at > 2 { 3 } else { 0 };
            let known = format!(
                "line {} is damaged, or not a line of a journal: the lines before it have {known} of 7 parts as done",
                at + 1
            );
            assert!(error.contains(&known), "{error}");
        }
    }
}

#[test]
fn what_is_out_of_range_is_damage_and_so_is_a_line_without_a_checksum() {
    let written = Written::new();
    let lines = &written.1;
    let plain: Vec<String> = lines.iter().map(|line| line[..line.len() - 9].to_owned()).collect();
    let summed = |lines: &[String]| -> Vec<String> {
        let mut sum = 0;
        let with_sum = |line: &String| {
            sum = checksum(sum, line.as_bytes());
            format!("{line} {sum:08x}")
        };
        lines.iter().map(with_sum).collect()
    };
    assert_eq!(written.open(&summed(&plain)), Ok(vec![Outcome::Done; 7]));
    for line in [
        r#"{"outcome":"done","first":0,"count":9}"#,
        r#"{"outcome":"done","first":7,"count":1}"#,
        r#"{"outcome":"done","first":18446744073709551615,"count":2}"#,
        r#"{"outcome":"done","first":0,"count":0}"#,
    ] {
        let mut changed = plain.clone();
        changed[2] = line.into();
        assert!(written.open(&summed(&changed)).unwrap_err().contains("line 3 is damaged"), "{line}");
    }
    let mut mixed = lines.clone();
    mixed[4] = plain[4].clone();
    assert!(written.open(&mixed).unwrap_err().contains("line 5 is damaged"));
}

#[test]
fn a_journal_of_another_robot_is_left_as_it_is() {
    let written = Written::new();
    let path = written.0.path().join("plate.journal");
    let other = || Head { robot: "saw".into(), ..head("5a", 7) };
    for again in [false, true] {
        let error = Journal::<Vec<Outcome>>::open(&path, "plate", other(), again).unwrap_err();
        assert!(
            format!("{error:#}")
                .ends_with("it has the outcomes of `run press`: name another file with --journal")
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), written.1.len());
    }
    std::fs::write(&path, format!("{}\n", written.1[0])).unwrap();
    assert!(Journal::<Vec<Outcome>>::open(&path, "plate", other(), false).is_ok());
}

#[test]
fn a_run_that_does_nothing_leaves_its_journal_and_one_without_an_entry_is_of_no_work() {
    let written = Written::new();
    let path = written.0.path().join("plate.journal");
    let open = |work: &str, again| {
        Journal::<Vec<Outcome>>::open(&path, "plate", head(work, 7), again)
            .map(|it| it.outcomes().into_owned())
    };
    assert_eq!(open("5a", true).unwrap(), [Outcome::NotSent; 7]);
    assert_eq!(open("5a", false).unwrap(), [Outcome::Done; 7]);
    assert!(format!("{:#}", open("5b", false).unwrap_err()).contains("it belongs to another plate"));
    let fewer = Journal::<Vec<Outcome>>::open(&path, "plate", head("5b", 2), false).unwrap_err();
    assert!(format!("{fewer:#}").contains("of which it has parts as done"), "{fewer:#}");
    std::fs::write(&path, format!("{}\n", written.1[0])).unwrap();
    assert_eq!(open("5b", false).unwrap(), [Outcome::NotSent; 7]);
    let mut journal = Journal::<Vec<Outcome>>::open(&path, "plate", head("5b", 7), false).unwrap();
    journal.note(&Span { outcome: Outcome::Done, first: 0, count: 2 }).unwrap();
    drop(journal);
    assert_eq!(open("5b", false).unwrap().iter().filter(|it| **it == Outcome::Done).count(), 2);
}
