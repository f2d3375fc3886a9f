/* The ends whose sessions this port has. */
#include <string.h>

#include "../alter_host.h"
#include "../laser_host.h"
#include "../mmacell_central.h"
#include "link.h"

/* Times of a configuration that are not there keep their default. */
static void read_time(const struct json *config, const char *name, uint64_t *time)
{
    const struct json *value = json_get(config, name);
    int64_t number;
    if (json_integer(value, 0, INT64_MAX - 1, &number))
        *time = (uint64_t)number;
    else if (value != NULL && value->type == '0')
        *time = UINT64_MAX; /* longer than 63 bits: never */
}

static void read_unsigned(const struct json *config, const char *name, int64_t most, unsigned *number)
{
    int64_t found;
    if (json_integer(json_get(config, name), 0, most, &found))
        *number = (unsigned)found;
}

static void begin_event(bool is_first, const char *name) { print("%s{\"event\":\"%s\"", is_first ? "" : ",", name); }

/* mmacell-proto, central */

static struct mmacell_central central;

static bool central_begin(const struct json *object)
{
    struct mmacell_central_config config = MMACELL_CENTRAL_DEFAULT;
    int64_t tolerance;
    read_mmacell_dialect(json_get(object, "accepts"), &config.accepts);
    read_mmacell_dialect(json_get(object, "writes"), &config.writes);
    read_time(object, "timeout", &config.timeout);
    read_time(object, "settle", &config.settle);
    if (json_integer(json_get(object, "tolerance"), 0, INT32_MAX, &tolerance))
        config.tolerance = (int32_t)tolerance;
    return mmacell_central_init(&central, &config);
}

static void central_connected(uint64_t now) { mmacell_central_connected(&central, now); }

static void central_disconnected(uint64_t now) { mmacell_central_disconnected(&central, now); }

static size_t central_input(uint64_t now, const uint8_t *data, size_t size)
{
    mmacell_central_input(&central, now, data, size);
    return size;
}

static void central_timeout(uint64_t now) { mmacell_central_timeout(&central, now); }

static void central_transmitted(uint64_t now) { (void)now; }

static bool central_call(uint64_t now, const char *name, const struct json *argument)
{
    struct mmacell_proto_message command = {0};
    (void)now;
    if (strcmp(name, "abort") == 0) {
        mmacell_central_abort(&central);
        return true;
    }
    return read_mmacell_command(argument, &command) && mmacell_central_request(&central, &command);
}

static bool central_event(bool is_first)
{
    static const char *const NAMES[] = {"connected", "done", "refused", "status", "aborted", "closed", "unexpected"};
    static const char *const UNFINISHED[] = {NULL, "not_sent", "unknown"};
    struct mmacell_central_event event;
    if (!mmacell_central_event(&central, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    bool is_status = event.kind == MMACELL_CENTRAL_STATUS, is_closed = event.kind == MMACELL_CENTRAL_CLOSED;
    if (is_status) {
        print(",\"status\":{");
        print_mmacell_status(&event.message);
        if (strncmp(event.motion, "missed_", 7) == 0)
            print("},\"motion\":{\"missed\":\"%s\"}", event.motion + 7);
        else
            print("},\"motion\":\"%s\"", event.motion);
    } else if (!is_closed && event.kind != MMACELL_CENTRAL_CONNECTED && event.kind != MMACELL_CENTRAL_UNEXPECTED) {
        print(",\"command\":");
        print_mmacell_message(&event.message);
    }
    if (event.kind == MMACELL_CENTRAL_REFUSED)
        print(",\"error\":%d", (int)event.error);
    if (is_closed && strcmp(event.reason, "malformed") == 0) {
        print(",\"reason\":{\"malformed\":");
        print_mmacell_error(&event.item);
        print("}");
    } else if (is_closed) {
        print(",\"reason\":\"%s\"", event.reason);
    }
    if (is_closed && UNFINISHED[event.unfinished] == NULL) {
        print(",\"unfinished\":\"nothing\"");
    } else if (is_closed) {
        print(",\"unfinished\":{\"%s\":", UNFINISHED[event.unfinished]);
        print_mmacell_message(&event.message);
        print("}");
    }
    print("}");
    return true;
}

static size_t central_transmit(uint64_t now, uint8_t *out, size_t size)
{
    return mmacell_central_transmit(&central, now, out, size);
}

static bool central_deadline(uint64_t *deadline) { return mmacell_central_deadline(&central, deadline); }

const struct end MMACELL_CENTRAL = {"mmacell-proto",      "central",     central_begin,    central_connected,
                                    central_disconnected, central_input, central_timeout,  central_transmitted,
                                    central_call,         central_event, central_transmit, central_deadline};

/* laser-eb90, host */

static struct laser_host laser;

static bool laser_begin(const struct json *object)
{
    unsigned baud = 9600;
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    struct laser_host_config config = laser_host_default(baud);
    if (json_get(object, "profile") != NULL || json_get(object, "words") != NULL)
        return false;
    read_unsigned(object, "batch", LASER_HOST_BATCH, &config.batch);
    read_unsigned(object, "resends", UINT8_MAX, &config.resends);
    read_unsigned(object, "longest_frame", LASER_EB90_MAX_LEN, &config.longest_frame);
    config.resend_on_silence = json_true(json_get(object, "resend_on_silence"));
    config.controller_drops_partial = json_true(json_get(object, "controller_drops_partial"));
    read_time(object, "answer_timeout", &config.answer_timeout);
    read_time(object, "execution_timeout", &config.execution_timeout);
    read_time(object, "settle", &config.settle);
    read_time(object, "max_pause", &config.max_pause);
    read_time(object, "reply_time", &config.reply_time);
    read_time(object, "earlier_execution", &config.earlier_execution);
    read_time(object, "backoff", &config.backoff);
    read_time(object, "full_timeout", &config.full_timeout);
    return laser_host_init(&laser, &config);
}

static void laser_connected(uint64_t now) { laser_host_connected(&laser, now); }

static void laser_disconnected(uint64_t now) { laser_host_disconnected(&laser, now); }

static size_t laser_input(uint64_t now, const uint8_t *data, size_t size)
{
    return laser_host_input(&laser, now, data, size);
}

static void laser_timeout(uint64_t now) { laser_host_timeout(&laser, now); }

static void laser_transmitted(uint64_t now) { laser_host_transmitted(&laser, now); }

static bool laser_submit(const struct json *instruction)
{
    struct laser_eb90_payload parameters = {.profile = &laser.config.profile};
    const struct json *items = json_get(instruction, "parameters");
    int64_t word;
    for (const struct json *item = items == NULL ? NULL : items->child; item != NULL; item = item->next)
        if (!put_laser_item(&parameters, item))
            return false;
    return json_integer(json_get(instruction, "word"), 0, UINT16_MAX, &word) &&
           laser_host_submit(&laser, (uint16_t)word, &parameters);
}

static bool laser_call(uint64_t now, const char *name, const struct json *argument)
{
    (void)now;
    if (strcmp(name, "submit") == 0)
        return laser_submit(argument);
    if (strcmp(name, "resume") == 0)
        laser_host_resume(&laser);
    else
        laser_host_take_back(&laser);
    return true;
}

static void print_laser_event(const struct laser_host_event *event)
{
    size_t word_len = 4; /* of the payload of an answer */
    switch (event->kind) {
    case LASER_HOST_DONE:
        print(",\"first\":%llu,\"count\":%u", (unsigned long long)event->first, event->count);
        print(",\"resends\":%u,\"unanswered\":%u", event->resends, event->unanswered);
        return;
    case LASER_HOST_ANSWER:
        print(",\"ticket\":%llu,", (unsigned long long)event->first);
        print_laser_items(&laser.config.profile, laser.answer.payload, laser.answer.payload_len, word_len);
        return;
    case LASER_HOST_REFUSED:
    case LASER_HOST_UNKNOWN:
        print(",\"first\":%llu,\"count\":%u", (unsigned long long)event->first, event->count);
        print(",\"%s\":", event->kind == LASER_HOST_REFUSED ? "refusal" : "reason");
        if (event->word != 0)
            print("{\"%s\":{\"expected\":%u,\"found\":%u}}", event->text, event->expected, event->word);
        else
            print("\"%s\"", event->text);
        return;
    case LASER_HOST_UNASKED:
        print(",\"word\":%u", event->word);
        return;
    case LASER_HOST_CORRUPT:
        print(",\"error\":");
        if (event->error.kind == LASER_EB90_FRAME)
            print("{\"kind\":\"no_word\"}");
        else
            print_laser_error(event->error.kind, event->error.error_offset, event->error.expected, event->error.found);
        return;
    case LASER_HOST_UNEXPECTED:
        return;
    }
}

static bool laser_event(bool is_first)
{
    static const char *const NAMES[] = {"done", "answer", "refused", "unknown", "unasked", "corrupt", "unexpected"};
    struct laser_host_event event;
    if (!laser_host_event(&laser, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    print_laser_event(&event);
    print("}");
    return true;
}

static size_t laser_transmit(uint64_t now, uint8_t *out, size_t size)
{
    return laser_host_transmit(&laser, now, out, size);
}

static bool laser_deadline(uint64_t *deadline) { return laser_host_deadline(&laser, deadline); }

const struct end LASER_HOST = {"laser-eb90",       "host",      laser_begin,    laser_connected,
                               laser_disconnected, laser_input, laser_timeout,  laser_transmitted,
                               laser_call,         laser_event, laser_transmit, laser_deadline};

/* val2-alter, host */

static struct alter_host alter;

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
    if (!read_list(list, ALTER_AXES, 0, INT16_MAX, values))
        return;
    for (int axis = 0; axis < ALTER_AXES; axis++)
        limit[axis] = (int16_t)values[axis];
}

static bool alter_begin(const struct json *object)
{
    struct alter_host_config config = ALTER_HOST_DEFAULT;
    const struct json *limits = json_get(object, "limits"), *gap = json_get(object, "gap");
    unsigned baud = config.baud, mode = config.mode, cycles = config.silence_cycles;
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
    config.has_gap = gap == NULL || gap->type != 'n';
    read_time(object, "gap", &config.gap);
    read_time(object, "target_timeout", &config.target_timeout);
    read_time(object, "reserve", &config.reserve);
    read_time(object, "max_delay", &config.max_delay);
    alter_host_init(&alter, &config);
    return true;
}

static void alter_connected(uint64_t now) { alter_host_connected(&alter, now); }

static void alter_disconnected(uint64_t now) { alter_host_disconnected(&alter, now); }

static size_t alter_input(uint64_t now, const uint8_t *data, size_t size)
{
    return alter_host_input(&alter, now, data, size);
}

static void alter_timeout(uint64_t now) { alter_host_timeout(&alter, now); }

static void alter_transmitted(uint64_t now) { (void)now; }

static bool alter_call(uint64_t now, const char *name, const struct json *argument)
{
    int64_t values[VAL2_ALTER_AXES], code;
    int16_t target[VAL2_ALTER_AXES];
    if (strcmp(name, "exception") == 0)
        return json_integer(argument, 0, UINT8_MAX, &code) && alter_host_exception(&alter, (uint8_t)code);
    if (strcmp(name, "set_target") == 0) {
        if (!read_list(argument, VAL2_ALTER_AXES, INT16_MIN, INT16_MAX, values))
            return false;
        for (int axis = 0; axis < VAL2_ALTER_AXES; axis++)
            target[axis] = (int16_t)values[axis];
        alter_host_set_target(&alter, now, target);
    } else if (strcmp(name, "clear_target") == 0) {
        alter_host_clear_target(&alter);
    } else if (strcmp(name, "set_policy") == 0) {
        read_policy(argument, &alter.policy);
    } else if (strcmp(name, "set_subroutine") == 0) {
        alter.subroutine = json_true(argument);
    } else {
        alter_host_stop(&alter);
    }
    return true;
}

static bool alter_event(bool is_first)
{
    static const char *const NAMES[] = {"",        "corrupt", "lost",         "exception",
                                        "stopped", "missed",  "target_stale", "rejected",
                                        "delayed", "unexpected"};
    struct alter_host_event event;
    if (!alter_host_event(&alter, &event))
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

static size_t alter_transmit(uint64_t now, uint8_t *out, size_t size)
{
    return alter_host_transmit(&alter, now, out, size);
}

static bool alter_deadline(uint64_t *deadline) { return alter_host_deadline(&alter, deadline); }

const struct end ALTER_HOST = {"val2-alter",       "host",      alter_begin,    alter_connected,
                               alter_disconnected, alter_input, alter_timeout,  alter_transmitted,
                               alter_call,         alter_event, alter_transmit, alter_deadline};
