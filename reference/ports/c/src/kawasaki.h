/* What the sessions of kawasaki-msg share: messages with a meaning, packets, numbers of jobs, and events. */
#ifndef CELLWIRE_KAWASAKI_H
#define CELLWIRE_KAWASAKI_H

#include "cellwire/kawasaki_end.h"
#include "session.h"

#define LATEST_DATAGRAM SECOND /* KM-9 */

/* A message and its fields, by their kind; a job's own as texts. */
struct found {
    const struct kawasaki_entry *entry;
    bool is_there[KAWASAKI_FIELDS]; /* and not empty */
    int32_t values[KAWASAKI_FIELDS];
    struct kawasaki_msg_text own;
    size_t own_count;
};

/* A number of a message, or `otherwise` where it has none. */
static inline int32_t value_or(const struct found *found, enum kawasaki_field field, int32_t otherwise)
{
    return found->is_there[field] ? found->values[field] : otherwise;
}

static inline uint16_t number_of(const struct found *found, enum kawasaki_field field)
{
    return (uint16_t)value_or(found, field, 0);
}

/* What is in a message, by kind of field; 0 is written empty where that is allowed. */
struct values {
    int32_t of[KAWASAKI_FIELDS];
    struct kawasaki_msg_text own;
};

/* KM-17; false: it is none. */
bool kawasaki_number(struct kawasaki_msg_text text, int32_t *value);
void kawasaki_trim(struct kawasaki_msg_text *text);

bool kawasaki_is_forbidden(uint8_t byte, bool is_latin1);

/* NULL: the table lacks it. */
const struct kawasaki_entry *kawasaki_entry(const struct kawasaki_dialect *dialect, enum kawasaki_role role, uint8_t command);
bool kawasaki_has(const struct kawasaki_dialect *dialect, enum kawasaki_role role);
bool kawasaki_entry_has(const struct kawasaki_entry *entry, enum kawasaki_field field);

/* Where a field is in a message, counted from 0. */
size_t kawasaki_place_of(const struct kawasaki_dialect *dialect, enum kawasaki_role role, enum kawasaki_field field);

/* Whether the table and the layout are allowed, and each message fits a packet (KM-25, KM-27, KM-28, KM-45, KM-83). */
bool kawasaki_check(const struct kawasaki_dialect *dialect, const struct kawasaki_limits *limits, uint16_t largest, bool datagrams);

/* What a message means, but for a job's own fields; false: nothing (KM-35). */
bool kawasaki_read(const struct kawasaki_dialect *dialect, const struct kawasaki_msg_item *item, struct found *found,
                   struct kawasaki_fault *fault);

/* Messages that are sent together (KM-6). */
struct packet {
    const struct kawasaki_end *end;
    uint8_t *out;
    size_t length;
};

/* Whether a message has room, or the table lacks it. */
bool kawasaki_add(struct packet *packet, enum kawasaki_role role, uint8_t command, const struct values *values);

/* Its length; filler is added if it has none. */
size_t kawasaki_finish(struct packet *packet);

/* A number on the wire, of a decimal with its point; returns its length, up to 12. */
size_t kawasaki_put_number(uint8_t *out, int32_t value, unsigned places);

/* Section 7. */
static inline uint16_t number_at(const struct kawasaki_end *end, uint64_t count)
{
    return (uint16_t)((count - 1) % end->largest + 1);
}

static inline uint16_t number_or_none(const struct kawasaki_end *end, uint64_t count)
{
    return count > 0 ? number_at(end, count) : 0;
}

static inline uint64_t ahead_of(const struct kawasaki_end *end, uint64_t count, uint16_t number)
{
    return (number + end->largest - count % end->largest) % end->largest;
}

/* Sets of numbers. */
static inline bool is_in(const uint8_t *set, uint16_t number) { return set[number / 8] >> number % 8 & 1; }

static inline void include(uint8_t *set, uint16_t number) { set[number / 8] = (uint8_t)(set[number / 8] | 1u << number % 8); }

static inline void exclude(uint8_t *set, uint16_t number) { set[number / 8] = (uint8_t)(set[number / 8] & ~(1u << number % 8)); }

bool kawasaki_end_init(struct kawasaki_end *end, const struct kawasaki_dialect *dialect, const struct kawasaki_limits *limits,
                       uint16_t largest, bool datagrams);

/* Half a message of the connection before is forgotten (KM-8); offsets count on. */
void kawasaki_end_clear(struct kawasaki_end *end);

/* The next message, error of the decoder, reported, or message that means nothing. */
enum reading { NOTHING, CORRUPT, MEANINGLESS, MESSAGE };
enum reading kawasaki_end_read(struct kawasaki_end *end, struct found *found, struct kawasaki_fault *fault);

/* Whether a message is not whole; what is corrupt is none, and not held. */
bool kawasaki_end_is_half(const struct kawasaki_end *end);

/* A new event, a notice or an outcome. Where all places are taken, the oldest notice is lost, which may be this one. */
struct kawasaki_event *kawasaki_report(struct kawasaki_end *end, enum kawasaki_event_kind kind);
struct kawasaki_event *kawasaki_report_outcome(struct kawasaki_end *end, enum kawasaki_event_kind kind);
void kawasaki_reject(struct kawasaki_end *end, const struct kawasaki_fault *fault);

/* The oldest event, or, without one, that the connection is to be closed; false: there is neither. */
bool kawasaki_end_event(struct kawasaki_end *end, struct kawasaki_event *event);

/* The event of what is set, which is not any more then; false: it is not. */
bool kawasaki_take_flag(bool *is_set, enum kawasaki_event_kind kind, struct kawasaki_event *event);

/* Room for so many outcomes (KM-81, KM-120). */
bool kawasaki_has_room(const struct kawasaki_end *end, size_t outcomes);

#endif
