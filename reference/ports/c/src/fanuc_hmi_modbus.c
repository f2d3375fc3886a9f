#include "cellwire/fanuc_hmi_modbus.h"

#include "bytes.h"

#define MBAP_LEN 7
#define MIN_BODY 2 /* unit and PDU */
#define MAX_BODY 254
#define SHORTEST_TCP 8
#define EXCEPTION_TCP 9
#define EXCEPTION_BODY 3
#define MIN_RTU 4
#define MAX_RTU 256
#define TCP_EXTENT 504
#define RTU_EXTENT 265
#define COIL_ON 0xFF00
#define EXCEPTION 0x80
#define MAX_REPLY_BYTES 250
#define IDENTIFICATION 14 /* the MEI type of function 43 that has a shape */
#define MORE 0xFF
#define OBJECTS_AT 7
#define MAX_LOG 70   /* bytes of function 12 after its byte count */
#define MAX_QUEUE 31 /* registers of function 24 */
#define REFERENCE 6
#define NO_FRAME SIZE_MAX

uint16_t modbus_crc(const uint8_t *data, size_t length)
{
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < length; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc >> 1 ^ (crc & 1 ? 0xA001 : 0));
    }
    return crc;
}

bool modbus_is_right(const uint8_t *frame, size_t length)
{
    return length >= 4 && length <= MAX_RTU && get_u16_le(frame + length - 2) == modbus_crc(frame, length - 2);
}

uint16_t modbus_max_read(uint8_t function)
{
    return function == 1 || function == 2 ? 2000 : function == 3 || function == 4 || function == 23 ? 125 : 0;
}

uint16_t modbus_max_write(uint8_t function) { return function == 15 ? 1968 : function == 16 ? 123 : 121; }

bool modbus_is_named(uint8_t function)
{
    return modbus_asks(function) || function == 5 || function == 6 || function == 8 || function == 15 || function == 16 ||
           function == 21 || function == 22 || function == 43;
}

/* A request that is its function alone. */
static bool is_bare(uint8_t function) { return function == 7 || function == 11 || function == 12 || function == 17; }

bool modbus_asks(uint8_t function) { return modbus_max_read(function) > 0 || is_bare(function) || function == 20 || function == 24; }

enum length_by { BY_BEGINNING, BY_SILENCE, NOT_KNOWN_YET };

/* The bytes of an RTU frame (FM-10); where they are not known yet, how many are needed to know. */
static enum length_by rtu_length(const uint8_t *frame, size_t length, enum modbus_side side, size_t *size)
{
    size_t base = 0, count_at = 0;
    *size = MIN_RTU;
    if (length < 2)
        return NOT_KNOWN_YET;
    uint8_t function = frame[1];
    bool is_client = side == MODBUS_CLIENT;
    if (function == 22) {
        *size = 10;
    } else if (function == 15 || function == 16) {
        *size = 8;
        base = 9, count_at = is_client ? 6 : 0;
    } else if (function == 23) {
        base = is_client ? 13 : 5, count_at = is_client ? 10 : 2;
    } else if (function == 5 || function == 6) {
        *size = 8;
    } else if (function == 7 || function == 11) {
        *size = is_client ? 4 : function == 7 ? 5 : 8;
    } else if (function == 20 || function == 21) {
        base = 5, count_at = 2;
    } else if (function == 24) {
        *size = 6;
        base = 6, count_at = is_client ? 0 : 3;
    } else if (modbus_max_read(function) > 0 || is_bare(function)) {
        *size = is_bare(function) ? 4 : 8;
        base = 5, count_at = is_client ? 0 : 2;
    } else if (!is_client && function > EXCEPTION) {
        *size = 5;
    } else {
        return BY_SILENCE;
    }
    if (count_at == 0)
        return BY_BEGINNING;
    bool is_there = length > count_at;
    *size = base + (is_there ? frame[count_at] : 0);
    return is_there ? BY_BEGINNING : NOT_KNOWN_YET;
}

/* The first error is the one that is reported. */
static void error(struct modbus_item *item, enum modbus_error_kind kind, size_t expected, size_t found)
{
    if (item->error != MODBUS_NO_ERROR)
        return;
    item->error = kind;
    item->expected = expected;
    item->found = found;
}

/* An error without `expected`. */
static void wrong(struct modbus_item *item, enum modbus_error_kind kind, size_t found) { error(item, kind, 0, found); }

/* What is at the beginning: FRAME of `item->length` bytes, CORRUPT, or WAIT for more bytes. */
enum outcome { FRAME, CORRUPT, WAIT };

static enum outcome corrupt(struct modbus_item *item, enum modbus_error_kind kind, size_t found)
{
    wrong(item, kind, found);
    return CORRUPT;
}

static enum outcome cut(struct modbus_item *item, size_t expected, size_t found)
{
    error(item, MODBUS_CUT, expected, found);
    return CORRUPT;
}

static enum outcome more(const struct modbus_decoder *decoder, size_t expected, struct modbus_item *item)
{
    return decoder->ended ? cut(item, expected, decoder->length) : WAIT;
}

/* Whether the TCP frame that is held is an exception of a function that has two bytes of PDU (FM-89). */
static bool is_exception(const struct modbus_decoder *decoder)
{
    uint8_t code = decoder->length >= SHORTEST_TCP ? decoder->held[MBAP_LEN] : 0, function = code & 0x7F;
    return decoder->side == MODBUS_SERVER && code > EXCEPTION && modbus_is_named(function);
}

/* FM-72 */
static enum outcome take_tcp(const struct modbus_decoder *decoder, struct modbus_item *item)
{
    if (decoder->length < MBAP_LEN - 1)
        return more(decoder, MBAP_LEN, item);
    uint16_t protocol = get_u16_be(decoder->held + 2), length = get_u16_be(decoder->held + 4);
    if (protocol != 0)
        return corrupt(item, MODBUS_PROTOCOL, protocol);
    if (length < MIN_BODY || length > MAX_BODY)
        return corrupt(item, MODBUS_MBAP_LENGTH, length);
    item->length = MBAP_LEN - 1 + (size_t)length;
    if (is_exception(decoder) && item->length > EXCEPTION_TCP)
        item->length = EXCEPTION_TCP;
    return decoder->length < item->length ? more(decoder, item->length, item) : FRAME;
}

/* FM-73 */
static enum outcome take_rtu(const struct modbus_decoder *decoder, struct modbus_item *item)
{
    const uint8_t *held = decoder->held;
    size_t size;
    switch (rtu_length(held, decoder->length, decoder->side, &size)) {
    case NOT_KNOWN_YET:
        return more(decoder, size, item);
    case BY_SILENCE:
        if (decoder->length > MAX_RTU)
            return corrupt(item, MODBUS_TOO_LONG, MAX_RTU + 1);
        if (!decoder->ended)
            return WAIT;
        size = decoder->length;
        if (size < MIN_RTU)
            return cut(item, MIN_RTU, size);
        break;
    case BY_BEGINNING:
        if (size > MAX_RTU)
            return corrupt(item, MODBUS_TOO_LONG, size);
        if (decoder->length < size)
            return more(decoder, size, item);
        break;
    }
    uint16_t expected = modbus_crc(held, size - 2), found = get_u16_le(held + size - 2);
    item->length = item->size = size;
    if (found == expected)
        return FRAME;
    error(item, MODBUS_CRC, expected, found);
    return CORRUPT;
}

/* Where the next frame is, from `start` on; NO_FRAME: nowhere, or that is not known yet. */
static size_t find_tcp(const struct modbus_decoder *decoder, size_t start)
{
    for (size_t at = start; at + MBAP_LEN - 1 <= decoder->length; at++) {
        const uint8_t *header = decoder->held + at;
        uint16_t length = get_u16_be(header + 4);
        size_t size;
        if (get_u16_be(header + 2) != 0 || length < MIN_BODY || length > MAX_BODY)
            continue;
        if (at == start && start > 1)
            return at;
        enum length_by by = rtu_length(header + 6, decoder->length - at - 6, decoder->side, &size);
        if (by == BY_BEGINNING && size == (size_t)length + 2)
            return at;
        /* Behind a place that 520 bytes do not decide none is tried. */
        if (by == NOT_KNOWN_YET && !decoder->ended)
            return NO_FRAME;
    }
    return NO_FRAME;
}

/* The frame with a right CRC that ends first, from `start` on (FM-30). */
static size_t find_rtu(const struct modbus_decoder *decoder, size_t start)
{
    size_t first_end = SIZE_MAX, found = NO_FRAME;
    for (size_t at = start; at < decoder->length; at++) {
        const uint8_t *frame = decoder->held + at;
        size_t left = decoder->length - at, size;
        if (rtu_length(frame, left, decoder->side, &size) != BY_BEGINNING || size > MAX_RTU || size > left)
            continue;
        if (at + size < first_end && get_u16_le(frame + size - 2) == modbus_crc(frame, size - 2)) {
            first_end = at + size;
            found = at;
        }
    }
    return found;
}

/* The bytes before the next frame, which are corrupt; false: that is not known yet. */
static bool extent(struct modbus_decoder *decoder, size_t start, size_t *covered)
{
    bool is_tcp = decoder->framing == MODBUS_TCP;
    *covered = is_tcp ? find_tcp(decoder, start) : find_rtu(decoder, start);
    if (*covered != NO_FRAME)
        return true;
    if (decoder->length == MODBUS_LOOKED_AT) {
        decoder->in_noise = true;
        *covered = is_tcp ? TCP_EXTENT : RTU_EXTENT;
        return true;
    }
    *covered = decoder->length;
    return decoder->ended;
}

/* A PDU that is read from left to right: what it does not hold is an error, and reads as 0. */
struct pdu {
    const uint8_t *data;
    size_t length, at;
    struct modbus_item *item;
};

static void exactly(struct pdu *pdu, size_t expected)
{
    if (pdu->length != expected)
        error(pdu->item, MODBUS_PDU_LENGTH, expected, pdu->length);
}

static bool has(struct pdu *pdu, size_t count)
{
    if (pdu->at + count <= pdu->length)
        return true;
    error(pdu->item, MODBUS_PDU_LENGTH, pdu->at + count, pdu->length);
    return false;
}

static uint8_t get_u8(struct pdu *pdu) { return has(pdu, 1) ? pdu->data[pdu->at++] : 0; }

static uint16_t get_u16(struct pdu *pdu)
{
    if (!has(pdu, 2))
        return 0;
    pdu->at += 2;
    return get_u16_be(pdu->data + pdu->at - 2);
}

static void check_quantity(struct pdu *pdu, uint16_t quantity, uint16_t most)
{
    if (quantity < 1 || quantity > most)
        error(pdu->item, MODBUS_QUANTITY, most, quantity);
}

static void get_bytes(struct pdu *pdu)
{
    for (uint8_t *to = pdu->item->message.bytes; pdu->at < pdu->length; to++)
        *to = get_u8(pdu);
}

static void get_registers(struct pdu *pdu)
{
    for (uint16_t *to = pdu->item->message.registers; pdu->at + 1 < pdu->length; to++)
        *to = get_u16(pdu);
}

/* The quantity, the byte count and the values of a request that writes (FM-12). */
static void get_written_values(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    bool is_bits = message->function == 15;
    message->quantity = get_u16(pdu);
    check_quantity(pdu, message->quantity, modbus_max_write(message->function));
    size_t expected = is_bits ? (message->quantity + 7u) / 8u : 2u * message->quantity;
    uint8_t found = get_u8(pdu);
    if (found != expected)
        error(pdu->item, MODBUS_BYTE_COUNT, expected, found);
    exactly(pdu, pdu->at + found);
    if (is_bits)
        get_bytes(pdu);
    else
        get_registers(pdu);
}

/* Functions 5, 6 and 22, whose replies repeat the request. */
static void decode_single(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    uint8_t function = message->function;
    message->shape = function == 5 ? MODBUS_WRITE_COIL : function == 6 ? MODBUS_WRITE_REGISTER : MODBUS_MASK;
    exactly(pdu, function == 22 ? 7 : 5);
    message->address = get_u16(pdu);
    message->value = message->and_mask = get_u16(pdu);
    message->coil = message->value == COIL_ON;
    if (function == 5 && !message->coil && message->value != 0)
        wrong(pdu->item, MODBUS_COIL_VALUE, message->value);
    if (function == 22)
        message->or_mask = get_u16(pdu);
}

/* A read, or the reply to a write of several: an address and a quantity. */
static void decode_run(struct pdu *pdu, enum modbus_shape shape, uint16_t most)
{
    struct modbus_message *message = &pdu->item->message;
    message->shape = shape;
    exactly(pdu, 5);
    message->address = get_u16(pdu);
    message->quantity = get_u16(pdu);
    check_quantity(pdu, message->quantity, most);
}

/* Function 8, both ways (FM-96). */
static void decode_diagnostic(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    size_t odd = pdu->length | 1;
    message->shape = MODBUS_DIAGNOSTIC;
    exactly(pdu, odd < 5 ? 5 : odd);
    message->subfunction = get_u16(pdu);
    message->quantity = (uint16_t)((pdu->length - pdu->at) / 2);
    get_registers(pdu);
}

static bool is_identification(const struct pdu *pdu) { return pdu->data[0] == 43 && pdu->length > 1 && pdu->data[1] == IDENTIFICATION; }

/* The reply of function 43 (FM-97). */
static void decode_identification(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    message->shape = MODBUS_IDENTIFICATION;
    if (pdu->length < OBJECTS_AT) {
        exactly(pdu, OBJECTS_AT);
        return;
    }
    pdu->at = 2;
    message->category = get_u8(pdu);
    message->conformity = get_u8(pdu);
    uint8_t more = get_u8(pdu);
    message->more = more == MORE;
    message->next = get_u8(pdu);
    if (more != 0 && !message->more)
        wrong(pdu->item, MODBUS_MORE_FOLLOWS, more);
    for (uint8_t count = get_u8(pdu); count > 0; count--) {
        size_t size = get_u16(pdu) & 0xFF;
        if (!has(pdu, size))
            return;
        pdu->at += size;
    }
    exactly(pdu, pdu->at);
    message->quantity = (uint16_t)(pdu->length - OBJECTS_AT);
    memcpy(message->bytes, pdu->data + OBJECTS_AT, message->quantity);
}

/* A byte count and runs (FM-104). */
static void decode_runs(struct pdu *pdu, enum modbus_shape shape)
{
    struct modbus_message *message = &pdu->item->message;
    bool is_contents = shape == MODBUS_CONTENTS, is_write = shape == MODBUS_RECORDS;
    size_t around = is_write ? 7 : 2, left = is_write ? 251 : 245, head = is_contents ? 2 : 7;
    message->shape = shape;
    message->quantity = get_u8(pdu);
    exactly(pdu, 2u + message->quantity);
    while (pdu->item->error == MODBUS_NO_ERROR && has(pdu, head)) {
        const uint8_t *run = pdu->data + pdu->at;
        size_t quantity = is_contents ? 0 : get_u16_be(run + 5), size = is_write ? 2 * quantity : 0;
        size_t most = left > around ? (left - around) / 2 : 0;
        if (is_contents) {
            size = run[0] > 0 ? run[0] - 1u : 0;
            quantity = size / 2;
        }
        if (!has(pdu, head + size))
            return;
        if (run[is_contents] != REFERENCE)
            wrong(pdu->item, MODBUS_REFERENCE_TYPE, run[is_contents]);
        if (size % 2 != 0)
            wrong(pdu->item, MODBUS_REPLY_BYTE_COUNT, run[0]);
        if (quantity < 1 || quantity > most)
            error(pdu->item, MODBUS_QUANTITY, most, quantity);
        left -= around + 2 * quantity;
        pdu->at += head + size;
        if (pdu->at == pdu->length)
            break;
    }
    memcpy(message->bytes, pdu->data + 2, pdu->length < 2 ? 0 : pdu->length - 2);
}

bool modbus_has_runs(const struct modbus_message *message)
{
    uint8_t bytes[MODBUS_MAX_DATA + 1] = {message->function, (uint8_t)message->quantity};
    struct modbus_item item = {.error = MODBUS_NO_ERROR};
    struct pdu pdu = {bytes, 2u + message->quantity, 1, &item};
    if (message->quantity > MODBUS_MAX_DATA - 1)
        return false;
    memcpy(bytes + 2, message->bytes, message->quantity);
    decode_runs(&pdu, message->shape);
    return item.error == MODBUS_NO_ERROR;
}

/* The reply of function 24 (FM-105). */
static void decode_queue(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    message->shape = MODBUS_QUEUE;
    if (pdu->length < 5) {
        exactly(pdu, 5);
        return;
    }
    uint16_t size = get_u16(pdu);
    message->quantity = get_u16(pdu);
    if (message->quantity > MAX_QUEUE)
        error(pdu->item, MODBUS_QUANTITY, MAX_QUEUE, message->quantity);
    else if (size != 2 + 2 * message->quantity)
        error(pdu->item, MODBUS_BYTE_COUNT, 2u + 2u * message->quantity, size);
    exactly(pdu, 3u + size);
    if (pdu->item->error == MODBUS_NO_ERROR)
        get_registers(pdu);
}

static void decode_raw(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    message->shape = MODBUS_RAW;
    message->quantity = (uint16_t)(pdu->length - 1);
    get_bytes(pdu);
}

/* FM-32 */
static void decode_request(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    uint8_t function = message->function;
    if (function == 0 || function >= EXCEPTION)
        wrong(pdu->item, MODBUS_FUNCTION, function);
    switch (function) {
    case 1:
    case 2:
    case 3:
    case 4:
        decode_run(pdu, MODBUS_READ, modbus_max_read(function));
        break;
    case 5:
    case 6:
    case 22:
        decode_single(pdu);
        break;
    case 15:
    case 16:
        message->shape = function == 15 ? MODBUS_WRITE_COILS : MODBUS_WRITE_WORDS;
        message->address = get_u16(pdu);
        get_written_values(pdu);
        break;
    case 23:
        message->shape = MODBUS_READ_WRITE;
        message->address = get_u16(pdu);
        message->read_quantity = get_u16(pdu);
        message->write_address = get_u16(pdu);
        check_quantity(pdu, message->read_quantity, modbus_max_read(function));
        get_written_values(pdu);
        break;
    case 8:
        decode_diagnostic(pdu);
        break;
    case 7:
    case 11:
    case 12:
    case 17:
        message->shape = MODBUS_BARE;
        exactly(pdu, 1);
        break;
    case 20:
    case 21:
        decode_runs(pdu, function == 20 ? MODBUS_RANGES : MODBUS_RECORDS);
        break;
    case 24:
        message->shape = MODBUS_READ_QUEUE;
        exactly(pdu, 3);
        message->address = get_u16(pdu);
        break;
    default:
        if (!is_identification(pdu)) {
            decode_raw(pdu);
            break;
        }
        message->shape = MODBUS_IDENTIFY;
        exactly(pdu, 4);
        pdu->at = 2;
        message->category = get_u8(pdu);
        message->object = get_u8(pdu);
    }
}

/* What was read: its byte count, and bits or registers (FM-13). */
static void decode_values(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    bool is_bits = message->function <= 2, is_log = message->function == 12, is_own = is_log || message->function == 17;
    uint8_t count = get_u8(pdu);
    if (count == 0 || count > (is_log ? MAX_LOG : MAX_REPLY_BYTES) || (!is_bits && !is_own && count % 2 != 0))
        wrong(pdu->item, MODBUS_REPLY_BYTE_COUNT, count);
    exactly(pdu, pdu->at + count);
    if (is_log && count < 6)
        wrong(pdu->item, MODBUS_REPLY_BYTE_COUNT, count);
    if (is_log) {
        message->status = get_u16(pdu);
        message->events = get_u16(pdu);
        message->messages = get_u16(pdu);
    }
    if (is_own) {
        message->shape = is_log ? MODBUS_EVENT_LOG : MODBUS_SERVER_ID;
        message->quantity = is_log ? (uint16_t)(count - 6) : count;
        get_bytes(pdu);
        return;
    }
    message->shape = is_bits ? MODBUS_BITS : MODBUS_REGISTERS;
    message->quantity = (uint16_t)(is_bits ? count * 8 : count / 2);
    if (is_bits)
        get_bytes(pdu);
    else
        get_registers(pdu);
}

/* FM-32 */
static void decode_reply(struct pdu *pdu)
{
    struct modbus_message *message = &pdu->item->message;
    uint8_t function = message->function;
    if (function == 0 || function == EXCEPTION)
        wrong(pdu->item, MODBUS_FUNCTION, function);
    if (function >= EXCEPTION) {
        message->shape = MODBUS_EXCEPTION;
        message->function = (uint8_t)(function - EXCEPTION);
        exactly(pdu, 2);
        message->exception = get_u8(pdu);
    } else if (modbus_max_read(function) > 0 || function == 12 || function == 17) {
        decode_values(pdu);
    } else if (function == 7 || function == 11) {
        message->shape = function == 7 ? MODBUS_STATUS : MODBUS_COUNTER;
        exactly(pdu, function == 7 ? 2 : 5);
        message->status = function == 7 ? get_u8(pdu) : get_u16(pdu);
        message->events = function == 7 ? 0 : get_u16(pdu);
    } else if (function == 20 || function == 21) {
        decode_runs(pdu, function == 20 ? MODBUS_CONTENTS : MODBUS_RECORDS);
    } else if (function == 24) {
        decode_queue(pdu);
    } else if (function == 8) {
        decode_diagnostic(pdu);
    } else if (is_identification(pdu)) {
        decode_identification(pdu);
    } else if (function == 5 || function == 6 || function == 22) {
        decode_single(pdu);
    } else if (function == 15 || function == 16) {
        decode_run(pdu, MODBUS_WRITTEN, modbus_max_write(function));
    } else {
        decode_raw(pdu);
    }
}

static void decode_body(const uint8_t *body, size_t pdu_len, enum modbus_side side, struct modbus_item *item)
{
    struct pdu pdu = {body + 1, pdu_len, 1, item};
    memset(&item->message, 0, sizeof item->message);
    item->message.unit = body[0];
    item->message.function = item->function = body[1];
    if (side == MODBUS_CLIENT)
        decode_request(&pdu);
    else
        decode_reply(&pdu);
}

/* An exception, whose header may count other bytes than it has (FM-89). */
static void check_exception(struct modbus_decoder *decoder, struct modbus_item *item)
{
    size_t length = get_u16_be(decoder->held + 4);
    decoder->excess = length < EXCEPTION_BODY ? EXCEPTION_BODY - length : length - EXCEPTION_BODY;
    if (length <= EXCEPTION_BODY)
        return;
    item->function = item->message.function;
    error(item, MODBUS_EXCEPTION_LENGTH, EXCEPTION_BODY, length);
}

/* The bytes before the next frame, behind an exception of a wrong length (FM-89); false: that is not known yet. */
static bool end_exception(const struct modbus_decoder *decoder, size_t *covered)
{
    for (*covered = 0; *covered < decoder->excess; ++*covered) {
        const uint8_t *header = decoder->held + *covered;
        if (decoder->length - *covered < SHORTEST_TCP)
            return decoder->ended;
        uint16_t length = get_u16_be(header + 4);
        if (get_u16_be(header + 2) == 0 && length >= MIN_BODY && length <= MAX_BODY && (header[MBAP_LEN] & 0x7F) != 0)
            return true;
    }
    return true;
}

static void decode_frame(struct modbus_decoder *decoder, struct modbus_item *item)
{
    if (decoder->framing == MODBUS_RTU) {
        decode_body(decoder->held, item->length - 3, decoder->side, item);
        return;
    }
    decode_body(decoder->held + MBAP_LEN - 1, item->length - MBAP_LEN, decoder->side, item);
    item->message.transaction = get_u16_be(decoder->held);
    if (is_exception(decoder))
        check_exception(decoder, item);
}

bool modbus_rtu_length(const uint8_t *frame, size_t length, enum modbus_side side, size_t *size)
{
    enum length_by by = rtu_length(frame, length, side, size);
    if (by == BY_SILENCE)
        *size = 0;
    return by == BY_BEGINNING;
}

void modbus_decode_rtu(const uint8_t *frame, size_t length, enum modbus_side side, struct modbus_item *item)
{
    *item = (struct modbus_item){.length = length};
    decode_body(frame, length - 3, side, item);
}

void modbus_init(struct modbus_decoder *decoder, enum modbus_side side, enum modbus_framing framing)
{
    memset(decoder, 0, sizeof *decoder);
    decoder->side = side;
    decoder->framing = framing;
}

size_t modbus_push(struct modbus_decoder *decoder, const uint8_t *data, size_t size)
{
    return bytes_append(decoder->held, &decoder->length, sizeof decoder->held, data, size);
}

void modbus_end(struct modbus_decoder *decoder) { decoder->ended = true; }

/* What is at the beginning; false: more bytes are needed. */
static bool take(struct modbus_decoder *decoder, struct modbus_item *item)
{
    bool is_tcp = decoder->framing == MODBUS_TCP;
    item->error = MODBUS_NO_ERROR;
    if (decoder->length == 0) {
        if (decoder->ended)
            decoder->excess = 0;
        return false;
    }
    if (decoder->in_noise) {
        if (!extent(decoder, 0, &item->length))
            return false;
        item->error = MODBUS_NOISE;
        item->size = item->length;
        if (item->length > 0)
            return true;
        decoder->in_noise = false;
        item->error = MODBUS_NO_ERROR;
    }
    if (decoder->excess > 0) {
        if (!end_exception(decoder, &item->length))
            return false;
        decoder->excess = 0;
        if (item->length > 0) {
            item->error = MODBUS_NOISE;
            item->size = item->length;
            return true;
        }
    }
    switch (is_tcp ? take_tcp(decoder, item) : take_rtu(decoder, item)) {
    case WAIT:
        return false;
    case FRAME:
        decode_frame(decoder, item);
        return true;
    case CORRUPT:
        break;
    }
    if (is_tcp && item->error == MODBUS_CUT) {
        item->length = decoder->length;
        return true;
    }
    size_t length = is_tcp ? get_u16_be(decoder->held + 4) : SIZE_MAX;
    return extent(decoder, length <= MAX_BODY ? MBAP_LEN - 1 + length : 1, &item->length);
}

bool modbus_is_corrupt(const struct modbus_decoder *decoder, struct modbus_item *item)
{
    item->error = decoder->in_noise ? MODBUS_NOISE : MODBUS_NO_ERROR;
    if (decoder->in_noise || decoder->length == 0 || decoder->excess > 0)
        return decoder->in_noise;
    return (decoder->framing == MODBUS_TCP ? take_tcp(decoder, item) : take_rtu(decoder, item)) == CORRUPT;
}

bool modbus_next(struct modbus_decoder *decoder, struct modbus_item *item)
{
    item->offset = decoder->position;
    if (!take(decoder, item)) {
        decoder->ended = false;
        return false;
    }
    bytes_remove(decoder->held, &decoder->length, item->length);
    decoder->position += item->length;
    return true;
}
