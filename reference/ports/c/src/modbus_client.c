#include "cellwire/modbus_client.h"

#include "session.h"

struct modbus_client_config modbus_client_default(enum modbus_line framing, uint32_t baud)
{
    uint64_t longest = modbus_line_longest(framing, baud);
    return (struct modbus_client_config){
        .framing = framing,
        .places = MODBUS_CLIENT_PLACES,
        .silence = modbus_line_silence(framing, baud),
        .timeout = after(after(SECOND, longest), longest),
        .in_flight = 1,
        .broadcast = framing != MODBUS_LINE_TCP,
        .turnaround = after(100 * MS, longest),
        .settle = framing == MODBUS_LINE_RTU_OVER_TCP ? 10 * SECOND : SECOND,
    };
}

static bool is_tcp(const struct modbus_client *client) { return client->config.framing == MODBUS_LINE_TCP; }

static enum modbus_framing framing_of(const struct modbus_client *client) { return is_tcp(client) ? MODBUS_TCP : MODBUS_RTU; }

bool modbus_client_init(struct modbus_client *client, const struct modbus_client_config *config)
{
    memset(client, 0, sizeof *client);
    client->config = *config;
    modbus_init(&client->decoder, MODBUS_SERVER, framing_of(client));
    unsigned most = is_tcp(client) ? config->places : 1;
    return config->places >= 1 && config->places <= MODBUS_CLIENT_PLACES && config->timeout > 0 && config->in_flight >= 1 &&
           config->in_flight <= most && (is_tcp(client) ? !config->echo : config->silence > 0);
}

/* An outcome, for which there is always room. */
static struct modbus_client_event *report(struct modbus_client *client, enum modbus_client_kind kind)
{
    struct modbus_client_event *event = ADD_EVENT(client);
    event->kind = kind;
    return event;
}

/* Anything else; where only the outcomes still fit it is dropped, in a slot behind them. */
static struct modbus_client_event *remark(struct modbus_client *client, enum modbus_client_kind kind)
{
    if (client->event_count >= MODBUS_CLIENT_EVENTS - MODBUS_CLIENT_PLACES)
        return &client->events[MODBUS_CLIENT_EVENTS - 1];
    return report(client, kind);
}

/* The request has its outcome. */
static struct modbus_client_event *end_request(struct modbus_client *client, struct modbus_client_place *place,
                                               enum modbus_client_kind kind, const char *reason)
{
    struct modbus_client_event *event = report(client, kind);
    event->ticket = place->ticket;
    event->place = (size_t)(place - client->places);
    event->reason = reason;
    place->stage = MODBUS_CLIENT_ENDED;
    return event;
}

/* No more reply is expected. */
static void forget_late(struct modbus_client_place *place)
{
    if (place->stage == MODBUS_CLIENT_TIMED_OUT)
        place->stage = MODBUS_CLIENT_ENDED;
    else if (place->stage == MODBUS_CLIENT_EXPIRED)
        place->stage = MODBUS_CLIENT_FREE;
}

/* FM-54 */
static void end_connection(struct modbus_client *client)
{
    if (!client->is_up)
        return;
    for (size_t i = 0; i < client->config.places; i++) {
        forget_late(&client->places[i]);
        if (client->places[i].stage == MODBUS_CLIENT_IN_FLIGHT)
            end_request(client, &client->places[i], MODBUS_CLIENT_FAILED, "disconnected");
    }
    for (size_t i = 0; i < client->config.places; i++)
        if (client->places[i].stage == MODBUS_CLIENT_QUEUED || client->places[i].stage == MODBUS_CLIENT_PROBING)
            end_request(client, &client->places[i], MODBUS_CLIENT_FAILED, "not_sent");
    client->is_up = client->is_busy = client->is_partial = client->is_quiet = client->is_doubtful = client->holds = false;
    memset(&client->step, 0, sizeof client->step);
    modbus_init(&client->decoder, MODBUS_SERVER, framing_of(client));
}

static void be_quiet(struct modbus_client *client, uint64_t until)
{
    client->is_quiet = true;
    client->quiet_until = until;
}

/* FM-94: for so long, if it is above 0. */
static void rest(struct modbus_client *client, uint64_t now, uint64_t span)
{
    if (span > 0)
        be_quiet(client, after(now, span));
}

/* FM-53 */
void modbus_client_connected(struct modbus_client *client, uint64_t now)
{
    end_connection(client);
    client->is_up = true;
    client->is_proven = is_tcp(client);
    line_echo_init(&client->echo, client->config.echo);
    if (client->config.framing == MODBUS_LINE_RTU)
        be_quiet(client, after(after(now, client->config.timeout), client->config.settle));
}

void modbus_client_disconnected(struct modbus_client *client, uint64_t now)
{
    (void)now;
    end_connection(client);
}

/* The request, or the probe before it. */
static bool is_in_flight(const struct modbus_client_place *place)
{
    return place->stage == MODBUS_CLIENT_IN_FLIGHT || place->stage == MODBUS_CLIENT_PROBING;
}

/* FM-93; its unit is the request's. */
static const struct modbus_message PROBE = {.function = 3, .shape = MODBUS_READ, .quantity = 1};

static const struct modbus_message *asked(const struct modbus_client_place *place)
{
    return place->stage == MODBUS_CLIENT_PROBING ? &PROBE : &place->message;
}

static struct modbus_client_place *find_in_flight(struct modbus_client *client, uint16_t transaction)
{
    for (size_t i = 0; i < client->config.places; i++)
        if (is_in_flight(&client->places[i]) && client->places[i].message.transaction == transaction)
            return &client->places[i];
    return NULL;
}

/* The newest request that has timed out with a transaction (FM-48). */
static struct modbus_client_place *find_late(struct modbus_client *client, uint16_t transaction)
{
    struct modbus_client_place *newest = NULL;
    for (size_t i = 0; i < client->config.places; i++) {
        struct modbus_client_place *place = &client->places[i];
        bool is_late = place->stage == MODBUS_CLIENT_TIMED_OUT || place->stage == MODBUS_CLIENT_EXPIRED;
        if (is_late && place->message.transaction == transaction && (newest == NULL || place->ticket > newest->ticket))
            newest = place;
    }
    return newest;
}

/* A misfit, with what was expected and found. */
struct judgement {
    enum modbus_client_misfit misfit;
    size_t expected, found;
};

static struct judgement differ(enum modbus_client_misfit misfit, size_t expected, size_t found)
{
    return (struct judgement){expected == found ? MODBUS_CLIENT_FITS : misfit, expected, found};
}

static struct judgement echo(bool is_same)
{
    return (struct judgement){.misfit = is_same ? MODBUS_CLIENT_FITS : MODBUS_CLIENT_ECHO};
}

static bool is_read(const struct modbus_message *request)
{
    return request->shape == MODBUS_READ || request->shape == MODBUS_READ_WRITE;
}

/* How many bytes of data the reply to a read has. */
static unsigned asked_bytes(const struct modbus_message *request)
{
    if (request->shape == MODBUS_READ_WRITE)
        return 2u * request->read_quantity;
    return request->function <= 2 ? (request->quantity + 7u) / 8 : 2u * request->quantity;
}

/* FM-93 */
static bool is_mirrored(const struct modbus_message *request)
{
    if (is_read(request))
        return request->address >> 8 == (int)asked_bytes(request);
    if (request->shape == MODBUS_READ_QUEUE)
        return request->address <= 64; /* its reply has its byte count there */
    return request->shape != MODBUS_WRITE_COILS && request->shape != MODBUS_WRITE_WORDS && request->shape != MODBUS_RANGES;
}

/* Whether the runs of a reply have the registers that were asked for. */
static bool are_contents(const struct modbus_message *request, const struct modbus_message *reply)
{
    size_t asked = 0, found = 0;
    for (; asked < request->quantity && found < reply->quantity; asked += 7) {
        size_t size = reply->bytes[found];
        if (size != 1u + 512u * request->bytes[asked + 5] + 2u * request->bytes[asked + 6])
            return false;
        found += 1 + size;
    }
    return asked == request->quantity && found == reply->quantity;
}

/* FM-44: the data of a reply. */
static struct judgement judge_data(const struct modbus_message *request, const struct modbus_message *reply)
{
    bool is_address = request->address == reply->address;
    switch (request->shape) {
    case MODBUS_READ:
    case MODBUS_READ_WRITE:
        return differ(MODBUS_CLIENT_QUANTITY, asked_bytes(request), request->function <= 2 ? reply->quantity / 8u : 2u * reply->quantity);
    case MODBUS_WRITE_COIL:
        return echo(is_address && request->coil == reply->coil);
    case MODBUS_WRITE_REGISTER:
        return echo(is_address && request->value == reply->value);
    case MODBUS_MASK:
        return echo(is_address && request->and_mask == reply->and_mask && request->or_mask == reply->or_mask);
    case MODBUS_WRITE_COILS:
    case MODBUS_WRITE_WORDS:
        return echo(is_address && request->quantity == reply->quantity);
    case MODBUS_DIAGNOSTIC: {
        bool is_same = request->quantity == reply->quantity &&
                       memcmp(request->registers, reply->registers, request->quantity * sizeof *request->registers) == 0;
        return echo(request->subfunction == reply->subfunction && (request->subfunction > 0 || is_same));
    }
    case MODBUS_RECORDS:
        return echo(request->quantity == reply->quantity && memcmp(request->bytes, reply->bytes, request->quantity) == 0);
    case MODBUS_RANGES:
        return echo(are_contents(request, reply));
    case MODBUS_IDENTIFY:
        return echo(reply->shape == MODBUS_IDENTIFICATION && request->category == reply->category);
    case MODBUS_RAW:
        return echo(reply->shape == MODBUS_RAW);
    default:
        return echo(true);
    }
}

/* FM-44, FM-84 */
static struct judgement judge(const struct modbus_client *client, const struct modbus_client_place *place,
                              const struct modbus_item *item)
{
    const struct modbus_message *request = asked(place), *reply = &item->message;
    if (!client->config.any_unit && reply->unit != place->message.unit)
        return differ(MODBUS_CLIENT_UNIT, place->message.unit, reply->unit);
    if (item->error != MODBUS_NO_ERROR)
        return (struct judgement){.misfit = MODBUS_CLIENT_MALFORMED};
    if (reply->function != request->function)
        return differ(MODBUS_CLIENT_FUNCTION, request->function, reply->function);
    if (reply->shape != MODBUS_EXCEPTION)
        return judge_data(request, reply);
    bool is_last = client->decoder.ended && client->decoder.length == 0 && !client->is_cut;
    bool is_doubtful = !is_tcp(client) && client->is_doubtful && !is_last;
    return (struct judgement){.misfit = is_doubtful ? MODBUS_CLIENT_DOUBTFUL : MODBUS_CLIENT_FITS};
}

/* FM-95: the line may have returned the request. */
static bool is_equal(const struct modbus_client_place *place, const struct modbus_item *item)
{
    uint8_t request[MODBUS_MAX_LEN], reply[MODBUS_MAX_LEN];
    size_t length = modbus_encode(&place->message, MODBUS_RTU, request, sizeof request);
    return place->stage == MODBUS_CLIENT_IN_FLIGHT && modbus_encode(&item->message, MODBUS_RTU, reply, sizeof reply) == length &&
           memcmp(request, reply, length) == 0;
}

static void say_misfit(struct modbus_client_event *event, const struct judgement *judgement, const struct modbus_item *item)
{
    event->misfit = judgement->misfit;
    event->expected = (uint16_t)judgement->expected;
    event->found = (uint16_t)judgement->found;
    event->error = modbus_fault_of(item);
}

static struct modbus_client_event *stray(struct modbus_client *client, const struct modbus_message *message)
{
    struct modbus_client_event *event = remark(client, MODBUS_CLIENT_STRAY);
    event->transaction = message->transaction;
    event->unit = message->unit;
    event->function = message->function;
    return event;
}

/* Section 7.3 */
static void take_frame(struct modbus_client *client, uint64_t now, const struct modbus_item *item)
{
    struct modbus_client_place *place = find_in_flight(client, item->message.transaction);
    if (place == NULL) {
        struct modbus_client_place *late = find_late(client, item->message.transaction);
        struct modbus_client_event *event = stray(client, &item->message);
        if (late != NULL) {
            event->late = late->ticket;
            forget_late(late);
        }
        return;
    }
    struct judgement judgement = judge(client, place, item);
    if (judgement.misfit == MODBUS_CLIENT_DOUBTFUL && !client->decoder.ended && client->decoder.length == 0) {
        client->holds = true;
        client->held = *item;
        return;
    }
    if (judgement.misfit != MODBUS_CLIENT_FITS && !is_tcp(client)) {
        say_misfit(stray(client, &item->message), &judgement, item);
        return;
    }
    bool has_returned = !is_tcp(client) && is_equal(place, item);
    if (has_returned && !client->is_proven) {
        place->is_returned = true;
        return;
    }
    client->is_proven |= !has_returned;
    rest(client, now, client->config.pause);
    if (place->stage == MODBUS_CLIENT_PROBING) {
        place->stage = MODBUS_CLIENT_QUEUED;
        place->is_probed = true;
    } else if (judgement.misfit == MODBUS_CLIENT_FITS) {
        uint16_t quantity = place->message.quantity;
        bool is_bits = item->message.shape == MODBUS_BITS;
        place->message = item->message;
        if (is_bits)
            place->message.quantity = quantity;
        end_request(client, place, MODBUS_CLIENT_REPLIED, NULL);
    } else {
        say_misfit(end_request(client, place, MODBUS_CLIENT_FAILED, NULL), &judgement, item);
    }
}

static void read_items(struct modbus_client *client, uint64_t now)
{
    struct modbus_item item;
    while (modbus_next(&client->decoder, &item)) {
        if (item.error == MODBUS_NO_ERROR || item.error > MODBUS_NOISE) {
            take_frame(client, now, &item);
            continue;
        }
        client->is_doubtful = true;
        if (item.error == MODBUS_NOISE)
            continue;
        client->step.last = modbus_fault_of(&item);
        remark(client, MODBUS_CLIENT_CORRUPT)->error = client->step.last;
    }
}

/* FM-84: more bytes have come after the exception that is in doubt, or the input has ended. */
static void decide(struct modbus_client *client, uint64_t now)
{
    if (!client->holds)
        return;
    struct modbus_item held = client->held;
    client->holds = false;
    take_frame(client, now, &held);
}

static void end_bytes(struct modbus_client *client, uint64_t now)
{
    client->is_cut = client->is_partial;
    client->is_busy = client->is_partial = false;
    modbus_end(&client->decoder);
    decide(client, now);
    read_items(client, now);
}

/* What begins with some bytes (FM-86). */
enum begins { OTHER, PART, WHOLE };

/* Whether the reply to a read, as far as it has come, counts the bytes that were asked for. */
static bool has_asked_count(const struct modbus_message *request, const uint8_t *d, size_t length)
{
    return length < 3 || d[1] >= 0x80 || !is_read(request) || d[2] == asked_bytes(request);
}

static enum begins begins_reply(const struct modbus_client *client, const struct modbus_client_place *place, const uint8_t *d, size_t length)
{
    const struct modbus_message *request = asked(place);
    size_t n;
    if (!client->config.any_unit && d[0] != place->message.unit)
        return OTHER;
    if (length > 1 && (d[1] & 0x7F) != request->function)
        return OTHER;
    bool is_whole = modbus_is_right(d, length);
    if (!modbus_rtu_length(d, length, MODBUS_SERVER, &n))
        return n == 0 && is_whole ? WHOLE : PART;
    if (n < length || !has_asked_count(request, d, length))
        return OTHER;
    return n > length ? PART : is_whole ? WHOLE : OTHER;
}

/* FM-86 */
static void wait_for_rest(struct modbus_client *client)
{
    const struct modbus_client_place *place = find_in_flight(client, 0);
    bool is_first = false, is_part = false, is_whole = false;
    const uint8_t *held = client->decoder.held;
    for (size_t at = 0; place != NULL && at < client->decoder.length; at++) {
        enum begins begins = begins_reply(client, place, held + at, client->decoder.length - at);
        is_first |= at == 0 && begins == PART;
        is_part |= begins == PART;
        is_whole |= begins == WHOLE;
    }
    if (is_first || (is_part && !is_whole)) {
        client->is_partial = true;
        client->silent_at = client->silent_at > place->deadline ? client->silent_at : place->deadline;
    }
}

/* FM-88, FM-92: how many of the first bytes are not to be read. */
static size_t remove_echo(struct modbus_client *client, const uint8_t *data, size_t size)
{
    struct line_echo_error error;
    size_t own = line_echo_receive(&client->echo, client->sent, data, size, &error);
    if (error.kind == LINE_ECHO_NOT_SET) {
        modbus_init(&client->decoder, MODBUS_SERVER, MODBUS_RTU);
        client->holds = false;
    }
    if (error.kind != LINE_ECHO_NONE)
        remark(client, MODBUS_CLIENT_LINE_ECHO)->echo = error;
    return own;
}

/* FM-49, FM-81 */
size_t modbus_client_input(struct modbus_client *client, uint64_t now, const uint8_t *data, size_t size)
{
    struct modbus_fault error;
    if (!client->is_up) {
        remark(client, MODBUS_CLIENT_UNEXPECTED);
        return size;
    }
    size_t taken = remove_echo(client, data, size);
    if (taken == size)
        return size;
    if (client->is_busy && !client->is_partial && now >= client->silent_at)
        end_bytes(client, now);
    if (!is_tcp(client)) {
        client->is_busy = true;
        client->is_partial = false;
        client->silent_at = after(now, client->config.silence);
    }
    while (taken < size) {
        taken += modbus_push(&client->decoder, data + taken, size - taken);
        decide(client, now);
        read_items(client, now);
    }
    if (!is_tcp(client))
        wait_for_rest(client);
    else if (modbus_step_is_lost(&client->step, &client->decoder, &error))
        remark(client, MODBUS_CLIENT_OUT_OF_STEP)->error = error;
    return size;
}

/* FM-50 */
void modbus_client_timeout(struct modbus_client *client, uint64_t now)
{
    bool has_ended = false;
    if (client->is_busy && now >= client->silent_at)
        end_bytes(client, now);
    if (now >= client->quiet_until)
        client->is_quiet = false;
    for (size_t i = 0; i < client->config.places; i++) {
        struct modbus_client_place *place = &client->places[i];
        if (!is_in_flight(place) || now < place->deadline)
            continue;
        has_ended = true;
        if (place->stage == MODBUS_CLIENT_PROBING) {
            place->stage = MODBUS_CLIENT_QUEUED;
            place->is_probed = true;
            continue;
        }
        end_request(client, place, MODBUS_CLIENT_FAILED, place->is_returned ? "returned" : "timed_out");
        place->stage = MODBUS_CLIENT_TIMED_OUT;
    }
    if (!has_ended)
        return;
    rest(client, now, later(client->config.pause, is_tcp(client) ? 0 : client->config.settle));
}

static bool is_broadcast(const struct modbus_client *client, const struct modbus_message *request)
{
    return client->config.broadcast && request->unit == 0;
}

/* FM-39 */
static struct modbus_client_place *find_place(struct modbus_client *client)
{
    struct modbus_client_place *oldest = NULL;
    for (size_t i = 0; i < client->config.places; i++) {
        struct modbus_client_place *place = &client->places[i];
        if (place->stage == MODBUS_CLIENT_FREE)
            return place;
        if (place->stage == MODBUS_CLIENT_EXPIRED && (oldest == NULL || place->expired < oldest->expired))
            oldest = place;
    }
    return oldest;
}

uint64_t modbus_client_request(struct modbus_client *client, const struct modbus_message *request)
{
    uint8_t frame[MODBUS_MAX_LEN];
    struct modbus_client_place *place = find_place(client);
    bool is_reply = request->shape >= MODBUS_BITS && request->shape < MODBUS_RAW;
    bool asks = request->shape == MODBUS_IDENTIFY || modbus_asks(request->function);
    if (place == NULL || is_reply || (is_broadcast(client, request) && asks) ||
        modbus_encode(request, framing_of(client), frame, sizeof frame) == 0)
        return 0;
    place->stage = MODBUS_CLIENT_QUEUED;
    place->is_probed = place->is_returned = false;
    place->ticket = ++client->tickets;
    place->message = *request;
    place->message.transaction = 0;
    return place->ticket;
}

const struct modbus_message *modbus_client_reply(const struct modbus_client *client, const struct modbus_client_event *event)
{
    return &client->places[event->place].message;
}

bool modbus_client_event(struct modbus_client *client, struct modbus_client_event *event)
{
    if (!TAKE_EVENT(client, event))
        return false;
    if (event->kind > MODBUS_CLIENT_FAILED)
        return true;
    struct modbus_client_place *place = &client->places[event->place];
    if (place->stage == MODBUS_CLIENT_TIMED_OUT) {
        place->stage = MODBUS_CLIENT_EXPIRED;
        place->expired = client->expiries++;
    } else {
        place->stage = MODBUS_CLIENT_FREE;
    }
    return true;
}

/* FM-40 */
static struct modbus_client_place *find_next(struct modbus_client *client)
{
    struct modbus_client_place *oldest = NULL;
    unsigned in_flight = 0;
    for (size_t i = 0; i < client->config.places; i++) {
        struct modbus_client_place *place = &client->places[i];
        in_flight += is_in_flight(place);
        if (place->stage == MODBUS_CLIENT_QUEUED && (oldest == NULL || place->ticket < oldest->ticket))
            oldest = place;
    }
    bool is_line_busy = (client->config.framing == MODBUS_LINE_RTU || client->config.echo) && client->is_busy;
    bool may_send = client->is_up && !client->is_quiet && !is_line_busy && in_flight < client->config.in_flight;
    return may_send ? oldest : NULL;
}

/* FM-93 */
static size_t encode_probe(const struct modbus_client_place *place, uint8_t *out, size_t size)
{
    struct modbus_message probe = PROBE;
    probe.unit = place->message.unit;
    return modbus_encode(&probe, MODBUS_RTU, out, size);
}

static bool needs_probe(const struct modbus_client *client, const struct modbus_client_place *place)
{
    bool is_asked = !is_broadcast(client, &place->message) && is_mirrored(&place->message);
    return is_asked && !client->is_proven && !place->is_probed;
}

/* FM-42, FM-43 */
size_t modbus_client_transmit(struct modbus_client *client, uint64_t now, uint8_t *out, size_t size)
{
    struct modbus_client_place *place = find_next(client);
    if (place == NULL || size < MODBUS_MAX_LEN)
        return 0;
    bool announces = is_broadcast(client, &place->message);
    if (is_tcp(client) && !announces) {
        do // FM-41
            client->transaction++;
        while (find_in_flight(client, client->transaction) != NULL || find_late(client, client->transaction) != NULL);
        place->message.transaction = client->transaction;
    }
    bool is_proof = announces || !is_mirrored(&place->message), probes = needs_probe(client, place);
    size_t length = probes ? encode_probe(place, out, size) : modbus_encode(&place->message, framing_of(client), out, size);
    if (!is_tcp(client))
        line_echo_sent(&client->echo, client->sent, out, length, is_proof || probes);
    client->is_doubtful = false;
    if (announces) {
        end_request(client, place, MODBUS_CLIENT_ANNOUNCED, NULL);
        be_quiet(client, after(now, client->config.turnaround));
    } else {
        place->stage = probes ? MODBUS_CLIENT_PROBING : MODBUS_CLIENT_IN_FLIGHT;
        place->deadline = after(now, client->config.timeout);
    }
    return length;
}

/* FM-55 */
bool modbus_client_deadline(const struct modbus_client *client, uint64_t *deadline)
{
    *deadline = client->is_busy ? client->silent_at : NEVER;
    if (client->is_quiet)
        *deadline = sooner(*deadline, client->quiet_until);
    for (size_t i = 0; i < client->config.places; i++)
        if (is_in_flight(&client->places[i]))
            *deadline = sooner(*deadline, client->places[i].deadline);
    return *deadline < NEVER;
}
