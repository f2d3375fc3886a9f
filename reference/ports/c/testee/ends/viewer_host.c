#include "cellwire/viewer_host.h"

#include "../end.h"

ADAPT(viewer_host)

static bool begin(const struct json *object)
{
    struct viewer_host_config config = VIEWER_HOST_DEFAULT;
    read_time(object, "interval", &config.interval);
    read_time(object, "max_age", &config.max_age);
    read_time(object, "max_hold", &config.max_hold);
    config.echo = json_true(json_get(object, "echo"));
    return viewer_host_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int16_t words[VAL2_VIEWER_WORDS];
    (void)name;
    if (!read_viewer_words(argument, words))
        return false;
    viewer_host_set_pose(&session, now, words);
    return true;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"asked", "ignored", "stale", "hold_ended", "sent", "unknown", "echo", "unexpected"};
    struct viewer_host_event event;
    if (!viewer_host_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind == VIEWER_HOST_SENT) {
        print(",\"message\":");
        print_viewer_pose(&event.pose);
    } else if (event.kind == VIEWER_HOST_UNKNOWN) {
        print(",\"byte\":%d", event.byte);
    } else if (event.kind == VIEWER_HOST_LINE_ECHO) {
        print_line_echo(&event.echo);
    }
    print("}");
    return true;
}

const struct end VIEWER_HOST = {END("val2-viewer", "host")};
