#include "cellwire/alter_controller.h"

#include <string.h>

#include "../end.h"

ADAPT(alter_controller)

static bool begin(const struct json *object)
{
    struct alter_controller_config config = ALTER_CONTROLLER_DEFAULT;
    const struct json *gap = json_get(object, "gap"), *list = json_get(object, "data"), *word = json_get(object, "unselected");
    unsigned baud = config.baud, mode = config.mode;
    int64_t values[VAL2_ALTER_MAX_LIST];
    if (json_get(object, "framing") != NULL)
        config.framing = read_alter_framing(json_get(object, "framing"));
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    read_unsigned(object, "mode", UINT8_MAX, &mode);
    read_unsigned(object, "attempts", UINT8_MAX, &config.attempts);
    config.baud = baud;
    config.mode = (uint8_t)mode;
    config.subroutine = json_true(json_get(object, "subroutine"));
    config.unselected = json_is(word, "hold")   ? ALTER_CONTROLLER_HOLD
                        : json_is(word, "zero") ? ALTER_CONTROLLER_ZERO
                                                : ALTER_CONTROLLER_BY_MODE;
    if (gap != NULL && gap->type == 'n')
        config.has_gap = false;
    else
        read_time(object, "gap", &config.gap);
    if (list != NULL && list->count > VAL2_ALTER_MAX_LIST) {
        config.list_len = VAL2_ALTER_MAX_LIST + 1;
    } else if (list != NULL) {
        if (!read_list(list, list->count, INT16_MIN, INT16_MAX, values))
            return false;
        config.list_len = (uint8_t)list->count;
        for (size_t i = 0; i < list->count; i++)
            config.list[i] = (int16_t)values[i];
    }
    return alter_controller_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int64_t values[VAL2_ALTER_TRANSFORM];
    int16_t words[VAL2_ALTER_TRANSFORM];
    if (strcmp(name, "start") == 0)
        return alter_controller_start(&session, now);
    if (strcmp(name, "finish") == 0)
        return alter_controller_finish(&session);
    if (strcmp(name, "interrupt") == 0)
        return alter_controller_interrupt(&session);
    if (strcmp(name, "resume") == 0)
        return alter_controller_resume(&session);
    if (strcmp(name, "set_segment") == 0) {
        if (!read_list(argument, 3, 0, UINT16_MAX, values))
            return false;
        alter_controller_set_segment(&session, (uint8_t)values[0], (uint16_t)values[1], (uint16_t)values[2]);
        return true;
    }
    if (!read_list(argument, VAL2_ALTER_TRANSFORM, INT16_MIN, INT16_MAX, values))
        return false;
    for (int word = 0; word < VAL2_ALTER_TRANSFORM; word++)
        words[word] = (int16_t)values[word];
    alter_controller_set_transform(&session, words);
    return true;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"started", "refused",   "gave_up", "reply", "bad_reply",
                                        "ended",   "exception", "aborted", "stray", "unexpected"};
    struct alter_controller_event event;
    if (!alter_controller_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind == ALTER_CONTROLLER_REPLY || event.kind == ALTER_CONTROLLER_STRAY) {
        print(",\"message\":");
        print_alter_message(&event.message);
    }
    if (event.kind == ALTER_CONTROLLER_REPLY) {
        print(",\"values\":");
        PRINT_LIST(event.values, VAL2_ALTER_AXES);
    } else if (event.kind == ALTER_CONTROLLER_BAD_REPLY || event.kind == ALTER_CONTROLLER_ENDED) {
        print(",\"error\":%d", event.code);
    } else if (event.kind == ALTER_CONTROLLER_EXCEPTION || event.kind == ALTER_CONTROLLER_ABORTED) {
        print(",\"exception\":%d", event.code);
    }
    print("}");
    return true;
}

const struct end ALTER_CONTROLLER = {END("val2-alter", "controller")};
