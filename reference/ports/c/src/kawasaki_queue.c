/* The robot's ring of slots, and its order (sections 8.1 and 8.6). */
#include "kawasaki_robot.h"

static struct kawasaki_slot *slot_at(const struct kawasaki_queue *queue, size_t place)
{
    return &queue->slots[(queue->first + place) % queue->capacity];
}

/* A slot that is freed before its turn counts until all before it are free. */
static void shrink(struct kawasaki_queue *queue)
{
    while (queue->count > 0 && slot_at(queue, 0)->state == KAWASAKI_FREE) {
        queue->first = (queue->first + 1) % queue->capacity;
        queue->count--;
    }
}

void kawasaki_queue_put(struct kawasaki_queue *queue, uint16_t order, uint16_t number, const uint8_t *job, size_t length)
{
    struct kawasaki_slot *slot = slot_at(queue, queue->count++);
    *slot = (struct kawasaki_slot){KAWASAKI_FILLED, order, number, length};
    if (length > 0)
        memcpy(queue->jobs + (size_t)(slot - queue->slots) * queue->job_size, job, length);
}

bool kawasaki_queue_take(struct kawasaki_queue *queue, uint16_t number, struct kawasaki_robot_job *job)
{
    for (size_t i = 0; i < queue->count && !queue->has_taken; i++) {
        struct kawasaki_slot *slot = slot_at(queue, i);
        if (slot->state != KAWASAKI_FILLED || (number != 0 && slot->number != number))
            continue;
        slot->state = KAWASAKI_TAKEN;
        queue->has_taken = true;
        queue->taken = (size_t)(slot - queue->slots);
        job->order = slot->order;
        job->number = slot->number;
        job->own = (struct kawasaki_msg_text){queue->jobs + queue->taken * queue->job_size, slot->length};
        return true;
    }
    return false;
}

bool kawasaki_queue_complete(struct kawasaki_queue *queue)
{
    if (!queue->has_taken)
        return false;
    queue->has_taken = false;
    queue->slots[queue->taken].state = KAWASAKI_FREE;
    shrink(queue);
    return true;
}

void kawasaki_queue_clear(struct kawasaki_queue *queue)
{
    for (size_t i = 0; i < queue->count; i++)
        if (slot_at(queue, i)->state == KAWASAKI_FILLED)
            slot_at(queue, i)->state = KAWASAKI_FREE;
    shrink(queue);
    if (queue->count > 0) /* the one that is being executed */
        queue->count = 1;
}

void kawasaki_order_begin(struct kawasaki_robot_order *order, uint16_t number)
{
    memset(order, 0, sizeof *order);
    order->number = number;
    order->stage = KAWASAKI_INTAKE;
}

/* Past all that are executed in one row. */
static void advance(const struct kawasaki_end *end, struct kawasaki_robot_order *order)
{
    while (is_in(order->ahead, number_at(end, order->executed + 1)))
        exclude(order->ahead, number_at(end, ++order->executed));
    order->queued = later(order->queued, order->executed); /* where the list was cleared meanwhile */
}

void kawasaki_order_queued(struct kawasaki_robot_order *order)
{
    order->queued++;
    order->gap = KAWASAKI_CLOSED;
    order->waits = false;
}

bool kawasaki_order_done(const struct kawasaki_end *end, struct kawasaki_robot_order *order, uint16_t number, bool is_individual)
{
    if (number < 1 || number > end->largest)
        return false;
    uint64_t count = order->executed + ahead_of(end, order->executed, number);
    bool is_next = count == order->executed + 1;
    if (count <= order->executed || count > order->queued || (!is_individual && !is_next) || is_in(order->ahead, number))
        return false;
    if (is_individual) {
        include(order->unacked, number);
        include(order->ahead, number);
        advance(end, order);
    } else {
        order->executed = count;
    }
    order->failures = 0;
    order->waits = false;
    return true;
}

bool kawasaki_order_is_acknowledged(const struct kawasaki_robot_order *order)
{
    for (size_t i = 0; i < sizeof order->unacked; i++)
        if (order->unacked[i] != 0)
            return false;
    return true;
}
