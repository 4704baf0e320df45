#include "json_text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool reserve(json_text *j, size_t more)
{
    if (j->failed) {
        return false;
    }
    if (more <= j->capacity - j->used) {
        return true;
    }
    size_t wanted = j->capacity * 2 + more + 4096;
    char *text = realloc(j->text, wanted);
    if (!text) {
        j->failed = true;
        return false;
    }
    j->text = text;
    j->capacity = wanted;
    return true;
}

static void put(json_text *j, const char *bytes, size_t count)
{
    if (reserve(j, count)) {
        memcpy(j->text + j->used, bytes, count);
        j->used += count;
    }
}

static void put_byte(json_text *j, char byte)
{
    put(j, &byte, 1);
}

/* Length of the well-formed UTF-8 sequence at s; 0: there is none. Shortest forms only, no
 * surrogates. */
static size_t sequence(const unsigned char *s)
{
    size_t more = s[0] < 0x80                   ? 0
                  : s[0] >= 0xC2 && s[0] < 0xE0 ? 1
                  : s[0] >= 0xE0 && s[0] < 0xF0 ? 2
                  : s[0] >= 0xF0 && s[0] < 0xF5 ? 3
                                                : 4;
    if (more == 4) {
        return 0;
    }
    for (size_t i = 1; i <= more; ++i) {
        if ((s[i] & 0xC0) != 0x80) {
            return 0;
        }
    }
    bool wrong = (s[0] == 0xE0 && s[1] < 0xA0) || (s[0] == 0xED && s[1] >= 0xA0) ||
                 (s[0] == 0xF0 && s[1] < 0x90) || (s[0] == 0xF4 && s[1] >= 0x90);
    return wrong ? 0 : more + 1;
}

static void put_quoted(json_text *j, const char *value)
{
    const unsigned char *s = (const unsigned char *)value;
    put_byte(j, '"');
    while (*s) {
        size_t length = sequence(s);
        if (length == 0) {
            put(j, "\xEF\xBF\xBD", 3);
            ++s;
        } else if (*s < 0x20) {
            char escape[8];
            snprintf(escape, sizeof escape, "\\u%04x", *s++);
            put(j, escape, 6);
        } else {
            if (*s == '"' || *s == '\\') {
                put_byte(j, '\\');
            }
            put(j, (const char *)s, length);
            s += length;
        }
    }
    put_byte(j, '"');
}

static void begin(json_text *j, const char *key)
{
    if (j->comma) {
        put_byte(j, ',');
    }
    j->comma = true;
    if (key) {
        put_quoted(j, key);
        put_byte(j, ':');
    }
}

void json_text_open(json_text *j, const char *key, char bracket)
{
    begin(j, key);
    put_byte(j, bracket);
    j->comma = false;
}

void json_text_close(json_text *j, char bracket)
{
    put_byte(j, bracket);
    j->comma = true;
}

void json_text_string(json_text *j, const char *key, const char *value)
{
    begin(j, key);
    if (value) {
        put_quoted(j, value);
    } else {
        put(j, "null", 4);
    }
}

void json_text_count(json_text *j, const char *key, uint64_t value)
{
    char digits[24];
    begin(j, key);
    put(j, digits, (size_t)snprintf(digits, sizeof digits, "%llu", (unsigned long long)value));
}

void json_text_number(json_text *j, const char *key, double value)
{
    char digits[40] = "null";
    begin(j, key);
    if (isfinite(value)) {
        for (int precision = 15; precision <= 17; ++precision) {
            snprintf(digits, sizeof digits, "%.*g", precision, value);
            if (strtod(digits, NULL) == value) {
                break;
            }
        }
    }
    put(j, digits, strlen(digits));
}

void json_text_bool(json_text *j, const char *key, bool value)
{
    begin(j, key);
    put(j, value ? "true" : "false", value ? 4 : 5);
}

void json_text_point(json_text *j, const char *key, const double value[3])
{
    json_text_open(j, key, '[');
    for (int i = 0; i < 3; ++i) {
        json_text_number(j, NULL, value[i]);
    }
    json_text_close(j, ']');
}

void json_text_ids(json_text *j, const char *key, const uint32_t *ids, uint32_t count)
{
    json_text_open(j, key, '[');
    for (uint32_t i = 0; i < count; ++i) {
        json_text_count(j, NULL, ids[i]);
    }
    json_text_close(j, ']');
}

void json_text_free(json_text *j)
{
    free(j->text);
    *j = (json_text){0};
}
