/* The image of a box along the axes; raster_kernels.inl includes this. Which faces look at the eye is decided exactly,
 * by the eye's place beside them: so the outline is one of 26, and every plane a quotient of the map's coefficients. */

/* Corners around the faces that look at the eye, counter-clockwise as it sees them; bit i of a corner: the upper end
 * along axis i. In places sx + 3 sy + 9 sz, s of an axis: 0 the eye is below the box, 2 above, 1 neither. */
typedef struct box_outline {
    uint8_t count, corner[6];
} box_outline;

static const box_outline BOX_OUTLINES[27] = {
    {6, {1, 5, 4, 6, 2, 3}}, {6, {0, 2, 3, 1, 5, 4}}, {6, {0, 2, 3, 7, 5, 4}},
    {6, {0, 4, 6, 2, 3, 1}}, {4, {0, 2, 3, 1, 0, 0}}, {6, {0, 2, 3, 7, 5, 1}},
    {6, {0, 4, 6, 7, 3, 1}}, {6, {0, 2, 6, 7, 3, 1}}, {6, {0, 2, 6, 7, 5, 1}},
    {6, {0, 1, 5, 4, 6, 2}}, {4, {0, 1, 5, 4, 0, 0}}, {6, {0, 1, 3, 7, 5, 4}},
    {4, {0, 4, 6, 2, 0, 0}}, {0, {0, 0, 0, 0, 0, 0}}, {4, {1, 3, 7, 5, 0, 0}},
    {6, {0, 4, 6, 7, 3, 2}}, {4, {2, 6, 7, 3, 0, 0}}, {6, {1, 3, 2, 6, 7, 5}},
    {6, {0, 1, 5, 7, 6, 2}}, {6, {0, 1, 5, 7, 6, 4}}, {6, {0, 1, 3, 7, 6, 4}},
    {6, {0, 4, 5, 7, 6, 2}}, {4, {4, 5, 7, 6, 0, 0}}, {6, {1, 3, 7, 6, 4, 5}},
    {6, {0, 4, 5, 7, 3, 2}}, {6, {2, 6, 4, 5, 7, 3}}, {6, {1, 3, 2, 6, 4, 5}},
};

/* The eight corners on the raster. */
typedef struct box_corners {
    double low[3], high[3]; /* faces relative to the eye: the signs are exact */
    double x[8], y[8], near_least[8];
    double x_min, y_min, x_max, y_max, error, most;
} box_corners;

/* The bounds of place(), for a perspective; false if the near cut is too close. */
static inline bool place_box(const umb_raster_map *m, const umb_aabb *box, box_corners *c)
{
    static const int64_t UPPER[3][8] = {
        {0, -1, 0, -1, 0, -1, 0, -1}, {0, 0, -1, -1, 0, 0, -1, -1}, {0, 0, 0, 0, -1, -1, -1, -1}};
    const double eye[3] = {m->eye.x, m->eye.y, m->eye.z};
    double reach = 0.0;
    for (int i = 0; i < 3; ++i) {
        c->low[i] = box->min[i] - eye[i];
        c->high[i] = box->max[i] - eye[i];
        double a = fabs(c->low[i]), b = fabs(c->high[i]);
        reach += a > b ? a : b;
    }
    umb_dv huge = umb_dv_set(INFINITY), w_min = huge, x_min = huge, y_min = huge;
    umb_dv x_max = -huge, y_max = -huge, error = -huge, most = -huge;
    for (int v = 0; v < 8; v += UMB_WIDE) {
        umb_dv d[3];
        for (int i = 0; i < 3; ++i) {
            umb_lv upper;
            memcpy(&upper, &UPPER[i][v], sizeof upper);
            d[i] = umb_dv_select(upper, umb_dv_set(c->high[i]), umb_dv_set(c->low[i]));
        }
        umb_dv w = (m->w.x * d[0] + m->w.y * d[1]) + m->w.z * d[2];
        umb_dv r = 1.0 / w;
        umb_dv x = ((m->x.x * d[0] + m->x.y * d[1]) + m->x.z * d[2]) * r;
        umb_dv y = ((m->y.x * d[0] + m->y.y * d[1]) + m->y.z * d[2]) * r;
        umb_dv a = umb_dv_abs(x) + umb_dv_abs(y);
        umb_dv e = (2.0 * UMB_U) *
                   (5.0 * (reach * r) * (m->scale + a) + 4.0 * (a + (fabs(m->cx) + fabs(m->cy))));
        umb_dv off = r * (2.0 * (5.0 * UMB_U * reach) * r + 4.0 * UMB_U);
        x += m->cx;
        y += m->cy;
        umb_dv_store(c->x + v, x);
        umb_dv_store(c->y + v, y);
        umb_dv_store(c->near_least + v, r - off);
        w_min = umb_dv_min(w_min, w);
        most = umb_dv_max(most, r + off);
        error = umb_dv_max(error, e);
        x_min = umb_dv_min(x_min, x);
        y_min = umb_dv_min(y_min, y);
        x_max = umb_dv_max(x_max, x);
        y_max = umb_dv_max(y_max, y);
    }
    double cut = m->near_cut + 64.0 * UMB_U * (reach + fabs(m->near_cut));
    c->x_min = umb_dv_least(x_min);
    c->y_min = umb_dv_least(y_min);
    c->x_max = -umb_dv_least(-x_max);
    c->y_max = -umb_dv_least(-y_max);
    c->error = -umb_dv_least(-error);
    c->most = -umb_dv_least(-most);
    return umb_dv_least(w_min) >= cut;
}

static inline double farthest_of_face(const box_corners *c, int axis, bool upper)
{
    uint32_t a = 1u << (axis + 1) % 3, b = 1u << (axis + 2) % 3, k = upper ? 1u << axis : 0;
    double p = c->near_least[k], q = c->near_least[k | a], r = c->near_least[k | b], s = c->near_least[k | a | b];
    p = p < q ? p : q;
    r = r < s ? r : s;
    return p < r ? p : r;
}

/* The plane of the face at d along an axis, d from the eye: a sight-line with W = 1 has gone ray when it is as deep as
 * that, so 1 / W = ray / d, of which ray is affine over the raster. The ray is off by a few units of its size, d and the
 * quotient by one: 16 units of the ray's size over d, and 8 of the terms. */
static inline void add_face(umb_convex *out, const umb_raster_map *m, int axis, double d, double least)
{
    const double x[3] = {m->ray_x.x, m->ray_x.y, m->ray_x.z}, y[3] = {m->ray_y.x, m->ray_y.y, m->ray_y.z};
    const double at[3] = {m->ray_0.x, m->ray_0.y, m->ray_0.z};
    double scale = 1.0 / d, gx = x[axis] * scale, gy = y[axis] * scale, g0 = at[axis] * scale;
    double terms = fabs(gx) * (m->width + 32.0) + fabs(gy) * (m->height + 8.0) + fabs(g0);
    double low = g0 - (16.0 * UMB_U * m->ray_size * fabs(scale) + 8.0 * UMB_U * terms);
    umb_convex_add_plane(out, m, gx, gy, low, low, least);
}

static inline void add_faces(umb_convex *out, const umb_raster_map *m, const box_corners *c)
{
    bool small = (out->x_max - out->x_min) * ((double)out->row1 - out->row0 + 1.0) < UMB_PLANE_PIXELS;
    double all = INFINITY;
    for (int i = 0; i < 3; ++i) {
        bool upper = c->high[i] < 0.0;
        if (!upper && !(c->low[i] > 0.0)) {
            continue;
        }
        double least = farthest_of_face(c, i, upper);
        all = least < all ? least : all;
        if (!small) {
            add_face(out, m, i, upper ? c->high[i] : c->low[i], least);
        }
    }
    if (small) {
        umb_convex_add_plane(out, m, 0.0, 0.0, all, all, all);
    }
}

/* Upright lines are bounds of columns, and need not be looked at in every row. */
static inline void fold_upright(umb_convex *v)
{
    umb_convex_lines *l = &v->left, *r = &v->right;
    uint32_t left = 0, right = 0;
    for (uint32_t i = 0; i < l->count; ++i) {
        double at = l->slope[i] == 0.0 ? l->in_at[i] : v->x_min;
        v->x_min = at > v->x_min ? at : v->x_min;
        l->slope[left] = l->slope[i];
        l->in_at[left] = l->in_at[i];
        left += l->slope[i] != 0.0;
    }
    for (uint32_t i = 0; i < r->count; ++i) {
        double at = r->slope[i] == 0.0 ? r->in_at[i] : v->x_max;
        v->x_max = at < v->x_max ? at : v->x_max;
        r->slope[right] = r->slope[i];
        r->in_at[right] = r->in_at[i];
        right += r->slope[i] != 0.0;
    }
    l->count = left;
    r->count = right;
}

static umb_convex_result find_box(const umb_raster_map *m, const umb_aabb *box, umb_convex *out)
{
    box_corners c;
    if (m->orthographic || !place_box(m, box, &c)) {
        return UMB_CONVEX_OTHER;
    }
    uint32_t place = 0;
    for (int i = 2; i >= 0; --i) {
        place = 3 * place + (c.low[i] <= 0.0) + (c.high[i] < 0.0);
    }
    const box_outline *o = &BOX_OUTLINES[place];
    umb_convex_frame frame = {c.error, c.x_max - c.x_min, m->height, c.y_min, c.y_max};
    out->left.count = out->right.count = out->edge_count = out->plane_count = 0;
    if (o->count == 0) {
        return UMB_CONVEX_NOTHING; /* the eye is in it */
    }
    uint32_t from = o->corner[m->turn > 0 ? o->count - 1 : 0];
    for (uint32_t i = 0; i < o->count; ++i) {
        uint32_t to = o->corner[m->turn > 0 ? i : o->count - 1 - i];
        if (!umb_convex_add_line(out, &frame, c.x[from], c.y[from], c.x[to], c.y[to])) {
            return UMB_CONVEX_OTHER;
        }
        from = to;
    }
    if (!umb_convex_place(out, m, &frame, c.x_min, c.x_max)) {
        return UMB_CONVEX_NOTHING;
    }
    fold_upright(out);
    if (!(out->x_max > out->x_min)) {
        return UMB_CONVEX_NOTHING;
    }
    out->most = (float)(c.most + 0x1p-22 * fabs(c.most));
    add_faces(out, m, &c);
    return UMB_CONVEX_READY;
}
