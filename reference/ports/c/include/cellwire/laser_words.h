/* The words of laser-eb90 (section 4.2 of reference/laser-eb90.md): commands by class, and error codes. */
#ifndef CELLWIRE_LASER_WORDS_H
#define CELLWIRE_LASER_WORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LASER_WORDS_MAX_RANGES 32

enum laser_words_class { LASER_WORDS_NO_CLASS, LASER_WORDS_INTERPRETED, LASER_WORDS_IMMEDIATE, LASER_WORDS_QUERY };

enum laser_words_error {
    LASER_WORDS_BAD_CHECKSUM,
    LASER_WORDS_BAD_FRAME,
    LASER_WORDS_UNKNOWN_COMMAND,
    LASER_WORDS_BAD_BATCH,
    LASER_WORDS_BAD_PARAMETERS,
    LASER_WORDS_QUEUE_FULL,
    LASER_WORDS_NO_ERROR,
};

struct laser_words {
    struct {
        uint16_t first, last;
        enum laser_words_class word_class;
    } commands[LASER_WORDS_MAX_RANGES];
    size_t command_count;
    uint16_t errors[LASER_WORDS_NO_ERROR];
};

extern const struct laser_words LASER_WORDS_DEFAULT;

/* LE-20 */
bool laser_words_are_valid(const struct laser_words *words);

/* LE-102 */
enum laser_words_class laser_words_class(const struct laser_words *words, uint16_t word);

/* LE-103 */
enum laser_words_error laser_words_error(const struct laser_words *words, uint16_t word);

/* The name of an error code in the reference; NULL: it is none. */
const char *laser_words_name(enum laser_words_error error);

#ifdef __cplusplus
}
#endif

#endif
