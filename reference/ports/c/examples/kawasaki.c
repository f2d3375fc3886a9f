/* kawasaki-msg: <TilausAlkaa$4#50$1#> */
#include <assert.h>
#include <cellwire/kawasaki_msg.h>

#define TEXT(string) {(const uint8_t *)(string), sizeof(string) - 1}

int main(void)
{
    const struct kawasaki_msg_text name = TEXT("TilausAlkaa"), fields[] = {TEXT("50"), TEXT("1")};
    static struct kawasaki_msg_decoder decoder;
    static struct kawasaki_msg_item item;
    struct kawasaki_msg_text value;
    uint8_t bytes[64];
    size_t length = kawasaki_msg_encode(name, NULL, 0, fields, 2, false, bytes, sizeof bytes), at = 0;
    kawasaki_msg_push(&decoder, bytes, length);
    assert(kawasaki_msg_next(&decoder, &item) && item.error.kind == KAWASAKI_MSG_MESSAGE);
    return kawasaki_msg_value(&item.fields, &at, &value) && value.length == 2 ? 0 : 1;
}
