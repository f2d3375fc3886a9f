#include "cellwire/kawasaki_robot.h"

#include <string.h>

#include "../kawasaki.h"

#define SLOTS 256

ADAPT(kawasaki_robot)

static struct kawasaki_slot slots[SLOTS];
static uint8_t jobs[SLOTS * KAWASAKI_MAX_OWN];
/* The motion program of the stories: a job that is taken is an event, behind the session's. */
static struct kawasaki_robot_job taken;
static bool has_taken;

static void read_switch(const struct json *config, const char *name, bool *value)
{
    if (json_get(config, name) != NULL)
        *value = json_true(json_get(config, name));
}

static void read_number(const struct json *config, const char *name, uint16_t *number)
{
    unsigned value = *number;
    read_unsigned(config, name, UINT16_MAX, &value);
    *number = (uint16_t)value;
}

static bool begin(const struct json *object)
{
    struct kawasaki_robot_config config = KAWASAKI_ROBOT_DEFAULT;
    const struct json *recovery = json_get(object, "recovery");
    unsigned low_water = 0;
    read_kawasaki_limits(object, &config.limits);
    read_switch(object, "datagrams", &config.datagrams);
    read_number(object, "max_number", &config.max_number);
    unsigned queue = config.max_number <= SLOTS ? config.max_number - 1u : SLOTS;
    read_unsigned(object, "queue", SLOTS, &queue);
    config.slots = slots;
    config.slot_count = queue;
    config.jobs = jobs;
    config.jobs_size = sizeof jobs;
    config.individual_acks = json_is(json_get(object, "acks"), "individual");
    read_number(object, "acks", &config.acks);
    read_unsigned(object, "low_water", UINT16_MAX, &low_water);
    const struct json *level = json_get(object, "low_water");
    if (level != NULL && level->type == '0')
        config.low_water = low_water;
    read_unsigned(recovery, "resends", UINT16_MAX, &config.resends);
    read_unsigned(recovery, "pauses", UINT16_MAX, &config.pauses);
    read_unsigned(recovery, "clears", UINT16_MAX, &config.clears);
    read_time(object, "patience", &config.patience);
    read_time(object, "pause", &config.pause);
    read_time(object, "reply_timeout", &config.reply_timeout);
    read_time(object, "exchange", &config.exchange);
    read_unsigned(object, "silent_cycles", UINT16_MAX, &config.silent_cycles);
    read_time(object, "reconnect_delay", &config.reconnect_delay);
    read_time(object, "status_period", &config.status_period);
    read_switch(object, "refuse_repeated_start", &config.refuse_repeated_start);
    read_switch(object, "end_foreign_order", &config.end_foreign_order);
    has_taken = false;
    return read_kawasaki_dialect(object, &config.dialect) && kawasaki_robot_init(&session, &config);
}

static bool take(uint16_t number)
{
    if (!kawasaki_robot_take(&session, number, &taken))
        return false;
    has_taken = true;
    return true;
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int64_t number = 0;
    (void)now;
    json_integer(argument, 0, UINT16_MAX, &number);
    if (strcmp(name, "take") == 0)
        return take((uint16_t)number);
    if (strcmp(name, "report") == 0)
        return kawasaki_robot_report(&session, (uint16_t)number);
    if (strcmp(name, "complete") == 0)
        return kawasaki_robot_complete(&session);
    if (strcmp(name, "execute") == 0)
        return take(0) && kawasaki_robot_report(&session, taken.number) && kawasaki_robot_complete(&session);
    if (strcmp(name, "clear_queue") == 0)
        return kawasaki_robot_clear_queue(&session);
    if (strcmp(name, "reset_order") == 0)
        return kawasaki_robot_reset_order(&session);
    kawasaki_robot_abandon(&session);
    return strcmp(name, "abandon") == 0;
}

static void print_taken(bool is_first)
{
    struct kawasaki_value values[KAWASAKI_OWN_FIELDS];
    const struct kawasaki_dialect *dialect = &session.end.dialect;
    struct kawasaki_fault fault;
    kawasaki_job_read(dialect, &taken.own, dialect->job_count, values, &fault);
    begin_event(is_first, "taken");
    print(",\"order\":%u,\"number\":%u,\"job\":", taken.order, taken.number);
    print_kawasaki_job(dialect, values);
    print("}");
}

static bool event(bool is_first)
{
    struct kawasaki_event event;
    if (kawasaki_robot_event(&session, &event)) {
        print_kawasaki_event(is_first, &event, true);
        return true;
    }
    if (!has_taken)
        return false;
    has_taken = false;
    print_taken(is_first);
    return true;
}

const struct end KAWASAKI_ROBOT = {END("kawasaki-msg", "robot")};
