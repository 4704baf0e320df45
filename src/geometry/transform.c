#include "transform.h"

#include <string.h>

/* Asked for each object that moves: most have a translation. The rest by the bits, in one pass, but
 * for the signs of zeros. */
bool umb_transform_is_identity(const umb_transform *t)
{
    static const uint32_t one[12] = {0x3F800000u, 0, 0, 0, 0,           0x3F800000u,
                                     0,           0, 0, 0, 0x3F800000u, 0};
    static const uint32_t no_sign = 0x7FFFFFFFu;
    uint32_t bits[12], zero = 0, identity = 0;
    if (t->m[0][3] != 0.0f || t->m[1][3] != 0.0f || t->m[2][3] != 0.0f) {
        return false;
    }
    memcpy(bits, t->m, sizeof bits);
    for (int i = 0; i < 12; ++i) {
        zero |= bits[i] & no_sign;
        identity |= one[i] != 0 ? bits[i] ^ one[i] : bits[i] & no_sign;
    }
    return zero == 0 || identity == 0;
}

bool umb_transform_mirrors(const umb_transform *t)
{
    umb_vec3 rows[3];
    for (int i = 0; i < 3; ++i) {
        rows[i] = umb_vec3_from_float(t->m[i]);
    }
    return umb_vec3_dot(rows[0], umb_vec3_cross(rows[1], rows[2])) < 0.0;
}
