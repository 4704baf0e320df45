/* A dot plot as SVG: a line for each case, a dot for each series on a logarithmic axis. */
#ifndef SVG_DOTS_H
#define SVG_DOTS_H

#include <stdbool.h>
#include <stdint.h>

#include "umbrage/base.h"

typedef struct svg_dots_series {
    const char *name, *colour;
    bool ring; /* its legend entry is a ring */
} svg_dots_series;

typedef struct svg_dots_dot {
    uint32_t line, series;
    double value; /* above zero */
    bool ring;    /* drawn as a ring */
} svg_dots_dot;

typedef struct svg_dots {
    const char *title, *axis;
    const char *const *lines; /* labels, top to bottom */
    uint32_t line_count;
    const svg_dots_series *series;
    uint32_t series_count;
    const svg_dots_dot *dots;
    uint32_t dot_count;
} svg_dots;

bool svg_dots_write(const svg_dots *plot, const char *file, umb_error *error);

#endif
