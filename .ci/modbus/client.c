/* libmodbus as a client: client ADDRESS:PORT ROUNDS reads 37 registers so often. */
#include <errno.h>
#include <modbus/modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int count, char **arguments) {
    if (count != 3) return 2;
    char *port = strrchr(arguments[1], ':');
    *port++ = 0;
    modbus_t *client = modbus_new_tcp(arguments[1], atoi(port));
    uint16_t words[37];
    modbus_set_slave(client, 1);
    if (modbus_connect(client) != 0) return 1;
    for (int left = atoi(arguments[2]); left > 0; left--)
        if (modbus_read_registers(client, 0, 37, words) != 37) {
            fprintf(stderr, "%s\n", modbus_strerror(errno));
            return 1;
        }
    return 0;
}
