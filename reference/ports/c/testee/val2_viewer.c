#include "cellwire/val2_viewer.h"

#include "link.h"

static struct val2_viewer_decoder decoder;

static bool begin(const struct json *request)
{
    (void)request;
    val2_viewer_init(&decoder);
    return true;
}

static size_t push(const uint8_t *data, size_t size) { return val2_viewer_push(&decoder, data, size); }

static void end(void) { val2_viewer_end(&decoder); }

void print_viewer_error(const struct val2_viewer_item *item)
{
    static const char *const KINDS[] = {"", "format", "number", "checksum", "too_long", "incomplete", "noise"};
    print("{\"kind\":\"%s\"", KINDS[item->kind]);
    if (item->kind == VAL2_VIEWER_FORMAT || item->kind == VAL2_VIEWER_NUMBER)
        print(",\"offset\":%zu", item->error_offset);
    else if (item->kind == VAL2_VIEWER_CHECKSUM)
        print(",\"expected\":%d,\"found\":%d", item->expected, item->found);
    else if (item->kind == VAL2_VIEWER_TOO_LONG)
        print(",\"limit\":%d", VAL2_VIEWER_MAX_LEN);
    else
        print(",\"length\":%zu", item->length);
    print("}");
}

void print_viewer_pose(const struct val2_viewer_pose *pose)
{
    print("{\"count\":%d,\"pose\":", pose->count);
    PRINT_LIST(pose->words, VAL2_VIEWER_WORDS);
    print("}");
}

bool read_viewer_words(const struct json *list, int16_t words[VAL2_VIEWER_WORDS])
{
    int64_t values[VAL2_VIEWER_WORDS];
    if (!read_list(list, VAL2_VIEWER_WORDS, INT16_MIN, INT16_MAX, values))
        return false;
    for (int word = 0; word < VAL2_VIEWER_WORDS; word++)
        words[word] = (int16_t)values[word];
    return true;
}

static bool next(bool ended)
{
    struct val2_viewer_item item;
    if (!val2_viewer_next(&decoder, &item))
        return false;
    print_item(item.offset, item.length, ended);
    if (item.kind != VAL2_VIEWER_POSE) {
        print("\"error\":");
        print_viewer_error(&item);
        return true;
    }
    print("\"message\":");
    print_viewer_pose(&item.pose);
    return true;
}

static size_t encode(const struct json *message, uint8_t *out, size_t size)
{
    struct val2_viewer_pose pose;
    int64_t count;
    if (message->count != 2 || !json_integer(json_get(message, "count"), 0, UINT16_MAX, &count) ||
        !read_viewer_words(json_get(message, "pose"), pose.words))
        return 0;
    pose.count = (uint16_t)count;
    return val2_viewer_encode(&pose, out, size);
}

const struct link VAL2_VIEWER = {"val2-viewer", begin, push, end, next, encode};
