#include "cellwire/alter_controller.h"

#include "alter_events.h"

#define CYCLE (28 * MS)
/* The outcomes of an ALTER (how its start goes, an exception, its end), and those from an exception on. */
#define OUTCOMES 3
#define LAST_OUTCOMES 2
#define FIELDS 2 /* the codes of section 4.6 */
#define TOO_LONG 3
#define TIMEOUT 6

const struct alter_controller_config ALTER_CONTROLLER_DEFAULT = {
    .framing = {.leading_dle = 2}, .baud = 38400, .mode = 23, .attempts = 3, .has_gap = true, .gap = 4 * MS};

/* AL-96: outcomes, and notices. */
static bool is_notice(enum alter_controller_kind kind)
{
    return kind == ALTER_CONTROLLER_REPLY || kind == ALTER_CONTROLLER_BAD_REPLY || kind >= ALTER_CONTROLLER_STRAY;
}

static struct alter_controller_event *report(struct alter_controller *controller, enum alter_controller_kind kind)
{
    struct alter_controller_event *event = ADD_ALTER_EVENT(controller, !is_notice(kind));
    event->kind = kind;
    return event;
}

static bool is_cumulative(const struct alter_controller *controller) { return controller->config.mode & 1; }

/* W (section 7.5), and what a message of `length` bytes leaves of it (AL-72). */
static uint64_t window(const struct alter_controller *controller, uint64_t length)
{
    uint64_t time = line_time(length, controller->config.baud);
    return sooner((is_cumulative(controller) ? 15 : 17) * MS, time < CYCLE ? CYCLE - time : 0);
}

bool alter_controller_init(struct alter_controller *controller, const struct alter_controller_config *config)
{
    memset(controller, 0, sizeof *controller);
    controller->config = *config;
    controller->segment_status = 2;
    controller->segment = 1;
    val2_alter_init(&controller->decoder, VAL2_ALTER_HOST, config->framing);
    uint64_t frame = config->framing.leading_dle + 4u, message = config->mode & 4 ? 30 : 6, reply = 4;
    return config->mode < 32 && config->attempts > 0 && config->list_len <= VAL2_ALTER_MAX_LIST &&
           line_time(frame + reply, config->baud) <= window(controller, frame + message);
}

static bool is_active(const struct alter_controller *controller) { return controller->phase >= ALTER_CONTROLLER_STARTING; }

static void end_alter(struct alter_controller *controller, enum alter_controller_phase phase, uint8_t code)
{
    report(controller, ALTER_CONTROLLER_ENDED)->code = code;
    controller->phase = phase;
    controller->is_hosts_turn = false;
}

static void restart(struct alter_controller *controller, enum alter_controller_phase phase)
{
    if (is_active(controller))
        end_alter(controller, phase, TIMEOUT);
    controller->phase = phase;
    controller->has_gap = false;
    val2_alter_clear(&controller->decoder);
}

void alter_controller_connected(struct alter_controller *controller, uint64_t now)
{
    (void)now;
    restart(controller, ALTER_CONTROLLER_OFF);
}

void alter_controller_disconnected(struct alter_controller *controller, uint64_t now)
{
    (void)now;
    restart(controller, ALTER_CONTROLLER_DISCONNECTED);
}

/* AL-73 */
static void take_turn(struct alter_controller *controller, uint8_t code)
{
    if (controller->is_hosts_turn) {
        controller->slot = later(controller->following, controller->closes);
        controller->following = after(controller->slot, CYCLE);
    }
    controller->is_hosts_turn = false;
    controller->code = code;
}

static bool is_awaited(const struct alter_controller *controller, uint64_t now)
{
    return controller->is_hosts_turn && now >= controller->opens;
}

static void note_fault(struct alter_controller *controller, uint8_t code)
{
    if (controller->fault == 0)
        controller->fault = code;
}

/* AL-75 */
static void try_again(struct alter_controller *controller, uint8_t code)
{
    take_turn(controller, code);
    if (controller->attempts < controller->config.attempts)
        return;
    report(controller, ALTER_CONTROLLER_GAVE_UP);
    controller->phase = ALTER_CONTROLLER_OFF;
}

/* AL-75, AL-76 */
static void close_window(struct alter_controller *controller)
{
    uint8_t code = controller->fault != 0 ? controller->fault : TIMEOUT;
    report(controller, ALTER_CONTROLLER_BAD_REPLY)->code = code;
    if (controller->phase == ALTER_CONTROLLER_STARTING) {
        try_again(controller, code);
        return;
    }
    take_turn(controller, code);
    if (controller->fault == 0)
        controller->phase = ALTER_CONTROLLER_ENDING;
}

static void take_start_reply(struct alter_controller *controller, uint8_t answer)
{
    if (controller->phase != ALTER_CONTROLLER_STARTING) {
        note_fault(controller, FIELDS);
    } else if (answer == 0x01) {
        try_again(controller, 0);
    } else {
        take_turn(controller, 0);
        report(controller, answer == 0x00 ? ALTER_CONTROLLER_STARTED : ALTER_CONTROLLER_REFUSED);
        controller->phase = answer == 0x00 ? ALTER_CONTROLLER_RUNNING : ALTER_CONTROLLER_OFF;
        memset(controller->words, 0, sizeof controller->words);
    }
}

/* AL-70, AL-80, AL-82: what a reply makes of the arm's words. */
static void move(struct alter_controller *controller, const struct val2_alter_message *reply, int16_t *values)
{
    enum alter_controller_unselected unselected = controller->config.unselected;
    bool moves = controller->phase == ALTER_CONTROLLER_RUNNING && (controller->config.mode & 0x10);
    bool zeros = unselected == ALTER_CONTROLLER_ZERO || (unselected == ALTER_CONTROLLER_BY_MODE && is_cumulative(controller));
    for (int axis = 0; moves && axis < VAL2_ALTER_AXES; axis++) {
        if (reply->select >> axis & 1)
            controller->words[axis] = reply->values[axis];
        else if (zeros)
            controller->words[axis] = 0;
    }
    if (moves || !is_cumulative(controller))
        memcpy(values, controller->words, sizeof controller->words);
}

static void take_reply(struct alter_controller *controller, const struct val2_alter_message *reply)
{
    if (controller->phase == ALTER_CONTROLLER_STARTING) {
        note_fault(controller, FIELDS);
        return;
    }
    if (reply->exception != 0 && !HAS_ROOM(controller, LAST_OUTCOMES)) {
        note_fault(controller, TOO_LONG);
        return;
    }
    struct alter_controller_event *event = report(controller, ALTER_CONTROLLER_REPLY);
    event->message = *reply;
    move(controller, reply, event->values);
    take_turn(controller, 0);
    if (reply->exception == 0 || controller->phase != ALTER_CONTROLLER_RUNNING)
        return;
    bool aborts = !controller->config.subroutine; /* AL-78 */
    report(controller, aborts ? ALTER_CONTROLLER_ABORTED : ALTER_CONTROLLER_EXCEPTION)->code = reply->exception;
    controller->phase = aborts ? ALTER_CONTROLLER_ENDING : ALTER_CONTROLLER_INTERRUPTED;
    controller->is_reported = controller->has_returned = false;
}

/* The error code of what could not be decoded (section 4.6). */
static uint8_t code_of(enum val2_alter_kind kind)
{
    switch (kind) {
    case VAL2_ALTER_CHECKSUM:
        return 1;
    case VAL2_ALTER_TOO_LONG:
        return TOO_LONG;
    case VAL2_ALTER_INCOMPLETE:
        return 4;
    case VAL2_ALTER_START_MARK:
    case VAL2_ALTER_END_MARK:
        return 5;
    default:
        return FIELDS;
    }
}

static void take_corrupt(struct alter_controller *controller, uint64_t now, enum val2_alter_kind kind)
{
    if (is_awaited(controller, now))
        note_fault(controller, code_of(kind));
}

static void take_message(struct alter_controller *controller, uint64_t now, const struct val2_alter_message *message)
{
    if (!is_awaited(controller, now))
        report(controller, ALTER_CONTROLLER_STRAY)->message = *message;
    else if (message->kind == VAL2_ALTER_START_REPLY)
        take_start_reply(controller, message->answer);
    else
        take_reply(controller, message);
}

static void read_items(struct alter_controller *controller, uint64_t now)
{
    struct val2_alter_decoder *decoder = &controller->decoder;
    struct val2_alter_item item;
    for (;;) {
        bool is_there = val2_alter_next(decoder, &item);
        if (decoder->failures != controller->failures) { /* AL-38 */
            controller->failures = decoder->failures;
            take_corrupt(controller, now, decoder->error.kind);
        }
        if (!is_there)
            return;
        if (!item.is_error)
            take_message(controller, now, &item.message);
        else if (item.error.kind == VAL2_ALTER_START_MARK)
            take_corrupt(controller, now, item.error.kind);
    }
}

size_t alter_controller_input(struct alter_controller *controller, uint64_t now, const uint8_t *data, size_t size)
{
    if (controller->phase == ALTER_CONTROLLER_DISCONNECTED) {
        report(controller, ALTER_CONTROLLER_UNEXPECTED);
        return size;
    }
    alter_controller_timeout(controller, now);
    size_t taken = val2_alter_push(&controller->decoder, data, size);
    read_items(controller, now);
    controller->has_gap = controller->config.has_gap && val2_alter_pending(&controller->decoder) > 0;
    controller->gap_at = after(now, controller->config.gap);
    return taken;
}

static void end_bytes(struct alter_controller *controller, uint64_t now)
{
    val2_alter_end(&controller->decoder);
    read_items(controller, now);
}

/* AL-74 */
void alter_controller_timeout(struct alter_controller *controller, uint64_t now)
{
    if (controller->has_gap && now >= controller->gap_at) {
        controller->has_gap = false;
        end_bytes(controller, now);
    }
    if (!controller->is_hosts_turn || now < controller->closes)
        return;
    end_bytes(controller, now); /* only errors come of it */
    close_window(controller);
}

/* AL-71 */
bool alter_controller_start(struct alter_controller *controller, uint64_t now)
{
    if (controller->phase != ALTER_CONTROLLER_OFF || !HAS_ROOM(controller, OUTCOMES))
        return false;
    controller->phase = ALTER_CONTROLLER_STARTING;
    controller->slot = now;
    controller->following = after(now, CYCLE);
    controller->attempts = 0;
    controller->code = 0;
    return true;
}

/* AL-81 */
bool alter_controller_finish(struct alter_controller *controller)
{
    if (!is_active(controller))
        return false;
    if (controller->phase == ALTER_CONTROLLER_STARTING) {
        end_alter(controller, ALTER_CONTROLLER_OFF, 0);
    } else if (controller->phase != ALTER_CONTROLLER_ENDING) {
        take_turn(controller, 0);
        controller->phase = ALTER_CONTROLLER_ENDING;
    }
    return true;
}

/* AL-90 */
bool alter_controller_interrupt(struct alter_controller *controller)
{
    if (controller->phase != ALTER_CONTROLLER_RUNNING || controller->is_hosts_turn)
        return false;
    controller->phase = ALTER_CONTROLLER_INTERRUPTED;
    controller->is_reported = controller->has_returned = false;
    return true;
}

bool alter_controller_resume(struct alter_controller *controller)
{
    if (controller->phase != ALTER_CONTROLLER_INTERRUPTED || controller->has_returned)
        return false;
    controller->has_returned = true;
    return true;
}

void alter_controller_set_segment(struct alter_controller *controller, uint8_t status, uint16_t number, uint16_t percent)
{
    controller->segment_status = status;
    controller->segment = number;
    controller->percent = percent;
}

void alter_controller_set_transform(struct alter_controller *controller, const int16_t words[VAL2_ALTER_TRANSFORM])
{
    memcpy(controller->transform, words, sizeof controller->transform);
}

bool alter_controller_event(struct alter_controller *controller, struct alter_controller_event *event)
{
    return TAKE_EVENT(controller, event);
}

static struct val2_alter_message next_message(struct alter_controller *controller)
{
    struct val2_alter_message message = {.kind = VAL2_ALTER_RUNNING, .code = controller->code};
    if (controller->phase == ALTER_CONTROLLER_ENDING) {
        message.kind = VAL2_ALTER_END;
    } else if (controller->phase == ALTER_CONTROLLER_STARTING) {
        message.kind = VAL2_ALTER_START;
        message.mode = controller->config.mode;
        message.list_len = controller->config.list_len;
        memcpy(message.list, controller->config.list, sizeof message.list);
    } else {
        if (controller->phase == ALTER_CONTROLLER_INTERRUPTED)
            message.kind = VAL2_ALTER_INTERRUPTED;
        message.status = controller->segment_status;
        message.segment = controller->segment;
        message.percent = controller->percent;
        message.has_transform = controller->config.mode & 4;
        memcpy(message.transform, controller->transform, sizeof message.transform);
    }
    return message;
}

/* AL-72, AL-79 */
size_t alter_controller_transmit(struct alter_controller *controller, uint64_t now, uint8_t *out, size_t size)
{
    alter_controller_timeout(controller, now);
    if (!is_active(controller) || controller->is_hosts_turn || now < controller->slot)
        return 0;
    if (controller->phase == ALTER_CONTROLLER_INTERRUPTED && controller->is_reported && controller->has_returned)
        controller->phase = ALTER_CONTROLLER_RUNNING;
    struct val2_alter_message message = next_message(controller);
    size_t length = val2_alter_encode(&message, controller->config.framing, out, size);
    if (length == 0)
        return 0;
    controller->is_reported = true;
    if (controller->phase == ALTER_CONTROLLER_STARTING)
        controller->attempts++;
    val2_alter_clear(&controller->decoder);
    controller->has_gap = false;
    if (controller->phase == ALTER_CONTROLLER_ENDING) {
        end_alter(controller, ALTER_CONTROLLER_OFF, controller->code);
        return length;
    }
    controller->is_hosts_turn = true;
    controller->fault = 0;
    controller->opens = after(now, line_time(length, controller->config.baud));
    controller->closes = after(controller->opens, window(controller, length));
    return length;
}

bool alter_controller_deadline(const struct alter_controller *controller, uint64_t *deadline)
{
    *deadline = NEVER;
    if (controller->has_gap)
        *deadline = controller->gap_at;
    if (is_active(controller))
        *deadline = sooner(*deadline, controller->is_hosts_turn ? controller->closes : controller->slot);
    return *deadline != NEVER;
}
