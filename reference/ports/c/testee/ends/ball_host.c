#include "cellwire/ball_host.h"

#include "../end.h"

ADAPT(ball_host)

static bool begin(const struct json *object)
{
    struct ball_host_config config = BALL_HOST_DEFAULT;
    unsigned baud = config.baud;
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    config.baud = baud;
    read_time(object, "period", &config.period);
    read_time(object, "max_delay", &config.max_delay);
    read_time(object, "max_age", &config.max_age);
    config.echo = json_true(json_get(object, "echo"));
    return ball_host_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    (void)now, (void)name, (void)argument;
    return false;
}

static void print_corrupt(const struct ball_host_event *event)
{
    static const char *const KINDS[] = {"", "layout", "noise", "checksum", "incomplete"};
    print(",\"error\":{\"kind\":\"%s\"", KINDS[event->error]);
    if (event->error == ISRA_BALL_NOISE)
        print(",\"length\":%zu", event->length);
    else if (event->error == ISRA_BALL_RAW)
        print(",\"expected\":8,\"found\":%zu", event->found);
    else
        print(",\"expected\":%zu,\"found\":%zu", event->expected, event->found);
    if (event->error == ISRA_BALL_CHECKSUM)
        print(",\"offset\":%zu", event->error_offset);
    print("}");
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"new", "old", "unasked", "missed", "stale", "corrupt", "echo", "unexpected"};
    struct ball_host_event event;
    if (!ball_host_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind <= BALL_HOST_UNASKED) {
        print(",\"message\":");
        print_isra_packet(&event.packet);
    } else if (event.kind == BALL_HOST_CORRUPT) {
        print_corrupt(&event);
    } else if (event.kind == BALL_HOST_LINE_ECHO) {
        print_line_echo(&event.echo);
    }
    if (event.kind == BALL_HOST_NEW && event.live_until != UINT64_MAX)
        print(",\"live_until\":%llu", (unsigned long long)event.live_until);
    print("}");
    return true;
}

const struct end BALL_HOST = {END("isra-ball", "host")};
