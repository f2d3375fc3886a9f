/* val2-viewer: lines with a pose. Clauses VV-… are those of reference/val2-viewer.md. */
#ifndef CELLWIRE_VAL2_VIEWER_H
#define CELLWIRE_VAL2_VIEWER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VAL2_VIEWER_REQUEST 0x05
#define VAL2_VIEWER_XON 0x11
#define VAL2_VIEWER_XOFF 0x13
#define VAL2_VIEWER_MAX_LEN 100 /* VV-7 */
#define VAL2_VIEWER_WORDS 12

struct val2_viewer_pose {
    uint16_t count;
    int16_t words[VAL2_VIEWER_WORDS]; /* VV-9 */
};

enum val2_viewer_kind {
    VAL2_VIEWER_POSE,
    VAL2_VIEWER_FORMAT,   /* error_offset */
    VAL2_VIEWER_NUMBER,   /* error_offset */
    VAL2_VIEWER_CHECKSUM, /* expected, found */
    VAL2_VIEWER_TOO_LONG,
    VAL2_VIEWER_INCOMPLETE,
    VAL2_VIEWER_NOISE,
};

struct val2_viewer_item {
    uint64_t offset; /* in the stream */
    size_t length;
    enum val2_viewer_kind kind;
    struct val2_viewer_pose pose;
    size_t error_offset; /* in the line */
    uint8_t expected, found;
};

struct val2_viewer_decoder {
    uint8_t held[VAL2_VIEWER_MAX_LEN];
    size_t length;
    uint64_t position;
    bool ended;
};

void val2_viewer_init(struct val2_viewer_decoder *decoder);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t val2_viewer_push(struct val2_viewer_decoder *decoder, const uint8_t *data, size_t size);

/* The stream has ended. Call `next` until it is false. */
void val2_viewer_end(struct val2_viewer_decoder *decoder);

/* The next pose or error; false: more bytes are needed. */
bool val2_viewer_next(struct val2_viewer_decoder *decoder, struct val2_viewer_item *item);

/* Writes a line, and returns its length; 0: `size` is too short, nothing is written. */
size_t val2_viewer_encode(const struct val2_viewer_pose *pose, uint8_t *out, size_t size);

#ifdef __cplusplus
}
#endif

#endif
