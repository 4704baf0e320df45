#include "obj_offset.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model_parts.h"

/* Where the line at p ends: at its newline or at the end of the text. */
static const char *line_end(const char *p, const char *end)
{
    const char *newline = memchr(p, '\n', (size_t)(end - p));
    return newline != NULL ? newline : end;
}

/* Read "v x y z"; *rest is what follows. 1: a vertex, 0: another line, -1: a vertex written in a
 * way that this reader leaves to the importer (homogeneous, continued on the next line, not
 * finite). */
static int read_vertex(const char *line, const char *end, double at[3], const char **rest)
{
    while (line < end && (*line == ' ' || *line == '\t')) {
        ++line;
    }
    if (end - line < 2 || line[0] != 'v' || (line[1] != ' ' && line[1] != '\t')) {
        return 0;
    }
    if (memchr(line, '\\', (size_t)(end - line)) != NULL) {
        return -1;
    }
    const char *p = line + 1;
    double number[7];
    int count = 0;
    while (count < 7) {
        while (p < end && (*p == ' ' || *p == '\t' || *p == '\r')) {
            ++p;
        }
        char *after;
        if (p >= end || *p == '#') {
            break;
        }
        number[count] = strtod(p, &after);
        if (after == p || after > end || !isfinite(number[count])) {
            return -1;
        }
        p = after;
        if (++count == 3) {
            *rest = p;
        }
    }
    if (count != 3 && count != 6) {
        return -1;
    }
    memcpy(at, number, 3 * sizeof *at);
    return 1;
}

/* Box of all vertices; how many, or 0 when one of them is unusual. */
static size_t measure(const char *text, const char *end, double min[3], double max[3])
{
    size_t count = 0;
    for (const char *line = text; line < end;) {
        const char *stop = line_end(line, end);
        const char *rest;
        double at[3];
        int kind = read_vertex(line, stop, at, &rest);
        if (kind < 0) {
            return 0;
        }
        for (int k = 0; k < 3 && kind == 1; ++k) {
            min[k] = count == 0 ? at[k] : fmin(min[k], at[k]);
            max[k] = count == 0 ? at[k] : fmax(max[k], at[k]);
        }
        count += (size_t)kind;
        line = stop < end ? stop + 1 : end;
    }
    return count;
}

/* A vertex line as it will be written: sign, nine digits, point, exponent and blank, three
 * times. */
#define VERTEX_ROOM 56

static size_t rewrite(const char *text, const char *end, const double origin[3], char *out)
{
    size_t used = 0;
    for (const char *line = text; line < end;) {
        const char *stop = line_end(line, end);
        const char *rest = line;
        double at[3];
        if (read_vertex(line, stop, at, &rest) == 1) {
            used += (size_t)snprintf(out + used, VERTEX_ROOM, "v %.9g %.9g %.9g", at[0] - origin[0],
                                     at[1] - origin[1], at[2] - origin[2]);
        }
        size_t length = (size_t)(stop - rest) + (stop < end);
        memcpy(out + used, rest, length);
        used += length;
        line = stop < end ? stop + 1 : end;
    }
    return used;
}

bool obj_offset(input *text, double origin[3])
{
    double min[3] = {0};
    double max[3] = {0};
    const char *begin = (const char *)text->data;
    const char *end = begin + text->size;
    size_t count = measure(begin, end, min, max);
    model_choose_origin(min, max, origin);
    char *moved = NULL;
    if (count != 0 && (origin[0] != 0.0 || origin[1] != 0.0 || origin[2] != 0.0)) {
        moved = malloc(text->size + count * VERTEX_ROOM + 1);
    }
    if (moved == NULL) {
        memset(origin, 0, 3 * sizeof *origin);
        return false;
    }
    size_t size = rewrite(begin, end, origin, moved);
    moved[size] = '\0';
    free(text->data);
    text->data = (uint8_t *)moved;
    text->size = size;
    return true;
}
