#include "cellwire/isra_ball.h"

#include "bytes.h"

#define HEADER_LEN 3
#define HEADER_MASK 0x55
#define DATA_LEN 8

/* Whether the bytes, as far as they are there, begin with a header (IB-5). */
static bool is_header(const uint8_t *at, size_t length)
{
    return (length < 2 || at[1] == (uint8_t)(0x100 - at[0])) && (length < 3 || at[2] == (at[0] ^ HEADER_MASK));
}

/* IB-6 */
static uint8_t checksum(uint8_t n, const uint8_t *data)
{
    unsigned sum = n;
    for (size_t i = 0; i < n; i++)
        sum += data[i];
    return (uint8_t)(0x100 - (sum & 0xFF));
}

/* How many bytes an error covers (IB-15, IB-16); 0: that is not known yet. */
static size_t extent(const struct isra_ball_decoder *decoder)
{
    size_t length = decoder->length;
    size_t covered = 0;
    for (size_t place = 1; place + HEADER_LEN <= length && covered == 0; place++)
        if (is_header(decoder->held + place, HEADER_LEN))
            covered = place;
    if (covered == 0 && (decoder->ended || length >= sizeof decoder->held))
        covered = length;
    return covered < ISRA_BALL_MAX_LEN ? covered : ISRA_BALL_MAX_LEN;
}

static int8_t to_i8(uint8_t byte) { return (int8_t)((byte ^ 0x80) - 0x80); }

/* Section 4.2 */
static void decode_data(const uint8_t *data, uint8_t n, struct isra_ball_item *item)
{
    item->kind = ISRA_BALL_RAW;
    item->raw_len = n;
    memcpy(item->raw, data, n);
    if (n != DATA_LEN)
        return;
    struct isra_ball_packet *packet = &item->packet;
    bool ab1 = data[0] >> 7, ab0 = data[0] >> 3 & 1;
    item->kind = ISRA_BALL_PACKET;
    packet->status = ab0 ? ISRA_BALL_RESERVED : ab1 ? ISRA_BALL_OLD : ISRA_BALL_FRESH;
    packet->sensor_type = data[0] >> 4 & 7;
    packet->sensor = data[0] & 7;
    for (size_t axis = 0; axis < 3; axis++) {
        packet->force[axis] = to_i8(data[1 + axis]);
        packet->moment[axis] = to_i8(data[4 + axis]);
    }
    packet->keys = data[7];
}

void isra_ball_init(struct isra_ball_decoder *decoder) { memset(decoder, 0, sizeof *decoder); }

size_t isra_ball_push(struct isra_ball_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void isra_ball_end(struct isra_ball_decoder *decoder) { decoder->ended = true; }

/* What is at the beginning; false: more bytes are needed. */
static bool take(const struct isra_ball_decoder *decoder, struct isra_ball_item *item)
{
    const uint8_t *held = decoder->held;
    if (decoder->length == 0)
        return false;
    uint8_t n = held[0];
    size_t size = (size_t)n + HEADER_LEN + 1;
    if (!is_header(held, decoder->length)) {
        item->kind = ISRA_BALL_NOISE;
        return (item->length = extent(decoder)) > 0;
    }
    if (decoder->length < size) {
        if (!decoder->ended)
            return false;
        item->kind = ISRA_BALL_INCOMPLETE;
        item->expected = size;
        item->found = item->length = extent(decoder);
        return true;
    }
    item->expected = checksum(n, held + HEADER_LEN);
    item->found = held[size - 1];
    if (item->found == item->expected) {
        decode_data(held + HEADER_LEN, n, item);
        item->length = size;
        return true;
    }
    item->kind = ISRA_BALL_CHECKSUM;
    item->error_offset = size - 1;
    return (item->length = extent(decoder)) > 0;
}

bool isra_ball_next(struct isra_ball_decoder *decoder, struct isra_ball_item *item)
{
    item->offset = decoder->position;
    if (!take(decoder, item)) {
        decoder->ended = false;
        return false;
    }
    bytes_remove(decoder->held, &decoder->length, item->length);
    decoder->position += item->length;
    return true;
}

size_t isra_ball_encode(const struct isra_ball_packet *packet, uint8_t *out, size_t size)
{
    if (packet->sensor_type > 7 || packet->sensor > 7 || size < ISRA_BALL_PACKET_LEN)
        return 0;
    unsigned status = packet->status == ISRA_BALL_OLD ? 0x80 : packet->status == ISRA_BALL_RESERVED ? 0x08 : 0;
    out[0] = DATA_LEN;
    out[1] = 0x100 - DATA_LEN;
    out[2] = DATA_LEN ^ HEADER_MASK;
    out[3] = (uint8_t)(status | (unsigned)packet->sensor_type << 4 | packet->sensor);
    for (size_t axis = 0; axis < 3; axis++) {
        out[4 + axis] = (uint8_t)packet->force[axis];
        out[7 + axis] = (uint8_t)packet->moment[axis];
    }
    out[10] = packet->keys;
    out[11] = checksum(DATA_LEN, out + HEADER_LEN);
    return ISRA_BALL_PACKET_LEN;
}
