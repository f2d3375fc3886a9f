#include "cellwire/viewer_workstation.h"

#include "../end.h"

ADAPT(viewer_workstation)

static bool begin(const struct json *object)
{
    struct viewer_workstation_config config = VIEWER_WORKSTATION_DEFAULT;
    read_time(object, "pause", &config.pause);
    read_time(object, "stale_after", &config.stale_after);
    read_time(object, "max_hold", &config.max_hold);
    config.echo = json_true(json_get(object, "echo"));
    return viewer_workstation_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    (void)name, (void)argument;
    viewer_workstation_draw(&session, now);
    return true;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"pose", "unasked", "missed", "stale", "corrupt", "hold_ended", "echo", "unexpected"};
    struct viewer_workstation_event event;
    if (!viewer_workstation_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind <= VIEWER_WORKSTATION_UNASKED) {
        print(",\"message\":");
        print_viewer_pose(&event.item.pose);
    } else if (event.kind == VIEWER_WORKSTATION_CORRUPT) {
        print(",\"error\":");
        print_viewer_error(&event.item);
    } else if (event.kind == VIEWER_WORKSTATION_LINE_ECHO) {
        print_line_echo(&event.echo);
    }
    if (event.kind == VIEWER_WORKSTATION_POSE && event.live_until != UINT64_MAX)
        print(",\"live_until\":%llu", (unsigned long long)event.live_until);
    print("}");
    return true;
}

const struct end VIEWER_WORKSTATION = {END("val2-viewer", "workstation")};
