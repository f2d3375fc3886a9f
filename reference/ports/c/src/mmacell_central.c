#include "cellwire/mmacell_central.h"

#include <string.h>

#include "session.h"

#define MAX_COORDINATE 999999

const struct mmacell_central_config MMACELL_CENTRAL_DEFAULT = {
    .device = MMACELL_PROTO_PLATFORM, .timeout = SECOND, .settle = 100 * MS, .tolerance = 10};

static bool is_notice(const struct mmacell_central_event *event)
{
    return event->kind == MMACELL_CENTRAL_CONNECTED || event->kind == MMACELL_CENTRAL_UNEXPECTED;
}

/* How many outcomes wait to be taken: a notice holds nothing up. */
static size_t outcomes(const struct mmacell_central *central)
{
    size_t count = 0;
    for (size_t i = 0; i < central->event_count; i++)
        count += !is_notice(&central->events[i]);
    return count;
}

/* A new event, in the place of the oldest notice if there is no other. */
static struct mmacell_central_event *report(struct mmacell_central *central, enum mmacell_central_kind kind)
{
    struct mmacell_central_event *first = central->events, *end = first + central->event_count;
    while (first < end && !is_notice(first))
        first++;
    if (central->event_count == MMACELL_CENTRAL_EVENTS && first < end) {
        memmove(first, first + 1, (size_t)(end - first - 1) * sizeof *first);
        central->event_count--;
    }
    struct mmacell_central_event *event = ADD_EVENT(central);
    event->kind = kind;
    event->message = central->command;
    return event;
}

/* The connection ends; a command that was not finished is reported with it (MM-36). */
static struct mmacell_central_event *close_link(struct mmacell_central *central, const char *reason,
                                                enum mmacell_central_link link)
{
    struct mmacell_central_event *event = report(central, MMACELL_CENTRAL_CLOSED);
    event->reason = reason;
    event->unfinished = central->link == MMACELL_CENTRAL_SENDING    ? MMACELL_CENTRAL_NOT_SENT
                        : central->link == MMACELL_CENTRAL_AWAITING ? MMACELL_CENTRAL_UNKNOWN
                                                                    : MMACELL_CENTRAL_NOTHING;
    central->link = link;
    return event;
}

static bool is_open(const struct mmacell_central *central)
{
    return central->link != MMACELL_CENTRAL_DOWN && central->link != MMACELL_CENTRAL_ENDED;
}

bool mmacell_central_init(struct mmacell_central *central, const struct mmacell_central_config *config)
{
    memset(central, 0, sizeof *central);
    central->config = *config;
    mmacell_proto_init(&central->decoder, config->device, config->accepts);
    return config->timeout > 0;
}

void mmacell_central_connected(struct mmacell_central *central, uint64_t now)
{
    if (outcomes(central) > 2) { /* MM-40 */
        mmacell_central_disconnected(central, now);
        return;
    }
    if (is_open(central))
        close_link(central, "disconnected", MMACELL_CENTRAL_DOWN);
    central->link = MMACELL_CENTRAL_IDLE;
    mmacell_proto_init(&central->decoder, central->config.device, central->config.accepts);
    central->motion = MMACELL_CENTRAL_REST; /* MM-39 */
    central->target = MMACELL_CENTRAL_NO_TARGET;
    central->has_pose = false;
    report(central, MMACELL_CENTRAL_CONNECTED);
}

void mmacell_central_disconnected(struct mmacell_central *central, uint64_t now)
{
    (void)now;
    if (is_open(central))
        close_link(central, "disconnected", MMACELL_CENTRAL_DOWN);
    central->link = MMACELL_CENTRAL_DOWN;
    mmacell_proto_init(&central->decoder, central->config.device, central->config.accepts);
}

/* Where a move ends (MM-42, MM-43). */
static void set_target(struct mmacell_central *central)
{
    const struct mmacell_proto_message *command = &central->command;
    bool is_relative = command->flag;
    central->target = MMACELL_CENTRAL_POSE;
    if (is_relative && (central->motion != MMACELL_CENTRAL_REST || !central->has_pose)) {
        central->target = MMACELL_CENTRAL_UNKNOWN_TARGET;
        return;
    }
    for (size_t axis = 0; axis < command->axes_len; axis++) {
        int32_t end = command->axes[axis] + (is_relative ? central->pose[axis] : 0);
        central->target_axes[axis] = end;
        if (end < -MAX_COORDINATE || end > MAX_COORDINATE)
            central->target = MMACELL_CENTRAL_UNKNOWN_TARGET;
    }
}

/* What `OK` to the command means for the motion (MM-42 to MM-44). */
static void done(struct mmacell_central *central, uint64_t now)
{
    switch (central->command.kind) {
    case MMACELL_PROTO_MOV:
    case MMACELL_PROTO_RST:
        if (central->command.kind == MMACELL_PROTO_MOV)
            set_target(central);
        else
            central->target = MMACELL_CENTRAL_UNKNOWN_TARGET;
        central->motion = MMACELL_CENTRAL_STARTING;
        central->believed_from = after(now, central->config.settle);
        return;
    case MMACELL_PROTO_SRV:
        if (central->command.flag)
            return;
        break;
    case MMACELL_PROTO_STP:
        break;
    default:
        return;
    }
    if (central->motion == MMACELL_CENTRAL_REST)
        central->target = MMACELL_CENTRAL_NO_TARGET;
    else
        central->motion = MMACELL_CENTRAL_STOPPING;
}

static bool is_there(const struct mmacell_central *central, const struct mmacell_proto_message *status)
{
    for (size_t axis = 0; axis < status->axes_len; axis++) {
        int32_t way = status->axes[axis] - central->target_axes[axis];
        if (way > central->config.tolerance || -way > central->config.tolerance)
            return false;
    }
    return central->target == MMACELL_CENTRAL_POSE;
}

/* What a status means for the motion (MM-70). */
static const char *status_motion(struct mmacell_central *central, const struct mmacell_proto_message *status)
{
    if (status->flag) {
        if (central->motion == MMACELL_CENTRAL_STOPPING)
            return "stopping";
        central->motion = MMACELL_CENTRAL_MOVING;
        return "moving";
    }
    bool arrived = is_there(central, status);
    bool is_still = central->motion == MMACELL_CENTRAL_STOPPING || central->target == MMACELL_CENTRAL_NO_TARGET;
    if (central->motion == MMACELL_CENTRAL_STARTING && !(arrived && status->servo))
        return "starting";
    central->motion = MMACELL_CENTRAL_REST;
    central->has_pose = true;
    memcpy(central->pose, status->axes, sizeof central->pose);
    if (is_still) {
        central->target = MMACELL_CENTRAL_NO_TARGET;
        return "still";
    }
    if (!status->servo)
        return "missed_servo_off";
    if (central->target == MMACELL_CENTRAL_UNKNOWN_TARGET)
        return "still";
    return arrived ? "arrived" : "missed_elsewhere";
}

/* MM-33, MM-34 */
static void take_reply(struct mmacell_central *central, uint64_t now, const struct mmacell_proto_message *reply)
{
    bool is_status = reply->kind == MMACELL_PROTO_STATUS, asked = central->command.kind == MMACELL_PROTO_STA;
    if (central->link != MMACELL_CENTRAL_AWAITING || (reply->kind != MMACELL_PROTO_ER && is_status != asked)) {
        close_link(central, "mismatch", MMACELL_CENTRAL_ENDED);
        return;
    }
    central->link = MMACELL_CENTRAL_IDLE; /* the command is finished */
    if (reply->kind == MMACELL_PROTO_ER) {
        report(central, MMACELL_CENTRAL_REFUSED)->error = reply->number;
    } else if (is_status) {
        struct mmacell_central_event *event = report(central, MMACELL_CENTRAL_STATUS);
        event->message = *reply;
        event->motion = status_motion(central, reply);
    } else if (central->command.kind == MMACELL_PROTO_CLO) {
        close_link(central, "agreed", MMACELL_CENTRAL_ENDED);
    } else {
        done(central, now);
        report(central, MMACELL_CENTRAL_DONE);
    }
}

size_t mmacell_central_input(struct mmacell_central *central, uint64_t now, const uint8_t *data, size_t size)
{
    struct mmacell_proto_item item;
    /* What comes after the end of a connection is ignored (MM-38). */
    for (size_t taken = 0; taken < size && central->link != MMACELL_CENTRAL_ENDED;) {
        taken += mmacell_proto_push(&central->decoder, data + taken, size - taken);
        while (central->link != MMACELL_CENTRAL_ENDED && mmacell_proto_next(&central->decoder, &item)) {
            if (central->link == MMACELL_CENTRAL_DOWN) {
                if (outcomes(central) < MMACELL_CENTRAL_EVENTS)
                    report(central, MMACELL_CENTRAL_UNEXPECTED);
            } else if (item.message.kind >= MMACELL_PROTO_TOO_LONG)
                close_link(central, "malformed", MMACELL_CENTRAL_ENDED)->item = item;
            else
                take_reply(central, now, &item.message);
        }
    }
    return size;
}

void mmacell_central_timeout(struct mmacell_central *central, uint64_t now)
{
    if (central->link == MMACELL_CENTRAL_AWAITING && now >= central->deadline)
        close_link(central, "timeout", MMACELL_CENTRAL_ENDED);
}

/* MM-30 */
bool mmacell_central_request(struct mmacell_central *central, const struct mmacell_proto_message *command)
{
    uint8_t line[MMACELL_PROTO_MAX_LINE];
    if (central->link != MMACELL_CENTRAL_IDLE || outcomes(central) > 0 || command->kind > MMACELL_PROTO_HND ||
        mmacell_proto_encode(command, central->config.writes, line, sizeof line) == 0)
        return false;
    central->command = *command;
    central->link = MMACELL_CENTRAL_SENDING;
    return true;
}

void mmacell_central_abort(struct mmacell_central *central)
{
    if (central->link == MMACELL_CENTRAL_SENDING) {
        central->link = MMACELL_CENTRAL_IDLE;
        report(central, MMACELL_CENTRAL_ABORTED);
    } else if (central->link == MMACELL_CENTRAL_AWAITING) {
        close_link(central, "aborted", MMACELL_CENTRAL_ENDED);
    }
}

bool mmacell_central_event(struct mmacell_central *central, struct mmacell_central_event *event)
{
    return TAKE_EVENT(central, event);
}

size_t mmacell_central_transmit(struct mmacell_central *central, uint64_t now, uint8_t *out, size_t size)
{
    if (central->link != MMACELL_CENTRAL_SENDING)
        return 0;
    size_t length = mmacell_proto_encode(&central->command, central->config.writes, out, size);
    if (length == 0)
        return 0;
    bool is_starting = central->motion == MMACELL_CENTRAL_STARTING;
    if (central->command.kind == MMACELL_PROTO_STA && is_starting && now >= central->believed_from)
        central->motion = MMACELL_CENTRAL_MOVING; /* MM-45 */
    central->link = MMACELL_CENTRAL_AWAITING;
    central->deadline = after(now, central->config.timeout);
    return length;
}

bool mmacell_central_deadline(const struct mmacell_central *central, uint64_t *deadline)
{
    *deadline = central->deadline;
    return central->link == MMACELL_CENTRAL_AWAITING;
}
