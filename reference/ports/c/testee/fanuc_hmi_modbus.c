#include "cellwire/fanuc_hmi_modbus.h"

#include <string.h>

#include "link.h"

static struct modbus_decoder decoder;

static bool begin(const struct json *request)
{
    const struct json *framing = json_get(json_get(request, "options"), "framing");
    modbus_init(&decoder, json_is(json_get(request, "from"), "client") ? MODBUS_CLIENT : MODBUS_SERVER,
                json_is(framing, "rtu") ? MODBUS_RTU : MODBUS_TCP);
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return modbus_push(&decoder, data, size); }

static void end(void) { modbus_end(&decoder); }

static void print_bits(const char *name, const struct modbus_message *message)
{
    print(",\"%s\":[", name);
    for (size_t i = 0; i < message->quantity; i++)
        print("%s%s", i > 0 ? "," : "", message->bytes[i / 8] >> i % 8 & 1 ? "true" : "false");
    print("]");
}

static void print_registers(const char *name, const struct modbus_message *message)
{
    print(",\"%s\":", name);
    PRINT_LIST(message->registers, message->quantity);
}

static void print_identification(const struct modbus_message *message)
{
    print(",\"category\":%d,\"conformity\":%d", message->category, message->conformity);
    print(",\"more\":%s,\"next\":%d,\"objects\":[", message->more ? "true" : "false", message->next);
    for (size_t at = 0; at < message->quantity; at += 2u + message->bytes[at + 1]) {
        print("%s{\"id\":%d,\"text\":\"", at > 0 ? "," : "", message->bytes[at]);
        for (size_t i = 0; i < message->bytes[at + 1]; i++)
            print("\\u%04x", message->bytes[at + 2 + i]);
        print("\"}");
    }
    print("]");
}

static unsigned u16_at(const uint8_t *bytes) { return bytes[0] * 256u + bytes[1]; }

static void print_words(const uint8_t *bytes, size_t count)
{
    print("[");
    for (size_t i = 0; i < count; i++)
        print("%s%u", i > 0 ? "," : "", u16_at(bytes + 2 * i));
    print("]");
}

static void print_runs(const struct modbus_message *message)
{
    bool is_contents = message->shape == MODBUS_CONTENTS, is_write = message->shape == MODBUS_RECORDS;
    print(",\"%s\":[", is_contents ? "contents" : is_write ? "records" : "ranges");
    for (size_t at = 0; at < message->quantity;) {
        const uint8_t *run = message->bytes + at;
        print("%s", at > 0 ? "," : "");
        if (is_contents) {
            print_words(run + 2, run[0] / 2u);
            at += 1u + run[0];
            continue;
        }
        print("{\"file\":%u,\"record\":%u,", u16_at(run + 1), u16_at(run + 3));
        print(is_write ? "\"values\":" : "\"quantity\":%u", u16_at(run + 5));
        if (is_write)
            print_words(run + 7, u16_at(run + 5));
        at += 7 + (is_write ? 2 * u16_at(run + 5) : 0);
        print("}");
    }
    print("]");
}

void print_modbus_message(const struct modbus_message *message, bool has_transaction)
{
    print("{\"unit\":%d,\"function\":%d", message->unit, message->function);
    if (has_transaction)
        print(",\"transaction\":%d", message->transaction);
    if (message->shape < MODBUS_BITS || message->shape == MODBUS_WRITTEN)
        print(",\"address\":%d", message->address);
    switch (message->shape) {
    case MODBUS_READ:
    case MODBUS_WRITTEN:
        /* Both have these keys; of another function than theirs they are shown without. */
        if ((message->shape == MODBUS_READ) == (modbus_max_read(message->function) > 0))
            print(",\"quantity\":%d", message->quantity);
        break;
    case MODBUS_WRITE_COIL:
        print(",\"value\":%s", message->coil ? "true" : "false");
        break;
    case MODBUS_WRITE_REGISTER:
        print(",\"value\":%d", message->value);
        break;
    case MODBUS_WRITE_COILS:
        print_bits("values", message);
        break;
    case MODBUS_MASK:
        print(",\"and\":%d,\"or\":%d", message->and_mask, message->or_mask);
        break;
    case MODBUS_READ_WRITE:
        print(",\"quantity\":%d,\"write_address\":%d", message->read_quantity, message->write_address);
        print_registers("values", message);
        break;
    case MODBUS_WRITE_WORDS:
        print_registers("values", message);
        break;
    case MODBUS_BITS:
        print_bits("bits", message);
        break;
    case MODBUS_REGISTERS:
        print_registers("registers", message);
        break;
    case MODBUS_EXCEPTION:
        print(",\"exception\":%d", message->exception);
        break;
    case MODBUS_RAW:
    case MODBUS_SERVER_ID:
        print(",\"%s\":", message->shape == MODBUS_RAW ? "data" : "id");
        PRINT_LIST(message->bytes, message->quantity);
        break;
    case MODBUS_DIAGNOSTIC:
        print(",\"subfunction\":%d", message->subfunction);
        print_registers("values", message);
        break;
    case MODBUS_STATUS:
        print(",\"status\":%d", message->status);
        break;
    case MODBUS_COUNTER:
    case MODBUS_EVENT_LOG:
        print(",\"status\":%d,\"events\":%d", message->status, message->events);
        if (message->shape == MODBUS_COUNTER)
            break;
        print(",\"messages\":%d,\"log\":", message->messages);
        PRINT_LIST(message->bytes, message->quantity);
        break;
    case MODBUS_QUEUE:
        print_registers("registers", message);
        break;
    case MODBUS_CONTENTS:
    case MODBUS_RANGES:
    case MODBUS_RECORDS:
        print_runs(message);
        break;
    case MODBUS_IDENTIFICATION:
        print_identification(message);
        break;
    case MODBUS_IDENTIFY:
        print(",\"category\":%d,\"object\":%d", message->category, message->object);
        break;
    case MODBUS_READ_QUEUE:
    case MODBUS_BARE:
        break;
    }
    print("}");
}

void print_modbus_error(const struct modbus_fault *item)
{
    static const char *const KINDS[] = {
        "",         "protocol",   "mbap_length",      "crc",       "cut", "too_long", "noise", "function", "pdu_length",
        "quantity", "byte_count", "reply_byte_count", "reference_type", "coil_value", "more_follows", "exception_length"};
    enum modbus_error_kind kind = item->kind;
    bool is_exception = kind == MODBUS_EXCEPTION_LENGTH;
    bool has_expected =
        kind == MODBUS_CRC || kind == MODBUS_CUT || kind == MODBUS_PDU_LENGTH || kind == MODBUS_BYTE_COUNT || is_exception;
    bool has_function = (kind >= MODBUS_PDU_LENGTH && kind <= MODBUS_REFERENCE_TYPE) || is_exception;
    print("{\"kind\":\"%s\"", KINDS[kind]);
    if (is_exception)
        print(",\"transaction\":%d,\"unit\":%d,\"exception\":%d", item->transaction, item->unit, item->exception);
    if (has_function)
        print(",\"function\":%d", item->function);
    if (has_expected || kind == MODBUS_QUANTITY)
        print(",\"%s\":%zu", has_expected ? "expected" : "max", item->expected);
    if (kind != MODBUS_NOISE)
        print(",\"found\":%zu", item->found);
    if (kind == MODBUS_CRC || kind == MODBUS_NOISE)
        print(",\"length\":%zu", item->size);
    print("}");
}

static bool next(bool ended)
{
    static struct modbus_item item;
    if (!modbus_next(&decoder, &item))
        return false;
    print_item(item.offset, item.length, ended);
    if (item.error == MODBUS_NO_ERROR) {
        print("\"message\":");
        print_modbus_message(&item.message, decoder.framing == MODBUS_TCP);
        return true;
    }
    struct modbus_fault fault = modbus_fault_of(&item);
    print("\"error\":");
    print_modbus_error(&fault);
    return true;
}

static bool read_u16(const struct json *object, const char *name, uint16_t *value)
{
    int64_t found;
    if (!json_integer(json_get(object, name), 0, UINT16_MAX, &found))
        return false;
    *value = (uint16_t)found;
    return true;
}

static bool read_u8(const struct json *object, const char *name, uint8_t *value)
{
    uint16_t found;
    if (!read_u16(object, name, &found) || found > UINT8_MAX)
        return false;
    *value = (uint8_t)found;
    return true;
}

/* true, false, 1 or 0 */
static bool read_bit(const struct json *value, bool *bit)
{
    int64_t number = 0;
    if (json_boolean(value, bit))
        return true;
    bool is_number = json_integer(value, 0, 1, &number);
    *bit = number == 1;
    return is_number;
}

static bool read_bits(const struct json *list, struct modbus_message *message)
{
    if (list == NULL || list->type != '[' || list->count > 8 * MODBUS_MAX_DATA)
        return false;
    message->quantity = 0;
    /* Those behind the last one are set: the encoder has to write 0. */
    memset(message->bytes, 0xFF, sizeof message->bytes);
    for (const struct json *value = list->child; value != NULL; value = value->next, message->quantity++) {
        bool bit;
        if (!read_bit(value, &bit))
            return false;
        if (!bit)
            message->bytes[message->quantity / 8] &= (uint8_t)~(1u << message->quantity % 8);
    }
    return true;
}

/* One byte more than a PDU has is read as well: it is the encoder that refuses it. */
static bool read_data(const struct json *list, struct modbus_message *message)
{
    int64_t values[MODBUS_MAX_DATA + 1];
    if (list == NULL || list->count > MODBUS_MAX_DATA + 1 || !read_list(list, list->count, 0, UINT8_MAX, values))
        return false;
    message->quantity = (uint16_t)list->count;
    for (size_t i = 0; i < list->count && i < MODBUS_MAX_DATA; i++)
        message->bytes[i] = (uint8_t)values[i];
    return true;
}

/* 1 to 250 bytes, and one more: it is the encoder that refuses it. */
static bool read_objects(const struct json *list, struct modbus_message *message)
{
    if (list == NULL || list->type != '[')
        return false;
    message->quantity = 0;
    for (const struct json *object = list->child; object != NULL; object = object->next) {
        uint8_t *to = message->bytes + message->quantity;
        size_t room = sizeof message->bytes - message->quantity;
        if (object->type != '{' || object->count != 2 || room < 2 || !read_u8(object, "id", to))
            return false;
        long size = json_latin1(json_get(object, "text"), to + 2, room - 2);
        if (size < 0)
            return false;
        to[1] = (uint8_t)size;
        message->quantity = (uint16_t)(message->quantity + 2 + size);
    }
    return true;
}

static bool read_registers(const struct json *list, struct modbus_message *message)
{
    int64_t values[MODBUS_MAX_REGISTERS];
    if (list == NULL || list->count > MODBUS_MAX_REGISTERS || !read_list(list, list->count, 0, UINT16_MAX, values))
        return false;
    message->quantity = (uint16_t)list->count;
    for (size_t i = 0; i < list->count; i++)
        message->registers[i] = (uint16_t)values[i];
    return true;
}

static bool put_u16(uint8_t *to, const struct json *value)
{
    int64_t found;
    if (!json_integer(value, 0, UINT16_MAX, &found))
        return false;
    to[0] = (uint8_t)(found >> 8);
    to[1] = (uint8_t)found;
    return true;
}

/* Registers of a run, at most as many as a PDU has and one more. */
static bool put_words(uint8_t *to, const struct json *list)
{
    if (list == NULL || list->type != '[' || list->count > MODBUS_MAX_REGISTERS)
        return false;
    for (const struct json *value = list->child; value != NULL; value = value->next, to += 2)
        if (!put_u16(to, value))
            return false;
    return true;
}

static bool read_runs(const struct json *list, struct modbus_message *message)
{
    bool is_contents = message->shape == MODBUS_CONTENTS, is_write = message->shape == MODBUS_RECORDS;
    if (list == NULL || list->type != '[')
        return false;
    message->quantity = 0;
    for (const struct json *run = list->child; run != NULL; run = run->next) {
        uint8_t bytes[7 + 2 * MODBUS_MAX_REGISTERS] = {6};
        const struct json *values = is_contents ? run : json_get(run, "values");
        size_t count = (is_contents || is_write) && values != NULL ? values->count : 0, size = 7 + 2 * count;
        if (is_contents) {
            if (!put_words(bytes + 2, values) || count > UINT8_MAX / 2)
                return false;
            size = 2 + 2 * count;
            bytes[0] = (uint8_t)(1 + 2 * count);
            bytes[1] = 6;
        } else {
            if (run->type != '{' || run->count != 3 || !put_u16(bytes + 1, json_get(run, "file")) ||
                !put_u16(bytes + 3, json_get(run, "record")))
                return false;
            bytes[6] = (uint8_t)count;
            if (is_write ? !put_words(bytes + 7, values) : !put_u16(bytes + 5, json_get(run, "quantity")))
                return false;
        }
        if (message->quantity + size > sizeof message->bytes)
            return false;
        memcpy(message->bytes + message->quantity, bytes, size);
        message->quantity = (uint16_t)(message->quantity + size);
    }
    return true;
}

/* Bits are true and false, and for the function that writes them 1 and 0 as well. */
static bool is_bit(const struct json *value, uint8_t function, uint8_t writer)
{
    bool bit;
    return function == writer ? read_bit(value, &bit) : json_boolean(value, &bit);
}

/* What the keys of an object are; whether the function has them is the encoder's to say. */
static bool read_shape(const struct json *object, struct modbus_message *message)
{
    bool is_client = decoder.side == MODBUS_CLIENT;
    const struct json *value = json_get(object, "value"), *values = json_get(object, "values");
    if (json_get(object, "data") != NULL)
        message->shape = MODBUS_RAW;
    else if (json_get(object, "subfunction") != NULL)
        message->shape = MODBUS_DIAGNOSTIC;
    else if (!is_client && json_get(object, "id") != NULL)
        message->shape = MODBUS_SERVER_ID;
    else if (is_client && json_get(object, "ranges") != NULL)
        message->shape = MODBUS_RANGES;
    else if (json_get(object, "records") != NULL)
        message->shape = MODBUS_RECORDS;
    else if (!is_client && json_get(object, "contents") != NULL)
        message->shape = MODBUS_CONTENTS;
    else if (!is_client && json_get(object, "log") != NULL)
        message->shape = MODBUS_EVENT_LOG;
    else if (!is_client && json_get(object, "events") != NULL)
        message->shape = MODBUS_COUNTER;
    else if (!is_client && json_get(object, "status") != NULL)
        message->shape = MODBUS_STATUS;
    else if (!is_client && json_get(object, "objects") != NULL)
        message->shape = MODBUS_IDENTIFICATION;
    else if (is_client && json_get(object, "category") != NULL)
        message->shape = MODBUS_IDENTIFY;
    else if (!is_client && json_get(object, "exception") != NULL)
        message->shape = MODBUS_EXCEPTION;
    else if (!is_client && json_get(object, "bits") != NULL)
        message->shape = MODBUS_BITS;
    else if (!is_client && json_get(object, "registers") != NULL)
        message->shape = message->function == 24 ? MODBUS_QUEUE : MODBUS_REGISTERS;
    else if (json_get(object, "and") != NULL)
        message->shape = MODBUS_MASK;
    else if (value != NULL)
        message->shape = is_bit(value, message->function, 5) ? MODBUS_WRITE_COIL : MODBUS_WRITE_REGISTER;
    else if (is_client && json_get(object, "write_address") != NULL)
        message->shape = MODBUS_READ_WRITE;
    else if (is_client && values != NULL)
        message->shape = is_bit(values->child, message->function, 15) ? MODBUS_WRITE_COILS : MODBUS_WRITE_WORDS;
    else if (json_get(object, "quantity") != NULL)
        message->shape = is_client ? MODBUS_READ : MODBUS_WRITTEN;
    else if (is_client && json_get(object, "address") != NULL)
        message->shape = MODBUS_READ_QUEUE;
    else if (is_client)
        message->shape = MODBUS_BARE;
    else
        return false;
    return true;
}

/* How many keys a message has beside unit, function and transaction. */
static size_t keys_of(enum modbus_shape shape)
{
    switch (shape) {
    case MODBUS_READ_WRITE:
    case MODBUS_EVENT_LOG:
        return 4;
    case MODBUS_MASK:
        return 3;
    case MODBUS_READ_QUEUE:
    case MODBUS_STATUS:
    case MODBUS_CONTENTS:
    case MODBUS_RANGES:
    case MODBUS_RECORDS:
    case MODBUS_QUEUE:
    case MODBUS_BITS:
    case MODBUS_REGISTERS:
    case MODBUS_EXCEPTION:
    case MODBUS_SERVER_ID:
    case MODBUS_RAW:
        return 1;
    case MODBUS_IDENTIFICATION:
        return 5;
    case MODBUS_BARE:
        return 0;
    default:
        return 2;
    }
}

static bool read_fields(const struct json *object, struct modbus_message *message)
{
    const struct json *values = json_get(object, "values");
    size_t head = json_get(object, "transaction") == NULL ? 2 : 3;
    if (!read_shape(object, message) || object->count != head + keys_of(message->shape))
        return false;
    bool has_address = message->shape < MODBUS_BITS || message->shape == MODBUS_WRITTEN;
    if (has_address && !read_u16(object, "address", &message->address))
        return false;
    switch (message->shape) {
    case MODBUS_READ:
    case MODBUS_WRITTEN:
        return read_u16(object, "quantity", &message->quantity);
    case MODBUS_WRITE_COIL:
        return read_bit(json_get(object, "value"), &message->coil);
    case MODBUS_WRITE_REGISTER:
        return read_u16(object, "value", &message->value);
    case MODBUS_WRITE_COILS:
        return read_bits(values, message);
    case MODBUS_WRITE_WORDS:
        return read_registers(values, message);
    case MODBUS_MASK:
        return read_u16(object, "and", &message->and_mask) && read_u16(object, "or", &message->or_mask);
    case MODBUS_READ_WRITE:
        return read_u16(object, "quantity", &message->read_quantity) &&
               read_u16(object, "write_address", &message->write_address) && read_registers(values, message);
    case MODBUS_BITS:
        return read_bits(json_get(object, "bits"), message);
    case MODBUS_REGISTERS:
        return read_registers(json_get(object, "registers"), message);
    case MODBUS_EXCEPTION:
        return read_u8(object, "exception", &message->exception);
    case MODBUS_RAW:
        return read_data(json_get(object, "data"), message);
    case MODBUS_SERVER_ID:
        return read_data(json_get(object, "id"), message);
    case MODBUS_DIAGNOSTIC:
        return read_u16(object, "subfunction", &message->subfunction) && read_registers(values, message);
    case MODBUS_IDENTIFICATION:
        return read_u8(object, "category", &message->category) && read_u8(object, "conformity", &message->conformity) &&
               read_bit(json_get(object, "more"), &message->more) && read_u8(object, "next", &message->next) &&
               read_objects(json_get(object, "objects"), message);
    case MODBUS_STATUS:
    case MODBUS_COUNTER:
        return read_u16(object, "status", &message->status) &&
               (message->shape == MODBUS_STATUS || read_u16(object, "events", &message->events));
    case MODBUS_EVENT_LOG:
        return read_u16(object, "status", &message->status) && read_u16(object, "events", &message->events) &&
               read_u16(object, "messages", &message->messages) && read_data(json_get(object, "log"), message);
    case MODBUS_CONTENTS:
        return read_runs(json_get(object, "contents"), message);
    case MODBUS_RANGES:
        return read_runs(json_get(object, "ranges"), message);
    case MODBUS_RECORDS:
        return read_runs(json_get(object, "records"), message);
    case MODBUS_QUEUE:
        return read_registers(json_get(object, "registers"), message);
    case MODBUS_READ_QUEUE:
    case MODBUS_BARE:
        return true;
    case MODBUS_IDENTIFY:
        return read_u8(object, "category", &message->category) && read_u8(object, "object", &message->object);
    }
    return false;
}

bool read_modbus_request(const struct json *object, struct modbus_message *message)
{
    /* A reply is read as well: it is the client that refuses it. */
    bool is_reply = json_get(object, "exception") != NULL || json_get(object, "bits") != NULL || json_get(object, "registers") != NULL ||
                    json_get(object, "id") != NULL || json_get(object, "objects") != NULL || json_get(object, "contents") != NULL ||
                    json_get(object, "status") != NULL;
    decoder.side = is_reply ? MODBUS_SERVER : MODBUS_CLIENT;
    return read_u8(object, "unit", &message->unit) && read_u8(object, "function", &message->function) &&
           json_get(object, "transaction") == NULL && read_fields(object, message);
}

static size_t encode(const struct json *object, uint8_t *out, size_t size)
{
    static struct modbus_message message;
    memset(&message, 0, sizeof message);
    bool has_head = read_u8(object, "unit", &message.unit) && read_u8(object, "function", &message.function) &&
                    (decoder.framing == MODBUS_RTU ? json_get(object, "transaction") == NULL
                                                   : read_u16(object, "transaction", &message.transaction));
    if (!has_head || !read_fields(object, &message))
        return 0;
    size_t length = modbus_encode(&message, decoder.framing, out, size);
    /* It fits its length, and no less. */
    bool is_exact = length > 0 && modbus_encode(&message, decoder.framing, out, length - 1) == 0 &&
                    modbus_encode(&message, decoder.framing, out, length) == length;
    return is_exact ? length : 0;
}

const struct link FANUC_HMI_MODBUS = {"fanuc-hmi-modbus", begin, push, end, next, encode};
