/* A device of mmacell-proto (section 8 of reference/mmacell-proto.md): asks its owner for what a central controller orders. */
#ifndef CELLWIRE_MMACELL_DEVICE_H
#define CELLWIRE_MMACELL_DEVICE_H

#include "cellwire/mmacell_proto.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MMACELL_DEVICE_EVENTS 16
#define MMACELL_DEVICE_KEPT 512 /* MM-50 */

/* MM-75 */
struct mmacell_device_config {
    size_t axes_len; /* 4: robot, 2: platform */
    struct mmacell_proto_dialect accepts, writes;
    int32_t refusal;
};

enum mmacell_device_link {
    MMACELL_DEVICE_DOWN,
    MMACELL_DEVICE_IDLE,
    MMACELL_DEVICE_WAITING, /* Asked */
    MMACELL_DEVICE_ANSWERING,
    MMACELL_DEVICE_LEAVING,
    MMACELL_DEVICE_ENDED,
};

enum mmacell_device_axes {
    MMACELL_DEVICE_OFF,
    MMACELL_DEVICE_STILL,
    MMACELL_DEVICE_MOVING,
    MMACELL_DEVICE_STOPPING,
    MMACELL_DEVICE_FAULT,
};

enum mmacell_device_kind {
    MMACELL_DEVICE_ASKED,        /* order: a command; a MOV is absolute */
    MMACELL_DEVICE_NOT_NOW,      /* rejected: axes do not allow it */
    MMACELL_DEVICE_NO_POSE,      /* rejected */
    MMACELL_DEVICE_OUT_OF_RANGE, /* rejected: the sum of a MOVR */
    MMACELL_DEVICE_MALFORMED,    /* rejected: item */
    MMACELL_DEVICE_AGREED,       /* closed, after CLO */
    MMACELL_DEVICE_OVERRUN,      /* closed */
    MMACELL_DEVICE_UNEXPECTED,   /* a line without a connection */
};

struct mmacell_device_event {
    enum mmacell_device_kind kind;
    struct mmacell_proto_message order;
    struct mmacell_proto_item item;
    enum mmacell_device_axes axes;
};

struct mmacell_device {
    struct mmacell_device_config config;
    enum mmacell_device_link link;
    struct mmacell_proto_decoder decoder;
    uint8_t kept[MMACELL_DEVICE_KEPT];
    size_t kept_len;
    struct mmacell_proto_message order, reply;
    enum mmacell_device_axes axes;
    int32_t fault, override;
    bool has_pose;
    int32_t pose[MMACELL_PROTO_MAX_AXES];
    struct mmacell_device_event events[MMACELL_DEVICE_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused (MM-59). */
bool mmacell_device_init(struct mmacell_device *device, const struct mmacell_device_config *config);

/* After each of these: take the events, then what is to be transmitted. A device has no deadlines. */
void mmacell_device_connected(struct mmacell_device *device);
void mmacell_device_disconnected(struct mmacell_device *device);

/* Takes bytes, all of them: those of a read of up to MMACELL_DEVICE_KEPT; returns how many. */
size_t mmacell_device_input(struct mmacell_device *device, const uint8_t *data, size_t size);

/* The owner accepts the order that was asked, or refuses it; false: it is not pending, or not possible any more (MM-54). */
bool mmacell_device_accept(struct mmacell_device *device, const struct mmacell_proto_message *order);
bool mmacell_device_refuse(struct mmacell_device *device, int32_t error);

/* NULL: the pose is not known, as one that mmacell_proto_round does not take (MM-52). */
void mmacell_device_set_pose(struct mmacell_device *device, const int32_t *axes);
void mmacell_device_arrived(struct mmacell_device *device);
void mmacell_device_fail(struct mmacell_device *device, int32_t error);

/* The next event; false: there is none. */
bool mmacell_device_event(struct mmacell_device *device, struct mmacell_device_event *event);

/* The bytes that are to be sent now, at most MMACELL_PROTO_MAX_LINE; 0: nothing. */
size_t mmacell_device_transmit(struct mmacell_device *device, uint8_t *out, size_t size);

#ifdef __cplusplus
}
#endif

#endif
