/* kawasaki-msg: messages of a robot and a PC. Clauses KM-… are those of reference/kawasaki-msg.md.
 * This is the envelope of sections 3, 5.1 and 6; what a message means (section 5.2) is the sessions'. */
#ifndef CELLWIRE_KAWASAKI_MSG_H
#define CELLWIRE_KAWASAKI_MSG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define KAWASAKI_MSG_MAX_LEN 4096 /* KM-14 */

/* Characters of a message; not terminated. */
struct kawasaki_msg_text {
    const uint8_t *bytes;
    size_t length;
};

enum kawasaki_msg_kind {
    KAWASAKI_MSG_MESSAGE,
    KAWASAKI_MSG_GARBAGE,   /* item.length */
    KAWASAKI_MSG_MARK,      /* found */
    KAWASAKI_MSG_NOT_ASCII, /* found */
    KAWASAKI_MSG_NO_LENGTH,
    KAWASAKI_MSG_NO_NAME,
    KAWASAKI_MSG_TOO_LONG,    /* the limit is KAWASAKI_MSG_MAX_LEN */
    KAWASAKI_MSG_LENGTH,      /* expected, found */
    KAWASAKI_MSG_NO_END_MARK, /* found */
    KAWASAKI_MSG_INCOMPLETE,  /* found */
};

struct kawasaki_msg_error {
    enum kawasaki_msg_kind kind;
    uint64_t offset; /* in the stream */
    size_t expected, found;
};

struct kawasaki_msg_item {
    uint64_t offset; /* in the stream */
    size_t length;
    struct kawasaki_msg_error error;               /* its kind is KAWASAKI_MSG_MESSAGE if there is none */
    uint8_t bytes[KAWASAKI_MSG_MAX_LEN];           /* the message; the texts are parts of it */
    struct kawasaki_msg_text name, header, fields; /* the values of header and fields have a `$` between them */
    bool has_header;                               /* one empty value, or none */
};

struct kawasaki_msg_decoder {
    bool is_latin1; /* KM-16 */
    uint8_t held[KAWASAKI_MSG_MAX_LEN];
    size_t length;
    size_t looked;                        /* how many bytes of a message were looked at; 0: none */
    size_t header_len, data_at, data_len; /* of a message whose first `#` was found; else `data_at` is 0 */
    uint64_t dropped; /* bytes of the pending error that are no longer held */
    uint64_t position;
    bool ended, is_pending;
    struct kawasaki_msg_error pending; /* its last byte is not known yet */
};

void kawasaki_msg_init(struct kawasaki_msg_decoder *decoder, bool is_latin1);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t kawasaki_msg_push(struct kawasaki_msg_decoder *decoder, const uint8_t *data, size_t size);

/* The stream or the datagram has ended (KM-32). Call `next` until it is false. */
void kawasaki_msg_end(struct kawasaki_msg_decoder *decoder);

/* The next message or error; false: more bytes are needed. */
bool kawasaki_msg_next(struct kawasaki_msg_decoder *decoder, struct kawasaki_msg_item *item);

/* The next value of header or fields, which begins at `*at` (0 at first); false: there is none. */
bool kawasaki_msg_value(const struct kawasaki_msg_text *values, size_t *at, struct kawasaki_msg_text *value);

/* Writes a message, and returns its length; 0: refused (KM-39), nothing is written. */
size_t kawasaki_msg_encode(struct kawasaki_msg_text name, const struct kawasaki_msg_text *header, size_t header_count,
                           const struct kawasaki_msg_text *fields, size_t field_count, bool is_latin1, uint8_t *out,
                           size_t size);

#ifdef __cplusplus
}
#endif

#endif
