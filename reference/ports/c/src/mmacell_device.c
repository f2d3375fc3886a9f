#include "cellwire/mmacell_device.h"

#include "session.h"

#define MAX_COORDINATE 999999
#define GENERIC_ERROR 1
/* Places for outcomes, and those that a line, or a connection, needs (MM-50). */
#define PLACES 8
#define NEEDED 2

static struct mmacell_device_event *report(struct mmacell_device *device, enum mmacell_device_kind kind)
{
    struct mmacell_device_event *event = ADD_EVENT(device);
    event->kind = kind;
    return event;
}

/* Whether there is room for two outcomes (MM-50): an order, and the end of the connection. */
static bool has_room(const struct mmacell_device *device)
{
    size_t outcomes = 0;
    for (size_t i = 0; i < device->event_count; i++) {
        enum mmacell_device_kind kind = device->events[i].kind;
        outcomes += kind == MMACELL_DEVICE_ASKED || kind == MMACELL_DEVICE_AGREED || kind == MMACELL_DEVICE_OVERRUN;
    }
    return outcomes + NEEDED <= PLACES && device->event_count + NEEDED <= MMACELL_DEVICE_EVENTS;
}

/* Whether an error number can be sent. */
static bool has_form(const struct mmacell_device *device, int32_t error)
{
    struct mmacell_proto_message reply = {.kind = MMACELL_PROTO_ER, .number = error};
    uint8_t line[MMACELL_PROTO_MAX_LINE];
    return mmacell_proto_encode(&reply, device->config.writes, line, sizeof line) > 0;
}

bool mmacell_device_init(struct mmacell_device *device, const struct mmacell_device_config *config)
{
    memset(device, 0, sizeof *device);
    device->config = *config;
    device->override = 100;
    mmacell_proto_init(&device->decoder, MMACELL_PROTO_CENTRAL, config->accepts);
    return (config->axes_len == 4 || config->axes_len == 2) && has_form(device, config->refusal);
}

/* MM-56 */
static void restart(struct mmacell_device *device, enum mmacell_device_link link)
{
    device->link = link;
    device->kept_len = 0;
    mmacell_proto_init(&device->decoder, MMACELL_PROTO_CENTRAL, device->config.accepts);
    device->decoder.axes_len = device->config.axes_len;
}

void mmacell_device_connected(struct mmacell_device *device)
{
    restart(device, has_room(device) ? MMACELL_DEVICE_IDLE : MMACELL_DEVICE_DOWN);
}

void mmacell_device_disconnected(struct mmacell_device *device) { restart(device, MMACELL_DEVICE_DOWN); }

static void answer(struct mmacell_device *device, enum mmacell_proto_kind kind, int32_t error)
{
    device->reply = (struct mmacell_proto_message){.kind = kind, .number = error};
    device->link = MMACELL_DEVICE_ANSWERING;
}

static struct mmacell_device_event *reject(struct mmacell_device *device, enum mmacell_device_kind kind)
{
    answer(device, MMACELL_PROTO_ER, device->config.refusal);
    struct mmacell_device_event *event = report(device, kind);
    event->axes = device->axes;
    return event;
}

/* MM-52 */
static void answer_status(struct mmacell_device *device)
{
    bool is_moving = device->axes == MMACELL_DEVICE_MOVING || device->axes == MMACELL_DEVICE_STOPPING;
    if (!device->has_pose) {
        reject(device, MMACELL_DEVICE_NO_POSE);
        return;
    }
    answer(device, MMACELL_PROTO_STATUS, device->axes == MMACELL_DEVICE_FAULT ? device->fault : 0);
    device->reply.flag = is_moving;
    device->reply.servo = is_moving || device->axes == MMACELL_DEVICE_STILL;
    device->reply.override = device->override;
    device->reply.axes_len = device->config.axes_len;
    memcpy(device->reply.axes, device->pose, sizeof device->pose);
}

/* MM-74 */
static bool is_possible(const struct mmacell_device *device, const struct mmacell_proto_message *order)
{
    if (order->kind == MMACELL_PROTO_SRV)
        return !(order->flag && device->axes == MMACELL_DEVICE_FAULT);
    return order->kind != MMACELL_PROTO_MOV || device->axes == MMACELL_DEVICE_STILL;
}

/* MM-53: a relative move as an absolute one; false: it is refused. */
static bool make_absolute(struct mmacell_device *device, struct mmacell_proto_message *order)
{
    order->flag = false;
    if (!device->has_pose) {
        reject(device, MMACELL_DEVICE_NO_POSE);
        return false;
    }
    for (size_t axis = 0; axis < order->axes_len; axis++) {
        order->axes[axis] += device->pose[axis];
        if (order->axes[axis] < -MAX_COORDINATE || order->axes[axis] > MAX_COORDINATE) {
            reject(device, MMACELL_DEVICE_OUT_OF_RANGE);
            return false;
        }
    }
    return true;
}

/* MM-51, MM-53 */
static void take_line(struct mmacell_device *device, const struct mmacell_proto_item *item)
{
    struct mmacell_proto_message order = item->message;
    if (device->link == MMACELL_DEVICE_DOWN) {
        report(device, MMACELL_DEVICE_UNEXPECTED);
    } else if (order.kind >= MMACELL_PROTO_TOO_LONG) {
        reject(device, MMACELL_DEVICE_MALFORMED)->item = *item;
    } else if (order.kind == MMACELL_PROTO_STA) {
        answer_status(device);
    } else if (order.kind == MMACELL_PROTO_MOV && order.flag && !make_absolute(device, &order)) {
        return;
    } else if (!is_possible(device, &order)) {
        reject(device, MMACELL_DEVICE_NOT_NOW);
    } else {
        device->order = order;
        device->link = MMACELL_DEVICE_WAITING;
        report(device, MMACELL_DEVICE_ASKED)->order = order;
    }
}

/* Reads the bytes that are kept, up to the end of a line that waits for something. */
static void read_lines(struct mmacell_device *device)
{
    struct mmacell_proto_item item;
    size_t read = 0;
    while (device->link == MMACELL_DEVICE_DOWN || (device->link == MMACELL_DEVICE_IDLE && has_room(device))) {
        if (mmacell_proto_next(&device->decoder, &item))
            take_line(device, &item);
        else if (read < device->kept_len)
            read += mmacell_proto_push(&device->decoder, device->kept + read, 1);
        else
            break;
    }
    device->kept_len -= read;
    memmove(device->kept, device->kept + read, device->kept_len);
}

size_t mmacell_device_input(struct mmacell_device *device, const uint8_t *data, size_t size)
{
    size_t part;
    for (size_t taken = 0; taken < size; taken += part) {
        size_t room = MMACELL_DEVICE_KEPT - device->kept_len;
        if (device->link == MMACELL_DEVICE_ENDED)
            break;
        if (room == 0) {
            restart(device, MMACELL_DEVICE_ENDED);
            report(device, MMACELL_DEVICE_OVERRUN);
            return size;
        }
        part = size - taken < room ? size - taken : room;
        memcpy(device->kept + device->kept_len, data + taken, part);
        device->kept_len += part;
        read_lines(device);
    }
    return size;
}

static bool is_same(const struct mmacell_proto_message *one, const struct mmacell_proto_message *other)
{
    bool is_move = one->kind == MMACELL_PROTO_MOV;
    return one->kind == other->kind && one->flag == other->flag && one->number == other->number &&
           (!is_move || (one->axes_len == other->axes_len && memcmp(one->axes, other->axes, sizeof one->axes) == 0));
}

bool mmacell_device_accept(struct mmacell_device *device, const struct mmacell_proto_message *order)
{
    if (device->link != MMACELL_DEVICE_WAITING || !is_same(order, &device->order))
        return false;
    if (!is_possible(device, order)) {
        reject(device, MMACELL_DEVICE_NOT_NOW);
        return false;
    }
    answer(device, MMACELL_PROTO_OK, 0);
    if (order->kind == MMACELL_PROTO_CLO)
        device->link = MMACELL_DEVICE_LEAVING; /* MM-55 */
    else if (order->kind == MMACELL_PROTO_OVR)
        device->override = order->number;
    else if (order->kind == MMACELL_PROTO_MOV || order->kind == MMACELL_PROTO_RST)
        device->axes = MMACELL_DEVICE_MOVING;
    else if (order->kind == MMACELL_PROTO_STP && device->axes == MMACELL_DEVICE_MOVING)
        device->axes = MMACELL_DEVICE_STOPPING;
    else if (order->kind == MMACELL_PROTO_SRV && order->flag && device->axes == MMACELL_DEVICE_OFF)
        device->axes = MMACELL_DEVICE_STILL;
    else if (order->kind == MMACELL_PROTO_SRV && !order->flag && device->axes != MMACELL_DEVICE_FAULT)
        device->axes = MMACELL_DEVICE_OFF;
    return true;
}

bool mmacell_device_refuse(struct mmacell_device *device, int32_t error)
{
    if (device->link != MMACELL_DEVICE_WAITING || !has_form(device, error))
        return false;
    answer(device, MMACELL_PROTO_ER, error);
    return true;
}

void mmacell_device_set_pose(struct mmacell_device *device, const int32_t *axes)
{
    device->has_pose = axes != NULL;
    if (axes != NULL)
        memcpy(device->pose, axes, device->config.axes_len * sizeof *axes);
}

void mmacell_device_arrived(struct mmacell_device *device)
{
    if (device->axes == MMACELL_DEVICE_MOVING || device->axes == MMACELL_DEVICE_STOPPING)
        device->axes = MMACELL_DEVICE_STILL;
}

/* MM-57 */
void mmacell_device_fail(struct mmacell_device *device, int32_t error)
{
    device->axes = MMACELL_DEVICE_FAULT;
    device->fault = has_form(device, error) ? error : GENERIC_ERROR;
}

bool mmacell_device_event(struct mmacell_device *device, struct mmacell_device_event *event)
{
    return TAKE_EVENT(device, event);
}

size_t mmacell_device_transmit(struct mmacell_device *device, uint8_t *out, size_t size)
{
    read_lines(device); /* what has waited for room */
    bool is_leaving = device->link == MMACELL_DEVICE_LEAVING;
    bool is_answering = is_leaving || device->link == MMACELL_DEVICE_ANSWERING;
    if (!is_answering)
        return 0;
    size_t length = mmacell_proto_encode(&device->reply, device->config.writes, out, size);
    if (length == 0)
        return 0;
    device->link = is_leaving ? MMACELL_DEVICE_ENDED : MMACELL_DEVICE_IDLE;
    if (is_leaving)
        report(device, MMACELL_DEVICE_AGREED);
    read_lines(device);
    return length;
}
