/* The dialect of a plant: its table of messages, its character set and its jobs (sections 4 and 5.2 of
 * reference/kawasaki-msg.md). */
#ifndef CELLWIRE_KAWASAKI_DIALECT_H
#define CELLWIRE_KAWASAKI_DIALECT_H

#include "cellwire/kawasaki_msg.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KAWASAKI_MAX_FIELDS 16 /* KM-27 */
#define KAWASAKI_MAX_OWN 960   /* KM-25 */
#define KAWASAKI_NAME_SHOWN 15 /* KM-35 */
#define KAWASAKI_LARGEST 9999  /* KM-43 */
#define KAWASAKI_OWN_FIELDS 64 /* of a job, at most */

enum kawasaki_field {
    KAWASAKI_UNUSED,
    KAWASAKI_CONSTANT,
    KAWASAKI_WORK, /* a job's own fields */
    KAWASAKI_ORDER,
    KAWASAKI_ENDED,
    KAWASAKI_PHASE,
    KAWASAKI_NUMBER,
    KAWASAKI_QUEUED,
    KAWASAKI_EXECUTED,
    KAWASAKI_VALUE,
    KAWASAKI_FIELDS,
};

/* One field of a message. */
struct kawasaki_place {
    enum kawasaki_field field;
    struct kawasaki_msg_text constant;
};

enum kawasaki_role {
    KAWASAKI_ORDER_START,
    KAWASAKI_ORDER_ACK,
    KAWASAKI_JOB,
    KAWASAKI_JOB_ACK,
    KAWASAKI_JOB_REQUEST,
    KAWASAKI_PAUSE,
    KAWASAKI_ORDER_END,
    KAWASAKI_ORDER_INTERRUPT,
    KAWASAKI_END_ACK,
    KAWASAKI_STATUS,
    KAWASAKI_FILLER,
    KAWASAKI_COMMAND,
    KAWASAKI_ROLES,
};

/* A message of the table. */
struct kawasaki_entry {
    enum kawasaki_role role;
    uint8_t command; /* the number of a command of the application's own */
    struct kawasaki_msg_text name;
    const struct kawasaki_place *header;
    size_t header_count;
    const struct kawasaki_place *fields;
    size_t field_count;
};

enum kawasaki_job_kind { KAWASAKI_WHOLE, KAWASAKI_DECIMAL, KAWASAKI_TEXT };

/* A field of a job's own. A decimal is a count of its last digit; the range of a text is its length. */
struct kawasaki_job_field {
    const char *name;
    enum kawasaki_job_kind kind;
    int32_t low, high;
    uint8_t places; /* of a decimal, 1 to 9 */
};

/* Its value: a number, or a text. A job without it is refused when it is to be sent. */
struct kawasaki_value {
    int32_t number;
    struct kawasaki_msg_text text;
    bool is_missing;
};

/* The caller's arrays stay where they are while a session uses them. */
struct kawasaki_dialect {
    bool is_latin1; /* KM-16 */
    const struct kawasaki_entry *entries;
    size_t entry_count;
    const struct kawasaki_job_field *job;
    size_t job_count;
};

extern const struct kawasaki_dialect KAWASAKI_DIALECT; /* KM-18, KM-23 */

enum kawasaki_fault_kind {
    KAWASAKI_UNKNOWN_NAME,     /* name */
    KAWASAKI_HEADER,           /* place */
    KAWASAKI_FIELD_COUNT,      /* expected, found */
    KAWASAKI_NOT_THE_CONSTANT, /* place */
    KAWASAKI_NOT_A_NUMBER,     /* place */
    KAWASAKI_OUT_OF_RANGE,     /* place, found, min, max */
    KAWASAKI_JOB_TOO_LONG,     /* found; the limit is 1024 */
    KAWASAKI_UNFIT,            /* field, unfit */
    KAWASAKI_NOT_EXPECTED,     /* role, command */
    KAWASAKI_WRONG_ORDER,      /* expected (the active one), found */
    KAWASAKI_OUT_OF_ORDER,     /* expected, found */
    KAWASAKI_REPEATED,         /* expected, found */
    KAWASAKI_JOBS_MISSING,     /* order, expected */
    KAWASAKI_NO_SLOT,          /* found (the job's number) */
};

/* KM-36 */
enum kawasaki_unfit {
    KAWASAKI_UNFIT_MISSING,
    KAWASAKI_UNFIT_NOT_A_NUMBER,
    KAWASAKI_UNFIT_TOO_PRECISE,
    KAWASAKI_UNFIT_OUT_OF_RANGE, /* found */
    KAWASAKI_UNFIT_RESERVED,     /* found */
    KAWASAKI_UNFIT_CHARACTER,    /* found */
    KAWASAKI_UNFIT_LENGTH,       /* found */
};

struct kawasaki_fault {
    enum kawasaki_fault_kind kind;
    uint8_t name[KAWASAKI_NAME_SHOWN];
    size_t name_length;
    size_t place;
    int64_t expected, found, min, max;
    uint16_t order;
    enum kawasaki_role role;
    uint8_t command;
    const struct kawasaki_job_field *field;
    enum kawasaki_unfit unfit;
};

/* The bytes that a job's own fields have at most, with a `$` for each (KM-25). */
size_t kawasaki_job_longest(const struct kawasaki_dialect *dialect);

/* Reads a job's own fields into as many values as the layout has; false: they do not fit. */
bool kawasaki_job_read(const struct kawasaki_dialect *dialect, const struct kawasaki_msg_text *own, size_t count,
                       struct kawasaki_value *values, struct kawasaki_fault *fault);

/* Writes a job's own fields, and their length; false: one does not fit (KM-40), or there is no room. */
bool kawasaki_job_write(const struct kawasaki_dialect *dialect, const struct kawasaki_value *values, uint8_t *out, size_t size,
                        size_t *length, struct kawasaki_fault *fault);

#ifdef __cplusplus
}
#endif

#endif
