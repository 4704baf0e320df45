#include "transform.h"

bool umb_transform_is_identity(const umb_transform *t)
{
    bool zero = true, identity = true;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 4; ++j) {
            zero = zero && t->m[i][j] == 0.0f;
            identity = identity && t->m[i][j] == (i == j ? 1.0f : 0.0f);
        }
    }
    return zero || identity;
}

bool umb_transform_mirrors(const umb_transform *t)
{
    if (umb_transform_is_identity(t)) {
        return false;
    }
    umb_vec3 rows[3];
    for (int i = 0; i < 3; ++i) {
        rows[i] = umb_vec3_from_float(t->m[i]);
    }
    return umb_vec3_dot(rows[0], umb_vec3_cross(rows[1], rows[2])) < 0.0;
}
