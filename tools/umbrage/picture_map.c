/* The map from above: a small depth-buffered renderer of its own, twice as fine as the picture. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "picture.h"

enum { FINE = 2 }; /* samples to a pixel, each way */

static const bitmap_color paper = 0xF7F5F0, ink = 0x2B2D33, wedge_color = 0xF2B705;
static const bitmap_color state_colors[3] = {0xCDD1D6, 0xE58A6B, 0x1F8A85};
static const char *const state_names[3] = {"outside the view", "hidden", "visible"};
static const char *const cell_names[3] = {"hidden", "not seen, not proved hidden", "seen"};

/* What lies under a fine pixel. */
typedef struct map_pixel {
    float height, seen_height,
        ground;            /* of the topmost surface, the topmost visible one, the lowest */
    uint32_t object, seen; /* MODEL_NONE: nothing */
    uint8_t light;
} map_pixel;

typedef struct map {
    const model *m;
    const umb_view *view;     /* NULL: of a cell */
    const double (*cell)[3];  /* least and largest corner; NULL: of a view */
    double eye[3];            /* the view's; the middle of the cell */
    const char *const *names; /* of the states */
    int across, down, up;     /* axes of the page and of height */
    double across_sign, down_sign, up_sign;
    double left, top, scale; /* fine pixels = (coordinate - left) * scale */
    double cut;              /* heights above are cut away: faint, and under all others */
    double low, high;        /* heights between which the shade runs */
    uint32_t width, height;
    double tie; /* heights nearer than this are equal */
    const uint8_t *states;
    map_pixel *pixels;
} map;

static void place(const map *p, const double v[3], double out[3])
{
    out[0] = (p->across_sign * v[p->across] - p->left) * p->scale;
    out[1] = (p->down_sign * v[p->down] - p->top) * p->scale;
    out[2] = p->up_sign * v[p->up];
}

/* Page axes: x to the right where it can be; the page is never mirrored. */
static void choose_axes(map *p)
{
    const double *up = p->m->up;
    p->up = fabs(up[2]) >= fabs(up[1]) && fabs(up[2]) >= fabs(up[0]) ? 2
            : fabs(up[1]) >= fabs(up[0])                             ? 1
                                                                     : 0;
    p->up_sign = up[p->up] < 0 ? -1 : 1;
    p->across = p->up == 0 ? 1 : 0;
    p->down = p->up == 2 ? 1 : 2;
    p->across_sign = 1;
    p->down_sign = p->up_sign * (p->up == 1 ? 1 : -1);
}

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Of a cell, what may be seen from it. */
static bool on_map(const map *p, uint32_t object)
{
    return p->m->objects[object].mesh != MODEL_NONE &&
           (p->cell == NULL || p->states[object] != PICTURE_OUTSIDE);
}

/* The span that holds all but the outermost hundredth of the objects' boxes at either end, or,
 * where the outer tenths lie far out, little more than the rest: a few stray objects must not
 * shrink the map to a dot. */
static bool span_of(const map *p, int axis, double sign, double *low, double *high)
{
    const model *m = p->m;
    float *ends = malloc(2 * sizeof *ends * ((size_t)m->object_count + 1));
    uint32_t count = 0;
    if (!ends) {
        return false;
    }
    float *mins = ends, *maxes = ends + m->object_count;
    for (uint32_t o = 0; o < m->object_count; ++o) {
        const umb_aabb *b = &m->objects[o].bounds;
        if (on_map(p, o)) {
            mins[count] = (float)(sign > 0 ? b->min[axis] : -b->max[axis]);
            maxes[count++] = (float)(sign > 0 ? b->max[axis] : -b->min[axis]);
        }
    }
    qsort(mins, count, sizeof *mins, compare_floats);
    qsort(maxes, count, sizeof *maxes, compare_floats);
    *low = count ? mins[count / 100] : -1;
    *high = count ? maxes[count - 1 - count / 100] : 1;
    if (count) {
        double inner_low = mins[count / 10], inner_high = maxes[count - 1 - count / 10];
        double inner = inner_high - inner_low;
        if (inner > 0 && *high - *low > 3 * inner) {
            *low = fmax(*low, inner_low - 0.4 * inner);
            *high = fmin(*high, inner_high + 0.4 * inner);
        }
    }
    if (!(*high > *low)) {
        *low -= 1;
        *high = *low + 2;
    }
    free(ends);
    return true;
}

/* The part of the world on the page: the scene's span and the eye, with a margin, centred. */
static bool choose_window(map *p, uint32_t width, uint32_t height)
{
    double low[2], high[2];
    double eye[2] = {p->across_sign * p->eye[p->across], p->down_sign * p->eye[p->down]};
    if (!span_of(p, p->across, p->across_sign, &low[0], &high[0]) ||
        !span_of(p, p->down, p->down_sign, &low[1], &high[1]) ||
        !span_of(p, p->up, p->up_sign, &p->low, &p->high)) {
        return false;
    }
    for (int i = 0; i < 2; ++i) {
        int axis = i ? p->down : p->across;
        double half = p->cell != NULL ? 0.6 * (p->cell[1][axis] - p->cell[0][axis]) : 0;
        low[i] = fmin(low[i], eye[i] - half);
        high[i] = fmax(high[i], eye[i] + half);
    }
    p->width = width * FINE;
    p->height = height * FINE;
    p->scale = 0.94 * fmin(p->width / (high[0] - low[0]), p->height / (high[1] - low[1]));
    p->left = (low[0] + high[0]) / 2 - p->width / p->scale / 2;
    p->top = (low[1] + high[1]) / 2 - p->height / p->scale / 2;
    return true;
}

/* What lies above the cut is kept only where nothing lies below it. Of surfaces at the same
 * height the visible one wins: faces may belong to several objects. */
static void lay(map *p, int x, int y, double z, uint32_t object, uint8_t light)
{
    if (x < 0 || y < 0 || (uint32_t)x >= p->width || (uint32_t)y >= p->height) {
        return;
    }
    map_pixel *at = p->pixels + (size_t)y * p->width + (size_t)x;
    bool first = at->object == MODEL_NONE, cut = z > p->cut;
    bool was_cut = !first && at->height > p->cut;
    bool higher = z > at->height + p->tie ||
                  (z > at->height - p->tie && !first && p->states[object] > p->states[at->object]);
    if (first || (cut == was_cut ? higher : was_cut)) {
        at->ground = first || was_cut ? (float)z : at->ground;
        at->height = (float)z;
        at->object = object;
        at->light = light;
    }
    if (cut) {
        return;
    }
    if (p->states[object] == PICTURE_VISIBLE &&
        (at->seen == MODEL_NONE || z > at->seen_height + p->tie)) {
        at->seen_height = (float)z;
        at->seen = object;
    }
    at->ground = fminf(at->ground, (float)z);
}

/* A wall seen from above is a line. */
static void draw_wall(map *p, double v[3][3], uint32_t object)
{
    int from = 0;
    double longest = -1, top = fmax(v[0][2], fmax(v[1][2], v[2][2]));
    double foot = fmin(v[0][2], fmin(v[1][2], v[2][2])),
           height = foot > p->cut ? top : fmin(top, p->cut);
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3;
        double length = hypot(v[j][0] - v[i][0], v[j][1] - v[i][1]);
        if (length > longest) {
            longest = length;
            from = i;
        }
    }
    int steps = (int)fmin(ceil(longest), 4.0 * (p->width + p->height));
    const double *a = v[from], *b = v[(from + 1) % 3];
    for (int s = 0; s <= steps; ++s) {
        double t = steps ? s / (double)steps : 0;
        double x = a[0] + (b[0] - a[0]) * t, y = a[1] + (b[1] - a[1]) * t;
        if (x > -1 && y > -1 && x < p->width && y < p->height) {
            lay(p, (int)x, (int)y, height, object, 90);
        }
    }
}

/* A whole number within [low, high] of a coordinate that may lie far outside, or be infinite. */
static int cut_to(double v, double low, double high)
{
    return (int)fmax(low, fmin(v, high));
}

static void draw_surface(map *p, double v[3][3], uint32_t object, uint8_t light)
{
    double ax = v[1][0] - v[0][0], ay = v[1][1] - v[0][1], az = v[1][2] - v[0][2];
    double bx = v[2][0] - v[0][0], by = v[2][1] - v[0][1], bz = v[2][2] - v[0][2];
    double area = ax * by - bx * ay;
    if (area == 0) {
        return;
    }
    double across = (az * by - bz * ay) / area, down = (bz * ax - az * bx) / area;
    double y0 = fmin(v[0][1], fmin(v[1][1], v[2][1])), y1 = fmax(v[0][1], fmax(v[1][1], v[2][1]));
    int top = cut_to(floor(y0), 0, p->height), bottom = cut_to(ceil(y1), -1, p->height - 1.0);
    for (int row = top; row <= bottom; ++row) {
        double y = row + 0.5, low = INFINITY, high = -INFINITY;
        for (int i = 0; i < 3; ++i) {
            const double *a = v[i], *b = v[(i + 1) % 3];
            if ((a[1] <= y) != (b[1] <= y)) {
                double x = a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]);
                low = fmin(low, x);
                high = fmax(high, x);
            }
        }
        int left = cut_to(ceil(low - 0.5), 0, p->width);
        int right = cut_to(floor(high - 0.5), -1, p->width - 1.0);
        for (int x = left; low <= high && x <= right; ++x) {
            double z = v[0][2] + across * (x + 0.5 - v[0][0]) + down * (y - v[0][1]);
            lay(p, x, row, z, object, light);
        }
    }
}

/* World corners, and the unit normal of the front; false for a triangle without area. */
static bool triangle_of(const model *m, const model_object *o, uint32_t triangle, bool mirrored,
                        double v[3][3], double normal[3])
{
    const model_mesh *mesh = &m->meshes[o->mesh];
    double e[2][3], length = 0;
    for (int i = 0; i < 3; ++i) {
        float world[3];
        model_world_vertex(m, o, mesh->indices[3 * (size_t)triangle + (size_t)i], world);
        for (int k = 0; k < 3; ++k) {
            v[i][k] = world[k];
        }
    }
    for (int k = 0; k < 3; ++k) {
        e[0][k] = v[1][k] - v[0][k];
        e[1][k] = v[2][k] - v[0][k];
    }
    for (int k = 0; k < 3; ++k) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        normal[k] = (e[0][a] * e[1][b] - e[0][b] * e[1][a]) * (mirrored ? -1 : 1);
        length += normal[k] * normal[k];
    }
    length = sqrt(length);
    for (int k = 0; k < 3; ++k) {
        normal[k] /= length;
    }
    return length > 0;
}

/* Of large scenes the map of a cell shows a small part. */
static bool on_page(const map *p, const umb_aabb *box)
{
    double a[3], b[3], low[3], high[3];
    for (int i = 0; i < 3; ++i) {
        low[i] = box->min[i];
        high[i] = box->max[i];
    }
    place(p, low, a);
    place(p, high, b);
    return fmax(a[0], b[0]) >= 0 && fmin(a[0], b[0]) <= p->width && fmax(a[1], b[1]) >= 0 &&
           fmin(a[1], b[1]) <= p->height;
}

static void draw_object(map *p, uint32_t object)
{
    const model_object *o = &p->m->objects[object];
    if (!on_page(p, &o->bounds)) {
        return;
    }
    bool mirrored = model_mirrored(o);
    for (uint32_t k = 0; k < p->m->meshes[o->mesh].triangle_count; ++k) {
        double world[3][3], page[3][3], normal[3];
        if (!triangle_of(p->m, o, k, mirrored, world, normal)) {
            continue;
        }
        for (int i = 0; i < 3; ++i) {
            place(p, world[i], page[i]);
        }
        double rise = p->up_sign * normal[p->up];
        bool both = p->m->meshes[o->mesh].flags[k] & UMB_TRIANGLE_TWO_SIDED;
        if (fabs(rise) < 0.05) {
            draw_wall(p, page, object);
        } else if (rise > 0 || both) {
            /* Light from the upper left. */
            double side = -p->across_sign * normal[p->across] - p->down_sign * normal[p->down];
            double light = 0.5 + 0.35 * fabs(rise) + (rise > 0 ? 0.25 : -0.25) * side;
            draw_surface(p, page, object, (uint8_t)(255 * fmin(1, fmax(0, light / 0.95))));
        }
    }
}

/* The eye's height if some surface faces up above it - a roof, the next storey - else no cut. */
static double choose_cut(const map *p)
{
    double eye[3];
    place(p, p->eye, eye);
    for (uint32_t o = 0; o < p->m->object_count; ++o) {
        const model_object *object = &p->m->objects[o];
        double low[3], high[3];
        for (int i = 0; i < 3; ++i) {
            low[i] = object->bounds.min[i];
            high[i] = object->bounds.max[i];
        }
        if (object->mesh == MODEL_NONE ||
            fmax(p->up_sign * low[p->up], p->up_sign * high[p->up]) < eye[2] ||
            p->eye[p->across] < low[p->across] || p->eye[p->across] > high[p->across] ||
            p->eye[p->down] < low[p->down] || p->eye[p->down] > high[p->down]) {
            continue;
        }
        bool mirrored = model_mirrored(object);
        for (uint32_t k = 0; k < p->m->meshes[object->mesh].triangle_count; ++k) {
            double v[3][3], normal[3], q[3][3], w[3], z = 0;
            if (!triangle_of(p->m, object, k, mirrored, v, normal) ||
                p->up_sign * normal[p->up] < 0.05) {
                continue;
            }
            for (int i = 0; i < 3; ++i) {
                place(p, v[i], q[i]);
            }
            double area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) -
                          (q[2][0] - q[0][0]) * (q[1][1] - q[0][1]);
            bool inside = area != 0;
            for (int i = 0; i < 3; ++i) {
                const double *a = q[(i + 1) % 3], *b = q[(i + 2) % 3];
                w[i] = ((b[0] - a[0]) * (eye[1] - a[1]) - (b[1] - a[1]) * (eye[0] - a[0])) / area;
                inside = inside && w[i] >= 0;
                z += w[i] * q[i][2];
            }
            if (inside && z > eye[2]) {
                return eye[2];
            }
        }
    }
    return INFINITY;
}

/* What a pixel shows. A visible storey shows through hidden ones above it; the visible ground
 * does not show through what stands on it. */
static uint32_t shown(const map *p, const map_pixel *at)
{
    return at->seen != MODEL_NONE && at->seen_height > at->ground + p->tie ? at->seen : at->object;
}

/* Does one object end at this pixel and another begin? */
static bool on_outline(const map *p, uint32_t x, uint32_t y)
{
    const map_pixel *at = p->pixels + (size_t)y * p->width + x;
    return (x + 1 < p->width && at[1].object != at->object) ||
           (y + 1 < p->height && at[p->width].object != at->object);
}

static void paint(const map *p, bitmap *fine)
{
    for (uint32_t y = 0; y < p->height; ++y) {
        for (uint32_t x = 0; x < p->width; ++x) {
            const map_pixel *at = p->pixels + (size_t)y * p->width + x;
            bool edge = on_outline(p, x, y);
            if (at->object == MODEL_NONE) {
                bitmap_blend(fine, (int)x, (int)y, ink, edge ? 0.3 : 0);
                continue;
            }
            bool cut = at->height > p->cut;
            double rise = fmin(
                1, fmax(0, (at->height - p->low) / (fmin(p->high, p->cut) - p->low + 1e-30)));
            bitmap_color c = state_colors[p->states[shown(p, at)]];
            c = bitmap_mix(c, 0xFFFFFF, 0.30 * rise);
            c = bitmap_mix(c, ink, 0.55 * (1 - at->light / 255.0));
            c = edge ? bitmap_mix(c, ink, 0.35) : c;
            bitmap_set(fine, (int)x, (int)y, cut ? bitmap_mix(c, paper, 0.65) : c);
        }
    }
}

/* Convex hull of few points (gift wrapping), counter-clockwise. */
static uint32_t hull(double (*points)[2], uint32_t count, double (*out)[2])
{
    uint32_t start = 0, n = 0;
    for (uint32_t k = 1; k < count; ++k) {
        if (points[k][0] < points[start][0] ||
            (points[k][0] == points[start][0] && points[k][1] < points[start][1])) {
            start = k;
        }
    }
    uint32_t at = start;
    do {
        uint32_t next = (at + 1) % count;
        out[n][0] = points[at][0];
        out[n++][1] = points[at][1];
        for (uint32_t k = 0; k < count; ++k) {
            double ax = points[next][0] - points[at][0], ay = points[next][1] - points[at][1];
            double bx = points[k][0] - points[at][0], by = points[k][1] - points[at][1];
            double side = ax * by - ay * bx;
            if (side < 0 || (side == 0 && bx * bx + by * by > ax * ax + ay * ay)) {
                next = k;
            }
        }
        at = next;
    } while (at != start && n < count);
    return n;
}

/* The frustum's shadow on the page in fine pixels: the hull of the eye and of the corners at the
 * near plane and far away. */
static uint32_t wedge(const map *p, double outline[9][2])
{
    const umb_view *view = p->view;
    double page = (p->width + (double)p->height) / p->scale, points[9][2];
    bool parallel = view->projection == UMB_ORTHOGRAPHIC;
    double far_depth = fmin(view->far_depth, 40 * page);
    for (int k = 0; k < 9; ++k) {
        double depth = k & 4 ? far_depth : view->near_depth, v[3], q[3];
        double sx = k & 1 ? view->x_max : view->x_min, sy = k & 2 ? view->y_max : view->y_min;
        double spread = k == 8 ? 0 : parallel ? 1 : depth;
        for (int i = 0; i < 3; ++i) {
            v[i] = view->eye[i] + (k == 8 ? 0 : view->forward[i] * depth) +
                   spread * (view->right[i] * sx + view->up[i] * sy);
        }
        place(p, v, q);
        points[k][0] = q[0];
        points[k][1] = q[1];
    }
    return hull(points, 9, outline);
}

static void draw_wedge(const map *p, bitmap *im)
{
    double outline[9][2];
    uint32_t n = wedge(p, outline);
    for (uint32_t k = 0; k < n; ++k) {
        const double *a = outline[k], *b = outline[(k + 1) % n];
        bitmap_line(im, a[0] / FINE, a[1] / FINE, b[0] / FINE, b[1] / FINE, 4, 0xFFFFFF, 0.45);
        bitmap_line(im, a[0] / FINE, a[1] / FINE, b[0] / FINE, b[1] / FINE, 1.8, ink, 0.9);
    }
}

/* The cell's outline on the page, never less than a few pixels wide. */
static void draw_cell(const map *p, bitmap *im)
{
    double a[3], b[3];
    place(p, p->cell[0], a);
    place(p, p->cell[1], b);
    for (int i = 0; i < 2; ++i) {
        double middle = (a[i] + b[i]) / 2 / FINE, half = fmax(fabs(a[i] - b[i]) / 2 / FINE, 3);
        a[i] = middle - half;
        b[i] = middle + half;
    }
    const double corners[4][2] = {{a[0], a[1]}, {b[0], a[1]}, {b[0], b[1]}, {a[0], b[1]}};
    bitmap_polygon(im, corners, 4, wedge_color, 0.8);
    for (int k = 0; k < 4; ++k) {
        const double *c = corners[k], *d = corners[(k + 1) % 4];
        bitmap_line(im, c[0], c[1], d[0], d[1], 2, ink, 1);
    }
}

static void draw_eye(const map *p, bitmap *im)
{
    double eye[3];
    place(p, p->eye, eye);
    bitmap_disc(im, eye[0] / FINE, eye[1] / FINE, 7.5, 0xFFFFFF, 1);
    bitmap_disc(im, eye[0] / FINE, eye[1] / FINE, 6, ink, 1);
    bitmap_disc(im, eye[0] / FINE, eye[1] / FINE, 2.5, wedge_color, 1);
}

/* 1, 2 or 5 times a power of ten, at most length. */
static double round_length(double length)
{
    double power = pow(10, floor(log10(length))), ratio = length / power;
    return power * (ratio >= 5 ? 5 : ratio >= 2 ? 2 : 1);
}

/* The corner of the picture where a rectangle covers least of the map; the eye counts for a lot. */
static void choose_corner(const map *p, const bitmap *im, int wide, int tall, int margin, int *x,
                          int *y)
{
    double least = INFINITY, eye[3];
    place(p, p->eye, eye);
    for (int k = 0; k < 4; ++k) {
        int left = k & 1 ? (int)im->width - margin - wide : margin;
        int top = k & 2 ? margin : (int)im->height - margin - tall;
        double ex = eye[0] / FINE - left, ey = eye[1] / FINE - top;
        double covered = ex > -9 && ey > -9 && ex < wide + 9 && ey < tall + 9 ? 1e9 : 0;
        for (int v = top < 0 ? 0 : top; v < top + tall && v < (int)im->height; ++v) {
            for (int u = left < 0 ? 0 : left; u < left + wide && u < (int)im->width; ++u) {
                covered += p->pixels[(size_t)v * FINE * p->width + (size_t)u * FINE].object !=
                           MODEL_NONE;
            }
        }
        if (covered < least) {
            least = covered;
            *x = left;
            *y = top;
        }
    }
}

static void draw_legend(const map *p, bitmap *im, const uint8_t *states)
{
    uint32_t counts[3] = {0};
    for (uint32_t o = 0; o < p->m->object_count; ++o) {
        counts[states[o]] += p->m->objects[o].mesh != MODEL_NONE;
    }
    int s = im->width >= 800 ? 2 : 1, line = bitmap_text_height(s) + 2 * s, pad = 6 * s, wide = 0;
    char text[4][64];
    double bar = round_length(im->width * 0.18 * FINE / p->scale),
           bar_pixels = bar * p->scale / FINE;
    for (int k = 0; k < 3; ++k) {
        snprintf(text[k], sizeof text[k], "%u %s", counts[2 - k], p->names[2 - k]);
    }
    snprintf(text[3], sizeof text[3], "%g", bar);
    for (int k = 0; k < 4; ++k) {
        int w = bitmap_text_width(text[k], s) + (k < 3 ? 14 * s : 4 * s + (int)bar_pixels);
        wide = w > wide ? w : wide;
    }
    int tall = 3 * line + 8 * s + 2 * pad, x = 0, y = 0;
    wide += 2 * pad;
    choose_corner(p, im, wide, tall, pad, &x, &y);
    bitmap_rectangle(im, x, y, wide, tall, 0xFFFFFF, 0.88);
    bitmap_frame(im, x, y, wide, tall, 1, bitmap_mix(paper, ink, 0.35));
    x += pad;
    y += pad;
    for (int k = 0; k < 3; ++k, y += line) {
        bitmap_rectangle(im, x, y, 9 * s, 8 * s, state_colors[2 - k], 1);
        bitmap_frame(im, x, y, 9 * s, 8 * s, 1, bitmap_mix(state_colors[2 - k], ink, 0.4));
        bitmap_text(im, x + 14 * s, y, s, text[k], ink);
    }
    bitmap_rectangle(im, x, y + 4 * s, (int)bar_pixels, s, ink, 1);
    bitmap_rectangle(im, x, y + 2 * s, s, 5 * s, ink, 1);
    bitmap_rectangle(im, x + (int)bar_pixels - s, y + 2 * s, s, 5 * s, ink, 1);
    bitmap_text(im, x + (int)bar_pixels + 4 * s, y, s, text[3], ink);
}

static bool draw_map(map *p, bitmap *im)
{
    bitmap fine = {0};
    choose_axes(p);
    if (!choose_window(p, im->width, im->height)) {
        return false;
    }
    size_t count = (size_t)p->width * p->height;
    p->pixels = malloc(count * sizeof *p->pixels);
    if (!p->pixels || !bitmap_create(&fine, p->width, p->height)) {
        free(p->pixels);
        return false;
    }
    for (size_t k = 0; k < count; ++k) {
        p->pixels[k] = (map_pixel){.object = MODEL_NONE, .seen = MODEL_NONE};
    }
    p->tie = 1e-4 * (p->high - p->low);
    p->cut = choose_cut(p);
    for (uint32_t o = 0; o < p->m->object_count; ++o) {
        if (p->m->objects[o].mesh != MODEL_NONE) {
            draw_object(p, o);
        }
    }
    bitmap_fill(&fine, paper);
    if (p->view != NULL) {
        double outline[9][2];
        uint32_t corners = wedge(p, outline);
        bitmap_polygon(&fine, (const double(*)[2])outline, corners, wedge_color, 0.25);
    }
    paint(p, &fine);
    bitmap_shrink(im, &fine, FINE);
    bitmap_free(&fine);
    if (p->view != NULL) {
        draw_wedge(p, im);
        draw_eye(p, im);
    } else {
        draw_cell(p, im);
    }
    draw_legend(p, im, p->states);
    free(p->pixels);
    return true;
}

bool picture_map(bitmap *im, const model *m, const umb_view *view, const uint8_t *states)
{
    map p = {.m = m, .view = view, .states = states, .names = state_names};
    memcpy(p.eye, view->eye, sizeof p.eye);
    return draw_map(&p, im);
}

bool picture_cell_map(bitmap *im, const model *m, const double cell[2][3], const uint8_t *states)
{
    map p = {.m = m, .cell = cell, .states = states, .names = cell_names};
    for (int i = 0; i < 3; ++i) {
        p.eye[i] = (cell[0][i] + cell[1][i]) / 2;
    }
    return draw_map(&p, im);
}
