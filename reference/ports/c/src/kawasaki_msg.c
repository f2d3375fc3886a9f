#include "cellwire/kawasaki_msg.h"

#include "bytes.h"

enum outcome { MORE, MESSAGE, WRONG };

static enum outcome wrong(struct kawasaki_msg_error *error, enum kawasaki_msg_kind kind, size_t offset, size_t expected,
                          size_t found)
{
    *error = (struct kawasaki_msg_error){kind, offset, expected, found};
    return WRONG;
}

static enum outcome more(const struct kawasaki_msg_decoder *decoder, struct kawasaki_msg_error *error)
{
    if (decoder->length == KAWASAKI_MSG_MAX_LEN)
        return wrong(error, KAWASAKI_MSG_TOO_LONG, 0, 0, 0);
    return decoder->ended ? wrong(error, KAWASAKI_MSG_INCOMPLETE, 0, 0, decoder->length) : MORE;
}

/* Where the next `#` is, MESSAGE; another mark, or what is no character, is WRONG. */
static enum outcome find_mark(struct kawasaki_msg_decoder *decoder, struct kawasaki_msg_error *error)
{
    for (; decoder->looked < decoder->length; decoder->looked++) {
        uint8_t byte = decoder->held[decoder->looked];
        if (byte == '#')
            return MESSAGE;
        if (byte == '<' || byte == '>')
            return wrong(error, KAWASAKI_MSG_MARK, decoder->looked, 0, byte);
        if (byte > 0x7F && !decoder->is_latin1)
            return wrong(error, KAWASAKI_MSG_NOT_ASCII, decoder->looked, 0, byte);
    }
    return more(decoder, error);
}

static bool is_blank(uint8_t byte)
{
    return byte == ' ' || byte == '\t' || byte == '\n' || byte == '\f' || byte == '\r';
}

/* A number of KM-17 that is not below 0; false: it is none. */
static bool read_length(struct kawasaki_msg_text text, size_t *length)
{
    int64_t value = 0;
    while (text.length > 0 && is_blank(text.bytes[text.length - 1]))
        text.length--;
    while (text.length > 0 && is_blank(*text.bytes))
        text.bytes++, text.length--;
    bool negative = text.length > 0 && *text.bytes == '-';
    for (size_t i = negative; i < text.length; i++) {
        if (text.bytes[i] < '0' || text.bytes[i] > '9')
            return false;
        value = value * 10 + (text.bytes[i] - '0');
        if (value > INT32_MAX)
            return false;
    }
    *length = (size_t)value;
    return text.length > (size_t)negative && (!negative || value == 0);
}

/* Where the data part begins, which is behind the `#` at `p`, and its length. */
static enum outcome read_header(struct kawasaki_msg_decoder *decoder, size_t p, struct kawasaki_msg_error *error)
{
    const uint8_t *m = decoder->held;
    size_t last = p;
    while (last > 0 && m[last] != '$')
        last--;
    if (last == 0)
        return wrong(error, KAWASAKI_MSG_NO_LENGTH, p, 0, 0);
    struct kawasaki_msg_text digits = {m + last + 1, p - last - 1};
    if (!read_length(digits, &decoder->data_len))
        return wrong(error, KAWASAKI_MSG_NO_LENGTH, last + 1, 0, 0);
    if (m[1] == '$')
        return wrong(error, KAWASAKI_MSG_NO_NAME, 1, 0, 0);
    if (p + 1 + decoder->data_len + 2 > KAWASAKI_MSG_MAX_LEN)
        return wrong(error, KAWASAKI_MSG_TOO_LONG, 1, 0, 0);
    decoder->header_len = last;
    decoder->data_at = decoder->looked = p + 1;
    return MESSAGE;
}

/* The message at the beginning of what is held: section 5.1. What was looked at is not looked at again. */
static enum outcome read_message(struct kawasaki_msg_decoder *decoder, struct kawasaki_msg_item *item,
                                 struct kawasaki_msg_error *error)
{
    const uint8_t *m = decoder->held;
    enum outcome outcome = MESSAGE;
    if (decoder->looked == 0)
        decoder->looked = 1; /* the `<` */
    if (decoder->data_at == 0) {
        outcome = find_mark(decoder, error);
        if (outcome == MESSAGE)
            outcome = read_header(decoder, decoder->looked, error);
    }
    if (outcome == MESSAGE)
        outcome = find_mark(decoder, error);
    if (outcome != MESSAGE)
        return outcome;
    size_t q = decoder->looked, found = q - decoder->data_at, first = 1, last = decoder->header_len;
    if (found != decoder->data_len)
        return wrong(error, KAWASAKI_MSG_LENGTH, decoder->data_at, decoder->data_len, found);
    if (decoder->length == q + 1)
        return more(decoder, error);
    if (m[q + 1] != '>')
        return wrong(error, m[q + 1] == '<' ? KAWASAKI_MSG_MARK : KAWASAKI_MSG_NO_END_MARK, q + 1, 0, m[q + 1]);
    memcpy(item->bytes, m, q + 2);
    while (m[first] != '$')
        first++;
    item->length = q + 2;
    item->name = (struct kawasaki_msg_text){item->bytes + 1, first - 1};
    item->has_header = first < last;
    item->header = (struct kawasaki_msg_text){item->bytes + first + 1, item->has_header ? last - first - 1 : 0};
    item->fields = (struct kawasaki_msg_text){item->bytes + decoder->data_at, found};
    return MESSAGE;
}

/* How many bytes the pending error covers (KM-31); false: its end has not come. Only their number is kept. */
static bool extent(struct kawasaki_msg_decoder *decoder, size_t *covered)
{
    size_t at = decoder->dropped > 0 ? 0 : 1;
    while (at < decoder->length && decoder->held[at] != '<')
        at++;
    if (at >= decoder->length && !decoder->ended) {
        decoder->dropped += decoder->length;
        decoder->length = 0;
        return false;
    }
    *covered = (size_t)decoder->dropped + (at < decoder->length ? at : decoder->length);
    return true;
}

void kawasaki_msg_init(struct kawasaki_msg_decoder *decoder, bool is_latin1)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->is_latin1 = is_latin1;
}

size_t kawasaki_msg_push(struct kawasaki_msg_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void kawasaki_msg_end(struct kawasaki_msg_decoder *decoder) { decoder->ended = true; }

/* What is at the beginning; false: more bytes are needed. */
static bool take(struct kawasaki_msg_decoder *decoder, struct kawasaki_msg_item *item)
{
    item->error = (struct kawasaki_msg_error){KAWASAKI_MSG_MESSAGE, 0, 0, 0};
    if (decoder->length == 0 && !decoder->is_pending)
        return false;
    if (!decoder->is_pending) {
        enum outcome outcome = WRONG;
        if (decoder->held[0] == '<')
            outcome = read_message(decoder, item, &decoder->pending);
        else
            wrong(&decoder->pending, KAWASAKI_MSG_GARBAGE, 0, 0, 0);
        if (outcome == MORE)
            return false;
        decoder->looked = decoder->data_at = 0;
        if (outcome == MESSAGE)
            return true;
        decoder->pending.offset += decoder->position;
        decoder->is_pending = true;
    }
    if (!extent(decoder, &item->length))
        return false;
    item->error = decoder->pending;
    decoder->is_pending = false;
    return true;
}

bool kawasaki_msg_next(struct kawasaki_msg_decoder *decoder, struct kawasaki_msg_item *item)
{
    item->offset = decoder->position;
    if (!take(decoder, item)) {
        decoder->ended = false;
        return false;
    }
    bytes_remove(decoder->held, &decoder->length, item->length - (size_t)decoder->dropped);
    decoder->position += item->length;
    decoder->dropped = 0;
    return true;
}

bool kawasaki_msg_value(const struct kawasaki_msg_text *values, size_t *at, struct kawasaki_msg_text *value)
{
    if (*at > values->length)
        return false;
    size_t end = *at;
    while (end < values->length && values->bytes[end] != '$')
        end++;
    *value = (struct kawasaki_msg_text){values->bytes + *at, end - *at};
    *at = end + 1;
    return true;
}

/* The bytes of values with a `$` between two. */
static size_t joined_len(const struct kawasaki_msg_text *values, size_t count)
{
    size_t length = count > 0 ? count - 1 : 0;
    for (size_t i = 0; i < count; i++)
        length += values[i].length;
    return length;
}

static bool can_be_sent(const struct kawasaki_msg_text *values, size_t count, bool is_latin1)
{
    for (size_t i = 0; i < count; i++)
        for (size_t at = 0; at < values[i].length; at++) {
            uint8_t byte = values[i].bytes[at];
            if (byte == '<' || byte == '>' || byte == '$' || byte == '#' || (byte > 0x7F && !is_latin1))
                return false;
        }
    return true;
}

static size_t put(uint8_t *out, size_t at, const void *bytes, size_t length)
{
    if (length > 0)
        memcpy(out + at, bytes, length);
    return at + length;
}

size_t kawasaki_msg_encode(struct kawasaki_msg_text name, const struct kawasaki_msg_text *header, size_t header_count,
                           const struct kawasaki_msg_text *fields, size_t field_count, bool is_latin1, uint8_t *out,
                           size_t size)
{
    char digits[MAX_DIGITS];
    size_t data_len = joined_len(fields, field_count), at = 0;
    if (data_len > KAWASAKI_MSG_MAX_LEN)
        return 0;
    size_t digits_len = put_decimal(digits, (uint32_t)data_len, 1);
    size_t header_len = header_count > 0 ? 1 + joined_len(header, header_count) : 0;
    size_t length = 1 + name.length + header_len + 1 + digits_len + 1 + data_len + 2;
    if (name.length == 0 || length > KAWASAKI_MSG_MAX_LEN || length > size || !can_be_sent(&name, 1, is_latin1) ||
        !can_be_sent(header, header_count, is_latin1) || !can_be_sent(fields, field_count, is_latin1))
        return 0;
    at = put(out, at, "<", 1);
    at = put(out, at, name.bytes, name.length);
    for (size_t i = 0; i < header_count; i++) {
        at = put(out, at, "$", 1);
        at = put(out, at, header[i].bytes, header[i].length);
    }
    at = put(out, at, "$", 1);
    at = put(out, at, digits, digits_len);
    at = put(out, at, "#", 1);
    for (size_t i = 0; i < field_count; i++) {
        at = put(out, at, "$", i > 0);
        at = put(out, at, fields[i].bytes, fields[i].length);
    }
    return put(out, at, "#>", 2);
}
