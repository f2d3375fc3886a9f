/* libmodbus's own server: tcp on a free port, which it prints, or rtu on the line of argv[2]. */
#include <arpa/inet.h>
#include <modbus/modbus.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

int main(int argc, char **argv) {
    int line = argc == 3 && strcmp(argv[1], "rtu") == 0, listener = -1;
    modbus_t *ctx = line ? modbus_new_rtu(argv[2], 115200, 'N', 8, 1) : modbus_new_tcp("127.0.0.1", 0);
    modbus_set_slave(ctx, 1);
    modbus_mapping_t *map = modbus_mapping_new(3200, 3200, 3200, 3200);
    for (int n = 0; n < 3200; n++) {
        map->tab_bits[n] = n % 7 == 0;
        map->tab_input_bits[n] = n % 3 == 0;
        map->tab_registers[n] = n;
        map->tab_input_registers[n] = 60000 + n;
    }
    if (line) {
        if (modbus_connect(ctx) == -1) return 1;
        puts("ready");
    } else {
        struct sockaddr_in address;
        socklen_t length = sizeof address;
        listener = modbus_tcp_listen(ctx, 1);
        getsockname(listener, (struct sockaddr *) &address, &length);
        printf("%d\n", ntohs(address.sin_port));
    }
    fflush(stdout);
    if (!line) modbus_tcp_accept(ctx, &listener);
    for (;;) {
        uint8_t query[MODBUS_MAX_ADU_LENGTH];
        int length = modbus_receive(ctx, query);
        if (length > 0) {
            modbus_reply(ctx, query, length, map);
        } else if (length == -1 && !line) {
            modbus_close(ctx);
            modbus_tcp_accept(ctx, &listener);
        }
    }
}
