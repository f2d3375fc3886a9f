#include "bytes.h"
#include "kawasaki.h"

#define MAX_OWN 1022 /* KM-36 */

static bool is_blank(uint8_t byte)
{
    return byte == ' ' || byte == '\t' || byte == '\n' || byte == '\f' || byte == '\r';
}

void kawasaki_trim(struct kawasaki_msg_text *text)
{
    while (text->length > 0 && is_blank(text->bytes[text->length - 1]))
        text->length--;
    while (text->length > 0 && is_blank(*text->bytes))
        text->bytes++, text->length--;
}

static bool is_digit(uint8_t byte) { return byte >= '0' && byte <= '9'; }

/* One more digit; a value that is too large stays so. */
static void add_digit(int64_t *value, uint8_t digit)
{
    if (*value <= UINT32_MAX)
        *value = *value * 10 + (digit - '0');
}

static bool to_i32(int64_t value, bool is_negative, int32_t *number)
{
    value = is_negative ? -value : value;
    if (value < INT32_MIN || value > INT32_MAX)
        return false;
    *number = (int32_t)value;
    return true;
}

bool kawasaki_number(struct kawasaki_msg_text text, int32_t *number)
{
    int64_t value = 0;
    kawasaki_trim(&text);
    bool is_negative = text.length > 0 && *text.bytes == '-';
    for (size_t i = is_negative; i < text.length; i++) {
        if (!is_digit(text.bytes[i]))
            return false;
        add_digit(&value, text.bytes[i]);
    }
    return text.length > (size_t)is_negative && to_i32(value, is_negative, number);
}

size_t kawasaki_put_number(uint8_t *out, int32_t value, unsigned places)
{
    char digits[MAX_DIGITS];
    uint32_t size = value < 0 ? 0 - (uint32_t)value : (uint32_t)value;
    size_t count = put_decimal(digits, size, places + 1), at = 0;
    if (value < 0)
        out[at++] = '-';
    for (size_t i = 0; i < count; i++) {
        if (places > 0 && i == count - places)
            out[at++] = '.';
        out[at++] = (uint8_t)digits[i];
    }
    return at;
}

static bool unfit(struct kawasaki_fault *fault, enum kawasaki_unfit kind, int64_t found)
{
    fault->unfit = kind;
    fault->found = found;
    return false;
}

static bool is_within(const struct kawasaki_job_field *field, int64_t found, enum kawasaki_unfit kind, struct kawasaki_fault *fault)
{
    return (found >= field->low && found <= field->high) || unfit(fault, kind, found);
}

/* KM-24 */
static bool read_decimal(struct kawasaki_msg_text text, unsigned places, int32_t *number, struct kawasaki_fault *fault)
{
    int64_t value = 0;
    size_t digits = 0, decimals = 0;
    bool has_point = false, is_too_precise = false;
    kawasaki_trim(&text);
    bool is_negative = text.length > 0 && *text.bytes == '-';
    for (size_t i = is_negative; i < text.length; i++) {
        uint8_t byte = text.bytes[i];
        if (byte == '.' && !has_point) {
            has_point = true;
            continue;
        }
        if (!is_digit(byte))
            return unfit(fault, KAWASAKI_UNFIT_NOT_A_NUMBER, 0);
        digits++;
        if (has_point && decimals == places) {
            is_too_precise = is_too_precise || byte != '0';
            continue;
        }
        decimals += has_point;
        add_digit(&value, byte);
    }
    for (; decimals < places; decimals++)
        add_digit(&value, '0');
    if (digits == 0)
        return unfit(fault, KAWASAKI_UNFIT_NOT_A_NUMBER, 0);
    if (is_too_precise)
        return unfit(fault, KAWASAKI_UNFIT_TOO_PRECISE, 0);
    return to_i32(value, is_negative, number) || unfit(fault, KAWASAKI_UNFIT_NOT_A_NUMBER, 0);
}

static bool read_own(const struct kawasaki_job_field *field, struct kawasaki_msg_text text, struct kawasaki_value *value,
                     struct kawasaki_fault *fault)
{
    value->text = text;
    if (field->kind == KAWASAKI_TEXT)
        return is_within(field, (int64_t)text.length, KAWASAKI_UNFIT_LENGTH, fault);
    if (field->kind == KAWASAKI_DECIMAL) {
        if (!read_decimal(text, field->places, &value->number, fault))
            return false;
    } else if (!kawasaki_number(text, &value->number)) {
        return unfit(fault, KAWASAKI_UNFIT_NOT_A_NUMBER, 0);
    }
    return is_within(field, value->number, KAWASAKI_UNFIT_OUT_OF_RANGE, fault);
}

bool kawasaki_job_read(const struct kawasaki_dialect *dialect, const struct kawasaki_msg_text *own, size_t count,
                       struct kawasaki_value *values, struct kawasaki_fault *fault)
{
    size_t size = count > 0 ? own->length + 1 : 0, at = 0;
    memset(fault, 0, sizeof *fault);
    if (size > MAX_OWN) {
        fault->kind = KAWASAKI_JOB_TOO_LONG;
        fault->found = (int64_t)size + 2;
        return false;
    }
    fault->kind = KAWASAKI_UNFIT;
    for (size_t i = 0; i < dialect->job_count; i++) {
        struct kawasaki_msg_text text;
        fault->field = &dialect->job[i];
        if (i >= count)
            return unfit(fault, KAWASAKI_UNFIT_MISSING, 0);
        kawasaki_msg_value(own, &at, &text);
        memset(&values[i], 0, sizeof values[i]);
        if (!read_own(fault->field, text, &values[i], fault))
            return false;
    }
    if (count > dialect->job_count) {
        size_t fixed = kawasaki_entry(dialect, KAWASAKI_JOB, 0)->field_count - 1;
        fault->kind = KAWASAKI_FIELD_COUNT;
        fault->expected = (int64_t)(fixed + dialect->job_count);
        fault->found = (int64_t)(fixed + count);
        return false;
    }
    return true;
}

/* KM-40 */
static bool fits(const struct kawasaki_dialect *dialect, const struct kawasaki_job_field *field, const struct kawasaki_value *value,
                 struct kawasaki_fault *fault)
{
    if (value->is_missing)
        return unfit(fault, KAWASAKI_UNFIT_MISSING, 0);
    if (field->kind != KAWASAKI_TEXT)
        return is_within(field, value->number, KAWASAKI_UNFIT_OUT_OF_RANGE, fault);
    for (size_t i = 0; i < value->text.length; i++) {
        uint8_t byte = value->text.bytes[i];
        if (kawasaki_is_forbidden(byte, true))
            return unfit(fault, KAWASAKI_UNFIT_RESERVED, byte);
        if (kawasaki_is_forbidden(byte, dialect->is_latin1))
            return unfit(fault, KAWASAKI_UNFIT_CHARACTER, byte);
    }
    return is_within(field, (int64_t)value->text.length, KAWASAKI_UNFIT_LENGTH, fault);
}

bool kawasaki_job_write(const struct kawasaki_dialect *dialect, const struct kawasaki_value *values, uint8_t *out, size_t size,
                        size_t *length, struct kawasaki_fault *fault)
{
    memset(fault, 0, sizeof *fault);
    fault->kind = KAWASAKI_UNFIT;
    *length = 0;
    for (size_t i = 0; i < dialect->job_count; i++) {
        uint8_t digits[MAX_DIGITS + 2];
        struct kawasaki_msg_text text = values[i].text;
        fault->field = &dialect->job[i];
        if (!fits(dialect, fault->field, &values[i], fault))
            return false;
        if (fault->field->kind != KAWASAKI_TEXT) {
            text.length = kawasaki_put_number(digits, values[i].number, fault->field->places);
            text.bytes = digits;
        }
        if (*length + text.length + 1 > size)
            return unfit(fault, KAWASAKI_UNFIT_LENGTH, (int64_t)text.length);
        if (i > 0)
            out[(*length)++] = '$';
        if (text.length > 0)
            memcpy(out + *length, text.bytes, text.length);
        *length += text.length;
    }
    return true;
}

size_t kawasaki_job_longest(const struct kawasaki_dialect *dialect)
{
    size_t longest = 0;
    for (size_t i = 0; i < dialect->job_count; i++) {
        const struct kawasaki_job_field *field = &dialect->job[i];
        uint8_t digits[MAX_DIGITS + 2];
        if (field->kind == KAWASAKI_TEXT) {
            longest += (size_t)field->high + 1;
            continue;
        }
        size_t low = kawasaki_put_number(digits, field->low, field->places);
        size_t high = kawasaki_put_number(digits, field->high, field->places);
        longest += (low > high ? low : high) + 1;
    }
    return longest;
}
