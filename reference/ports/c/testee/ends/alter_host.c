#include "cellwire/alter_host.h"

#include <string.h>

#include "../end.h"

ADAPT(alter_host)

static void read_policy(const struct json *value, enum alter_host_policy *policy)
{
    if (value != NULL)
        *policy = json_is(value, "refuse")   ? ALTER_HOST_REFUSE
                  : json_is(value, "ignore") ? ALTER_HOST_IGNORE
                                             : ALTER_HOST_ACCEPT;
}

static void read_limit(const struct json *list, int16_t *limit)
{
    int64_t values[ALTER_AXES];
    if (!read_list(list, ALTER_AXES, 0, UINT16_MAX, values))
        return;
    for (int axis = 0; axis < ALTER_AXES; axis++)
        limit[axis] = (int16_t)(values[axis] < INT16_MAX ? values[axis] : INT16_MAX);
}

static bool begin(const struct json *object)
{
    struct alter_host_config config = ALTER_HOST_DEFAULT;
    const struct json *limits = json_get(object, "limits"), *gap = json_get(object, "gap");
    unsigned baud = config.baud, mode = config.mode, cycles = config.silence_cycles;
    if (json_get(object, "framing") != NULL)
        config.framing = read_alter_framing(json_get(object, "framing"));
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    read_unsigned(object, "mode", UINT8_MAX, &mode);
    read_unsigned(object, "silence_cycles", UINT32_MAX, &cycles);
    read_unsigned(object, "repeats", UINT8_MAX, &config.repeats);
    config.baud = baud;
    config.mode = (uint8_t)mode;
    config.silence_cycles = cycles;
    read_limit(json_get(limits, "velocity"), config.limits.velocity);
    read_limit(json_get(limits, "acceleration"), config.limits.acceleration);
    config.subroutine = json_true(json_get(object, "subroutine"));
    read_policy(json_get(object, "policy"), &config.policy);
    if (gap != NULL && gap->type == 'n')
        config.has_gap = false;
    else
        read_time(object, "gap", &config.gap);
    read_time(object, "target_timeout", &config.target_timeout);
    read_time(object, "reserve", &config.reserve);
    read_time(object, "max_delay", &config.max_delay);
    return alter_host_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int64_t values[VAL2_ALTER_AXES], code;
    int16_t target[VAL2_ALTER_AXES];
    if (strcmp(name, "exception") == 0)
        return json_integer(argument, 0, UINT8_MAX, &code) && alter_host_exception(&session, (uint8_t)code);
    if (strcmp(name, "set_target") == 0) {
        if (!read_list(argument, VAL2_ALTER_AXES, INT16_MIN, INT16_MAX, values))
            return false;
        for (int axis = 0; axis < VAL2_ALTER_AXES; axis++)
            target[axis] = (int16_t)values[axis];
        alter_host_set_target(&session, now, target);
    } else if (strcmp(name, "clear_target") == 0) {
        alter_host_clear_target(&session);
    } else if (strcmp(name, "set_policy") == 0) {
        read_policy(argument, &session.policy);
    } else if (strcmp(name, "set_subroutine") == 0) {
        session.subroutine = json_true(argument);
    } else {
        alter_host_stop(&session);
    }
    return true;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"",        "corrupt", "lost",         "exception",
                                        "stopped", "missed",  "target_stale", "rejected",
                                        "delayed", "unexpected"};
    struct alter_host_event event;
    if (!alter_host_event(&session, &event))
        return false;
    const char *name = NAMES[event.kind];
    if (event.kind == ALTER_HOST_MESSAGE)
        name = event.message.kind == VAL2_ALTER_START ? "start"
               : event.message.kind == VAL2_ALTER_END ? "end"
                                                      : "motion";
    begin_event(is_first, name);
    if (event.kind == ALTER_HOST_MESSAGE) {
        print(",\"message\":");
        print_alter_message(&event.message);
    } else if (event.kind == ALTER_HOST_CORRUPT) {
        print(",\"error\":");
        print_alter_error(&event.error);
    } else if (event.kind == ALTER_HOST_LOST) {
        print(",\"reason\":\"%s\"", event.text);
    } else if (event.kind == ALTER_HOST_REJECTED) {
        print(",\"error\":%d", event.code);
    } else if (event.kind == ALTER_HOST_EXCEPTION) {
        print(",\"exception\":%d,\"outcome\":", event.code);
        if (event.reason != NULL)
            print("{\"%s\":\"%s\"}", event.text, event.reason);
        else
            print("\"%s\"", event.text);
    }
    print("}");
    return true;
}

const struct end ALTER_HOST = {END("val2-alter", "host")};
