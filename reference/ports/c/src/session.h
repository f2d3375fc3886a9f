/* What the sessions share: time in nanoseconds, counted from any instant; sums saturate. */
#ifndef CELLWIRE_SESSION_H
#define CELLWIRE_SESSION_H

#include <stdint.h>

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

#endif
