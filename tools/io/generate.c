#include "generate.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "generate_parts.h"
#include "model_parts.h"

static const generate_kind *const kinds[] = {&generate_blocks, &generate_city, &generate_boxfield,
                                             &generate_building, &generate_sodacity};
enum { KIND_COUNT = sizeof kinds / sizeof kinds[0] };

/* What a spec says, ready to be run. */
typedef struct request {
    const generate_kind *kind;
    uint64_t values[GENERATE_MAX_KEYS];
} request;

static void list_kinds(char *text, size_t size)
{
    size_t used = 0;
    text[0] = 0;
    for (int k = 0; k < KIND_COUNT && used < size; ++k) {
        used += (size_t)snprintf(text + used, size - used, "%s%s", k ? ", " : "", kinds[k]->name);
    }
}

static void list_keys(const generate_kind *kind, char *text, size_t size)
{
    size_t used = 0;
    text[0] = 0;
    for (int k = 0; k < GENERATE_MAX_KEYS && kind->keys[k].name && used < size; ++k) {
        used += (size_t)snprintf(text + used, size - used, "%s%s=%llu", k ? ", " : "",
                                 kind->keys[k].name, (unsigned long long)kind->keys[k].standard);
    }
}

/* Digits, perhaps a fraction, perhaps k or M: 200000, 200k, 1.5M. The result must be whole. */
static bool parse_number(const char *text, size_t length, uint64_t *out)
{
    uint64_t value = 0, scale = 1, divisor = 1;
    size_t i = 0, digits = 0;
    bool fraction = false;
    if (length > 0 && (text[length - 1] == 'k' || text[length - 1] == 'M')) {
        scale = text[length - 1] == 'k' ? 1000 : 1000000;
        --length;
    }
    for (; i < length; ++i) {
        if (text[i] == '.' && !fraction) {
            fraction = true;
            continue;
        }
        if (text[i] < '0' || text[i] > '9' || ++digits > 12) {
            return false;
        }
        value = value * 10 + (uint64_t)(text[i] - '0');
        divisor *= fraction ? 10 : 1;
    }
    if (digits == 0 || value * scale % divisor != 0) {
        return false;
    }
    *out = value * scale / divisor;
    return true;
}

static bool parse_pair(const char *text, size_t length, request *r, umb_error *error)
{
    char list[160];
    const char *equals = memchr(text, '=', length);
    size_t name_length = equals ? (size_t)(equals - text) : length;
    const generate_kind *kind = r->kind;
    list_keys(kind, list, sizeof list);
    for (int k = 0; k < GENERATE_MAX_KEYS && kind->keys[k].name; ++k) {
        const generate_key *key = &kind->keys[k];
        if (strlen(key->name) != name_length || memcmp(key->name, text, name_length) != 0) {
            continue;
        }
        if (!equals || !parse_number(equals + 1, length - name_length - 1, &r->values[k]) ||
            r->values[k] < key->min || r->values[k] > key->max) {
            return model_fail(
                error, UMB_ERROR_ARGUMENT,
                "gen:%s: '%.*s': %s takes a whole number from %llu to %llu, k and M allowed",
                kind->name, (int)(length < 40 ? length : 40), text, key->name,
                (unsigned long long)key->min, (unsigned long long)key->max);
        }
        return true;
    }
    return model_fail(error, UMB_ERROR_ARGUMENT,
                      "gen:%s has no '%.*s'; its keys and their defaults: %s", kind->name,
                      (int)(name_length < 40 ? name_length : 40), text, list);
}

static bool parse(const char *spec, request *r, umb_error *error)
{
    char list[160];
    if (strncmp(spec, "gen:", 4) != 0) {
        return model_fail(error, UMB_ERROR_ARGUMENT,
                          "'%.60s' is no generator: write gen:NAME,key=value", spec);
    }
    const char *name = spec + 4;
    size_t length = strcspn(name, ",");
    r->kind = NULL;
    for (int k = 0; k < KIND_COUNT; ++k) {
        if (strlen(kinds[k]->name) == length && memcmp(kinds[k]->name, name, length) == 0) {
            r->kind = kinds[k];
        }
    }
    if (!r->kind) {
        list_kinds(list, sizeof list);
        return model_fail(error, UMB_ERROR_ARGUMENT, "no generator '%.*s'; there are: %s",
                          (int)(length < 40 ? length : 40), name, list);
    }
    for (int k = 0; k < GENERATE_MAX_KEYS; ++k) {
        r->values[k] = r->kind->keys[k].standard;
    }
    const char *at = name + length;
    while (*at == ',') {
        ++at;
        length = strcspn(at, ",");
        if (!parse_pair(at, length, r, error)) {
            return false;
        }
        at += length;
    }
    return true;
}

model *generate_model(const char *spec, const model_options *options, umb_error *error)
{
    request r;
    if (!parse(spec, &r, error)) {
        return NULL;
    }
    model *m = model_create();
    if (!m || !r.kind->model(r.values, m)) {
        model_free(m);
        model_fail(error, UMB_ERROR_MEMORY, "%.60s: not enough memory; ask for a smaller scene",
                   spec);
        return NULL;
    }
    if (!model_finish(m, options, error)) {
        model_free(m);
        return NULL;
    }
    return m;
}

bool generate_path(const char *spec, camera_path *out, umb_error *error)
{
    request r;
    memset(out, 0, sizeof *out);
    if (!parse(spec, &r, error)) {
        return false;
    }
    if (!r.kind->path(r.values, out)) {
        free(out->rows);
        memset(out, 0, sizeof *out);
        return model_fail(error, UMB_ERROR_MEMORY, "%.60s: not enough memory for the path", spec);
    }
    return true;
}
