#include "shaft.h"

/* A corner c (bit 0: upper in x, bit 1: upper in y) of both rectangles: the line through both has them on one side if
 * its normal points out of both there. */
static bool side_at(const double min[2][3], const double max[2][3], uint32_t i, uint32_t j, int c, struct umb_shaft_side *out)
{
    double x[2], y[2], sx = (c & 1) != 0 ? 1.0 : -1.0, sy = (c & 2) != 0 ? 1.0 : -1.0;
    for (int k = 0; k < 2; ++k) {
        x[k] = (c & 1) != 0 ? max[k][i] : min[k][i];
        y[k] = (c & 2) != 0 ? max[k][j] : min[k][j];
    }
    double nx = y[1] - y[0], ny = x[0] - x[1];
    if (nx * sx < 0.0 || ny * sy < 0.0) {
        nx = -nx;
        ny = -ny;
    }
    if (nx * sx < 0.0 || ny * sy < 0.0 || (nx == 0.0 && ny == 0.0)) {
        return false;
    }
    double a = nx * x[0] + ny * y[0], b = nx * x[1] + ny * y[1];
    *out = (struct umb_shaft_side){nx, ny, a > b ? a : b, i, j};
    return true;
}

void umb_shaft_make(umb_shaft *s, const double min[2][3], const double max[2][3])
{
    s->side_count = 0;
    for (uint32_t i = 0; i < 3; ++i) {
        s->min[i] = min[0][i] < min[1][i] ? min[0][i] : min[1][i];
        s->max[i] = max[0][i] > max[1][i] ? max[0][i] : max[1][i];
        for (int c = 0; c < 4; ++c) {
            s->side_count += side_at(min, max, i, (i + 1) % 3, c, &s->sides[s->side_count]) ? 1 : 0;
        }
    }
}
