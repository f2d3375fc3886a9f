/* The controller of laser-eb90 (section 8 of reference/laser-eb90.md). Its queue of instructions is its owner's. */
#ifndef CELLWIRE_LASER_CONTROLLER_H
#define CELLWIRE_LASER_CONTROLLER_H

#include "cellwire/laser_eb90.h"
#include "cellwire/laser_words.h"
#include "cellwire/line_echo.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LASER_CONTROLLER_EVENTS 64

/* The owner of a controller, asked while a frame is judged (LE-92 to LE-94). Parameters are items, read by laser_eb90_item. */
struct laser_controller_owner {
    void *context;
    /* Whether it takes these parameters of an interpreted word. */
    bool (*takes)(void *context, uint16_t word, const uint8_t *parameters, size_t length);
    /* For how many instructions its queue has room. */
    size_t (*room)(void *context);
    void (*queue)(void *context, uint16_t word, const uint8_t *parameters, size_t length);
};

/* LE-109; times in nanoseconds. */
struct laser_controller_config {
    struct laser_eb90_profile profile;
    struct laser_words words;
    unsigned batch;
    uint64_t tick, silence;
    bool echo; /* the line returns what is sent */
    struct laser_controller_owner owner;
};

/* All but the owner. */
struct laser_controller_config laser_controller_default(void);

enum laser_controller_kind {
    LASER_CONTROLLER_EXECUTE, /* class, word; the parameters are laser_controller_parameters */
    LASER_CONTROLLER_QUEUED,  /* count */
    LASER_CONTROLLER_REFUSED, /* refusal */
    LASER_CONTROLLER_CORRUPT, /* error: its kind and numbers */
    LASER_CONTROLLER_LINE_ECHO, /* echo: something else than the answer has come back */
    LASER_CONTROLLER_UNEXPECTED,
};

struct laser_controller_event {
    enum laser_controller_kind kind;
    enum laser_words_class word_class;
    uint16_t word;
    size_t count;
    enum laser_words_error refusal;
    enum laser_eb90_kind error;
    size_t error_offset, expected, found;
    struct line_echo_error echo;
};

enum laser_controller_work { LASER_CONTROLLER_LISTENING, LASER_CONTROLLER_EXECUTING, LASER_CONTROLLER_ANSWERING };
enum laser_controller_line { LASER_CONTROLLER_DISCONNECTED, LASER_CONTROLLER_SILENT, LASER_CONTROLLER_BYTES };

struct laser_controller {
    struct laser_controller_config config;
    struct laser_eb90_decoder decoder;
    enum laser_controller_work work;
    bool rest; /* the last answer was an error code for corrupt bytes */
    enum laser_controller_line line;
    uint64_t silent_at;
    bool has_fault, is_fault_answered; /* of the stretch */
    enum laser_words_error fault;
    size_t fault_len; /* counted to 8 */
    struct laser_eb90_result frame; /* the last one */
    uint16_t word;                  /* that is executed */
    bool has_peer;                  /* whose answer it is */
    struct laser_eb90_payload answer;
    bool is_resent; /* the answer makes a host send again */
    uint64_t due;
    struct line_echo echo;
    uint8_t sent[LASER_EB90_MAX_LEN]; /* the last answer, if `echo` compares it */
    struct laser_controller_event events[LASER_CONTROLLER_EVENTS];
    size_t event_count;
};

/* false: the configuration is refused. */
bool laser_controller_init(struct laser_controller *controller, const struct laser_controller_config *config);

/* After each of these: take the events, then what is to be transmitted. */
void laser_controller_connected(struct laser_controller *controller, uint64_t now);
void laser_controller_disconnected(struct laser_controller *controller, uint64_t now);
void laser_controller_timeout(struct laser_controller *controller, uint64_t now);

/* Takes bytes, all of them; returns how many. */
size_t laser_controller_input(struct laser_controller *controller, uint64_t now, const uint8_t *data, size_t size);

/* The parameters of the instruction that is executed. */
const uint8_t *laser_controller_parameters(const struct laser_controller *controller, size_t *length);

/* It was executed; a query has values (NULL: none), of the controller's profile. false: refused, nothing has changed (LE-83). */
bool laser_controller_answer(struct laser_controller *controller, uint64_t now, const struct laser_eb90_payload *values);

/* It was not; false: nothing is executed. */
bool laser_controller_refuse(struct laser_controller *controller, uint64_t now, enum laser_words_error refusal);

/* The next event; false: there is none. */
bool laser_controller_event(struct laser_controller *controller, struct laser_controller_event *event);

/* The bytes that are to be sent now, at most LASER_EB90_MAX_LEN; 0: nothing. */
size_t laser_controller_transmit(struct laser_controller *controller, uint64_t now, uint8_t *out, size_t size);

/* When `timeout` is to be called, or an answer may be sent, at the latest; false: never. */
bool laser_controller_deadline(const struct laser_controller *controller, uint64_t *deadline);

#ifdef __cplusplus
}
#endif

#endif
