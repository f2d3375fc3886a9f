#include "cellwire/val2_alter.h"

#include "bytes.h"

#define DLE 0x10
#define STX 0x02
#define ETX 0x03
#define CONTROLLER_LIMIT 30 /* AL-9 */
#define HOST_LIMIT 14

enum outcome { MORE, MESSAGE, WRONG };

/* What `read_frame` finds: a message of `size` bytes with the checksum `sum`, or an error that `size` bytes show. */
struct reading {
    enum outcome outcome;
    struct val2_alter_message message;
    struct val2_alter_error error; /* its offset counts from the frame's first byte */
    size_t size;
    uint8_t sum;
};

static size_t leading(struct val2_alter_framing framing) { return framing.leading_dle == 1 ? 1 : 2; }

/* AL-7 */
static uint8_t checksum(const uint8_t *data, size_t length, bool negated)
{
    unsigned sum = 0;
    for (size_t i = 0; i < length; i++)
        sum += data[i];
    return (uint8_t)(negated ? 0x100 - (sum & 0xFF) : sum);
}

static void wrong(struct reading *reading, enum val2_alter_kind kind, size_t expected, size_t found)
{
    reading->outcome = WRONG;
    reading->error = (struct val2_alter_error){kind, 0, expected, found};
}

static void get_words(const uint8_t *data, int16_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++)
        words[i] = get_i16_le(data + 2 * i);
}

/* The fields of a message from the controller (AL-29). */
static void decode_controller(const uint8_t *data, size_t length, struct reading *reading)
{
    static const enum val2_alter_kind KINDS[] = {VAL2_ALTER_RUNNING, VAL2_ALTER_START, VAL2_ALTER_INTERRUPTED,
                                                 VAL2_ALTER_END};
    struct val2_alter_message *message = &reading->message;
    if (length == 0) {
        wrong(reading, VAL2_ALTER_LENGTH, 0, 0);
        return;
    }
    message->kind = KINDS[data[0] >> 5 & 3];
    message->marked = data[0] >> 7;
    message->code = data[0] & 7;
    bool is_start = message->kind == VAL2_ALTER_START, is_end = message->kind == VAL2_ALTER_END;
    if ((data[0] & 0x18) != 0 || (!message->marked && !is_start)) {
        wrong(reading, VAL2_ALTER_CONTROL, 0, data[0]);
    } else if (is_start ? length % 2 != 0 : length != 6 && length != 30 && !(is_end && length == 1)) {
        wrong(reading, VAL2_ALTER_LENGTH, 0, length);
    } else if (is_start) {
        message->mode = data[1];
        message->list_len = (uint8_t)(length / 2 - 1);
        get_words(data + 2, message->list, message->list_len);
    } else if (!is_end) {
        message->status = data[1];
        message->segment = get_u16_le(data + 2);
        message->percent = get_u16_le(data + 4);
        message->has_transform = length == 30;
        if (message->has_transform)
            get_words(data + 6, message->transform, VAL2_ALTER_TRANSFORM);
    }
}

/* The fields of a message from the host (AL-29). */
static void decode_host(const uint8_t *data, size_t length, bool ignore_spare_select, struct reading *reading)
{
    struct val2_alter_message *message = &reading->message;
    if (length == 0) {
        wrong(reading, VAL2_ALTER_LENGTH, 0, 0);
        return;
    }
    if (length == 1) {
        message->kind = VAL2_ALTER_START_REPLY;
        message->answer = data[0];
        if (data[0] != 0x00 && data[0] != 0x01 && data[0] != 0xFF)
            wrong(reading, VAL2_ALTER_ANSWER, 0, data[0]);
        return;
    }
    if ((data[1] & 0xC0) != 0 && !ignore_spare_select) {
        wrong(reading, VAL2_ALTER_SELECT, 0, data[1]);
        return;
    }
    message->kind = VAL2_ALTER_REPLY;
    message->exception = data[0];
    message->select = data[1] & 0x3F;
    size_t expected = 2;
    for (size_t axis = 0; axis < VAL2_ALTER_AXES; axis++)
        expected += message->select >> axis & 1 ? 2 : 0;
    if (length != expected) {
        wrong(reading, VAL2_ALTER_REPLY_LENGTH, expected, length);
        return;
    }
    size_t at = 2;
    for (size_t axis = 0; axis < VAL2_ALTER_AXES; axis++) {
        if (message->select >> axis & 1) {
            message->values[axis] = get_i16_le(data + at);
            at += 2;
        }
    }
}

/* AL-25 */
static bool is_named(const struct val2_alter_message *message)
{
    switch (message->kind) {
    case VAL2_ALTER_START:
        return message->code <= 6 && message->mode < 32 && message->marked;
    case VAL2_ALTER_RUNNING:
    case VAL2_ALTER_INTERRUPTED:
        return message->code <= 6 && message->status >= 1 && message->status <= 13;
    case VAL2_ALTER_REPLY:
        return message->exception == 0 || message->exception == 253 || message->exception == 254;
    default:
        return message->code <= 6;
    }
}

/* No byte at `at`, where the frame must go on. */
static struct reading breaks_off(struct reading *reading, size_t length, bool ended)
{
    if (ended)
        wrong(reading, VAL2_ALTER_INCOMPLETE, 0, length);
    reading->size = length;
    return *reading;
}

static struct reading wrong_at(struct reading *reading, enum val2_alter_kind kind, size_t at, size_t expected,
                               uint8_t found)
{
    wrong(reading, kind, expected, found);
    reading->error.offset = at;
    reading->size = at;
    return *reading;
}

/* The frame whose start mark is at the beginning of `frame`. */
static struct reading read_frame(const struct val2_alter_decoder *decoder, const uint8_t *frame, size_t length,
                                 bool ended)
{
    struct reading reading = {.outcome = MORE};
    uint8_t data[CONTROLLER_LIMIT];
    size_t limit = decoder->side == VAL2_ALTER_CONTROLLER ? CONTROLLER_LIMIT : HOST_LIMIT;
    size_t count = 0, at = 0;
    while (at < length && frame[at] == DLE)
        at++;
    at++; /* STX; no byte, as below, where it is cut off */
    for (;;) {
        bool is_dle = at < length && frame[at] == DLE;
        if (at + is_dle >= length)
            return breaks_off(&reading, length, ended);
        if (is_dle && frame[at + 1] == ETX)
            break;
        if (is_dle && frame[at + 1] != DLE)
            return wrong_at(&reading, VAL2_ALTER_END_MARK, at + 1, 0, frame[at + 1]);
        if (count == limit) {
            wrong(&reading, VAL2_ALTER_TOO_LONG, 0, limit);
            reading.size = limit;
            return reading;
        }
        data[count++] = frame[at];
        at += is_dle ? 2 : 1;
    }
    at += 2;
    if (at >= length)
        return breaks_off(&reading, length, ended);
    reading.sum = frame[at];
    uint8_t expected = checksum(data, count, decoder->framing.negated_sum);
    if (reading.sum != expected)
        return wrong_at(&reading, VAL2_ALTER_CHECKSUM, at, expected, reading.sum);
    at++;
    if (decoder->framing.stuffed_checksum && reading.sum == DLE) {
        if (at >= length)
            return breaks_off(&reading, length, ended);
        if (frame[at] != DLE)
            return wrong_at(&reading, VAL2_ALTER_END_MARK, at, 0, frame[at]);
        at++;
    }
    reading.size = at;
    reading.outcome = MESSAGE;
    if (decoder->side == VAL2_ALTER_CONTROLLER)
        decode_controller(data, count, &reading);
    else
        decode_host(data, count, decoder->framing.ignore_spare_select, &reading);
    if (reading.outcome == MESSAGE && decoder->read_before > 0 && !is_named(&reading.message))
        wrong(&reading, VAL2_ALTER_LENGTH, 0, count);
    return reading;
}

static void remove_bytes(struct val2_alter_decoder *decoder, size_t count)
{
    bytes_remove(decoder->held, &decoder->length, count);
    decoder->read_before -= count < decoder->read_before ? count : decoder->read_before;
}

static void skip(struct val2_alter_decoder *decoder, size_t count)
{
    if (count == 0)
        return;
    decoder->skipped += decoder->spare + count - decoder->lent;
    decoder->spare = 0;
    decoder->lent = false;
    remove_bytes(decoder, count);
}

/* DLEs at the beginning that are more than a start mark needs. */
static void remove_spare(struct val2_alter_decoder *decoder, size_t run)
{
    size_t needed = leading(decoder->framing);
    if (run <= needed)
        return;
    decoder->spare += run - needed - decoder->lent;
    decoder->lent = false;
    remove_bytes(decoder, run - needed);
}

/* Removes what cannot belong to a start mark; true: `held` begins with one. */
static bool seek(struct val2_alter_decoder *decoder)
{
    for (;;) {
        size_t start = 0, run = 0;
        while (start < decoder->length && decoder->held[start] != DLE)
            start++;
        skip(decoder, start);
        while (run < decoder->length && decoder->held[run] == DLE)
            run++;
        bool is_last = run == decoder->length;
        if (!is_last && decoder->held[run] == STX && run >= leading(decoder->framing)) {
            remove_spare(decoder, run);
            return true;
        }
        if (is_last && !decoder->ended) {
            remove_spare(decoder, run);
            return false;
        }
        skip(decoder, run);
        if (is_last)
            return false;
    }
}

/* Whether what is held is a second reading, and wrong within the bytes that were read before (AL-84). */
static bool is_wrong_again(const struct val2_alter_decoder *decoder)
{
    return decoder->has_error && read_frame(decoder, decoder->held, decoder->read_before, false).outcome == WRONG;
}

static void give_error(struct val2_alter_decoder *decoder, struct val2_alter_item *item)
{
    item->offset = decoder->position;
    item->length = decoder->skipped;
    item->is_error = true;
    item->error = decoder->error;
    if (!decoder->has_error)
        item->error = (struct val2_alter_error){VAL2_ALTER_START_MARK, decoder->position, 0, decoder->skipped};
    decoder->has_error = false;
    decoder->position += decoder->skipped;
    decoder->skipped = 0;
}

static void give_message(struct val2_alter_decoder *decoder, const struct reading *reading,
                         struct val2_alter_item *item)
{
    item->offset = decoder->position;
    item->length = decoder->spare + reading->size - decoder->lent;
    item->is_error = false;
    item->message = reading->message;
    decoder->spare = 0;
    decoder->lent = false;
    remove_bytes(decoder, reading->size);
    if (!decoder->framing.stuffed_checksum && reading->sum == DLE) {
        memmove(decoder->held + 1, decoder->held, decoder->length);
        decoder->held[0] = DLE;
        decoder->length++;
        decoder->lent = true;
        decoder->read_before = 1; /* a message ends behind what was read before */
    }
    decoder->position += item->length;
}

void val2_alter_init(struct val2_alter_decoder *decoder, enum val2_alter_side side, struct val2_alter_framing framing)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->side = side;
    decoder->framing = framing;
}

size_t val2_alter_push(struct val2_alter_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void val2_alter_end(struct val2_alter_decoder *decoder) { decoder->ended = true; }

size_t val2_alter_pending(const struct val2_alter_decoder *decoder)
{
    return decoder->skipped + decoder->spare + decoder->length - decoder->lent;
}

void val2_alter_clear(struct val2_alter_decoder *decoder)
{
    decoder->position += val2_alter_pending(decoder);
    decoder->length = decoder->read_before = decoder->spare = decoder->skipped = 0;
    decoder->ended = decoder->lent = decoder->has_error = false;
}

bool val2_alter_next(struct val2_alter_decoder *decoder, struct val2_alter_item *item)
{
    for (;;) {
        bool at_mark = seek(decoder);
        if (at_mark && is_wrong_again(decoder)) {
            skip(decoder, 1);
            continue;
        }
        if ((at_mark || decoder->ended) && decoder->skipped > 0) {
            give_error(decoder, item);
            return true;
        }
        if (!at_mark) {
            decoder->ended = false;
            return false;
        }
        struct reading reading = read_frame(decoder, decoder->held, decoder->length, decoder->ended);
        if (reading.outcome == MORE)
            return false;
        if (reading.outcome == MESSAGE) {
            give_message(decoder, &reading, item);
            return true;
        }
        decoder->error = reading.error;
        decoder->error.offset += decoder->position + decoder->spare - decoder->lent;
        decoder->has_error = true;
        decoder->failures++;
        if (decoder->read_before < reading.size)
            decoder->read_before = reading.size;
        skip(decoder, 1);
    }
}

static size_t put_words(uint8_t *data, const int16_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put_u16_le(data + 2 * i, (uint16_t)words[i]);
    return 2 * count;
}

/* The data bytes; 0: refused. */
static size_t encode_data(const struct val2_alter_message *message, uint8_t *data)
{
    size_t length = 2;
    if (message->code > 7)
        return 0;
    switch (message->kind) {
    case VAL2_ALTER_START:
        if (message->list_len > VAL2_ALTER_MAX_LIST)
            return 0;
        data[0] = (uint8_t)(0xA0 | message->code);
        data[1] = message->mode;
        return 2 + put_words(data + 2, message->list, message->list_len);
    case VAL2_ALTER_RUNNING:
    case VAL2_ALTER_INTERRUPTED:
        data[0] = (uint8_t)((message->kind == VAL2_ALTER_RUNNING ? 0x80 : 0xC0) | message->code);
        data[1] = message->status;
        put_u16_le(data + 2, message->segment);
        put_u16_le(data + 4, message->percent);
        return 6 + (message->has_transform ? put_words(data + 6, message->transform, VAL2_ALTER_TRANSFORM) : 0);
    case VAL2_ALTER_END:
        data[0] = (uint8_t)(0xE0 | message->code);
        return 1;
    case VAL2_ALTER_START_REPLY:
        data[0] = message->answer;
        return message->answer == 0x00 || message->answer == 0x01 || message->answer == 0xFF;
    case VAL2_ALTER_REPLY:
        if (message->select > 0x3F)
            return 0;
        data[0] = message->exception;
        data[1] = message->select;
        for (size_t axis = 0; axis < VAL2_ALTER_AXES; axis++)
            if (message->select >> axis & 1)
                length += put_words(data + length, message->values + axis, 1);
        return length;
    default:
        return 0;
    }
}

size_t val2_alter_encode(const struct val2_alter_message *message, struct val2_alter_framing framing, uint8_t *out,
                         size_t size)
{
    uint8_t data[CONTROLLER_LIMIT], frame[VAL2_ALTER_MAX_LEN];
    size_t count = encode_data(message, data), length = 0;
    if (count == 0)
        return 0;
    while (length < leading(framing))
        frame[length++] = DLE;
    frame[length++] = STX;
    for (size_t i = 0; i < count; i++) {
        frame[length++] = data[i];
        if (data[i] == DLE)
            frame[length++] = DLE;
    }
    frame[length++] = DLE;
    frame[length++] = ETX;
    frame[length++] = checksum(data, count, framing.negated_sum);
    if (framing.stuffed_checksum && frame[length - 1] == DLE)
        frame[length++] = DLE;
    if (length > size)
        return 0;
    memcpy(out, frame, length);
    return length;
}
