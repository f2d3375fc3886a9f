//! The counts of what the shadows report, by link, and the lists that they are made from.
//!
//! `SHADOW_LISTS=FOLDER cargo test -p cellwire-links --test it shadow` writes the lists to FOLDER, an absolute path. A test that fails
//! prints the new counts; if a checksum has changed, compare the lists with those of an earlier revision.

use std::path::PathBuf;

/// The complaints about the peers in the stories: how many by kind and clause, and the checksum of `LINK.txt`, the list of them. A
/// complaint that follows one of the same words in its story does not count.
pub(super) const STORIES: &str = "\
kawasaki-msg Assumption: KM-51 202, KM-87 177
kawasaki-msg Budget: KM-50 122
kawasaki-msg Rule: KM-22 30, KM-42 17, KM-52 38, KM-54 6, KM-56 11, KM-67 6, KM-68 6, KM-92 277, KM-93 19, KM-95 51
kawasaki-msg list dae45c28e4c78b91
val2-alter Assumption: AL-53 143, AL-93 23
val2-alter Budget: AL-53 5, AL-60 5, AL-61 8, AL-73 31
val2-alter Rule: AL-16 236, AL-23 21, AL-53 50, AL-73 8, AL-76 30, AL-78 1, AL-86 4, AL-89 46
val2-alter list 899d5e6b5c540b26
val2-viewer Assumption: VV-38 28, VV-40 51
val2-viewer Rule: VV-10 7, VV-19 43, VV-25 14, VV-3 18
val2-viewer list 2445fb67940bbf88
isra-ball Assumption: IB-24 55, IB-25 16, IB-26 3, IB-31 15
isra-ball Rule: IB-10 3, IB-11 1, IB-25 12, IB-33 5, IB-35 27, IB-9 75
isra-ball list 5596c364515c5fe5
fanuc-hmi-modbus Assumption: FM-42 168, FM-57 30
fanuc-hmi-modbus Rule: FM-40 25, FM-41 2, FM-43 27, FM-44 36, FM-48 87, FM-60 7, FM-61 23
fanuc-hmi-modbus list 5ae09b9692e64d4a
laser-eb90 Assumption: LE-72 20, LE-98 14
laser-eb90 Budget: LE-99 68
laser-eb90 Rule: LE-102 12, LE-19 1, LE-22 2, LE-23 4, LE-24 3, LE-25 13, LE-45 20, LE-5 30
laser-eb90 list 459c19b407d940ca
mmacell-proto Assumption: MM-60 41
mmacell-proto Rule: MM-18 4, MM-3 16, MM-4 15, MM-51 1, MM-54 2, MM-74 17
mmacell-proto list ed2d73a38868e4a6
";

/// The stories that are read with one fault. The columns are: how many of all stories; for each of [`FAULTS`](super::faults::FAULTS) the
/// faults that are complained about, of those that can be seen, + those that nobody between the ends can see; the complaints that come
/// later than the next two messages; the faults that nobody can see, for each of [`REASONS`](super::unseen::REASONS); the checksum of
/// `LINK-faults.txt`.
pub(super) const FAULTS: &str = "\
kawasaki-msg: 99 of 365; 484/512 + 40, 506/552, 550/551 + 1, 26/26 + 341, 120/120 + 432; 18; 341 32 8 1 0 0 432 0; list 4fb1dae126205ebf
val2-alter: 91 of 430; 200/208 + 119, 324/327, 168/174 + 153, 11/11 + 239, 327/327; 30; 214 120 6 137 0 34 0 0; list 2d3ce949f9f94e5e
val2-viewer: 60 of 147; 78/78 + 75, 109/123 + 30, 51/51 + 102, 0/0 + 41, 83/83 + 70; 1; 41 41 6 80 0 0 44 106; list 58a07ca338c56e4d
isra-ball: 34 of 96; 80/80 + 24, 104/104, 56/56 + 48, 5/5 + 35, 104/104; 0; 35 21 3 48 0 0 0 0; list 8774e218441dacca
fanuc-hmi-modbus: 101 of 356; 227/233 + 120, 294/304 + 49, 147/151 + 202, 126/132 + 212, 319/319 + 34; 13; 97 134 3 202 147 0 34 0; list 394aa1be2892934a
laser-eb90: 109 of 271; 175/175 + 80, 246/246 + 9, 114/114 + 141, 116/116 + 134, 255/255; 0; 25 42 4 141 152 0 0 0; list 49ed2ba0c3bd7215
mmacell-proto: 118 of 191; 798/799 + 78, 877/877, 419/419 + 458, 100/106 + 225, 819/819 + 58; 45; 212 38 40 458 0 13 58 0; list ebd6b4496045a3ff
";

/// Writes a list to the folder of the lists, if one is named, and returns its checksum (FNV-1a).
pub(super) fn keep(name: &str, list: &str) -> String {
    if let Some(folder) = std::env::var_os("SHADOW_LISTS").map(PathBuf::from) {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(name), list).unwrap();
    }
    let checksum = list
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325_u64, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3));
    format!("list {checksum:016x}")
}

/// Fails if the counts differ, with those that were found.
pub(super) fn compare(found: &str, expected: &str) {
    assert!(
        found == expected,
        "SHADOW_LISTS=FOLDER writes the lists of these counts, which are not those of counts.rs:\n{found}"
    );
}
