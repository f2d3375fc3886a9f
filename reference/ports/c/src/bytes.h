/* What the links share: a buffer of fixed size, words of 16 bits, and decimal numbers (printf needs a heap on some C libraries). */
#ifndef CELLWIRE_BYTES_H
#define CELLWIRE_BYTES_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Appends what fits, and returns how much that is. */
static inline size_t bytes_append(uint8_t *held, size_t *length, size_t capacity, const uint8_t *data, size_t size)
{
    size_t room = capacity - *length;
    if (size > room)
        size = room;
    if (size > 0)
        memcpy(held + *length, data, size);
    *length += size;
    return size;
}

/* Removes the first `count` bytes. */
static inline void bytes_remove(uint8_t *held, size_t *length, size_t count)
{
    memmove(held, held + count, *length - count);
    *length -= count;
}

static inline uint16_t get_u16_le(const uint8_t *at) { return (uint16_t)(at[0] | at[1] << 8); }

static inline uint16_t get_u16_be(const uint8_t *at) { return (uint16_t)(at[0] << 8 | at[1]); }

/* Two's complement, without a conversion that C leaves open. */
static inline int16_t to_i16(uint16_t word) { return (int16_t)(word < 0x8000 ? word : (int32_t)word - 0x10000); }

static inline int16_t get_i16_le(const uint8_t *at) { return to_i16(get_u16_le(at)); }

static inline void put_u16_le(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)(value & 0xFF);
    at[1] = (uint8_t)(value >> 8);
}

static inline void put_u16_be(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)(value >> 8);
    at[1] = (uint8_t)(value & 0xFF);
}

#define MAX_DIGITS 10

/* Writes a number with at least so many digits, without a terminator; returns how many. */
static inline size_t put_decimal(char *at, uint32_t value, size_t digits)
{
    char text[MAX_DIGITS];
    size_t count = 0;
    for (; value > 0 || count < digits; value /= 10)
        text[count++] = (char)('0' + value % 10);
    for (size_t i = 0; i < count; i++)
        at[i] = text[count - 1 - i];
    return count;
}

#endif
