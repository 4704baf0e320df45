#include "measure.h"

/* Van Oosterom and Strackee: half the solid angle of a triangle from the origin. */
static double half_angle(umb_vec3 a, umb_vec3 b, umb_vec3 c)
{
    double la = umb_vec3_length(a), lb = umb_vec3_length(b), lc = umb_vec3_length(c);
    double volume = umb_vec3_dot(a, umb_vec3_cross(b, c));
    double rest = la * lb * lc + umb_vec3_dot(a, b) * lc + umb_vec3_dot(b, c) * la + umb_vec3_dot(c, a) * lb;
    return atan2(volume, rest);
}

double umb_measure_solid_angle(const umb_vec3 *corners, uint32_t count)
{
    double sum = 0.0;
    for (uint32_t i = 2; i < count; ++i) {
        sum -= 2.0 * half_angle(corners[0], corners[i - 1], corners[i]);
    }
    return sum;
}

double umb_measure_area_angle(umb_vec3 area, umb_vec3 centre)
{
    double square = umb_vec3_dot(centre, centre);
    return square > 0.0 ? -umb_vec3_dot(area, centre) / (square * sqrt(square)) : 0.0;
}

/* The area that the polygon's shadow has on the plane n . x = at. */
static double shadow_area(const umb_vec3 *corners, uint32_t count, umb_vec3 n, double at)
{
    umb_vec3 sum = {0, 0, 0};
    umb_vec3 first = umb_vec3_scale(corners[0], at / umb_vec3_dot(n, corners[0]));
    for (uint32_t i = 2; i < count; ++i) {
        umb_vec3 a = umb_vec3_scale(corners[i - 1], at / umb_vec3_dot(n, corners[i - 1]));
        umb_vec3 b = umb_vec3_scale(corners[i], at / umb_vec3_dot(n, corners[i]));
        sum = umb_vec3_add(sum, umb_vec3_cross(umb_vec3_sub(a, first), umb_vec3_sub(b, first)));
    }
    return 0.5 * fabs(umb_vec3_dot(n, sum));
}

double umb_measure_umbra_growth(const umb_vec3 *corners, uint32_t count, umb_vec3 n, double delta)
{
    double farthest = 0.0;
    for (uint32_t i = 0; i < count; ++i) {
        double depth = umb_vec3_dot(n, corners[i]);
        if (!(depth > 0.0)) {
            return 0.0;
        }
        farthest = depth > farthest ? depth : farthest;
    }
    double near_area = shadow_area(corners, count, n, farthest);
    return near_area > 0.0 ? shadow_area(corners, count, n, farthest + delta) / near_area : 0.0;
}
