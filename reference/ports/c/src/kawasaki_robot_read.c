/* What a robot makes of the messages of a PC (sections 8.4 and 8.5). */
#include "kawasaki_robot.h"

/* Room for so many outcomes (KM-81). */
enum { ROOM_TO_START = 10, ROOM_FOR_COMMAND };

static void reject(struct kawasaki_robot *robot, enum kawasaki_fault_kind kind, int64_t expected, int64_t found)
{
    struct kawasaki_fault fault = {.kind = kind, .expected = expected, .found = found, .order = robot->order.number};
    kawasaki_reject(&robot->end, &fault);
}

static void reject_role(struct kawasaki_robot *robot, const struct kawasaki_entry *entry)
{
    struct kawasaki_fault fault = {.kind = KAWASAKI_NOT_EXPECTED, .role = entry->role, .command = entry->command};
    kawasaki_reject(&robot->end, &fault);
}

static void reject_number(struct kawasaki_robot *robot, enum kawasaki_role role, int32_t found, int32_t max)
{
    struct kawasaki_fault fault = {.kind = KAWASAKI_OUT_OF_RANGE, .found = found, .min = 1, .max = max};
    fault.place = kawasaki_place_of(&robot->end.dialect, role, KAWASAKI_NUMBER);
    kawasaki_reject(&robot->end, &fault);
}

/* KM-65 */
static void fail(struct kawasaki_robot *robot)
{
    robot->order.gap = KAWASAKI_REST;
}

static void refuse_start(struct kawasaki_robot *robot, uint16_t by, uint16_t named)
{
    struct kawasaki_event *event = kawasaki_report(&robot->end, KAWASAKI_ORDER_REFUSED);
    robot->start = by;
    event->active = robot->order.number;
    event->order = named;
}

static bool has_ended(const struct kawasaki_robot *robot, uint16_t order)
{
    for (size_t i = 0; i < robot->ended_count; i++)
        if (robot->ended_orders[i] == order)
            return true;
    return false;
}

/* Whether starts are not looked at (KM-63). */
static bool ignores_start(struct kawasaki_robot *robot, uint64_t now)
{
    if (!robot->config.datagrams)
        return false;
    if (now < robot->ignored_until)
        return true;
    if (robot->was_drained)
        return false;
    robot->was_drained = true;
    robot->ignored_until = after(now, robot->config.exchange);
    return true;
}

/* KM-56, KM-57, KM-63 */
static void start(struct kawasaki_robot *robot, uint64_t now, uint16_t named, int32_t number)
{
    struct kawasaki_robot_order *order = &robot->order;
    if (ignores_start(robot, now))
        return;
    robot->replies_status = robot->replies_start = true;
    if (order->stage != KAWASAKI_IDLE) {
        bool is_repeated = named == order->number;
        robot->start = named;
        if (!is_repeated || order->queued > 0 || number != 1)
            refuse_start(robot, is_repeated && robot->config.refuse_repeated_start ? 0 : order->number, named);
    } else if (named != 0 && number != 1) {
        robot->start = 0;
        reject_number(robot, KAWASAKI_ORDER_START, number, 1);
    } else if (named == 0 || robot->queue.is_abandoned || !kawasaki_has_room(&robot->end, ROOM_TO_START) ||
               (robot->config.datagrams && has_ended(robot, named))) {
        refuse_start(robot, 0, named);
    } else {
        kawasaki_order_begin(order, named);
        robot->start = named;
        report_outcome(robot, KAWASAKI_ORDER_STARTED);
    }
}

/* KM-58, KM-66 */
static void end_order(struct kawasaki_robot *robot)
{
    struct kawasaki_robot_order *order = &robot->order;
    bool is_missing = takes_jobs(robot) && (order->gap == KAWASAKI_ASKED || order->gap == KAWASAKI_END_ONCE);
    if (order->stage == KAWASAKI_CLEARING || is_missing) {
        if (is_missing && robot->unanswered > 0)
            robot->unanswered--;
        else
            order->gap = KAWASAKI_END_ONCE;
        reject(robot, KAWASAKI_JOBS_MISSING, next_number(robot), 0);
    } else if (order->stage == KAWASAKI_IN_ALARM || (takes_jobs(robot) && order->gap != KAWASAKI_REST)) {
        order->stage = KAWASAKI_ENDING;
        robot->replies_status = true;
        report_outcome(robot, KAWASAKI_ORDER_ENDING);
    }
}

static void end_or_interrupt(struct kawasaki_robot *robot, bool is_end, uint16_t named)
{
    const struct kawasaki_robot_order *order = &robot->order;
    if (order->stage == KAWASAKI_IDLE || named != order->number) { /* KM-60 */
        if (robot->has_ended && named == robot->ended)
            robot->replies_end = true;
        else
            robot->replies_status = true;
    } else if (is_end) {
        end_order(robot);
    } else if (order->stage != KAWASAKI_INTERRUPTED) {
        kawasaki_robot_interrupt(robot);
    }
}

/* The third line of KM-64 and those that follow. */
static void queue_or_reject(struct kawasaki_robot *robot, const struct found *found, uint16_t number)
{
    struct kawasaki_robot_order *order = &robot->order;
    struct kawasaki_value values[KAWASAKI_OWN_FIELDS];
    uint8_t own[KAWASAKI_MAX_OWN];
    struct kawasaki_fault fault;
    size_t length;
    const struct kawasaki_dialect *dialect = &robot->end.dialect;
    uint16_t expected = next_number(robot), largest = robot->end.largest;
    uint64_t ahead = ahead_of(&robot->end, order->queued, number);
    if (!kawasaki_job_read(dialect, &found->own, found->own_count, values, &fault) ||
        !kawasaki_job_write(dialect, values, own, sizeof own, &length, &fault)) {
        fail(robot);
        kawasaki_reject(&robot->end, &fault);
    } else if (number > largest) {
        fail(robot);
        reject_number(robot, KAWASAKI_JOB, number, largest);
    } else if (number == expected && is_in(order->ahead, number)) {
        kawasaki_order_queued(order);
    } else if (number == expected && queue_is_full(&robot->queue)) {
        fail(robot);
        reject(robot, KAWASAKI_NO_SLOT, 0, number);
        order->flow = KAWASAKI_FULL;
        robot->replies_pause = true;
        report_next(robot, KAWASAKI_QUEUE_FULL, number_or_none(&robot->end, order->queued));
    } else if (number == expected) {
        kawasaki_order_queued(order);
        kawasaki_queue_put(&robot->queue, order->number, number, own, length);
    } else if (ahead >= 2 && ahead <= largest / 2u) {
        fail(robot);
        reject(robot, KAWASAKI_OUT_OF_ORDER, expected, number);
    } else {
        reject(robot, KAWASAKI_REPEATED, expected, number);
    }
}

/* KM-64 */
static void take_job(struct kawasaki_robot *robot, const struct found *found, uint16_t named)
{
    if (takes_jobs(robot) && robot->order.gap == KAWASAKI_REST)
        return;
    if (named != robot->order.number) {
        fail(robot);
        reject(robot, KAWASAKI_WRONG_ORDER, robot->order.number, named);
    } else if (!takes_jobs(robot)) {
        reject_role(robot, found->entry);
    } else {
        queue_or_reject(robot, found, number_of(found, KAWASAKI_NUMBER));
    }
}

/* KM-62 */
static void status(struct kawasaki_robot *robot, const struct found *found, uint16_t named)
{
    struct kawasaki_event *event = kawasaki_report(&robot->end, KAWASAKI_PEER_STATUS);
    event->order = named;
    event->phase = (uint8_t)value_or(found, KAWASAKI_PHASE, 0);
    event->number = number_of(found, KAWASAKI_QUEUED);
    event->executed = number_of(found, KAWASAKI_EXECUTED);
    bool is_over = robot->order.stage == KAWASAKI_IDLE || robot->order.stage == KAWASAKI_INTERRUPTED;
    if (robot->config.end_foreign_order && !is_over && named != robot->order.number)
        kawasaki_robot_interrupt(robot);
}

static void command(struct kawasaki_robot *robot, const struct found *found)
{
    if (!kawasaki_has_room(&robot->end, ROOM_FOR_COMMAND)) {
        reject_role(robot, found->entry);
        return;
    }
    struct kawasaki_event *event = report_outcome(robot, KAWASAKI_COMMANDED);
    event->id = found->entry->command;
    event->has_value = found->is_there[KAWASAKI_VALUE];
    event->value = value_or(found, KAWASAKI_VALUE, 0);
}

static void take_message(struct kawasaki_robot *robot, uint64_t now, const struct found *found)
{
    uint16_t named = (uint16_t)value_or(found, KAWASAKI_ORDER, robot->order.number);
    switch (found->entry->role) {
    case KAWASAKI_ORDER_START:
        start(robot, now, named, value_or(found, KAWASAKI_NUMBER, 1));
        break;
    case KAWASAKI_ORDER_END:
    case KAWASAKI_ORDER_INTERRUPT:
        end_or_interrupt(robot, found->entry->role == KAWASAKI_ORDER_END, named);
        break;
    case KAWASAKI_JOB:
        take_job(robot, found, named);
        break;
    case KAWASAKI_STATUS:
        status(robot, found, named);
        break;
    case KAWASAKI_COMMAND:
        command(robot, found);
        break;
    case KAWASAKI_FILLER:
        break;
    default:
        reject_role(robot, found->entry);
    }
}

static void read_messages(struct kawasaki_robot *robot, uint64_t now)
{
    struct found found;
    struct kawasaki_fault fault;
    for (;;) {
        enum reading reading = kawasaki_end_read(&robot->end, &found, &fault);
        bool was_resting = takes_jobs(robot) && robot->order.gap == KAWASAKI_REST;
        if (reading == NOTHING)
            return;
        robot->answered = true;
        if (reading == MESSAGE) {
            take_message(robot, now, &found);
            continue;
        }
        fail(robot);
        if (reading == MEANINGLESS && !was_resting)
            kawasaki_reject(&robot->end, &fault);
    }
}

/* KM-50 */
static void all_read(struct kawasaki_robot *robot, uint64_t now)
{
    bool is_half = kawasaki_end_is_half(&robot->end);
    uint64_t soon = after(now, READ_ON);
    if (robot->link == KAWASAKI_WAITING && robot->answered && !is_half) {
        robot->link = KAWASAKI_READY;
        robot->at = later(robot->not_before, sooner(soon, later(now, robot->overdue_at)));
        robot->silent = 0;
        robot->synced = true;
    } else if (robot->link == KAWASAKI_READY && !is_half) {
        robot->at = later(robot->at, sooner(soon, robot->overdue_at));
    } else if (robot->link == KAWASAKI_READY && now < robot->overdue_at) {
        robot->link = KAWASAKI_WAITING;
        robot->not_before = robot->at;
        robot->answered = true;
    }
}

size_t kawasaki_robot_input(struct kawasaki_robot *robot, uint64_t now, const uint8_t *data, size_t size)
{
    if (!is_connected(robot)) {
        kawasaki_report(&robot->end, KAWASAKI_UNEXPECTED);
        return size;
    }
    for (size_t taken = 0; taken < size;) {
        taken += kawasaki_msg_push(&robot->end.decoder, data + taken, size - taken);
        read_messages(robot, now);
    }
    if (robot->config.datagrams) { /* KM-9 */
        kawasaki_msg_end(&robot->end.decoder);
        read_messages(robot, now);
    }
    all_read(robot, now);
    return size;
}
