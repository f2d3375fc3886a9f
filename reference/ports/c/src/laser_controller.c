#include "cellwire/laser_controller.h"

#include <math.h>

#include "laser_payload.h"
#include "session.h"

#define SHORTEST_FRAME 8 /* LE-85 */
#define MAX_VALUES 508   /* LE-83 */
#define HEAD_LEN 3

static const uint8_t HEAD[HEAD_LEN] = {0xEB, 0x90, 0x82};

static struct laser_controller_event *report(struct laser_controller *controller, enum laser_controller_kind kind)
{
    struct laser_controller_event *event = ADD_EVENT(controller);
    event->kind = kind;
    return event;
}

struct laser_controller_config laser_controller_default(void)
{
    return (struct laser_controller_config){.profile = LASER_EB90_DEFAULT,
                                            .words = LASER_WORDS_DEFAULT,
                                            .batch = 7,
                                            .tick = 16 * MS,
                                            .silence = 50 * MS};
}

bool laser_controller_init(struct laser_controller *controller, const struct laser_controller_config *config)
{
    memset(controller, 0, sizeof *controller);
    controller->config = *config;
    return laser_eb90_profile_is_valid(&config->profile) && laser_words_are_valid(&config->words) && config->batch >= 1 &&
           config->batch <= UINT8_MAX;
}

static bool is_partial(const struct laser_controller *controller) { return controller->decoder.length > 0; }

static void forget_fault(struct laser_controller *controller)
{
    controller->has_fault = controller->is_fault_answered = false;
    controller->fault_len = 0;
}

/* LE-87 */
static void restart(struct laser_controller *controller, enum laser_controller_line line)
{
    controller->line = line;
    laser_eb90_init(&controller->decoder, controller->config.profile);
    controller->rest = controller->has_peer = false;
    forget_fault(controller);
    if (controller->work == LASER_CONTROLLER_ANSWERING)
        controller->work = LASER_CONTROLLER_LISTENING;
}

void laser_controller_connected(struct laser_controller *controller, uint64_t now)
{
    (void)now;
    restart(controller, LASER_CONTROLLER_SILENT);
    line_echo_init(&controller->echo, controller->config.echo);
}

void laser_controller_disconnected(struct laser_controller *controller, uint64_t now)
{
    (void)now;
    restart(controller, LASER_CONTROLLER_DISCONNECTED);
}

/* LE-78: an answer begins with its word. */
static void begin_answer(struct laser_controller *controller, uint64_t now, uint16_t word)
{
    uint64_t tick = controller->config.tick, over = tick == 0 ? 0 : now % tick;
    controller->answer = (struct laser_eb90_payload){.profile = &controller->config.profile};
    put_word(&controller->answer, word);
    controller->work = LASER_CONTROLLER_ANSWERING;
    controller->is_resent = false;
    controller->due = over == 0 ? now : after(now, tick - over);
}

static void answer_error(struct laser_controller *controller, uint64_t now, enum laser_words_error error)
{
    begin_answer(controller, now, controller->config.words.errors[error]);
    controller->is_resent = error == LASER_WORDS_BAD_CHECKSUM || error == LASER_WORDS_BAD_FRAME;
}

static void refuse(struct laser_controller *controller, uint64_t now, enum laser_words_error error)
{
    report(controller, LASER_CONTROLLER_REFUSED)->refusal = error;
    answer_error(controller, now, error);
}

/* LE-75, LE-76 */
static void take_error(struct laser_controller *controller, const struct laser_eb90_result *result, bool has_head)
{
    bool is_listening = controller->work == LASER_CONTROLLER_LISTENING;
    bool is_headless = !has_head || result->kind == LASER_EB90_FLAG ||
                       (result->kind == LASER_EB90_TAG && result->error_offset == 0);
    struct laser_controller_event *event = report(controller, LASER_CONTROLLER_CORRUPT);
    event->error = result->kind;
    event->error_offset = result->error_offset;
    event->expected = result->expected;
    event->found = result->found;
    if (!controller->has_fault) {
        controller->has_fault = true;
        controller->fault = result->kind == LASER_EB90_BAD_CHECK ? LASER_WORDS_BAD_CHECKSUM : LASER_WORDS_BAD_FRAME;
    }
    controller->fault_len += result->length;
    if (controller->fault_len > SHORTEST_FRAME)
        controller->fault_len = SHORTEST_FRAME;
    if (is_listening && !controller->rest) {
        controller->is_fault_answered = true;
    } else if (is_listening && !is_headless) {
        controller->rest = false;
        controller->is_fault_answered = result->length >= SHORTEST_FRAME;
    }
}

/* Whether the parameters of an instruction are finite. */
static bool are_finite(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item)
{
    for (size_t i = 0; item->type == LASER_EB90_F32 && i < item->count; i++)
        if (!isfinite(laser_eb90_get_f32(profile, item, i)))
            return false;
    return true;
}

/* The instruction at `*at`: its word and its parameters, which begin at `*begin`; false: there is none. */
static bool next_instruction(const struct laser_controller *controller, size_t *at, uint16_t *word, size_t *begin, bool *is_finite)
{
    const struct laser_eb90_profile *profile = &controller->config.profile;
    const struct laser_eb90_result *frame = &controller->frame;
    struct laser_eb90_item item;
    uint16_t other;
    *is_finite = true;
    if (!first_word(profile, frame->payload, frame->payload_len, at, word))
        return false;
    *begin = *at;
    for (size_t next = *at; laser_eb90_item(profile, frame->payload, frame->payload_len, &next, &item); *at = next) {
        if (is_word(profile, &item, &other))
            break;
        *is_finite = *is_finite && are_finite(profile, &item);
    }
    return true;
}

/* LE-92, LE-93 */
static enum laser_words_error judge_batch(const struct laser_controller *controller, size_t *count)
{
    const struct laser_controller_config *config = &controller->config;
    const uint8_t *payload = controller->frame.payload;
    size_t at = 0, begin;
    uint16_t word;
    bool is_finite;
    for (*count = 0; next_instruction(controller, &at, &word, &begin, &is_finite); ++*count) {
        enum laser_words_class class = laser_words_class(&config->words, word);
        if (class == LASER_WORDS_NO_CLASS)
            return LASER_WORDS_UNKNOWN_COMMAND;
        if (class != LASER_WORDS_INTERPRETED || *count >= config->batch)
            return LASER_WORDS_BAD_BATCH;
        if (!is_finite || !config->owner.takes(config->owner.context, word, payload + begin, at - begin))
            return LASER_WORDS_BAD_PARAMETERS;
    }
    return config->owner.room(config->owner.context) < *count ? LASER_WORDS_QUEUE_FULL : LASER_WORDS_NO_ERROR;
}

/* LE-96, LE-97 */
static enum laser_words_error judge_lone(const struct laser_controller *controller, size_t at)
{
    const struct laser_eb90_profile *profile = &controller->config.profile;
    const struct laser_eb90_result *frame = &controller->frame;
    struct laser_eb90_item item;
    uint16_t word;
    bool is_finite = true;
    while (laser_eb90_item(profile, frame->payload, frame->payload_len, &at, &item)) {
        if (is_word(profile, &item, &word) && laser_words_class(&controller->config.words, word) != LASER_WORDS_NO_CLASS)
            return LASER_WORDS_BAD_BATCH;
        is_finite = is_finite && are_finite(profile, &item);
    }
    return is_finite ? LASER_WORDS_NO_ERROR : LASER_WORDS_BAD_PARAMETERS;
}

/* LE-94, LE-95 */
static void queue(struct laser_controller *controller, uint64_t now, uint16_t word, size_t count)
{
    const struct laser_controller_owner *owner = &controller->config.owner;
    size_t at = 0, begin;
    uint16_t each;
    bool is_finite;
    while (next_instruction(controller, &at, &each, &begin, &is_finite))
        owner->queue(owner->context, each, controller->frame.payload + begin, at - begin);
    report(controller, LASER_CONTROLLER_QUEUED)->count = count;
    begin_answer(controller, now, word);
}

/* Section 8.6, LE-77 */
static void take_frame(struct laser_controller *controller, uint64_t now)
{
    const struct laser_eb90_result *frame = &controller->frame;
    size_t at = 0, count = 0;
    uint16_t word;
    if (controller->fault_len >= SHORTEST_FRAME) { /* LE-112 */
        controller->is_fault_answered = true;
        controller->work = LASER_CONTROLLER_LISTENING;
        controller->rest = false;
        return;
    }
    forget_fault(controller);
    if (!first_word(&controller->config.profile, frame->payload, frame->payload_len, &at, &word)) {
        refuse(controller, now, LASER_WORDS_BAD_FRAME);
        return;
    }
    enum laser_words_class class = laser_words_class(&controller->config.words, word);
    enum laser_words_error error = class == LASER_WORDS_NO_CLASS      ? LASER_WORDS_UNKNOWN_COMMAND
                                   : class == LASER_WORDS_INTERPRETED ? judge_batch(controller, &count)
                                                                      : judge_lone(controller, at);
    if (error != LASER_WORDS_NO_ERROR) {
        refuse(controller, now, error);
    } else if (class == LASER_WORDS_INTERPRETED) {
        queue(controller, now, word, count);
    } else {
        struct laser_controller_event *event = report(controller, LASER_CONTROLLER_EXECUTE);
        event->word_class = class;
        event->word = controller->word = word;
        controller->work = LASER_CONTROLLER_EXECUTING;
        controller->has_peer = true;
    }
}

/* LE-84: the line is silent, if it has been for long enough. */
static void end_stretch(struct laser_controller *controller, uint64_t now)
{
    if (now >= controller->silent_at) {
        controller->line = LASER_CONTROLLER_SILENT;
        forget_fault(controller);
    }
}

static void read_items(struct laser_controller *controller, uint64_t now)
{
    while (controller->work != LASER_CONTROLLER_EXECUTING) {
        bool has_head = controller->decoder.length >= HEAD_LEN && memcmp(controller->decoder.held, HEAD, HEAD_LEN) == 0;
        if (!laser_eb90_next(&controller->decoder, &controller->frame))
            break;
        if (controller->frame.kind == LASER_EB90_FRAME)
            take_frame(controller, now);
        else
            take_error(controller, &controller->frame, has_head);
    }
    if (controller->work == LASER_CONTROLLER_ANSWERING && !is_partial(controller))
        end_stretch(controller, now);
}

/* LE-113: how many of the first bytes are not to be read. */
static size_t remove_echo(struct laser_controller *controller, const uint8_t *data, size_t size)
{
    struct line_echo_error error;
    size_t own = line_echo_receive(&controller->echo, controller->sent, data, size, &error);
    if (error.kind != LINE_ECHO_NONE)
        report(controller, LASER_CONTROLLER_LINE_ECHO)->echo = error;
    return own;
}

/* LE-74, LE-80 */
size_t laser_controller_input(struct laser_controller *controller, uint64_t now, const uint8_t *data, size_t size)
{
    size_t taken = remove_echo(controller, data, size), more;
    if (taken == size)
        return size;
    if (controller->line == LASER_CONTROLLER_DISCONNECTED) {
        report(controller, LASER_CONTROLLER_UNEXPECTED);
        return size;
    }
    controller->line = LASER_CONTROLLER_BYTES;
    controller->silent_at = after(now, controller->config.silence);
    do {
        more = laser_eb90_push(&controller->decoder, data + taken, size - taken);
        taken += more;
        read_items(controller, now);
    } while (more > 0);
    return size;
}

/* LE-84 */
void laser_controller_timeout(struct laser_controller *controller, uint64_t now)
{
    bool is_silent = controller->line == LASER_CONTROLLER_BYTES && now >= controller->silent_at;
    bool is_awaited = controller->work == LASER_CONTROLLER_LISTENING ||
                      (controller->work == LASER_CONTROLLER_ANSWERING && is_partial(controller));
    if (!is_silent || !is_awaited)
        return;
    laser_eb90_end(&controller->decoder);
    read_items(controller, now);
    bool answers = controller->is_fault_answered && controller->fault_len >= SHORTEST_FRAME;
    controller->line = LASER_CONTROLLER_SILENT;
    if (answers)
        refuse(controller, now, controller->fault);
    forget_fault(controller);
}

const uint8_t *laser_controller_parameters(const struct laser_controller *controller, size_t *length)
{
    size_t at = 0;
    uint16_t word;
    first_word(&controller->config.profile, controller->frame.payload, controller->frame.payload_len, &at, &word);
    *length = controller->frame.payload_len - at;
    return controller->frame.payload + at;
}

bool laser_controller_answer(struct laser_controller *controller, uint64_t now, const struct laser_eb90_payload *values)
{
    bool is_query = laser_words_class(&controller->config.words, controller->word) == LASER_WORDS_QUERY;
    if (controller->work != LASER_CONTROLLER_EXECUTING || (values != NULL && (values->is_refused || values->length > MAX_VALUES)))
        return false;
    controller->work = LASER_CONTROLLER_LISTENING;
    if (controller->has_peer) {
        begin_answer(controller, now, controller->word);
        for (size_t i = 0; is_query && values != NULL && i < values->length; i++)
            laser_eb90_put_byte(&controller->answer, values->bytes[i]);
    }
    read_items(controller, now);
    return true;
}

bool laser_controller_refuse(struct laser_controller *controller, uint64_t now, enum laser_words_error refusal)
{
    if (controller->work != LASER_CONTROLLER_EXECUTING || refusal >= LASER_WORDS_NO_ERROR)
        return false;
    controller->work = LASER_CONTROLLER_LISTENING;
    if (controller->has_peer)
        refuse(controller, now, refusal);
    read_items(controller, now);
    return true;
}

bool laser_controller_event(struct laser_controller *controller, struct laser_controller_event *event)
{
    return TAKE_EVENT(controller, event);
}

/* LE-82 */
size_t laser_controller_transmit(struct laser_controller *controller, uint64_t now, uint8_t *out, size_t size)
{
    laser_controller_timeout(controller, now);
    if (controller->work != LASER_CONTROLLER_ANSWERING || now < controller->due || is_partial(controller))
        return 0;
    size_t length = laser_eb90_encode(&controller->answer, out, size);
    if (length == 0)
        return 0;
    controller->work = LASER_CONTROLLER_LISTENING;
    line_echo_sent(&controller->echo, controller->sent, out, length, false); /* a host may send the same */
    controller->rest = controller->is_resent || controller->has_fault;
    end_stretch(controller, now);
    return length;
}

/* LE-88 */
bool laser_controller_deadline(const struct laser_controller *controller, uint64_t *deadline)
{
    bool has_bytes = controller->line == LASER_CONTROLLER_BYTES;
    bool is_answering = controller->work == LASER_CONTROLLER_ANSWERING;
    *deadline = is_answering && !is_partial(controller) ? controller->due : controller->silent_at;
    return (is_answering || (controller->work == LASER_CONTROLLER_LISTENING && has_bytes)) && *deadline != NEVER;
}
