/* libmodbus reads and writes every table of the simulated FANUC controller. */
#include <errno.h>
#include <modbus/modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int checks;

#define CHECK(condition, ...)                                              \
    do {                                                                   \
        checks++;                                                          \
        if (!(condition)) {                                                \
            fprintf(stderr, "line %d: %s: ", __LINE__, #condition);        \
            fprintf(stderr, __VA_ARGS__);                                  \
            fprintf(stderr, " (%s)\n", modbus_strerror(errno));            \
            exit(1);                                                       \
        }                                                                  \
    } while (0)

#define EXCEPTION(call, code) CHECK((call) == -1 && errno == MODBUS_ENOBASE + (code), "exception %d", code)

static modbus_t *ctx;

/* Sends a request that libmodbus's own functions cannot build, and checks the exception. */
static void raw(const uint8_t *request, int length, int exception) {
    uint8_t reply[MODBUS_MAX_ADU_LENGTH];
    CHECK(modbus_send_raw_request(ctx, request, length) > 0, "send");
    int found = modbus_receive_confirmation(ctx, reply) == -1 ? errno - MODBUS_ENOBASE
                                                               : reply[modbus_get_header_length(ctx) + 1];
    CHECK(found == exception, "function %d: exception %d", request[1], found);
}

int main(int argc, char **argv) {
    int line = argc == 3 && strcmp(argv[1], "rtu") == 0;
    if (line) {
        ctx = modbus_new_rtu(argv[2], 115200, 'N', 8, 1);
    } else {
        char *port = strchr(argv[2], ':');
        *port++ = 0;
        ctx = modbus_new_tcp(argv[2], atoi(port));
    }
    modbus_set_slave(ctx, 1);
    modbus_set_response_timeout(ctx, 2, 0);
    CHECK(modbus_connect(ctx) == 0, "connect");

    static uint8_t bits[2000], pattern[1968];
    static uint16_t words[125], numbers[123];
    int every = line ? 7 : 1; /* on a line a whole table takes long: a seventh of it */
    for (int a = 0; a < 28000; a += 2000 * every) {
        CHECK(modbus_read_input_bits(ctx, a, 2000, bits) == 2000, "discrete inputs %d", a);
        for (int i = 0; i < 2000; i++) CHECK(bits[i] == ((a + i + 1) % 3 == 0), "discrete input %d", a + i);
    }
    for (int a = 0; a < 30000; a += 2000 * every) {
        CHECK(modbus_read_bits(ctx, a, 2000, bits) == 2000, "coils %d", a);
        for (int i = 0; i < 2000; i++) CHECK(bits[i] == 0, "coil %d", a + i);
    }
    for (int a = 0; a < 4000; a += 125 * every) {
        CHECK(modbus_read_input_registers(ctx, a, 125, words) == 125, "input registers %d", a);
        for (int i = 0; i < 125; i++) CHECK(words[i] == a + i + 1, "input register %d", a + i);
    }
    for (int a = 37; a < 16448; a += 125 * every) {
        int n = a + 125 <= 16448 ? 125 : 16448 - a;
        CHECK(modbus_read_registers(ctx, a, n, words) == n, "holding registers %d", a);
        for (int i = 0; i < n; i++) {
            int expected = a + i < 16384 ? a + i + 1 : 0;
            CHECK(words[i] == expected, "holding register %d", a + i);
        }
    }
    EXCEPTION(modbus_read_input_bits(ctx, 28000, 1, bits), 2);
    EXCEPTION(modbus_read_input_bits(ctx, 27999, 2, bits), 2);
    EXCEPTION(modbus_read_bits(ctx, 30000, 1, bits), 2);
    EXCEPTION(modbus_read_input_registers(ctx, 3999, 2, words), 2);
    EXCEPTION(modbus_read_registers(ctx, 16448, 1, words), 2);
    EXCEPTION(modbus_read_registers(ctx, 65535, 1, words), 2);

    for (int i = 0; i < 1968; i++) pattern[i] = i % 5 == 0;
    for (int i = 0; i < 123; i++) numbers[i] = 65535 - 3 * i;
    CHECK(modbus_write_bit(ctx, 29999, 1) == 1, "one coil");
    CHECK(modbus_read_bits(ctx, 29999, 1, bits) == 1 && bits[0] == 1, "one coil");
    CHECK(modbus_write_bits(ctx, 11, 1968, pattern) == 1968, "1968 coils");
    CHECK(modbus_read_bits(ctx, 11, 1968, bits) == 1968 && memcmp(bits, pattern, 1968) == 0, "1968 coils");
    CHECK(modbus_write_register(ctx, 16447, 0xABCD) == 1, "one register");
    CHECK(modbus_read_registers(ctx, 16447, 1, words) == 1 && words[0] == 0xABCD, "one register");
    CHECK(modbus_write_registers(ctx, 1000, 123, numbers) == 123, "123 registers");
    CHECK(modbus_read_registers(ctx, 1000, 123, words) == 123, "123 registers");
    CHECK(memcmp(words, numbers, sizeof numbers) == 0, "123 registers");
    CHECK(modbus_mask_write_register(ctx, 1000, 0x0F0F, 0x1234) == 1, "mask");
    CHECK(modbus_read_registers(ctx, 1000, 1, words) == 1, "mask");
    CHECK(words[0] == ((0xFFFF & 0x0F0F) | (0x1234 & 0xF0F0)), "mask: %04x", words[0]);
    CHECK(modbus_write_and_read_registers(ctx, 2000, 121, numbers, 1999, 125, words) == 125, "read/write");
    CHECK(words[0] == 2000 && memcmp(words + 1, numbers, 242) == 0 && words[122] == 2122, "read/write");
    EXCEPTION(modbus_write_bit(ctx, 30000, 1), 2);
    EXCEPTION(modbus_write_bits(ctx, 29999, 2, pattern), 2);
    EXCEPTION(modbus_write_register(ctx, 16448, 1), 2);
    EXCEPTION(modbus_write_registers(ctx, 16447, 2, numbers), 2);
    EXCEPTION(modbus_mask_write_register(ctx, 16448, 0, 0), 2);
    EXCEPTION(modbus_write_and_read_registers(ctx, 16447, 2, numbers, 0, 1, words), 2);

    raw((const uint8_t[]) {1, 0x03, 0, 0, 0, 0}, 6, 3);       /* no registers */
    raw((const uint8_t[]) {1, 0x03, 0, 0, 0, 126}, 6, 3);     /* too many */
    raw((const uint8_t[]) {1, 0x01, 0, 0, 0x07, 0xD1}, 6, 3); /* 2001 coils */
    raw((const uint8_t[]) {1, 0x05, 0, 0, 0, 1}, 6, 3);       /* neither on nor off */
    raw((const uint8_t[]) {1, 0x07}, 2, 1);                   /* functions that it does not have */
    EXCEPTION(modbus_report_slave_id(ctx, sizeof bits, bits), 1);

    CHECK(modbus_read_registers(ctx, 0, 37, words) == 37 && words[2] == 100, "telemetry");
    modbus_close(ctx);
    modbus_free(ctx);
    printf("libmodbus %s, %s: %d checks\n", LIBMODBUS_VERSION_STRING, argv[1], checks);
    return 0;
}
