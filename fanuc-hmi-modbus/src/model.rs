//! What the model of both machines takes away, to show that each rule is needed. For the model only.

/// A rule of a machine that the model can take out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(not(feature = "model"), allow(unreachable_pub, reason = "exported for the model only"))]
#[allow(missing_docs, reason = "each is explained where it is kept")]
pub enum Rule {
    // Client
    MatchTransaction,
    FreshTransaction,
    OneInFlight,
    CheckReply,
    DrainFirst,
    ReadBeforeSend,
    WaitForSilence,
    CutAtSilence,
    EndAtDisconnect,
    DropQueued,
    // Server
    CheckUnit,
    NoReplyToBroadcast,
    ReplyAfterSilence,
    DropReplies,
}
