#include "plane.h"

/* A triple product of differences of three vertices and the eye is off by at most this many units
 * 2^-53 times the product of the three factors' sums of absolute components. */
#define TRIPLE_SLACK 16.0

/* A plane is used when the eye's distance from it is this many times that distance's error bound:
 * the distance then has a relative error below 2^-24. */
#define PLANE_TRUST 0x1p24

umb_face umb_face_of(const umb_raster_map *map, const float a[3], const float b[3], const float c[3])
{
    umb_vec3 corner = umb_vec3_from_float(a);
    umb_vec3 ab = umb_vec3_sub(umb_vec3_from_float(b), corner);
    umb_vec3 ac = umb_vec3_sub(umb_vec3_from_float(c), corner);
    umb_vec3 to_eye = map->orthographic ? umb_vec3_scale(map->ray_w, -1.0)
                                        : umb_vec3_sub(map->eye, corner);
    umb_face f;
    f.normal = umb_vec3_cross(ab, ac);
    f.size = umb_vec3_sum_abs(ab) * umb_vec3_sum_abs(ac);
    f.distance = umb_vec3_dot(f.normal, to_eye);
    f.error = TRIPLE_SLACK * UMB_U * f.size * umb_vec3_sum_abs(to_eye);
    return f;
}

/* Nearness is affine over the raster: with ray(i, j) the direction through a pixel and N the
 * normal,
 *   perspective: 1 / W = N.ray / N.(a - eye)       parallel: -W = (N.ray - N.(a - eye)) / N.ray_w
 * N is off by 4 units of its size, ray by a few of ray_size, hence 16 for the product; evaluating the sum
 * of three terms adds 4 units of each. */
bool umb_face_nearness(const umb_raster_map *map, const umb_face *f, const float a[3],
                       umb_plane_nearness *out)
{
    if (!(fabs(f->distance) >= PLANE_TRUST * f->error)) {
        return false;
    }
    double scale = -1.0 / f->distance;
    double offset = 0.0, offset_size = 0.0;
    if (map->orthographic) {
        umb_vec3 from_eye = umb_vec3_sub(umb_vec3_from_float(a), map->eye);
        offset = umb_vec3_dot(f->normal, from_eye);
        offset_size = umb_vec3_sum_abs(from_eye);
    }
    out->gx = umb_vec3_dot(f->normal, map->ray_x) * scale;
    out->gy = umb_vec3_dot(f->normal, map->ray_y) * scale;
    out->g0 = (umb_vec3_dot(f->normal, map->ray_0) - offset) * scale;
    double terms = fabs(out->gx) * (map->width + 32.0) + fabs(out->gy) * (map->height + 8.0) + fabs(out->g0);
    out->error = 16.0 * UMB_U * f->size * (map->ray_size + offset_size) * fabs(scale) +
                 8.0 * UMB_U * terms;
    return true;
}
