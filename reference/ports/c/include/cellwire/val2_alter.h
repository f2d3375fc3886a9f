/* val2-alter: frames of ALTER. Clauses AL-… are those of reference/val2-alter.md. */
#ifndef CELLWIRE_VAL2_ALTER_H
#define CELLWIRE_VAL2_ALTER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VAL2_ALTER_MAX_LEN 67 /* AL-11 */
#define VAL2_ALTER_AXES 6
#define VAL2_ALTER_TRANSFORM 12
#define VAL2_ALTER_MAX_LIST 14
#define VAL2_ALTER_EVENTS 16 /* that wait at an end; of more, the oldest notice is dropped (AL-96) */

enum val2_alter_side { VAL2_ALTER_CONTROLLER, VAL2_ALTER_HOST };

/* The settings of section 3. */
struct val2_alter_framing {
    uint8_t leading_dle; /* 1 or 2; 0 counts as 2 */
    bool negated_sum, stuffed_checksum, ignore_spare_select;
};

enum val2_alter_kind {
    /* messages */
    VAL2_ALTER_START,       /* code, marked, mode, list */
    VAL2_ALTER_RUNNING,     /* code, status, segment, percent, transform */
    VAL2_ALTER_INTERRUPTED, /* the same */
    VAL2_ALTER_END,         /* code */
    VAL2_ALTER_START_REPLY, /* answer: 00h accept, 01h repeat, FFh refuse */
    VAL2_ALTER_REPLY,       /* exception, select, values */
    /* errors; all have error_offset */
    VAL2_ALTER_START_MARK,
    VAL2_ALTER_END_MARK,     /* found */
    VAL2_ALTER_CHECKSUM,     /* expected, found */
    VAL2_ALTER_TOO_LONG,     /* found: the limit */
    VAL2_ALTER_INCOMPLETE,   /* found: the bytes that are there */
    VAL2_ALTER_CONTROL,      /* found */
    VAL2_ALTER_LENGTH,       /* found */
    VAL2_ALTER_ANSWER,       /* found; `start_reply` */
    VAL2_ALTER_SELECT,       /* found */
    VAL2_ALTER_REPLY_LENGTH, /* expected, found */
};

struct val2_alter_message {
    enum val2_alter_kind kind;
    uint8_t code; /* error code, 0..=7 */
    bool marked;  /* bit 7 of a start message (AL-13); it is always written */
    uint8_t mode, list_len;
    int16_t list[VAL2_ALTER_MAX_LIST];
    uint8_t status;
    uint16_t segment, percent;
    bool has_transform;
    int16_t transform[VAL2_ALTER_TRANSFORM];
    uint8_t answer;
    uint8_t exception, select;
    int16_t values[VAL2_ALTER_AXES]; /* those whose bit of `select` is set */
};

struct val2_alter_error {
    enum val2_alter_kind kind;
    uint64_t offset; /* in the stream */
    size_t expected, found;
};

struct val2_alter_item {
    uint64_t offset; /* in the stream */
    size_t length;
    bool is_error;
    struct val2_alter_message message;
    struct val2_alter_error error;
};

/* The names are those of the pseudocode of section 5. */
struct val2_alter_decoder {
    enum val2_alter_side side;
    struct val2_alter_framing framing;
    uint8_t held[2 * VAL2_ALTER_MAX_LEN];
    size_t length;
    uint64_t position;
    bool ended, lent, has_error;
    size_t read_before, spare, skipped;
    struct val2_alter_error error;
    unsigned failures; /* how often a frame was found corrupt (AL-38) */
};

/* Reads the bytes of one side. */
void val2_alter_init(struct val2_alter_decoder *decoder, enum val2_alter_side side, struct val2_alter_framing framing);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t val2_alter_push(struct val2_alter_decoder *decoder, const uint8_t *data, size_t size);

/* The stream has ended, or the line was silent for longer than `gap` (AL-36). Call `next` until it is false. */
void val2_alter_end(struct val2_alter_decoder *decoder);

/* The next message or error; false: more bytes are needed. */
bool val2_alter_next(struct val2_alter_decoder *decoder, struct val2_alter_item *item);

/* How many bytes belong to no item yet (AL-52). */
size_t val2_alter_pending(const struct val2_alter_decoder *decoder);

/* Forgets what belongs to no item yet; offsets count on. */
void val2_alter_clear(struct val2_alter_decoder *decoder);

/* Writes a message, and returns its length; 0: refused (AL-40), nothing is written. */
size_t val2_alter_encode(const struct val2_alter_message *message, struct val2_alter_framing framing, uint8_t *out,
                         size_t size);

#ifdef __cplusplus
}
#endif

#endif
