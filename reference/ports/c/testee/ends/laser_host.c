#include "cellwire/laser_host.h"

#include <string.h>

#include "../end.h"

ADAPT(laser_host)

static void transmitted(uint64_t now) { laser_host_transmitted(&session, now); }

static bool begin(const struct json *object)
{
    unsigned baud = 9600;
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    struct laser_host_config config = laser_host_default(baud);
    read_laser_profile(json_get(object, "profile"), &config.profile);
    read_laser_words(json_get(object, "words"), &config.words);
    read_unsigned(object, "batch", UINT16_MAX, &config.batch);
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
    config.echo = json_true(json_get(object, "echo"));
    return laser_host_init(&session, &config);
}

static bool laser_submit(const struct json *instruction)
{
    struct laser_eb90_payload parameters = {.profile = &session.config.profile};
    const struct json *items = json_get(instruction, "parameters");
    int64_t word;
    for (const struct json *item = items == NULL ? NULL : items->child; item != NULL; item = item->next)
        if (!put_laser_item(&parameters, item))
            return false;
    return json_integer(json_get(instruction, "word"), 0, UINT16_MAX, &word) &&
           laser_host_submit(&session, (uint16_t)word, &parameters);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    (void)now;
    if (strcmp(name, "submit") == 0)
        return laser_submit(argument);
    if (strcmp(name, "resume") == 0)
        laser_host_resume(&session);
    else
        laser_host_take_back(&session);
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
        print_laser_items(&session.config.profile, session.answer.payload, session.answer.payload_len, word_len);
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
    case LASER_HOST_LINE_ECHO:
        print_line_echo(&event->echo);
        return;
    case LASER_HOST_UNEXPECTED:
        return;
    }
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"done", "answer", "refused", "unknown", "unasked", "corrupt", "echo", "unexpected"};
    struct laser_host_event event;
    if (!laser_host_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    print_laser_event(&event);
    print("}");
    return true;
}

const struct end LASER_HOST = {END("laser-eb90", "host"), .transmitted = transmitted};
