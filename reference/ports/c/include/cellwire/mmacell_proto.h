/* mmacell-proto: lines of the MM&A cell. Clauses MM-… are those of reference/mmacell-proto.md. */
#ifndef CELLWIRE_MMACELL_PROTO_H
#define CELLWIRE_MMACELL_PROTO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MMACELL_PROTO_MAX_LINE 64 /* MM-7 */
#define MMACELL_PROTO_MAX_AXES 4

enum mmacell_proto_side { MMACELL_PROTO_CENTRAL, MMACELL_PROTO_ROBOT, MMACELL_PROTO_PLATFORM };

/* Section 11: other readings than the strict one. */
struct mmacell_proto_dialect {
    bool itr, ovrd, clos, off, lone_lf, blank, wide_integers;
};

enum mmacell_proto_kind {
    /* commands */
    MMACELL_PROTO_STA,
    MMACELL_PROTO_STP,
    MMACELL_PROTO_RST,
    MMACELL_PROTO_CLO,
    MMACELL_PROTO_SRV, /* flag: on */
    MMACELL_PROTO_OVR, /* number: percent */
    MMACELL_PROTO_MOV, /* flag: relative; axes */
    MMACELL_PROTO_ACQ, /* number: camera */
    MMACELL_PROTO_HND, /* number: gripper; flag: open */
    /* replies */
    MMACELL_PROTO_OK,
    MMACELL_PROTO_STATUS, /* flag: moving; axes; servo; override; number: error */
    MMACELL_PROTO_ER,     /* number: error */
    /* errors */
    MMACELL_PROTO_TOO_LONG,
    MMACELL_PROTO_INCOMPLETE,
    MMACELL_PROTO_UNKNOWN_COMMAND, /* name */
    MMACELL_PROTO_UNKNOWN_REPLY,   /* name */
    MMACELL_PROTO_UNEXPECTED,      /* error_offset, found, expected */
    MMACELL_PROTO_SHORT,           /* error_offset, expected */
    MMACELL_PROTO_TRAILING,        /* error_offset */
    MMACELL_PROTO_INTEGER_RANGE,   /* error_offset, found */
    MMACELL_PROTO_PERCENT,         /* error_offset, found */
    MMACELL_PROTO_ERROR_ZERO,
};

struct mmacell_proto_message {
    enum mmacell_proto_kind kind;
    bool flag, servo;
    int32_t number, override;
    size_t axes_len;                      /* 4: robot, 2: platform */
    int32_t axes[MMACELL_PROTO_MAX_AXES]; /* in the last digit: 1 µm, 0.1 mrad (MM-9) */
};

struct mmacell_proto_item {
    uint64_t offset; /* in the stream */
    size_t length;
    struct mmacell_proto_message message; /* its kind may be an error */
    size_t error_offset;                  /* in the line */
    int32_t found;
    const char *expected;
    uint8_t name[3];
};

struct mmacell_proto_decoder {
    enum mmacell_proto_side side;
    struct mmacell_proto_dialect dialect;
    size_t axes_len; /* of the device that the central controller commands; 0: it is not known (MM-27) */
    uint8_t held[MMACELL_PROTO_MAX_LINE];
    size_t length;
    size_t dropped; /* bytes of a line that is too long */
    uint8_t last;   /* the last one of them */
    uint64_t position;
    bool ended;
};

/* Reads the lines of one side. The central controller's may be those to either device (MM-27). */
void mmacell_proto_init(struct mmacell_proto_decoder *decoder, enum mmacell_proto_side side,
                        struct mmacell_proto_dialect dialect);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t mmacell_proto_push(struct mmacell_proto_decoder *decoder, const uint8_t *data, size_t size);

/* The stream has ended. Call `next` until it is false. */
void mmacell_proto_end(struct mmacell_proto_decoder *decoder);

/* The next message or error; false: more bytes are needed. */
bool mmacell_proto_next(struct mmacell_proto_decoder *decoder, struct mmacell_proto_item *item);

/* Writes a message, and returns its length; 0: refused (MM-28), nothing is written. */
size_t mmacell_proto_encode(const struct mmacell_proto_message *message, struct mmacell_proto_dialect dialect,
                            uint8_t *out, size_t size);

/* The digits after the point of an axis: 3 for a length in mm, 4 for an angle in rad. */
unsigned mmacell_proto_decimals(size_t axes_len, size_t axis);

/* A value in mm or rad as a count of its last digit, halves away from zero (MM-11); false: it does not fit. */
bool mmacell_proto_round(double value, unsigned decimals, int32_t *count);

#ifdef __cplusplus
}
#endif

#endif
