/* The controller of val2-alter (section 8 of reference/val2-alter.md): a robot's program that runs ALTER. */
#ifndef CELLWIRE_ALTER_CONTROLLER_H
#define CELLWIRE_ALTER_CONTROLLER_H

#include "cellwire/val2_alter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* AL-70: what a word means that a reply leaves out. */
enum alter_controller_unselected { ALTER_CONTROLLER_BY_MODE, ALTER_CONTROLLER_HOLD, ALTER_CONTROLLER_ZERO };

/* Section 8.1; times in nanoseconds. */
struct alter_controller_config {
    struct val2_alter_framing framing;
    uint32_t baud;
    uint8_t mode, list_len;
    int16_t list[VAL2_ALTER_MAX_LIST];
    bool subroutine;
    unsigned attempts;
    enum alter_controller_unselected unselected;
    bool has_gap;
    uint64_t gap;
};

extern const struct alter_controller_config ALTER_CONTROLLER_DEFAULT;

enum alter_controller_phase {
    ALTER_CONTROLLER_DISCONNECTED,
    ALTER_CONTROLLER_OFF,
    ALTER_CONTROLLER_STARTING,
    ALTER_CONTROLLER_RUNNING,
    ALTER_CONTROLLER_INTERRUPTED,
    ALTER_CONTROLLER_ENDING,
};

enum alter_controller_kind {
    ALTER_CONTROLLER_STARTED,
    ALTER_CONTROLLER_REFUSED,
    ALTER_CONTROLLER_GAVE_UP,
    ALTER_CONTROLLER_REPLY,     /* message; values: what moves or holds the arm */
    ALTER_CONTROLLER_BAD_REPLY, /* code */
    ALTER_CONTROLLER_ENDED,     /* code */
    ALTER_CONTROLLER_EXCEPTION, /* code */
    ALTER_CONTROLLER_ABORTED,   /* code */
    ALTER_CONTROLLER_STRAY,     /* message */
    ALTER_CONTROLLER_UNEXPECTED,
};

struct alter_controller_event {
    bool is_outcome; /* never dropped */
    enum alter_controller_kind kind;
    struct val2_alter_message message;
    int16_t values[VAL2_ALTER_AXES];
    uint8_t code;
};

struct alter_controller {
    struct alter_controller_config config;
    struct val2_alter_decoder decoder;
    unsigned failures; /* of the decoder, that were looked at */
    bool has_gap;
    uint64_t gap_at;
    enum alter_controller_phase phase;
    unsigned attempts;
    bool is_reported, has_returned; /* of an interruption */
    uint8_t code;                   /* of the next message */
    uint64_t slot, following;
    bool is_hosts_turn;
    uint64_t opens, closes;
    uint8_t fault; /* the first one of the window; 0: none */
    int16_t words[VAL2_ALTER_AXES];
    uint8_t segment_status;
    uint16_t segment, percent;
    int16_t transform[VAL2_ALTER_TRANSFORM];
    struct alter_controller_event events[VAL2_ALTER_EVENTS + 1]; /* the last one is no place of the queue */
    size_t event_count;
};

/* false: the configuration is refused (AL-69). */
bool alter_controller_init(struct alter_controller *controller, const struct alter_controller_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void alter_controller_connected(struct alter_controller *controller, uint64_t now);
void alter_controller_disconnected(struct alter_controller *controller, uint64_t now);
void alter_controller_timeout(struct alter_controller *controller, uint64_t now);

/* Takes bytes, as many as fit; returns how many. Take the events, then give the rest. */
size_t alter_controller_input(struct alter_controller *controller, uint64_t now, const uint8_t *data, size_t size);

/* The robot's program; false: refused, nothing has changed. */
bool alter_controller_start(struct alter_controller *controller, uint64_t now);
bool alter_controller_finish(struct alter_controller *controller);
bool alter_controller_interrupt(struct alter_controller *controller);
bool alter_controller_resume(struct alter_controller *controller);

/* What the standard messages say. */
void alter_controller_set_segment(struct alter_controller *controller, uint8_t status, uint16_t number, uint16_t percent);
void alter_controller_set_transform(struct alter_controller *controller, const int16_t words[VAL2_ALTER_TRANSFORM]);

/* The next event; false: there is none. */
bool alter_controller_event(struct alter_controller *controller, struct alter_controller_event *event);

/* The bytes that are to be sent now; 0: nothing. */
size_t alter_controller_transmit(struct alter_controller *controller, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called, or a message may be sent, at the latest; false: never. */
bool alter_controller_deadline(const struct alter_controller *controller, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
