/* The workstation of val2-viewer (section 8 of reference/val2-viewer.md): asks for a pose in a display cycle. */
#ifndef CELLWIRE_VIEWER_WORKSTATION_H
#define CELLWIRE_VIEWER_WORKSTATION_H

#include "cellwire/line_echo.h"
#include "cellwire/val2_viewer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define VIEWER_WORKSTATION_EVENTS 16

/* Times in nanoseconds, UINT64_MAX is never. */
struct viewer_workstation_config {
    uint64_t pause, stale_after, max_hold;
    bool echo; /* the line returns what is sent */
};

extern const struct viewer_workstation_config VIEWER_WORKSTATION_DEFAULT;

enum viewer_workstation_kind {
    VIEWER_WORKSTATION_POSE,    /* item.pose, live_until */
    VIEWER_WORKSTATION_UNASKED, /* item.pose */
    VIEWER_WORKSTATION_MISSED,
    VIEWER_WORKSTATION_STALE,
    VIEWER_WORKSTATION_CORRUPT, /* item */
    VIEWER_WORKSTATION_HOLD_ENDED,
    VIEWER_WORKSTATION_LINE_ECHO, /* echo: the line returns what is sent, or something else */
    VIEWER_WORKSTATION_UNEXPECTED,
};

struct viewer_workstation_event {
    enum viewer_workstation_kind kind;
    struct val2_viewer_item item;
    uint64_t live_until; /* UINT64_MAX: no limit */
    struct line_echo_error echo;
};

enum viewer_workstation_request {
    VIEWER_WORKSTATION_DISCONNECTED,
    VIEWER_WORKSTATION_ALLOWED,
    VIEWER_WORKSTATION_DUE,
    VIEWER_WORKSTATION_WAITING,
    VIEWER_WORKSTATION_OVERDUE,
};

struct viewer_workstation {
    struct viewer_workstation_config config;
    struct val2_viewer_decoder decoder;
    enum viewer_workstation_request request;
    uint64_t again_from, missed_from;
    bool is_live, is_held;
    uint64_t live_until, hold;
    struct line_echo echo;
    uint8_t sent[1]; /* the last request, if `echo` looks for it */
    struct viewer_workstation_event events[VIEWER_WORKSTATION_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused (VV-24, VV-39). */
bool viewer_workstation_init(struct viewer_workstation *station, const struct viewer_workstation_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void viewer_workstation_connected(struct viewer_workstation *station, uint64_t now);
void viewer_workstation_disconnected(struct viewer_workstation *station, uint64_t now);
void viewer_workstation_timeout(struct viewer_workstation *station, uint64_t now);

/* A display cycle. */
void viewer_workstation_draw(struct viewer_workstation *station, uint64_t now);

/* Takes bytes; returns how many. Take the events, then give the rest. */
size_t viewer_workstation_input(struct viewer_workstation *station, uint64_t now, const uint8_t *data, size_t size);

/* The next event; false: there is none. */
bool viewer_workstation_event(struct viewer_workstation *station, struct viewer_workstation_event *event);

/* The bytes that are to be sent now; 0: nothing. */
size_t viewer_workstation_transmit(struct viewer_workstation *station, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called at the latest; false: never. */
bool viewer_workstation_deadline(const struct viewer_workstation *station, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
