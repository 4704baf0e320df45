/* Rectangles of boxes, as plain loops over eight lanes that compilers turn into vectors. */
#include "screen_boxes.h"

#include <stdlib.h>
#include <string.h>

#include "yardstick.h"

enum { LANES = SCREEN_LANES };

void screen_lens_make(screen_lens *lens, const umb_view *view, uint32_t width, uint32_t height)
{
    double sx = width / (view->x_max - view->x_min);
    double sy = height / (view->y_max - view->y_min);
    double planes[16][4];
    memset(lens, 0, sizeof *lens);
    for (int k = 0; k < 3; ++k) {
        lens->eye[k] = (float)view->eye[k];
        lens->x[k] = (float)(sx * view->right[k]);
        lens->y[k] = (float)(-sy * view->up[k]);
        lens->w[k] = (float)view->forward[k];
    }
    lens->centre[0] = (float)(-view->x_min * sx);
    lens->centre[1] = (float)(view->y_max * sy);
    lens->near_depth = (float)view->near_depth;
    lens->far_depth = (float)view->far_depth;
    lens->width = width;
    lens->height = height;
    uint32_t count = umb_view_planes(view, planes);
    for (uint32_t p = 0; p < 6 && p < count; ++p) {
        for (int k = 0; k < 4; ++k) {
            lens->planes[p][k] = (float)planes[p][k];
        }
    }
}

static float *floats(uint32_t count)
{
    return aligned_alloc(64, ((size_t)count * sizeof(float) + 191) / 64 * 64);
}

bool screen_boxes_make(screen_boxes *s, const world *w)
{
    uint32_t n = w->box_count;
    memset(s, 0, sizeof *s);
    s->mask = calloc((size_t)n / 8 + 64, 1);
    s->box = calloc((size_t)n + 16, sizeof(uint32_t));
    s->place = calloc((size_t)n + 16, sizeof(uint32_t));
    s->x_min = floats(n);
    s->x_max = floats(n);
    s->y_min = floats(n);
    s->y_max = floats(n);
    s->nearest = floats(n);
    return s->mask != NULL && s->box != NULL && s->place != NULL && s->x_min != NULL &&
           s->x_max != NULL && s->y_min != NULL && s->y_max != NULL && s->nearest != NULL;
}

void screen_boxes_free(screen_boxes *s)
{
    free(s->mask);
    free(s->box);
    free(s->place);
    free(s->x_min);
    free(s->x_max);
    free(s->y_min);
    free(s->y_max);
    free(s->nearest);
}

static uint32_t list_inside(screen_boxes *s, uint32_t box_count)
{
    uint32_t count = 0;
    for (uint32_t word = 0; word < (box_count + 7) / 8; ++word) {
        for (uint32_t bits = s->mask[word]; bits != 0; bits &= bits - 1) {
            uint32_t box = 8 * word + (uint32_t)__builtin_ctz(bits);
            if (box < box_count) {
                s->place[box] = count;
                s->box[count++] = box;
            }
        }
    }
    for (uint32_t k = count; k % LANES != 0; ++k) {
        s->box[k] = 0;
    }
    return count;
}

/* c . (corner - eye) for all corners of eight boxes is a sum of one of two products an axis. */
typedef struct products {
    float low[3][LANES], high[3][LANES];
} products;

static void multiply(products *out, const float c[3], const float d[6][LANES])
{
    for (int axis = 0; axis < 3; ++axis) {
        for (int j = 0; j < LANES; ++j) {
            out->low[axis][j] = c[axis] * d[axis][j];
            out->high[axis][j] = c[axis] * d[axis + 3][j];
        }
    }
}

static inline float corner(const products *p, int k, int j)
{
    return (k & 1 ? p->high[0][j] : p->low[0][j]) + (k & 2 ? p->high[1][j] : p->low[1][j]) +
           (k & 4 ? p->high[2][j] : p->low[2][j]);
}

void screen_boxes_project(const screen_lens *lens, const float box[6][LANES], screen_rects *out)
{
    float d[6][LANES];
    products px;
    products py;
    products pw;
    screen_rects r;
    for (int k = 0; k < 6; ++k) {
        for (int j = 0; j < LANES; ++j) {
            d[k][j] = box[k][j] - lens->eye[k % 3];
        }
    }
    multiply(&px, lens->x, d);
    multiply(&py, lens->y, d);
    multiply(&pw, lens->w, d);
    for (int j = 0; j < LANES; ++j) {
        r.x_min[j] = r.y_min[j] = r.nearest[j] = 1e30f;
        r.x_max[j] = r.y_max[j] = -1e30f;
    }
    for (int k = 0; k < 8; ++k) {
        for (int j = 0; j < LANES; ++j) {
            float depth = corner(&pw, k, j);
            float inverse = 1.0f / depth;
            float x = corner(&px, k, j) * inverse;
            float y = corner(&py, k, j) * inverse;
            r.nearest[j] = depth < r.nearest[j] ? depth : r.nearest[j];
            r.x_min[j] = x < r.x_min[j] ? x : r.x_min[j];
            r.x_max[j] = x > r.x_max[j] ? x : r.x_max[j];
            r.y_min[j] = y < r.y_min[j] ? y : r.y_min[j];
            r.y_max[j] = y > r.y_max[j] ? y : r.y_max[j];
        }
    }
    for (int j = 0; j < LANES; ++j) {
        out->x_min[j] = r.x_min[j] + lens->centre[0];
        out->x_max[j] = r.x_max[j] + lens->centre[0];
        out->y_min[j] = r.y_min[j] + lens->centre[1];
        out->y_max[j] = r.y_max[j] + lens->centre[1];
        out->nearest[j] = r.nearest[j];
    }
}

uint32_t screen_boxes_inside(const screen_lens *lens, const float box[6][LANES])
{
    uint32_t inside[LANES] = {1, 2, 4, 8, 16, 32, 64, 128};
    uint32_t bits = 0;
    for (int k = 0; k < 6; ++k) {
        const float *p = lens->planes[k];
        const float *x = box[p[0] < 0.0f ? 0 : 3];
        const float *y = box[p[1] < 0.0f ? 1 : 4];
        const float *z = box[p[2] < 0.0f ? 2 : 5];
        for (int j = 0; j < LANES; ++j) {
            float g = x[j] * p[0] + y[j] * p[1] + z[j] * p[2] + p[3];
            inside[j] = g < 0.0f ? 0u : inside[j];
        }
    }
    for (int j = 0; j < LANES; ++j) {
        bits |= inside[j];
    }
    return bits;
}

static void project(screen_boxes *s, const world *w, const screen_lens *lens, uint32_t at)
{
    float box[6][LANES];
    screen_rects r;
    for (int k = 0; k < 6; ++k) {
        for (uint32_t j = 0; j < LANES; ++j) {
            box[k][j] = w->box[k][s->box[at + j]];
        }
    }
    screen_boxes_project(lens, (const float(*)[LANES])box, &r);
    memcpy(s->x_min + at, r.x_min, sizeof r.x_min);
    memcpy(s->x_max + at, r.x_max, sizeof r.x_max);
    memcpy(s->y_min + at, r.y_min, sizeof r.y_min);
    memcpy(s->y_max + at, r.y_max, sizeof r.y_max);
    memcpy(s->nearest + at, r.nearest, sizeof r.nearest);
}

void screen_boxes_frame(screen_boxes *s, const world *w, const screen_lens *lens)
{
    yardstick_frustum_pass((const float **)(void *)w->box, w->box_count,
                           (const float(*)[4])lens->planes, s->mask);
    s->count = list_inside(s, w->box_count);
    for (uint32_t at = 0; at < s->count; at += LANES) {
        project(s, w, lens, at);
    }
}

/* Bits of floats that are not negative sort like the floats. */
static uint32_t bits_of(float f)
{
    uint32_t bits;
    f = f > 0.0f ? f : 0.0f;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

void screen_boxes_sort(const float *depth, uint32_t *order, uint32_t *scratch, uint32_t count)
{
    /* Eleven bits of mantissa and the exponent: order among near equals does not matter. */
    for (int pass = 0; pass < 2; ++pass) {
        uint32_t first[2049] = {0};
        int shift = pass == 0 ? 9 : 20;
        for (uint32_t i = 0; i < count; ++i) {
            ++first[((bits_of(depth[order[i]]) >> shift) & 2047) + 1];
        }
        for (int k = 0; k < 2048; ++k) {
            first[k + 1] += first[k];
        }
        for (uint32_t i = 0; i < count; ++i) {
            scratch[first[(bits_of(depth[order[i]]) >> shift) & 2047]++] = order[i];
        }
        memcpy(order, scratch, count * sizeof *order);
    }
}
