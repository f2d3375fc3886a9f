#include "cellwire/laser_controller.h"

#include <string.h>

#include "../end.h"

#define MAX_QUEUE 64

ADAPT(laser_controller)

static struct instruction {
    uint16_t word;
    uint8_t parameters[LASER_EB90_MAX_PAYLOAD];
    size_t length;
} queued[MAX_QUEUE];
static size_t queued_count, queue_size, to_take;

static bool takes(void *context, uint16_t word, const uint8_t *parameters, size_t length)
{
    struct laser_eb90_item item;
    (void)context, (void)word;
    for (size_t at = 0; laser_eb90_item(&session.config.profile, parameters, length, &at, &item);)
        if (item.type == LASER_EB90_CHAR)
            return false;
    return true;
}

static size_t room(void *context)
{
    (void)context;
    return queue_size - queued_count;
}

static void queue(void *context, uint16_t word, const uint8_t *parameters, size_t length)
{
    struct instruction *last = &queued[queued_count++];
    (void)context;
    last->word = word;
    last->length = length;
    memcpy(last->parameters, parameters, length);
}

static bool begin(const struct json *object)
{
    struct laser_controller_config config = laser_controller_default();
    unsigned size = 8;
    read_laser_profile(json_get(object, "profile"), &config.profile);
    read_laser_words(json_get(object, "words"), &config.words);
    read_unsigned(object, "batch", UINT16_MAX, &config.batch);
    read_unsigned(object, "queue", MAX_QUEUE, &size);
    read_time(object, "tick", &config.tick);
    read_time(object, "silence", &config.silence);
    config.echo = json_true(json_get(object, "echo"));
    config.owner = (struct laser_controller_owner){.takes = takes, .room = room, .queue = queue};
    queue_size = size;
    queued_count = to_take = 0;
    return laser_controller_init(&session, &config);
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    static struct laser_eb90_payload values;
    int64_t count = 0;
    int error = 0;
    if (strcmp(name, "take") == 0) {
        json_integer(argument, 0, MAX_QUEUE, &count);
        to_take = (size_t)count < queued_count ? (size_t)count : queued_count;
        return true;
    }
    if (strcmp(name, "refuse") == 0) {
        while (error < LASER_WORDS_NO_ERROR && !json_is(argument, laser_words_name((enum laser_words_error)error)))
            error++;
        return laser_controller_refuse(&session, now, (enum laser_words_error)error);
    }
    values = (struct laser_eb90_payload){.profile = &session.config.profile};
    for (const struct json *item = argument->child; item != NULL; item = item->next)
        if (!put_laser_item(&values, item))
            return false;
    return laser_controller_answer(&session, now, values.length == 0 && !values.is_refused ? NULL : &values);
}

static void print_parameters(const uint8_t *parameters, size_t length)
{
    print(",\"parameters\":");
    print_laser_list(&session.config.profile, parameters, length, 0);
}

/* What the owner takes from its queue. */
static bool print_taken(bool is_first)
{
    if (to_take == 0)
        return false;
    begin_event(is_first, "taken");
    print(",\"word\":%u", queued[0].word);
    print_parameters(queued[0].parameters, queued[0].length);
    print("}");
    memmove(queued, queued + 1, --queued_count * sizeof *queued);
    to_take--;
    return true;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"execute", "queued", "refused", "corrupt", "echo", "unexpected"};
    static const char *const CLASSES[] = {"", "interpreted", "immediate", "query"};
    struct laser_controller_event event;
    size_t length;
    if (print_taken(is_first))
        return true;
    if (!laser_controller_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind == LASER_CONTROLLER_EXECUTE) {
        print(",\"class\":\"%s\",\"word\":%u", CLASSES[event.word_class], event.word);
        const uint8_t *parameters = laser_controller_parameters(&session, &length);
        print_parameters(parameters, length);
    } else if (event.kind == LASER_CONTROLLER_QUEUED) {
        print(",\"count\":%zu", event.count);
    } else if (event.kind == LASER_CONTROLLER_REFUSED) {
        print(",\"refusal\":\"%s\"", laser_words_name(event.refusal));
    } else if (event.kind == LASER_CONTROLLER_CORRUPT) {
        print(",\"error\":");
        print_laser_error(event.error, event.error_offset, event.expected, event.found);
    } else if (event.kind == LASER_CONTROLLER_LINE_ECHO) {
        print_line_echo(&event.echo);
    }
    print("}");
    return true;
}

const struct end LASER_CONTROLLER = {END("laser-eb90", "controller")};
