/* What the sessions share: time in nanoseconds, counted from any instant, whose sums saturate; and a queue of events. */
#ifndef CELLWIRE_SESSION_H
#define CELLWIRE_SESSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define NEVER UINT64_MAX
#define MS UINT64_C(1000000)
#define SECOND (1000 * MS)

static inline uint64_t after(uint64_t now, uint64_t span) { return span > NEVER - now ? NEVER : now + span; }

static inline uint64_t later(uint64_t a, uint64_t b) { return a > b ? a : b; }

static inline uint64_t sooner(uint64_t a, uint64_t b) { return a < b ? a : b; }

/* The time of `length` bytes on a line, ten bits each, rounded down. */
static inline uint64_t line_time(uint64_t length, uint32_t baud)
{
    return baud == 0 ? NEVER : length * 10 * SECOND / baud;
}

/* A new event, all zero, in an array of `capacity`; where it is full, in the place of the last one. */
static inline void *queue_add(void *events, size_t size, size_t capacity, size_t *count)
{
    if (*count == capacity)
        (*count)--;
    void *event = (char *)events + size * (*count)++;
    memset(event, 0, size);
    return event;
}

/* The same of a session that has `events` and `event_count`. */
#define ADD_EVENT(session)                                                                                             \
    queue_add((session)->events, sizeof *(session)->events, sizeof(session)->events / sizeof *(session)->events,       \
              &(session)->event_count)

/* Takes the oldest event; false: there is none. */
static inline bool queue_take(void *events, size_t size, size_t *count, void *event)
{
    if (*count == 0)
        return false;
    memcpy(event, events, size);
    memmove(events, (char *)events + size, --*count * size);
    return true;
}

#define TAKE_EVENT(session, event)                                                                                     \
    queue_take((session)->events, sizeof *(session)->events, &(session)->event_count, (event))

#endif
