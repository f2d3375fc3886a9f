#include "cellwire/modbus_client.h"

#include "../end.h"

ADAPT(modbus_client)

static struct modbus_client_config config;

static bool init(unsigned places)
{
    config.places = places;
    return modbus_client_init(&session, &config);
}

static bool begin(const struct json *object)
{
    unsigned baud = 19200;
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    config = modbus_client_default(read_modbus_line(object), baud);
    read_unsigned(object, "places", MODBUS_CLIENT_PLACES, &config.places);
    read_unsigned(object, "in_flight", MODBUS_CLIENT_PLACES, &config.in_flight);
    config.any_unit = json_true(json_get(object, "any_unit"));
    if (json_get(object, "broadcast") != NULL)
        config.broadcast = json_true(json_get(object, "broadcast"));
    read_time(object, "silence", &config.silence);
    read_time(object, "stall", &config.silence);
    read_time(object, "timeout", &config.timeout);
    read_time(object, "turnaround", &config.turnaround);
    read_time(object, "settle", &config.settle);
    read_time(object, "pause", &config.pause);
    config.echo = json_true(json_get(object, "echo"));
    if (config.framing == MODBUS_LINE_TCP)
        config.silence = 0; /* which is not looked at */
    unsigned places = config.places;
    bool is_bounded = !init(0) && !init(MODBUS_CLIENT_PLACES + 1) && (init(1) || config.in_flight > 1);
    return init(places) && is_bounded;
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    static struct modbus_message request;
    (void)now, (void)name;
    request = (struct modbus_message){.transaction = 1}; /* which is not looked at */
    return read_modbus_request(argument, &request) && modbus_client_request(&session, &request) > 0;
}

static void print_mismatch(const struct modbus_client_event *event)
{
    static const char *const KINDS[] = {"", "unit", "function", "quantity", "echo"};
    print("{\"kind\":\"%s\"", KINDS[event->misfit]);
    if (event->misfit != MODBUS_CLIENT_ECHO)
        print(",\"expected\":%u,\"found\":%u", event->expected, event->found);
    print("}");
}

static void print_failure(const struct modbus_client_event *event)
{
    print(",\"ticket\":%llu,\"reason\":", (unsigned long long)event->ticket);
    if (event->reason != NULL) {
        print("\"%s\"", event->reason);
        return;
    }
    print("{\"%s\":", event->misfit == MODBUS_CLIENT_MALFORMED ? "malformed" : "mismatch");
    if (event->misfit == MODBUS_CLIENT_MALFORMED)
        print_modbus_error(&event->error);
    else
        print_mismatch(event);
    print("}");
}

static void print_stray(const struct modbus_client_event *event)
{
    print(",\"unit\":%u,\"function\":%u", event->unit, event->function);
    if (session.config.framing == MODBUS_LINE_TCP)
        print(",\"transaction\":%u", event->transaction);
    if (event->late > 0)
        print(",\"late\":%llu", (unsigned long long)event->late);
    if (event->misfit >= MODBUS_CLIENT_UNIT && event->misfit <= MODBUS_CLIENT_ECHO) {
        print(",\"mismatch\":");
        print_mismatch(event);
    }
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"replied", "announced", "failed", "stray", "corrupt", "out_of_step", "echo", "unexpected"};
    struct modbus_client_event event;
    if (!modbus_client_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    switch (event.kind) {
    case MODBUS_CLIENT_REPLIED:
        print(",\"ticket\":%llu,\"message\":", (unsigned long long)event.ticket);
        print_modbus_message(modbus_client_reply(&session, &event), false);
        break;
    case MODBUS_CLIENT_ANNOUNCED:
        print(",\"ticket\":%llu", (unsigned long long)event.ticket);
        break;
    case MODBUS_CLIENT_FAILED:
        print_failure(&event);
        break;
    case MODBUS_CLIENT_STRAY:
        print_stray(&event);
        break;
    case MODBUS_CLIENT_CORRUPT:
    case MODBUS_CLIENT_OUT_OF_STEP:
        print(",\"error\":");
        print_modbus_error(&event.error);
        break;
    case MODBUS_CLIENT_LINE_ECHO:
        print_line_echo(&event.echo);
        break;
    case MODBUS_CLIENT_UNEXPECTED:
        break;
    }
    print("}");
    return true;
}

const struct end MODBUS_CLIENT_END = {END("fanuc-hmi-modbus", "client")};
