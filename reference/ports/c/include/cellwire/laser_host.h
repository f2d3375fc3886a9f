/* The host of laser-eb90 (section 7 of reference/laser-eb90.md): one serial line to a controller. */
#ifndef CELLWIRE_LASER_HOST_H
#define CELLWIRE_LASER_HOST_H

#include "cellwire/laser_eb90.h"
#include "cellwire/laser_words.h"
#include "cellwire/line_echo.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LASER_HOST_EVENTS 160 /* more than one push of bytes can cause */
#define LASER_HOST_BATCH 255

/* LE-107; times in nanoseconds. */
struct laser_host_config {
    struct laser_eb90_profile profile;
    struct laser_words words;
    uint32_t baud;
    unsigned batch, resends;
    bool resend_on_silence;
    uint64_t answer_timeout, execution_timeout, settle, max_pause, reply_time;
    unsigned longest_frame;
    uint64_t earlier_execution;
    bool controller_drops_partial;
    uint64_t backoff, full_timeout;
    bool echo; /* the line returns what is sent */
};

enum laser_host_state {
    LASER_HOST_DISCONNECTED,
    LASER_HOST_DISCONNECTED_HELD,
    LASER_HOST_IDLE,
    LASER_HOST_AWAITING,
    LASER_HOST_RESENDING,
    LASER_HOST_AWAITING_REST,
    LASER_HOST_HELD,
};

enum laser_host_kind {
    LASER_HOST_DONE,       /* first, count, resends, unanswered */
    LASER_HOST_ANSWER,     /* first; the values are in `laser_host.answer` until the next query is answered */
    LASER_HOST_REFUSED,    /* first, count, text: the error code */
    LASER_HOST_UNKNOWN,    /* first, count, text: the reason; expected and word for `other_word` */
    /* notices */
    LASER_HOST_UNASKED,    /* word */
    LASER_HOST_CORRUPT,    /* error; `no_word` if its kind is LASER_EB90_FRAME */
    LASER_HOST_LINE_ECHO,  /* echo: the line returns what is sent, or something else */
    LASER_HOST_UNEXPECTED, /* a call, or bytes, that the state does not allow */
};

struct laser_host_event {
    enum laser_host_kind kind;
    uint64_t first;
    unsigned count, resends, unanswered;
    const char *text;
    uint16_t word, expected;
    struct {
        enum laser_eb90_kind kind;
        size_t error_offset, expected, found;
    } error;
    struct line_echo_error echo;
};

/* A frame of instructions, and its tries. */
struct laser_host_batch {
    uint64_t first;
    unsigned count;
    uint16_t word; /* of the first instruction */
    struct laser_eb90_payload payload;
    unsigned resends, unanswered;
    bool has_full_until;
    uint64_t full_until;
};

struct laser_host {
    struct laser_host_config config;
    enum laser_host_state state;
    struct laser_eb90_decoder decoder;
    uint64_t quiet_until, submitted;
    struct laser_host_batch next, batch; /* a batch without instructions is none */
    uint64_t received_by, final_from, executed_by;
    uint64_t until; /* `deadline`, `not_before`, or `until` of the state */
    bool is_corrupt;
    struct laser_eb90_result answer; /* of the query that was answered last, its word included */
    struct line_echo echo;
    uint8_t sent[LASER_EB90_MAX_LEN]; /* the last frame, if `echo` looks for it */
    struct laser_host_event events[LASER_HOST_EVENTS];
    size_t event_count;
};

/* The defaults at a baud rate (LE-70). */
struct laser_host_config laser_host_default(uint32_t baud);

/* false: the configuration cannot work (LE-71). */
bool laser_host_init(struct laser_host *host, const struct laser_host_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void laser_host_connected(struct laser_host *host, uint64_t now);
void laser_host_disconnected(struct laser_host *host, uint64_t now);
void laser_host_timeout(struct laser_host *host, uint64_t now);
void laser_host_transmitted(struct laser_host *host, uint64_t now);
void laser_host_resume(struct laser_host *host);
void laser_host_take_back(struct laser_host *host);

/* Takes bytes, as many as fit; returns how many. Take the events, then give the rest. */
size_t laser_host_input(struct laser_host *host, uint64_t now, const uint8_t *data, size_t size);

/* An instruction with the items of its parameters; false: refused, nothing has changed (LE-40, LE-41). */
bool laser_host_submit(struct laser_host *host, uint16_t word, const struct laser_eb90_payload *parameters);

/* The next event; false: there is none. */
bool laser_host_event(struct laser_host *host, struct laser_host_event *event);

/* The bytes that are to be sent now, at most LASER_EB90_MAX_LEN; 0: nothing. */
size_t laser_host_transmit(struct laser_host *host, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` or `transmit` is to be called at the latest; false: never. */
bool laser_host_deadline(const struct laser_host *host, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
