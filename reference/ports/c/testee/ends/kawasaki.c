#include "../kawasaki.h"

#include <string.h>

#define MAX_ENTRIES 32

static struct kawasaki_entry entries[MAX_ENTRIES];
static struct kawasaki_place places[MAX_ENTRIES][2][KAWASAKI_MAX_FIELDS];
static struct kawasaki_job_field layout[KAWASAKI_OWN_FIELDS];
static char names[KAWASAKI_OWN_FIELDS][32];
/* Where the texts of a configuration and of jobs are. */
static uint8_t characters[1 << 16];
static size_t characters_used;

static const char *const ROLES[] = {"order_start", "order_ack",       "job",     "job_ack", "job_request", "pause",
                                    "order_end",   "order_interrupt", "end_ack", "status",  "filler",      "command"};
static const char *const FIELDS[] = {"unused", "",       "work",     "order", "ended",
                                     "phase",  "number", "queued", "executed", "value"};

static bool read_text(const struct json *value, struct kawasaki_msg_text *text)
{
    uint8_t *at = characters + characters_used;
    long length = json_latin1(value, at, sizeof characters - characters_used);
    *text = (struct kawasaki_msg_text){at, length < 0 ? 0 : (size_t)length};
    characters_used += text->length;
    return length >= 0;
}

static bool read_place(const struct json *value, struct kawasaki_place *place)
{
    memset(place, 0, sizeof *place);
    if (value->length > 0 && value->text[0] == '=') {
        place->field = KAWASAKI_CONSTANT;
        if (!read_text(value, &place->constant))
            return false;
        place->constant.bytes++, place->constant.length--;
        return true;
    }
    for (unsigned field = 0; field < KAWASAKI_FIELDS; field++)
        if (json_is(value, FIELDS[field])) {
            place->field = (enum kawasaki_field)field;
            return true;
        }
    return false;
}

static bool read_places(const struct json *list, struct kawasaki_place *out, size_t *count)
{
    *count = 0;
    for (const struct json *value = list == NULL ? NULL : list->child; value != NULL; value = value->next)
        if (*count == KAWASAKI_MAX_FIELDS || !read_place(value, &out[(*count)++]))
            return false;
    return true;
}

/* The role of a key, and the number of a command. */
static bool read_role(const struct json *spec, enum kawasaki_role *role, uint8_t *command)
{
    static const char COMMAND[] = "command_";
    size_t length = sizeof COMMAND - 1;
    *command = 0;
    if (spec->key_length > length && memcmp(spec->key, COMMAND, length) == 0) {
        *role = KAWASAKI_COMMAND;
        for (; length < spec->key_length; length++)
            *command = (uint8_t)(*command * 10 + (spec->key[length] - '0'));
        return true;
    }
    for (unsigned i = 0; i < KAWASAKI_COMMAND; i++)
        if (strlen(ROLES[i]) == spec->key_length && memcmp(ROLES[i], spec->key, spec->key_length) == 0) {
            *role = (enum kawasaki_role)i;
            return true;
        }
    return false;
}

/* One message in the place of that of the table, or behind it. */
static bool read_entry(const struct json *spec, size_t *count)
{
    enum kawasaki_role role;
    uint8_t command;
    size_t at = 0;
    if (!read_role(spec, &role, &command))
        return false;
    while (at < *count && (entries[at].role != role || entries[at].command != command))
        at++;
    if (spec->type == 'n') {
        if (at < *count)
            entries[at] = entries[--*count];
        return true;
    }
    if (at == MAX_ENTRIES)
        return false;
    *count += at == *count;
    struct kawasaki_entry *entry = &entries[at];
    struct kawasaki_place(*of)[KAWASAKI_MAX_FIELDS] = places[role == KAWASAKI_COMMAND ? at : role];
    *entry = (struct kawasaki_entry){.role = role, .command = command, .header = of[0], .fields = of[1]};
    return read_text(json_get(spec, "name"), &entry->name) && read_places(json_get(spec, "header"), of[0], &entry->header_count) &&
           read_places(json_get(spec, "fields"), of[1], &entry->field_count);
}

/* A number of a range, as a count of its last decimal. */
static bool read_count(const struct json *value, unsigned places_of, int32_t *count)
{
    int64_t number = 0;
    unsigned decimals = 0;
    bool has_point = false, is_negative = value->length > 0 && value->text[0] == '-';
    for (size_t i = is_negative; i < value->length; i++) {
        if (value->text[i] == '.') {
            has_point = true;
            continue;
        }
        if (value->text[i] < '0' || value->text[i] > '9' || number > INT32_MAX)
            return false;
        number = number * 10 + (value->text[i] - '0');
        decimals += has_point;
    }
    for (; decimals < places_of; decimals++)
        number *= 10;
    *count = (int32_t)(is_negative ? -number : number);
    return number <= (int64_t)INT32_MAX + is_negative && decimals == places_of;
}

static bool read_job_field(const struct json *spec, struct kawasaki_job_field *field, char *name)
{
    const struct json *kind = json_get(spec, "kind");
    unsigned places_of = 0;
    long length = json_utf8(json_get(spec, "name"), name, sizeof names[0] - 1);
    read_unsigned(spec, "places", UINT8_MAX, &places_of);
    *field = (struct kawasaki_job_field){.name = name, .places = (uint8_t)places_of};
    field->kind = json_is(kind, "text") ? KAWASAKI_TEXT : json_is(kind, "decimal") ? KAWASAKI_DECIMAL : KAWASAKI_WHOLE;
    const struct json *range = json_get(spec, field->kind == KAWASAKI_TEXT ? "length" : "range");
    if (length < 0 || range == NULL || range->count != 2)
        return false;
    name[length] = 0;
    return read_count(range->child, places_of, &field->low) && read_count(range->child->next, places_of, &field->high);
}

bool read_kawasaki_dialect(const struct json *config, struct kawasaki_dialect *dialect)
{
    const struct json *messages = json_get(config, "messages"), *job = json_get(config, "job");
    size_t count = KAWASAKI_DIALECT.entry_count;
    characters_used = 0;
    *dialect = KAWASAKI_DIALECT;
    dialect->is_latin1 = json_is(json_get(config, "charset"), "latin1");
    memcpy(entries, KAWASAKI_DIALECT.entries, count * sizeof *entries);
    for (const struct json *spec = messages == NULL ? NULL : messages->child; spec != NULL; spec = spec->next)
        if (!read_entry(spec, &count))
            return false;
    dialect->entries = entries;
    dialect->entry_count = count;
    if (job == NULL)
        return true;
    dialect->job = layout;
    dialect->job_count = 0;
    for (const struct json *spec = job->child; spec != NULL; spec = spec->next) {
        size_t at = dialect->job_count++;
        if (at == KAWASAKI_OWN_FIELDS || !read_job_field(spec, &layout[at], names[at]))
            return false;
    }
    return true;
}

void read_kawasaki_limits(const struct json *config, struct kawasaki_limits *limits)
{
    const struct json *object = json_get(config, "limits");
    unsigned element = (unsigned)limits->element, packet = (unsigned)limits->packet;
    read_unsigned(object, "element", UINT16_MAX, &element);
    read_unsigned(object, "packet", UINT16_MAX, &packet);
    *limits = (struct kawasaki_limits){element, packet};
}

bool read_kawasaki_job(const struct kawasaki_dialect *dialect, const struct json *job, struct kawasaki_value *values)
{
    for (size_t i = 0; i < dialect->job_count; i++) {
        const struct json *value = json_get(job, dialect->job[i].name);
        int64_t number = 0;
        values[i] = (struct kawasaki_value){.is_missing = value == NULL};
        if (value == NULL)
            continue;
        bool is_text = dialect->job[i].kind == KAWASAKI_TEXT;
        if (is_text ? !read_text(value, &values[i].text) : !json_integer(value, INT32_MIN, INT32_MAX, &number))
            return false;
        values[i].number = (int32_t)number;
    }
    return true;
}

void print_kawasaki_job(const struct kawasaki_dialect *dialect, const struct kawasaki_value *values)
{
    print("{");
    for (size_t i = 0; i < dialect->job_count; i++) {
        print("%s\"%s\":", i > 0 ? "," : "", dialect->job[i].name);
        if (dialect->job[i].kind == KAWASAKI_TEXT)
            print_kawasaki_text(&values[i].text);
        else
            print("%ld", (long)values[i].number);
    }
    print("}");
}

/* A number with decimals as a text, any other as it is. */
static void print_shown(const char *key, const struct kawasaki_job_field *field, int64_t value)
{
    long long size = value < 0 ? -value : value, unit = 1;
    for (unsigned i = 0; i < field->places; i++)
        unit *= 10;
    if (field->kind == KAWASAKI_DECIMAL)
        print(",\"%s\":\"%s%lld.%0*lld\"", key, value < 0 ? "-" : "", size / unit, (int)field->places, size % unit);
    else
        print(",\"%s\":%lld", key, (long long)value);
}

static void print_unfit(const struct kawasaki_fault *fault)
{
    static const char *const KINDS[] = {"missing",  "not_a_number", "too_precise", "out_of_range",
                                        "reserved", "character",    "length"};
    const struct kawasaki_job_field *field = fault->field;
    bool is_found = fault->unfit == KAWASAKI_UNFIT_OUT_OF_RANGE || fault->unfit == KAWASAKI_UNFIT_LENGTH;
    print("\"field\":\"%s\",\"fault\":{\"kind\":\"%s\"", field->name, KINDS[fault->unfit]);
    if (fault->unfit == KAWASAKI_UNFIT_TOO_PRECISE)
        print(",\"places\":%u", field->places);
    if (fault->unfit == KAWASAKI_UNFIT_RESERVED)
        print(",\"found\":%lld", (long long)fault->found);
    if (fault->unfit == KAWASAKI_UNFIT_CHARACTER)
        print(",\"found\":\"\\u%04x\"", (unsigned)fault->found);
    if (is_found)
        print_shown("found", field, fault->found);
    if (is_found || fault->unfit == KAWASAKI_UNFIT_NOT_A_NUMBER) {
        print_shown("min", field, field->low);
        print_shown("max", field, field->high);
    }
    print("}");
}

static void print_fault(const struct kawasaki_fault *fault)
{
    static const char *const KINDS[] = {"unknown_name", "header",       "field_count", "not_the_constant", "not_a_number",
                                        "out_of_range", "job_too_long", "field",       "not_expected",     "wrong_order",
                                        "out_of_order", "repeated",     "jobs_missing", "queue_full"};
    const struct kawasaki_msg_text name = {fault->name, fault->name_length};
    long long expected = fault->expected, found = fault->found;
    print(",\"error\":{\"kind\":\"%s\"", KINDS[fault->kind]);
    switch (fault->kind) {
    case KAWASAKI_UNKNOWN_NAME:
        print(",\"name\":");
        print_kawasaki_text(&name);
        break;
    case KAWASAKI_HEADER:
        print(",\"value\":%zu", fault->place);
        break;
    case KAWASAKI_NOT_THE_CONSTANT:
    case KAWASAKI_NOT_A_NUMBER:
        print(",\"field\":%zu", fault->place);
        break;
    case KAWASAKI_OUT_OF_RANGE:
        print(",\"field\":%zu,\"found\":%lld", fault->place, found);
        print(",\"min\":%lld,\"max\":%lld", (long long)fault->min, (long long)fault->max);
        break;
    case KAWASAKI_JOB_TOO_LONG:
        print(",\"found\":%lld,\"limit\":1024", found);
        break;
    case KAWASAKI_UNFIT:
        print(",");
        print_unfit(fault);
        break;
    case KAWASAKI_NOT_EXPECTED:
        print(fault->role == KAWASAKI_COMMAND ? ",\"role\":{\"%s\":%u}" : ",\"role\":\"%s\"", ROLES[fault->role], fault->command);
        break;
    case KAWASAKI_WRONG_ORDER:
        print(",\"active\":%lld,\"found\":%lld", expected, found);
        break;
    case KAWASAKI_JOBS_MISSING:
        print(",\"order\":%u,\"expected\":%lld", fault->order, expected);
        break;
    case KAWASAKI_NO_SLOT:
        print(",\"number\":%lld", found);
        break;
    default:
        print(",\"expected\":%lld,\"found\":%lld", expected, found);
    }
    print("}");
}

/* A number, or none. */
static void print_number(const char *key, uint64_t number)
{
    if (number == 0)
        print(",\"%s\":null", key);
    else
        print(",\"%s\":%llu", key, (unsigned long long)number);
}

static void print_status(const struct kawasaki_event *event, bool is_robot)
{
    static const char *const PHASES[] = {"idle", "starting", "active", "ending", "interrupted", "alarm"};
    if (event->phase < sizeof PHASES / sizeof *PHASES)
        print(",\"order\":%u,\"phase\":\"%s\"", event->order, PHASES[event->phase]);
    else
        print(",\"order\":%u,\"phase\":{\"other\":%u}", event->order, event->phase);
    print_number(is_robot ? "sent" : "queued", event->number);
    print_number("executed", event->executed);
}

void print_kawasaki_event(bool is_first, const struct kawasaki_event *event, bool is_robot)
{
    static const char *const NAMES[] = {
        "connect", "disconnect", "order_started", "order_ending", "order_interrupted", "order_over", "outcome_unknown", "alarm",
        "command", "order_refused", "job_unfit", "progress", "executed_ahead", "paused", "peer_status", "queue_full",
        "queue_drained", "queue_cleared", "recovery", "no_reply", "corrupt", "rejected", "unexpected"};
    static const char *const STEPS[] = {"resend", "pause", "clear"};
    unsigned long long executed = event->executed, queued = event->queued, sent = event->sent, index = event->index;
    begin_event(is_first, NAMES[event->kind]);
    switch (event->kind) {
    case KAWASAKI_ORDER_STARTED:
    case KAWASAKI_ORDER_ENDING:
    case KAWASAKI_ORDER_INTERRUPTED:
        print(",\"order\":%u", event->order);
        break;
    case KAWASAKI_ORDER_OVER:
        print(",\"order\":%u,\"executed\":%llu", event->order, executed);
        print(is_robot ? "" : event->complete ? ",\"complete\":true" : ",\"complete\":false");
        break;
    case KAWASAKI_OUTCOME_UNKNOWN:
        print(",\"order\":%u,\"executed\":%llu,\"sent\":%llu", event->order, executed, sent);
        break;
    case KAWASAKI_ALARM:
        print(",\"order\":%u,\"next\":%u", event->order, event->number);
        break;
    case KAWASAKI_COMMANDED:
        print(event->has_value ? ",\"id\":%u,\"value\":%ld" : ",\"id\":%u,\"value\":null", event->id, (long)event->value);
        print(is_robot ? "" : ",\"outcome\":\"%s\"", event->is_transmitted ? "transmitted" : "unknown");
        break;
    case KAWASAKI_ORDER_REFUSED:
        print(",\"order\":%u,\"active\":%u", event->order, event->active);
        print(is_robot ? "" : event->given_up ? ",\"given_up\":true" : ",\"given_up\":false");
        break;
    case KAWASAKI_JOB_UNFIT:
        print(",\"order\":%u,\"index\":%llu,\"error\":{", event->order, index);
        print_unfit(&event->fault);
        print("}");
        break;
    case KAWASAKI_PROGRESS:
        print(",\"executed\":%llu,\"queued\":%llu", executed, queued);
        break;
    case KAWASAKI_EXECUTED_AHEAD:
        print(",\"index\":%llu", index);
        break;
    case KAWASAKI_PAUSED:
        print(",\"queued\":%llu", queued);
        break;
    case KAWASAKI_PEER_STATUS:
        print_status(event, is_robot);
        break;
    case KAWASAKI_QUEUE_FULL:
        print_number("last", event->number);
        break;
    case KAWASAKI_RECOVERY:
        print(",\"step\":\"%s\"", STEPS[event->step]);
        /* fall through */
    case KAWASAKI_QUEUE_DRAINED:
    case KAWASAKI_QUEUE_CLEARED:
        print(",\"next\":%u", event->number);
        break;
    case KAWASAKI_CORRUPT:
        print(",");
        print_kawasaki_error(&event->error, event->length);
        break;
    case KAWASAKI_REJECTED:
        print_fault(&event->fault);
        break;
    default:
        break;
    }
    print("}");
}
