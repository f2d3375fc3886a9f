/* What the testee needs of a link. */
#ifndef CELLWIRE_LINK_H
#define CELLWIRE_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "cellwire/isra_ball.h"
#include "cellwire/kawasaki_msg.h"
#include "cellwire/laser_eb90.h"
#include "cellwire/laser_words.h"
#include "cellwire/mmacell_proto.h"
#include "cellwire/modbus_line.h"
#include "cellwire/val2_alter.h"
#include "cellwire/val2_viewer.h"
#include "json.h"

#define MAX_FRAME 4096

/* Adds to the answer, as printf does. */
void print(const char *format, ...);

struct link {
    const char *name;
    /* Begins with `from` and `options` of a request; false: they are not implemented. */
    bool (*begin)(const struct json *request);
    size_t (*push)(const uint8_t *data, size_t size);
    void (*end)(void);
    /* Prints the next item, by print_item and then `"message":…` or `"error":…`; false: there is none. */
    bool (*next)(bool ended);
    /* The bytes of a message; 0: refused. */
    size_t (*encode)(const struct json *message, uint8_t *out, size_t size);
};

/* Begins the object of an item, with `"end":true` if `ended`. */
void print_item(uint64_t offset, size_t length, bool ended);

/* Prints a list of integers. */
#define PRINT_LIST(values, count)                                                                                      \
    do {                                                                                                               \
        print("[");                                                                                                    \
        for (size_t i_ = 0; i_ < (size_t)(count); i_++)                                                                \
            print("%s%ld", i_ > 0 ? "," : "", (long)(values)[i_]);                                                     \
        print("]");                                                                                                    \
    } while (0)

/* Reads a list of exactly `count` integers within low..=high; false: it is none. */
bool read_list(const struct json *list, size_t count, int64_t low, int64_t high, int64_t *values);

extern const struct link FANUC_HMI_MODBUS, ISRA_BALL, KAWASAKI_MSG, LASER_EB90, MMACELL_PROTO, VAL2_ALTER, VAL2_VIEWER;

/* Shared by a link's codec and its sessions. */
void print_alter_message(const struct val2_alter_message *message);
void print_alter_error(const struct val2_alter_error *error);
void read_laser_profile(const struct json *options, struct laser_eb90_profile *profile);
void read_laser_words(const struct json *object, struct laser_words *words);
void print_laser_list(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t at);
void print_laser_items(const struct laser_eb90_profile *profile, const uint8_t *payload, size_t length, size_t at);
void print_laser_error(enum laser_eb90_kind kind, size_t error_offset, size_t expected, size_t found);
bool put_laser_item(struct laser_eb90_payload *payload, const struct json *item);
void print_kawasaki_error(const struct kawasaki_msg_error *error, size_t length); /* with its key */
void print_kawasaki_text(const struct kawasaki_msg_text *text);
void print_isra_packet(const struct isra_ball_packet *packet);
void print_modbus_message(const struct modbus_message *message, bool has_transaction);
void print_modbus_error(const struct modbus_fault *fault);
bool read_modbus_request(const struct json *object, struct modbus_message *message);
void print_viewer_pose(const struct val2_viewer_pose *pose);
void print_viewer_error(const struct val2_viewer_item *item);
bool read_viewer_words(const struct json *list, int16_t words[VAL2_VIEWER_WORDS]);
void print_mmacell_status(const struct mmacell_proto_message *message); /* its fields */
void print_mmacell_message(const struct mmacell_proto_message *message);
void print_mmacell_error(const struct mmacell_proto_item *item);
bool read_mmacell_command(const struct json *object, struct mmacell_proto_message *message);
void read_mmacell_dialect(const struct json *options, struct mmacell_proto_dialect *dialect);
struct val2_alter_framing read_alter_framing(const struct json *options);

#endif
