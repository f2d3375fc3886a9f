/* What both ends of fanuc-hmi-modbus know of their line. */
#ifndef CELLWIRE_MODBUS_LINE_H
#define CELLWIRE_MODBUS_LINE_H

#include "cellwire/fanuc_hmi_modbus.h"

#ifdef __cplusplus
extern "C" {
#endif

enum modbus_line { MODBUS_LINE_TCP, MODBUS_LINE_RTU, MODBUS_LINE_RTU_OVER_TCP };

/* An error of a decoder, without the message of its item. */
struct modbus_fault {
    enum modbus_error_kind kind;
    uint8_t function;
    size_t expected, found, size;
    uint16_t transaction;    /* these three of an exception with a wrong length */
    uint8_t unit, exception;
};

struct modbus_fault modbus_fault_of(const struct modbus_item *item);

/* Whether reads end within corruption (FM-81). */
struct modbus_step {
    bool is_lost;
    struct modbus_fault last;
};

/* Whether a read has just ended within corruption, and the one before did not: then `error` is that of the corruption. */
bool modbus_step_is_lost(struct modbus_step *step, const struct modbus_decoder *decoder, struct modbus_fault *error);

/* FM-4; a stall of half a second where a gap shows nothing (FM-5). */
uint64_t modbus_line_silence(enum modbus_line line, uint32_t baud);

/* The time of 32 characters and 20 ms on a serial line, else 50 ms (FM-79). */
uint64_t modbus_line_piece(enum modbus_line line, uint32_t baud);

/* The time of 256 characters on a serial line, else 0 (FM-77). */
uint64_t modbus_line_longest(enum modbus_line line, uint32_t baud);

#ifdef __cplusplus
}
#endif

#endif
