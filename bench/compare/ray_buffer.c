/* The tracer does one thread's work here, as everything that is timed. */
#include "ray_buffer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <embree3/rtcore.h>

enum { LEVELS = 12, MOST_TEXELS = 512 };

struct ray_buffer {
    const world *world;
    RTCDevice device;
    RTCScene scene;
    screen_lens lens;
    screen_boxes boxes;
    float *level[LEVELS];
    uint32_t level_width[LEVELS], level_height[LEVELS];
    uint32_t levels;
    uint32_t *visible;
};

static RTCScene build(ray_buffer *r, enum RTCBuildQuality quality)
{
    const world *w = r->world;
    RTCScene scene = rtcNewScene(r->device);
    RTCGeometry g = rtcNewGeometry(r->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, w->vertices, 0, 12,
                               w->vertex_count);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, w->indices, 0, 12,
                               w->triangle_count);
    rtcSetGeometryBuildQuality(g, quality);
    rtcCommitGeometry(g);
    (void)rtcAttachGeometry(scene, g);
    rtcReleaseGeometry(g);
    rtcSetSceneBuildQuality(scene, quality);
    rtcCommitScene(scene);
    return scene;
}

ray_buffer *ray_buffer_create(const world *w, uint32_t width, uint32_t height)
{
    ray_buffer *r = calloc(1, sizeof *r);
    if (r == NULL) {
        return NULL;
    }
    r->world = w;
    r->device = rtcNewDevice("threads=1");
    r->visible = malloc(((size_t)w->box_count + 1) * sizeof(uint32_t));
    bool ok = r->device != NULL && r->visible != NULL && screen_boxes_make(&r->boxes, w);
    uint32_t wide = width;
    uint32_t high = height;
    for (bool more = true; ok && more && r->levels < LEVELS; ++r->levels) {
        r->level_width[r->levels] = wide;
        r->level_height[r->levels] = high;
        r->level[r->levels] = malloc((size_t)wide * high * sizeof(float));
        ok = r->level[r->levels] != NULL;
        more = wide > 1 || high > 1;
        wide = (wide + 1) / 2;
        high = (high + 1) / 2;
    }
    if (!ok) {
        ray_buffer_destroy(r);
        return NULL;
    }
    r->scene = build(r, RTC_BUILD_QUALITY_MEDIUM);
    return r;
}

void ray_buffer_destroy(ray_buffer *r)
{
    if (r == NULL) {
        return;
    }
    if (r->scene != NULL) {
        rtcReleaseScene(r->scene);
    }
    if (r->device != NULL) {
        rtcReleaseDevice(r->device);
    }
    for (uint32_t k = 0; k < LEVELS; ++k) {
        free(r->level[k]);
    }
    screen_boxes_free(&r->boxes);
    free(r->visible);
    free(r);
}

double ray_buffer_rebuild(ray_buffer *r, bool quickest)
{
    double start = world_clock();
    RTCScene scene = build(r, quickest ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM);
    double spent = world_clock() - start;
    rtcReleaseScene(scene);
    return spent;
}

static void cast_packet(ray_buffer *r, const umb_view *v, uint32_t x0, uint32_t y0)
{
    static const _Alignas(64) int all[16] = {-1, -1, -1, -1, -1, -1, -1, -1,
                                             -1, -1, -1, -1, -1, -1, -1, -1};
    uint32_t width = r->level_width[0];
    float step_x = (float)((v->x_max - v->x_min) / width);
    float step_y = (float)((v->y_max - v->y_min) / r->level_height[0]);
    float left = (float)v->x_min + step_x * ((float)x0 + 0.5f);
    float top = (float)v->y_max - step_y * ((float)y0 + 0.5f);
    struct RTCRayHit16 q;
    struct RTCIntersectContext context;
    float right[3];
    float up[3];
    for (int k = 0; k < 3; ++k) {
        right[k] = (float)v->right[k];
        up[k] = (float)v->up[k];
    }
    for (uint32_t i = 0; i < 16; ++i) {
        float sx = left + step_x * (float)(i % 4);
        float sy = top - step_y * (float)(i / 4);
        q.ray.org_x[i] = r->lens.eye[0];
        q.ray.org_y[i] = r->lens.eye[1];
        q.ray.org_z[i] = r->lens.eye[2];
        q.ray.dir_x[i] = r->lens.w[0] + sx * right[0] + sy * up[0];
        q.ray.dir_y[i] = r->lens.w[1] + sx * right[1] + sy * up[1];
        q.ray.dir_z[i] = r->lens.w[2] + sx * right[2] + sy * up[2];
        q.ray.tnear[i] = r->lens.near_depth;
        q.ray.tfar[i] = r->lens.far_depth * 1.05f;
        q.ray.time[i] = 0.0f;
        q.ray.mask[i] = UINT32_MAX;
        q.ray.id[i] = i;
        q.ray.flags[i] = 0;
        q.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(all, r->scene, &context, &q);
    for (uint32_t i = 0; i < 16; ++i) {
        r->level[0][(y0 + i / 4) * width + x0 + i % 4] = q.ray.tfar[i];
    }
}

static void make_levels(ray_buffer *r)
{
    for (uint32_t k = 1; k < r->levels; ++k) {
        uint32_t from_width = r->level_width[k - 1];
        uint32_t from_height = r->level_height[k - 1];
        const float *from = r->level[k - 1];
        for (uint32_t y = 0; y < r->level_height[k]; ++y) {
            uint32_t y1 = 2 * y + 1 < from_height ? 2 * y + 1 : 2 * y;
            for (uint32_t x = 0; x < r->level_width[k]; ++x) {
                uint32_t x1 = 2 * x + 1 < from_width ? 2 * x + 1 : 2 * x;
                float a = fmaxf(from[2 * y * from_width + 2 * x], from[2 * y * from_width + x1]);
                float b = fmaxf(from[y1 * from_width + 2 * x], from[y1 * from_width + x1]);
                r->level[k][y * r->level_width[k] + x] = fmaxf(a, b);
            }
        }
    }
}

static uint32_t texel(float at, uint32_t end)
{
    return at > 0.0f ? (at < (float)(end - 1) ? (uint32_t)at : end - 1) : 0;
}

static float distance_to(const ray_buffer *r, uint32_t box)
{
    float square = 0.0f;
    for (int k = 0; k < 3; ++k) {
        float low = r->world->box[k][box] - r->lens.eye[k];
        float high = r->lens.eye[k] - r->world->box[k + 3][box];
        float out = fmaxf(0.0f, fmaxf(low, high));
        square += out * out;
    }
    return sqrtf(square);
}

/* Is a texel of the level within the rectangle, a texel wider all round, farther than this? */
static bool level_shows(const ray_buffer *r, uint32_t k, const float rect[4], float depth,
                        uint32_t *looked)
{
    uint32_t w = r->level_width[k];
    uint32_t h = r->level_height[k];
    uint32_t x0 = texel(rect[0] * (float)w - 1.0f, w);
    uint32_t x1 = texel(rect[1] * (float)w + 1.0f, w);
    uint32_t y0 = texel(rect[2] * (float)h - 1.0f, h);
    uint32_t y1 = texel(rect[3] * (float)h + 1.0f, h);
    *looked += (x1 - x0 + 1) * (y1 - y0 + 1);
    if (*looked > MOST_TEXELS) {
        return true;
    }
    for (uint32_t y = y0; y <= y1; ++y) {
        for (uint32_t x = x0; x <= x1; ++x) {
            if (r->level[k][y * w + x] > depth) {
                return true;
            }
        }
    }
    return false;
}

static bool hidden(const ray_buffer *r, uint32_t place)
{
    const screen_boxes *s = &r->boxes;
    float width = (float)r->level_width[0];
    float height = (float)r->level_height[0];
    if (s->nearest[place] < r->lens.near_depth) {
        return false;
    }
    const float rect[4] = {
        fmaxf(0.0f, s->x_min[place] / width), fminf(1.0f, s->x_max[place] / width),
        fmaxf(0.0f, s->y_min[place] / height), fminf(1.0f, s->y_max[place] / height)};
    float depth = distance_to(r, s->box[place]);
    float size = fmaxf((rect[1] - rect[0]) * width, (rect[3] - rect[2]) * height);
    int32_t level = size > 1.0f ? (int32_t)ceilf(log2f(size)) : 0;
    level = level < (int32_t)r->levels ? level : (int32_t)r->levels - 1;
    uint32_t looked = 0;
    for (; level >= 0; --level) {
        if (!level_shows(r, (uint32_t)level, rect, depth, &looked)) {
            return true;
        }
        if (looked > MOST_TEXELS) {
            return false;
        }
    }
    return false;
}

uint32_t ray_buffer_frame(ray_buffer *r, const umb_view *view, const uint32_t **objects)
{
    uint32_t count = 0;
    screen_lens_make(&r->lens, view, r->level_width[0], r->level_height[0]);
    screen_boxes_frame(&r->boxes, r->world, &r->lens);
    for (uint32_t y = 0; y + 4 <= r->level_height[0]; y += 4) {
        for (uint32_t x = 0; x + 4 <= r->level_width[0]; x += 4) {
            cast_packet(r, view, x, y);
        }
    }
    make_levels(r);
    for (uint32_t i = 0; i < r->boxes.count; ++i) {
        if (!hidden(r, i)) {
            r->visible[count++] = r->world->box_object[r->boxes.box[i]];
        }
    }
    *objects = r->visible;
    return count;
}
