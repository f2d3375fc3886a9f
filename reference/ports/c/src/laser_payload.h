/* What the sessions of laser-eb90 read in a payload. */
#ifndef CELLWIRE_LASER_PAYLOAD_H
#define CELLWIRE_LASER_PAYLOAD_H

#include "cellwire/laser_eb90.h"

/* Whether an item is a word (LE-18). */
static inline bool is_word(const struct laser_eb90_profile *profile, const struct laser_eb90_item *item, uint16_t *word)
{
    if (item->type != LASER_EB90_I16 || item->count != 1)
        return false;
    *word = (uint16_t)laser_eb90_get_i16(profile, item, 0);
    return true;
}

/* The word that a payload begins with (LE-19); `*at` moves behind it. */
static inline bool first_word(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t *at,
                              uint16_t *word)
{
    struct laser_eb90_item item;
    return laser_eb90_item(profile, payload, length, at, &item) && is_word(profile, &item, word);
}

static inline void put_word(struct laser_eb90_payload *payload, uint16_t word)
{
    laser_eb90_put_item(payload, LASER_EB90_I16, 1);
    laser_eb90_put_i16(payload, (int16_t)((word ^ 0x8000) - 0x8000));
}

#endif
