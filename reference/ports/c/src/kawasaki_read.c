/* What a message means (section 5.2), and how one is written (section 6). */
#include "bytes.h"
#include "kawasaki.h"

static const struct {
    int32_t low, high;
    bool may_be_empty;
} RANGES[KAWASAKI_FIELDS] = {
    [KAWASAKI_ORDER] = {0, 65535, false},   [KAWASAKI_ENDED] = {0, 65535, true},    [KAWASAKI_PHASE] = {0, 255, false},
    [KAWASAKI_NUMBER] = {1, 9999, false},   [KAWASAKI_QUEUED] = {1, 9999, true},    [KAWASAKI_EXECUTED] = {1, 9999, true},
    [KAWASAKI_VALUE] = {INT32_MIN, INT32_MAX, false},
};

static bool wrong(struct kawasaki_fault *fault, enum kawasaki_fault_kind kind, size_t place)
{
    fault->kind = kind;
    fault->place = place;
    return false;
}

/* KM-35, step 4 */
static bool read_field(const struct kawasaki_place *place, struct kawasaki_msg_text text, size_t at, struct found *found,
                       struct kawasaki_fault *fault)
{
    enum kawasaki_field field = place->field;
    int32_t value;
    if (field == KAWASAKI_UNUSED)
        return true;
    if (field == KAWASAKI_CONSTANT) {
        bool is_it = text.length == place->constant.length &&
                     (text.length == 0 || memcmp(text.bytes, place->constant.bytes, text.length) == 0);
        return is_it || wrong(fault, KAWASAKI_NOT_THE_CONSTANT, at);
    }
    if (text.length == 0 && RANGES[field].may_be_empty)
        return true;
    if (!kawasaki_number(text, &value))
        return wrong(fault, KAWASAKI_NOT_A_NUMBER, at);
    if (value < RANGES[field].low || value > RANGES[field].high) {
        fault->found = value;
        fault->min = RANGES[field].low;
        fault->max = RANGES[field].high;
        return wrong(fault, KAWASAKI_OUT_OF_RANGE, at);
    }
    found->is_there[field] = true;
    found->values[field] = value;
    return true;
}

static bool read_header(const struct kawasaki_entry *entry, const struct kawasaki_msg_item *item, struct found *found,
                        struct kawasaki_fault *fault)
{
    struct kawasaki_msg_text text;
    size_t at = 0;
    for (size_t i = 0; i < entry->header_count; i++) {
        bool is_there = item->has_header && kawasaki_msg_value(&item->header, &at, &text);
        if (!is_there || !read_field(&entry->header[i], text, i, found, fault))
            return wrong(fault, KAWASAKI_HEADER, i);
    }
    if (entry->header_count > 0 && kawasaki_msg_value(&item->header, &at, &text))
        return wrong(fault, KAWASAKI_HEADER, entry->header_count);
    return true;
}

static size_t count_values(const struct kawasaki_msg_text *values)
{
    struct kawasaki_msg_text value;
    size_t at = 0, count = 0;
    while (kawasaki_msg_value(values, &at, &value))
        count++;
    return count;
}

/* So many values from `*at` on, as one text. */
static void skip_own(const struct kawasaki_msg_text *values, size_t *at, struct found *found)
{
    struct kawasaki_msg_text value = {values->bytes, 0};
    size_t begin = *at;
    for (size_t i = 0; i < found->own_count; i++)
        kawasaki_msg_value(values, at, &value);
    found->own = (struct kawasaki_msg_text){values->bytes + begin, found->own_count > 0 ? *at - 1 - begin : 0};
}

/* Whether no field is read as one empty field (KM-37). */
static bool is_one_empty(const struct kawasaki_entry *entry)
{
    if (entry->field_count != 1)
        return false;
    enum kawasaki_field field = entry->fields[0].field;
    return field == KAWASAKI_UNUSED || RANGES[field].may_be_empty;
}

static bool read_fields(const struct kawasaki_entry *entry, const struct kawasaki_msg_text *values, struct found *found,
                        struct kawasaki_fault *fault)
{
    bool has_own = kawasaki_entry_has(entry, KAWASAKI_WORK);
    size_t count = values->length > 0 || is_one_empty(entry) ? count_values(values) : 0;
    size_t fixed = entry->field_count - has_own, at = 0;
    fault->expected = (int64_t)entry->field_count;
    fault->found = (int64_t)count;
    if (has_own && count < fixed)
        return wrong(fault, KAWASAKI_FIELD_COUNT, 0);
    found->own_count = has_own ? count - fixed : 0;
    size_t place = 0;
    for (size_t i = 0; i < entry->field_count; i++) {
        struct kawasaki_msg_text text;
        if (entry->fields[i].field == KAWASAKI_WORK) {
            skip_own(values, &at, found);
            place += found->own_count;
            continue;
        }
        if (place >= count)
            return wrong(fault, KAWASAKI_FIELD_COUNT, 0);
        kawasaki_msg_value(values, &at, &text);
        if (!read_field(&entry->fields[i], text, place, found, fault))
            return false;
        place++;
    }
    return place == count || wrong(fault, KAWASAKI_FIELD_COUNT, 0);
}

bool kawasaki_read(const struct kawasaki_dialect *dialect, const struct kawasaki_msg_item *item, struct found *found,
                   struct kawasaki_fault *fault)
{
    const struct kawasaki_entry *entry = NULL;
    memset(found, 0, sizeof *found);
    memset(fault, 0, sizeof *fault);
    for (size_t i = 0; i < dialect->entry_count && entry == NULL; i++) {
        struct kawasaki_msg_text name = dialect->entries[i].name;
        if (name.length == item->name.length && memcmp(name.bytes, item->name.bytes, name.length) == 0)
            entry = &dialect->entries[i];
    }
    if (entry == NULL) {
        fault->name_length = item->name.length < KAWASAKI_NAME_SHOWN ? item->name.length : KAWASAKI_NAME_SHOWN;
        memcpy(fault->name, item->name.bytes, fault->name_length);
        return wrong(fault, KAWASAKI_UNKNOWN_NAME, 0);
    }
    found->entry = entry;
    return read_header(entry, item, found, fault) && read_fields(entry, &item->fields, found, fault);
}

/* Where a message is written; without `out` its bytes are counted. */
struct writer {
    uint8_t *out;
    size_t length;
};

static void put(struct writer *writer, const void *bytes, size_t length)
{
    if (writer->out != NULL && length > 0)
        memcpy(writer->out + writer->length, bytes, length);
    writer->length += length;
}

static void put_number(struct writer *writer, int32_t value)
{
    uint8_t digits[MAX_DIGITS + 2];
    put(writer, digits, kawasaki_put_number(digits, value, 0));
}

/* A list of fields, with `$` before the first one if `is_header`. A command has no phase. */
static void put_list(struct writer *writer, const struct kawasaki_place *list, size_t count, const struct values *values,
                     bool is_header, bool is_command)
{
    for (size_t i = 0; i < count; i++) {
        enum kawasaki_field field = list[i].field;
        bool may_be_empty = RANGES[field].may_be_empty || field == KAWASAKI_NUMBER || (is_command && field == KAWASAKI_PHASE);
        if (i > 0 || is_header)
            put(writer, "$", 1);
        if (field == KAWASAKI_CONSTANT)
            put(writer, list[i].constant.bytes, list[i].constant.length);
        else if (field == KAWASAKI_WORK)
            put(writer, values->own.bytes, values->own.length);
        else if (field != KAWASAKI_UNUSED && (values->of[field] != 0 || !may_be_empty))
            put_number(writer, values->of[field]);
    }
}

static void put_message(struct writer *writer, const struct kawasaki_entry *entry, const struct values *values)
{
    struct writer data = {NULL, 0};
    bool is_command = entry->role == KAWASAKI_COMMAND;
    put_list(&data, entry->fields, entry->field_count, values, false, is_command);
    put(writer, "<", 1);
    put(writer, entry->name.bytes, entry->name.length);
    put_list(writer, entry->header, entry->header_count, values, true, is_command);
    put(writer, "$", 1);
    put_number(writer, (int32_t)data.length);
    put(writer, "#", 1);
    put_list(writer, entry->fields, entry->field_count, values, false, is_command);
    put(writer, "#>", 2);
}

bool kawasaki_add(struct packet *packet, enum kawasaki_role role, uint8_t command, const struct values *values)
{
    const struct kawasaki_entry *entry = kawasaki_entry(&packet->end->dialect, role, command);
    struct writer size = {NULL, 0}, writer = {packet->out, packet->length};
    if (entry == NULL)
        return true;
    put_message(&size, entry, values);
    if (packet->length + size.length > packet->end->packet)
        return false;
    put_message(&writer, entry, values);
    packet->length = writer.length;
    return true;
}

size_t kawasaki_finish(struct packet *packet)
{
    const struct values none = {{0}, {NULL, 0}};
    if (packet->length == 0)
        kawasaki_add(packet, KAWASAKI_FILLER, 0, &none);
    return packet->length;
}
