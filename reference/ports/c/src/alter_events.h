/* The reports of both ends of val2-alter, in a queue (AL-96). */
#ifndef CELLWIRE_ALTER_EVENTS_H
#define CELLWIRE_ALTER_EVENTS_H

#include "cellwire/val2_alter.h"
#include "session.h"

/* Every event begins with `is_outcome`. */
static inline bool is_outcome(const void *event) { return *(const bool *)event; }

/* A new report, all zero but for `is_outcome`. A notice that has no place is in none: the array has one more than the queue. */
static inline void *alter_event_add(void *events, size_t size, size_t *count, bool outcome)
{
    char *first = events, *oldest = first, *end = first + size * *count;
    if (*count == VAL2_ALTER_EVENTS) {
        while (oldest < end && is_outcome(oldest))
            oldest += size;
        if (oldest < end) {
            memmove(oldest, oldest + size, (size_t)(end - oldest) - size);
            end -= size;
        }
    } else {
        (*count)++;
    }
    memset(end, 0, size);
    *(bool *)end = outcome;
    return end;
}

#define ADD_ALTER_EVENT(session, outcome)                                                                              \
    alter_event_add((session)->events, sizeof *(session)->events, &(session)->event_count, outcome)

/* Whether so many more outcomes fit. */
#define HAS_ROOM(session, more)                                                                                        \
    alter_events_have_room((session)->events, sizeof *(session)->events, (session)->event_count, more)

static inline bool alter_events_have_room(const void *events, size_t size, size_t count, size_t more)
{
    for (size_t i = 0; i < count; i++)
        more += is_outcome((const char *)events + i * size);
    return more <= VAL2_ALTER_EVENTS;
}

#endif
