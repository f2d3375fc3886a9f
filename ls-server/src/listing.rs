//! The listings of a controller's backup: the names and values of registers, the names of inputs and outputs, the macros.

use std::collections::BTreeMap;
use std::path::Path;

use fanuc_ls::ItemKind;

use crate::files::{has_ending, stem};
use crate::index::Item;

/// The longest listing that is read, in bytes.
const MAX_LISTING: usize = 8 << 20;

/// The contents of a listing.
#[derive(Debug, Default)]
pub(crate) struct Listing {
    /// The file's name.
    pub(crate) file: String,
    pub(crate) items: BTreeMap<Item, ListedItem>,
    /// Macros by their names in capitals, and the programs that they run.
    pub(crate) macros: BTreeMap<String, String>,
}

/// A register, an input or an output in a listing.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct ListedItem {
    /// The comment; empty if the item lacks one.
    pub(crate) name: String,
    /// The value as it stands; empty for one that was never set.
    pub(crate) value: String,
}

/// Returns whether a file is a listing, by its name.
pub(crate) fn is_one(path: &Path) -> bool {
    const STEMS: [&str; 6] = ["NUMREG", "POSREG", "STRREG", "SYSMACRO", "IOSTATE", "IOCONFIG"];
    let is_known = |stem: String| STEMS.iter().any(|known| stem.eq_ignore_ascii_case(known));
    has_ending(path, &["va", "ls", "dg"]) && stem(path).is_some_and(is_known)
}

/// Reads a listing. Lines that are not understood are skipped.
pub(crate) fn read(path: &Path, bytes: &[u8]) -> Listing {
    let file = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut listing = Listing { file, ..Listing::default() };
    let text = String::from_utf8_lossy(bytes.get(..MAX_LISTING).unwrap_or(bytes));
    let (mut kind, mut last, mut name) = (None, None, None);
    for line in text.lines() {
        let words = line.trim();
        if words.starts_with("[*") {
            let kinds = [
                ("$NUMREG", ItemKind::Register),
                ("$POSREG", ItemKind::PositionRegister),
                ("$STRREG", ItemKind::StringRegister),
            ];
            kind = kinds.into_iter().find(|(word, _)| words.contains(word)).map(|(_, kind)| kind);
            last = None;
        } else if let Some(value) = field(words, ".$MACRO_NAME") {
            name = Some(value.to_uppercase()).filter(|name| !name.is_empty());
        } else if let Some(program) = field(words, ".$PROG_NAME") {
            if let Some(name) = name.take() {
                listing.macros.insert(name, program.to_owned());
            }
        } else if let Some((kind, number, rest)) =
            kind.and_then(|kind| element(words).map(|(n, rest)| (kind, n, rest)))
        {
            last = Some((kind, number));
            listing.items.entry((kind, number)).or_insert_with(|| listed(kind, rest));
        } else if words.starts_with('[') {
            last = None;
        } else if let (Some(item), Some(ItemKind::PositionRegister)) = (last, kind) {
            // The coordinates are on the next lines.
            if let Some(listed) = listing.items.get_mut(&item).filter(|_| !words.is_empty()) {
                listed.value.push_str(if listed.value.is_empty() { "" } else { "; " });
                listed.value.push_str(&words.split_whitespace().collect::<Vec<_>>().join(" "));
            }
        } else {
            signals(words, &mut listing.items);
        }
    }
    listing
}

/// Returns the value in `Field: $MACROTABLE[1].$PROG_NAME Access: RW: STRING[37] = 'OPEN'`.
fn field<'a>(line: &'a str, name: &str) -> Option<&'a str> {
    let (head, value) = line.split_once('=')?;
    let is_meant = head.contains("$MACROTABLE[") && head.contains(name);
    is_meant.then(|| value.trim().trim_matches('\'').trim())
}

/// Returns the number in `[5] = 1 'name'` or `[1,5] = 'name'`, and the text after it. For position registers, the first
/// motion group counts.
fn element(line: &str) -> Option<(u32, &str)> {
    let (index, rest) = line.strip_prefix('[')?.split_once(']')?;
    let number = match index.split_once(',') {
        Some((group, number)) => Some(number).filter(|_| group.trim() == "1")?,
        None => index,
    };
    Some((number.trim().parse().ok()?, rest.trim_start().strip_prefix('=')?.trim()))
}

/// Returns the name and the value in the text after the number.
fn listed(kind: ItemKind, rest: &str) -> ListedItem {
    let (before, name, after) = match rest.strip_suffix('\'').filter(|_| kind != ItemKind::PositionRegister) {
        // A string may have quotes of its own: the last ones are the name's.
        Some(inner) => inner.rsplit_once('\'').map_or(("", inner, ""), |(value, name)| (value, name, "")),
        None => match rest.split_once('\'').and_then(|(before, rest)| Some((before, rest.split_once('\'')?)))
        {
            Some((before, (name, after))) => (before, name, after),
            None => (rest, "", ""),
        },
    };
    let value = [before.trim(), after.trim()].into_iter().find(|value| !value.is_empty()).unwrap_or("");
    let is_set = !value.eq_ignore_ascii_case("Uninitialized") && value != "''";
    ListedItem { name: name.trim().to_owned(), value: if is_set { value.to_owned() } else { String::new() } }
}

/// Adds the inputs and outputs of a line such as `DIN[   1]  ON  Auto Mode`, which may have several.
fn signals(line: &str, items: &mut BTreeMap<Item, ListedItem>) {
    const KINDS: [(&str, ItemKind); 18] = [
        ("DIN", ItemKind::DigitalInput),
        ("DOUT", ItemKind::DigitalOutput),
        ("RIN", ItemKind::RobotInput),
        ("RDI", ItemKind::RobotInput),
        ("RI", ItemKind::RobotInput),
        ("ROUT", ItemKind::RobotOutput),
        ("RDO", ItemKind::RobotOutput),
        ("RO", ItemKind::RobotOutput),
        ("GIN", ItemKind::GroupInput),
        ("GOUT", ItemKind::GroupOutput),
        ("AIN", ItemKind::AnalogInput),
        ("AOUT", ItemKind::AnalogOutput),
        ("UIN", ItemKind::UserInput),
        ("UOUT", ItemKind::UserOutput),
        ("SIN", ItemKind::OperatorInput),
        ("SOUT", ItemKind::OperatorOutput),
        ("FLG", ItemKind::Flag),
        ("MRK", ItemKind::Marker),
    ];
    let mut rest = line;
    while let Some((head, after)) = rest.split_once('[') {
        let letters = head.rsplit(|c: char| !c.is_ascii_alphabetic()).next().unwrap_or("");
        let kind = KINDS.iter().find(|(name, _)| *name == letters).map(|(_, kind)| *kind);
        let Some((number, tail)) = after.split_once(']') else { return };
        // The next signal begins with its letters.
        let end = tail.find('[').map_or(tail.len(), |at| {
            tail.get(..at).map_or(0, |text| text.trim_end_matches(|c: char| c.is_ascii_alphabetic()).len())
        });
        let (own, next) = tail.split_at_checked(end).unwrap_or((tail, ""));
        if let (Some(kind), Ok(number)) = (kind, number.trim().parse()) {
            let own = own.trim();
            let state = own.split_whitespace().next().unwrap_or("");
            let is_state = ["ON", "OFF"].contains(&state) || state.parse::<f64>().is_ok();
            let (value, name) =
                if is_state { (state, own.get(state.len()..).unwrap_or("").trim()) } else { ("", own) };
            let listed = items.entry((kind, number)).or_default();
            for (field, new) in [(&mut listed.name, name), (&mut listed.value, value)] {
                if field.is_empty() {
                    new.clone_into(field);
                }
            }
        }
        rest = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(name: &str, text: &str) -> Vec<String> {
        let listing = read(Path::new(name), text.as_bytes());
        let item = |((kind, number), listed): (&Item, &ListedItem)| {
            format!("{kind}{number} {}={}", listed.name, listed.value)
        };
        listing
            .items
            .iter()
            .map(item)
            .chain(listing.macros.iter().map(|(name, program)| format!("{name}>{program}")))
            .collect()
    }

    #[test]
    fn registers_have_names_and_values() {
        let text = "[*NUMREG*]$NUMREG  Storage: SHADOW  Access: RW  : ARRAY[200] OF Numeric Reg\r\n  [1] = 1  'Chip 1' \r\n\
                    \x20 [51] = -2.700000  'X STEP'\r\n  [52] = 0  ''\r\n[*NUMREG*]$MAXREGNUM  Storage: CMOS  Access: RW  : INTEGER = 200\r\n";
        assert_eq!(shown("NUMREG.VA", text), ["R1 Chip 1=1", "R51 X STEP=-2.700000", "R52 =0"]);
        let text = "[*POSREG*]$POSREG  Storage: CMOS  Access: RW  : ARRAY[2,8] OF Position Reg\n    [1,1] =   'Home'   Group: 1\n\
                    \x20 J1 =     9.998 deg   J2 =   -45.000 deg\n\n    [1,2] =   'Far' Uninitialized\n    [1,6] =   '' \n\
                    \x20 Group: 1   Config: F U T, 0, 0, 0\n  X:  2066.881   Y: -1269.113\n    [2,1] =   'Home' Uninitialized\n";
        assert_eq!(
            shown("posreg.va", text),
            [
                "PR1 Home=Group: 1; J1 = 9.998 deg J2 = -45.000 deg",
                "PR2 Far=",
                "PR6 =Group: 1 Config: F U T, 0, 0, 0; X: 2066.881 Y: -1269.113"
            ]
        );
        let text = "[*STRREG*]$STRREG  Storage: SHADOW  Access: RW  : ARRAY[25] OF String Reg\n  [1] = Reset R[101] to 'x'.  'Alarm' \n  [2] =   '' \n";
        assert_eq!(shown("STRREG.VA", text), ["SR1 Alarm=Reset R[101] to 'x'.", "SR2 ="]);
    }

    #[test]
    fn inputs_outputs_and_macros_have_names() {
        let text = "IO STATUS::\n\nDIN[   1]  ON  Auto Mode\nDOUT[ 104] OFF  \nFLG[   8] OFF  Task Rdy     FLG[ 520] OFF    \nGOUT[  93]21986  Total\nDIN[   2]  *Hold\n";
        assert_eq!(
            shown("IOSTATE.DG", text),
            [
                "F8 Task Rdy=OFF",
                "F520 =OFF",
                "DI1 Auto Mode=ON",
                "DI2 *Hold=",
                "DO104 =OFF",
                "GO93 Total=21986"
            ]
        );
        let text = "     Field: $MACROTABLE[1].$MACRO_NAME Access: RW: STRING[37] = 'Open hand 1'\n\
                    \x20    Field: $MACROTABLE[1].$PROG_NAME Access: RW: STRING[37] = 'HOPN1'\n";
        assert_eq!(shown("SYSMACRO.VA", text), ["OPEN HAND 1>HOPN1"]);
        assert_eq!(
            shown("NUMREG.VA", "[*NUMREG*]$NUMREG\n[\n[]\n[x] = 1\n[1 = 2\nDIN[\nDIN[]x\n\u{e9}[1]"),
            [""; 0]
        );
    }

    #[test]
    fn a_listing_is_known_by_its_name() {
        for (name, is) in [
            ("a/numreg.va", true),
            ("IOSTATE.DG", true),
            ("NUMREG.LS", true),
            ("PICK.LS", false),
            ("SYSTEM.VA", false),
        ] {
            assert_eq!(is_one(Path::new(name)), is, "{name}");
        }
    }
}
