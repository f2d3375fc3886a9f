/* The central controller of mmacell-proto (section 7 of reference/mmacell-proto.md): one connection to a device. */
#ifndef CELLWIRE_MMACELL_CENTRAL_H
#define CELLWIRE_MMACELL_CENTRAL_H

#include "cellwire/mmacell_proto.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MMACELL_CENTRAL_EVENTS 4

/* MM-71; times in nanoseconds. */
struct mmacell_central_config {
    enum mmacell_proto_side device;
    struct mmacell_proto_dialect accepts, writes;
    uint64_t timeout, settle;
    int32_t tolerance; /* in the last digit of an axis */
};

extern const struct mmacell_central_config MMACELL_CENTRAL_DEFAULT; /* for a platform */

enum mmacell_central_link {
    MMACELL_CENTRAL_DOWN,
    MMACELL_CENTRAL_IDLE,
    MMACELL_CENTRAL_SENDING,
    MMACELL_CENTRAL_AWAITING,
    MMACELL_CENTRAL_ENDED,
};

enum mmacell_central_kind {
    MMACELL_CENTRAL_CONNECTED,
    MMACELL_CENTRAL_DONE,    /* message: the command */
    MMACELL_CENTRAL_REFUSED, /* message: the command; error */
    MMACELL_CENTRAL_STATUS,  /* message: the status; motion */
    MMACELL_CENTRAL_ABORTED, /* message: the command */
    MMACELL_CENTRAL_CLOSED,  /* reason; unfinished, message: the command; item for `malformed` */
    MMACELL_CENTRAL_UNEXPECTED, /* a line without a connection */
};

/* What is known of a command that was not finished (MM-36). */
enum mmacell_central_unfinished { MMACELL_CENTRAL_NOTHING, MMACELL_CENTRAL_NOT_SENT, MMACELL_CENTRAL_UNKNOWN };

struct mmacell_central_event {
    enum mmacell_central_kind kind;
    struct mmacell_proto_message message;
    int32_t error;
    const char *motion, *reason;
    enum mmacell_central_unfinished unfinished;
    struct mmacell_proto_item item;
};

enum mmacell_central_motion {
    MMACELL_CENTRAL_REST,
    MMACELL_CENTRAL_STARTING,
    MMACELL_CENTRAL_MOVING,
    MMACELL_CENTRAL_STOPPING,
};

enum mmacell_central_target { MMACELL_CENTRAL_NO_TARGET, MMACELL_CENTRAL_UNKNOWN_TARGET, MMACELL_CENTRAL_POSE };

struct mmacell_central {
    struct mmacell_central_config config;
    enum mmacell_central_link link;
    struct mmacell_proto_decoder decoder;
    struct mmacell_proto_message command;
    uint64_t deadline;
    enum mmacell_central_motion motion;
    enum mmacell_central_target target;
    int32_t target_axes[MMACELL_PROTO_MAX_AXES];
    uint64_t believed_from;
    bool has_pose;
    int32_t pose[MMACELL_PROTO_MAX_AXES];
    struct mmacell_central_event events[MMACELL_CENTRAL_EVENTS];
    size_t event_count;
};

/* false: the configuration cannot work (MM-48). */
bool mmacell_central_init(struct mmacell_central *central, const struct mmacell_central_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void mmacell_central_connected(struct mmacell_central *central, uint64_t now);
void mmacell_central_disconnected(struct mmacell_central *central, uint64_t now);
void mmacell_central_timeout(struct mmacell_central *central, uint64_t now);

/* Takes bytes, all of them; returns how many. */
size_t mmacell_central_input(struct mmacell_central *central, uint64_t now, const uint8_t *data, size_t size);

/* false: refused, nothing has changed (MM-30). */
bool mmacell_central_request(struct mmacell_central *central, const struct mmacell_proto_message *command);
void mmacell_central_abort(struct mmacell_central *central);

/* The next event; false: there is none. */
bool mmacell_central_event(struct mmacell_central *central, struct mmacell_central_event *event);

/* The bytes that are to be sent now, at most MMACELL_PROTO_MAX_LINE; 0: nothing. */
size_t mmacell_central_transmit(struct mmacell_central *central, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called at the latest; false: never. */
bool mmacell_central_deadline(const struct mmacell_central *central, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
