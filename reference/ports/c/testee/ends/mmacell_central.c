#include "cellwire/mmacell_central.h"

#include <string.h>

#include "../end.h"

ADAPT(mmacell_central)

static bool begin(const struct json *object)
{
    struct mmacell_central_config config = MMACELL_CENTRAL_DEFAULT;
    int64_t tolerance;
    read_mmacell_dialect(json_get(object, "accepts"), &config.accepts);
    read_mmacell_dialect(json_get(object, "writes"), &config.writes);
    read_time(object, "timeout", &config.timeout);
    read_time(object, "settle", &config.settle);
    if (json_integer(json_get(object, "tolerance"), 0, INT32_MAX, &tolerance))
        config.tolerance = (int32_t)tolerance;
    return mmacell_central_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    struct mmacell_proto_message command = {0};
    (void)now;
    if (strcmp(name, "abort") == 0) {
        mmacell_central_abort(&session);
        return true;
    }
    return read_mmacell_command(argument, &command) && mmacell_central_request(&session, &command);
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"connected", "done", "refused", "status", "aborted", "closed", "unexpected"};
    static const char *const UNFINISHED[] = {NULL, "not_sent", "unknown"};
    struct mmacell_central_event event;
    if (!mmacell_central_event(&session, &event))
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

const struct end MMACELL_CENTRAL = {END("mmacell-proto", "central")};
