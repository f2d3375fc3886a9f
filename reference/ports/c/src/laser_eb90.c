#include "cellwire/laser_eb90.h"

#include <math.h>

#include "bytes.h"

#define HEAD_LEN 3
#define FLAG 0xF0
#define MARK 0x90

static const uint8_t HEAD[HEAD_LEN] = {0xEB, 0x90, 0x82};
static const uint8_t SIZES[LASER_EB90_TYPES] = {4, 2, 1, 1};

const struct laser_eb90_profile LASER_EB90_DEFAULT = {.tags = {0xF0, 0xF1, 0xF2, 0xF3}};

static size_t sum_size(const struct laser_eb90_profile *profile)
{
    return profile->checksum == LASER_EB90_SUM_U8 ? 1 : 2;
}

/* LE-13 */
static uint16_t check_of(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length)
{
    uint32_t sum = profile->checksum_with_flag && !profile->first_tag ? FLAG : 0;
    for (size_t i = 0; i < length; i++)
        sum += payload[i];
    if (profile->checksum_negated)
        sum = UINT32_MAX - sum + 1;
    return (uint16_t)(sum & (profile->checksum == LASER_EB90_SUM_U8 ? 0xFF : 0xFFFF));
}

static bool find_type(const struct laser_eb90_profile *profile, uint8_t tag, enum laser_eb90_type *type)
{
    for (int i = 0; i < LASER_EB90_TYPES; i++) {
        if (profile->tags[i] == tag) {
            *type = (enum laser_eb90_type)i;
            return true;
        }
    }
    return false;
}

bool laser_eb90_profile_is_valid(const struct laser_eb90_profile *profile)
{
    for (int i = 0; i < LASER_EB90_TYPES; i++) {
        enum laser_eb90_type first;
        if (find_type(profile, profile->tags[i], &first) && first != (enum laser_eb90_type)i)
            return false;
    }
    return true;
}

static bool is_tail(const struct laser_eb90_profile *profile, uint8_t byte)
{
    return (byte == 0x82 && profile->tail != LASER_EB90_ETX) || (byte == 0x83 && profile->tail != LASER_EB90_PRINTED);
}

/* Where the first head is, whole or cut off by the end; `length`: nowhere. */
static size_t find_head(const uint8_t *data, size_t length)
{
    for (size_t at = 0; at < length; at++) {
        size_t left = length - at;
        if (memcmp(data + at, HEAD, left < HEAD_LEN ? left : HEAD_LEN) == 0)
            return at;
    }
    return length;
}

/* An error that `examined` bytes show (LE-30). */
static bool fail(const uint8_t *held, struct laser_eb90_result *result, enum laser_eb90_kind kind, size_t offset,
                 size_t examined)
{
    result->kind = kind;
    result->error_offset = offset;
    result->length = 1 + find_head(held + 1, examined - 1);
    return true;
}

static bool incomplete(const struct laser_eb90_decoder *decoder, struct laser_eb90_result *result)
{
    result->kind = LASER_EB90_INCOMPLETE;
    result->found = result->length = decoder->length;
    return decoder->ended && decoder->length > 0;
}

/* Bytes before the first head (LE-32). */
static bool take_no_head(const struct laser_eb90_decoder *decoder, struct laser_eb90_result *result)
{
    size_t begin = find_head(decoder->held, decoder->length);
    if (begin > LASER_EB90_MAX_PAYLOAD)
        begin = LASER_EB90_MAX_PAYLOAD;
    bool is_whole = decoder->length - begin >= HEAD_LEN;
    if (!is_whole && begin < LASER_EB90_MAX_PAYLOAD)
        return incomplete(decoder, result);
    result->kind = LASER_EB90_NO_HEAD;
    result->found = result->length = begin;
    return true;
}

/* The items of a whole frame of `end` bytes. */
static bool check_items(const struct laser_eb90_decoder *decoder, struct laser_eb90_result *result, size_t end)
{
    size_t i = 0;
    while (i < result->payload_len) {
        enum laser_eb90_type type;
        size_t left = result->payload_len - i;
        result->found = result->payload[i];
        if (!find_type(&decoder->profile, result->payload[i], &type))
            return fail(decoder->held, result, LASER_EB90_TAG, i, end);
        size_t needed = 2 + (left == 1 ? 0 : (size_t)result->payload[i + 1] * SIZES[type]);
        result->expected = needed;
        result->found = left;
        if (left < needed)
            return fail(decoder->held, result, LASER_EB90_ITEM, i, end);
        i += needed;
    }
    result->kind = LASER_EB90_FRAME;
    result->length = end;
    return true;
}

/* The frame or error at the beginning of what is held; false: more bytes are needed. */
static bool take(const struct laser_eb90_decoder *decoder, struct laser_eb90_result *result)
{
    const struct laser_eb90_profile *profile = &decoder->profile;
    const uint8_t *held = decoder->held;
    size_t length = decoder->length, p = HEAD_LEN;
    enum laser_eb90_type type;
    if (length < HEAD_LEN || memcmp(held, HEAD, HEAD_LEN) != 0)
        return take_no_head(decoder, result);
    if (!profile->first_tag) {
        if (length <= p)
            return incomplete(decoder, result);
        result->expected = FLAG;
        result->found = held[p];
        if (held[p] != FLAG)
            return fail(held, result, LASER_EB90_FLAG, p, 4);
        p++;
    }
    if (length <= p)
        return incomplete(decoder, result);
    result->found = held[p];
    if (!find_type(profile, held[p], &type))
        return fail(held, result, LASER_EB90_TAG, 0, p + 1);
    result->payload_len = 0;
    for (;;) {
        size_t last = p;
        if (p < length && held[p] == MARK)
            last++;
        if (last >= length)
            return incomplete(decoder, result);
        result->found = held[last];
        if (last > p && held[last] != MARK) {
            if (is_tail(profile, held[last]))
                break;
            return fail(held, result, LASER_EB90_STUFFING, last, last + 1);
        }
        if (result->payload_len == LASER_EB90_MAX_PAYLOAD)
            return fail(held, result, LASER_EB90_TOO_LONG, last, last + 1);
        result->payload[result->payload_len++] = held[p];
        p = last + 1;
    }
    size_t check_at = p + 2, end = check_at + sum_size(profile);
    if (length < end)
        return incomplete(decoder, result);
    bool is_big = profile->checksum == LASER_EB90_SUM_U16_BE;
    result->found = end - check_at == 1 ? held[check_at]
                    : is_big            ? get_u16_be(held + check_at)
                                        : get_u16_le(held + check_at);
    result->expected = check_of(profile, result->payload, result->payload_len);
    if (result->found != result->expected)
        return fail(held, result, LASER_EB90_BAD_CHECK, check_at, end);
    return check_items(decoder, result, end);
}

void laser_eb90_init(struct laser_eb90_decoder *decoder, struct laser_eb90_profile profile)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->profile = profile;
}

size_t laser_eb90_push(struct laser_eb90_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void laser_eb90_end(struct laser_eb90_decoder *decoder) { decoder->ended = true; }

bool laser_eb90_next(struct laser_eb90_decoder *decoder, struct laser_eb90_result *result)
{
    result->offset = decoder->position;
    if (!take(decoder, result)) {
        decoder->ended = false;
        return false;
    }
    bytes_remove(decoder->held, &decoder->length, result->length);
    decoder->position += result->length;
    return true;
}

bool laser_eb90_item(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t *at,
                     struct laser_eb90_item *item)
{
    if (length - *at < 2 || !find_type(profile, payload[*at], &item->type))
        return false;
    item->count = payload[*at + 1];
    item->values = payload + *at + 2;
    size_t size = 2 + (size_t)item->count * SIZES[item->type];
    if (length - *at < size)
        return false;
    *at += size;
    return true;
}

float laser_eb90_get_f32(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item, size_t index)
{
    uint32_t bits = 0;
    float value;
    for (size_t i = 0; i < 4; i++)
        bits = bits << 8 | item->values[4 * index + (profile->big_endian ? i : 3 - i)];
    memcpy(&value, &bits, sizeof value);
    return value;
}

int16_t laser_eb90_get_i16(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item, size_t index)
{
    const uint8_t *at = item->values + 2 * index;
    return to_i16(profile->big_endian ? get_u16_be(at) : get_u16_le(at));
}

void laser_eb90_put_byte(struct laser_eb90_payload *payload, uint8_t value)
{
    if (payload->length == sizeof payload->bytes)
        payload->is_refused = true;
    else
        payload->bytes[payload->length++] = value;
}

void laser_eb90_put_item(struct laser_eb90_payload *payload, enum laser_eb90_type type, size_t count)
{
    payload->is_refused |= count > 255;
    laser_eb90_put_byte(payload, payload->profile->tags[type]);
    laser_eb90_put_byte(payload, (uint8_t)count);
}

void laser_eb90_put_f32(struct laser_eb90_payload *payload, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    payload->is_refused |= !isfinite(value);
    for (unsigned i = 0; i < 4; i++)
        laser_eb90_put_byte(payload, (uint8_t)(bits >> 8 * (payload->profile->big_endian ? 3 - i : i)));
}

void laser_eb90_put_i16(struct laser_eb90_payload *payload, int16_t value)
{
    uint8_t low = (uint8_t)((uint16_t)value & 0xFF), high = (uint8_t)((uint16_t)value >> 8);
    laser_eb90_put_byte(payload, payload->profile->big_endian ? high : low);
    laser_eb90_put_byte(payload, payload->profile->big_endian ? low : high);
}

size_t laser_eb90_encode(const struct laser_eb90_payload *payload, uint8_t *out, size_t size)
{
    const struct laser_eb90_profile *profile = payload->profile;
    size_t length = HEAD_LEN + (profile->first_tag ? 0u : 1u) + payload->length + 2 + sum_size(profile), at = HEAD_LEN;
    for (size_t i = 0; i < payload->length; i++)
        length += payload->bytes[i] == MARK;
    if (payload->is_refused || payload->length == 0 || length > size)
        return 0;
    memcpy(out, HEAD, HEAD_LEN);
    if (!profile->first_tag)
        out[at++] = FLAG;
    for (size_t i = 0; i < payload->length; i++) {
        out[at++] = payload->bytes[i];
        if (payload->bytes[i] == MARK)
            out[at++] = MARK;
    }
    out[at++] = MARK;
    out[at++] = profile->tail == LASER_EB90_ETX ? 0x83 : 0x82;
    uint16_t check = check_of(profile, payload->bytes, payload->length);
    if (profile->checksum == LASER_EB90_SUM_U16_BE)
        out[at++] = (uint8_t)(check >> 8);
    out[at++] = (uint8_t)(check & 0xFF);
    if (profile->checksum == LASER_EB90_SUM_U16_LE)
        out[at] = (uint8_t)(check >> 8);
    return length;
}
