#include "cellwire/isra_ball.h"

#include "link.h"

static const char *const STATUSES[] = {"fresh", "old", "reserved"};
static struct isra_ball_decoder decoder;

static bool begin(const struct json *request)
{
    (void)request;
    isra_ball_init(&decoder);
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return isra_ball_push(&decoder, data, size); }

static void end(void) { isra_ball_end(&decoder); }

void print_isra_packet(const struct isra_ball_packet *packet)
{
    print("{\"sensor_type\":%d,\"sensor\":%d,", packet->sensor_type, packet->sensor);
    print("\"status\":\"%s\",\"keys\":%d,\"force\":", STATUSES[packet->status], packet->keys);
    PRINT_LIST(packet->force, 3);
    print(",\"moment\":");
    PRINT_LIST(packet->moment, 3);
    print("}");
}

static bool next(bool ended)
{
    struct isra_ball_item item;
    if (!isra_ball_next(&decoder, &item))
        return false;
    print_item(item.offset, item.length, ended);
    switch (item.kind) {
    case ISRA_BALL_PACKET:
        print("\"message\":");
        print_isra_packet(&item.packet);
        break;
    case ISRA_BALL_RAW:
        print("\"message\":{\"data\":");
        PRINT_LIST(item.raw, item.raw_len);
        print("}");
        break;
    case ISRA_BALL_NOISE:
        print("\"error\":{\"kind\":\"noise\",\"length\":%zu}", item.length);
        break;
    case ISRA_BALL_CHECKSUM:
        print("\"error\":{\"kind\":\"checksum\",\"offset\":%zu,", item.error_offset);
        print("\"expected\":%zu,\"found\":%zu}", item.expected, item.found);
        break;
    case ISRA_BALL_INCOMPLETE:
        print("\"error\":{\"kind\":\"incomplete\",\"expected\":%zu,\"found\":%zu}", item.expected, item.found);
        break;
    }
    return true;
}

static size_t encode(const struct json *message, uint8_t *out, size_t size)
{
    struct isra_ball_packet packet = {0};
    const struct json *status = json_get(message, "status");
    int64_t type, sensor, keys, force[3], moment[3];
    int found = 0;
    while (found < 3 && !json_is(status, STATUSES[found]))
        found++;
    if (message->count != 6 || found == 3 || !json_integer(json_get(message, "sensor_type"), 0, 255, &type) ||
        !json_integer(json_get(message, "sensor"), 0, 255, &sensor) ||
        !json_integer(json_get(message, "keys"), 0, 255, &keys) ||
        !read_list(json_get(message, "force"), 3, INT8_MIN, INT8_MAX, force) ||
        !read_list(json_get(message, "moment"), 3, INT8_MIN, INT8_MAX, moment))
        return 0;
    packet.status = (enum isra_ball_status)found;
    packet.sensor_type = (uint8_t)type;
    packet.sensor = (uint8_t)sensor;
    packet.keys = (uint8_t)keys;
    for (int axis = 0; axis < 3; axis++) {
        packet.force[axis] = (int8_t)force[axis];
        packet.moment[axis] = (int8_t)moment[axis];
    }
    return isra_ball_encode(&packet, out, size);
}

const struct link ISRA_BALL = {"isra-ball", begin, push, end, next, encode};
