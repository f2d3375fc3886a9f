#include "kawasaki_pc.h"

#define ROOM 6 /* outcomes (KM-120) */

const struct kawasaki_pc_config KAWASAKI_PC_DEFAULT = {
    .limits = {255, KAWASAKI_MSG_MAX_LEN},
    .max_number = KAWASAKI_LARGEST,
    .reply_delay = 2 * MS,
    .silence = 10 * SECOND,
    .takeover = KAWASAKI_TAKEOVER_INTERRUPT,
    .start_retries = 10,
    .end_when_done = true,
};

bool kawasaki_pc_init(struct kawasaki_pc *pc, const struct kawasaki_pc_config *config)
{
    memset(pc, 0, sizeof *pc);
    pc->config = *config;
    if (config->dialect.entries == NULL)
        pc->config.dialect = KAWASAKI_DIALECT;
    const struct kawasaki_dialect *dialect = &pc->config.dialect;
    if (!kawasaki_end_init(&pc->end, dialect, &config->limits, config->max_number, config->datagrams))
        return false;
    const uint16_t window = (uint16_t)(config->datagrams ? config->max_number / 2 : config->max_number - 1);
    pc->window = config->individual_acks && window > 1024 ? 1024 : window; /* KM-95 */
    if (config->takeover == KAWASAKI_TAKEOVER_INTERRUPT && !kawasaki_has(dialect, KAWASAKI_ORDER_INTERRUPT))
        return false;
    return config->silence > 0 && (!config->individual_acks || kawasaki_has(dialect, KAWASAKI_JOB_ACK));
}

static void begin(struct kawasaki_pc *pc, uint16_t order, const struct kawasaki_pc_jobs *jobs)
{
    pc->has_progress = false;
    pc->number = pc->foreign = order;
    pc->jobs = *jobs;
    pc->executed = pc->queued = pc->sent = 0;
    pc->has_total = pc->is_unsure = pc->is_cancelled = pc->has_answer_by = pc->has_left = false;
    pc->refusals = 0;
    memset(pc->ahead, 0, sizeof pc->ahead);
}

static bool can_begin(const struct kawasaki_pc *pc, uint16_t order)
{
    return order != 0 && pc->stage == KAWASAKI_PC_IDLE && kawasaki_has_room(&pc->end, ROOM);
}

/* KM-112 */
bool kawasaki_pc_start(struct kawasaki_pc *pc, uint16_t order, const struct kawasaki_pc_jobs *jobs)
{
    if (!can_begin(pc, order))
        return false;
    begin(pc, order, jobs);
    pc->stage = pc->knows_robot && pc->robot == order ? KAWASAKI_PC_FOREIGN : KAWASAKI_PC_UNSENT;
    return true;
}

/* KM-128 */
bool kawasaki_pc_resume(struct kawasaki_pc *pc, uint16_t order, const struct kawasaki_pc_jobs *jobs,
                        const struct kawasaki_pc_reached *reached)
{
    if (!can_begin(pc, order) || reached->sent < reached->executed || reached->sent - reached->executed > pc->window)
        return false;
    if (!jobs->is_open && jobs->count < reached->sent)
        return false;
    begin(pc, order, jobs);
    pc->stage = KAWASAKI_PC_ACTIVE;
    pc->executed = pc->queued = reached->executed;
    pc->sent = pc->total = reached->sent;
    pc->has_total = !jobs->is_open && jobs->count <= pc->sent;
    for (size_t i = 0; pc->config.individual_acks && i < reached->ahead_count; i++)
        if (reached->ahead[i] >= pc->executed && reached->ahead[i] < pc->sent)
            include(pc->ahead, number_at(&pc->end, reached->ahead[i] + 1));
    pc->is_unsure = true;
    return true;
}

void kawasaki_pc_set_jobs(struct kawasaki_pc *pc, const struct kawasaki_pc_jobs *jobs) { pc->jobs = *jobs; }

/* KM-113 */
bool kawasaki_pc_end(struct kawasaki_pc *pc)
{
    if (pc->stage != KAWASAKI_PC_ACTIVE)
        return false;
    pc->stage = KAWASAKI_PC_ENDING;
    return true;
}

/* KM-114 */
bool kawasaki_pc_interrupt(struct kawasaki_pc *pc)
{
    bool is_over = pc->stage == KAWASAKI_PC_IDLE || pc->stage == KAWASAKI_PC_INTERRUPTED || pc->is_cancelled;
    if (is_over || !kawasaki_has(&pc->end.dialect, KAWASAKI_ORDER_INTERRUPT))
        return false;
    if (pc->stage == KAWASAKI_PC_UNSENT || pc->stage == KAWASAKI_PC_FOREIGN)
        kawasaki_pc_over(pc);
    else if (is_starting(pc))
        pc->is_cancelled = true;
    else
        pc->stage = KAWASAKI_PC_INTERRUPTED;
    return true;
}

/* KM-98 */
bool kawasaki_pc_command(struct kawasaki_pc *pc, uint8_t id, int32_t value)
{
    bool has_room = pc->command_count < KAWASAKI_PC_COMMANDS && kawasaki_has_room(&pc->end, ROOM);
    if (kawasaki_entry(&pc->end.dialect, KAWASAKI_COMMAND, id) == NULL || !has_room)
        return false;
    pc->commands[pc->command_count++] = (struct kawasaki_pc_command){id, value, false};
    return true;
}

void kawasaki_pc_settle_commands(struct kawasaki_pc *pc, bool is_transmitted)
{
    size_t kept = 0;
    for (size_t i = 0; i < pc->command_count; i++) {
        struct kawasaki_pc_command command = pc->commands[i];
        if (!command.is_in_flight) {
            pc->commands[kept++] = command;
            continue;
        }
        struct kawasaki_event *event = kawasaki_report_outcome(&pc->end, KAWASAKI_COMMANDED);
        event->id = command.id;
        event->value = command.value;
        event->has_value = true;
        event->is_transmitted = is_transmitted;
    }
    pc->command_count = kept;
}

static struct kawasaki_event *report_outcome(struct kawasaki_pc *pc, enum kawasaki_event_kind kind)
{
    struct kawasaki_event *event = kawasaki_report_outcome(&pc->end, kind);
    event->order = pc->number;
    event->executed = pc->executed;
    event->sent = pc->sent;
    pc->number = 0;
    pc->stage = KAWASAKI_PC_IDLE;
    return event;
}

void kawasaki_pc_lose_outcome(struct kawasaki_pc *pc) { report_outcome(pc, KAWASAKI_OUTCOME_UNKNOWN); }

void kawasaki_pc_over(struct kawasaki_pc *pc)
{
    bool is_doubtful = pc->config.individual_acks && (pc->is_unsure || pc->config.datagrams);
    if (is_doubtful && pc->executed < pc->sent) {
        kawasaki_pc_lose_outcome(pc);
        return;
    }
    bool complete = is_running(pc) && pc->has_total && pc->executed == pc->total;
    report_outcome(pc, KAWASAKI_ORDER_OVER)->complete = complete;
}

static void lose(struct kawasaki_pc *pc)
{
    pc->end.closes = pc->is_up = pc->is_receiving = pc->is_due = pc->asks_status = pc->has_request = pc->knows_robot = false;
    if (pc->stage == KAWASAKI_PC_SENT)
        pc->stage = KAWASAKI_PC_LOST;
    kawasaki_pc_settle_commands(pc, false);
}

/* KM-86 */
void kawasaki_pc_connected(struct kawasaki_pc *pc, uint64_t now)
{
    lose(pc);
    kawasaki_end_clear(&pc->end);
    pc->is_up = true;
    pc->silent_at = after(now, pc->config.silence);
}

void kawasaki_pc_disconnected(struct kawasaki_pc *pc, uint64_t now)
{
    (void)now;
    lose(pc);
}

/* KM-87, KM-88 */
void kawasaki_pc_timeout(struct kawasaki_pc *pc, uint64_t now)
{
    if (!pc->is_up)
        return;
    if (pc->stage == KAWASAKI_PC_SENT && pc->has_answer_by && now >= pc->answer_by) {
        pc->has_answer_by = false;
        if (pc->config.datagrams)
            pc->stage = KAWASAKI_PC_LOST;
        else
            pc->end.closes = true;
    }
    if (now >= pc->silent_at) {
        pc->silent_at = after(now, pc->config.silence);
        pc->end.closes = true;
    }
}

bool kawasaki_pc_event(struct kawasaki_pc *pc, struct kawasaki_event *event)
{
    if (kawasaki_end_event(&pc->end, event))
        return true;
    bool has_progress = kawasaki_take_flag(&pc->has_progress, KAWASAKI_PROGRESS, event);
    event->executed = pc->executed;
    event->queued = pc->queued;
    return has_progress;
}

/* KM-119 */
bool kawasaki_pc_deadline(const struct kawasaki_pc *pc, uint64_t *deadline)
{
    *deadline = pc->silent_at;
    if (pc->is_due)
        *deadline = sooner(*deadline, pc->reply_at);
    if (pc->stage == KAWASAKI_PC_SENT && pc->has_answer_by)
        *deadline = sooner(*deadline, pc->answer_by);
    return pc->is_up && *deadline != NEVER;
}
