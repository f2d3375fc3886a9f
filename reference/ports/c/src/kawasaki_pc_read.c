/* What a PC makes of the messages of a robot (section 9.5). */
#include "kawasaki_pc.h"

#define NO_COUNT UINT64_MAX
#define PHASE_ACTIVE 2 /* an order in any other is begun (KM-107) */

static void reject(struct kawasaki_pc *pc, enum kawasaki_fault_kind kind, int64_t expected, int64_t found)
{
    struct kawasaki_fault fault = {.kind = kind, .expected = expected, .found = found};
    kawasaki_reject(&pc->end, &fault);
}

/* KM-110 */
static void doubt(struct kawasaki_pc *pc)
{
    pc->is_unsure = pc->is_unsure || is_running(pc);
}

/* `count` is of the job before the one that is expected. */
static void means_nothing(struct kawasaki_pc *pc, uint16_t number, uint64_t count)
{
    reject(pc, KAWASAKI_OUT_OF_ORDER, number_at(&pc->end, count + 1), number);
}

/* The count of a number of the robot's; NO_COUNT: it means nothing (KM-99). */
static uint64_t count_of(const struct kawasaki_pc *pc, uint16_t number)
{
    uint64_t count = pc->executed + ahead_of(&pc->end, pc->executed, number);
    return number <= pc->end.largest && count <= pc->sent ? count : NO_COUNT;
}

/* All up to this count are executed, and those that were ahead behind it. */
static void set_executed(struct kawasaki_pc *pc, uint64_t count)
{
    while (pc->executed < count || is_in(pc->ahead, number_at(&pc->end, pc->executed + 1)))
        exclude(pc->ahead, number_at(&pc->end, ++pc->executed));
    pc->queued = later(pc->queued, pc->executed);
}

/* KM-100 */
static void job_ack(struct kawasaki_pc *pc, uint16_t number)
{
    uint64_t count = count_of(pc, number);
    if (count == NO_COUNT) {
        means_nothing(pc, number, pc->executed);
    } else if (!pc->config.individual_acks || count <= pc->executed + 1) {
        set_executed(pc, count);
    } else if (!is_in(pc->ahead, number)) {
        include(pc->ahead, number);
        kawasaki_report(&pc->end, KAWASAKI_EXECUTED_AHEAD)->index = count - 1;
    }
}

/* KM-105 */
static void refused(struct kawasaki_pc *pc, uint16_t by)
{
    uint16_t number = pc->number;
    bool gives_up;
    if (pc->is_cancelled) {
        kawasaki_pc_over(pc);
        return;
    }
    if (by == 0) {
        pc->refusals++;
        pc->stage = KAWASAKI_PC_UNSENT;
        gives_up = pc->refusals > pc->config.start_retries;
    } else {
        pc->stage = KAWASAKI_PC_FOREIGN;
        pc->foreign = by;
        gives_up = pc->config.takeover == KAWASAKI_TAKEOVER_NEVER;
    }
    if (gives_up) {
        pc->stage = KAWASAKI_PC_IDLE;
        pc->number = 0;
    }
    struct kawasaki_event *event = kawasaki_report(&pc->end, KAWASAKI_ORDER_REFUSED);
    event->is_outcome = event->given_up = gives_up;
    event->order = number;
    event->active = by;
}

/* KM-104 */
static void accepted(struct kawasaki_pc *pc)
{
    pc->stage = pc->is_cancelled ? KAWASAKI_PC_INTERRUPTED : KAWASAKI_PC_ACTIVE;
    kawasaki_report(&pc->end, KAWASAKI_ORDER_STARTED)->order = pc->number;
}

/* KM-101 */
static void request(struct kawasaki_pc *pc, uint16_t number)
{
    uint16_t largest = pc->end.largest;
    uint64_t begin = pc->executed + (ahead_of(&pc->end, pc->executed, number) + largest - 1u) % largest;
    if (number <= largest && begin <= pc->sent) {
        pc->queued = pc->jobs_from = begin;
        pc->has_request = true;
    } else if (pc->sent == 0) {
        pc->refusals = 0;
        refused(pc, pc->number);
    } else {
        means_nothing(pc, number, pc->sent);
    }
}

/* `queued` is the count of a number, or `executed` without one; a number that means nothing leaves it. */
static void set_queued(struct kawasaki_pc *pc, const struct found *found)
{
    uint16_t number = number_of(found, KAWASAKI_QUEUED);
    uint64_t count = number == 0 ? pc->executed : count_of(pc, number);
    pc->queued = count == NO_COUNT ? pc->queued : count;
}

/* Acknowledgements of jobs, pauses and requests (KM-117). */
static void of_order(struct kawasaki_pc *pc, const struct found *found, uint16_t named)
{
    enum kawasaki_role role = found->entry->role;
    if (role == KAWASAKI_JOB_REQUEST && is_starting(pc))
        return;
    if (!is_running(pc) || named != pc->number) {
        reject(pc, KAWASAKI_WRONG_ORDER, pc->number, named);
        return;
    }
    pc->has_left = false;
    if (role == KAWASAKI_JOB_ACK) {
        job_ack(pc, number_of(found, KAWASAKI_NUMBER));
    } else if (role == KAWASAKI_PAUSE) {
        set_queued(pc, found);
        kawasaki_report(&pc->end, KAWASAKI_PAUSED)->queued = pc->queued;
    } else if (pc->stage == KAWASAKI_PC_ACTIVE) {
        request(pc, number_of(found, KAWASAKI_NUMBER));
    }
}

/* Whether the number of the job that is executed last means something; it counts then. */
static bool takes_executed(struct kawasaki_pc *pc, uint16_t number)
{
    uint64_t count = number == 0 ? pc->executed : count_of(pc, number);
    if (count == NO_COUNT)
        means_nothing(pc, number, pc->executed);
    else if (number != 0)
        set_executed(pc, count);
    return count != NO_COUNT;
}

/* KM-106 */
static void end_ack(struct kawasaki_pc *pc, const struct found *found)
{
    uint16_t active = number_of(found, KAWASAKI_ORDER);
    bool is_ours = found->is_there[KAWASAKI_ENDED] && found->values[KAWASAKI_ENDED] == pc->number;
    pc->robot = active;
    pc->knows_robot = true;
    if (pc->stage == KAWASAKI_PC_FOREIGN && active != pc->foreign)
        pc->stage = KAWASAKI_PC_UNSENT;
    else if (is_running(pc) && is_ours && active != pc->number && takes_executed(pc, number_of(found, KAWASAKI_EXECUTED)))
        kawasaki_pc_over(pc);
}

/* KM-107 */
static void status_of_start(struct kawasaki_pc *pc, uint16_t named, bool is_begun)
{
    if (pc->stage == KAWASAKI_PC_FOREIGN) {
        if (named != pc->foreign)
            pc->stage = KAWASAKI_PC_UNSENT;
        else if (pc->config.takeover == KAWASAKI_TAKEOVER_NEVER)
            refused(pc, named);
    } else if (named == pc->number && (is_begun || pc->stage == KAWASAKI_PC_UNSENT)) {
        refused(pc, named);
    } else if (named == pc->number) {
        accepted(pc);
    } else if (pc->stage == KAWASAKI_PC_LOST && pc->is_cancelled) {
        kawasaki_pc_over(pc);
    } else if (pc->stage == KAWASAKI_PC_LOST) {
        pc->stage = KAWASAKI_PC_UNSENT;
    }
}

/* The robot has left our order (KM-109). */
static void left(struct kawasaki_pc *pc, uint64_t now, uint16_t named, const struct found *found)
{
    if (pc->config.datagrams) {
        pc->left_at = pc->has_left ? pc->left_at : now;
        pc->has_left = true;
        if (now < after(pc->left_at, LATEST_DATAGRAM))
            return;
    }
    uint16_t number = number_of(found, KAWASAKI_EXECUTED);
    uint64_t count = number == 0 ? pc->executed : count_of(pc, number);
    if (number_of(found, KAWASAKI_ENDED) == pc->number && named == 0 && count != NO_COUNT) {
        set_executed(pc, count);
        kawasaki_pc_over(pc);
    } else if (pc->executed == pc->sent) {
        kawasaki_pc_over(pc);
    } else {
        kawasaki_pc_lose_outcome(pc);
    }
}

/* KM-107 to KM-109 */
static void status(struct kawasaki_pc *pc, uint64_t now, uint16_t named, const struct found *found)
{
    uint16_t executed = number_of(found, KAWASAKI_EXECUTED), queued = number_of(found, KAWASAKI_QUEUED);
    struct kawasaki_event *event = kawasaki_report(&pc->end, KAWASAKI_PEER_STATUS);
    event->order = named;
    event->phase = (uint8_t)value_or(found, KAWASAKI_PHASE, 0);
    event->number = queued;
    event->executed = executed;
    bool is_begun = queued != 0 || executed != 0 || event->phase != PHASE_ACTIVE;
    pc->robot = named;
    pc->knows_robot = pc->asks_status = true;
    if (is_starting(pc)) {
        status_of_start(pc, named, is_begun);
    } else if (is_running(pc) && named == pc->number) {
        pc->has_left = false;
        if (takes_executed(pc, executed))
            set_queued(pc, found);
    } else if (is_running(pc)) {
        left(pc, now, named, found);
    }
}

static bool is_of_pc(enum kawasaki_role role)
{
    return role == KAWASAKI_ORDER_START || role == KAWASAKI_JOB || role == KAWASAKI_ORDER_END || role == KAWASAKI_ORDER_INTERRUPT ||
           role == KAWASAKI_COMMAND;
}

static void take_message(struct kawasaki_pc *pc, uint64_t now, const struct found *found)
{
    enum kawasaki_role role = found->entry->role;
    uint16_t named = (uint16_t)value_or(found, KAWASAKI_ORDER, pc->number);
    uint64_t executed = pc->executed, queued = pc->queued;
    if (is_of_pc(role)) {
        struct kawasaki_fault fault = {.kind = KAWASAKI_NOT_EXPECTED, .role = role, .command = found->entry->command};
        kawasaki_reject(&pc->end, &fault);
    } else if (role == KAWASAKI_STATUS) {
        status(pc, now, named, found);
    } else if (role == KAWASAKI_ORDER_ACK) { /* KM-103 */
        if (pc->stage == KAWASAKI_PC_SENT && named == pc->number)
            accepted(pc);
        else if (pc->stage == KAWASAKI_PC_SENT)
            refused(pc, named);
    } else if (role == KAWASAKI_END_ACK) {
        end_ack(pc, found);
    } else if (role != KAWASAKI_FILLER) {
        of_order(pc, found, named);
    }
    if (executed != pc->executed || queued != pc->queued)
        pc->has_progress = true;
}

static void read_messages(struct kawasaki_pc *pc, uint64_t now)
{
    struct found found;
    struct kawasaki_fault fault;
    enum reading reading;
    while ((reading = kawasaki_end_read(&pc->end, &found, &fault)) != NOTHING) {
        if (reading == CORRUPT) {
            doubt(pc);
            continue;
        }
        pc->silent_at = after(now, pc->config.silence);
        pc->is_receiving = true;
        kawasaki_pc_settle_commands(pc, true);
        if (reading == MESSAGE) {
            take_message(pc, now, &found);
        } else {
            kawasaki_reject(&pc->end, &fault);
            doubt(pc);
        }
    }
}

/* KM-89 */
static void all_read(struct kawasaki_pc *pc, uint64_t now)
{
    if (!pc->is_due && !pc->is_receiving)
        return;
    pc->is_receiving = kawasaki_end_is_half(&pc->end);
    pc->is_due = !pc->is_receiving;
    pc->reply_at = after(now, pc->config.reply_delay);
}

size_t kawasaki_pc_input(struct kawasaki_pc *pc, uint64_t now, const uint8_t *data, size_t size)
{
    if (!pc->is_up) {
        kawasaki_report(&pc->end, KAWASAKI_UNEXPECTED);
        return size;
    }
    for (size_t taken = 0; taken < size;) {
        taken += kawasaki_msg_push(&pc->end.decoder, data + taken, size - taken);
        read_messages(pc, now);
    }
    if (pc->config.datagrams) { /* KM-9 */
        kawasaki_msg_end(&pc->end.decoder);
        read_messages(pc, now);
    }
    all_read(pc, now);
    return size;
}
