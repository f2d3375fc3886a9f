/* The PC of kawasaki-msg (section 9 of reference/kawasaki-msg.md): gives a robot the jobs of an order, one
 * order after the other. */
#ifndef CELLWIRE_KAWASAKI_PC_H
#define CELLWIRE_KAWASAKI_PC_H

#include "cellwire/kawasaki_end.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KAWASAKI_PC_COMMANDS 4 /* in flight and waiting */

/* How an order that is in the way ends. */
enum kawasaki_takeover { KAWASAKI_TAKEOVER_INTERRUPT, KAWASAKI_TAKEOVER_END, KAWASAKI_TAKEOVER_NEVER };

/* KM-121; times in nanoseconds, UINT64_MAX is never. */
struct kawasaki_pc_config {
    struct kawasaki_dialect dialect; /* without entries: KAWASAKI_DIALECT */
    struct kawasaki_limits limits;
    bool datagrams;
    uint16_t max_number;
    bool individual_acks;
    uint64_t reply_delay, silence;
    enum kawasaki_takeover takeover;
    unsigned start_retries;
    bool end_when_done;
};

extern const struct kawasaki_pc_config KAWASAKI_PC_DEFAULT;

/* Section 9.1: Unsent to Foreign are an order that starts, Active to Interrupted one that runs. */
enum kawasaki_pc_stage {
    KAWASAKI_PC_IDLE,
    KAWASAKI_PC_UNSENT,
    KAWASAKI_PC_LOST,
    KAWASAKI_PC_SENT,
    KAWASAKI_PC_FOREIGN,
    KAWASAKI_PC_ACTIVE,
    KAWASAKI_PC_ENDING,
    KAWASAKI_PC_INTERRUPTED,
};

struct kawasaki_pc_command {
    uint8_t id;
    int32_t value;
    bool is_in_flight;
};

/* The jobs of an order, each as many values as the layout has fields; the caller's, until the order has its outcome. */
struct kawasaki_pc_jobs {
    const struct kawasaki_value *values;
    uint64_t count;
    bool is_open; /* more may come */
};

/* What an order of before had reached (KM-128); `ahead` are places, counted from 0. */
struct kawasaki_pc_reached {
    uint64_t executed, sent;
    const uint64_t *ahead;
    size_t ahead_count;
};

struct kawasaki_pc {
    struct kawasaki_end end;
    struct kawasaki_pc_config config;
    uint16_t window;
    bool is_up, is_receiving, is_due, asks_status, has_request, knows_robot;
    uint64_t silent_at, reply_at, jobs_from;
    uint16_t robot; /* the order that it said it is in */
    struct kawasaki_pc_command commands[KAWASAKI_PC_COMMANDS];
    size_t command_count;
    uint16_t number;
    enum kawasaki_pc_stage stage;
    struct kawasaki_pc_jobs jobs;
    uint64_t executed, queued, sent, total;
    bool has_progress; /* that is not reported yet */
    bool has_total, is_unsure, is_cancelled, has_answer_by, has_left;
    uint8_t ahead[KAWASAKI_NUMBERS]; /* a set of numbers */
    unsigned refusals;
    uint16_t foreign;
    uint64_t answer_by, left_at;
};

/* false: the configuration is refused (KM-122). */
bool kawasaki_pc_init(struct kawasaki_pc *pc, const struct kawasaki_pc_config *config);

/* After each of these, and of those below: take the events, then what is to be transmitted. */
void kawasaki_pc_connected(struct kawasaki_pc *pc, uint64_t now);
void kawasaki_pc_disconnected(struct kawasaki_pc *pc, uint64_t now);
void kawasaki_pc_timeout(struct kawasaki_pc *pc, uint64_t now);

/* Takes all bytes, and returns how many. With datagrams they are one. */
size_t kawasaki_pc_input(struct kawasaki_pc *pc, uint64_t now, const uint8_t *data, size_t size);

/* What the owner asks (KM-118); false: refused, nothing has changed. */
bool kawasaki_pc_start(struct kawasaki_pc *pc, uint16_t order, const struct kawasaki_pc_jobs *jobs);
bool kawasaki_pc_resume(struct kawasaki_pc *pc, uint16_t order, const struct kawasaki_pc_jobs *jobs,
                        const struct kawasaki_pc_reached *reached);
bool kawasaki_pc_end(struct kawasaki_pc *pc);
bool kawasaki_pc_interrupt(struct kawasaki_pc *pc);
bool kawasaki_pc_command(struct kawasaki_pc *pc, uint8_t id, int32_t value);

/* The jobs of the order, with more behind those that were there; and whether more may come. */
void kawasaki_pc_set_jobs(struct kawasaki_pc *pc, const struct kawasaki_pc_jobs *jobs);

/* The next event; false: there is none. */
bool kawasaki_pc_event(struct kawasaki_pc *pc, struct kawasaki_event *event);

/* The bytes that are to be sent now; 0: nothing, or `size` is less than a packet may have. */
size_t kawasaki_pc_transmit(struct kawasaki_pc *pc, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` or `transmit` is to be called at the latest; false: never. */
bool kawasaki_pc_deadline(const struct kawasaki_pc *pc, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
