#include "cellwire/mmacell_device.h"

#include <string.h>

#include "../end.h"

#define AXES 2 /* the stories' device is a platform */

static struct mmacell_device session;

static bool begin(const struct json *object)
{
    struct mmacell_device_config config = {.axes_len = AXES, .refusal = 1};
    int64_t refusal = 1;
    json_integer(json_get(object, "refusal"), INT32_MIN, INT32_MAX, &refusal);
    config.refusal = (int32_t)refusal;
    read_mmacell_dialect(json_get(object, "accepts"), &config.accepts);
    read_mmacell_dialect(json_get(object, "writes"), &config.writes);
    return mmacell_device_init(&session, &config);
}

static void connected(uint64_t now)
{
    (void)now;
    mmacell_device_connected(&session);
}

static void disconnected(uint64_t now)
{
    (void)now;
    mmacell_device_disconnected(&session);
}

static size_t input(uint64_t now, const uint8_t *data, size_t size)
{
    (void)now;
    return mmacell_device_input(&session, data, size);
}

static void timeout(uint64_t now) { (void)now; }

static size_t transmit(uint64_t now, uint8_t *out, size_t size)
{
    (void)now;
    return mmacell_device_transmit(&session, out, size);
}

static bool deadline(uint64_t *at)
{
    (void)at;
    return false;
}

static bool accept(bool is_asked)
{
    struct mmacell_proto_message order = session.order;
    if (session.link != MMACELL_DEVICE_WAITING)
        order = (struct mmacell_proto_message){.kind = MMACELL_PROTO_STP};
    else if (!is_asked)
        order.kind = order.kind == MMACELL_PROTO_STP ? MMACELL_PROTO_CLO : MMACELL_PROTO_STP;
    return mmacell_device_accept(&session, &order);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int32_t pose[AXES];
    int64_t number = 0;
    (void)now;
    if (strcmp(name, "accept") == 0 || strcmp(name, "accept_another") == 0)
        return accept(strcmp(name, "accept") == 0);
    if (strcmp(name, "refuse") == 0)
        return json_integer(argument, INT32_MIN, INT32_MAX, &number) && mmacell_device_refuse(&session, (int32_t)number);
    if (strcmp(name, "set_pose") == 0) {
        size_t axis = 0;
        for (const struct json *at = argument->child; at != NULL && axis < AXES; at = at->next, axis++) {
            double value;
            if (!json_number(at, &value) || !mmacell_proto_round(value, mmacell_proto_decimals(AXES, axis), &pose[axis]))
                break;
        }
        mmacell_device_set_pose(&session, axis == AXES ? pose : NULL);
    } else if (strcmp(name, "fail") == 0) {
        json_integer(argument, INT32_MIN, INT32_MAX, &number);
        mmacell_device_fail(&session, (int32_t)number);
    } else {
        mmacell_device_arrived(&session);
    }
    return true;
}

static void print_order(const struct mmacell_proto_message *order)
{
    static const char *const NAMES[] = {"", "stop", "home", "close", "servo", "override", "move", "acquire", "grip"};
    print(",\"order\":{\"order\":\"%s\"", NAMES[order->kind]);
    if (order->kind == MMACELL_PROTO_SRV)
        print(",\"on\":%s", order->flag ? "true" : "false");
    if (order->kind == MMACELL_PROTO_OVR)
        print(",\"percent\":%d", (int)order->number);
    if (order->kind == MMACELL_PROTO_ACQ)
        print(",\"camera\":%d", (int)order->number);
    if (order->kind == MMACELL_PROTO_HND)
        print(",\"gripper\":%d,\"open\":%s", (int)order->number, order->flag ? "true" : "false");
    if (order->kind == MMACELL_PROTO_MOV)
        print(",\"target\":[%.4f,%.4f]", order->axes[0] / 1e4, order->axes[1] / 1e4);
    print("}");
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"asked",    "rejected", "rejected", "rejected",
                                        "rejected", "closed",   "closed",   "unexpected"};
    static const char *const STATES[] = {"Off", "Still", "Moving", "Stopping", "Fault"};
    struct mmacell_device_event event;
    if (!mmacell_device_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    switch (event.kind) {
    case MMACELL_DEVICE_ASKED:
        print_order(&event.order);
        break;
    case MMACELL_DEVICE_NOT_NOW:
        print(",\"reason\":{\"not_now\":{\"state\":\"%s\"}}", STATES[event.axes]);
        break;
    case MMACELL_DEVICE_NO_POSE:
        print(",\"reason\":\"no_pose\"");
        break;
    case MMACELL_DEVICE_OUT_OF_RANGE:
        print(",\"reason\":\"out_of_range\"");
        break;
    case MMACELL_DEVICE_MALFORMED:
        print(",\"reason\":{\"malformed\":");
        print_mmacell_error(&event.item);
        print("}");
        break;
    case MMACELL_DEVICE_AGREED:
        print(",\"reason\":\"agreed\"");
        break;
    case MMACELL_DEVICE_OVERRUN:
        print(",\"reason\":\"overrun\"");
        break;
    case MMACELL_DEVICE_UNEXPECTED:
        break;
    }
    print("}");
    return true;
}

const struct end MMACELL_DEVICE = {END("mmacell-proto", "device")};
