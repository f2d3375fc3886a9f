/* What both ends of kawasaki-msg share: a connection's decoder, and events. */
#ifndef CELLWIRE_KAWASAKI_END_H
#define CELLWIRE_KAWASAKI_END_H

#include "cellwire/kawasaki_dialect.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KAWASAKI_EVENTS 32 /* that wait */
#define KAWASAKI_NUMBERS ((KAWASAKI_LARGEST + 8) / 8)

/* KM-81, KM-120. A `number` that is 0 is none. */
enum kawasaki_event_kind {
    KAWASAKI_CONNECT,
    KAWASAKI_DISCONNECT,
    KAWASAKI_ORDER_STARTED,     /* order */
    KAWASAKI_ORDER_ENDING,      /* order */
    KAWASAKI_ORDER_INTERRUPTED, /* order */
    KAWASAKI_ORDER_OVER,        /* order, executed; of a PC complete */
    KAWASAKI_OUTCOME_UNKNOWN,   /* order, executed, sent */
    KAWASAKI_ALARM,             /* order, number */
    KAWASAKI_COMMANDED,         /* id, value (of a robot only if has_value); of a PC is_transmitted */
    KAWASAKI_ORDER_REFUSED,     /* order, active; of a PC given_up */
    KAWASAKI_JOB_UNFIT,         /* order, index, fault */
    KAWASAKI_PROGRESS,          /* executed, queued */
    KAWASAKI_EXECUTED_AHEAD,    /* index */
    KAWASAKI_PAUSED,            /* queued */
    KAWASAKI_PEER_STATUS,       /* order, phase, number (queued, or sent), executed (a number) */
    KAWASAKI_QUEUE_FULL,        /* number */
    KAWASAKI_QUEUE_DRAINED,     /* number */
    KAWASAKI_QUEUE_CLEARED,     /* number */
    KAWASAKI_RECOVERY,          /* step, number */
    KAWASAKI_NO_REPLY,
    KAWASAKI_CORRUPT,  /* error, length */
    KAWASAKI_REJECTED, /* fault */
    KAWASAKI_UNEXPECTED,
};

enum kawasaki_step { KAWASAKI_RESEND, KAWASAKI_HOLD, KAWASAKI_CLEAR, KAWASAKI_GIVE_UP };

struct kawasaki_event {
    enum kawasaki_event_kind kind;
    bool is_outcome; /* it is never lost */
    uint16_t order, active, number;
    uint64_t executed, queued, sent, index; /* counts of jobs; an index is counted from 0 */
    bool complete, given_up, is_transmitted, has_value;
    uint8_t id, phase;
    int32_t value;
    enum kawasaki_step step;
    struct kawasaki_msg_error error;
    size_t length; /* of garbage */
    struct kawasaki_fault fault;
};

/* A part of both sessions. */
struct kawasaki_end {
    struct kawasaki_dialect dialect;
    uint16_t largest; /* of the numbers of jobs */
    size_t packet;
    struct kawasaki_msg_decoder decoder;
    struct kawasaki_msg_item item;
    struct kawasaki_event events[KAWASAKI_EVENTS + 1]; /* the last place is of a notice that is lost */
    size_t event_count;
    bool closes; /* that it is to be closed is not reported yet */
};

/* KM-4, KM-5: bytes of a string of AS, and of a packet. */
struct kawasaki_limits {
    size_t element, packet;
};

#ifdef __cplusplus
}
#endif

#endif
