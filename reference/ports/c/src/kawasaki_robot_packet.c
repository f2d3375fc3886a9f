/* What a robot's packet holds (section 8.3), and when one is due. */
#include "kawasaki_robot.h"

static bool acknowledge(struct packet *packet, uint16_t order, uint16_t number)
{
    const struct values values = {.of = {[KAWASAKI_ORDER] = order, [KAWASAKI_NUMBER] = number}};
    return kawasaki_add(packet, KAWASAKI_JOB_ACK, 0, &values);
}

/* KM-54, KM-55 */
static void add_acks(struct kawasaki_robot *robot, struct packet *packet, bool is_alone)
{
    struct kawasaki_robot_order *order = &robot->order;
    uint16_t named = order->number != 0 ? order->number : robot->ended;
    if (robot->config.individual_acks) {
        for (uint16_t number = 1; number <= robot->end.largest; number++) {
            if (!is_in(order->unacked, number))
                continue;
            if (!acknowledge(packet, named, number))
                return;
            exclude(order->unacked, number);
        }
        return;
    }
    uint64_t every = robot->config.acks;
    for (uint64_t count = (order->acknowledged / every + 1) * every; count <= order->executed; count += every) {
        if (!acknowledge(packet, named, number_at(&robot->end, count)))
            return;
        order->acknowledged = count;
    }
    bool is_rest_due = order->executed > order->acknowledged && (order_is_done(order) || is_alone);
    if (is_rest_due && acknowledge(packet, named, number_at(&robot->end, order->executed)))
        order->acknowledged = order->executed;
}

/* What the order and the connection have to tell: true, it has been told. */
static bool add_status(const struct kawasaki_robot *robot, struct packet *packet)
{
    static const int32_t PHASES[] = {0, 2, 2, 3, 4, 5};
    const struct kawasaki_robot_order *order = &robot->order;
    const struct values values = {.of = {[KAWASAKI_ORDER] = order->number,
                                         [KAWASAKI_PHASE] = PHASES[order->stage],
                                         [KAWASAKI_QUEUED] = number_or_none(&robot->end, order->queued),
                                         [KAWASAKI_EXECUTED] = number_or_none(&robot->end, order->executed),
                                         [KAWASAKI_ENDED] = robot->ended}};
    return kawasaki_add(packet, KAWASAKI_STATUS, 0, &values);
}

/* KM-52, KM-53 */
size_t kawasaki_robot_transmit(struct kawasaki_robot *robot, uint64_t now, uint8_t *out, size_t size)
{
    struct kawasaki_robot_order *order = &robot->order;
    struct packet packet = {&robot->end, out, 0};
    if (robot->link != KAWASAKI_READY || now < robot->at || size < robot->end.packet)
        return 0;
    bool asks = order->stage == KAWASAKI_INTAKE && order->flow == KAWASAKI_ASKING;
    bool is_status_due = robot->replies_status || now >= robot->status_at;
    add_acks(robot, &packet, !is_status_due && !robot->replies_pause && !robot->replies_start && !(asks && robot->synced));
    const struct values start = {.of = {[KAWASAKI_ORDER] = robot->start}};
    if (robot->replies_start && kawasaki_add(&packet, KAWASAKI_ORDER_ACK, 0, &start))
        robot->replies_start = false;
    bool is_told = kawasaki_order_is_acknowledged(order);
    const struct values end = {.of = {[KAWASAKI_ENDED] = robot->ended,
                                      [KAWASAKI_ORDER] = order->number,
                                      [KAWASAKI_EXECUTED] = robot->ended_executed}};
    if (robot->replies_end && is_told && kawasaki_add(&packet, KAWASAKI_END_ACK, 0, &end))
        robot->replies_end = false;
    if (is_status_due && is_told && add_status(robot, &packet)) {
        robot->replies_status = false;
        robot->status_at = after(now, robot->config.status_period);
    }
    const struct values pause = {
        .of = {[KAWASAKI_ORDER] = order->number, [KAWASAKI_QUEUED] = number_or_none(&robot->end, order->queued)}};
    if (robot->replies_pause && kawasaki_add(&packet, KAWASAKI_PAUSE, 0, &pause))
        robot->replies_pause = false;
    const struct values request = {
        .of = {[KAWASAKI_ORDER] = order->number, [KAWASAKI_NUMBER] = number_at(&robot->end, order->queued + 1)}};
    if (asks && robot->synced && kawasaki_add(&packet, KAWASAKI_JOB_REQUEST, 0, &request))
        order->gap = order->gap == KAWASAKI_REST       ? KAWASAKI_ASKED
                     : order->gap == KAWASAKI_END_ONCE ? KAWASAKI_ASKED_AGAIN
                                                       : order->gap;
    if (asks && !order->waits && order_is_done(order)) {
        order->waits = true;
        order->waits_until = after(now, robot->config.patience);
    }
    robot->link = KAWASAKI_WAITING;
    robot->answered = false;
    robot->not_before = after(now, robot->config.exchange);
    robot->overdue_at = after(now, robot->config.reply_timeout);
    return kawasaki_finish(&packet);
}

/* KM-80 */
bool kawasaki_robot_deadline(const struct kawasaki_robot *robot, uint64_t *deadline)
{
    const struct kawasaki_robot_order *order = &robot->order;
    bool is_cleared = order->stage == KAWASAKI_CLEARING || order->stage == KAWASAKI_INTERRUPTED;
    *deadline = robot->link == KAWASAKI_DISCONNECTED ? robot->connect_at
                : robot->link == KAWASAKI_READY      ? robot->at
                : robot->link == KAWASAKI_WAITING    ? robot->overdue_at
                                                     : NEVER;
    if (is_cleared && order->is_reported)
        *deadline = sooner(*deadline, order->reported_at);
    if (is_connected(robot) && order->stage == KAWASAKI_INTAKE) {
        if (order->waits)
            *deadline = sooner(*deadline, order->waits_until);
        if (order->flow == KAWASAKI_HELD)
            *deadline = sooner(*deadline, order->held_until);
    }
    return *deadline != NEVER;
}
