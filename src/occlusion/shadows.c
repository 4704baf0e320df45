/* U is 2^-53; PAD covers the roundings of a bound itself. */
#include "shadows.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "geometry/orient.h"

#define U 0x1p-53
#define PAD (1.0 + 0x1p-40)

double umb_shadow_depth(const umb_shadow_viewer *v, const float p[3], double *off)
{
    double sum = 0.0, size = 0.0;
    for (int k = 0; k < 3; ++k) {
        double x = v->sight.forward[k] * (p[k] - v->sight.eye[k]);
        sum += x;
        size += fabs(x);
    }
    *off = 5.0 * U * size * PAD;
    return sum;
}

/* ---- the viewer ---------------------------------------------------------------------------------- */

/* The line of a linear function that is 0 or more on the frame, moved outwards: n + margin forward, so that rounding,
 * below 8 units of terms whose sizes are size, is made up for at every d of the frame. */
static void frame_line(umb_shadow_viewer *v, const double side[3], double slope, umb_seen_line *out)
{
    double size = 0.0, n[3];
    const double *f = v->sight.forward;
    for (int k = 0; k < 3; ++k) {
        n[k] = side[k] - slope * f[k];
        size = fmax(size, fabs(side[k]) + fabs(slope * f[k]));
    }
    double margin = 16.0 * U * size * v->ray;
    for (int k = 0; k < 3; ++k) {
        n[k] += margin * f[k];
    }
    umb_seen_line_free(n, out);
}

/* Corners of a frame whose lines run around it. */
static void find_corners(umb_shadow_viewer *v)
{
    for (int i = 0; i < 4; ++i) {
        umb_seen_corner *c = &v->corners[i];
        umb_seen_corner_of(&v->frame[(i + 3) % 4], &v->frame[i], 1, c);
        c->edge = &v->frame[i];
        c->flip = false;
        c->closed = v->framed;
    }
    /* The other way round where the axes are left-handed: turn the order of the lines. */
    if (umb_seen_side(&v->sight, &v->frame[2], &v->corners[0]) == -1) {
        umb_seen_line swap = v->frame[1];
        v->frame[1] = v->frame[3];
        v->frame[3] = swap;
        for (int i = 0; i < 4; ++i) {
            umb_seen_corner_of(&v->frame[(i + 3) % 4], &v->frame[i], 1, &v->corners[i]);
        }
    }
}

static void frame_view(umb_shadow_viewer *v, const umb_view *view)
{
    double minus_right[3], minus_up[3], x = fmax(fabs(view->x_min), fabs(view->x_max));
    double y = fmax(fabs(view->y_min), fabs(view->y_max));
    for (int k = 0; k < 3; ++k) {
        minus_right[k] = -view->right[k];
        minus_up[k] = -view->up[k];
    }
    /* Axes are unit vectors at right angles to within 1e-6. */
    v->ray = 1.01 * 1.75 * (1.0 + x + y);
    v->framed = true;
    frame_line(v, view->right, view->x_min, &v->frame[0]);
    frame_line(v, view->up, view->y_min, &v->frame[1]);
    frame_line(v, minus_right, -view->x_max, &v->frame[2]);
    frame_line(v, minus_up, -view->y_max, &v->frame[3]);
}

/* Images of parallel views have the coordinates q_0 / q_2 and q_1 / q_2, of at most four times the reach. */
static void frame_scene(umb_shadow_viewer *v, double reach)
{
    double sign = v->sight.forward[v->sight.axis] < 0.0 ? -1.0 : 1.0;
    v->framed = false;
    for (int i = 0; i < 4; ++i) {
        double n[3] = {0.0, 0.0, sign * 16.0 * reach};
        n[i % 2] = i < 2 ? sign : -sign;
        umb_seen_line_free(n, &v->frame[i]);
    }
}

void umb_shadow_viewer_prepare(umb_shadow_viewer *v, const umb_view *view, double reach)
{
    bool parallel = view->projection == UMB_ORTHOGRAPHIC;
    for (int k = 0; k < 3; ++k) {
        reach = fmax(reach, fabs(view->eye[k]));
    }
    umb_seen_prepare(&v->sight, view->eye, view->forward, parallel, reach);
    v->near_depth = view->near_depth;
    v->cut = true;
    if (parallel) {
        frame_scene(v, reach);
    } else {
        frame_view(v, view);
    }
    find_corners(v);
}

/* ---- room ---------------------------------------------------------------------------------------- */

bool umb_shadows_reserve(umb_shadows *s, const umb_allocator *a, uint32_t fronts, uint32_t edges, uint32_t triangles)
{
    /* Near lines are at most as many as triangles, and the frame adds four corners. */
    size_t lines = (size_t)edges + triangles, corners = lines + 4 * (size_t)fronts;
    return umb_memory_reserve(a, (void **)&s->items, &s->item_capacity, fronts, sizeof *s->items) &&
           umb_memory_reserve(a, (void **)&s->lines, &s->line_capacity, lines, sizeof *s->lines) &&
           umb_memory_reserve(a, (void **)&s->corners, &s->corner_capacity, corners, sizeof *s->corners) &&
           umb_memory_reserve(a, (void **)&s->planes, &s->plane_capacity, triangles, sizeof *s->planes);
}

void umb_shadows_free(umb_shadows *s, const umb_allocator *a)
{
    umb_memory_free(a, s->items, s->item_capacity * sizeof *s->items);
    umb_memory_free(a, s->lines, s->line_capacity * sizeof *s->lines);
    umb_memory_free(a, s->corners, s->corner_capacity * sizeof *s->corners);
    umb_memory_free(a, s->planes, s->plane_capacity * sizeof *s->planes);
    memset(s, 0, sizeof *s);
}

void umb_shadows_clear(umb_shadows *s)
{
    s->count = s->line_count = s->corner_count = s->plane_count = 0;
}

/* ---- planes --------------------------------------------------------------------------------------- */

void umb_shadow_plane_of(const umb_seen_from *s, const float a[3], const float b[3], const float c[3],
                         umb_shadow_plane *out)
{
    double p[3], q[3], h = 0.0, off = 0.0;
    memcpy(out->a, a, sizeof out->a);
    memcpy(out->b, b, sizeof out->b);
    memcpy(out->c, c, sizeof out->c);
    for (int k = 0; k < 3; ++k) {
        p[k] = (double)c[k] - a[k];
        q[k] = (double)b[k] - a[k];
    }
    for (int k = 0; k < 3; ++k) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double x = p[i] * q[j], y = p[j] * q[i], d = a[k] - s->eye[k];
        out->n.at[k] = x - y;
        out->n.off[k] = 5.0 * U * (fabs(x) + fabs(y)) * PAD + 0x1p-1000;
        h += out->n.at[k] * d;
        off += out->n.off[k] * fabs(d) + 5.0 * U * fabs(out->n.at[k] * d);
    }
    out->h = h;
    out->h_off = off * PAD + 0x1p-1000;
}

static bool same_plane(const umb_shadow_plane *p, const float a[3], const float b[3], const float c[3])
{
    return umb_orient(p->a, p->b, p->c, a) == 0 && umb_orient(p->a, p->b, p->c, b) == 0 &&
           umb_orient(p->a, p->b, p->c, c) == 0;
}

/* False if some triangle does not surely face the viewer, or there are too many. */
static bool add_planes(umb_shadows *s, const umb_shadow_front *front, umb_shadow *out)
{
    const umb_seen_from *sight = &s->viewer.sight;
    out->first_plane = s->plane_count;
    out->plane_count = 0;
    for (uint32_t i = 0; i < front->triangle_count; ++i) {
        const uint32_t *k = front->triangles[i];
        const float *a = front->points[k[0]], *b = front->points[k[1]], *c = front->points[k[2]];
        umb_seen_line line;
        umb_seen_corner corner;
        umb_seen_line_through(sight, a, b, &line);
        umb_seen_corner_at(sight, c, &corner);
        if (umb_seen_side(sight, &line, &corner) != -1) {
            return false;
        }
        bool known = false;
        for (uint32_t p = 0; p < out->plane_count && !known; ++p) {
            known = same_plane(&s->planes[out->first_plane + p], a, b, c);
        }
        if (known) {
            continue;
        }
        if (out->plane_count == UMB_SHADOW_PLANES || out->first_plane + out->plane_count >= s->plane_capacity) {
            return false;
        }
        umb_shadow_plane_of(sight, a, b, c, &s->planes[out->first_plane + out->plane_count++]);
    }
    return out->plane_count > 0;
}

/* ---- lines ---------------------------------------------------------------------------------------- */

/* Beyond this line the plane is nowhere nearer than the near depth: along d it has the depth h f.d / n.d, so
 * h f.d - near n.d >= 0. Moved inwards for what h and n may be off, times |d|_1 <= ray f.d, and for 8 roundings. */
static void near_line(const umb_shadow_viewer *v, const umb_shadow_plane *p, umb_seen_line *out)
{
    const double *f = v->sight.forward;
    double n[3], off = 0.0, size = 0.0;
    for (int k = 0; k < 3; ++k) {
        double x = p->h * f[k], y = v->near_depth * p->n.at[k];
        n[k] = x - y;
        off = fmax(off, p->h_off * fabs(f[k]) + fabs(v->near_depth) * p->n.off[k]);
        size = fmax(size, fabs(x) + fabs(y));
    }
    double margin = (off + 16.0 * U * size) * v->ray * 1.01;
    for (int k = 0; k < 3; ++k) {
        n[k] -= margin * f[k];
    }
    umb_seen_line_free(n, out);
}

/* How many of the front's corners are surely not nearer than the near depth; *farthest as in umb_shadow. */
static uint32_t count_beyond(const umb_shadow_viewer *v, const umb_shadow_front *front, double *farthest)
{
    uint32_t beyond = 0;
    *farthest = -INFINITY;
    for (uint32_t i = 0; i < front->triangle_count; ++i) {
        for (int k = 0; k < 3; ++k) {
            double off, w = umb_shadow_depth(v, front->points[front->triangles[i][k]], &off);
            beyond += !v->cut || w - off >= v->near_depth;
            *farthest = fmax(*farthest, w + off);
        }
    }
    return beyond;
}

/* Lines of the boundary have the inside on their positive side: against the direction in which fronts run. */
static bool add_lines(umb_shadows *s, const umb_shadow_front *front, bool cut, umb_shadow *out)
{
    uint32_t most = front->edge_count + (cut ? out->plane_count : 0);
    out->first_line = s->line_count;
    out->line_count = 0;
    if (front->edge_count < 3 || most > UMB_SHADOW_LINES || s->line_count + (size_t)most > s->line_capacity) {
        return false;
    }
    umb_seen_line *lines = s->lines + s->line_count;
    for (uint32_t i = 0; i < front->edge_count; ++i) {
        const uint32_t *e = front->edges[front->edge_count - 1 - i];
        umb_seen_line_through(&s->viewer.sight, front->points[e[1]], front->points[e[0]], &lines[out->line_count++]);
    }
    for (uint32_t i = 0; cut && i < out->plane_count; ++i) {
        near_line(&s->viewer, &s->planes[out->first_plane + i], &lines[out->line_count++]);
    }
    return true;
}

/* ---- the polygon --------------------------------------------------------------------------------- */

/* True if the edges make one loop of a convex polygon, which is then in corners. */
static bool find_loop(const umb_seen_from *sight, umb_seen_line *lines, uint32_t count, umb_seen_corner *corners)
{
    for (uint32_t i = 0; i < count; ++i) {
        const umb_seen_line *next = &lines[i + 1 < count ? i + 1 : 0];
        if (memcmp(lines[i].b, next->a, sizeof next->a) != 0) {
            return false;
        }
        umb_seen_corner_at(sight, lines[i].a, &corners[i]);
        corners[i].edge = &lines[i];
        corners[i].flip = corners[i].closed = false;
    }
    bool wide = false;
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t k = 0; k < count; ++k) {
            int side = umb_seen_side(sight, &lines[i], &corners[k]);
            if (side != 0 && side != 1) {
                return false;
            }
            wide = wide || side == 1;
        }
    }
    return wide;
}

/* Cut the frame down to what is inside of all lines; 0: nothing is, or that cannot be told. */
static uint32_t cut_frame(const umb_shadow_viewer *v, umb_seen_line *lines, uint32_t count,
                          umb_seen_corner *out)
{
    umb_seen_corner room[2][UMB_SHADOW_LINES + 8];
    int8_t sides[UMB_SHADOW_LINES + 8];
    uint32_t corner_count = 4, now = 0;
    memcpy(room[0], v->corners, sizeof v->corners);
    for (uint32_t i = 0; i < count; ++i) {
        bool inside = false, outside = false;
        for (uint32_t k = 0; k < corner_count; ++k) {
            int side = umb_seen_side(&v->sight, &lines[i], &room[now][k]);
            if (side == UMB_SEEN_UNKNOWN) {
                return 0;
            }
            sides[k] = (int8_t)side;
            inside = inside || side > 0;
            outside = outside || side < 0;
        }
        if (!inside) {
            return 0;
        }
        if (outside) {
            umb_seen_cut cut = {&v->sight, &lines[i], room[now], sides, corner_count};
            corner_count = umb_seen_clip(&cut, 1, room[1 - now]);
            now = 1 - now;
        }
    }
    for (uint32_t k = 0; k < corner_count; ++k) {
        out[k] = room[now][k];
        out[k].closed = v->framed && out[k].edge >= v->frame && out[k].edge < v->frame + 4;
    }
    return corner_count;
}

umb_shadow_result umb_shadows_add(umb_shadows *s, const umb_shadow_front *front, bool whole)
{
    const umb_shadow_viewer *v = &s->viewer;
    umb_shadow item = {.source = front->source, .first_corner = s->corner_count};
    uint32_t beyond = count_beyond(v, front, &item.farthest);
    bool cut = beyond < 3 * front->triangle_count;
    if (beyond == 0) {
        return UMB_SHADOW_NOTHING;
    }
    if (cut && whole) {
        return UMB_SHADOW_CUT;
    }
    if (cut && !v->framed) {
        return UMB_SHADOW_NOTHING;
    }
    if (s->count >= s->item_capacity || !add_planes(s, front, &item) || !add_lines(s, front, cut, &item) ||
        s->corner_count + (size_t)item.line_count + 4 > s->corner_capacity) {
        return UMB_SHADOW_NOTHING;
    }
    umb_seen_line *lines = s->lines + item.first_line;
    umb_seen_corner *corners = s->corners + s->corner_count;
    item.corner_count = !cut && find_loop(&v->sight, lines, item.line_count, corners)
                            ? item.line_count
                            : cut_frame(v, lines, item.line_count, corners);
    if (item.corner_count == 0) {
        return UMB_SHADOW_NOTHING;
    }
    s->items[s->count++] = item;
    s->line_count += item.line_count;
    s->plane_count += item.plane_count;
    s->corner_count += item.corner_count;
    return UMB_SHADOW_ADDED;
}
