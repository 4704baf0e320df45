/* JSON as one line of text, written front to back: lists of a million ids need no tree in
 * memory. */
#ifndef JSON_TEXT_H
#define JSON_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct json_text {
    char *text; /* what was written so far; not terminated */
    size_t used, capacity;
    bool comma;  /* something precedes at this depth */
    bool failed; /* out of memory: the text is not complete */
} json_text;

/* key NULL: an element of an array. bracket: '{' or '['. */
void json_text_open(json_text *j, const char *key, char bracket);
void json_text_close(json_text *j, char bracket); /* '}' or ']' */
/* Text that is no UTF-8 has its wrong bytes replaced by U+FFFD; NULL is null. */
void json_text_string(json_text *j, const char *key, const char *value);
void json_text_count(json_text *j, const char *key, uint64_t value);
/* The shortest of 15 to 17 digits that reads back as the same double; not finite: null. */
void json_text_number(json_text *j, const char *key, double value);
void json_text_bool(json_text *j, const char *key, bool value);
void json_text_point(json_text *j, const char *key, const double value[3]);
void json_text_ids(json_text *j, const char *key, const uint32_t *ids, uint32_t count);
void json_text_free(json_text *j);

#endif
