/* The times of val2-alter's host, by which it reads and replies (section 7.5). */
#ifndef CELLWIRE_ALTER_HOST_TIMES_H
#define CELLWIRE_ALTER_HOST_TIMES_H

#include "cellwire/alter_host.h"
#include "session.h"

#define CYCLE (28 * MS)
/* The outcomes of an ALTER: its end, and that of a stop. */
#define ALTER_HOST_OUTCOMES 2

static inline bool is_cumulative(const struct alter_host *host) { return host->config.mode & 1; }

/* W (section 7.5) */
static inline uint64_t window(const struct alter_host *host) { return (is_cumulative(host) ? 15 : 17) * MS; }

static inline uint64_t span(const struct alter_host *host, uint64_t length)
{
    return line_time(length, host->config.baud);
}

static inline uint64_t silence(const struct alter_host *host, uint64_t now)
{
    return after(now, CYCLE * host->config.silence_cycles);
}

static inline bool is_replying(const struct alter_host *host)
{
    return host->phase >= ALTER_HOST_RUNNING && host->phase <= ALTER_HOST_STOPPING;
}

/* AL-68 */
static inline uint64_t follows_from(const struct alter_host *host, uint64_t arrival)
{
    uint64_t end = after(arrival, 2 * CYCLE);
    return end > host->config.max_delay ? end - host->config.max_delay : 0;
}

/* No reply comes in the window of another message. */
static inline bool is_in_time(const struct alter_host *host) { return host->config.max_delay < CYCLE - window(host); }

/* AL-95 */
static inline uint64_t settles_from(const struct alter_host *host, uint64_t now)
{
    uint64_t late = sooner(host->config.max_delay, CYCLE * host->config.silence_cycles);
    return after(now, 2 * (late + CYCLE));
}

#endif
