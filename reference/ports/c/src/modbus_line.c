#include "cellwire/modbus_line.h"

#include "session.h"

#define BITS_OF_SILENCE 38500000 /* 3.5 characters of 11 bits, in µs at one baud */
#define BITS_OF_LONGEST 2816     /* 256 characters */
#define BITS_OF_PIECE 352        /* 32 characters */
#define FASTEST_COUNTED 19200

struct modbus_fault modbus_fault_of(const struct modbus_item *item)
{
    struct modbus_fault fault = {item->error, item->function, item->expected, item->found, item->size, 0, 0, 0};
    if (item->error == MODBUS_EXCEPTION_LENGTH) {
        fault.transaction = item->message.transaction;
        fault.unit = item->message.unit;
        fault.exception = item->message.exception;
    }
    return fault;
}

bool modbus_step_is_lost(struct modbus_step *step, const struct modbus_decoder *decoder, struct modbus_fault *error)
{
    struct modbus_item item;
    bool was_lost = step->is_lost;
    step->is_lost = modbus_is_corrupt(decoder, &item);
    *error = item.error == MODBUS_NOISE ? step->last : modbus_fault_of(&item);
    return step->is_lost && !was_lost;
}

uint64_t modbus_line_silence(enum modbus_line line, uint32_t baud)
{
    if (line == MODBUS_LINE_RTU_OVER_TCP)
        return 500 * MS;
    return baud == 0 || baud > FASTEST_COUNTED ? 1750 * MS / 1000 : BITS_OF_SILENCE / baud * (MS / 1000);
}

uint64_t modbus_line_piece(enum modbus_line line, uint32_t baud)
{
    return line != MODBUS_LINE_RTU ? 50 * MS : BITS_OF_PIECE * SECOND / (baud == 0 ? 1 : baud) + 20 * MS;
}

uint64_t modbus_line_longest(enum modbus_line line, uint32_t baud)
{
    return line != MODBUS_LINE_RTU ? 0 : BITS_OF_LONGEST * SECOND / (baud == 0 ? 1 : baud);
}
