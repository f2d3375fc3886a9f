#include "cellwire/val2_viewer.h"

#include "bytes.h"

static const char HEAD[] = "$POSE,";
static const char HEX[] = "0123456789ABCDEF";

/* A line that is read from left to right (VV-12); `error` is the first failure. It ends with LF, so that reading stops there. */
struct line {
    const uint8_t *bytes;
    size_t at;
    enum val2_viewer_kind error; /* VAL2_VIEWER_POSE: none */
    size_t error_offset;
};

static bool fail(struct line *line, enum val2_viewer_kind error, size_t offset)
{
    line->error = error;
    line->error_offset = offset;
    return false;
}

static bool expect(struct line *line, const char *expected)
{
    for (; *expected != '\0'; expected++, line->at++)
        if (line->bytes[line->at] != (uint8_t)*expected)
            return fail(line, VAL2_VIEWER_FORMAT, line->at);
    return true;
}

/* A number in its one form (VV-5). */
static bool number(struct line *line, int32_t low, int32_t high, int32_t *value)
{
    const uint8_t *bytes = line->bytes;
    size_t begin = line->at;
    bool negative = bytes[begin] == '-';
    size_t digits = begin + negative;
    *value = 0;
    for (line->at = digits; bytes[line->at] >= '0' && bytes[line->at] <= '9'; line->at++)
        if (line->at - digits < 5)
            *value = *value * 10 + (bytes[line->at] - '0');
    size_t count = line->at - digits;
    bool one_form = count >= 1 && count <= 5 && (bytes[digits] != '0' || (count == 1 && !negative));
    if (negative)
        *value = -*value;
    return (one_form && *value >= low && *value <= high) || fail(line, VAL2_VIEWER_NUMBER, begin);
}

static bool hex_digits(struct line *line, uint8_t *value)
{
    *value = 0;
    for (int i = 0; i < 2; i++, line->at++) {
        const char *digit = memchr(HEX, line->bytes[line->at], sizeof HEX - 1);
        if (digit == NULL)
            return fail(line, VAL2_VIEWER_FORMAT, line->at);
        *value = (uint8_t)(*value << 4 | (uint8_t)(digit - HEX));
    }
    return true;
}

/* The XOR of the bytes after `$`, up to `end`. */
static uint8_t checksum(const uint8_t *line, size_t end)
{
    uint8_t sum = 0;
    for (size_t i = 1; i < end; i++)
        sum ^= line[i];
    return sum;
}

static void decode_line(struct line *line, struct val2_viewer_item *item)
{
    int32_t value;
    if (!expect(line, HEAD) || !number(line, 0, UINT16_MAX, &value))
        return;
    item->pose.count = (uint16_t)value;
    for (size_t word = 0; word < VAL2_VIEWER_WORDS; word++) {
        if (!expect(line, ",") || !number(line, INT16_MIN, INT16_MAX, &value))
            return;
        item->pose.words[word] = (int16_t)value;
    }
    item->expected = checksum(line->bytes, line->at);
    if (!expect(line, "*") || !hex_digits(line, &item->found))
        return;
    if (item->found != item->expected)
        fail(line, VAL2_VIEWER_CHECKSUM, 0);
    else
        expect(line, "\r\n");
}

void val2_viewer_init(struct val2_viewer_decoder *decoder) { memset(decoder, 0, sizeof *decoder); }

size_t val2_viewer_push(struct val2_viewer_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void val2_viewer_end(struct val2_viewer_decoder *decoder) { decoder->ended = true; }

/* What is at the beginning; false: more bytes are needed. */
static bool take(const struct val2_viewer_decoder *decoder, struct val2_viewer_item *item)
{
    const uint8_t *held = decoder->held;
    size_t length = decoder->length, stop = 0;
    if (length == 0)
        return false;
    bool begins = held[0] == '$';
    while (stop < length && held[stop] != '\n' && (held[stop] != '$' || stop == 0))
        stop++;
    if (stop < length && held[stop] == '\n') {
        struct line line = {held, 0, VAL2_VIEWER_POSE, 0};
        decode_line(&line, item);
        item->kind = line.error;
        item->error_offset = line.error_offset;
        item->length = stop + 1;
        return true;
    }
    bool is_full = stop == VAL2_VIEWER_MAX_LEN;
    if (stop == length && !is_full && !decoder->ended)
        return false;
    item->kind = !begins ? VAL2_VIEWER_NOISE : is_full ? VAL2_VIEWER_TOO_LONG : VAL2_VIEWER_INCOMPLETE;
    item->length = stop;
    return true;
}

bool val2_viewer_next(struct val2_viewer_decoder *decoder, struct val2_viewer_item *item)
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

size_t val2_viewer_encode(const struct val2_viewer_pose *pose, uint8_t *out, size_t size)
{
    char line[VAL2_VIEWER_MAX_LEN];
    size_t length = sizeof HEAD - 1;
    memcpy(line, HEAD, length);
    length += put_decimal(line + length, pose->count, 1);
    for (size_t word = 0; word < VAL2_VIEWER_WORDS; word++) {
        int32_t value = pose->words[word];
        line[length++] = ',';
        if (value < 0)
            line[length++] = '-';
        length += put_decimal(line + length, (uint32_t)(value < 0 ? -value : value), 1);
    }
    unsigned sum = checksum((const uint8_t *)line, length);
    line[length++] = '*';
    line[length++] = HEX[sum >> 4];
    line[length++] = HEX[sum & 0xF];
    line[length++] = '\r';
    line[length++] = '\n';
    if (length > size)
        return 0;
    memcpy(out, line, length);
    return length;
}
