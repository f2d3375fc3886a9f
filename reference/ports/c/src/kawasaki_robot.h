/* What the parts of a robot share: its queue, its order, and what all of them report. */
#ifndef CELLWIRE_KAWASAKI_ROBOT_PARTS_H
#define CELLWIRE_KAWASAKI_ROBOT_PARTS_H

#include "cellwire/kawasaki_robot.h"
#include "kawasaki.h"

#define READ_ON (2 * MS) /* KM-50 */

static inline bool queue_is_full(const struct kawasaki_queue *queue) { return queue->count == queue->capacity; }

/* Nothing of what was cleared is left, and nothing is being executed (KM-72). */
static inline bool queue_has_settled(const struct kawasaki_queue *queue) { return queue->is_abandoned || queue->count == 0; }

/* Into the next slot, which is free. */
void kawasaki_queue_put(struct kawasaki_queue *queue, uint16_t order, uint16_t number, const uint8_t *job, size_t length);
bool kawasaki_queue_take(struct kawasaki_queue *queue, uint16_t number, struct kawasaki_robot_job *job);
bool kawasaki_queue_complete(struct kawasaki_queue *queue);

/* Every job but the one that is being executed is removed. */
void kawasaki_queue_clear(struct kawasaki_queue *queue);

/* KM-56 */
void kawasaki_order_begin(struct kawasaki_robot_order *order, uint16_t number);

/* The next job is queued. */
void kawasaki_order_queued(struct kawasaki_robot_order *order);

/* Whether a report is one of a job of the queue (KM-69). */
bool kawasaki_order_done(const struct kawasaki_end *end, struct kawasaki_robot_order *order, uint16_t number, bool is_individual);

static inline bool order_is_done(const struct kawasaki_robot_order *order) { return order->executed == order->queued; }

/* Whether no job waits to be acknowledged individually. */
bool kawasaki_order_is_acknowledged(const struct kawasaki_robot_order *order);

static inline bool is_connected(const struct kawasaki_robot *robot)
{
    return robot->link == KAWASAKI_READY || robot->link == KAWASAKI_WAITING;
}

static inline bool takes_jobs(const struct kawasaki_robot *robot) { return robot->order.stage == KAWASAKI_INTAKE; }

static inline uint16_t next_number(const struct kawasaki_robot *robot) { return number_at(&robot->end, robot->order.queued + 1); }

static inline uint16_t next_executed(const struct kawasaki_robot *robot)
{
    return number_at(&robot->end, robot->order.executed + 1);
}

/* An outcome of the active order. */
static inline struct kawasaki_event *report_outcome(struct kawasaki_robot *robot, enum kawasaki_event_kind kind)
{
    struct kawasaki_event *event = kawasaki_report_outcome(&robot->end, kind);
    event->order = robot->order.number;
    return event;
}

static inline void report_next(struct kawasaki_robot *robot, enum kawasaki_event_kind kind, uint16_t number)
{
    kawasaki_report(&robot->end, kind)->number = number;
}

/* KM-59 */
void kawasaki_robot_interrupt(struct kawasaki_robot *robot);

#endif
