/* Volleys: many rays at once from an eye to one hidden object, asked only whether anything stands between. Such a ray is cheap, and a
 * thousand of them say more about what was hidden than one that finds out what it met. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "region_hunt.h"

#define SHORT_OF 2e-5f /* of the way to the object, so that it is not itself in the way */

static double unit(uint64_t random, uint64_t which)
{
    return oracle_unit(oracle_mix(random, which, 51));
}

bool region_volley_prepare(region_hunt *h)
{
    const uint8_t *accused = h->options->accused;
    uint32_t objects = h->t->model->object_count;
    h->hidden_count = h->near_hidden = 0;
    if (accused == NULL || h->options->volleys == 0) {
        return true;
    }
    h->hidden = h->hidden != NULL ? h->hidden : malloc(((size_t)objects + 1) * sizeof *h->hidden);
    if (h->hidden == NULL) {
        return false;
    }
    /* Those right behind what is seen first. */
    for (int pass = 0; pass < 2; ++pass) {
        for (uint32_t i = 0; i < objects; ++i) {
            bool near = (h->candidate[i] & REGION_LIKELY) != 0;
            bool some = h->t->first_triangle[i + 1] > h->t->first_triangle[i];
            if (accused[i] && some && near == (pass == 0) && h->witness_of[i] == MODEL_NONE) {
                h->hidden[h->hidden_count++] = i;
            }
        }
        h->near_hidden = pass == 0 ? h->hidden_count : h->near_hidden;
    }
    return true;
}

/* A point of a triangle: anywhere, or close to a corner or to the middle of an edge, where what peeps out shows. */
static void point_of(float v[3][3], uint64_t random, double out[3])
{
    static const double pulls[4] = {1e-4, 1e-2, 1.0, 1.0};
    double p = unit(random, 1), q = unit(random, 2), pull = pulls[random >> 40 & 3];
    bool over = p + q > 1.0;
    p = over ? 1.0 - p : p;
    q = over ? 1.0 - q : q;
    double half = random >> 42 & 1 ? 0.5 : 0.0, weight[3] = {1.0 - p - q, p, q};
    unsigned corner = (unsigned)(random >> 43 & 0xFF) % 3;
    for (unsigned i = 0; i < 3; ++i) {
        double goal = i == corner ? 1.0 - half : i == (corner + 1) % 3 ? half : 0.0;
        weight[i] = goal + pull * (weight[i] - goal);
    }
    for (int i = 0; i < 3; ++i) {
        out[i] = weight[0] * v[0][i] + weight[1] * v[1][i] + weight[2] * v[2][i];
    }
}

typedef struct volley {
    struct RTCRay rays[REGION_VOLLEY];
    double points[REGION_VOLLEY][3];
    uint32_t triangles[REGION_VOLLEY];
} volley;

static void aim(const region_hunt *h, volley *s, const double eye[3], uint32_t object, uint64_t random)
{
    uint64_t count = h->t->first_triangle[object + 1] - h->t->first_triangle[object];
    float v[3][3];
    for (uint32_t i = 0; i < REGION_VOLLEY; ++i) {
        uint64_t choice = oracle_mix(random, i, 52);
        if (i % 4 == 0) { /* four at a triangle; one that looks away hides itself */
            for (uint64_t k = 0; k < 4 && (k == 0 || oracle_facing(v, eye) >= 0); ++k) {
                s->triangles[i] = (uint32_t)(oracle_mix(choice, k, 53) % count);
                oracle_triangle(h->t, object, s->triangles[i], v);
            }
        }
        s->triangles[i] = s->triangles[i - i % 4];
        point_of(v, choice, s->points[i]);
        double d[3], square = 0.0;
        for (int k = 0; k < 3; ++k) {
            d[k] = s->points[i][k] - eye[k];
            square += d[k] * d[k];
        }
        float start = square > 0.0 ? (float)(h->cell->near_distance / sqrt(square)) : 2.0f;
        s->rays[i] = (struct RTCRay){.org_x = (float)eye[0], .org_y = (float)eye[1], .org_z = (float)eye[2], .tnear = start,
                                     .dir_x = (float)d[0], .dir_y = (float)d[1], .dir_z = (float)d[2],
                                     .tfar = 1.0f - SHORT_OF, .mask = 0xFFFFFFFFu};
    }
}

void region_volley_item(region_hand *hand, uint64_t item)
{
    const region_hunt *h = hand->hunt;
    uint64_t random = oracle_mix(item, h->options->seed, 50), which = oracle_mix(random, 1, 54);
    bool near = h->near_hidden != 0 && (which & 1) != 0;
    uint32_t object = h->hidden[(which >> 1) % (near ? h->near_hidden : h->hidden_count)];
    double eye[3];
    volley s;
    region_eye(h, random, eye);
    aim(h, &s, eye, object, random);
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcOccluded1M(h->t->scene, &context, s.rays, REGION_VOLLEY, sizeof *s.rays);
    hand->rays += REGION_VOLLEY;
    for (uint32_t i = 0; i < REGION_VOLLEY; ++i) {
        /* Nothing in the way, as floats see it: look closely. A stopped ray has a tfar of -INFINITY. */
        if (s.rays[i].tfar > 0.0f && s.rays[i].tnear < s.rays[i].tfar) {
            region_aim(hand, eye, s.points[i], object, s.triangles[i]);
        }
    }
}
