#include "cellwire/ball.h"

#include "../end.h"

static struct ball session;

static bool begin(const struct json *object)
{
    unsigned type = 0, sensor = 0;
    read_unsigned(object, "sensor_type", UINT8_MAX, &type);
    read_unsigned(object, "sensor", UINT8_MAX, &sensor);
    return ball_init(&session, (uint8_t)type, (uint8_t)sensor, json_true(json_get(object, "echo")));
}

static void connected(uint64_t now)
{
    (void)now;
    ball_connected(&session);
}

static void disconnected(uint64_t now)
{
    (void)now;
    ball_disconnected(&session);
}

static size_t input(uint64_t now, const uint8_t *data, size_t size)
{
    (void)now;
    return ball_input(&session, data, size);
}

static void timeout(uint64_t now) { (void)now; }

static size_t transmit(uint64_t now, uint8_t *out, size_t size)
{
    (void)now;
    return ball_transmit(&session, out, size);
}

static bool deadline(uint64_t *at)
{
    (void)at;
    return false;
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int64_t values[6], keys;
    int8_t force[3], moment[3];
    (void)now, (void)name;
    if (!read_list(json_get(argument, "force"), 3, INT8_MIN, INT8_MAX, values) ||
        !read_list(json_get(argument, "moment"), 3, INT8_MIN, INT8_MAX, values + 3) ||
        !json_integer(json_get(argument, "keys"), 0, UINT8_MAX, &keys))
        return false;
    for (int axis = 0; axis < 3; axis++) {
        force[axis] = (int8_t)values[axis];
        moment[axis] = (int8_t)values[3 + axis];
    }
    ball_measure(&session, force, moment, (uint8_t)keys);
    return true;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"reply", "ignored", "unknown", "echo", "unexpected"};
    struct ball_event event;
    if (!ball_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind == BALL_REPLY) {
        print(",\"message\":");
        print_isra_packet(&event.packet);
    } else if (event.kind == BALL_UNKNOWN) {
        print(",\"byte\":%d", event.byte);
    } else if (event.kind == BALL_LINE_ECHO) {
        print_line_echo(&event.echo);
    }
    print("}");
    return true;
}

const struct end BALL = {END("isra-ball", "ball")};
