/* What a PC answers (section 9.4). */
#include "kawasaki_pc.h"

#define CANCELLED (2 * SECOND) /* KM-93 */

static void add_status(const struct kawasaki_pc *pc, struct packet *packet)
{
    const struct values values = {.of = {[KAWASAKI_ORDER] = pc->number,
                                         [KAWASAKI_PHASE] = pc->stage == KAWASAKI_PC_IDLE     ? 0
                                                            : is_starting(pc)                 ? 1
                                                            : pc->stage == KAWASAKI_PC_ACTIVE ? 2
                                                            : pc->stage == KAWASAKI_PC_ENDING ? 3
                                                                                              : 4,
                                         [KAWASAKI_QUEUED] = number_or_none(&pc->end, pc->sent),
                                         [KAWASAKI_EXECUTED] = number_or_none(&pc->end, pc->executed)}};
    kawasaki_add(packet, KAWASAKI_STATUS, 0, &values);
}

static bool add_of_order(struct packet *packet, enum kawasaki_role role, uint16_t order)
{
    const struct values values = {.of = {[KAWASAKI_ORDER] = order, [KAWASAKI_NUMBER] = 1}};
    return kawasaki_add(packet, role, 0, &values);
}

/* KM-93 */
static void add_order(struct kawasaki_pc *pc, uint64_t now, struct packet *packet)
{
    bool datagrams = pc->config.datagrams;
    if (pc->stage == KAWASAKI_PC_ENDING) {
        add_of_order(packet, KAWASAKI_ORDER_END, pc->number);
    } else if (pc->stage == KAWASAKI_PC_INTERRUPTED) {
        add_of_order(packet, KAWASAKI_ORDER_INTERRUPT, pc->number);
    } else if (pc->is_cancelled) {
        if (datagrams) {
            uint64_t limit = after(now, CANCELLED);
            pc->answer_by = pc->has_answer_by ? sooner(pc->answer_by, limit) : limit;
            pc->has_answer_by = true;
        }
    } else if (pc->stage == KAWASAKI_PC_FOREIGN) {
        bool ends = pc->config.takeover == KAWASAKI_TAKEOVER_END;
        if (pc->config.takeover != KAWASAKI_TAKEOVER_NEVER)
            add_of_order(packet, ends ? KAWASAKI_ORDER_END : KAWASAKI_ORDER_INTERRUPT, pc->foreign);
    } else if (is_starting(pc) && pc->knows_robot && (pc->stage != KAWASAKI_PC_SENT || datagrams)) {
        if (add_of_order(packet, KAWASAKI_ORDER_START, pc->number)) {
            pc->stage = KAWASAKI_PC_SENT;
            pc->has_answer_by = !datagrams;
            pc->answer_by = after(now, pc->config.silence);
        }
    }
}

static void add_commands(struct kawasaki_pc *pc, struct packet *packet)
{
    for (size_t i = 0; i < pc->command_count; i++) {
        struct kawasaki_pc_command *command = &pc->commands[i];
        const struct values values = {.of = {[KAWASAKI_ORDER] = pc->number, [KAWASAKI_VALUE] = command->value}};
        if (!kawasaki_add(packet, KAWASAKI_COMMAND, command->id, &values))
            return;
        command->is_in_flight = true;
    }
}

/* KM-97 */
static void report_unfit(struct kawasaki_pc *pc, uint64_t index, const struct kawasaki_fault *fault)
{
    struct kawasaki_event *event = kawasaki_report_outcome(&pc->end, KAWASAKI_JOB_UNFIT);
    event->order = pc->number;
    event->index = index;
    event->fault = *fault;
    pc->stage = KAWASAKI_PC_ENDING;
}

/* KM-95 */
static void add_jobs(struct kawasaki_pc *pc, struct packet *packet)
{
    const struct kawasaki_dialect *dialect = &pc->end.dialect;
    uint8_t own[KAWASAKI_MAX_OWN];
    for (uint64_t count = later(pc->jobs_from, pc->executed); count < pc->executed + pc->window; count++) {
        struct values values = {.of = {[KAWASAKI_ORDER] = pc->number, [KAWASAKI_NUMBER] = number_at(&pc->end, count + 1)}};
        struct kawasaki_fault fault;
        if (count >= pc->jobs.count) {
            if (!pc->jobs.is_open) {
                pc->total = pc->jobs.count;
                pc->has_total = true;
            }
            return;
        }
        const struct kawasaki_value *job = pc->jobs.values + count * dialect->job_count;
        values.own.bytes = own;
        if (!kawasaki_job_write(dialect, job, own, sizeof own, &values.own.length, &fault)) {
            report_unfit(pc, count, &fault);
            return;
        }
        if (!kawasaki_add(packet, KAWASAKI_JOB, 0, &values))
            return;
        pc->sent = later(pc->sent, count + 1);
    }
}

/* KM-92 */
size_t kawasaki_pc_transmit(struct kawasaki_pc *pc, uint64_t now, uint8_t *out, size_t size)
{
    struct packet packet = {&pc->end, out, 0};
    if (!pc->is_due || now < pc->reply_at || size < pc->end.packet)
        return 0;
    bool is_done = pc->executed == pc->sent && !pc->jobs.is_open && pc->jobs.count <= pc->sent;
    if (pc->stage == KAWASAKI_PC_ACTIVE && pc->config.end_when_done && is_done) { /* KM-94 */
        pc->stage = KAWASAKI_PC_ENDING;
        pc->total = pc->sent;
        pc->has_total = true;
    }
    if (pc->asks_status)
        add_status(pc, &packet);
    add_order(pc, now, &packet);
    add_commands(pc, &packet);
    if (pc->stage == KAWASAKI_PC_ACTIVE && pc->has_request)
        add_jobs(pc, &packet);
    pc->asks_status = pc->has_request = pc->is_due = false;
    return kawasaki_finish(&packet);
}
