//! The counts of what the shadows report, by link, and the lists that they are made from.
//!
//! `SHADOW_LISTS=FOLDER cargo test -p cellwire-links --test it shadow` writes the lists to FOLDER, an absolute path. A test
//! that fails prints the new counts; if a checksum has changed, compare the lists with those of an earlier revision.

use std::path::PathBuf;

/// The complaints about the peers in the stories: how many by kind and clause, and the checksum of `LINK.txt`, the list of
/// them. A complaint that follows one of the same words in its story does not count.
pub(super) const STORIES: &str = "\
kawasaki-msg Assumption: KM-51 104, KM-87 113
kawasaki-msg Budget: KM-50 84
kawasaki-msg Rule: KM-22 23, KM-42 14, KM-52 36, KM-54 3, KM-56 8, KM-67 5, KM-68 4, KM-92 159, KM-93 18, KM-95 31
kawasaki-msg list fcde83adbac1458c
val2-alter Assumption: AL-53 92, AL-93 14
val2-alter Budget: AL-53 4, AL-60 5, AL-61 5, AL-73 18
val2-alter Rule: AL-16 150, AL-23 16, AL-53 35, AL-73 5, AL-76 19, AL-86 3, AL-89 34
val2-alter list 43d918210880081f
val2-viewer Assumption: VV-38 28, VV-40 46
val2-viewer Rule: VV-10 6, VV-19 36, VV-25 12, VV-3 15
val2-viewer list 10fdc3ceb0ed0710
isra-ball Assumption: IB-24 35, IB-25 11, IB-26 2, IB-31 6
isra-ball Rule: IB-10 2, IB-25 6, IB-33 5, IB-35 19, IB-9 63
isra-ball list 3d0c5fd23055199b
fanuc-hmi-modbus Assumption: FM-42 156, FM-57 26
fanuc-hmi-modbus Rule: FM-40 24, FM-41 2, FM-43 22, FM-44 40, FM-48 82, FM-60 29, FM-61 22
fanuc-hmi-modbus list 84e2044cd9d1a456
laser-eb90 Assumption: LE-72 14, LE-98 10
laser-eb90 Budget: LE-99 50
laser-eb90 Rule: LE-102 9, LE-19 1, LE-22 2, LE-23 3, LE-24 3, LE-25 10, LE-45 13, LE-5 24
laser-eb90 list ed0d2796203f5e53
mmacell-proto Assumption: MM-60 33
mmacell-proto Rule: MM-18 3, MM-3 15, MM-4 10, MM-54 1, MM-74 14
mmacell-proto list 80178ce444839e70
";

/// The stories that are read with one fault. The columns are: how many of all stories; for each of
/// [`FAULTS`](super::faults::FAULTS) the faults that are complained about, of those that can be seen, + those that nobody
/// between the ends can see; the complaints that come later than the next two messages; the faults that nobody can see, for
/// each of [`REASONS`](super::unseen::REASONS); the checksum of `LINK-faults.txt`.
pub(super) const FAULTS: &str = "\
kawasaki-msg: 53 of 220; 255/269 + 25, 283/294, 292/293 + 1, 20/20 + 169, 68/68 + 226; 6; 169 21 4 1 0 0 226 0; list 301ccec6354cf117
val2-alter: 68 of 300; 174/181 + 89, 267/270, 146/149 + 121, 9/9 + 197, 270/270; 17; 173 97 5 105 0 27 0 0; list 5d486678cf483887
val2-viewer: 50 of 128; 58/58 + 69, 85/97 + 30, 41/41 + 86, 0/0 + 31, 64/64 + 63; 1; 31 35 6 64 0 0 37 106; list b67d235ce28d1944
isra-ball: 26 of 69; 69/69 + 19, 88/88, 50/50 + 38, 5/5 + 30, 88/88; 0; 30 16 3 38 0 0 0 0; list d1058dafb6a49b34
fanuc-hmi-modbus: 75 of 282; 184/190 + 100, 251/258 + 32, 116/117 + 173, 113/122 + 162, 258/258 + 32; 13; 77 117 3 173 97 0 32 0; list 77a6fd86f0d188eb
laser-eb90: 70 of 182; 107/107 + 50, 148/148 + 9, 70/70 + 87, 64/64 + 90, 157/157; 0; 17 32 2 87 98 0 0 0; list 786a1821ed592c24
mmacell-proto: 90 of 145; 575/576 + 63, 639/639, 302/302 + 337, 77/81 + 163, 598/598 + 41; 38; 153 34 29 337 0 10 41 0; list 89a9ef30d5a325c7
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
