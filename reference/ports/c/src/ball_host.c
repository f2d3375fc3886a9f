#include "cellwire/ball_host.h"

#include "session.h"

#define EXCHANGE_LEN 13
#define PLACES 8
#define NEEDED 3 /* IB-30 */

const struct ball_host_config BALL_HOST_DEFAULT = {
    .baud = 9600, .period = 28 * MS, .max_delay = 14 * MS, .max_age = 150 * MS};

static struct ball_host_event *report(struct ball_host *host, enum ball_host_kind kind)
{
    struct ball_host_event *event = ADD_EVENT(host);
    event->kind = kind;
    return event;
}

bool ball_host_init(struct ball_host *host, const struct ball_host_config *config)
{
    memset(host, 0, sizeof *host);
    host->config = *config;
    host->exchange = line_time(EXCHANGE_LEN, config->baud);
    host->window = after(host->exchange, config->max_delay);
    host->spread = after(config->max_delay, host->exchange / 5);
    uint64_t cycle = later(config->period, host->window);
    host->quiet = after(cycle, host->spread);
    uint64_t whole = (host->exchange + MS - 1) / MS * MS;
    bool outlasts = config->max_age == NEVER || config->max_age > after(after(cycle, cycle), host->window);
    return config->baud > 0 && config->period >= whole && outlasts;
}

/* IB-29 */
static void lose_values(struct ball_host *host)
{
    if (host->is_live)
        report(host, BALL_HOST_STALE);
    host->is_live = false;
}

static void close(struct ball_host *host)
{
    if (host->link == BALL_HOST_WAITING)
        report(host, BALL_HOST_MISSED);
    lose_values(host);
    host->link = BALL_HOST_DISCONNECTED;
}

/* IB-23 */
void ball_host_connected(struct ball_host *host, uint64_t now)
{
    ball_host_timeout(host, now);
    close(host);
    host->link = BALL_HOST_IDLE;
    host->due = after(now, host->quiet);
    host->proven = 0;
    isra_ball_init(&host->decoder);
    line_echo_init(&host->echo, host->config.echo);
}

void ball_host_disconnected(struct ball_host *host, uint64_t now)
{
    ball_host_timeout(host, now);
    close(host);
}

/* IB-26, IB-31 */
static void take_packet(struct ball_host *host, uint64_t now, const struct isra_ball_packet *packet)
{
    if (host->link == BALL_HOST_DISCONNECTED) {
        report(host, BALL_HOST_UNEXPECTED);
        return;
    }
    if (host->link == BALL_HOST_IDLE || now < host->from) {
        report(host, BALL_HOST_UNASKED)->packet = *packet;
        return;
    }
    bool is_new = packet->status == ISRA_BALL_FRESH && now < host->proven;
    struct ball_host_event *event = report(host, is_new ? BALL_HOST_NEW : BALL_HOST_OLD);
    event->packet = *packet;
    if (is_new) {
        host->is_live = true;
        host->live_until = event->live_until = host->proven;
    }
    host->proven = host->proof;
    host->link = BALL_HOST_IDLE;
}

static void read_items(struct ball_host *host, uint64_t now)
{
    struct isra_ball_item item;
    while (isra_ball_next(&host->decoder, &item)) {
        if (item.kind == ISRA_BALL_PACKET) {
            take_packet(host, now, &item.packet);
            continue;
        }
        struct ball_host_event *event = report(host, BALL_HOST_CORRUPT);
        event->error = item.kind;
        event->length = item.length;
        event->error_offset = item.error_offset;
        event->expected = item.expected;
        event->found = item.kind == ISRA_BALL_RAW ? item.raw_len : item.found;
    }
}

/* IB-28 */
static void give_up(struct ball_host *host, uint64_t now)
{
    isra_ball_end(&host->decoder);
    read_items(host, now);
}

/* IB-41: how many of the first bytes are not to be read. */
static size_t remove_echo(struct ball_host *host, const uint8_t *data, size_t *size)
{
    struct line_echo_error error;
    size_t own = line_echo_begin(&host->echo, host->sent, data, size, &error);
    if (error.kind != LINE_ECHO_NONE)
        report(host, BALL_HOST_LINE_ECHO)->echo = error;
    return own;
}

size_t ball_host_input(struct ball_host *host, uint64_t now, const uint8_t *data, size_t size)
{
    ball_host_timeout(host, now);
    size_t taken = remove_echo(host, data, &size);
    while (taken < size && host->event_count < BALL_HOST_EVENTS / 2) {
        taken += isra_ball_push(&host->decoder, data + taken, 1);
        read_items(host, now);
    }
    return line_echo_taken(&host->echo, size, taken);
}

void ball_host_timeout(struct ball_host *host, uint64_t now)
{
    if (host->link == BALL_HOST_WAITING && now >= host->until) {
        host->link = BALL_HOST_IDLE;
        host->due = after(later(host->due, now), host->spread); /* IB-40 */
        give_up(host, now);
        report(host, BALL_HOST_MISSED);
    }
    if (now >= host->live_until)
        lose_values(host);
}

bool ball_host_event(struct ball_host *host, struct ball_host_event *event) { return TAKE_EVENT(host, event); }

/* Events that wait, but for notices. */
static size_t outcomes(const struct ball_host *host)
{
    size_t count = 0;
    for (size_t i = 0; i < host->event_count; i++) {
        enum ball_host_kind kind = host->events[i].kind;
        count += kind == BALL_HOST_NEW || kind == BALL_HOST_OLD || kind == BALL_HOST_MISSED || kind == BALL_HOST_STALE;
    }
    return count;
}

/* IB-24 */
size_t ball_host_transmit(struct ball_host *host, uint64_t now, uint8_t *out, size_t size)
{
    ball_host_timeout(host, now);
    bool is_due = host->link == BALL_HOST_IDLE && now >= host->due;
    if (!is_due || size < 1 || outcomes(host) + NEEDED > PLACES)
        return 0;
    give_up(host, now);
    host->link = BALL_HOST_WAITING;
    host->from = after(now, host->exchange - host->exchange / 10);
    host->until = after(now, host->window);
    host->due = after(now, host->config.period);
    host->proof = after(now, host->config.max_age);
    out[0] = ISRA_BALL_POLL;
    line_echo_sent(&host->echo, host->sent, out, 1, false); /* a packet may begin with it */
    return 1;
}

/* IB-39 */
bool ball_host_deadline(const struct ball_host *host, uint64_t *deadline)
{
    *deadline = host->link == BALL_HOST_WAITING ? host->until : host->due;
    if (host->is_live)
        *deadline = sooner(*deadline, host->live_until);
    return host->link != BALL_HOST_DISCONNECTED;
}
