#include "cellwire/modbus_server.h"

#include <string.h>

#include "../end.h"

#define TABLE 100
#define BUSY 6

ADAPT(modbus_server)

/* The server of the stories: coils, discrete inputs, which are the coils turned round, and holding registers. */
static bool coils[TABLE];
static uint16_t registers[TABLE];

/* In 16 bits: no request that the server lets through reaches beyond the last address. */
static bool is_there(unsigned address, unsigned quantity) { return (uint16_t)(address + quantity - 1) < TABLE; }

static void read_coils(const struct modbus_message *request, struct modbus_message *reply)
{
    reply->shape = MODBUS_BITS;
    reply->quantity = request->quantity;
    for (unsigned i = 0; i < request->quantity; i++)
        if (coils[request->address + i] == (request->function == 1))
            reply->bytes[i / 8] = (uint8_t)(reply->bytes[i / 8] | 1u << i % 8);
}

static void read_registers(unsigned address, uint16_t quantity, struct modbus_message *reply)
{
    reply->shape = MODBUS_REGISTERS;
    reply->quantity = quantity;
    memcpy(reply->registers, registers + address, quantity * sizeof *registers);
}

static uint8_t write(const struct modbus_message *request, struct modbus_message *reply)
{
    unsigned address = request->address, quantity = request->quantity;
    *reply = *request;
    switch (request->shape) {
    case MODBUS_WRITE_COIL:
        if (!is_there(address, 1))
            return 2;
        coils[address] = request->coil;
        return 0;
    case MODBUS_WRITE_REGISTER:
        if (!is_there(address, 1))
            return 2;
        registers[address] = request->value;
        return 0;
    case MODBUS_MASK:
        if (!is_there(address, 1))
            return 2;
        registers[address] = (uint16_t)((registers[address] & request->and_mask) | (request->or_mask & ~request->and_mask));
        return 0;
    case MODBUS_WRITE_COILS:
        if (!is_there(address, quantity))
            return 2;
        for (unsigned i = 0; i < quantity; i++)
            coils[address + i] = request->bytes[i / 8] >> i % 8 & 1;
        break;
    default:
        if (!is_there(address, quantity))
            return 2;
        memcpy(registers + address, request->registers, quantity * sizeof *registers);
    }
    reply->shape = MODBUS_WRITTEN;
    return 0;
}

/* What it says of itself. */
static const struct object {
    uint8_t id;
    const char *value;
    uint8_t length;
} OBJECTS[] = {{0, "cellwire", 8}, {1, "FM", 2}, {2, "1.0", 3}, {3, "", 0}, {128, NULL, 230}, {129, "\xFC", 1}, {130, NULL, 244}};
#define OBJECT_COUNT (sizeof OBJECTS / sizeof *OBJECTS)

static bool has_object(uint8_t id)
{
    for (size_t i = 0; i < OBJECT_COUNT; i++)
        if (OBJECTS[i].id == id)
            return true;
    return false;
}

/* FM-98 */
static uint8_t identify(const struct modbus_message *request, struct modbus_message *reply)
{
    static const uint8_t LAST[] = {0, 2, 0x7F, 0xFF};
    uint8_t category = request->category, object = request->object, last = object;
    if (category == 0 || category > 4)
        return 3;
    if (category < 4)
        last = LAST[category];
    else if (!has_object(object))
        return 2;
    uint8_t first = object <= last && has_object(object) ? object : 0;
    reply->shape = MODBUS_IDENTIFICATION;
    reply->category = category;
    reply->conformity = 0x83;
    for (size_t i = 0; i < OBJECT_COUNT && !reply->more; i++) {
        const struct object *it = &OBJECTS[i];
        uint8_t *to = reply->bytes + reply->quantity;
        if (it->id < first || it->id > last)
            continue;
        if (reply->quantity + 2 + it->length > MODBUS_MAX_OBJECTS) {
            reply->more = true;
            reply->next = it->id;
            continue;
        }
        to[0] = it->id;
        to[1] = it->length;
        if (it->value == NULL)
            memset(to + 2, it->id == 128 ? 'x' : 'y', it->length);
        else
            memcpy(to + 2, it->value, it->length);
        reply->quantity = (uint16_t)(reply->quantity + 2 + it->length);
    }
    return 0;
}

static uint8_t diagnose(const struct modbus_message *request, struct modbus_message *reply)
{
    *reply = *request;
    if (request->subfunction == 11)
        reply->registers[0] = 7;
    return request->subfunction == 0 || request->subfunction == 11 ? 0 : 1;
}

/* FM-104: file 4 is the table of holding registers. */
static uint8_t serve_files(const struct modbus_message *request, struct modbus_message *reply)
{
    bool is_write = request->function == 21;
    reply->shape = is_write ? MODBUS_RECORDS : MODBUS_CONTENTS;
    for (int pass = is_write ? 0 : 1; pass < 2; pass++)
        for (size_t at = 0; at < request->quantity;) {
            const uint8_t *run = request->bytes + at;
            unsigned file = run[1] * 256u + run[2], record = run[3] * 256u + run[4], quantity = run[5] * 256u + run[6];
            uint8_t *to = reply->bytes + reply->quantity;
            at += 7 + (is_write ? 2 * quantity : 0);
            if (record + quantity > 0x10000)
                return 2;
            if (pass == 0)
                continue;
            if (file != 4 || !is_there(record, quantity))
                return 2;
            if (!is_write) {
                *to++ = (uint8_t)(1 + 2 * quantity);
                *to++ = 6;
                reply->quantity = (uint16_t)(reply->quantity + 2 + 2 * quantity);
            }
            for (unsigned i = 0; i < quantity; i++) {
                uint16_t *word = registers + record + i;
                if (is_write) {
                    *word = (uint16_t)(run[7 + 2 * i] << 8 | run[8 + 2 * i]);
                    continue;
                }
                *to++ = (uint8_t)(*word >> 8);
                *to++ = (uint8_t)*word;
            }
        }
    if (is_write)
        *reply = *request;
    return 0;
}

static uint8_t serve_queue(unsigned address, struct modbus_message *reply)
{
    reply->shape = MODBUS_QUEUE;
    if (address == 1246) {
        reply->quantity = 2;
        reply->registers[0] = 440;
        reply->registers[1] = 4740;
    }
    return address == 1248 ? 3 : address == 1246 || address == 1247 ? 0 : 2;
}

static uint8_t serve(void *context, const struct modbus_message *request, struct modbus_message *reply)
{
    unsigned address = request->address;
    (void)context;
    switch (request->function) {
    case 1:
    case 2:
        if (!is_there(address, request->quantity))
            return 2;
        read_coils(request, reply);
        return 0;
    case 3:
        if (!is_there(address, request->quantity))
            return 2;
        read_registers(address, request->quantity, reply);
        return 0;
    case 23:
        if (!is_there(address, request->read_quantity) || !is_there(request->write_address, request->quantity))
            return 2;
        memcpy(registers + request->write_address, request->registers, request->quantity * sizeof *registers);
        read_registers(address, request->read_quantity, reply);
        return 0;
    case 5:
    case 6:
    case 15:
    case 16:
    case 22:
        return write(request, reply);
    case 8:
        return diagnose(request, reply);
    case 7:
        reply->shape = MODBUS_STATUS;
        reply->status = 0x6D;
        return 0;
    case 11:
    case 12:
        reply->shape = request->function == 11 ? MODBUS_COUNTER : MODBUS_EVENT_LOG;
        reply->events = 264;
        reply->messages = 289;
        reply->bytes[0] = 0x20;
        reply->quantity = 2;
        return 0;
    case 20:
    case 21:
        return serve_files(request, reply);
    case 24:
        return serve_queue(address, reply);
    case 17:
        reply->shape = MODBUS_SERVER_ID;
        reply->bytes[0] = 0x11;
        reply->bytes[1] = 0xFF;
        reply->quantity = 2;
        return 0;
    case 43:
        return request->shape == MODBUS_IDENTIFY ? identify(request, reply) : 1;
    case 65:
        *reply = *request;
        return 0;
    case 66:
        reply->shape = MODBUS_RAW;
        reply->quantity = MODBUS_MAX_DATA + 1;
        return 0;
    case 67:
        return BUSY;
    default:
        return 1;
    }
}

static struct modbus_server_config config;

static bool init(unsigned places)
{
    config.places = places;
    return modbus_server_init(&session, &config);
}

static bool begin(const struct json *object)
{
    const struct json *unit = json_get(object, "unit");
    unsigned baud = 19200;
    read_unsigned(object, "baud", UINT32_MAX, &baud);
    config = modbus_server_default(read_modbus_line(object), baud);
    if (unit != NULL) {
        unsigned number = 0; /* which is not looked at without a unit */
        config.has_unit = unit->type == '0';
        read_unsigned(object, "unit", UINT8_MAX, &number);
        config.unit = (uint8_t)number;
    }
    if (json_get(object, "broadcast") != NULL)
        config.broadcast = json_true(json_get(object, "broadcast"));
    read_unsigned(object, "places", MODBUS_SERVER_PLACES, &config.places);
    read_time(object, "silence", &config.silence);
    read_time(object, "stall", &config.silence);
    read_time(object, "frame_timeout", &config.frame_timeout);
    config.echo = json_true(json_get(object, "echo"));
    config.owner.serve = serve;
    for (unsigned i = 0; i < TABLE; i++) {
        coils[i] = i % 3 == 0;
        registers[i] = (uint16_t)(7 * i);
    }
    if (config.framing == MODBUS_LINE_TCP)
        config.silence = 0; /* which is not looked at */
    unsigned places = config.places;
    bool is_bounded = !init(0) && !init(MODBUS_SERVER_PLACES + 1) && init(1);
    return init(places) && is_bounded;
}

static bool call(uint64_t now, const char *name, const struct json *argument)
{
    (void)now, (void)name, (void)argument;
    return false;
}

static bool event(bool is_first)
{
    static const char *const NAMES[] = {"served", "refused", "corrupt", "out_of_step", "echo", "unexpected"};
    struct modbus_server_event event;
    if (!modbus_server_event(&session, &event))
        return false;
    begin_event(is_first, NAMES[event.kind]);
    if (event.kind <= MODBUS_SERVER_REFUSED)
        print(",\"unit\":%u,\"function\":%u", event.unit, event.function);
    if (event.kind == MODBUS_SERVER_SERVED && session.config.framing == MODBUS_LINE_TCP)
        print(",\"transaction\":%u", event.transaction);
    if (event.exception != 0)
        print(",\"exception\":%u", event.exception);
    if (event.kind == MODBUS_SERVER_CORRUPT || event.kind == MODBUS_SERVER_OUT_OF_STEP) {
        print(",\"error\":");
        print_modbus_error(&event.error);
    }
    if (event.kind == MODBUS_SERVER_LINE_ECHO)
        print_line_echo(&event.echo);
    print("}");
    return true;
}

const struct end MODBUS_SERVER_END = {END("fanuc-hmi-modbus", "server")};
