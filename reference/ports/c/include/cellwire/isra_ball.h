/* isra-ball: packets of the ball. Clauses IB-… are those of reference/isra-ball.md. */
#ifndef CELLWIRE_ISRA_BALL_H
#define CELLWIRE_ISRA_BALL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ISRA_BALL_POLL 0x05
#define ISRA_BALL_PACKET_LEN 12 /* what an encoder writes */
#define ISRA_BALL_MAX_LEN 259   /* IB-8 */

enum isra_ball_status { ISRA_BALL_FRESH, ISRA_BALL_OLD, ISRA_BALL_RESERVED };

struct isra_ball_packet {
    uint8_t sensor_type, sensor; /* 0..=7 each */
    enum isra_ball_status status;
    int8_t force[3], moment[3]; /* X, Y, Z; units of the sensor */
    uint8_t keys;               /* bit k - 1 is key k */
};

enum isra_ball_kind {
    ISRA_BALL_PACKET,
    ISRA_BALL_RAW, /* IB-13: raw_len data bytes */
    ISRA_BALL_NOISE,
    ISRA_BALL_CHECKSUM,   /* error_offset, expected, found */
    ISRA_BALL_INCOMPLETE, /* expected, found */
};

struct isra_ball_item {
    uint64_t offset; /* in the stream */
    size_t length;
    enum isra_ball_kind kind;
    struct isra_ball_packet packet;
    uint8_t raw[255];
    size_t raw_len;
    size_t error_offset; /* from the packet's first byte */
    size_t expected, found;
};

struct isra_ball_decoder {
    uint8_t held[ISRA_BALL_MAX_LEN + 3]; /* IB-16 */
    size_t length;
    uint64_t position;
    bool ended;
};

/* All zero is the beginning, too. */
void isra_ball_init(struct isra_ball_decoder *decoder);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t isra_ball_push(struct isra_ball_decoder *decoder, const uint8_t *data, size_t size);

/* The stream has ended, or the reply was given up (IB-17). Call `next` until it is false. */
void isra_ball_end(struct isra_ball_decoder *decoder);

/* The next packet or error; false: more bytes are needed. */
bool isra_ball_next(struct isra_ball_decoder *decoder, struct isra_ball_item *item);

/* Writes a packet, and returns its length; 0: refused (IB-19), nothing is written. */
size_t isra_ball_encode(const struct isra_ball_packet *packet, uint8_t *out, size_t size);

#ifdef __cplusplus
}
#endif

#endif
