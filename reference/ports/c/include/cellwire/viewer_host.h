/* The host of val2-viewer (section 7 of reference/val2-viewer.md): answers requests with the newest pose. */
#ifndef CELLWIRE_VIEWER_HOST_H
#define CELLWIRE_VIEWER_HOST_H

#include "cellwire/line_echo.h"
#include "cellwire/val2_viewer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define VIEWER_HOST_EVENTS 16

/* Times in nanoseconds above 0, UINT64_MAX is never. */
struct viewer_host_config {
    uint64_t interval, max_age, max_hold;
    bool echo; /* the line returns what is sent */
};

extern const struct viewer_host_config VIEWER_HOST_DEFAULT;

enum viewer_host_kind {
    VIEWER_HOST_ASKED,
    VIEWER_HOST_IGNORED,
    VIEWER_HOST_STALE,
    VIEWER_HOST_HOLD_ENDED,
    VIEWER_HOST_SENT,    /* pose */
    VIEWER_HOST_UNKNOWN, /* byte */
    VIEWER_HOST_LINE_ECHO, /* echo: the line returns what is sent, or something else */
    VIEWER_HOST_UNEXPECTED,
};

struct viewer_host_event {
    enum viewer_host_kind kind;
    struct val2_viewer_pose pose;
    uint8_t byte;
    struct line_echo_error echo;
};

enum viewer_host_link { VIEWER_HOST_DISCONNECTED, VIEWER_HOST_READY, VIEWER_HOST_WAS_ASKED };

struct viewer_host {
    struct viewer_host_config config;
    enum viewer_host_link link;
    uint64_t from;
    struct val2_viewer_pose pose; /* its count is that of the next packet */
    bool is_known, is_held;
    uint64_t until, hold;
    struct line_echo echo;
    uint8_t sent[VAL2_VIEWER_MAX_LEN]; /* the last packet, if `echo` looks for it */
    struct viewer_host_event events[VIEWER_HOST_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused (VV-18, VV-39). */
bool viewer_host_init(struct viewer_host *host, const struct viewer_host_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void viewer_host_connected(struct viewer_host *host, uint64_t now);
void viewer_host_disconnected(struct viewer_host *host, uint64_t now);
void viewer_host_timeout(struct viewer_host *host, uint64_t now);

/* Takes bytes; returns how many. Take the events, then give the rest. */
size_t viewer_host_input(struct viewer_host *host, uint64_t now, const uint8_t *data, size_t size);

void viewer_host_set_pose(struct viewer_host *host, uint64_t now, const int16_t words[VAL2_VIEWER_WORDS]);

/* The next event; false: there is none. */
bool viewer_host_event(struct viewer_host *host, struct viewer_host_event *event);

/* The bytes that are to be sent now, at most VAL2_VIEWER_MAX_LEN; 0: nothing. */
size_t viewer_host_transmit(struct viewer_host *host, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called, or a packet may be sent, at the latest; false: never. */
bool viewer_host_deadline(const struct viewer_host *host, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
