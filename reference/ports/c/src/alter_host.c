#include "cellwire/alter_host.h"

#include <string.h>

#include "alter_events.h"
#include "alter_host_times.h"

const struct alter_host_config ALTER_HOST_DEFAULT = {
    .framing = {.leading_dle = 2},
    .baud = 38400,
    .mode = 23,
    .limits = {{90, 90, 90, 150, 150, 150}, {9, 9, 9, 15, 15, 15}},
    .repeats = 2,
    .silence_cycles = 4,
    .has_gap = true,
    .gap = 4 * MS,
    .target_timeout = 200 * MS,
    .reserve = 1 * MS,
    .max_delay = 10 * MS,
};

static bool takes_targets(const struct alter_host *host)
{
    return host->phase == ALTER_HOST_ACCEPTED || is_replying(host);
}

static bool has_target(const struct alter_host *host) { return takes_targets(host) && host->is_fresh; }

static struct alter_host_event *add_event(struct alter_host *host, enum alter_host_kind kind, bool is_outcome)
{
    struct alter_host_event *event = ADD_ALTER_EVENT(host, is_outcome);
    event->kind = kind;
    return event;
}

/* A notice. */
static struct alter_host_event *report(struct alter_host *host, enum alter_host_kind kind)
{
    return add_event(host, kind, false);
}

static struct alter_host_event *report_outcome(struct alter_host *host, enum alter_host_kind kind)
{
    return add_event(host, kind, true);
}

/* Section 7.6: the outcome of an exception, if there is one. */
static void settle_exception(struct alter_host *host, const char *outcome, const char *reason)
{
    if (host->exception == ALTER_HOST_NO_EXCEPTION)
        return;
    struct alter_host_event *event = report_outcome(host, ALTER_HOST_EXCEPTION);
    event->code = host->exception_code;
    event->text = outcome;
    event->reason = reason;
    host->exception = ALTER_HOST_NO_EXCEPTION;
}

/* ALTER has ended, or the connection. */
static void end_exception(struct alter_host *host)
{
    if (host->exception == ALTER_HOST_UNSENT)
        settle_exception(host, "not_done", NULL);
    else
        settle_exception(host, "unknown", "ended");
}

/* AL-95 */
static void keep_late(struct alter_host *host, uint64_t now, const struct val2_alter_message *message)
{
    host->kept |= host->sent;
    if (message->kind == VAL2_ALTER_INTERRUPTED || host->phase == ALTER_HOST_INTERRUPTED) {
        host->sent = host->kept;
    } else if (message->code == 0 && now >= host->settles_at) {
        host->kept = host->sent;
        host->sent = 0;
        host->settles_at = settles_from(host, now);
    }
}

/* A standard message has come. */
static void judge_exception(struct alter_host *host, uint64_t now, const struct val2_alter_message *message)
{
    bool is_unread = host->exception == ALTER_HOST_UNREAD;
    bool follows = now < (is_unread ? host->unread_until : host->follows_until);
    if (host->exception == ALTER_HOST_NO_EXCEPTION || host->exception == ALTER_HOST_UNSENT)
        return;
    if (!is_in_time(host)) {
        settle_exception(host, "unknown", "out_of_sequence");
    } else if (host->exception == ALTER_HOST_SENT && message->code == 0) {
        settle_exception(host, "done", NULL);
    } else if (message->kind == VAL2_ALTER_INTERRUPTED) {
        settle_exception(host, "unknown", "unclear");
    } else if (host->exception == ALTER_HOST_SENT) {
        host->exception = ALTER_HOST_UNREAD;
        host->unread_until = follows ? follows_from(host, now) : 0;
    } else if (!follows) {
        settle_exception(host, "unknown", "out_of_sequence");
    } else if (host->phase == ALTER_HOST_STOPPING) {
        settle_exception(host, "not_done", NULL);
    } else {
        host->exception = ALTER_HOST_UNSENT;
    }
}

/* An ALTER is lost, unless there is none. */
static void leave(struct alter_host *host, const char *reason, enum alter_host_phase phase)
{
    end_exception(host);
    if (host->phase >= ALTER_HOST_ACCEPTED)
        report_outcome(host, ALTER_HOST_LOST)->text = reason;
    host->phase = phase;
    host->is_due = false;
}

/* An answer was not sent in time. */
static void miss(struct alter_host *host)
{
    if (!host->is_due)
        return;
    report(host, ALTER_HOST_MISSED);
    host->is_due = false;
    alter_limiter_missed(&host->limiter);
}

/* An answer is due; its shortest form has `shortest` bytes (AL-60 to AL-62). */
static void set_due(struct alter_host *host, uint64_t now, uint64_t end_by, uint64_t shortest)
{
    uint64_t time = span(host, shortest);
    host->is_due = true;
    host->arrival = now;
    host->end_by = end_by;
    host->begin_by = later(end_by > time ? end_by - time : 0, now + 1);
}

static void set_start_due(struct alter_host *host, uint64_t now)
{
    set_due(host, now, after(now, window(host)), host->config.framing.leading_dle + 5u);
}

bool alter_host_init(struct alter_host *host, const struct alter_host_config *config)
{
    memset(host, 0, sizeof *host);
    host->config = *config;
    host->policy = config->policy;
    host->subroutine = config->subroutine;
    val2_alter_init(&host->decoder, VAL2_ALTER_CONTROLLER, config->framing);
    /* AL-42 */
    uint64_t marks = config->framing.leading_dle + 4u, message = span(host, marks + (config->mode & 4 ? 30 : 6));
    uint64_t left = sooner(window(host), message < CYCLE ? CYCLE - message : 0);
    return config->mode < 32 && config->silence_cycles >= 2 && after(span(host, marks + 4), config->reserve) <= left;
}

void alter_host_connected(struct alter_host *host, uint64_t now)
{
    (void)now;
    leave(host, "disconnected", ALTER_HOST_IDLE);
    val2_alter_clear(&host->decoder); /* AL-92 */
    host->has_gap = false;
}

void alter_host_disconnected(struct alter_host *host, uint64_t now)
{
    (void)now;
    leave(host, "disconnected", ALTER_HOST_DISCONNECTED);
    host->has_gap = false;
}

/* AL-68, AL-95: a message may have been among the bytes. */
static void lose_sequence(struct alter_host *host)
{
    host->follows_until = host->unread_until = 0;
    if (!is_in_time(host))
        host->sent |= host->kept;
}

/* AL-47, AL-68 */
static void take_corrupt_frame(struct alter_host *host, uint64_t now)
{
    bool may_ask = host->phase == ALTER_HOST_IDLE || (host->phase == ALTER_HOST_REPEATING && !host->is_due);
    lose_sequence(host);
    if (!may_ask || host->policy != ALTER_HOST_ACCEPT)
        return;
    host->asked = host->phase == ALTER_HOST_REPEATING ? host->asked + 1 : 1;
    host->phase = ALTER_HOST_REPEATING;
    set_start_due(host, now);
    host->forget_at = silence(host, now);
}

/* Sections 7.4 and 7.5 */
static void take_motion(struct alter_host *host, uint64_t now, const struct val2_alter_message *message, size_t length)
{
    if (host->phase < ALTER_HOST_ACCEPTED)
        return;
    bool is_early = after(silence(host, now), host->config.max_delay) < after(host->lost_at, CYCLE);
    host->lost_at = silence(host, now);
    if (host->phase == ALTER_HOST_SILENT)
        return;
    miss(host);
    if (is_early && is_replying(host))
        report(host, ALTER_HOST_DELAYED); /* AL-93 */
    if (message->code > 0) {
        report(host, ALTER_HOST_REJECTED)->code = message->code;
        if (is_in_time(host) && now < host->follows_until) /* AL-94 */
            alter_limiter_rejected(&host->limiter);
        else
            alter_limiter_missed(&host->limiter);
    }
    if (is_in_time(host)) {
        host->kept = message->code > 0 ? host->kept | host->sent : host->sent; /* AL-64 */
        host->sent = host->kept;
    } else {
        keep_late(host, now, message);
    }
    judge_exception(host, now, message);
    if (host->phase != ALTER_HOST_STOPPING) {
        host->phase = message->kind == VAL2_ALTER_RUNNING ? ALTER_HOST_RUNNING : ALTER_HOST_INTERRUPTED;
    } else if (message->code == 0 && host->zeros_sent && host->kept == 0) {
        report_outcome(host, ALTER_HOST_STOPPED);
        host->phase = ALTER_HOST_SILENT;
        return;
    }
    host->zeros_sent = false;
    uint64_t time = span(host, length), left = time < CYCLE ? CYCLE - time : 0;
    uint64_t shortest = host->config.framing.leading_dle + 6u;
    for (int axis = 0; axis < VAL2_ALTER_AXES; axis++)
        shortest += host->kept >> axis & 1 ? 2 : 0;
    set_due(host, now, after(now, sooner(window(host), left)), shortest);
    host->is_interrupted = message->kind == VAL2_ALTER_INTERRUPTED;
}

static void take_message(struct alter_host *host, uint64_t now, const struct val2_alter_item *item)
{
    const struct val2_alter_message *message = &item->message;
    bool is_outcome = message->kind == VAL2_ALTER_END && host->phase >= ALTER_HOST_ACCEPTED;
    if (message->kind == VAL2_ALTER_START) {
        miss(host);
        if (host->phase == ALTER_HOST_ACCEPTED)
            host->phase = ALTER_HOST_IDLE; /* nothing is lost */
        leave(host, "restart", ALTER_HOST_STARTING);
        host->names_mode = message->mode == host->config.mode;
        set_start_due(host, now);
    } else if (message->kind == VAL2_ALTER_END) {
        end_exception(host);
        host->phase = ALTER_HOST_IDLE;
        host->is_due = false;
    } else {
        take_motion(host, now, message, item->length);
    }
    add_event(host, ALTER_HOST_MESSAGE, is_outcome)->message = *message;
}

static void read_items(struct alter_host *host, uint64_t now)
{
    struct val2_alter_item item;
    for (;;) {
        bool is_there = val2_alter_next(&host->decoder, &item);
        if (host->decoder.failures != host->failures) { /* AL-38 */
            host->failures = host->decoder.failures;
            take_corrupt_frame(host, now);
        }
        if (!is_there)
            return;
        if (item.is_error) {
            if (item.error.kind == VAL2_ALTER_START_MARK)
                lose_sequence(host);
            report(host, ALTER_HOST_CORRUPT)->error = item.error;
        } else {
            take_message(host, now, &item);
        }
    }
}

size_t alter_host_input(struct alter_host *host, uint64_t now, const uint8_t *data, size_t size)
{
    if (host->phase == ALTER_HOST_DISCONNECTED) {
        report(host, ALTER_HOST_UNEXPECTED);
        return size;
    }
    alter_host_timeout(host, now); /* AL-91 */
    size_t taken = val2_alter_push(&host->decoder, data, size);
    read_items(host, now);
    host->has_gap = host->config.has_gap && val2_alter_pending(&host->decoder) > 0; /* AL-52 */
    host->gap_at = after(now, host->config.gap);
    return taken;
}

void alter_host_timeout(struct alter_host *host, uint64_t now)
{
    if (host->has_gap && now >= host->gap_at) {
        host->has_gap = false;
        val2_alter_end(&host->decoder);
        read_items(host, now);
    }
    if (host->is_due && now >= host->begin_by) {
        miss(host);
        if (host->phase == ALTER_HOST_STARTING)
            host->phase = ALTER_HOST_IDLE;
    }
    if (has_target(host) && now >= host->fresh_until) {
        host->is_fresh = false;
        report(host, ALTER_HOST_STALE);
    }
    if (host->phase == ALTER_HOST_REPEATING && now >= host->forget_at)
        host->phase = ALTER_HOST_IDLE;
    if (host->phase >= ALTER_HOST_ACCEPTED && now >= host->lost_at)
        leave(host, "silence", ALTER_HOST_IDLE);
}

void alter_host_set_target(struct alter_host *host, uint64_t now, const int16_t target[VAL2_ALTER_AXES])
{
    memcpy(host->target, target, sizeof host->target);
    host->is_fresh = true;
    host->fresh_until = after(now, host->config.target_timeout);
}

void alter_host_clear_target(struct alter_host *host) { host->is_fresh = false; }

bool alter_host_exception(struct alter_host *host, uint8_t code)
{
    if (!host->subroutine || host->phase != ALTER_HOST_RUNNING || host->exception != ALTER_HOST_NO_EXCEPTION)
        return false;
    if (!HAS_ROOM(host, ALTER_HOST_OUTCOMES + 1))
        return false;
    host->exception = ALTER_HOST_UNSENT;
    host->exception_code = code;
    return true;
}

void alter_host_stop(struct alter_host *host)
{
    host->policy = ALTER_HOST_IGNORE;
    if (host->exception == ALTER_HOST_UNSENT)
        settle_exception(host, "not_done", NULL);
    if (host->phase == ALTER_HOST_REPEATING || host->phase == ALTER_HOST_STARTING) {
        host->phase = ALTER_HOST_IDLE;
        host->is_due = false;
    } else if (host->phase == ALTER_HOST_ACCEPTED) {
        host->phase = ALTER_HOST_SILENT;
        report_outcome(host, ALTER_HOST_STOPPED);
    } else if (host->phase == ALTER_HOST_RUNNING || host->phase == ALTER_HOST_INTERRUPTED) {
        host->phase = ALTER_HOST_STOPPING;
        host->zeros_sent = false;
    }
}

bool alter_host_event(struct alter_host *host, struct alter_host_event *event)
{
    return TAKE_EVENT(host, event);
}

bool alter_host_deadline(const struct alter_host *host, uint64_t *deadline)
{
    *deadline = NEVER;
    bool is_altering = host->phase >= ALTER_HOST_ACCEPTED, is_repeating = host->phase == ALTER_HOST_REPEATING;
    if (host->has_gap)
        *deadline = sooner(*deadline, host->gap_at);
    if (host->is_due)
        *deadline = sooner(*deadline, host->begin_by);
    if (is_repeating)
        *deadline = sooner(*deadline, host->forget_at);
    if (is_altering)
        *deadline = sooner(*deadline, host->lost_at);
    if (has_target(host))
        *deadline = sooner(*deadline, host->fresh_until);
    return host->has_gap || host->is_due || is_repeating || is_altering;
}
