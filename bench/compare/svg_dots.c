/* Plain SVG that any browser shows; sizes in pixels. */
#include "svg_dots.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "io/output.h"

enum { LEFT = 190, PLOT = 620, RIGHT = 30, TOP = 104, LINE = 22, BOTTOM = 50 };

typedef struct scale {
    double low, high; /* decimal logarithms of the ends */
} scale;

static scale scale_of(const svg_dots *p)
{
    double low = HUGE_VAL;
    double high = -HUGE_VAL;
    for (uint32_t i = 0; i < p->dot_count; ++i) {
        double at = log10(p->dots[i].value);
        low = at < low ? at : low;
        high = at > high ? at : high;
    }
    return low <= high ? (scale){low - 0.08, high + 0.08} : (scale){0.0, 1.0};
}

static double x_of(const scale *s, double value)
{
    return LEFT + PLOT * (log10(value) - s->low) / (s->high - s->low);
}

static void text(FILE *f, double x, double y, const char *anchor, const char *style,
                 const char *what)
{
    (void)fprintf(f, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" %s>", x, y, anchor, style);
    for (const char *c = what; *c != 0; ++c) {
        switch (*c) {
        case '<':
            (void)fputs("&lt;", f);
            break;
        case '&':
            (void)fputs("&amp;", f);
            break;
        default:
            (void)fputc(*c, f);
        }
    }
    (void)fputs("</text>\n", f);
}

static void axis(FILE *f, const svg_dots *p, const scale *s, double bottom)
{
    static const int steps[] = {1, 2, 5};
    double decades = s->high - s->low;
    for (int power = (int)floor(s->low); power <= (int)ceil(s->high); ++power) {
        for (int i = 0; i < 3; ++i) {
            double value = steps[i] * pow(10.0, power);
            double x = x_of(s, value);
            if (x < LEFT || x > LEFT + PLOT) {
                continue;
            }
            (void)fprintf(f, "<path d=\"M%.1f %d V%.1f\" stroke=\"%s\"/>\n", x, TOP - 8, bottom,
                          i == 0 ? "#bbb" : "#e6e6e6");
            if (i == 0 || decades < 2.5) {
                char label[32];
                (void)snprintf(label, sizeof label, "%g", value);
                text(f, x, bottom + 15, "middle", "fill=\"#555\"", label);
            }
        }
    }
    text(f, LEFT + PLOT / 2.0, bottom + 34, "middle", "fill=\"#333\"", p->axis);
}

static void mark(FILE *f, double x, double y, const char *colour, bool ring)
{
    (void)fprintf(
        f,
        "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" fill=\"%s\" stroke=\"%s\" stroke-width=\"2\"/>\n",
        x, y, ring ? "#fff" : colour, colour);
}

bool svg_dots_write(const svg_dots *plot, const char *file, umb_error *error)
{
    FILE *f = output_open(file, error);
    if (f == NULL) {
        return false;
    }
    scale s = scale_of(plot);
    int width = LEFT + PLOT + RIGHT;
    double bottom = TOP + LINE * (double)plot->line_count;
    (void)fprintf(f,
                  "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%.0f\" "
                  "viewBox=\"0 0 %d %.0f\" "
                  "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%%\" "
                  "height=\"100%%\" fill=\"#fff\"/>\n",
                  width, bottom + BOTTOM, width, bottom + BOTTOM);
    text(f, 16, 24, "start", "font-size=\"15\" fill=\"#111\"", plot->title);
    double x = 22;
    double y = 48;
    for (uint32_t i = 0; i < plot->series_count; ++i) {
        double wide = 34 + 6.6 * (double)strlen(plot->series[i].name);
        if (x + wide > width) {
            x = 22;
            y += 22;
        }
        mark(f, x, y, plot->series[i].colour, plot->series[i].ring);
        text(f, x + 12, y + 4, "start", "fill=\"#333\"", plot->series[i].name);
        x += wide;
    }
    axis(f, plot, &s, bottom);
    for (uint32_t i = 0; i < plot->line_count; ++i) {
        double at = TOP + LINE * (i + 0.5);
        text(f, LEFT - 10, at + 4, "end", "fill=\"#333\"", plot->lines[i]);
        (void)fprintf(f, "<path d=\"M%d %.1f H%d\" stroke=\"#f0f0f0\"/>\n", LEFT, at, LEFT + PLOT);
    }
    for (uint32_t i = 0; i < plot->dot_count; ++i) {
        const svg_dots_dot *d = &plot->dots[i];
        mark(f, x_of(&s, d->value), TOP + LINE * (d->line + 0.5), plot->series[d->series].colour,
             d->ring);
    }
    (void)fputs("</svg>\n", f);
    return output_close(f, file, true, error);
}
