/* Decodes vectors, encodes what they say again, and lets a ball and its host work for a minute of a clock that is counted here. */
#include "cellwire/ball.h"
#include "cellwire/ball_host.h"
#include "cellwire/fanuc_hmi_modbus.h"
#include "cellwire/kawasaki_msg.h"
#include "cellwire/laser_eb90.h"
#include "cellwire/mmacell_proto.h"
#include "cellwire/val2_alter.h"
#include "cellwire/val2_viewer.h"
#include <string.h>

#include "start.h"

#define MS UINT64_C(1000000)
#define MINUTE (60000 * MS)
#define MAX_FRAME 4100

enum { FANUC_HMI_MODBUS, ISRA_BALL, KAWASAKI_MSG, LASER_EB90, MMACELL_PROTO, VAL2_ALTER, VAL2_VIEWER };

static const struct vector {
    uint8_t link, side; /* `side` is that of the link's enumeration */
    bool is_valid;
    uint16_t size;
    const char *bytes;
} VECTORS[] = {
#include "vectors.h"
};

static uint8_t out[MAX_FRAME];

/* What a link's decoder finds first: whether it is a message, its length, and how many bytes it has when it is encoded. */
#define READ(prefix, item_type, is_message, ...)                                                                       \
    do {                                                                                                               \
        static struct prefix##_decoder decoder;                                                                        \
        static struct item_type item;                                                                                  \
        prefix##_init(&decoder, ##__VA_ARGS__);                                                                        \
        prefix##_push(&decoder, bytes, vector->size);                                                                  \
        prefix##_end(&decoder);                                                                                        \
        if (!prefix##_next(&decoder, &item))                                                                           \
            return false;                                                                                              \
        if (!(is_message))                                                                                             \
            return !vector->is_valid;                                                                                  \
        if (!vector->is_valid || item.length != vector->size)                                                          \
            return false;                                                                                              \
        ENCODE;                                                                                                        \
    } while (0)

static bool is_same(const struct vector *vector, size_t length)
{
    return length == vector->size && memcmp(out, vector->bytes, length) == 0;
}

static bool is_read(const struct vector *vector)
{
    const uint8_t *bytes = (const uint8_t *)vector->bytes;
    const struct mmacell_proto_dialect strict = {0};
    const struct val2_alter_framing framing = {0};
    switch (vector->link) {
#define ENCODE return is_same(vector, modbus_encode(&item.message, MODBUS_TCP, out, sizeof out))
    case FANUC_HMI_MODBUS:
        READ(modbus, modbus_item, item.error == MODBUS_NO_ERROR, (enum modbus_side)vector->side, MODBUS_TCP);
#undef ENCODE
#define ENCODE return is_same(vector, isra_ball_encode(&item.packet, out, sizeof out))
    case ISRA_BALL:
        READ(isra_ball, isra_ball_item, item.kind == ISRA_BALL_PACKET);
#undef ENCODE
#define ENCODE return true
    case KAWASAKI_MSG:
        READ(kawasaki_msg, kawasaki_msg_item, item.error.kind == KAWASAKI_MSG_MESSAGE, false);
    case LASER_EB90:
        READ(laser_eb90, laser_eb90_result, item.kind == LASER_EB90_FRAME, LASER_EB90_DEFAULT);
#undef ENCODE
#define ENCODE return is_same(vector, mmacell_proto_encode(&item.message, strict, out, sizeof out))
    case MMACELL_PROTO:
        READ(mmacell_proto, mmacell_proto_item, item.message.kind <= MMACELL_PROTO_ER, (enum mmacell_proto_side)vector->side, strict);
#undef ENCODE
#define ENCODE return is_same(vector, val2_alter_encode(&item.message, framing, out, sizeof out))
    case VAL2_ALTER:
        READ(val2_alter, val2_alter_item, !item.is_error, (enum val2_alter_side)vector->side, framing);
#undef ENCODE
#define ENCODE return is_same(vector, val2_viewer_encode(&item.pose, out, sizeof out))
    case VAL2_VIEWER:
        READ(val2_viewer, val2_viewer_item, item.kind == VAL2_VIEWER_POSE);
#undef ENCODE
    }
    return false;
}

/* How many new values a host has of a ball in a minute; each reply takes 13 ms, and the ball measures between them. */
static unsigned play(void)
{
    static struct ball_host host;
    static struct ball ball;
    struct ball_host_event news;
    struct ball_event reply;
    const int8_t force[3] = {1, -2, 3}, moment[3] = {-4, 5, -6};
    unsigned count = 0;
    uint64_t now = 0;
    if (!ball_host_init(&host, &BALL_HOST_DEFAULT) || !ball_init(&ball, 0, 0, false))
        return 0;
    ball_host_connected(&host, now);
    ball_connected(&ball);
    while (now < MINUTE && ball_host_deadline(&host, &now)) {
        size_t length = ball_host_transmit(&host, now, out, sizeof out);
        ball_measure(&ball, force, moment, 0x81);
        ball_input(&ball, out, length);
        length = ball_transmit(&ball, out, sizeof out);
        now += 13 * MS;
        if (ball_host_input(&host, now, out, length) != length)
            return 0;
        while (ball_event(&ball, &reply))
            ;
        while (ball_host_event(&host, &news))
            count += news.kind == BALL_HOST_NEW && news.packet.keys == 0x81;
    }
    return count;
}

int run(void)
{
    static char number[] = "vector 0000 is read in another way\n";
    for (size_t i = 0; i < sizeof VECTORS / sizeof *VECTORS; i++) {
        if (is_read(&VECTORS[i]))
            continue;
        for (size_t digit = 0, rest = i; digit < 4; digit++, rest /= 10)
            number[10 - digit] = (char)('0' + rest % 10);
        say(number);
        return 1;
    }
    if (play() != 2141) {
        say("the host has not as many new values as it polls, but the first\n");
        return 1;
    }
    say("ok\n");
    return 0;
}
