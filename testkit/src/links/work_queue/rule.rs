//! The properties of the queue, and the rules that they depend on.

pub(super) const EXECUTED_ONCE: &str = "nothing is executed twice";
pub(super) const NOT_LOST: &str = "nothing is lost that was not cleared";
pub(super) const NOT_PULLED_AWAY: &str = "a job being executed is not pulled away";
pub(super) const PUBLISHED: &str = "the reader sees only jobs that were published, and in whole rows";
pub(super) const NUMBERED: &str = "a job is seen under its number";
pub(super) const RESET_KEEPS: &str = "jobs queued after a reset are kept";
pub(super) const NOT_BEGUN: &str = "no look that begins after a reset finds what it discards";
pub(super) const SETTLED: &str = "a reset that has settled has taken effect";
pub(super) const IN_ORDER: &str = "take takes the oldest job";
pub(super) const UNIQUE: &str = "no number is queued twice";
pub(super) const GAPLESS: &str = "each job has the number after that of the job before it";
pub(super) const DROPPED: &str = "jobs that are left when both ends are gone are dropped once";
pub(super) const FOUND: &str = "who finds nothing after the writer is gone has found everything";

macro_rules! rules {
    ($($rule:ident: $words:literal, $property:ident;)*) => {
        /// The rules that the queue's proof depends on.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[allow(missing_docs, reason = "the words are beside them")]
        pub enum Rule { $($rule),* }

        impl Rule {
            /// Each with its words, and the property that breaks without it.
            pub(super) const ALL: &[(Self, &'static str, &'static str)] = &[$((Self::$rule, $words, $property)),*];
        }
    };
}

rules! {
    TailBeforeMark: "the mark is looked at after the tail", NUMBERED;
    ListTailBeforeMark: "a listing looks at the mark after the tail", NUMBERED;
    TakeObeysMark: "take obeys the mark", NOT_BEGUN;
    BatchObeysMark: "take_batch obeys the mark", NOT_BEGUN;
    FindObeysMark: "take_where obeys the mark", NOT_BEGUN;
    ListBeginsAtMark: "a listing begins at the mark", NOT_BEGUN;
    ListEndsAtTail: "a listing ends at the tail, be the mark after it", PUBLISHED;
    DiscardEndsAtMark: "discarding ends at the mark", RESET_KEEPS;
    MarkIsOneWord: "the mark's position and number are one word", NUMBERED;
    MarkIsRenumbered: "the jobs after a mark have its number", NUMBERED;
    PassedMarkIsOnlyNoted: "a mark that was passed numbers nothing", NUMBERED;
    RenewedMarkNumbersHead: "a renewed mark has the number of the job there", NUMBERED;
    SettledIsTheHead: "settled is where the head is", SETTLED;
    CompletingFrees: "a job's slot is freed when it is completed", NOT_PULLED_AWAY;
    ClearedIsNotFree: "a cleared slot is the reader's", NOT_PULLED_AWAY;
    ClaimLooksForSpace: "a claim looks for space", NOT_LOST;
    BatchLooksForSpace: "a batch ends where the space does", NOT_LOST;
    TailAfterJob: "the tail is stored after the job", PUBLISHED;
    DroppedBatchIsEmptied: "a batch that is dropped drops its jobs", NOT_LOST;
    BatchIsFreedAtItsEnd: "the slots of a batch are freed after its jobs", NOT_LOST;
    RowEndsWithLap: "a row ends with the lap", PUBLISHED;
    RowEndsWithNumbers: "a row ends with the numbers", NUMBERED;
    RowEndsAtCompleted: "a row ends at a job that was completed before its turn", EXECUTED_ONCE;
    CompletedIsMarked: "what is completed is marked", EXECUTED_ONCE;
    HeadWaitsForOldest: "the head waits for the oldest job", NOT_LOST;
    HeadPassesCompleted: "the head passes what is completed", EXECUTED_ONCE;
    TakeIsOldest: "take begins at the head", IN_ORDER;
    NumberIsChecked: "the number is checked", GAPLESS;
    LeavingIsOneStep: "an end leaves in one step", DROPPED;
    GoneBeforeNothing: "whether the writer is gone is asked first", FOUND;
}
