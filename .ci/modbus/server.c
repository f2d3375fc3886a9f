/* Servers to race against, on a free port that the first line of output names: `libmodbus`, as its own example for many clients
 * serves them, and `bare`, a loop over epoll that answers every request of 12 bytes with the same 37 registers. */
#include <arpa/inet.h>
#include <errno.h>
#include <modbus/modbus.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

static int listening(int listener) {
    struct sockaddr_in place;
    socklen_t size = sizeof place;
    getsockname(listener, (struct sockaddr *)&place, &size);
    printf("%d\n", ntohs(place.sin_port));
    fflush(stdout);
    return listener;
}

static int accepted(int listener) {
    int one = 1, s = accept(listener, NULL, NULL);
    setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return s;
}

static void libmodbus(int listener) {
    modbus_t *ctx = modbus_new_tcp("127.0.0.1", 0);
    modbus_mapping_t *mapping = modbus_mapping_new(30000, 28000, 16448, 4000);
    uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    fd_set all, ready;
    int most = listener;
    FD_ZERO(&all);
    FD_SET(listener, &all);
    for (;;) {
        ready = all;
        if (select(most + 1, &ready, NULL, NULL, NULL) == -1) exit(1);
        for (int s = 0; s <= most; s++) {
            if (!FD_ISSET(s, &ready)) continue;
            if (s == listener) {
                int client = accepted(listener);
                FD_SET(client, &all);
                if (client > most) most = client;
                continue;
            }
            modbus_set_socket(ctx, s);
            int length = modbus_receive(ctx, query);
            if (length > 0) {
                modbus_reply(ctx, query, length, mapping);
            } else if (length == -1) {
                close(s);
                FD_CLR(s, &all);
            }
        }
    }
}

static void bare(int listener) {
    uint8_t reply[9 + 2 * 37] = {0, 1, 0, 0, 0, 3 + 2 * 37, 1, 3, 2 * 37}, query[512];
    struct epoll_event events[128];
    int epoll = epoll_create1(0);
    epoll_ctl(epoll, EPOLL_CTL_ADD, listener, &(struct epoll_event){.events = EPOLLIN, .data.fd = listener});
    for (;;) {
        int ready = epoll_wait(epoll, events, 128, -1);
        for (int i = 0; i < ready; i++) {
            int s = events[i].data.fd;
            if (s == listener) {
                int client = accepted(listener);
                epoll_ctl(epoll, EPOLL_CTL_ADD, client, &(struct epoll_event){.events = EPOLLIN, .data.fd = client});
            } else if (recv(s, query, sizeof query, 0) <= 0) {
                close(s);
            } else {
                send(s, reply, sizeof reply, 0);
            }
        }
    }
}

int main(int argc, char **argv) {
    struct sockaddr_in place = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    int listener = socket(AF_INET, SOCK_STREAM, 0);
    if (argc != 2 || bind(listener, (struct sockaddr *)&place, sizeof place) || listen(listener, 200)) return 1;
    (strcmp(argv[1], "bare") == 0 ? bare : libmodbus)(listening(listener));
    return 0;
}
