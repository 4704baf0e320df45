/* The large picture, traced in packets of 4 x 4 rays. */
#include "item_buffer.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <xxhash.h>

#include <embree3/rtcore.h>

#include "truth/truth.h"

enum { OPAQUE, OPEN, KINDS };

/* All triangles of the scene in two soups, and whose each is. */
typedef struct soup {
    float *vertices;
    uint32_t *indices[KINDS];
    uint32_t *objects[KINDS];
    uint32_t count[KINDS];
    size_t vertex_count;
    RTCDevice device;
    RTCScene scene[KINDS];
} soup;

static void soup_free(soup *s)
{
    for (int k = 0; k < KINDS; ++k) {
        if (s->scene[k] != NULL) {
            rtcReleaseScene(s->scene[k]);
        }
        free(s->indices[k]);
        free(s->objects[k]);
    }
    if (s->device != NULL) {
        rtcReleaseDevice(s->device);
    }
    free(s->vertices);
}

static bool soup_fill(soup *s, const model *m)
{
    size_t triangles = 0;
    for (uint32_t i = 0; i < m->object_count; ++i) {
        if (m->objects[i].mesh != MODEL_NONE) {
            s->vertex_count += m->meshes[m->objects[i].mesh].position_count;
            triangles += m->meshes[m->objects[i].mesh].triangle_count;
        }
    }
    bool ok = (s->vertices = calloc(s->vertex_count + 2, 3 * sizeof(float))) != NULL;
    for (int k = 0; k < KINDS; ++k) {
        s->indices[k] = malloc((triangles + 1) * 3 * sizeof(uint32_t));
        s->objects[k] = malloc((triangles + 1) * sizeof(uint32_t));
        ok = ok && s->indices[k] != NULL && s->objects[k] != NULL;
    }
    uint32_t first = 0;
    for (uint32_t i = 0; ok && i < m->object_count; ++i) {
        const model_object *o = &m->objects[i];
        if (o->mesh == MODEL_NONE) {
            continue;
        }
        const model_mesh *mesh = &m->meshes[o->mesh];
        for (uint32_t v = 0; v < mesh->position_count; ++v) {
            model_world_vertex(m, o, v, s->vertices + 3 * (size_t)(first + v));
        }
        for (uint32_t k = 0; k < mesh->triangle_count; ++k) {
            int kind = mesh->flags[k] & UMB_TRIANGLE_OPEN ? OPEN : OPAQUE;
            uint32_t slot = s->count[kind]++;
            for (int j = 0; j < 3; ++j) {
                s->indices[kind][3 * (size_t)slot + j] = first + mesh->indices[3 * (size_t)k + j];
            }
            s->objects[kind][slot] = i;
        }
        first += mesh->position_count;
    }
    return ok;
}

static bool soup_build(soup *s)
{
    s->device = rtcNewDevice("threads=1");
    for (int k = 0; k < KINDS && s->device != NULL; ++k) {
        if (s->count[k] == 0) {
            continue;
        }
        RTCGeometry g = rtcNewGeometry(s->device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, s->vertices, 0,
                                   12, s->vertex_count);
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, s->indices[k], 0,
                                   12, s->count[k]);
        rtcCommitGeometry(g);
        s->scene[k] = rtcNewScene(s->device);
        rtcSetSceneFlags(s->scene[k],
                         RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
        rtcAttachGeometry(s->scene[k], g);
        rtcReleaseGeometry(g);
        rtcCommitScene(s->scene[k]);
    }
    return s->device != NULL && rtcGetDeviceError(s->device) == RTC_ERROR_NONE;
}

typedef struct tracing {
    const soup *soup;
    const cameras *cameras;
    item_buffer *out;
    uint32_t object_count;
    bool *failed; /* per view */
} tracing;

typedef struct open_context {
    struct RTCIntersectContext base; /* first: the filter gets a pointer to it */
    const soup *soup;
    uint32_t *pixels;
} open_context;

/* Whatever open surface lies before the opaque one is seen; none of them ends a ray. */
static void note_open(const struct RTCFilterFunctionNArguments *args)
{
    open_context *c = (open_context *)(void *)args->context;
    for (unsigned i = 0; i < args->N; ++i) {
        if (args->valid[i] == -1) {
            /* Behind five arrays of N numbers: the normal, u and v. */
            uint32_t primitive = ((const uint32_t *)(const void *)args->hit)[5 * args->N + i];
            ++c->pixels[c->soup->objects[OPEN][primitive]];
            args->valid[i] = 0;
        }
    }
}

static void aim(struct RTCRayHit16 *q, const umb_view *v, uint32_t x, uint32_t y, uint32_t width,
                uint32_t height)
{
    for (uint32_t i = 0; i < 16; ++i) {
        double sx = v->x_min + (v->x_max - v->x_min) * (x + i % 4 + 0.5) / width;
        double sy = v->y_max - (v->y_max - v->y_min) * (y + i / 4 + 0.5) / height;
        float *org[3] = {q->ray.org_x, q->ray.org_y, q->ray.org_z};
        float *dir[3] = {q->ray.dir_x, q->ray.dir_y, q->ray.dir_z};
        for (int k = 0; k < 3; ++k) {
            org[k][i] = (float)v->eye[k];
            dir[k][i] = (float)(v->forward[k] + sx * v->right[k] + sy * v->up[k]);
        }
        q->ray.tnear[i] = (float)v->near_depth;
        q->ray.tfar[i] = (float)v->far_depth;
        q->ray.time[i] = 0.0f;
        q->ray.mask[i] = UINT32_MAX;
        q->ray.id[i] = i;
        q->ray.flags[i] = 0;
        q->hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        q->hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
}

static void trace_packet(const tracing *t, const umb_view *v, uint32_t x, uint32_t y,
                         uint32_t *pixels)
{
    _Alignas(64) int valid[16];
    struct RTCRayHit16 q;
    open_context c = {.soup = t->soup, .pixels = pixels};
    aim(&q, v, x, y, t->out->width, t->out->height);
    for (uint32_t i = 0; i < 16; ++i) {
        valid[i] = x + i % 4 < t->out->width && y + i / 4 < t->out->height ? -1 : 0;
    }
    rtcInitIntersectContext(&c.base);
    c.base.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    if (t->soup->scene[OPAQUE] != NULL) {
        rtcIntersect16(valid, t->soup->scene[OPAQUE], &c.base, &q);
    }
    for (uint32_t i = 0; i < 16; ++i) {
        if (valid[i] == -1 && q.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
            ++pixels[t->soup->objects[OPAQUE][q.hit.primID[i]]];
        }
    }
    if (t->soup->scene[OPEN] != NULL) {
        c.base.filter = note_open;
        rtcIntersect16(valid, t->soup->scene[OPEN], &c.base, &q);
    }
}

static void trace_view(void *data, uint32_t number)
{
    const tracing *t = data;
    item_view *out = &t->out->views[number];
    uint32_t *pixels = calloc((size_t)t->object_count + 1, sizeof *pixels);
    if (pixels == NULL) {
        t->failed[number] = true;
        return;
    }
    for (uint32_t y = 0; y < t->out->height; y += 4) {
        for (uint32_t x = 0; x < t->out->width; x += 4) {
            trace_packet(t, &t->cameras->views[number], x, y, pixels);
        }
    }
    for (uint32_t i = 0; i < t->object_count; ++i) {
        out->count += pixels[i] != 0;
    }
    out->items = malloc(((size_t)out->count + 1) * sizeof *out->items);
    t->failed[number] = out->items == NULL;
    for (uint32_t i = 0, n = 0; out->items != NULL && i < t->object_count; ++i) {
        if (pixels[i] != 0) {
            out->items[n++] = (item){i, pixels[i]};
        }
    }
    free(pixels);
}

static bool trace_all(item_buffer *b, const world *w, const cameras *c)
{
    soup s = {0};
    tracing t = {.soup = &s, .cameras = c, .out = b, .object_count = w->model->object_count};
    umb_pool *pool = NULL;
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    uint32_t workers = cores < 1 ? 1 : cores > 64 ? 64 : (uint32_t)cores;
    t.failed = calloc(c->count, sizeof(bool));
    bool ok = t.failed != NULL && soup_fill(&s, w->model) && soup_build(&s) &&
              umb_pool_create(workers, &pool) == UMB_OK;
    if (ok) {
        umb_tasks tasks = umb_pool_tasks(pool);
        tasks.run(tasks.user, trace_view, &t, c->count);
    }
    for (uint32_t v = 0; ok && v < c->count; ++v) {
        ok = !t.failed[v];
    }
    umb_pool_destroy(pool);
    free(t.failed);
    soup_free(&s);
    b->traced = true;
    return ok;
}

/* Everything an answer depends on: geometry, views, size. */
static uint64_t key_of(const world *w, const cameras *c, uint32_t width, uint32_t height)
{
    XXH64_state_t *state = XXH64_createState();
    uint64_t key = 0;
    if (state == NULL) {
        return 0;
    }
    (void)XXH64_reset(state, 1);
    for (uint32_t i = 0; i < w->model->mesh_count; ++i) {
        const model_mesh *m = &w->model->meshes[i];
        (void)XXH64_update(state, m->positions, 12 * (size_t)m->position_count);
        (void)XXH64_update(state, m->indices, 12 * (size_t)m->triangle_count);
        (void)XXH64_update(state, m->flags, m->triangle_count);
    }
    for (uint32_t i = 0; i < w->model->object_count; ++i) {
        (void)XXH64_update(state, &w->model->objects[i].mesh, sizeof(uint32_t));
        (void)XXH64_update(state, &w->model->objects[i].transform, sizeof(umb_transform));
    }
    for (uint32_t v = 0; v < c->count; ++v) {
        const umb_view *view = &c->views[v];
        (void)XXH64_update(state, view->eye, sizeof view->eye);
        (void)XXH64_update(state, view->forward, sizeof view->forward);
        (void)XXH64_update(state, view->up, sizeof view->up);
        const double sizes[4] = {view->x_max, view->y_max, view->near_depth, view->far_depth};
        (void)XXH64_update(state, sizes, sizeof sizes);
    }
    (void)XXH64_update(state, &width, sizeof width);
    (void)XXH64_update(state, &height, sizeof height);
    key = XXH64_digest(state);
    (void)XXH64_freeState(state);
    return key;
}

static bool read_cache(item_buffer *b, const char *file, uint32_t object_count)
{
    FILE *f = fopen(file, "rb");
    uint32_t count = 0;
    bool ok = f != NULL && fread(&count, sizeof count, 1, f) == 1 && count == b->view_count;
    for (uint32_t v = 0; ok && v < b->view_count; ++v) {
        item_view *view = &b->views[v];
        ok = fread(&view->count, sizeof view->count, 1, f) == 1 && view->count <= object_count;
        view->items = ok ? malloc(((size_t)view->count + 1) * sizeof(item)) : NULL;
        ok = ok && view->items != NULL &&
             fread(view->items, sizeof(item), view->count, f) == view->count;
        for (uint32_t i = 0; ok && i < view->count; ++i) {
            ok = view->items[i].object < object_count;
        }
    }
    if (f != NULL) {
        (void)fclose(f);
    }
    for (uint32_t v = 0; !ok && v < b->view_count; ++v) {
        free(b->views[v].items);
        b->views[v] = (item_view){0};
    }
    return ok;
}

/* A file that cannot be written costs time at the next run, nothing else. */
static void write_cache(const item_buffer *b, const char *file)
{
    char part[600];
    (void)snprintf(part, sizeof part, "%s.part", file);
    FILE *f = fopen(part, "wb");
    if (f == NULL) {
        return;
    }
    bool ok = fwrite(&b->view_count, sizeof b->view_count, 1, f) == 1;
    for (uint32_t v = 0; v < b->view_count; ++v) {
        const item_view *view = &b->views[v];
        ok = ok && fwrite(&view->count, sizeof view->count, 1, f) == 1 &&
             fwrite(view->items, sizeof(item), view->count, f) == view->count;
    }
    ok = fclose(f) == 0 && ok;
    if (!ok || rename(part, file) != 0) {
        (void)remove(part);
    }
}

bool item_buffer_make(item_buffer *b, const world *w, const cameras *c, uint32_t width,
                      uint32_t height, const char *cache, umb_error *error)
{
    char file[512];
    *b = (item_buffer){.view_count = c->count, .width = width, .height = height};
    b->views = calloc(c->count, sizeof *b->views);
    (void)snprintf(file, sizeof file, "%s/%s-%s-%016llx.items", cache, w->name, c->name,
                   (unsigned long long)key_of(w, c, width, height));
    bool ok = b->views != NULL;
    if (ok && !read_cache(b, file, w->model->object_count)) {
        ok = trace_all(b, w, c);
        if (ok) {
            write_cache(b, file);
        }
    }
    if (!ok) {
        (void)snprintf(error->text, sizeof error->text, "%.200s: not enough memory to trace it",
                       w->spec);
        item_buffer_free(b);
        return false;
    }
    for (uint32_t v = 0; v < b->view_count; ++v) {
        b->mean += (double)b->views[v].count / b->view_count;
    }
    return true;
}

void item_buffer_free(item_buffer *b)
{
    for (uint32_t v = 0; b->views != NULL && v < b->view_count; ++v) {
        free(b->views[v].items);
    }
    free(b->views);
    *b = (item_buffer){0};
}

uint32_t item_buffer_confirm(const world *w, const umb_view *view, const uint8_t *hidden)
{
    umb_error error = {0};
    truth_result result;
    truth *t = truth_create(w->model, &error);
    uint32_t confirmed = UINT32_MAX;
    truth_options options = {.grid_width = 640, .grid_height = 360, .accused = hidden, .threads = 1};
    if (t != NULL && truth_view(t, view, &options, &result, &error)) {
        confirmed = 0;
        for (uint32_t i = 0; i < w->model->object_count; ++i) {
            bool seen = (result.culling[i].renderers != 0 && result.culling[i].confirmed) ||
                        (result.two_sided[i].renderers != 0 && result.two_sided[i].confirmed);
            confirmed += hidden[i] && seen;
        }
        truth_result_free(&result);
    }
    truth_destroy(t);
    return confirmed;
}
