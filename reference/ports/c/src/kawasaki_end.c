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
    end->closes = false;
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

bool kawasaki_has_room(const struct kawasaki_end *end, size_t outcomes)
{
    size_t held = 0;
    for (size_t i = 0; i < end->event_count; i++)
        held += end->events[i].is_outcome;
    return held + outcomes <= KAWASAKI_EVENTS;
}

/* The oldest notice leaves its place, if there is one. */
static void drop_notice(struct kawasaki_end *end)
{
    size_t at = 0;
    while (at < KAWASAKI_EVENTS && end->events[at].is_outcome)
        at++;
    if (at < KAWASAKI_EVENTS)
        memmove(end->events + at, end->events + at + 1, (--end->event_count - at) * sizeof *end->events);
}

static struct kawasaki_event *add(struct kawasaki_end *end, enum kawasaki_event_kind kind, bool is_outcome)
{
    if (end->event_count == KAWASAKI_EVENTS)
        drop_notice(end);
    struct kawasaki_event *event = &end->events[end->event_count];
    end->event_count += end->event_count < KAWASAKI_EVENTS;
    *event = (struct kawasaki_event){.kind = kind, .is_outcome = is_outcome};
    return event;
}

struct kawasaki_event *kawasaki_report(struct kawasaki_end *end, enum kawasaki_event_kind kind) { return add(end, kind, false); }

struct kawasaki_event *kawasaki_report_outcome(struct kawasaki_end *end, enum kawasaki_event_kind kind)
{
    return add(end, kind, true);
}

void kawasaki_reject(struct kawasaki_end *end, const struct kawasaki_fault *fault)
{
    kawasaki_report(end, KAWASAKI_REJECTED)->fault = *fault;
}

bool kawasaki_end_event(struct kawasaki_end *end, struct kawasaki_event *event)
{
    return TAKE_EVENT(end, event) || kawasaki_take_flag(&end->closes, KAWASAKI_DISCONNECT, event);
}

bool kawasaki_take_flag(bool *is_set, enum kawasaki_event_kind kind, struct kawasaki_event *event)
{
    bool was_set = *is_set;
    *is_set = false;
    *event = (struct kawasaki_event){.kind = kind};
    return was_set;
}
