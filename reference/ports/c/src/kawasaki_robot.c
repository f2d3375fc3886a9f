#include "kawasaki_robot.h"

#define ROOM_TO_CLEAR 5 /* outcomes (KM-81) */

const struct kawasaki_robot_config KAWASAKI_ROBOT_DEFAULT = {
    .limits = {255, KAWASAKI_MSG_MAX_LEN},
    .max_number = KAWASAKI_LARGEST,
    .acks = 1,
    .low_water = KAWASAKI_HALF,
    .resends = 3,
    .pauses = 3,
    .clears = 1,
    .patience = SECOND,
    .pause = 500 * MS,
    .reply_timeout = SECOND,
    .exchange = 32 * MS,
    .silent_cycles = 5,
    .reconnect_delay = SECOND,
    .status_period = SECOND,
    .refuse_repeated_start = true,
};

bool kawasaki_robot_init(struct kawasaki_robot *robot, const struct kawasaki_robot_config *config)
{
    memset(robot, 0, sizeof *robot);
    robot->config = *config;
    if (config->dialect.entries == NULL)
        robot->config.dialect = KAWASAKI_DIALECT;
    const struct kawasaki_dialect *dialect = &robot->config.dialect;
    if (!kawasaki_end_init(&robot->end, dialect, &config->limits, config->max_number, config->datagrams))
        return false;
    if (config->low_water == KAWASAKI_HALF)
        robot->config.low_water = config->slot_count / 2;
    size_t job_size = kawasaki_job_longest(dialect);
    robot->queue.slots = config->slots;
    robot->queue.jobs = config->jobs;
    robot->queue.capacity = config->slot_count;
    robot->queue.job_size = job_size;
    bool is_number = config->slot_count >= 1 && config->slot_count < config->max_number;
    return is_number && config->jobs_size / config->slot_count >= job_size &&
           (config->individual_acks ? kawasaki_has(dialect, KAWASAKI_JOB_ACK) : config->acks > 0);
}

static void clear_list(struct kawasaki_robot *robot, unsigned failures)
{
    kawasaki_queue_clear(&robot->queue);
    robot->order.stage = KAWASAKI_CLEARING;
    robot->order.failures = failures;
    robot->order.is_reported = false;
}

/* KM-59 */
void kawasaki_robot_interrupt(struct kawasaki_robot *robot)
{
    robot->replies_status = true;
    kawasaki_queue_clear(&robot->queue);
    robot->order.stage = KAWASAKI_INTERRUPTED;
    robot->order.is_reported = false;
    report_outcome(robot, KAWASAKI_ORDER_INTERRUPTED);
}

bool kawasaki_robot_take(struct kawasaki_robot *robot, uint16_t number, struct kawasaki_robot_job *job)
{
    return kawasaki_queue_take(&robot->queue, number, job);
}

bool kawasaki_robot_report(struct kawasaki_robot *robot, uint16_t number)
{
    return kawasaki_order_done(&robot->end, &robot->order, number, robot->config.individual_acks);
}

bool kawasaki_robot_complete(struct kawasaki_robot *robot) { return kawasaki_queue_complete(&robot->queue); }

void kawasaki_robot_abandon(struct kawasaki_robot *robot) { robot->queue.is_abandoned = true; }

bool kawasaki_robot_clear_queue(struct kawasaki_robot *robot)
{
    bool is_alarm = robot->order.stage == KAWASAKI_IN_ALARM;
    if ((!takes_jobs(robot) && !is_alarm) || !kawasaki_has_room(&robot->end, ROOM_TO_CLEAR))
        return false;
    robot->replies_status = robot->replies_status || is_alarm;
    clear_list(robot, 0);
    return true;
}

bool kawasaki_robot_reset_order(struct kawasaki_robot *robot)
{
    if (robot->order.stage == KAWASAKI_IDLE || robot->order.stage == KAWASAKI_INTERRUPTED)
        return false;
    kawasaki_robot_interrupt(robot);
    return true;
}

/* KM-49 */
void kawasaki_robot_connected(struct kawasaki_robot *robot, uint64_t now)
{
    struct kawasaki_robot_order *order = &robot->order;
    kawasaki_end_clear(&robot->end);
    robot->opens = false;
    robot->link = KAWASAKI_READY;
    robot->at = robot->overdue_at = now;
    robot->silent = robot->unanswered = 0;
    robot->synced = false;
    robot->replies_status = true;
    robot->replies_start = false;
    order->acknowledged = order->executed;
    memcpy(order->unacked, order->ahead, sizeof order->unacked);
    if (order->flow == KAWASAKI_HELD && now >= order->held_until)
        order->flow = KAWASAKI_ASKING;
    order->gap = KAWASAKI_REST;
    if (!robot->ignores) {
        robot->ignores = true;
        robot->ignored_until = after(now, LATEST_DATAGRAM);
    }
}

/* KM-73 */
static enum kawasaki_step next_step(const struct kawasaki_robot *robot)
{
    const struct kawasaki_robot_config *config = &robot->config;
    uint64_t failures = robot->order.failures, pauses = (uint64_t)config->resends + config->pauses;
    return failures <= config->resends           ? KAWASAKI_RESEND
           : failures <= pauses                  ? KAWASAKI_HOLD
           : failures <= pauses + config->clears ? KAWASAKI_CLEAR
                                                 : KAWASAKI_GIVE_UP;
}

/* KM-73, KM-74 */
static void recover(struct kawasaki_robot *robot, uint64_t now)
{
    struct kawasaki_robot_order *order = &robot->order;
    order->failures++;
    order->waits = false;
    enum kawasaki_step step = next_step(robot);
    uint16_t following = next_executed(robot);
    if (step == KAWASAKI_GIVE_UP) {
        robot->replies_status = true;
        order->stage = KAWASAKI_IN_ALARM;
        report_outcome(robot, KAWASAKI_ALARM)->number = following;
        return;
    }
    if (step == KAWASAKI_HOLD) {
        order->flow = KAWASAKI_HELD;
        order->held_until = after(now, robot->config.pause);
        robot->replies_pause = true;
    } else if (step == KAWASAKI_CLEAR) {
        clear_list(robot, order->failures);
    }
    struct kawasaki_event *event = kawasaki_report(&robot->end, KAWASAKI_RECOVERY);
    event->step = step;
    event->number = following;
}

/* KM-48, KM-74 */
void kawasaki_robot_disconnected(struct kawasaki_robot *robot, uint64_t now)
{
    bool was_connected = is_connected(robot);
    if (robot->link == KAWASAKI_DISCONNECTED)
        return;
    robot->link = KAWASAKI_DISCONNECTED;
    robot->opens = robot->end.closes = false;
    robot->connect_at = after(now, robot->config.reconnect_delay);
    if (was_connected && takes_jobs(robot) && order_is_done(&robot->order))
        recover(robot, now);
}

/* KM-61 */
static void over(struct kawasaki_robot *robot)
{
    struct kawasaki_robot_order *order = &robot->order;
    order->stage = KAWASAKI_IDLE;
    order->queued = order->acknowledged = order->executed;
    robot->has_ended = true;
    robot->ended = order->number;
    robot->ended_executed = number_or_none(&robot->end, order->executed);
    if (robot->ended_count == KAWASAKI_ENDED_ORDERS)
        memmove(robot->ended_orders, robot->ended_orders + 1, --robot->ended_count * sizeof *robot->ended_orders);
    robot->ended_orders[robot->ended_count++] = order->number;
    robot->replies_status = robot->replies_end = true;
    robot->replies_pause = false;
    report_outcome(robot, KAWASAKI_ORDER_OVER)->executed = order->executed;
    order->number = 0;
}

/* KM-70, KM-72 */
static void look(struct kawasaki_robot *robot, uint64_t now)
{
    struct kawasaki_robot_order *order = &robot->order;
    bool is_cleared = order->stage == KAWASAKI_CLEARING || order->stage == KAWASAKI_INTERRUPTED;
    if (is_cleared && queue_has_settled(&robot->queue)) {
        if (!order->is_reported) {
            order->is_reported = true;
            order->reported_at = after(now, READ_ON);
        } else if (now >= order->reported_at && order->stage == KAWASAKI_INTERRUPTED) {
            over(robot);
        } else if (now >= order->reported_at) {
            order->stage = KAWASAKI_INTAKE;
            order->flow = KAWASAKI_ASKING;
            order->gap = KAWASAKI_REST;
            order->waits = false;
            order->queued = order->executed;
            report_next(robot, KAWASAKI_QUEUE_CLEARED, next_executed(robot));
        }
    } else if (order->stage == KAWASAKI_ENDING && order_is_done(order)) {
        over(robot);
    } else if (takes_jobs(robot) && order->flow == KAWASAKI_FULL && robot->queue.count <= robot->config.low_water) {
        order->flow = KAWASAKI_ASKING;
        report_next(robot, KAWASAKI_QUEUE_DRAINED, next_number(robot));
    }
}

/* KM-80 */
void kawasaki_robot_timeout(struct kawasaki_robot *robot, uint64_t now)
{
    struct kawasaki_robot_order *order = &robot->order;
    if (robot->link == KAWASAKI_DISCONNECTED && now >= robot->connect_at) {
        robot->link = KAWASAKI_CONNECTING;
        robot->opens = true;
    }
    if (order->flow == KAWASAKI_HELD && now >= order->held_until)
        order->flow = KAWASAKI_ASKING;
    if (takes_jobs(robot) && order->waits && now >= order->waits_until)
        recover(robot, now);
    if (robot->link == KAWASAKI_WAITING && now >= robot->overdue_at) {
        robot->link = KAWASAKI_READY;
        robot->at = robot->overdue_at = now;
        robot->silent++;
        if (robot->unanswered < (robot->config.silent_cycles > 0 ? robot->config.silent_cycles : UINT16_MAX))
            robot->unanswered++;
        kawasaki_report(&robot->end, KAWASAKI_NO_REPLY);
        if (robot->config.silent_cycles > 0 && robot->silent >= robot->config.silent_cycles)
            robot->end.closes = true;
    }
    look(robot, now);
}

bool kawasaki_robot_event(struct kawasaki_robot *robot, struct kawasaki_event *event)
{
    return kawasaki_end_event(&robot->end, event) || kawasaki_take_flag(&robot->opens, KAWASAKI_CONNECT, event);
}
