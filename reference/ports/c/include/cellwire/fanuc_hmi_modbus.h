/* fanuc-hmi-modbus: frames and PDUs of Modbus. Clauses FM-… are those of reference/fanuc-hmi-modbus.md. */
#ifndef CELLWIRE_FANUC_HMI_MODBUS_H
#define CELLWIRE_FANUC_HMI_MODBUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MODBUS_MAX_LEN 260  /* FM-6 */
#define MODBUS_MAX_DATA 252 /* bytes of a PDU after its function code */
#define MODBUS_MAX_REGISTERS (MODBUS_MAX_DATA / 2)
#define MODBUS_MAX_OBJECTS 246 /* bytes of the objects of function 43 */
#define MODBUS_LOOKED_AT 520 /* bytes that are searched for the next frame */

enum modbus_side { MODBUS_CLIENT, MODBUS_SERVER };
enum modbus_framing { MODBUS_TCP, MODBUS_RTU };

enum modbus_shape {
    /* requests */
    MODBUS_READ,           /* 1 to 4: address, quantity */
    MODBUS_WRITE_COIL,     /* 5, both sides: address, coil */
    MODBUS_WRITE_REGISTER, /* 6, both sides: address, value */
    MODBUS_WRITE_COILS,    /* 15: address, quantity, bytes */
    MODBUS_WRITE_WORDS,    /* 16: address, quantity, registers */
    MODBUS_MASK,           /* 22, both sides: address, and_mask, or_mask */
    MODBUS_READ_WRITE,     /* 23: address, read_quantity, write_address, quantity, registers */
    MODBUS_READ_QUEUE,     /* 24: address */
    /* replies */
    MODBUS_BITS,      /* 1, 2: quantity (a multiple of 8 when decoded), bytes */
    MODBUS_REGISTERS, /* 3, 4, 23: quantity, registers */
    MODBUS_WRITTEN,   /* 15, 16: address, quantity */
    MODBUS_EXCEPTION, /* exception */
    MODBUS_SERVER_ID, /* 17: quantity bytes */
    MODBUS_IDENTIFICATION, /* 43: category, conformity, more, next; quantity bytes of objects: id, length, value of each */
    MODBUS_STATUS,    /* 7: status */
    MODBUS_COUNTER,   /* 11: status, events */
    MODBUS_EVENT_LOG, /* 12: status, events, messages; quantity bytes */
    MODBUS_CONTENTS,  /* 20: quantity bytes of runs: length, reference type, registers of each */
    MODBUS_QUEUE,     /* 24: quantity, registers */
    /* both */
    MODBUS_RAW,        /* any other function: quantity bytes */
    MODBUS_DIAGNOSTIC, /* 8: subfunction, quantity, registers */
    MODBUS_RECORDS,    /* 21: quantity bytes of runs: reference type, file, record, registers of each, and how many */
    /* requests without an address */
    MODBUS_BARE,     /* 7, 11, 12, 17 */
    MODBUS_RANGES,   /* 20: quantity bytes of runs: reference type, file, record, quantity of each */
    MODBUS_IDENTIFY, /* 43: category, object */
};

struct modbus_message {
    uint16_t transaction; /* TCP */
    uint8_t unit, function;
    enum modbus_shape shape;
    uint16_t address, quantity, read_quantity, write_address;
    uint16_t value, and_mask, or_mask, subfunction, status, events, messages;
    bool coil, more;
    uint8_t exception, category, object, conformity, next;
    uint8_t bytes[MODBUS_MAX_DATA]; /* raw, objects, runs, or bits: the first one in bit 0 of the first byte */
    uint16_t registers[MODBUS_MAX_REGISTERS];
};

enum modbus_error_kind {
    MODBUS_NO_ERROR,
    /* frames */
    MODBUS_PROTOCOL,    /* found */
    MODBUS_MBAP_LENGTH, /* found */
    MODBUS_CRC,         /* expected, found, size */
    MODBUS_CUT,         /* expected, found */
    MODBUS_TOO_LONG,    /* found */
    MODBUS_NOISE,       /* size */
    /* PDUs */
    MODBUS_FUNCTION,         /* found */
    MODBUS_PDU_LENGTH,       /* function, expected, found */
    MODBUS_QUANTITY,         /* function, found, expected: the most */
    MODBUS_BYTE_COUNT,       /* function, expected, found */
    MODBUS_REPLY_BYTE_COUNT, /* function, found */
    MODBUS_REFERENCE_TYPE,   /* function, found */
    MODBUS_COIL_VALUE,       /* found */
    MODBUS_MORE_FOLLOWS,     /* found */
    /* An exception over TCP (FM-89), which is also in the item's message. */
    MODBUS_EXCEPTION_LENGTH, /* function, expected, found */
};

struct modbus_item {
    uint64_t offset; /* in the stream */
    size_t length;
    enum modbus_error_kind error;
    uint8_t function;
    size_t expected, found, size;
    struct modbus_message message; /* unless there is another error */
};

struct modbus_decoder {
    enum modbus_side side;
    enum modbus_framing framing;
    uint8_t held[MODBUS_LOOKED_AT];
    size_t length;
    uint64_t position;
    bool ended;
    bool in_noise; /* the bytes before were corrupt, and where a frame begins is not known yet */
    size_t excess; /* bytes that may belong to the exception before them (FM-89) */
};

/* Reads the bytes of one side. */
void modbus_init(struct modbus_decoder *decoder, enum modbus_side side, enum modbus_framing framing);

/* Takes bytes, as many as fit; returns how many. Call `next` until it is false, then push the rest. */
size_t modbus_push(struct modbus_decoder *decoder, const uint8_t *data, size_t size);

/* The stream has ended, or FM-4's silence has passed on a serial line. Call `next` until it is false. */
void modbus_end(struct modbus_decoder *decoder);

/* The next message or error; false: more bytes are needed. */
bool modbus_next(struct modbus_decoder *decoder, struct modbus_item *item);

/* Whether what is held is corrupt, and where a frame begins behind it is not known yet; `item` has its error. */
bool modbus_is_corrupt(const struct modbus_decoder *decoder, struct modbus_item *item);

/* Writes a message, and returns its length; 0: refused (FM-36), nothing is written. */
size_t modbus_encode(const struct modbus_message *message, enum modbus_framing framing, uint8_t *out, size_t size);

/* Whether a function has a shape of its own. */
bool modbus_is_named(uint8_t function);

/* Whether only a reply makes sense of a function: it reads. */
bool modbus_asks(uint8_t function);

/* Whether the bytes of a message of shape MODBUS_CONTENTS, MODBUS_RECORDS or MODBUS_RANGES are runs (FM-104). */
bool modbus_has_runs(const struct modbus_message *message);

/* The most bits or registers that one request reads; 0: the function reads nothing. */
uint16_t modbus_max_read(uint8_t function);

/* The most that one request of function 15, 16 or 23 writes. */
uint16_t modbus_max_write(uint8_t function);

/* The length of the RTU frame that begins here (FM-10); false: more bytes are needed, `*size` at least; 0: it does not show. */
bool modbus_rtu_length(const uint8_t *frame, size_t length, enum modbus_side side, size_t *size);

/* Decodes an RTU frame of 4 to 256 bytes whose CRC is right. */
void modbus_decode_rtu(const uint8_t *frame, size_t length, enum modbus_side side, struct modbus_item *item);

/* Whether these are 4 to 256 bytes whose CRC is right. */
bool modbus_is_right(const uint8_t *frame, size_t length);

/* FM-9 */
uint16_t modbus_crc(const uint8_t *data, size_t length);

#ifdef __cplusplus
}
#endif

#endif
