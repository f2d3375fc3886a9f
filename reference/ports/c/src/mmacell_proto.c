#include "cellwire/mmacell_proto.h"

#include <math.h>

#include "bytes.h"

#define MAX_COORDINATE 999999
#define ROBOT_AXES 4
#define PLATFORM_AXES 2
#define ROBOT_CHARACTERS 32 /* MM-27 */
#define CONTENT_SIZE 128

/* A line that is read from left to right (MM-25); the first failure is in `item`. Behind its content stands its end. */
struct line {
    const uint8_t *content;
    size_t length, at;
    struct mmacell_proto_dialect dialect;
    size_t axes_len;
    struct mmacell_proto_item *item;
};

static bool fail(struct line *line, enum mmacell_proto_kind kind, size_t offset, int32_t found, const char *expected)
{
    line->item->message.kind = kind;
    line->item->error_offset = offset;
    line->item->found = found;
    line->item->expected = expected;
    return false;
}

static bool character(struct line *line, const char *allowed, const char *expected, char *found)
{
    if (line->at >= line->length)
        return fail(line, MMACELL_PROTO_SHORT, line->length, 0, expected);
    uint8_t byte = line->content[line->at];
    if (byte == 0 || strchr(allowed, byte) == NULL)
        return fail(line, MMACELL_PROTO_UNEXPECTED, line->at, byte, expected);
    *found = (char)byte;
    line->at++;
    return true;
}

static bool digits(struct line *line, unsigned count, int32_t *value)
{
    char digit;
    for (unsigned i = 0; i < count; i++) {
        if (!character(line, "0123456789", "digit", &digit))
            return false;
        *value = *value * 10 + (digit - '0');
    }
    return true;
}

static bool flag(struct line *line, bool *value)
{
    char found;
    if (!character(line, "TF", "true_or_false", &found))
        return false;
    *value = found == 'T';
    return true;
}

static bool fits_integer(int32_t value, const struct mmacell_proto_dialect *dialect)
{
    return dialect->wide_integers ? value >= -99999 && value <= 99999 : value >= INT16_MIN && value <= INT16_MAX;
}

static bool integer(struct line *line, int32_t *value)
{
    size_t begin = line->at;
    char sign;
    if (!character(line, "+-", "sign", &sign))
        return false;
    if (line->dialect.blank && line->content[line->at] == ' ')
        line->at++;
    if (!digits(line, 5, value))
        return false;
    if (sign == '-')
        *value = -*value;
    return fits_integer(*value, &line->dialect) || fail(line, MMACELL_PROTO_INTEGER_RANGE, begin, *value, NULL);
}

static bool percent(struct line *line, int32_t *value)
{
    size_t begin = line->at;
    if (!integer(line, value))
        return false;
    return (*value >= 0 && *value <= 100) || fail(line, MMACELL_PROTO_PERCENT, begin, *value, NULL);
}

static bool coordinates(struct line *line, size_t axes_len)
{
    struct mmacell_proto_message *message = &line->item->message;
    message->axes_len = axes_len;
    for (size_t axis = 0; axis < axes_len; axis++) {
        unsigned decimals = mmacell_proto_decimals(axes_len, axis);
        int32_t count = 0;
        char sign, point;
        if (!character(line, "+-", "sign", &sign) || !digits(line, 6 - decimals, &count) ||
            !character(line, ".", "point", &point) || !digits(line, decimals, &count))
            return false;
        message->axes[axis] = sign == '-' ? -count : count;
    }
    return true;
}

/* The rest of the line, as one of the words; `*index` says which. */
static bool word(struct line *line, const char *const *words, size_t count, const char *expected, size_t *index)
{
    const uint8_t *rest = line->content + line->at;
    size_t left = line->length - line->at;
    for (*index = 0; *index < count; ++*index) {
        if (strlen(words[*index]) == left && memcmp(words[*index], rest, left) == 0) {
            line->at = line->length;
            return true;
        }
    }
    for (size_t i = 0; i < count; i++) {
        size_t size = strlen(words[i]);
        if (size < left && memcmp(words[i], rest, size) == 0)
            return fail(line, MMACELL_PROTO_TRAILING, line->at + size, 0, NULL);
    }
    for (size_t i = 0; i < count; i++)
        if (left < strlen(words[i]) && memcmp(words[i], rest, left) == 0)
            return fail(line, MMACELL_PROTO_SHORT, line->length, 0, expected);
    return fail(line, MMACELL_PROTO_UNEXPECTED, line->at, rest[0], expected);
}

/* Takes the name of a message into `item->name`. */
static bool name(struct line *line, size_t size, const char *expected)
{
    if (line->length < size)
        return fail(line, MMACELL_PROTO_SHORT, line->length, 0, expected);
    memcpy(line->item->name, line->content, size);
    line->at = size;
    return true;
}

static bool command(struct line *line)
{
    static const char *const NAMES[] = {"STA", "STP", "RST", "CLO", "SRV", "OVR", "MOV", "ACQ", "HND"};
    static const char *const SERVO[] = {"ON", "OF", "OFF"};
    static const char *const HAND[] = {"OPEN", "CLOSE", "CLOS"};
    struct mmacell_proto_message *message = &line->item->message;
    size_t kind = 0, index = 0;
    char mode;
    if (!name(line, 3, "command"))
        return false;
    while (kind < sizeof NAMES / sizeof *NAMES && memcmp(line->content, NAMES[kind], 3) != 0)
        kind++;
    if (line->dialect.itr && memcmp(line->content, "ITR", 3) == 0)
        kind = MMACELL_PROTO_STP;
    message->kind = (enum mmacell_proto_kind)kind;
    switch (message->kind) {
    case MMACELL_PROTO_STA:
    case MMACELL_PROTO_STP:
    case MMACELL_PROTO_RST:
    case MMACELL_PROTO_CLO:
        return true;
    case MMACELL_PROTO_SRV:
        if (!word(line, SERVO, line->dialect.off ? 3 : 2, "on_or_off", &index))
            return false;
        message->flag = index == 0;
        return true;
    case MMACELL_PROTO_OVR:
        if (line->dialect.ovrd && line->content[line->at] == 'D')
            line->at++;
        return percent(line, &message->number);
    case MMACELL_PROTO_MOV:
        if (!character(line, "AR", "absolute_or_relative", &mode))
            return false;
        message->flag = mode == 'R';
        return coordinates(line, line->axes_len > 0 ? line->axes_len
                                 : line->length - line->at >= ROBOT_CHARACTERS ? ROBOT_AXES
                                                                               : PLATFORM_AXES);
    case MMACELL_PROTO_ACQ:
        return integer(line, &message->number);
    case MMACELL_PROTO_HND:
        if (!integer(line, &message->number) || !word(line, HAND, line->dialect.clos ? 3 : 2, "open_or_close", &index))
            return false;
        message->flag = index == 0;
        return true;
    default:
        return fail(line, MMACELL_PROTO_UNKNOWN_COMMAND, 0, 0, NULL);
    }
}

static bool reply(struct line *line, enum mmacell_proto_side side)
{
    struct mmacell_proto_message *message = &line->item->message;
    if (!name(line, 2, "reply"))
        return false;
    if (memcmp(line->content, "ER", 2) == 0) {
        message->kind = MMACELL_PROTO_ER;
        if (!integer(line, &message->number))
            return false;
        return message->number != 0 || fail(line, MMACELL_PROTO_ERROR_ZERO, 0, 0, NULL);
    }
    if (memcmp(line->content, "OK", 2) != 0)
        return fail(line, MMACELL_PROTO_UNKNOWN_REPLY, 0, 0, NULL);
    message->kind = MMACELL_PROTO_OK;
    if (line->length == 2)
        return true;
    message->kind = MMACELL_PROTO_STATUS;
    return flag(line, &message->flag) && coordinates(line, side == MMACELL_PROTO_ROBOT ? ROBOT_AXES : PLATFORM_AXES) &&
           flag(line, &message->servo) && percent(line, &message->override) && integer(line, &message->number);
}

/* Whether a byte after `before` ends a line (MM-5, MM-6). */
static bool is_end(const struct mmacell_proto_decoder *decoder, uint8_t before, uint8_t byte)
{
    return byte == '\n' && (before == '\r' || decoder->dialect.lone_lf);
}

/* The bytes up to the end of the line, its end included; 0: it is not there. */
static size_t line_size(const struct mmacell_proto_decoder *decoder)
{
    uint8_t before = decoder->last;
    for (size_t at = 0; at < decoder->length; at++) {
        if (is_end(decoder, before, decoder->held[at]))
            return at + 1;
        before = decoder->held[at];
    }
    return 0;
}

void mmacell_proto_init(struct mmacell_proto_decoder *decoder, enum mmacell_proto_side side,
                        struct mmacell_proto_dialect dialect)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->side = side;
    decoder->dialect = dialect;
}

size_t mmacell_proto_push(struct mmacell_proto_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void mmacell_proto_end(struct mmacell_proto_decoder *decoder) { decoder->ended = true; }

/* What is at the beginning; false: more bytes are needed. */
static bool take(struct mmacell_proto_decoder *decoder, struct mmacell_proto_item *item)
{
    size_t size = line_size(decoder);
    bool is_long = decoder->dropped > 0 || (size == 0 && decoder->length == MMACELL_PROTO_MAX_LINE);
    if (size == 0 && is_long && decoder->length > 0) {
        /* MM-23: the rest of the line only counts. */
        decoder->dropped += decoder->length;
        decoder->last = decoder->held[decoder->length - 1];
        decoder->length = 0;
    }
    item->length = decoder->dropped + (size > 0 ? size : decoder->length);
    if (size == 0 && (!decoder->ended || item->length == 0))
        return false;
    if (size == 0 || is_long) {
        item->message.kind = is_long ? MMACELL_PROTO_TOO_LONG : MMACELL_PROTO_INCOMPLETE;
        return true;
    }
    bool has_cr = size >= 2 && decoder->held[size - 2] == '\r';
    struct line line = {decoder->held, size - 1 - has_cr, 0, decoder->dialect, decoder->axes_len, item};
    bool is_read = decoder->side == MMACELL_PROTO_CENTRAL ? command(&line) : reply(&line, decoder->side);
    if (is_read && line.at < line.length)
        fail(&line, MMACELL_PROTO_TRAILING, line.at, 0, NULL);
    return true;
}

bool mmacell_proto_next(struct mmacell_proto_decoder *decoder, struct mmacell_proto_item *item)
{
    *item = (struct mmacell_proto_item){.offset = decoder->position};
    if (!take(decoder, item)) {
        decoder->ended = false;
        return false;
    }
    bytes_remove(decoder->held, &decoder->length, item->length - decoder->dropped);
    decoder->position += item->length;
    decoder->dropped = 0;
    decoder->last = 0;
    return true;
}

unsigned mmacell_proto_decimals(size_t axes_len, size_t axis)
{
    return axes_len == ROBOT_AXES && axis + 1 < ROBOT_AXES ? 3 : 4;
}

bool mmacell_proto_round(double value, unsigned decimals, int32_t *count)
{
    double scaled = round(value * (decimals == 3 ? 1e3 : 1e4));
    if (!(fabs(scaled) <= MAX_COORDINATE))
        return false;
    *count = (int32_t)scaled;
    return true;
}

/* Appends a number of `decimals` digits after the point, `width` digits in all; false: it does not fit. */
static bool put_coordinate(char *line, int32_t count, unsigned decimals)
{
    if (count < -MAX_COORDINATE || count > MAX_COORDINATE)
        return false;
    int32_t scale = decimals == 3 ? 1000 : 10000;
    int32_t size = count < 0 ? -count : count;
    char *end = line + strlen(line);
    *end++ = count < 0 ? '-' : '+';
    end += put_decimal(end, (uint32_t)(size / scale), 6 - decimals);
    *end++ = '.';
    end += put_decimal(end, (uint32_t)(size % scale), decimals);
    return true;
}

static bool put_axes(char *line, const struct mmacell_proto_message *message)
{
    if (message->axes_len != ROBOT_AXES && message->axes_len != PLATFORM_AXES)
        return false;
    for (size_t axis = 0; axis < message->axes_len; axis++)
        if (!put_coordinate(line, message->axes[axis], mmacell_proto_decimals(message->axes_len, axis)))
            return false;
    return true;
}

static bool put_integer(char *line, int32_t value, struct mmacell_proto_dialect dialect)
{
    if (!fits_integer(value, &dialect))
        return false;
    int32_t size = value < 0 ? -value : value;
    char *end = line + strlen(line);
    *end++ = value < 0 ? '-' : '+';
    if (dialect.blank)
        *end++ = ' ';
    end += put_decimal(end, (uint32_t)size, 5);
    return true;
}

static bool put_percent(char *line, int32_t value, struct mmacell_proto_dialect dialect)
{
    return value >= 0 && value <= 100 && put_integer(line, value, dialect);
}

/* The content of the line; false: refused. */
static bool put_content(char *line, const struct mmacell_proto_message *message, struct mmacell_proto_dialect dialect)
{
    switch (message->kind) {
    case MMACELL_PROTO_STA:
        return strcpy(line, "STA") != NULL;
    case MMACELL_PROTO_STP:
        return strcpy(line, dialect.itr ? "ITR" : "STP") != NULL;
    case MMACELL_PROTO_RST:
        return strcpy(line, "RST") != NULL;
    case MMACELL_PROTO_CLO:
        return strcpy(line, "CLO") != NULL;
    case MMACELL_PROTO_SRV:
        return strcpy(line, message->flag ? "SRVON" : dialect.off ? "SRVOFF" : "SRVOF") != NULL;
    case MMACELL_PROTO_OVR:
        strcpy(line, dialect.ovrd ? "OVRD" : "OVR");
        return put_percent(line, message->number, dialect);
    case MMACELL_PROTO_MOV:
        strcpy(line, message->flag ? "MOVR" : "MOVA");
        return put_axes(line, message);
    case MMACELL_PROTO_ACQ:
        strcpy(line, "ACQ");
        return put_integer(line, message->number, dialect);
    case MMACELL_PROTO_HND:
        strcpy(line, "HND");
        if (!put_integer(line, message->number, dialect))
            return false;
        return strcat(line, message->flag ? "OPEN" : dialect.clos ? "CLOS" : "CLOSE") != NULL;
    case MMACELL_PROTO_OK:
        return strcpy(line, "OK") != NULL;
    case MMACELL_PROTO_STATUS:
        strcpy(line, message->flag ? "OKT" : "OKF");
        if (!put_axes(line, message))
            return false;
        strcat(line, message->servo ? "T" : "F");
        return put_percent(line, message->override, dialect) && put_integer(line, message->number, dialect);
    case MMACELL_PROTO_ER:
        strcpy(line, "ER");
        return message->number != 0 && put_integer(line, message->number, dialect);
    default:
        return false;
    }
}

size_t mmacell_proto_encode(const struct mmacell_proto_message *message, struct mmacell_proto_dialect dialect,
                            uint8_t *out, size_t size)
{
    char line[CONTENT_SIZE] = {0}; /* what is put at its end has one */
    if (!put_content(line, message, dialect))
        return 0;
    strcat(line, dialect.lone_lf ? "\n" : "\r\n");
    size_t length = strlen(line);
    if (length > size)
        return 0;
    memcpy(out, line, length);
    return length;
}
