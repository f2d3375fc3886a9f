/* The limiter of val2-alter's host: section 7.5 of reference/val2-alter.md. */
#ifndef CELLWIRE_ALTER_LIMITER_H
#define CELLWIRE_ALTER_LIMITER_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ALTER_AXES 6

/* In units of a word and a cycle, 0..=32767. */
struct alter_limits {
    int16_t velocity[ALTER_AXES], acceleration[ALTER_AXES];
};

struct alter_limiter {
    int32_t speed[ALTER_AXES], position[ALTER_AXES];
};

/* Cumulative values towards a target. */
void alter_limiter_speeds(struct alter_limiter *limiter, const struct alter_limits *limits, const int16_t *target,
                          int16_t *values);

/* Non-cumulative values; NULL: the axes brake, and stay where that ends. */
void alter_limiter_positions(struct alter_limiter *limiter, const struct alter_limits *limits, const int16_t *target,
                             int16_t *values);

/* The controller did not read the reply. */
void alter_limiter_rejected(struct alter_limiter *limiter);

/* No reply was sent. */
void alter_limiter_missed(struct alter_limiter *limiter);

/* An axis that was to move stays at zero (AL-65). */
void alter_limiter_hold(struct alter_limiter *limiter, int axis);

bool alter_limiter_is_at_rest(const struct alter_limiter *limiter);

#ifdef __cplusplus
}
#endif

#endif
