/* The testee of the C port: reference/ports/README.md describes what it reads and writes. */
#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "end.h"

#define MAX_LINE (1 << 22)

static const struct link *const LINKS[] = {&FANUC_HMI_MODBUS, &ISRA_BALL,  &KAWASAKI_MSG, &LASER_EB90,
                                           &MMACELL_PROTO,    &VAL2_ALTER, &VAL2_VIEWER};
static const struct end *const ENDS[] = {
    &ALTER_CONTROLLER, &ALTER_HOST, &BALL,            &BALL_HOST,      &KAWASAKI_PC,       &KAWASAKI_ROBOT,    &LASER_CONTROLLER,
    &LASER_HOST,       &VIEWER_HOST, &MMACELL_CENTRAL, &MMACELL_DEVICE, &MODBUS_CLIENT_END, &MODBUS_SERVER_END, &VIEWER_WORKSTATION};
static char line[MAX_LINE];
static bool is_first; /* of the items of an answer */

void print(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
}

void print_item(uint64_t offset, size_t length, bool ended)
{
    print("%s{", is_first ? "" : ",");
    is_first = false;
    print("\"offset\":%llu,\"length\":%zu,%s", (unsigned long long)offset, length, ended ? "\"end\":true," : "");
}

bool read_list(const struct json *list, size_t count, int64_t low, int64_t high, int64_t *values)
{
    if (list == NULL || list->type != '[' || list->count != count)
        return false;
    for (const struct json *value = list->child; value != NULL; value = value->next)
        if (!json_integer(value, low, high, values++))
            return false;
    return true;
}

/* Prints all items that the decoder has. */
static void drain(const struct link *link, bool ended)
{
    while (link->next(ended))
        print("}");
}

/* The next byte of the hex digits; -1: an end, -2: no more. */
static int next_byte(const char **at, const char *end)
{
    static const char DIGITS[] = "0123456789ABCDEF";
    int value = 0, count = 0;
    for (; *at < end; ++*at) {
        if (**at == ' ')
            continue;
        if (**at == '|') {
            ++*at;
            return -1;
        }
        const char *digit = strchr(DIGITS, toupper((unsigned char)**at));
        value = value << 4 | (int)(digit == NULL ? 0 : digit - DIGITS);
        if (++count == 2) {
            ++*at;
            return value;
        }
    }
    return -2;
}

/* Gives a read of bytes to the decoder. */
static void give(const struct link *link, const uint8_t *data, size_t size)
{
    while (size > 0) {
        size_t taken = link->push(data, size);
        drain(link, false);
        data += taken;
        size -= taken;
    }
}

static void decode(const struct link *link, const struct json *request)
{
    static uint8_t data[MAX_LINE / 2];
    const struct json *hex = json_get(request, "hex");
    int64_t read = 0;
    json_integer(json_get(request, "read"), 0, MAX_LINE, &read);
    is_first = true;
    print("{\"items\":[");
    size_t length = 0;
    const char *at = hex->text, *end = hex->text + hex->length;
    for (int byte = 0; byte != -2;) {
        byte = next_byte(&at, end);
        if (byte >= 0)
            data[length++] = (uint8_t)byte;
        if (byte < 0 || (int64_t)length == read) {
            give(link, data, length);
            length = 0;
        }
        if (byte == -1) {
            link->end();
            drain(link, true);
        }
    }
    print("]}\n");
}

static void encode(const struct link *link, const struct json *request)
{
    static uint8_t out[MAX_FRAME];
    size_t length = link->encode(json_get(request, "message"), out, sizeof out);
    if (length == 0) {
        print("{\"refused\":\"no message that this side sends\"}\n");
        return;
    }
    print("{\"hex\":\"");
    for (size_t i = 0; i < length; i++)
        print("%02X", out[i]);
    print("\"}\n");
}

/* Whether there was one. */
static bool print_events(const struct end *end, bool *is_first_event)
{
    bool is_any = false;
    for (; end->event(*is_first_event); is_any = true)
        *is_first_event = false;
    return is_any;
}

/* Gives bytes in pieces, until a session whose events stay takes no more; whether an event was taken. */
static bool give_input(const struct end *end, uint64_t now, const struct json *hex, bool takes, bool *is_first_event)
{
    static uint8_t data[MAX_LINE / 2];
    bool is_any = false;
    size_t length = 0, taken = 1;
    const char *at = hex->text, *stop = hex->text + hex->length;
    for (int byte = next_byte(&at, stop); byte >= 0; byte = next_byte(&at, stop))
        data[length++] = (uint8_t)byte;
    for (size_t given = 0; given < length && taken > 0; given += taken) {
        taken = end->input(now, data + given, length - given);
        if (takes && print_events(end, is_first_event))
            is_any = true;
    }
    return is_any;
}

/* One step of a story, as reference/README.md describes it. */
static void play(const struct end *end, const struct json *step)
{
    static uint8_t out[MAX_FRAME];
    static char sent[8 * MAX_FRAME];
    const struct json *input = json_get(step, "do")->child;
    char name[32] = "";
    int64_t now = 0;
    uint64_t deadline;
    bool is_taken = true, is_first_event = true, was_event = false, goes_on = true;
    bool takes = !json_true(json_get(step, "keep")), sends = !json_true(json_get(step, "hold"));
    size_t sent_len = 0;
    json_integer(json_get(step, "at"), 0, INT64_MAX, &now);
    memcpy(name, input->key, input->key_length < sizeof name ? input->key_length : 0);
    print("{\"events\":[");
    if (strcmp(name, "connected") == 0)
        end->connected((uint64_t)now);
    else if (strcmp(name, "disconnected") == 0)
        end->disconnected((uint64_t)now);
    else if (strcmp(name, "input") == 0)
        was_event = give_input(end, (uint64_t)now, input, takes, &is_first_event);
    else if (strcmp(name, "timeout") == 0)
        end->timeout((uint64_t)now);
    else if (strcmp(name, "transmitted") == 0 && end->transmitted != NULL)
        end->transmitted((uint64_t)now);
    else if (strcmp(name, "transmitted") != 0 && strcmp(name, "nothing") != 0)
        is_taken = end->call((uint64_t)now, name, input);
    /* All events, then all that is to be sent, until neither was there. */
    while (goes_on) {
        goes_on = (takes && print_events(end, &is_first_event)) || was_event;
        was_event = false;
        while (sends) {
            size_t length = end->transmit((uint64_t)now, out, sizeof out);
            if (length == 0 || sent_len + 2 * length + 4 > sizeof sent)
                break;
            sent_len += (size_t)sprintf(sent + sent_len, "%s\"", sent_len > 0 ? "," : "");
            for (size_t i = 0; i < length; i++)
                sent_len += (size_t)sprintf(sent + sent_len, "%02X", out[i]);
            sent_len += (size_t)sprintf(sent + sent_len, "\"");
            goes_on = true;
        }
    }
    print("],%s", is_taken ? "" : "\"refused\":{\"kind\":\"refused\"},");
    print("\"transmit\":[%.*s],\"deadline\":", (int)sent_len, sent);
    if (end->deadline(&deadline))
        print("%llu}", (unsigned long long)deadline);
    else
        print("null}");
}

static void session(const struct end *end, const struct json *request)
{
    const struct json *steps = json_get(request, "steps");
    print("{\"steps\":[");
    for (const struct json *step = steps->child; step != NULL; step = step->next) {
        print(step == steps->child ? "" : ",");
        play(end, step);
    }
    print("]}\n");
}

static bool begin(const struct end *end, const struct json *request)
{
    is_out_of_range = false;
    return end->begin(json_get(request, "config")) && !is_out_of_range;
}

static const struct end *find_end(const struct json *request)
{
    for (size_t i = 0; i < sizeof ENDS / sizeof *ENDS; i++)
        if (json_is(json_get(request, "link"), ENDS[i]->link) && json_is(json_get(request, "end"), ENDS[i]->name))
            return ENDS[i];
    return NULL;
}

static const struct link *find_link(const struct json *name)
{
    for (size_t i = 0; i < sizeof LINKS / sizeof *LINKS; i++)
        if (json_is(name, LINKS[i]->name))
            return LINKS[i];
    return NULL;
}

int main(void)
{
    while (fgets(line, sizeof line, stdin) != NULL) {
        const struct json *request = json_parse(line), *task = json_get(request, "task");
        const struct link *link = find_link(json_get(request, "link"));
        bool decodes = json_is(task, "decode") || json_is(task, "stream");
        const struct end *end = find_end(request);
        if (json_is(task, "session") && end != NULL && !begin(end, request))
            print("{\"refused\":\"the configuration\"}\n");
        else if (json_is(task, "session") && end != NULL)
            session(end, request);
        else if (link == NULL || !(decodes || json_is(task, "encode")) || !link->begin(request))
            print("{\"skipped\":\"not implemented\"}\n");
        else if (decodes)
            decode(link, request);
        else
            encode(link, request);
        fflush(stdout);
    }
    return 0;
}
