/* laser-eb90: frames of the laser. Clauses LE-… are those of reference/laser-eb90.md. */
#ifndef CELLWIRE_LASER_EB90_H
#define CELLWIRE_LASER_EB90_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LASER_EB90_MAX_LEN 1032    /* LE-14 */
#define LASER_EB90_MAX_PAYLOAD 512 /* LE-12 */
#define LASER_EB90_TYPES 4

enum laser_eb90_type { LASER_EB90_F32, LASER_EB90_I16, LASER_EB90_U8, LASER_EB90_CHAR };
enum laser_eb90_tail { LASER_EB90_PRINTED, LASER_EB90_ETX, LASER_EB90_EITHER };
enum laser_eb90_checksum { LASER_EB90_SUM_U8, LASER_EB90_SUM_U16_LE, LASER_EB90_SUM_U16_BE };

/* LE-101 */
struct laser_eb90_profile {
    enum laser_eb90_tail tail;
    bool first_tag; /* `flag = first_tag` */
    uint8_t tags[LASER_EB90_TYPES];
    enum laser_eb90_checksum checksum;
    bool checksum_negated, checksum_with_flag;
    bool big_endian; /* `byte_order = big` */
};

extern const struct laser_eb90_profile LASER_EB90_DEFAULT;

/* Whether the tags are four different ones (LE-16). */
bool laser_eb90_profile_is_valid(const struct laser_eb90_profile *profile);

enum laser_eb90_kind {
    LASER_EB90_FRAME,      /* payload: items, to be read by laser_eb90_item */
    LASER_EB90_NO_HEAD,    /* found: the bytes skipped */
    LASER_EB90_FLAG,       /* error_offset, expected, found */
    LASER_EB90_TAG,        /* error_offset, found */
    LASER_EB90_STUFFING,   /* error_offset, found */
    LASER_EB90_TOO_LONG,   /* error_offset; the limit is LASER_EB90_MAX_PAYLOAD */
    LASER_EB90_BAD_CHECK,  /* error_offset, expected, found; `checksum` */
    LASER_EB90_ITEM,       /* error_offset, expected: the bytes needed, found */
    LASER_EB90_INCOMPLETE, /* found: the bytes held */
};

struct laser_eb90_result {
    uint64_t offset; /* in the stream */
    size_t length;
    enum laser_eb90_kind kind;
    uint8_t payload[LASER_EB90_MAX_PAYLOAD]; /* unstuffed */
    size_t payload_len;
    size_t error_offset, expected, found;
};

struct laser_eb90_decoder {
    struct laser_eb90_profile profile;
    uint8_t held[LASER_EB90_MAX_LEN];
    size_t length;
    uint64_t position;
    bool ended;
};

/* An item within a payload: `count` values of one type. */
struct laser_eb90_item {
    enum laser_eb90_type type;
    uint8_t count;
    const uint8_t *values; /* as on the line */
};

void laser_eb90_init(struct laser_eb90_decoder *decoder, struct laser_eb90_profile profile);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t laser_eb90_push(struct laser_eb90_decoder *decoder, const uint8_t *data, size_t size);

/* The input has ended, or the line is silent (LE-33). Call `next` until it is false. */
void laser_eb90_end(struct laser_eb90_decoder *decoder);

/* The next frame or error; false: more bytes are needed. */
bool laser_eb90_next(struct laser_eb90_decoder *decoder, struct laser_eb90_result *result);

/* The item at `*at` of a payload of `length` bytes, and moves `*at` behind it; false at the end, and where no item is.
 */
bool laser_eb90_item(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t *at,
                     struct laser_eb90_item *item);

float laser_eb90_get_f32(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item, size_t index);
int16_t laser_eb90_get_i16(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item, size_t index);

/* A payload under construction. What does not fit or cannot be written makes it refused. */
struct laser_eb90_payload {
    const struct laser_eb90_profile *profile;
    uint8_t bytes[LASER_EB90_MAX_PAYLOAD];
    size_t length;
    bool is_refused;
};

/* Begins an item of `count` values (up to 255); as many `put` calls of its type follow. */
void laser_eb90_put_item(struct laser_eb90_payload *payload, enum laser_eb90_type type, size_t count);
void laser_eb90_put_f32(struct laser_eb90_payload *payload, float value);
void laser_eb90_put_i16(struct laser_eb90_payload *payload, int16_t value);
void laser_eb90_put_byte(struct laser_eb90_payload *payload, uint8_t value);

/* Writes a frame, and returns its length; 0: refused (LE-36) or `size` is too short, nothing is written. */
size_t laser_eb90_encode(const struct laser_eb90_payload *payload, uint8_t *out, size_t size);

#ifdef __cplusplus
}
#endif

#endif
