/* Section 6 of reference/fanuc-hmi-modbus.md. */
#include "cellwire/fanuc_hmi_modbus.h"

#include "bytes.h"

#define MBAP_LEN 7
#define COIL_ON 0xFF00
#define EXCEPTION 0x80
#define MAX_WORDS 125 /* of function 8 */
#define MAX_OWN 250   /* bytes of function 17 */
#define MAX_LOG 64    /* events of function 12 */
#define MAX_QUEUE 31
#define IDENTIFICATION 14

static bool is_quantity(uint16_t quantity, uint16_t most) { return quantity >= 1 && quantity <= most; }

/* A run of addresses that the function allows (FM-36). */
static bool is_run(uint16_t address, uint16_t quantity, uint16_t most)
{
    return is_quantity(quantity, most) && (uint32_t)address + quantity <= 0x10000;
}

static size_t put_u16(uint8_t *pdu, size_t at, uint16_t value)
{
    put_u16_be(pdu + at, value);
    return at + 2;
}

/* A byte count and bits; the unused ones are 0 (FM-8). */
static size_t put_bits(uint8_t *pdu, size_t at, const struct modbus_message *message)
{
    size_t count = (message->quantity + 7u) / 8u;
    pdu[at++] = (uint8_t)count;
    memcpy(pdu + at, message->bytes, count);
    at += count;
    if (message->quantity % 8 != 0)
        pdu[at - 1] &= (uint8_t)((1u << message->quantity % 8) - 1);
    return at;
}

static size_t put_registers(uint8_t *pdu, size_t at, const struct modbus_message *message)
{
    pdu[at++] = (uint8_t)(2 * message->quantity);
    for (size_t i = 0; i < message->quantity; i++)
        at = put_u16(pdu, at, message->registers[i]);
    return at;
}

/* How many objects there are (FM-97); -1: the last one is not whole. */
static int count_objects(const struct modbus_message *message)
{
    int count = 0;
    size_t at = 0;
    for (; at + 1 < message->quantity; at += 2u + message->bytes[at + 1])
        count++;
    return at == message->quantity ? count : -1;
}

static bool is_shape(const struct modbus_message *message)
{
    uint8_t function = message->function;
    uint16_t most = modbus_max_read(function), quantity = message->quantity;
    bool is_written = is_run(message->address, quantity, modbus_max_write(function));
    switch (message->shape) {
    case MODBUS_READ:
        return function <= 4 && is_run(message->address, quantity, most);
    case MODBUS_WRITE_COIL:
        return function == 5;
    case MODBUS_WRITE_REGISTER:
        return function == 6;
    case MODBUS_WRITE_COILS:
        return function == 15 && is_written;
    case MODBUS_WRITE_WORDS:
        return function == 16 && is_written;
    case MODBUS_MASK:
        return function == 22;
    case MODBUS_READ_WRITE:
        return function == 23 && is_run(message->address, message->read_quantity, most) &&
               is_run(message->write_address, quantity, modbus_max_write(function));
    case MODBUS_BITS:
        return function <= 2 && is_quantity(quantity, most);
    case MODBUS_REGISTERS:
        return function > 2 && is_quantity(quantity, most);
    case MODBUS_WRITTEN:
        return (function == 15 || function == 16) && is_written;
    case MODBUS_EXCEPTION:
        return function >= 1 && function < EXCEPTION;
    case MODBUS_SERVER_ID:
        return function == 17 && is_quantity(quantity, MAX_OWN);
    case MODBUS_IDENTIFICATION:
        return function == 43 && quantity <= MODBUS_MAX_OBJECTS && count_objects(message) >= 0;
    case MODBUS_DIAGNOSTIC:
        return function == 8 && is_quantity(quantity, MAX_WORDS);
    case MODBUS_BARE:
        return function == 7 || function == 11 || function == 12 || function == 17;
    case MODBUS_READ_QUEUE:
        return function == 24;
    case MODBUS_STATUS:
        return function == 7 && message->status <= UINT8_MAX;
    case MODBUS_COUNTER:
        return function == 11;
    case MODBUS_EVENT_LOG:
        return function == 12 && quantity <= MAX_LOG;
    case MODBUS_RANGES:
    case MODBUS_CONTENTS:
        return function == 20 && modbus_has_runs(message);
    case MODBUS_RECORDS:
        return function == 21 && modbus_has_runs(message);
    case MODBUS_QUEUE:
        return function == 24 && quantity <= MAX_QUEUE;
    case MODBUS_IDENTIFY:
        return function == 43;
    case MODBUS_RAW:
        break;
    }
    bool is_other = function == 43 ? quantity == 0 || message->bytes[0] != IDENTIFICATION : !modbus_is_named(function);
    return function != 0 && function < EXCEPTION && is_other && quantity <= MODBUS_MAX_DATA;
}

/* The PDU of a message that is_shape. */
static size_t put_pdu(uint8_t *pdu, const struct modbus_message *message)
{
    size_t at = 1;
    pdu[0] = message->function;
    switch (message->shape) {
    case MODBUS_EXCEPTION:
        pdu[0] = message->function | EXCEPTION;
        pdu[at++] = message->exception;
        return at;
    case MODBUS_RANGES:
    case MODBUS_CONTENTS:
    case MODBUS_RECORDS:
    case MODBUS_SERVER_ID:
        pdu[at++] = (uint8_t)message->quantity;
        memcpy(pdu + at, message->bytes, message->quantity);
        return at + message->quantity;
    case MODBUS_IDENTIFICATION:
        pdu[at++] = IDENTIFICATION;
        pdu[at++] = message->category;
        pdu[at++] = message->conformity;
        pdu[at++] = message->more ? 0xFF : 0;
        pdu[at++] = message->next;
        pdu[at++] = (uint8_t)count_objects(message);
        memcpy(pdu + at, message->bytes, message->quantity);
        return at + message->quantity;
    case MODBUS_STATUS:
        pdu[at++] = (uint8_t)message->status;
        return at;
    case MODBUS_COUNTER:
        return put_u16(pdu, put_u16(pdu, at, message->status), message->events);
    case MODBUS_EVENT_LOG:
        pdu[at++] = (uint8_t)(6 + message->quantity);
        at = put_u16(pdu, put_u16(pdu, put_u16(pdu, at, message->status), message->events), message->messages);
        memcpy(pdu + at, message->bytes, message->quantity);
        return at + message->quantity;
    case MODBUS_READ_QUEUE:
        return put_u16(pdu, at, message->address);
    case MODBUS_QUEUE:
    case MODBUS_DIAGNOSTIC:
        if (message->shape == MODBUS_QUEUE)
            at = put_u16(pdu, at, (uint16_t)(2 + 2 * message->quantity));
        at = put_u16(pdu, at, message->shape == MODBUS_QUEUE ? message->quantity : message->subfunction);
        for (size_t i = 0; i < message->quantity; i++)
            at = put_u16(pdu, at, message->registers[i]);
        return at;
    case MODBUS_BARE:
        return at;
    case MODBUS_IDENTIFY:
        pdu[at++] = IDENTIFICATION;
        pdu[at++] = message->category;
        pdu[at++] = message->object;
        return at;
    case MODBUS_RAW:
        memcpy(pdu + at, message->bytes, message->quantity);
        return at + message->quantity;
    case MODBUS_BITS:
        return put_bits(pdu, at, message);
    case MODBUS_REGISTERS:
        return put_registers(pdu, at, message);
    case MODBUS_READ:
    case MODBUS_WRITTEN:
        return put_u16(pdu, put_u16(pdu, at, message->address), message->quantity);
    case MODBUS_WRITE_COIL:
        return put_u16(pdu, put_u16(pdu, at, message->address), message->coil ? COIL_ON : 0);
    case MODBUS_WRITE_REGISTER:
        return put_u16(pdu, put_u16(pdu, at, message->address), message->value);
    case MODBUS_MASK:
        return put_u16(pdu, put_u16(pdu, put_u16(pdu, at, message->address), message->and_mask), message->or_mask);
    case MODBUS_WRITE_COILS:
        return put_bits(pdu, put_u16(pdu, put_u16(pdu, at, message->address), message->quantity), message);
    case MODBUS_WRITE_WORDS:
        return put_registers(pdu, put_u16(pdu, put_u16(pdu, at, message->address), message->quantity), message);
    case MODBUS_READ_WRITE:
        break;
    }
    at = put_u16(pdu, put_u16(pdu, at, message->address), message->read_quantity);
    return put_registers(pdu, put_u16(pdu, put_u16(pdu, at, message->write_address), message->quantity), message);
}

size_t modbus_encode(const struct modbus_message *message, enum modbus_framing framing, uint8_t *out, size_t size)
{
    uint8_t body[MODBUS_MAX_LEN];
    if (!is_shape(message))
        return 0;
    body[0] = message->unit;
    size_t length = 1 + put_pdu(body + 1, message);
    bool is_tcp = framing == MODBUS_TCP;
    size_t head = is_tcp ? MBAP_LEN - 1 : 0, tail = is_tcp ? 0 : 2;
    if (head + length + tail > size)
        return 0;
    memcpy(out + head, body, length);
    if (is_tcp) {
        put_u16_be(out, message->transaction);
        put_u16_be(out + 2, 0);
        put_u16_be(out + 4, (uint16_t)length);
    } else {
        put_u16_le(out + length, modbus_crc(body, length));
    }
    return head + length + tail;
}
