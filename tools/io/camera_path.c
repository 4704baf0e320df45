/* Camera paths: CSV text, one view a line. */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "generate.h"
#include "input.h"
#include "model_parts.h"
#include "readers.h"

void camera_path_free(camera_path *p)
{
    free(p->rows);
    p->rows = NULL;
    p->count = 0;
}

/* Numbers of a line, separated by commas, blanks around them. Returns how many, or -1 when there is
 * anything else; *any says whether a field begins with a number, which none of a header does. */
static int read_numbers(const char *line, const char *end, double number[6], bool *any)
{
    int count = 0;
    bool clean = true;
    *any = false;
    for (const char *p = line;; ++p) {
        const char *comma = memchr(p, ',', (size_t)(end - p));
        const char *stop = comma != NULL ? comma : end;
        while (p < stop && isspace((unsigned char)*p)) {
            ++p;
        }
        char *after = NULL;
        double value = p < stop ? strtod(p, &after) : 0.0;
        bool is_number = p < stop && after != p && after <= stop &&
                         strchr("+-.0123456789", *p) != NULL;
        *any = *any || is_number;
        for (; is_number && after < stop && isspace((unsigned char)*after); ++after) {
        }
        is_number = is_number && after == stop && isfinite(value);
        clean = clean && is_number;
        if (is_number && count < 6) {
            number[count] = value;
        }
        ++count;
        if (comma == NULL) {
            return clean ? count : -1;
        }
        p = comma;
    }
}

static bool blank(const char *line, const char *end)
{
    while (line < end && isspace((unsigned char)*line)) {
        ++line;
    }
    return line == end;
}

static bool add_row(camera_path *out, uint32_t *room, const double row[6])
{
    if (out->count == *room) {
        uint32_t larger = *room != 0 ? 2 * *room : 512;
        void *grown = realloc(out->rows, larger * sizeof *out->rows);
        if (grown == NULL) {
            return false;
        }
        out->rows = grown;
        *room = larger;
    }
    memcpy(out->rows[out->count++], row, 6 * sizeof *row);
    return true;
}

static bool read_lines(const char *text, const char *end, const char *name, camera_path *out,
                       umb_error *error)
{
    uint32_t room = 0;
    unsigned line_number = 0;
    for (const char *line = text; line < end;) {
        const char *newline = memchr(line, '\n', (size_t)(end - line));
        const char *stop = newline != NULL ? newline : end;
        double row[6];
        bool any;
        ++line_number;
        int count = read_numbers(line, stop, row, &any);
        if (count == 6) {
            if (!add_row(out, &room, row)) {
                return model_fail_memory(error, name);
            }
        } else if (!blank(line, stop) && (any || out->count != 0)) {
            return model_fail(error, UMB_ERROR_FORMAT,
                              "%s:%u: not six numbers; write ex,ey,ez,tx,ty,tz", name, line_number);
        }
        line = newline != NULL ? newline + 1 : end;
    }
    return out->count != 0 ||
           model_fail(error, UMB_ERROR_FORMAT,
                      "%s: no view in it; write ex,ey,ez,tx,ty,tz, one view a line", name);
}

bool read_camera_path(const char *text, size_t size, const char *name, camera_path *out,
                      umb_error *error)
{
    memset(out, 0, sizeof *out);
    /* A byte order mark is no part of the first line. */
    size_t start = size >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0 ? 3 : 0;
    if (!read_lines(text + start, text + size, name, out, error)) {
        camera_path_free(out);
        return false;
    }
    return true;
}

bool camera_path_load(const char *name, camera_path *out, umb_error *error)
{
    memset(out, 0, sizeof *out);
    if (strncmp(name, "gen:", 4) == 0) {
        return generate_path(name, out, error);
    }
    input in;
    if (!input_read(name, &in, error)) {
        return false;
    }
    bool read = read_camera_path((const char *)in.data, in.size, name, out, error);
    input_free(&in);
    return read;
}
