#include "cellwire/val2_alter.h"

#include "link.h"

static struct val2_alter_decoder decoder;
static struct val2_alter_framing framing;
static bool is_robot;

struct val2_alter_framing read_alter_framing(const struct json *options)
{
    int64_t leading_dle = 2;
    json_integer(json_get(options, "leading_dle"), 1, 2, &leading_dle);
    return (struct val2_alter_framing){
        .leading_dle = (uint8_t)leading_dle,
        .negated_sum = json_true(json_get(options, "negated_sum")),
        .stuffed_checksum = json_true(json_get(options, "stuffed_checksum")),
        .ignore_spare_select = json_true(json_get(options, "ignore_spare_select")),
    };
}

static bool begin(const struct json *request)
{
    framing = read_alter_framing(json_get(request, "options"));
    is_robot = json_is(json_get(request, "from"), "robot");
    val2_alter_init(&decoder, is_robot ? VAL2_ALTER_CONTROLLER : VAL2_ALTER_HOST, framing);
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return val2_alter_push(&decoder, data, size); }

static void end(void) { val2_alter_end(&decoder); }

void print_alter_message(const struct val2_alter_message *message)
{
    switch (message->kind) {
    case VAL2_ALTER_START:
        print("{\"kind\":\"start\",\"mode\":%d,\"data\":", message->mode);
        PRINT_LIST(message->list, message->list_len);
        if (message->code != 0)
            print(",\"error\":%d", message->code);
        print("%s}", message->marked ? "" : ",\"marked\":false");
        return;
    case VAL2_ALTER_END:
        print("{\"kind\":\"end\",\"error\":%d}", message->code);
        return;
    case VAL2_ALTER_START_REPLY:
        print("{\"kind\":\"start_reply\",\"reply\":\"%s\"}", message->answer == 0   ? "accept"
                                                             : message->answer == 1 ? "repeat"
                                                                                    : "refuse");
        return;
    case VAL2_ALTER_REPLY:
        print("{\"kind\":\"reply\",\"exception\":%d,\"values\":[", message->exception);
        for (int axis = 0; axis < VAL2_ALTER_AXES; axis++) {
            print(axis > 0 ? "," : "");
            if (message->select >> axis & 1)
                print("%d", message->values[axis]);
            else
                print("null");
        }
        print("]}");
        return;
    default:
        print("{\"kind\":\"motion\",\"phase\":\"%s\",",
              message->kind == VAL2_ALTER_RUNNING ? "running" : "interrupted");
        print("\"error\":%d,\"segment_status\":%d,", message->code, message->status);
        print("\"segment\":%d,\"percent\":%d,\"transform\":", message->segment, message->percent);
        if (message->has_transform)
            PRINT_LIST(message->transform, VAL2_ALTER_TRANSFORM);
        else
            print("null");
        print("}");
    }
}

void print_alter_error(const struct val2_alter_error *error)
{
    static const char *const KINDS[] = {"start_mark", "end_mark", "checksum",    "too_long", "incomplete",
                                        "control",    "length",   "start_reply", "select",   "reply_length"};
    print("{\"kind\":\"%s\",\"offset\":%llu", KINDS[error->kind - VAL2_ALTER_START_MARK],
          (unsigned long long)error->offset);
    if (error->kind == VAL2_ALTER_CHECKSUM || error->kind == VAL2_ALTER_REPLY_LENGTH)
        print(",\"expected\":%zu", error->expected);
    bool is_length = error->kind == VAL2_ALTER_START_MARK || error->kind == VAL2_ALTER_INCOMPLETE;
    print(",\"%s\":%zu}", is_length ? "length" : error->kind == VAL2_ALTER_TOO_LONG ? "limit" : "found", error->found);
}

static bool next(bool ended)
{
    struct val2_alter_item item;
    if (!val2_alter_next(&decoder, &item))
        return false;
    print_item(item.offset, item.length, ended);
    print(item.is_error ? "\"error\":" : "\"message\":");
    if (item.is_error)
        print_alter_error(&item.error);
    else
        print_alter_message(&item.message);
    return true;
}

static bool read_words(const struct json *list, size_t count, int16_t *words)
{
    int64_t values[VAL2_ALTER_MAX_LIST];
    if (!read_list(list, count, INT16_MIN, INT16_MAX, values))
        return false;
    for (size_t i = 0; i < count; i++)
        words[i] = (int16_t)values[i];
    return true;
}

static bool read_host(const struct json *object, struct val2_alter_message *message)
{
    const struct json *reply = json_get(object, "reply"), *values = json_get(object, "values");
    int64_t exception, value;
    size_t axis = 0;
    bool is_start_reply = json_is(json_get(object, "kind"), "start_reply");
    if (object->count != (is_start_reply ? 2 : 3))
        return false;
    if (is_start_reply) {
        message->kind = VAL2_ALTER_START_REPLY;
        message->answer = json_is(reply, "accept") ? 0x00 : json_is(reply, "repeat") ? 0x01 : 0xFF;
        return message->answer != 0xFF || json_is(reply, "refuse");
    }
    message->kind = VAL2_ALTER_REPLY;
    if (!json_is(json_get(object, "kind"), "reply") || values == NULL || values->count != VAL2_ALTER_AXES ||
        !json_integer(json_get(object, "exception"), 0, UINT8_MAX, &exception))
        return false;
    message->exception = (uint8_t)exception;
    for (const struct json *at = values->child; at != NULL; at = at->next, axis++) {
        if (at->type == 'n')
            continue;
        if (!json_integer(at, INT16_MIN, INT16_MAX, &value))
            return false;
        message->select = (uint8_t)(message->select | 1 << axis);
        message->values[axis] = (int16_t)value;
    }
    return true;
}

static bool read_controller(const struct json *object, struct val2_alter_message *message)
{
    const struct json *kind = json_get(object, "kind"), *code = json_get(object, "error");
    const struct json *list = json_get(object, "data"), *transform = json_get(object, "transform");
    const struct json *marked = json_get(object, "marked");
    int64_t value = 0, status, segment, percent;
    bool is_start = json_is(kind, "start"), is_marked;
    if (object->count != (is_start ? 3u + (code != NULL) + (marked != NULL) : json_is(kind, "end") ? 2u : 7u) ||
        (marked != NULL && !json_boolean(marked, &is_marked)))
        return false;
    /* Only a start message may leave it out. */
    if ((code != NULL || !is_start) && !json_integer(code, 0, UINT8_MAX, &value))
        return false;
    message->code = (uint8_t)value;
    if (json_is(kind, "end")) {
        message->kind = VAL2_ALTER_END;
        return true;
    }
    if (is_start) {
        message->kind = VAL2_ALTER_START;
        if (list == NULL || list->count > UINT8_MAX || !json_integer(json_get(object, "mode"), 0, UINT8_MAX, &value))
            return false;
        message->mode = (uint8_t)value;
        message->list_len = (uint8_t)list->count;
        return list->count > VAL2_ALTER_MAX_LIST || read_words(list, list->count, message->list);
    }
    bool is_interrupted = json_is(json_get(object, "phase"), "interrupted");
    message->kind = is_interrupted ? VAL2_ALTER_INTERRUPTED : VAL2_ALTER_RUNNING;
    if (!json_is(kind, "motion") || !(is_interrupted || json_is(json_get(object, "phase"), "running")) ||
        !json_integer(json_get(object, "segment_status"), 0, UINT8_MAX, &status) ||
        !json_integer(json_get(object, "segment"), 0, UINT16_MAX, &segment) ||
        !json_integer(json_get(object, "percent"), 0, UINT16_MAX, &percent))
        return false;
    message->status = (uint8_t)status;
    message->segment = (uint16_t)segment;
    message->percent = (uint16_t)percent;
    if (transform == NULL)
        return false;
    message->has_transform = transform->type != 'n';
    return !message->has_transform || read_words(transform, VAL2_ALTER_TRANSFORM, message->transform);
}

static size_t encode(const struct json *object, uint8_t *out, size_t size)
{
    struct val2_alter_message message = {0};
    bool is_read = is_robot ? read_controller(object, &message) : read_host(object, &message);
    return is_read ? val2_alter_encode(&message, framing, out, size) : 0;
}

const struct link VAL2_ALTER = {"val2-alter", begin, push, end, next, encode};
