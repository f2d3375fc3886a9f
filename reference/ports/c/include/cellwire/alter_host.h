/* The host of val2-alter (section 7 of reference/val2-alter.md): one serial line to a controller. */
#ifndef CELLWIRE_ALTER_HOST_H
#define CELLWIRE_ALTER_HOST_H

#include "cellwire/alter_limiter.h"
#include "cellwire/val2_alter.h"

#ifdef __cplusplus
extern "C" {
#endif

enum alter_host_policy { ALTER_HOST_ACCEPT, ALTER_HOST_REFUSE, ALTER_HOST_IGNORE };

/* Section 7.1; times in nanoseconds. */
struct alter_host_config {
    struct val2_alter_framing framing;
    uint32_t baud;
    uint8_t mode;
    struct alter_limits limits;
    bool subroutine;
    enum alter_host_policy policy;
    unsigned repeats;
    uint32_t silence_cycles;
    bool has_gap;
    uint64_t gap, target_timeout, reserve, max_delay;
};

extern const struct alter_host_config ALTER_HOST_DEFAULT;

/* Section 7.2; the order matters: ALTER is accepted from ALTER_HOST_ACCEPTED on. */
enum alter_host_phase {
    ALTER_HOST_DISCONNECTED,
    ALTER_HOST_IDLE,
    ALTER_HOST_REPEATING,
    ALTER_HOST_STARTING,
    ALTER_HOST_ACCEPTED,
    ALTER_HOST_RUNNING,
    ALTER_HOST_INTERRUPTED,
    ALTER_HOST_STOPPING,
    ALTER_HOST_SILENT,
};

/* What became of an exception (section 7.6). */
enum alter_host_sent { ALTER_HOST_NO_EXCEPTION, ALTER_HOST_UNSENT, ALTER_HOST_SENT, ALTER_HOST_UNREAD };

enum alter_host_kind {
    ALTER_HOST_MESSAGE,   /* message */
    ALTER_HOST_CORRUPT,   /* error */
    ALTER_HOST_LOST,      /* text: the reason */
    ALTER_HOST_EXCEPTION, /* code, text: the outcome, reason or NULL */
    ALTER_HOST_STOPPED,
    ALTER_HOST_MISSED,
    ALTER_HOST_STALE,
    ALTER_HOST_REJECTED, /* code: the error */
    ALTER_HOST_DELAYED,
    ALTER_HOST_UNEXPECTED, /* bytes without a connection */
};

struct alter_host_event {
    bool is_outcome; /* never dropped */
    enum alter_host_kind kind;
    struct val2_alter_message message;
    struct val2_alter_error error;
    uint8_t code;
    const char *text, *reason;
};

struct alter_host {
    struct alter_host_config config;
    enum alter_host_policy policy;
    bool subroutine;
    struct val2_alter_decoder decoder;
    unsigned failures; /* of the decoder, that were looked at */
    bool has_gap;
    uint64_t gap_at;
    enum alter_host_phase phase;
    bool is_due;                        /* an answer is */
    uint64_t arrival, begin_by, end_by; /* of the answer that is due */
    bool is_interrupted;                /* says the message that it answers */
    unsigned asked;
    uint64_t forget_at, lost_at;
    bool names_mode, zeros_sent;
    struct alter_limiter limiter;
    int16_t target[VAL2_ALTER_AXES];
    bool is_fresh;
    uint64_t fresh_until;
    uint8_t kept, sent; /* sets of axes, a bit each (AL-64) */
    enum alter_host_sent exception;
    uint8_t exception_code;
    uint64_t follows_until; /* a message is about the last reply */
    uint64_t unread_until;  /* the same for an exception that was not read */
    uint64_t settles_at;    /* where replies may be late */
    struct alter_host_event events[VAL2_ALTER_EVENTS + 1]; /* the last one is no place of the queue */
    size_t event_count;
};

/* False: the configuration cannot work (AL-42). */
bool alter_host_init(struct alter_host *host, const struct alter_host_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void alter_host_connected(struct alter_host *host, uint64_t now);
void alter_host_disconnected(struct alter_host *host, uint64_t now);
void alter_host_timeout(struct alter_host *host, uint64_t now);

/* Takes bytes, as many as fit; returns how many. Take the events, then give the rest. */
size_t alter_host_input(struct alter_host *host, uint64_t now, const uint8_t *data, size_t size);

void alter_host_set_target(struct alter_host *host, uint64_t now, const int16_t target[VAL2_ALTER_AXES]);
void alter_host_clear_target(struct alter_host *host);
void alter_host_stop(struct alter_host *host);

/* false: refused (AL-66). */
bool alter_host_exception(struct alter_host *host, uint8_t code);

/* The next event; false: there is none. */
bool alter_host_event(struct alter_host *host, struct alter_host_event *event);

/* The bytes that are to be sent now, at most VAL2_ALTER_MAX_LEN; 0: nothing. */
size_t alter_host_transmit(struct alter_host *host, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called at the latest; false: never. */
bool alter_host_deadline(const struct alter_host *host, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
