#include "cellwire/kawasaki_msg.h"

#include "link.h"

#define MAX_VALUES 4096

static struct kawasaki_msg_decoder decoder;

static bool begin(const struct json *request)
{
    kawasaki_msg_init(&decoder, json_is(json_get(json_get(request, "options"), "charset"), "latin1"));
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return kawasaki_msg_push(&decoder, data, size); }

static void end(void) { kawasaki_msg_end(&decoder); }

void print_kawasaki_text(const struct kawasaki_msg_text *text)
{
    print("\"");
    for (size_t i = 0; i < text->length; i++)
        print("\\u%04x", text->bytes[i]);
    print("\"");
}

static void print_values(const struct kawasaki_msg_text *values, bool is_there)
{
    struct kawasaki_msg_text value;
    size_t at = 0;
    print("[");
    for (int number = 0; is_there && kawasaki_msg_value(values, &at, &value); number++) {
        print(number > 0 ? "," : "");
        print_kawasaki_text(&value);
    }
    print("]");
}

void print_kawasaki_error(const struct kawasaki_msg_error *error, size_t length)
{
    static const char *const KINDS[] = {"",        "garbage",  "mark",   "not_ascii",   "no_length",
                                        "no_name", "too_long", "length", "no_end_mark", "incomplete"};
    print("\"error\":{\"kind\":\"%s\",\"offset\":%llu", KINDS[error->kind], (unsigned long long)error->offset);
    switch (error->kind) {
    case KAWASAKI_MSG_GARBAGE:
        print(",\"length\":%zu", length);
        break;
    case KAWASAKI_MSG_NO_LENGTH:
    case KAWASAKI_MSG_NO_NAME:
        break;
    case KAWASAKI_MSG_TOO_LONG:
        print(",\"limit\":%d", KAWASAKI_MSG_MAX_LEN);
        break;
    case KAWASAKI_MSG_LENGTH:
        print(",\"expected\":%zu,\"found\":%zu", error->expected, error->found);
        break;
    default:
        print(",\"found\":%zu", error->found);
    }
    print("}");
}

static bool next(bool ended)
{
    static struct kawasaki_msg_item item;
    if (!kawasaki_msg_next(&decoder, &item))
        return false;
    print_item(item.offset, item.length, ended);
    if (item.error.kind != KAWASAKI_MSG_MESSAGE) {
        print_kawasaki_error(&item.error, item.length);
        return true;
    }
    print("\"message\":{\"name\":");
    print_kawasaki_text(&item.name);
    print(",\"header\":");
    print_values(&item.header, item.has_header);
    print(",\"fields\":");
    print_values(&item.fields, item.fields.length > 0);
    print("}");
    return true;
}

/* Where the characters of a message are while it is encoded. */
static uint8_t characters[4 * KAWASAKI_MSG_MAX_LEN];
static size_t characters_used;

static bool read_text(const struct json *value, struct kawasaki_msg_text *text)
{
    text->bytes = characters + characters_used;
    long length = json_latin1(value, characters + characters_used, sizeof characters - characters_used);
    if (length < 0)
        return false;
    text->length = (size_t)length;
    characters_used += text->length;
    return true;
}

static bool read_texts(const struct json *list, struct kawasaki_msg_text *texts)
{
    if (list == NULL || list->type != '[' || list->count > MAX_VALUES)
        return false;
    for (const struct json *value = list->child; value != NULL; value = value->next)
        if (!read_text(value, texts++))
            return false;
    return true;
}

static size_t encode(const struct json *message, uint8_t *out, size_t size)
{
    static struct kawasaki_msg_text header[MAX_VALUES], fields[MAX_VALUES];
    const struct json *headers = json_get(message, "header"), *data = json_get(message, "fields");
    struct kawasaki_msg_text name;
    characters_used = 0;
    if (!read_text(json_get(message, "name"), &name) || !read_texts(headers, header) || !read_texts(data, fields))
        return 0;
    return kawasaki_msg_encode(name, header, headers->count, fields, data->count, decoder.is_latin1, out, size);
}

const struct link KAWASAKI_MSG = {"kawasaki-msg", begin, push, end, next, encode};
