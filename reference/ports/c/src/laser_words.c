#include "cellwire/laser_words.h"

const struct laser_words LASER_WORDS_DEFAULT = {
    .commands = {{0x0100, 0x01FF, LASER_WORDS_INTERPRETED},
                 {0x0200, 0x02FF, LASER_WORDS_IMMEDIATE},
                 {0x0300, 0x03FF, LASER_WORDS_QUERY}},
    .command_count = 3,
    .errors = {0xE001, 0xE002, 0xE003, 0xE004, 0xE005, 0xE006},
};

bool laser_words_are_valid(const struct laser_words *words)
{
    if (words->command_count > LASER_WORDS_MAX_RANGES)
        return false;
    for (size_t i = 0; i < words->command_count; i++)
        for (size_t j = 0; j < i; j++)
            if (words->commands[i].first <= words->commands[j].last && words->commands[j].first <= words->commands[i].last)
                return false;
    for (size_t i = 0; i < LASER_WORDS_NO_ERROR; i++)
        if (laser_words_class(words, words->errors[i]) != LASER_WORDS_NO_CLASS || laser_words_error(words, words->errors[i]) != i)
            return false;
    return true;
}

enum laser_words_class laser_words_class(const struct laser_words *words, uint16_t word)
{
    for (size_t i = 0; i < words->command_count; i++)
        if (word >= words->commands[i].first && word <= words->commands[i].last)
            return words->commands[i].word_class;
    return LASER_WORDS_NO_CLASS;
}

enum laser_words_error laser_words_error(const struct laser_words *words, uint16_t word)
{
    size_t error = 0;
    while (error < LASER_WORDS_NO_ERROR && words->errors[error] != word)
        error++;
    return (enum laser_words_error)error;
}

const char *laser_words_name(enum laser_words_error error)
{
    static const char *const NAMES[] = {"bad_checksum", "bad_frame",      "unknown_command",
                                        "bad_batch",    "bad_parameters", "queue_full"};
    return error < LASER_WORDS_NO_ERROR ? NAMES[error] : NULL;
}
