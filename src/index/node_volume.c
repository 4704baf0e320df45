#include "node_volume.h"

#include <math.h>
#include <string.h>

#include "cut.h"
#include "geometry/vec.h"

/* A volume is looked at if its surface is less than this part of the box's: the test of one costs more than a box's eighth of
 * a kernel's call. */
#define SPHERE_PAYS 1.0
#define ORIENTED_PAYS 0.8
/* Sweeps of Jacobi's method: each squares what is left off the diagonal. */
#define SWEEPS 6

static float round_up(double x)
{
    float f = (float)x;
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

static umb_vec3 centre_of(const umb_node_volume *v)
{
    return umb_vec3_make(v->place.m[0][3], v->place.m[1][3], v->place.m[2][3]);
}

static void set_centre(umb_node_volume *v, const umb_aabb *box)
{
    for (int i = 0; i < 3; ++i) {
        v->place.m[i][3] = 0.5f * box->min[i] + 0.5f * box->max[i];
    }
}

/* ---- spheres -------------------------------------------------------------------------------- */

/* The farthest corner of each box, or the far side of the sphere in it: 2^-48 covers the roundings of both. */
static void fit_sphere(const umb_node *node, const umb_node_volume *volumes, umb_node_volume *out)
{
    umb_vec3 c = centre_of(out);
    double radius = 0.0;
    for (uint32_t s = 0; s < node->count; ++s) {
        double square = 0.0;
        for (int i = 0; i < 3; ++i) {
            double at = i == 0 ? c.x : i == 1 ? c.y : c.z;
            double off = fmax(at - node->min[i][s], node->max[i][s] - at);
            square += off * off;
        }
        double far = sqrt(square);
        if ((node->ref[s] & UMB_REF_KIND) == UMB_REF_NODE) {
            const umb_node_volume *below = &volumes[node->ref[s]];
            far = fmin(far, umb_vec3_length(umb_vec3_sub(centre_of(below), c)) + below->half[0]);
        }
        radius = fmax(radius, far);
    }
    out->half[0] = round_up(radius * (1.0 + 0x1p-48));
}

/* ---- oriented boxes ------------------------------------------------------------------------- */

/* How the boxes of a node are spread: the sum over them of the moments around their common middle, each as if filled. */
static void find_spread(const umb_node *node, double m[3][3])
{
    double mean[3] = {0, 0, 0}, centre[UMB_NODE_WIDTH][3];
    memset(m, 0, 9 * sizeof(double));
    for (uint32_t s = 0; s < node->count; ++s) {
        for (int i = 0; i < 3; ++i) {
            centre[s][i] = 0.5 * ((double)node->min[i][s] + node->max[i][s]);
            mean[i] += centre[s][i] / node->count;
        }
    }
    for (uint32_t s = 0; s < node->count; ++s) {
        for (int i = 0; i < 3; ++i) {
            double extent = (double)node->max[i][s] - node->min[i][s];
            m[i][i] += extent * extent / 12.0;
            for (int j = 0; j < 3; ++j) {
                m[i][j] += (centre[s][i] - mean[i]) * (centre[s][j] - mean[j]);
            }
        }
    }
}

/* Turn two axes so that the moment between them vanishes (Jacobi). */
static void turn(double m[3][3], double axes[3][3], int p, int q)
{
    if (m[p][q] == 0.0) {
        return;
    }
    double theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
    double t = (theta >= 0.0 ? 1.0 : -1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
    double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
    if (!isfinite(c) || !isfinite(s)) {
        return;
    }
    for (int k = 0; k < 3; ++k) {
        double a = m[k][p], b = m[k][q];
        m[k][p] = c * a - s * b;
        m[k][q] = s * a + c * b;
    }
    for (int k = 0; k < 3; ++k) {
        double a = m[p][k], b = m[q][k];
        m[p][k] = c * a - s * b;
        m[q][k] = s * a + c * b;
    }
    for (int k = 0; k < 3; ++k) {
        double a = axes[p][k], b = axes[q][k];
        axes[p][k] = c * a - s * b;
        axes[q][k] = s * a + c * b;
    }
}

/* The inverse of a matrix whose columns are floats close to at right angles and to unit length. */
static void invert(const umb_transform *t, double out[3][3])
{
    umb_vec3 a = umb_vec3_make(t->m[0][0], t->m[1][0], t->m[2][0]), b = umb_vec3_make(t->m[0][1], t->m[1][1], t->m[2][1]);
    umb_vec3 c = umb_vec3_make(t->m[0][2], t->m[1][2], t->m[2][2]);
    const umb_vec3 rows[3] = {umb_vec3_cross(b, c), umb_vec3_cross(c, a), umb_vec3_cross(a, b)};
    double det = umb_vec3_dot(a, rows[0]);
    for (int i = 0; i < 3; ++i) {
        out[i][0] = rows[i].x / det;
        out[i][1] = rows[i].y / det;
        out[i][2] = rows[i].z / det;
    }
}

/* How far a box around a centre reaches along a row of the inverse, at most. */
static double reach_of_box(const double row[3], const double low[3], const double high[3])
{
    double up = 0.0, down = 0.0;
    for (int i = 0; i < 3; ++i) {
        up += row[i] > 0.0 ? row[i] * high[i] : row[i] * low[i];
        down += row[i] > 0.0 ? row[i] * low[i] : row[i] * high[i];
    }
    return fmax(up, -down);
}

static double reach_of_volume(const double row[3], const double c[3], const umb_node_volume *v)
{
    double middle = 0.0, half = 0.0;
    for (int i = 0; i < 3; ++i) {
        middle += row[i] * (v->place.m[i][3] - c[i]);
    }
    for (int j = 0; j < 3; ++j) {
        half += fabs(row[0] * v->place.m[0][j] + row[1] * v->place.m[1][j] + row[2] * v->place.m[2][j]) * v->half[j];
    }
    return fabs(middle) + half;
}

/* A point p of what is in the node has the coordinates inverse (p - c) in the box's own axes, exactly as these floats are.
 * Rows of the computed inverse are off by a few 2^-53 of 1, for the matrix is close to a turn; products and sums add
 * fewer than 16 of the reach: 2^-45 of it is more than all. */
static void fit_halves(const umb_node *node, const umb_node_volume *volumes, umb_node_volume *out)
{
    double inverse[3][3], c[3] = {out->place.m[0][3], out->place.m[1][3], out->place.m[2][3]}, half[3] = {0, 0, 0};
    double reach = 0.0;
    invert(&out->place, inverse);
    for (uint32_t s = 0; s < node->count; ++s) {
        double low[3], high[3], own = 0.0;
        for (int i = 0; i < 3; ++i) {
            low[i] = node->min[i][s] - c[i];
            high[i] = node->max[i][s] - c[i];
            own += fmax(fabs(low[i]), fabs(high[i]));
        }
        reach = fmax(reach, own);
        bool deep = (node->ref[s] & UMB_REF_KIND) == UMB_REF_NODE;
        for (int i = 0; i < 3; ++i) {
            double most = reach_of_box(inverse[i], low, high);
            if (deep) {
                most = fmin(most, reach_of_volume(inverse[i], c, &volumes[node->ref[s]]));
            }
            half[i] = fmax(half[i], most);
        }
    }
    for (int i = 0; i < 3; ++i) {
        /* Volumes below reach at most three times as far as their boxes, for they are no larger along their own axes. */
        out->half[i] = round_up(half[i] + 0x1p-43 * reach);
    }
}

static void fit_oriented(const umb_node *node, const umb_node_volume *volumes, umb_node_volume *out)
{
    double spread[3][3], axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    find_spread(node, spread);
    for (int sweep = 0; sweep < SWEEPS; ++sweep) {
        turn(spread, axes, 0, 1);
        turn(spread, axes, 0, 2);
        turn(spread, axes, 1, 2);
    }
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            out->place.m[i][j] = (float)axes[j][i];
        }
    }
    fit_halves(node, volumes, out);
}

/* ---- all of it ------------------------------------------------------------------------------ */

/* Where floats cannot hold it well, a volume is not looked at. */
static bool pays(const umb_node_volume *v, bool spheres, const umb_aabb *box)
{
    double area = umb_half_area(box->min, box->max), x = v->half[0], y = v->half[1], z = v->half[2];
    double own = spheres ? 2.0 * 3.14159265 * x * x : 4.0 * (x * y + y * z + z * x);
    return area > 1e-30 && x < 1e15 && y < 1e15 && z < 1e15 && own < (spheres ? SPHERE_PAYS : ORIENTED_PAYS) * area;
}

bool umb_node_volumes_reserve(umb_node_volumes *volumes, const umb_allocator *a, size_t nodes)
{
    return umb_memory_reserve(a, (void **)&volumes->list, &volumes->capacity, nodes, sizeof *volumes->list);
}

void umb_node_volumes_free(umb_node_volumes *volumes, const umb_allocator *a)
{
    umb_memory_free(a, volumes->list, umb_node_volumes_memory(volumes));
    *volumes = (umb_node_volumes){.spheres = volumes->spheres};
}

size_t umb_node_volumes_memory(const umb_node_volumes *volumes)
{
    return volumes->capacity * sizeof *volumes->list;
}

bool umb_node_volumes_fit(umb_node_volumes *volumes, const umb_node *nodes, uint32_t number)
{
    const umb_node *node = &nodes[number];
    if (node->count == 0) {
        return false;
    }
    umb_aabb box = umb_node_bounds(node);
    umb_node_volume next;
    memset(&next, 0, sizeof next);
    set_centre(&next, &box);
    if (volumes->spheres) {
        fit_sphere(node, volumes->list, &next);
    } else {
        fit_oriented(node, volumes->list, &next);
    }
    next.pays = pays(&next, volumes->spheres, &box);
    bool changed = memcmp(&next, &volumes->list[number], sizeof next) != 0;
    volumes->list[number] = next;
    return changed;
}

void umb_node_volumes_fit_all(umb_node_volumes *volumes, const umb_node *nodes, uint32_t node_count)
{
    for (uint32_t k = node_count; k-- > 0;) {
        (void)umb_node_volumes_fit(volumes, nodes, k);
    }
}
