#include "cellwire/laser_host.h"

#include <string.h>

#include "laser_payload.h"
#include "session.h"

#define ANSWER_LEN 13 /* LE-70 */
#define REFERENCE_BAUD 9600
#define WORD_LEN 4 /* of a payload */

static enum laser_words_class class_of(const struct laser_host *host, uint16_t word)
{
    return laser_words_class(&host->config.words, word);
}

static struct laser_host_event *report(struct laser_host *host, enum laser_host_kind kind)
{
    struct laser_host_event *event = ADD_EVENT(host);
    event->kind = kind;
    return event;
}

struct laser_host_config laser_host_default(uint32_t baud)
{
    uint64_t usual = line_time(ANSWER_LEN, REFERENCE_BAUD), e = later(line_time(ANSWER_LEN, baud), usual) - usual;
    return (struct laser_host_config){
        .profile = LASER_EB90_DEFAULT,
        .words = LASER_WORDS_DEFAULT,
        .baud = baud,
        .batch = 7,
        .resends = 3,
        .answer_timeout = after(250 * MS, e),
        .execution_timeout = after(30 * SECOND, e),
        .settle = after(100 * MS, e),
        .max_pause = 300 * MS,
        .reply_time = after(40 * MS, e),
        .longest_frame = LASER_EB90_MAX_LEN,
        .backoff = 100 * MS,
        .full_timeout = 60 * SECOND,
    };
}

bool laser_host_init(struct laser_host *host, const struct laser_host_config *config)
{
    memset(host, 0, sizeof *host);
    host->config = *config;
    return laser_eb90_profile_is_valid(&config->profile) && laser_words_are_valid(&config->words) && config->baud > 0 &&
           config->batch >= 1 && config->batch <= LASER_HOST_BATCH;
}

/* How long the controller executes before it answers (LE-48). */
static uint64_t execution(const struct laser_host *host)
{
    return class_of(host, host->batch.word) == LASER_WORDS_INTERPRETED ? 0 : host->config.execution_timeout;
}

static uint64_t answer_time(const struct laser_host *host)
{
    return class_of(host, host->batch.word) == LASER_WORDS_INTERPRETED ? host->config.answer_timeout : host->config.execution_timeout;
}

static uint64_t settled(const struct laser_host *host, uint64_t now)
{
    return after(later(now, host->received_by), host->config.settle);
}

static uint64_t settled_if_taken(const struct laser_host *host, uint64_t now)
{
    return after(later(now, host->executed_by), host->config.settle);
}

/* The frame in flight has its outcome; it was not Done, so that the caller has to resume. */
static struct laser_host_event *finish(struct laser_host *host, enum laser_host_kind kind, const char *text,
                                       uint64_t quiet_until)
{
    struct laser_host_event *event = report(host, kind);
    event->first = host->batch.first;
    event->count = host->batch.count;
    event->text = text;
    host->batch.count = 0;
    host->state = LASER_HOST_HELD;
    host->quiet_until = quiet_until;
    return event;
}

/* LE-63; what AwaitingRest waits for is settled if taken, or past when there is a connection again. */
void laser_host_disconnected(struct laser_host *host, uint64_t now)
{
    bool is_sent_again = host->state == LASER_HOST_RESENDING;
    if (host->batch.count > 0)
        finish(host, LASER_HOST_UNKNOWN, "disconnected", is_sent_again ? host->until : settled_if_taken(host, now));
    bool is_held = host->state == LASER_HOST_HELD || host->state == LASER_HOST_DISCONNECTED_HELD;
    host->state = is_held ? LASER_HOST_DISCONNECTED_HELD : LASER_HOST_DISCONNECTED;
}

/* LE-64 */
void laser_host_connected(struct laser_host *host, uint64_t now)
{
    const struct laser_host_config *config = &host->config;
    laser_host_disconnected(host, now);
    laser_eb90_init(&host->decoder, config->profile);
    line_echo_init(&host->echo, config->echo);
    host->state = host->state == LASER_HOST_DISCONNECTED_HELD ? LASER_HOST_HELD : LASER_HOST_IDLE;
    uint64_t drained = after(now, line_time(config->longest_frame, config->baud));
    drained = after(after(after(drained, config->max_pause), config->earlier_execution), config->settle);
    host->quiet_until = later(host->quiet_until, drained);
}

static void resend(struct laser_host *host, uint64_t not_before)
{
    host->state = LASER_HOST_RESENDING;
    host->until = not_before;
}

/* LE-52 to LE-56, LE-69 */
static void take_code(struct laser_host *host, uint64_t now, enum laser_words_error code)
{
    struct laser_host_batch *batch = &host->batch;
    bool may_be_half = code == LASER_WORDS_BAD_FRAME && now < host->final_from && !host->config.controller_drops_partial;
    if (may_be_half) {
        host->state = LASER_HOST_AWAITING_REST;
        host->until = settled_if_taken(host, now);
        return;
    }
    if ((code == LASER_WORDS_BAD_CHECKSUM || code == LASER_WORDS_BAD_FRAME) && batch->resends < host->config.resends) {
        batch->resends++;
        resend(host, settled(host, now));
        return;
    }
    if (code == LASER_WORDS_QUEUE_FULL) {
        if (!batch->has_full_until)
            batch->full_until = after(now, host->config.full_timeout);
        batch->has_full_until = true;
        if (now < batch->full_until) {
            resend(host, after(now, host->config.backoff));
            return;
        }
    }
    if (batch->unanswered > 0)
        finish(host, LASER_HOST_UNKNOWN, "silence", settled(host, now));
    else if (code == LASER_WORDS_BAD_PARAMETERS && class_of(host, batch->word) == LASER_WORDS_IMMEDIATE)
        finish(host, LASER_HOST_UNKNOWN, "execution_failed", settled(host, now));
    else
        finish(host, LASER_HOST_REFUSED, laser_words_name(code), settled(host, now));
}

/* LE-50 */
static void take_echo(struct laser_host *host, uint64_t now, const struct laser_eb90_result *result)
{
    bool is_query = class_of(host, host->batch.word) == LASER_WORDS_QUERY;
    struct laser_host_event *event = report(host, is_query ? LASER_HOST_ANSWER : LASER_HOST_DONE);
    event->first = host->batch.first;
    event->count = host->batch.count;
    event->resends = host->batch.resends;
    event->unanswered = host->batch.unanswered;
    if (is_query)
        host->answer = *result;
    host->batch.count = 0;
    host->state = LASER_HOST_IDLE;
    host->quiet_until = now;
}

/* Section 7.4 */
static void take_answer(struct laser_host *host, uint64_t now, uint16_t word, const struct laser_eb90_result *result)
{
    enum laser_words_error code = laser_words_error(&host->config.words, word);
    if (host->batch.count == 0) {
        report(host, LASER_HOST_UNASKED)->word = word;
    } else if (word == host->batch.word) {
        take_echo(host, now, result);
    } else if (code == LASER_WORDS_NO_ERROR) {
        uint16_t expected = host->batch.word;
        uint64_t quiet_until = host->state == LASER_HOST_AWAITING ? settled_if_taken(host, now)
                                                                  : later(host->until, after(now, host->config.settle));
        struct laser_host_event *event = finish(host, LASER_HOST_UNKNOWN, "other_word", quiet_until);
        event->expected = expected;
        event->word = word;
    } else if (host->state == LASER_HOST_AWAITING) {
        take_code(host, now, code);
    }
}

/* LE-115: the frame in flight, which the line has returned. */
static bool is_own(struct laser_host *host, const struct laser_eb90_result *result)
{
    uint8_t frame[LASER_EB90_MAX_LEN];
    const struct laser_eb90_payload *sent = &host->batch.payload;
    if (host->batch.count == 0 || sent->length <= WORD_LEN || result->kind != LASER_EB90_FRAME ||
        result->payload_len != sent->length || memcmp(result->payload, sent->bytes, sent->length) != 0)
        return false;
    if (!host->echo.returns) {
        struct laser_host_event *event = report(host, LASER_HOST_LINE_ECHO);
        event->echo.kind = LINE_ECHO_NOT_SET;
        event->echo.length = laser_eb90_encode(sent, frame, sizeof frame);
    }
    size_t unread = host->echo.unread;
    line_echo_init(&host->echo, true);
    host->echo.unread = unread;
    return true;
}

static void read_items(struct laser_host *host, uint64_t now)
{
    struct laser_eb90_result result;
    uint16_t word = 0;
    while (laser_eb90_next(&host->decoder, &result)) {
        size_t at = 0;
        if (is_own(host, &result))
            continue;
        bool is_answer = result.kind == LASER_EB90_FRAME &&
                         first_word(&host->config.profile, result.payload, result.payload_len, &at, &word);
        if (is_answer) {
            take_answer(host, now, word, &result);
            continue;
        }
        struct laser_host_event *event = report(host, LASER_HOST_CORRUPT); /* LE-57 */
        event->error.kind = result.kind;
        event->error.error_offset = result.error_offset;
        event->error.expected = result.expected;
        event->error.found = result.found;
        host->is_corrupt = true;
    }
}

/* LE-113, LE-114: how many of the first bytes are not to be read. */
static size_t remove_echo(struct laser_host *host, const uint8_t *data, size_t *size)
{
    struct line_echo_error error;
    size_t own = line_echo_begin(&host->echo, host->sent, data, size, &error);
    if (error.kind == LINE_ECHO_NOT_SET)
        laser_eb90_init(&host->decoder, host->config.profile);
    if (error.kind != LINE_ECHO_NONE)
        report(host, LASER_HOST_LINE_ECHO)->echo = error;
    return own;
}

size_t laser_host_input(struct laser_host *host, uint64_t now, const uint8_t *data, size_t size)
{
    size_t taken = remove_echo(host, data, &size);
    if (taken == size)
        return size;
    if (host->state == LASER_HOST_DISCONNECTED || host->state == LASER_HOST_DISCONNECTED_HELD) {
        report(host, LASER_HOST_UNEXPECTED);
        return size;
    }
    taken += laser_eb90_push(&host->decoder, data + taken, size - taken);
    read_items(host, now);
    return line_echo_taken(&host->echo, size, taken);
}

/* LE-58, LE-61 */
void laser_host_timeout(struct laser_host *host, uint64_t now)
{
    bool is_due = now >= host->until;
    if (is_due && host->state == LASER_HOST_AWAITING_REST) {
        finish(host, LASER_HOST_UNKNOWN, "partial_frame", host->until);
    } else if (is_due && host->state == LASER_HOST_AWAITING) {
        laser_eb90_end(&host->decoder);
        read_items(host, now);
        if (host->config.resend_on_silence && host->batch.resends < host->config.resends) {
            host->batch.resends++;
            host->batch.unanswered++;
            resend(host, settled_if_taken(host, now));
        } else {
            finish(host, LASER_HOST_UNKNOWN, host->is_corrupt ? "corrupt" : "silence", settled_if_taken(host, now));
        }
    }
}

/* LE-49 */
void laser_host_transmitted(struct laser_host *host, uint64_t now)
{
    if (host->state != LASER_HOST_AWAITING)
        return;
    host->received_by = now;
    host->final_from = after(now, host->config.reply_time);
    host->executed_by = after(now, execution(host));
    host->until = after(now, answer_time(host));
}

/* LE-62 */
void laser_host_resume(struct laser_host *host)
{
    if (host->state == LASER_HOST_HELD)
        host->state = LASER_HOST_IDLE;
    else if (host->state == LASER_HOST_DISCONNECTED_HELD)
        host->state = LASER_HOST_DISCONNECTED;
    else
        report(host, LASER_HOST_UNEXPECTED);
}

void laser_host_take_back(struct laser_host *host) { host->next.count = 0; }

/* Whether the parameters of a word keep LE-23 and LE-24. */
static bool keeps_words(const struct laser_host *host, enum laser_words_class class,
                        const struct laser_eb90_payload *parameters)
{
    struct laser_eb90_item item;
    size_t at = 0;
    while (laser_eb90_item(&host->config.profile, parameters->bytes, parameters->length, &at, &item)) {
        uint16_t word;
        if (!is_word(&host->config.profile, &item, &word))
            continue;
        if (class == LASER_WORDS_INTERPRETED || class_of(host, word) != LASER_WORDS_NO_CLASS)
            return false;
    }
    return true;
}

bool laser_host_submit(struct laser_host *host, uint16_t word, const struct laser_eb90_payload *parameters)
{
    enum laser_words_class class = class_of(host, word);
    struct laser_host_batch *next = &host->next;
    bool is_alone = next->count == 0;
    struct laser_eb90_payload payload = {.profile = &host->config.profile};
    if (class == LASER_WORDS_NO_CLASS || parameters->is_refused || !keeps_words(host, class, parameters))
        return false;
    if (!is_alone && (class != LASER_WORDS_INTERPRETED || class_of(host, next->word) != LASER_WORDS_INTERPRETED || next->count >= host->config.batch))
        return false;
    if (!is_alone)
        payload = next->payload;
    put_word(&payload, word);
    for (size_t i = 0; i < parameters->length; i++)
        laser_eb90_put_byte(&payload, parameters->bytes[i]);
    if (payload.is_refused)
        return false;
    if (is_alone)
        *next = (struct laser_host_batch){.first = host->submitted, .word = word};
    next->payload = payload;
    next->count++;
    host->submitted++;
    return true;
}

bool laser_host_event(struct laser_host *host, struct laser_host_event *event)
{
    return TAKE_EVENT(host, event);
}

/* Whether an outcome waits to be taken: a notice holds nothing up. */
static bool has_outcome(const struct laser_host *host)
{
    for (size_t i = 0; i < host->event_count; i++)
        if (host->events[i].kind <= LASER_HOST_UNKNOWN)
            return true;
    return false;
}

/* LE-44 to LE-48, LE-111 */
size_t laser_host_transmit(struct laser_host *host, uint64_t now, uint8_t *out, size_t size)
{
    laser_host_timeout(host, now);
    bool is_next = host->state == LASER_HOST_IDLE && host->next.count > 0 && now >= host->quiet_until;
    bool is_again = host->state == LASER_HOST_RESENDING && now >= host->until;
    if (has_outcome(host) || size < LASER_EB90_MAX_LEN || !(is_next || is_again))
        return 0;
    if (is_next) {
        host->batch = host->next;
        host->next.count = 0;
    }
    size_t length = laser_eb90_encode(&host->batch.payload, out, size);
    uint64_t left = after(now, line_time(length, host->config.baud));
    host->received_by = after(left, host->config.max_pause);
    host->final_from = after(host->received_by, host->config.reply_time);
    host->executed_by = after(host->received_by, execution(host));
    host->until = after(left, answer_time(host));
    host->is_corrupt = false;
    host->state = LASER_HOST_AWAITING;
    laser_eb90_init(&host->decoder, host->config.profile);
    line_echo_sent(&host->echo, host->sent, out, length, host->batch.payload.length > WORD_LEN); /* LE-114 */
    return length;
}

/* LE-65 */
bool laser_host_deadline(const struct laser_host *host, uint64_t *deadline)
{
    bool is_idle = host->state == LASER_HOST_IDLE;
    *deadline = is_idle ? host->quiet_until : host->until;
    return is_idle ? host->next.count > 0
                   : host->state == LASER_HOST_AWAITING || host->state == LASER_HOST_RESENDING ||
                         host->state == LASER_HOST_AWAITING_REST;
}
