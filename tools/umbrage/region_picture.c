#include "region_picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "picture.h"

enum { MAPS = 8, GAP = 4 };

static const bitmap_color paper = 0xF7F5F0, ink = 0x2B2D33, night = 0x101522, low_color = 0x175C73,
                          high_color = 0xF0E3B2;

/* Where the occlusion maps go: columns x rows of square panels. */
typedef struct panels {
    int left, top, side, columns;
} panels;

static void copy_into(bitmap *im, const bitmap *part, int left, int top)
{
    for (uint32_t y = 0; y < part->height; ++y) {
        for (uint32_t x = 0; x < part->width; ++x) {
            bitmap_set(im, left + (int)x, top + (int)y, bitmap_get(part, (int)x, (int)y));
        }
    }
}

static bitmap_color color_of(const umb_region_pixel *p)
{
    if (!p->live) {
        return paper;
    }
    if (p->top == -INFINITY) {
        return night;
    }
    /* A quarter turn up is the brightest. */
    double up = p->top == INFINITY ? 1.0 : fmax(0.0, atan((double)p->top) / 1.5707963267948966);
    bitmap_color c = bitmap_mix(low_color, high_color, sqrt(up));
    return p->bottom == -INFINITY ? c : bitmap_mix(c, ink, 0.15);
}

static void name_map(const umb_region_query *q, uint32_t map, char out[4])
{
    int up = q->up == UMB_UP_Y ? 1 : q->up == UMB_UP_Z ? 2 : 0;
    bool none = q->up == UMB_UP_NONE;
    int axis = none ? (int)map / 2 : (up + 1 + (int)(map % 4) / 2) % 3;
    (void)snprintf(out, 4, "%c%c%s", map % 2 ? '-' : '+', "xyz"[axis], none || map < 4 ? "" : "'");
}

/* One map into its panel; each pixel of the panel takes the nearest of the map. */
static bool draw_map(bitmap *im, const umb_region *region, const umb_region_query *q, uint32_t map,
                     const panels *p)
{
    uint32_t side;
    (void)umb_region_read_map(region, map, NULL, 0, &side);
    if (side == 0 || p->side <= 0) {
        return true;
    }
    size_t count = (size_t)side * side;
    umb_region_pixel *pixels = malloc(count * sizeof *pixels);
    if (pixels == NULL) {
        return false;
    }
    (void)umb_region_read_map(region, map, pixels, count, &side);
    int left = p->left + (int)map % p->columns * (p->side + GAP);
    int top = p->top + (int)map / p->columns * (p->side + GAP);
    for (int y = 0; y < p->side; ++y) {
        for (int x = 0; x < p->side; ++x) {
            size_t s = (size_t)(p->side - 1 - y) * side / (size_t)p->side;
            size_t t = (size_t)x * side / (size_t)p->side;
            bitmap_set(im, left + x, top + y, color_of(&pixels[s * side + t]));
        }
    }
    free(pixels);
    char name[4];
    name_map(q, map, name);
    int scale = p->side >= 200 ? 2 : 1;
    bitmap_frame(im, left, top, p->side, p->side, 1, bitmap_mix(paper, ink, 0.35));
    bitmap_rectangle(im, left + 3, top + 3, bitmap_text_width(name, scale) + 6,
                     bitmap_text_height(scale) + 2, 0xFFFFFF, 0.88);
    bitmap_text(im, left + 6, top + 4, scale, name, ink);
    return true;
}

/* Beside the scene in wide pictures, else below it. Returns the size that is left for the scene. */
static void lay_out(const bitmap *im, uint32_t maps, panels *p, uint32_t *width, uint32_t *height)
{
    uint32_t rows = maps > 4 ? 2 : 1;
    *width = im->width;
    *height = im->height;
    if (2 * im->width >= 3 * im->height) {
        p->columns = maps > 6 ? 4 : maps > 4 ? 3 : 2;
        rows = maps / (uint32_t)p->columns;
        uint32_t all = (im->height - 1) / rows * (uint32_t)p->columns;
        uint32_t most = im->width / 2;
        p->side = (int)((all < most ? all : most) / (uint32_t)p->columns) - GAP;
        *width = im->width - (uint32_t)(p->columns * (p->side + GAP));
        p->left = (int)*width + GAP / 2;
        p->top = ((int)im->height - (int)rows * (p->side + GAP)) / 2 + GAP / 2;
    } else {
        p->columns = 4;
        p->side = (int)im->width / 4 - GAP;
        *height = im->height - rows * (uint32_t)(p->side + GAP);
        p->left = GAP / 2;
        p->top = (int)*height + GAP / 2;
    }
}

bool region_picture(bitmap *im, const model *m, const umb_region *region,
                    const umb_region_query *query, const uint8_t *states)
{
    double cell[2][3];
    bitmap scene = {0};
    panels p;
    uint32_t maps = 0, side = 1, width, height;
    for (; maps < MAPS && side != 0; maps += side != 0) {
        (void)umb_region_read_map(region, maps, NULL, 0, &side);
    }
    memcpy(cell[0], query->min, sizeof cell[0]);
    memcpy(cell[1], query->max, sizeof cell[1]);
    lay_out(im, maps, &p, &width, &height);
    bool ok = bitmap_create(&scene, width, height) &&
              picture_cell_map(&scene, m, (const double(*)[3])cell, states);
    bitmap_fill(im, paper);
    if (ok) {
        copy_into(im, &scene, 0, 0);
    }
    for (uint32_t k = 0; ok && k < maps; ++k) {
        ok = draw_map(im, region, query, k, &p);
    }
    bitmap_free(&scene);
    return ok;
}
