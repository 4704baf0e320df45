/* The tables of contestants. */
#include "entries.h"

#include <stdlib.h>

#include "foundation_entry.h"
#include "ray_buffer.h"
#include "zbuffer_tree.h"

typedef struct umbrage_row {
    const char *name;
    uint32_t why; /* ENTRY_* */
    umb_index_kind index;
    umb_culler_def def;
    uint32_t width, height; /* the raster; 0: the default */
    uint32_t workers;       /* threads for a frame; 0: one */
} umbrage_row;

enum { ALL = ENTRY_STILL | ENTRY_MOTION | ENTRY_SCENE, STANDARD_ROW = 0 };

static const umbrage_row umbrage_rows[] = {
    {"umbrage", ALL, UMB_INDEX_BVH, {.method = UMB_METHOD_RASTER}, 0, 0, 0},
    {"umbrage, 2 threads",
     ENTRY_MOTION | ENTRY_SCENE,
     UMB_INDEX_BVH,
     {.method = UMB_METHOD_RASTER},
     0,
     0,
     2},
    {"umbrage 512x288", ENTRY_STILL, UMB_INDEX_BVH, {.method = UMB_METHOD_RASTER}, 512, 288, 0},
    {"umbrage 1024x576", ENTRY_STILL, UMB_INDEX_BVH, {.method = UMB_METHOD_RASTER}, 1024, 576, 0},
    {"umbrage 2048x576", ENTRY_STILL, UMB_INDEX_BVH, {.method = UMB_METHOD_RASTER}, 2048, 576, 0},
    {"umbrage, flat index", ENTRY_STILL, UMB_INDEX_FLAT, {.method = UMB_METHOD_RASTER}, 0, 0, 0},
    {"umbrage, frustum only",
     ENTRY_STILL | ENTRY_SCENE,
     UMB_INDEX_BVH,
     {.method = UMB_METHOD_NONE},
     0,
     0,
     0},
    {"umbrage, frustum only, unordered",
     ENTRY_STILL | ENTRY_SCENE,
     UMB_INDEX_BVH,
     {.method = UMB_METHOD_NONE, .unordered = true},
     0,
     0,
     0},
    {"umbrage, frustum only, flat", ENTRY_STILL, UMB_INDEX_FLAT, {.method = UMB_METHOD_NONE}, 0, 0, 0},
    {"umbrage, frustum, flat, unordered",
     ENTRY_STILL,
     UMB_INDEX_FLAT,
     {.method = UMB_METHOD_NONE, .unordered = true},
     0,
     0,
     0},
};

typedef struct zbuffer_row {
    const char *name;
    uint32_t why;
    uint32_t width, height;
    bool tree;
} zbuffer_row;

static const zbuffer_row zbuffer_rows[] = {
    {"z-buffer 1920x1080", ALL, 1920, 1080, false},
    {"z-buffer 512x256", ALL, 512, 256, false},
    {"z-buffer 512x256, tree", ALL, 512, 256, true},
};

typedef struct ray_row {
    const char *name;
    uint32_t why;
    uint32_t width, height;
} ray_row;

static const ray_row ray_rows[] = {
    {"ray buffer 256x144", ALL, 256, 144},
};

typedef struct umbrage_self {
    umb_culler *culler;
    umb_pool *pool;
    const umbrage_row *row;
} umbrage_self;

static uint32_t umbrage_frame(void *self, const umb_view *view, const uint32_t **objects)
{
    umbrage_self *u = self;
    umb_view own = *view;
    umb_visible_set seen;
    own.buffer_width = u->row->width;
    own.buffer_height = u->row->height;
    if (umb_cull(u->culler, &own, &seen) != UMB_OK) {
        return UINT32_MAX;
    }
    *objects = seen.objects;
    return seen.count;
}

static void umbrage_destroy(void *self)
{
    umbrage_self *u = self;
    umb_culler_destroy(u->culler);
    umb_pool_destroy(u->pool);
    free(u);
}

static bool make_umbrage(const world *w, const umbrage_row *row, entry *out)
{
    umbrage_self *u = calloc(1, sizeof *u);
    *out = (entry){.name = row->name,
                   .about = row->def.method == UMB_METHOD_NONE ? "frustum" : "strict",
                   .ours = true,
                   .standard = row == &umbrage_rows[STANDARD_ROW],
                   .self = u,
                   .frame = umbrage_frame,
                   .destroy = umbrage_destroy};
    if (u == NULL) {
        return false;
    }
    umb_culler_def def = row->def;
    u->row = row;
    if (row->workers > 1) {
        if (umb_pool_create(row->workers, &u->pool) != UMB_OK) {
            return false;
        }
        def.tasks = umb_pool_tasks(u->pool);
    }
    return umb_culler_create(w->index[row->index], &def, &u->culler) == UMB_OK;
}

static uint32_t frame_of_zbuffer(void *self, const umb_view *view, const uint32_t **objects)
{
    return zbuffer_frame(self, view, objects);
}

static void destroy_zbuffer(void *self)
{
    zbuffer_destroy(self);
}

static uint32_t frame_of_tree(void *self, const umb_view *view, const uint32_t **objects)
{
    return zbuffer_tree_frame(self, view, objects);
}

static void destroy_tree(void *self)
{
    zbuffer_tree_destroy(self);
}

static bool make_zbuffer(const world *w, const zbuffer_row *row, entry *out)
{
    *out = (entry){.name = row->name,
                   .about = "samples",
                   .frame = row->tree ? frame_of_tree : frame_of_zbuffer,
                   .destroy = row->tree ? destroy_tree : destroy_zbuffer};
    if (row->tree) {
        out->self = zbuffer_tree_create(w, row->width, row->height);
    } else {
        out->self = zbuffer_create(w, row->width, row->height);
    }
    return out->self != NULL;
}

static uint32_t frame_of_rays(void *self, const umb_view *view, const uint32_t **objects)
{
    return ray_buffer_frame(self, view, objects);
}

static void destroy_rays(void *self)
{
    ray_buffer_destroy(self);
}

static bool make_rays(const world *w, const ray_row *row, entry *out)
{
    ray_buffer *r = ray_buffer_create(w, row->width, row->height);
    *out = (entry){.name = row->name,
                   .about = "samples",
                   .self = r,
                   .frame = frame_of_rays,
                   .destroy = destroy_rays,
                   .apart = "tree of the occluders"};
    if (r != NULL) {
        double first = ray_buffer_rebuild(r, false);
        double second = ray_buffer_rebuild(r, false);
        out->apart_ms = first < second ? first : second;
    }
    return r != NULL;
}

#define COUNT(table) (sizeof(table) / sizeof(table)[0])

uint32_t entries_make(const world *w, uint32_t why, entry out[ENTRIES_MOST])
{
    uint32_t count = 0;
    bool ok = true;
    for (size_t i = 0; ok && i < COUNT(umbrage_rows); ++i) {
        if (umbrage_rows[i].why & why) {
            ok = make_umbrage(w, &umbrage_rows[i], &out[count++]);
        }
    }
    for (size_t i = 0; ok && i < COUNT(zbuffer_rows); ++i) {
        if (zbuffer_rows[i].why & why) {
            ok = make_zbuffer(w, &zbuffer_rows[i], &out[count++]);
        }
    }
    for (size_t i = 0; ok && i < COUNT(ray_rows); ++i) {
        if (ray_rows[i].why & why) {
            ok = make_rays(w, &ray_rows[i], &out[count++]);
        }
    }
    if (ok && w->foundation != NULL && (ENTRY_SCENE & why) != 0 && foundation_entry(w, &out[count])) {
        ++count;
    }
    if (!ok) {
        entries_free(out, count);
        return 0;
    }
    return count;
}

void entries_free(entry *entries, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        if (entries[i].self != NULL) {
            entries[i].destroy(entries[i].self);
        }
    }
}
