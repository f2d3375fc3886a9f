/* Loads a Modbus TCP server with N clients that each send the next request when they have the reply to the last one:
 * load ADDRESS PORT N SECONDS PID. Prints requests a second, the 50th and the 99th percentile of a reply's time in microseconds,
 * and the processor time in microseconds that the server's process took for a request. */
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* 37 holding registers: the telemetry block, as the logger reads it. */
static const uint8_t REQUEST[] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 37};
enum { REPLY = 9 + 2 * 37, TIMES = 1000000 };

struct client { int socket, received; int64_t sent; };

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void fail(const char *what) {
    perror(what);
    exit(1);
}

/* The processor time of a process, in microseconds, from the scheduler's own sum: /proc/PID/stat counts ticks of 10 ms. */
static double processor(const char *pid) {
    char path[64];
    unsigned long long total = 0, time;
    snprintf(path, sizeof path, "ls /proc/%s/task", pid);
    FILE *tasks = popen(path, "r");
    char task[32];
    while (tasks && fscanf(tasks, "%31s", task) == 1) {
        snprintf(path, sizeof path, "/proc/%s/task/%s/schedstat", pid, task);
        FILE *file = fopen(path, "r");
        if (!file) continue;
        if (fscanf(file, "%llu", &time) == 1) total += time;
        fclose(file);
    }
    pclose(tasks);
    return total / 1e3;
}

static void ask(struct client *client) {
    client->sent = now();
    client->received = 0;
    if (send(client->socket, REQUEST, sizeof REQUEST, 0) != sizeof REQUEST) fail("send");
}

static int ascending(const void *a, const void *b) { return (*(int32_t *)a > *(int32_t *)b) - (*(int32_t *)a < *(int32_t *)b); }

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    int count = atoi(argv[3]), epoll = epoll_create1(0);
    struct client *clients = calloc(count, sizeof *clients);
    int32_t *times = malloc(TIMES * sizeof *times);
    struct sockaddr_in place = {.sin_family = AF_INET, .sin_port = htons(atoi(argv[2]))};
    inet_pton(AF_INET, argv[1], &place.sin_addr);
    for (int i = 0; i < count; i++) {
        int one = 1, s = clients[i].socket = socket(AF_INET, SOCK_STREAM, 0);
        if (connect(s, (struct sockaddr *)&place, sizeof place)) fail("connect");
        setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        epoll_ctl(epoll, EPOLL_CTL_ADD, s, &(struct epoll_event){.events = EPOLLIN, .data.ptr = &clients[i]});
        ask(&clients[i]);
    }
    int64_t begin = now(), warm = begin + 300000000, end = warm + (int64_t)(atof(argv[4]) * 1e9), at = begin;
    double before = 0;
    long requests = 0;
    while (at < end) {
        struct epoll_event events[128];
        int ready = epoll_wait(epoll, events, 128, 5000);
        if (ready <= 0) { fprintf(stderr, "no reply within 5 s\n"); return 1; }
        for (int i = 0; i < ready; i++) {
            struct client *client = events[i].data.ptr;
            uint8_t reply[512];
            ssize_t length = recv(client->socket, reply, sizeof reply, 0);
            if (length <= 0) fail("recv");
            if ((client->received += length) < REPLY) continue;
            if (client->received > REPLY) { fprintf(stderr, "a reply of another length\n"); return 1; }
            at = now();
            if (at >= warm) {
                if (!before) before = processor(argv[5]), warm = at = now(), end = warm + (int64_t)(atof(argv[4]) * 1e9);
                else times[requests++ % TIMES] = at - client->sent;
            }
            ask(client);
        }
    }
    double cost = (processor(argv[5]) - before) / requests;
    long kept = requests < TIMES ? requests : TIMES;
    qsort(times, kept, sizeof *times, ascending);
    printf("%.0f %.1f %.1f %.2f\n", requests / ((at - warm) / 1e9), times[kept / 2] / 1e3, times[kept * 99 / 100] / 1e3, cost);
    return 0;
}
