/* val2-viewer: a pose */
#include <cellwire/val2_viewer.h>

int main(void)
{
    const struct val2_viewer_pose pose = {.count = 7, .words = {16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16}};
    uint8_t line[VAL2_VIEWER_MAX_LEN];
    return val2_viewer_encode(&pose, line, sizeof line) > 0 ? 0 : 1;
}
