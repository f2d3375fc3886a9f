/* What the host of val2-alter sends: its answers to a start (AL-44 to AL-48), and its replies (AL-63 to AL-65). */
#include <string.h>

#include "alter_events.h"
#include "alter_host_times.h"

#define ALL_AXES 0x3F

/* ALTER begins at rest (AL-51). */
static void restart(struct alter_host *host)
{
    memset(&host->limiter, 0, sizeof host->limiter);
    host->is_fresh = false;
    host->kept = host->sent = 0;
}

/* AL-44 to AL-48 */
static size_t transmit_start_reply(struct alter_host *host, uint64_t now, uint8_t *out, size_t size)
{
    bool accepts = host->policy == ALTER_HOST_ACCEPT;
    struct val2_alter_message message = {.kind = VAL2_ALTER_START_REPLY, .answer = 0xFF};
    if (host->phase == ALTER_HOST_REPEATING && accepts && host->asked <= host->config.repeats)
        message.answer = 0x01;
    if (host->phase == ALTER_HOST_STARTING && accepts && host->names_mode)
        message.answer = 0x00;
    bool has_room = message.answer != 0x00 || HAS_ROOM(host, ALTER_HOST_OUTCOMES);
    size_t length = 0;
    if (host->policy != ALTER_HOST_IGNORE && has_room) {
        length = val2_alter_encode(&message, host->config.framing, out, size);
        if (after(now, span(host, length)) > host->end_by) {
            host->begin_by = now; /* AL-46 */
            return 0;
        }
    }
    host->is_due = false;
    if (message.answer == 0x01)
        return length;
    host->phase = ALTER_HOST_IDLE;
    if (length > 0 && message.answer == 0x00) {
        host->phase = ALTER_HOST_ACCEPTED;
        host->lost_at = silence(host, now);
        restart(host);
        host->settles_at = settles_from(host, now);
    }
    return length;
}

/* AL-86 */
static void next_values(const struct alter_host *host, uint64_t now, struct alter_limiter *limiter, int16_t *values)
{
    static const int16_t ZERO[VAL2_ALTER_AXES];
    const struct alter_limits *limits = &host->config.limits;
    bool is_fresh = host->phase == ALTER_HOST_RUNNING && host->is_fresh && now < host->fresh_until;
    if (host->phase == ALTER_HOST_INTERRUPTED) {
        alter_limiter_missed(limiter);
        for (int axis = 0; axis < VAL2_ALTER_AXES; axis++)
            values[axis] = (int16_t)limiter->position[axis]; /* cumulative: 0 */
    } else if (is_cumulative(host)) {
        alter_limiter_speeds(limiter, limits, is_fresh ? host->target : ZERO, values);
    } else {
        bool goes_back = host->phase == ALTER_HOST_STOPPING;
        alter_limiter_positions(limiter, limits, goes_back ? ZERO : is_fresh ? host->target : NULL, values);
    }
}

/* The length of the reply with these axes, if it ends `reserve` before the window does; else 0. */
static size_t encode_reply(const struct alter_host *host, uint64_t now, struct val2_alter_message *reply,
                           uint8_t select, uint64_t reserve, uint8_t *out, size_t size)
{
    reply->select = select;
    size_t length = val2_alter_encode(reply, host->config.framing, out, size);
    return after(after(now, span(host, length)), reserve) <= host->end_by ? length : 0;
}

/* AL-63 to AL-65 */
static size_t transmit_reply(struct alter_host *host, uint64_t now, uint8_t *out, size_t size)
{
    struct alter_limiter limiter = host->limiter;
    struct val2_alter_message reply = {.kind = VAL2_ALTER_REPLY};
    uint64_t reserve = host->config.reserve;
    bool has_exception = host->exception == ALTER_HOST_UNSENT && host->phase == ALTER_HOST_RUNNING;
    uint8_t select = ALL_AXES, moved = 0;
    next_values(host, now, &limiter, reply.values);
    reply.exception = has_exception ? host->exception_code : 0;
    size_t length = encode_reply(host, now, &reply, select, reserve, out, size);
    if (length == 0) {
        select = host->kept;
        if (encode_reply(host, now, &reply, select, 0, out, size) == 0) {
            host->begin_by = now;
            return 0;
        }
        for (int axis = 0; axis < VAL2_ALTER_AXES; axis++) {
            uint8_t with = (uint8_t)(select | 1 << axis);
            if (reply.values[axis] == 0 || with == select)
                continue;
            if (encode_reply(host, now, &reply, with, reserve, out, size) > 0)
                select = with;
            else
                alter_limiter_hold(&limiter, axis);
        }
        length = encode_reply(host, now, &reply, select, 0, out, size);
    }
    host->limiter = limiter;
    for (int axis = 0; axis < VAL2_ALTER_AXES; axis++)
        if (reply.values[axis] != 0)
            moved = (uint8_t)(moved | (select & 1 << axis));
    bool is_uncertain = host->is_interrupted || host->exception == ALTER_HOST_UNREAD;
    if (is_uncertain)
        host->kept |= moved;
    uint8_t sent = is_uncertain ? host->kept : moved;
    host->sent = is_in_time(host) ? sent : host->sent | sent;
    host->follows_until = follows_from(host, host->arrival);
    if (has_exception)
        host->exception = ALTER_HOST_SENT;
    host->is_due = false;
    host->zeros_sent = moved == 0 && alter_limiter_is_at_rest(&limiter);
    return length;
}

size_t alter_host_transmit(struct alter_host *host, uint64_t now, uint8_t *out, size_t size)
{
    if (!host->is_due || size < VAL2_ALTER_MAX_LEN)
        return 0;
    return is_replying(host) ? transmit_reply(host, now, out, size) : transmit_start_reply(host, now, out, size);
}
