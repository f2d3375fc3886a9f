#include "cellwire/kawasaki_pc.h"

#include <string.h>

#include "../kawasaki.h"

#define MAX_VALUES 4096
#define MAX_AHEAD 64

ADAPT(kawasaki_pc)

static struct kawasaki_value values[MAX_VALUES];
static struct kawasaki_pc_jobs jobs; /* of the order; `values` has theirs */

static bool begin(const struct json *object)
{
    struct kawasaki_pc_config config = KAWASAKI_PC_DEFAULT;
    const struct json *takeover = json_get(object, "takeover"), *when_done = json_get(object, "end_when_done");
    const struct json *cumulative = json_get(object, "cumulative_acks");
    unsigned max_number = config.max_number;
    read_kawasaki_limits(object, &config.limits);
    config.datagrams = json_true(json_get(object, "datagrams"));
    read_unsigned(object, "max_number", UINT16_MAX, &max_number);
    config.max_number = (uint16_t)max_number;
    config.individual_acks = cumulative != NULL && !json_true(cumulative);
    read_time(object, "reply_delay", &config.reply_delay);
    read_time(object, "silence", &config.silence);
    if (takeover != NULL) {
        if (!json_is(takeover, "end") && !json_is(takeover, "never") && !json_is(takeover, "interrupt"))
            return false;
        config.takeover = json_is(takeover, "end")     ? KAWASAKI_TAKEOVER_END
                          : json_is(takeover, "never") ? KAWASAKI_TAKEOVER_NEVER
                                                       : KAWASAKI_TAKEOVER_INTERRUPT;
    }
    read_unsigned(object, "start_retries", UINT16_MAX, &config.start_retries);
    if (when_done != NULL)
        config.end_when_done = json_true(when_done);
    jobs = (struct kawasaki_pc_jobs){values, 0, false};
    return read_kawasaki_dialect(object, &config.dialect) && kawasaki_pc_init(&session, &config);
}

/* More jobs behind those that are there. */
static bool read_jobs(const struct json *list)
{
    const struct kawasaki_dialect *dialect = &session.end.dialect;
    for (const struct json *job = list == NULL ? NULL : list->child; job != NULL; job = job->next) {
        size_t at = (size_t)jobs.count * dialect->job_count;
        if (at + dialect->job_count > MAX_VALUES || !read_kawasaki_job(dialect, job, values + at))
            return false;
        jobs.count++;
    }
    return true;
}

static bool start(const struct json *argument, bool resumes)
{
    uint64_t ahead[MAX_AHEAD];
    struct kawasaki_pc_reached reached = {0, 0, ahead, 0};
    int64_t order = 0, executed = 0, sent = 0, place = 0;
    if (session.stage != KAWASAKI_PC_IDLE) /* `values` are of another order */
        return resumes ? kawasaki_pc_resume(&session, 1, &jobs, &reached) : kawasaki_pc_start(&session, 1, &jobs);
    jobs.count = 0;
    jobs.is_open = json_true(json_get(argument, "open"));
    if (!json_integer(json_get(argument, "order"), 0, UINT16_MAX, &order) || !read_jobs(json_get(argument, "jobs")))
        return false;
    if (!resumes)
        return kawasaki_pc_start(&session, (uint16_t)order, &jobs);
    const struct json *list = json_get(argument, "ahead");
    json_integer(json_get(argument, "executed"), 0, INT64_MAX, &executed);
    json_integer(json_get(argument, "sent"), 0, INT64_MAX, &sent);
    reached.executed = (uint64_t)executed;
    reached.sent = (uint64_t)sent;
    for (const struct json *at = list == NULL ? NULL : list->child; at != NULL && reached.ahead_count < MAX_AHEAD; at = at->next)
        if (json_integer(at, 0, INT64_MAX, &place))
            ahead[reached.ahead_count++] = (uint64_t)place;
    return kawasaki_pc_resume(&session, (uint16_t)order, &jobs, &reached);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    int64_t id = 0, value = 0;
    (void)now;
    if (strcmp(name, "start") == 0 || strcmp(name, "resume") == 0)
        return start(argument, strcmp(name, "resume") == 0);
    if (strcmp(name, "end") == 0)
        return kawasaki_pc_end(&session);
    if (strcmp(name, "interrupt") == 0)
        return kawasaki_pc_interrupt(&session);
    if (strcmp(name, "command") == 0)
        return json_integer(json_get(argument, "id"), 0, UINT8_MAX, &id) &&
               json_integer(json_get(argument, "value"), INT32_MIN, INT32_MAX, &value) &&
               kawasaki_pc_command(&session, (uint8_t)id, (int32_t)value);
    if (strcmp(name, "add") == 0 && !read_jobs(argument))
        return false;
    jobs.is_open = jobs.is_open && strcmp(name, "close") != 0;
    kawasaki_pc_set_jobs(&session, &jobs);
    return true;
}

static bool event(bool is_first)
{
    struct kawasaki_event event;
    if (!kawasaki_pc_event(&session, &event))
        return false;
    print_kawasaki_event(is_first, &event, false);
    return true;
}

const struct end KAWASAKI_PC = {END("kawasaki-msg", "pc")};
