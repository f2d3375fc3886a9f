/* The robot of kawasaki-msg (section 8 of reference/kawasaki-msg.md): asks a PC for jobs, queues them for its motion
 * program, and tells what became of them. */
#ifndef CELLWIRE_KAWASAKI_ROBOT_H
#define CELLWIRE_KAWASAKI_ROBOT_H

#include "cellwire/kawasaki_end.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KAWASAKI_HALF SIZE_MAX /* low_water: half the queue */
#define KAWASAKI_ENDED_ORDERS 16 /* KM-63 */

enum kawasaki_slot_state { KAWASAKI_FREE, KAWASAKI_FILLED, KAWASAKI_TAKEN };

/* A place of the queue; it is written by the session alone. */
struct kawasaki_slot {
    enum kawasaki_slot_state state;
    uint16_t order, number;
    size_t length; /* of the job's own fields */
};

/* KM-82; times in nanoseconds, UINT64_MAX is never. */
struct kawasaki_robot_config {
    struct kawasaki_dialect dialect; /* without entries: KAWASAKI_DIALECT */
    struct kawasaki_limits limits;
    bool datagrams;
    uint16_t max_number;
    struct kawasaki_slot *slots; /* the caller's, fewer than max_number */
    size_t slot_count;
    uint8_t *jobs; /* the caller's: kawasaki_job_longest for each slot */
    size_t jobs_size;
    bool individual_acks;
    uint16_t acks; /* cumulative: one for so many jobs */
    size_t low_water;
    unsigned resends, pauses, clears;
    uint64_t patience, pause, reply_timeout, exchange;
    unsigned silent_cycles; /* 0: never */
    uint64_t reconnect_delay, status_period;
    bool refuse_repeated_start, end_foreign_order;
};

extern const struct kawasaki_robot_config KAWASAKI_ROBOT_DEFAULT; /* all but slots and jobs */

enum kawasaki_robot_link { KAWASAKI_DISCONNECTED, KAWASAKI_CONNECTING, KAWASAKI_READY, KAWASAKI_WAITING };
enum kawasaki_robot_stage {
    KAWASAKI_IDLE,
    KAWASAKI_INTAKE,
    KAWASAKI_CLEARING,
    KAWASAKI_ENDING,
    KAWASAKI_INTERRUPTED,
    KAWASAKI_IN_ALARM,
};
enum kawasaki_flow { KAWASAKI_ASKING, KAWASAKI_FULL, KAWASAKI_HELD };
enum kawasaki_gap { KAWASAKI_CLOSED, KAWASAKI_REST, KAWASAKI_ASKED, KAWASAKI_END_ONCE, KAWASAKI_ASKED_AGAIN };

/* What a robot knows of its order; counts stay when it is over (KM-46). */
struct kawasaki_robot_order {
    uint16_t number;
    enum kawasaki_robot_stage stage;
    enum kawasaki_flow flow;
    enum kawasaki_gap gap;
    uint64_t held_until;
    unsigned failures;
    bool waits, is_reported;
    uint64_t waits_until, reported_at;
    uint64_t queued, executed, acknowledged;                     /* counts */
    uint8_t ahead[KAWASAKI_NUMBERS], unacked[KAWASAKI_NUMBERS]; /* sets of numbers */
};

struct kawasaki_queue {
    struct kawasaki_slot *slots;
    uint8_t *jobs;
    size_t capacity, job_size;
    size_t first, count;
    bool is_abandoned, has_taken;
    size_t taken;
};

struct kawasaki_robot {
    struct kawasaki_end end;
    struct kawasaki_robot_config config;
    struct kawasaki_queue queue;
    struct kawasaki_robot_order order;
    enum kawasaki_robot_link link;
    bool opens; /* that it is to be opened is not reported yet */
    uint64_t connect_at, at, overdue_at, not_before, status_at;
    bool answered, synced;
    unsigned silent, unanswered;
    bool has_ended;
    uint16_t ended, ended_executed; /* an order, and a job's number or 0 */
    uint16_t ended_orders[KAWASAKI_ENDED_ORDERS];
    size_t ended_count;
    bool replies_status, replies_pause, replies_end, replies_start;
    uint16_t start;
    bool ignores, was_drained;
    uint64_t ignored_until;
};

/* A job for the motion program; kawasaki_job_read reads its own fields, as many as the layout has. */
struct kawasaki_robot_job {
    uint16_t order, number;
    struct kawasaki_msg_text own; /* until its slot is free */
};

/* false: the configuration is refused (KM-83). */
bool kawasaki_robot_init(struct kawasaki_robot *robot, const struct kawasaki_robot_config *config);

/* After each of these, and of those below: take the events, then what is to be transmitted. */
void kawasaki_robot_connected(struct kawasaki_robot *robot, uint64_t now);
void kawasaki_robot_disconnected(struct kawasaki_robot *robot, uint64_t now);
void kawasaki_robot_timeout(struct kawasaki_robot *robot, uint64_t now);

/* Takes all bytes, and returns how many. With datagrams they are one. */
size_t kawasaki_robot_input(struct kawasaki_robot *robot, uint64_t now, const uint8_t *data, size_t size);

/* The motion program: takes the oldest job, or that of a number other than 0; reports that it is executed; frees its slot.
 * false: refused, nothing has changed (KM-69). Give a `timeout` when a slot was freed, the list was cleared, or the motion
 * program is gone (KM-72). */
bool kawasaki_robot_take(struct kawasaki_robot *robot, uint16_t number, struct kawasaki_robot_job *job);
bool kawasaki_robot_report(struct kawasaki_robot *robot, uint16_t number);
bool kawasaki_robot_complete(struct kawasaki_robot *robot);
void kawasaki_robot_abandon(struct kawasaki_robot *robot); /* there is none any more */

/* The resets of KM-71; false: refused. */
bool kawasaki_robot_clear_queue(struct kawasaki_robot *robot);
bool kawasaki_robot_reset_order(struct kawasaki_robot *robot);

/* The next event; false: there is none. */
bool kawasaki_robot_event(struct kawasaki_robot *robot, struct kawasaki_event *event);

/* The bytes that are to be sent now; 0: nothing, or `size` is less than a packet may have. */
size_t kawasaki_robot_transmit(struct kawasaki_robot *robot, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` or `transmit` is to be called at the latest; false: never. */
bool kawasaki_robot_deadline(const struct kawasaki_robot *robot, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
