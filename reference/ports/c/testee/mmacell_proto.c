#include "cellwire/mmacell_proto.h"

#include "link.h"

static const char *const COMMANDS[] = {"STA", "STP", "RST", "CLO", "SRV", "OVR", "MOV", "ACQ", "HND"};
static const size_t FIELDS[] = {1, 1, 1, 1, 2, 2, 3, 2, 3}; /* of the object of each */
static struct mmacell_proto_decoder decoder;

void read_mmacell_dialect(const struct json *options, struct mmacell_proto_dialect *dialect)
{
    *dialect = (struct mmacell_proto_dialect){
        .itr = json_true(json_get(options, "itr")),
        .ovrd = json_true(json_get(options, "ovrd")),
        .clos = json_true(json_get(options, "clos")),
        .off = json_true(json_get(options, "off")),
        .lone_lf = json_true(json_get(options, "lone_lf")),
        .blank = json_true(json_get(options, "blank")),
        .wide_integers = json_true(json_get(options, "wide_integers")),
    };
}

static bool begin(const struct json *request)
{
    const struct json *from = json_get(request, "from");
    struct mmacell_proto_dialect dialect;
    read_mmacell_dialect(json_get(request, "options"), &dialect);
    mmacell_proto_init(&decoder,
                       json_is(from, "central") ? MMACELL_PROTO_CENTRAL
                       : json_is(from, "robot") ? MMACELL_PROTO_ROBOT
                                                : MMACELL_PROTO_PLATFORM,
                       dialect);
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return mmacell_proto_push(&decoder, data, size); }

static void end(void) { mmacell_proto_end(&decoder); }

static const char *truth(bool value) { return value ? "true" : "false"; }

static void print_axes(const struct mmacell_proto_message *message)
{
    print(",\"axes\":[");
    for (size_t axis = 0; axis < message->axes_len; axis++) {
        unsigned decimals = mmacell_proto_decimals(message->axes_len, axis);
        long count = message->axes[axis], size = count < 0 ? -count : count, scale = decimals == 3 ? 1000 : 10000;
        print("%s%s%ld.%0*ld", axis > 0 ? "," : "", count < 0 ? "-" : "", size / scale, (int)decimals, size % scale);
    }
    print("]");
}

void print_mmacell_status(const struct mmacell_proto_message *message)
{
    print("\"moving\":%s,\"servo\":%s", truth(message->flag), truth(message->servo));
    print_axes(message);
    print(",\"override\":%d,\"error\":%d", (int)message->override, (int)message->number);
}

void print_mmacell_message(const struct mmacell_proto_message *message)
{
    switch (message->kind) {
    case MMACELL_PROTO_OK:
        print("{\"reply\":\"ok\"}");
        return;
    case MMACELL_PROTO_ER:
        print("{\"reply\":\"error\",\"error\":%d}", (int)message->number);
        return;
    case MMACELL_PROTO_STATUS:
        print("{\"reply\":\"status\",");
        print_mmacell_status(message);
        print("}");
        return;
    default:
        break;
    }
    print("{\"command\":\"%s\"", COMMANDS[message->kind]);
    if (message->kind == MMACELL_PROTO_SRV)
        print(",\"on\":%s", truth(message->flag));
    if (message->kind == MMACELL_PROTO_OVR)
        print(",\"percent\":%d", (int)message->number);
    if (message->kind == MMACELL_PROTO_ACQ)
        print(",\"camera\":%d", (int)message->number);
    if (message->kind == MMACELL_PROTO_HND)
        print(",\"gripper\":%d,\"open\":%s", (int)message->number, truth(message->flag));
    if (message->kind == MMACELL_PROTO_MOV) {
        print(",\"mode\":\"%s\"", message->flag ? "relative" : "absolute");
        print_axes(message);
    }
    print("}");
}

void print_mmacell_error(const struct mmacell_proto_item *item)
{
    static const char *const KINDS[] = {"too_long", "incomplete", "unknown_command", "unknown_reply", "unexpected",
                                        "short",    "trailing",   "integer_range",   "percent",       "error_zero"};
    enum mmacell_proto_kind kind = item->message.kind;
    print("{\"kind\":\"%s\"", KINDS[kind - MMACELL_PROTO_TOO_LONG]);
    if (kind == MMACELL_PROTO_TOO_LONG)
        print(",\"limit\":%d", MMACELL_PROTO_MAX_LINE);
    if (kind == MMACELL_PROTO_UNKNOWN_COMMAND || kind == MMACELL_PROTO_UNKNOWN_REPLY) {
        print(",\"found\":");
        PRINT_LIST(item->name, kind == MMACELL_PROTO_UNKNOWN_COMMAND ? 3 : 2);
    }
    if (kind >= MMACELL_PROTO_UNEXPECTED && kind <= MMACELL_PROTO_PERCENT)
        print(",\"offset\":%zu", item->error_offset);
    if (kind == MMACELL_PROTO_UNEXPECTED || kind == MMACELL_PROTO_INTEGER_RANGE || kind == MMACELL_PROTO_PERCENT)
        print(",\"found\":%d", (int)item->found);
    if (kind == MMACELL_PROTO_UNEXPECTED || kind == MMACELL_PROTO_SHORT)
        print(",\"expected\":\"%s\"", item->expected);
    print("}");
}

static bool next(bool ended)
{
    struct mmacell_proto_item item;
    if (!mmacell_proto_next(&decoder, &item))
        return false;
    print_item(item.offset, item.length, ended);
    bool is_error = item.message.kind >= MMACELL_PROTO_TOO_LONG;
    print(is_error ? "\"error\":" : "\"message\":");
    if (is_error)
        print_mmacell_error(&item);
    else
        print_mmacell_message(&item.message);
    return true;
}

static bool read_number(const struct json *value, int32_t *number)
{
    int64_t found;
    if (!json_integer(value, INT32_MIN, INT32_MAX, &found))
        return false;
    *number = (int32_t)found;
    return true;
}

static bool read_axes(const struct json *object, struct mmacell_proto_message *message)
{
    const struct json *axes = json_get(object, "axes");
    if (axes == NULL || axes->type != '[' || axes->count > MMACELL_PROTO_MAX_AXES ||
        !(axes->count == 4 || axes->count == 2))
        return false;
    message->axes_len = axes->count;
    size_t axis = 0;
    for (const struct json *at = axes->child; at != NULL; at = at->next, axis++) {
        double value;
        if (!json_number(at, &value) ||
            !mmacell_proto_round(value, mmacell_proto_decimals(message->axes_len, axis), &message->axes[axis]))
            return false;
    }
    return true;
}

bool read_mmacell_command(const struct json *object, struct mmacell_proto_message *message)
{
    const struct json *name = json_get(object, "command"), *mode = json_get(object, "mode");
    size_t kind = 0, count = sizeof COMMANDS / sizeof *COMMANDS;
    while (kind < count && !json_is(name, COMMANDS[kind]))
        kind++;
    message->kind = (enum mmacell_proto_kind)kind;
    if (kind == count || object->count != FIELDS[kind])
        return false;
    switch (message->kind) {
    case MMACELL_PROTO_SRV:
        return json_boolean(json_get(object, "on"), &message->flag);
    case MMACELL_PROTO_OVR:
        return read_number(json_get(object, "percent"), &message->number);
    case MMACELL_PROTO_MOV:
        message->flag = json_is(mode, "relative");
        return (message->flag || json_is(mode, "absolute")) && read_axes(object, message);
    case MMACELL_PROTO_ACQ:
        return read_number(json_get(object, "camera"), &message->number);
    case MMACELL_PROTO_HND:
        return read_number(json_get(object, "gripper"), &message->number) &&
               json_boolean(json_get(object, "open"), &message->flag);
    default:
        return true;
    }
}

/* A device has its own axes; a central controller moves either. */
static bool has_own_axes(const struct mmacell_proto_message *message)
{
    return message->axes_len == (decoder.side == MMACELL_PROTO_ROBOT ? 4 : 2);
}

static bool read_reply(const struct json *object, struct mmacell_proto_message *message)
{
    const struct json *name = json_get(object, "reply"), *number = json_get(object, "error");
    message->kind = MMACELL_PROTO_OK;
    if (json_is(name, "ok"))
        return object->count == 1;
    message->kind = MMACELL_PROTO_ER;
    if (json_is(name, "error"))
        return object->count == 2 && read_number(number, &message->number);
    message->kind = MMACELL_PROTO_STATUS;
    return json_is(name, "status") && object->count == 6 && read_number(number, &message->number) && read_axes(object, message) &&
           has_own_axes(message) && json_boolean(json_get(object, "moving"), &message->flag) &&
           json_boolean(json_get(object, "servo"), &message->servo) &&
           read_number(json_get(object, "override"), &message->override);
}

static size_t encode(const struct json *object, uint8_t *out, size_t size)
{
    struct mmacell_proto_message message = {0};
    bool is_read =
        decoder.side == MMACELL_PROTO_CENTRAL ? read_mmacell_command(object, &message) : read_reply(object, &message);
    return is_read ? mmacell_proto_encode(&message, decoder.dialect, out, size) : 0;
}

const struct link MMACELL_PROTO = {"mmacell-proto", begin, push, end, next, encode};
