#include "kawasaki.h"

bool kawasaki_end_init(struct kawasaki_end *end, const struct kawasaki_dialect *dialect, const struct kawasaki_limits *limits,
                       uint16_t largest, bool datagrams)
{
    end->dialect = *dialect;
    end->largest = largest;
    end->packet = limits->packet;
    return kawasaki_check(dialect, limits, largest, datagrams);
}

void kawasaki_end_clear(struct kawasaki_end *end)
{
    uint64_t position = end->decoder.position + end->decoder.dropped + end->decoder.length;
    kawasaki_msg_init(&end->decoder, end->dialect.is_latin1);
    end->decoder.position = position;
}

enum reading kawasaki_end_read(struct kawasaki_end *end, struct found *found, struct kawasaki_fault *fault)
{
    if (!kawasaki_msg_next(&end->decoder, &end->item))
        return NOTHING;
    if (end->item.error.kind == KAWASAKI_MSG_MESSAGE)
        return kawasaki_read(&end->dialect, &end->item, found, fault) ? MESSAGE : MEANINGLESS;
    struct kawasaki_event *event = kawasaki_report(end, KAWASAKI_CORRUPT);
    event->error = end->item.error;
    event->length = end->item.length;
    return CORRUPT;
}

bool kawasaki_end_is_half(const struct kawasaki_end *end)
{
    return end->decoder.length > 0;
}

static bool is_outcome(const struct kawasaki_event *event)
{
    return event->kind <= KAWASAKI_COMMANDED || event->kind == KAWASAKI_JOB_UNFIT ||
           (event->kind == KAWASAKI_ORDER_REFUSED && event->given_up);
}

bool kawasaki_has_room(const struct kawasaki_end *end, size_t outcomes)
{
    size_t held = 0;
    for (size_t i = 0; i < end->event_count; i++)
        held += is_outcome(&end->events[i]);
    return held + outcomes <= KAWASAKI_EVENTS;
}

static void remove_event(struct kawasaki_end *end, size_t at)
{
    memmove(end->events + at, end->events + at + 1, (--end->event_count - at) * sizeof *end->events);
}

/* The oldest notice; the last event, if there is none. */
static void drop_notice(struct kawasaki_end *end)
{
    size_t at = 0;
    while (at + 1 < end->event_count && (is_outcome(&end->events[at]) || end->events[at].kind == KAWASAKI_PROGRESS))
        at++;
    remove_event(end, at);
}

/* What comes behind all other events. */
static int rank(enum kawasaki_event_kind kind) { return kind == KAWASAKI_PROGRESS ? 2 : kind <= KAWASAKI_DISCONNECT ? 1 : 0; }

struct kawasaki_event *kawasaki_report(struct kawasaki_end *end, enum kawasaki_event_kind kind)
{
    if (end->event_count == KAWASAKI_EVENTS)
        drop_notice(end);
    size_t at = end->event_count++;
    for (; at > 0 && rank(end->events[at - 1].kind) > rank(kind); at--)
        end->events[at] = end->events[at - 1];
    memset(&end->events[at], 0, sizeof *end->events);
    end->events[at].kind = kind;
    return &end->events[at];
}

void kawasaki_reject(struct kawasaki_end *end, const struct kawasaki_fault *fault)
{
    kawasaki_report(end, KAWASAKI_REJECTED)->fault = *fault;
}

void kawasaki_drop_progress(struct kawasaki_end *end)
{
    for (size_t i = end->event_count; i > 0; i--)
        if (end->events[i - 1].kind == KAWASAKI_PROGRESS)
            remove_event(end, i - 1);
}
