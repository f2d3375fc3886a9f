#include "cellwire/laser_eb90.h"

#include <math.h>

#include "end.h"

static const char *const TYPES[] = {"f32", "i16", "u8", "char"};
static struct laser_eb90_decoder decoder;

/* A number that may be left out. */
static void read_number(const struct json *value, int64_t most, int64_t *number)
{
    is_out_of_range |= value != NULL && !json_integer(value, 0, most, number);
}

void read_laser_profile(const struct json *options, struct laser_eb90_profile *profile)
{
    const struct json *tags = json_get(options, "tags");
    const struct json *tail = json_get(options, "tail"), *checksum = json_get(options, "checksum");
    profile->tail = json_is(tail, "etx")      ? LASER_EB90_ETX
                   : json_is(tail, "either") ? LASER_EB90_EITHER
                                             : LASER_EB90_PRINTED;
    profile->first_tag = json_is(json_get(options, "flag"), "first_tag");
    for (int type = 0; type < LASER_EB90_TYPES; type++) {
        int64_t tag = profile->tags[type];
        read_number(json_get(tags, TYPES[type]), UINT8_MAX, &tag);
        profile->tags[type] = (uint8_t)tag;
    }
    if (json_is(checksum, "u16_le"))
        profile->checksum = LASER_EB90_SUM_U16_LE;
    if (json_is(checksum, "u16_be"))
        profile->checksum = LASER_EB90_SUM_U16_BE;
    profile->checksum_negated = json_true(json_get(options, "checksum_negated"));
    profile->checksum_with_flag = json_true(json_get(options, "checksum_with_flag"));
    profile->big_endian = json_is(json_get(options, "byte_order"), "big");
}

void read_laser_words(const struct json *object, struct laser_words *words)
{
    static const char *const CLASSES[] = {"", "interpreted", "immediate", "query"};
    const struct json *commands = json_get(object, "commands"), *errors = json_get(object, "errors");
    if (commands != NULL)
        words->command_count = 0;
    for (const struct json *at = commands == NULL ? NULL : commands->child;
         at != NULL && words->command_count < LASER_WORDS_MAX_RANGES; at = at->next) {
        int64_t first = 0, last = 0;
        int class = LASER_WORDS_INTERPRETED;
        read_number(json_get(at, "first"), UINT16_MAX, &first);
        read_number(json_get(at, "last"), UINT16_MAX, &last);
        while (class < LASER_WORDS_QUERY && !json_is(json_get(at, "class"), CLASSES[class]))
            class++;
        words->commands[words->command_count].first = (uint16_t)first;
        words->commands[words->command_count].last = (uint16_t)last;
        words->commands[words->command_count++].word_class = (enum laser_words_class)class;
    }
    if (commands != NULL)
        words->command_count = commands->count;
    for (int error = 0; error < LASER_WORDS_NO_ERROR; error++) {
        int64_t word = words->errors[error];
        read_number(json_get(errors, laser_words_name((enum laser_words_error)error)), UINT16_MAX, &word);
        words->errors[error] = (uint16_t)word;
    }
}

static bool begin(const struct json *request)
{
    struct laser_eb90_profile profile = LASER_EB90_DEFAULT;
    read_laser_profile(json_get(request, "options"), &profile);
    laser_eb90_init(&decoder, profile);
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return laser_eb90_push(&decoder, data, size); }

static void end(void) { laser_eb90_end(&decoder); }

static void print_value(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item, size_t index)
{
    if (item->type == LASER_EB90_I16) {
        print("%d", laser_eb90_get_i16(profile, item, index));
    } else if (item->type == LASER_EB90_U8) {
        print("%d", item->values[index]);
    } else if (item->type == LASER_EB90_CHAR) {
        print("\\u%04x", item->values[index]);
    } else {
        double value = laser_eb90_get_f32(profile, item, index);
        if (value == 0)
            print(signbit(value) ? "-0.0" : "0.0"); /* -0 alone is an integer for some readers */
        else if (isfinite(value))
            print("%.9g", value);
        else
            print("null");
    }
}

void print_laser_list(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t at)
{
    struct laser_eb90_item item;
    print("[");
    for (int number = 0; laser_eb90_item(profile, payload, length, &at, &item); number++) {
        bool is_char = item.type == LASER_EB90_CHAR;
        print("%s{\"%s\":%s", number > 0 ? "," : "", TYPES[item.type], is_char ? "\"" : "[");
        for (size_t index = 0; index < item.count; index++) {
            if (!is_char && index > 0)
                print(",");
            print_value(profile, &item, index);
        }
        print("%s}", is_char ? "\"" : "]");
    }
    print("]");
}

void print_laser_items(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t at)
{
    print("\"items\":");
    print_laser_list(profile, payload, length, at);
}

void print_laser_error(enum laser_eb90_kind kind, size_t error_offset, size_t expected, size_t found)
{
    static const char *const KINDS[] = {"",         "no_head",  "flag", "tag",       "stuffing",
                                        "too_long", "checksum", "item", "incomplete"};
    print("{\"kind\":\"%s\"", KINDS[kind]);
    if (kind != LASER_EB90_NO_HEAD && kind != LASER_EB90_INCOMPLETE)
        print(",\"offset\":%zu", error_offset);
    if (kind == LASER_EB90_FLAG || kind == LASER_EB90_BAD_CHECK || kind == LASER_EB90_ITEM)
        print(",\"%s\":%zu", kind == LASER_EB90_ITEM ? "needed" : "expected", expected);
    if (kind == LASER_EB90_TOO_LONG)
        print(",\"limit\":%d}", LASER_EB90_MAX_PAYLOAD);
    else if (kind == LASER_EB90_NO_HEAD)
        print(",\"skipped\":%zu}", found);
    else
        print(",\"%s\":%zu}", kind == LASER_EB90_INCOMPLETE ? "held" : "found", found);
}

static bool next(bool ended)
{
    static struct laser_eb90_result result;
    if (!laser_eb90_next(&decoder, &result))
        return false;
    print_item(result.offset, result.length, ended);
    if (result.kind == LASER_EB90_FRAME) {
        print("\"message\":{");
        print_laser_items(&decoder.profile, result.payload, result.payload_len, 0);
        print("}");
    } else {
        print("\"error\":");
        print_laser_error(result.kind, result.error_offset, result.expected, result.found);
    }
    return true;
}

bool put_laser_item(struct laser_eb90_payload *payload, const struct json *item)
{
    static uint8_t characters[2048];
    const struct json *values = item->child;
    int type = 0;
    while (type < LASER_EB90_TYPES && (item->count != 1 || json_get(item, TYPES[type]) == NULL))
        type++;
    if (type == LASER_EB90_TYPES)
        return false;
    if (type == LASER_EB90_CHAR) {
        long count = json_latin1(values, characters, sizeof characters);
        if (count < 0)
            return false;
        laser_eb90_put_item(payload, LASER_EB90_CHAR, (size_t)count);
        for (long i = 0; i < count; i++)
            laser_eb90_put_byte(payload, characters[i]);
        return true;
    }
    if (values->type != '[')
        return false;
    laser_eb90_put_item(payload, (enum laser_eb90_type)type, values->count);
    for (const struct json *at = values->child; at != NULL; at = at->next) {
        int64_t integer = 0;
        double number = 0;
        if (type == LASER_EB90_F32 ? !json_number(at, &number)
                                   : !json_integer(at, type == LASER_EB90_U8 ? 0 : INT16_MIN,
                                                   type == LASER_EB90_U8 ? UINT8_MAX : INT16_MAX, &integer))
            return false;
        if (type == LASER_EB90_F32)
            laser_eb90_put_f32(payload, (float)number);
        else if (type == LASER_EB90_I16)
            laser_eb90_put_i16(payload, (int16_t)integer);
        else
            laser_eb90_put_byte(payload, (uint8_t)integer);
    }
    return true;
}

static size_t encode(const struct json *message, uint8_t *out, size_t size)
{
    static struct laser_eb90_payload payload;
    const struct json *items = json_get(message, "items");
    payload = (struct laser_eb90_payload){.profile = &decoder.profile};
    if (items == NULL || message->count != 1)
        return 0;
    for (const struct json *item = items->child; item != NULL; item = item->next)
        if (!put_laser_item(&payload, item))
            return 0;
    return laser_eb90_encode(&payload, out, size);
}

const struct link LASER_EB90 = {"laser-eb90", begin, push, end, next, encode};
