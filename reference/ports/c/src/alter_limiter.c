#include "cellwire/alter_limiter.h"

static int32_t clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

static int32_t to_word(int32_t value) { return clamp(value, INT16_MIN, INT16_MAX); }

/* The speed of this cycle on the way to the wanted one. */
static int32_t step(struct alter_limiter *limiter, const struct alter_limits *limits, int axis, int32_t wanted)
{
    int32_t v = limits->velocity[axis], a = limits->acceleration[axis], speed = limiter->speed[axis];
    limiter->speed[axis] = clamp(clamp(wanted, -v, v), speed - a, speed + a);
    return limiter->speed[axis];
}

/* The highest speed from which an axis stops within `way`, this cycle's move included. */
static int32_t braking(int32_t a, int32_t way)
{
    int32_t n = 0;
    if (a == 0)
        return 0;
    while ((int64_t)(n + 1) * (n + 2) / 2 <= way / a)
        n++;
    return n * a + (int32_t)((way - (int64_t)a * n * (n + 1) / 2) / (n + 1));
}

void alter_limiter_speeds(struct alter_limiter *limiter, const struct alter_limits *limits, const int16_t *target,
                          int16_t *values)
{
    for (int axis = 0; axis < ALTER_AXES; axis++)
        values[axis] = (int16_t)to_word(step(limiter, limits, axis, target[axis]));
}

void alter_limiter_positions(struct alter_limiter *limiter, const struct alter_limits *limits, const int16_t *target,
                             int16_t *values)
{
    for (int axis = 0; axis < ALTER_AXES; axis++) {
        int32_t before = limiter->position[axis];
        int32_t way = target == 0 ? 0 : target[axis] - before;
        int32_t wanted = braking(limits->acceleration[axis], way < 0 ? -way : way);
        limiter->position[axis] = to_word(before + step(limiter, limits, axis, way < 0 ? -wanted : wanted));
        limiter->speed[axis] = limiter->position[axis] - before;
        values[axis] = (int16_t)limiter->position[axis];
    }
}

void alter_limiter_rejected(struct alter_limiter *limiter)
{
    for (int axis = 0; axis < ALTER_AXES; axis++)
        limiter->position[axis] = to_word(limiter->position[axis] - limiter->speed[axis]);
    alter_limiter_missed(limiter);
}

void alter_limiter_missed(struct alter_limiter *limiter)
{
    for (int axis = 0; axis < ALTER_AXES; axis++)
        limiter->speed[axis] = 0;
}

void alter_limiter_hold(struct alter_limiter *limiter, int axis) { limiter->speed[axis] = limiter->position[axis] = 0; }

bool alter_limiter_is_at_rest(const struct alter_limiter *limiter)
{
    for (int axis = 0; axis < ALTER_AXES; axis++)
        if (limiter->speed[axis] != 0)
            return false;
    return true;
}
