/* Lines that return what is sent, as adapters for two wires often do (FM-88, IB-41, LE-113, VV-42 of the reference). */
#ifndef CELLWIRE_LINE_ECHO_H
#define CELLWIRE_LINE_ECHO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The line of a connection. The last frame is in a buffer of the caller's. */
struct line_echo {
    bool returns;      /* the line returns what is sent */
    bool has_collided; /* which was reported */
    uint8_t begun;     /* the frame may have begun with one of the first three bytes that came, a bit for each */
    size_t length;     /* of the last frame, if it is compared or looked for */
    size_t come;       /* bytes since it was sent */
    size_t unread;     /* bytes that were looked at, and will be given again */
};

enum line_echo_kind {
    LINE_ECHO_NONE,
    LINE_ECHO_NOT_SET,   /* length */
    LINE_ECHO_COLLISION, /* offset, expected, found */
};

struct line_echo_error {
    enum line_echo_kind kind;
    size_t length, offset;
    uint8_t expected, found;
};

/* A connection begins. `is_set`: its line is known to return what is sent. */
void line_echo_init(struct line_echo *echo, bool is_set);

/* A frame is sent, and copied to `sent`. `is_proof`: no answer to it begins with the same bytes. */
void line_echo_sent(struct line_echo *echo, uint8_t *sent, const uint8_t *frame, size_t length, bool is_proof);

/* Of bytes that have come: how many of the first ones are not to be read; and what is wrong, once for a frame. */
size_t line_echo_receive(struct line_echo *echo, const uint8_t *sent, const uint8_t *data, size_t size,
                         struct line_echo_error *error);

/* The same of an end that does not always take all bytes; `size` becomes that of the bytes to be taken now. Behind it: line_echo_taken. */
size_t line_echo_begin(struct line_echo *echo, const uint8_t *sent, const uint8_t *data, size_t *size,
                       struct line_echo_error *error);

/* So many of them were taken, and this is how many are returned: the others will be given again. */
size_t line_echo_taken(struct line_echo *echo, size_t size, size_t taken);

#ifdef __cplusplus
}
#endif

#endif
