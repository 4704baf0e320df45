/* Refinement of large cells: what is hidden from every part of a cell is hidden from the cell. Beams are blocked by bodies one
 * by one; from a large cell what hides is mostly several together, which the maps of a part put together. */
#include <math.h>

#include "region_state.h"

#define MOST_ALONG 4    /* parts of an axis */
#define MOST_PARTS 16
#define FIRST_EFFORT 32 /* of what is asked about the whole cell first: it decides about most */

/* As wide as objects are in the mean, but no more than so many: bodies of that size hide much from a part, little from the whole. */
static void find_parts(const umb_region *r, uint32_t parts[3])
{
    double size = umb_region_width(r);
    for (int k = 0; k < 3; ++k) {
        double wanted = ceil((r->query.max[k] - r->query.min[k]) / size);
        parts[k] = wanted >= MOST_ALONG ? MOST_ALONG : wanted > 1.0 ? (uint32_t)wanted : 1;
    }
    while (parts[0] * parts[1] * parts[2] > MOST_PARTS) {
        int k = parts[0] >= parts[1] && parts[0] >= parts[2] ? 0 : parts[1] >= parts[2] ? 1 : 2;
        parts[k] -= 1;
    }
}

static umb_region_query part_of(const umb_region_query *whole, const uint32_t parts[3], uint32_t number)
{
    umb_region_query q = *whole;
    q.maps_only = false;
    for (int k = 0; k < 3; ++k) {
        uint32_t at = number % parts[k];
        double size = (whole->max[k] - whole->min[k]) / parts[k];
        number /= parts[k];
        q.min[k] = whole->min[k] + at * size;
        q.max[k] = at + 1 == parts[k] ? whole->max[k] : whole->min[k] + (at + 1) * size;
    }
    return q;
}

enum { KEPT = 4 }; /* a verdict: it was not decided in some part */

/* Whether object k of the part's set is undecided in the whole; *i is where to go on in the whole's. */
static bool is_open(const umb_region *whole, const umb_region *part, uint32_t k, uint32_t *i)
{
    while (*i < whole->answer.pvs_count && whole->pvs[*i] < part->pvs[k]) {
        *i += 1;
    }
    return *i < whole->answer.pvs_count && whole->pvs[*i] == part->pvs[k] && whole->verdicts[*i] == UMB_UNDECIDED;
}

static void decide_part(umb_region *whole, umb_region *part, uint32_t effort)
{
    uint32_t i = 0;
    for (uint32_t k = 0; k < part->answer.pvs_count; ++k) {
        part->verdicts[k] = is_open(whole, part, k, &i) ? part->verdicts[k] : UMB_STAYS; /* nothing to decide */
    }
    umb_region_decide(part, effort);
    i = 0;
    for (uint32_t k = 0; k < part->answer.pvs_count; ++k) {
        if (is_open(whole, part, k, &i) && part->verdicts[k] != UMB_HIDDEN) {
            whole->verdicts[i] = part->verdicts[k] == UMB_STAYS ? UMB_STAYS : KEPT;
        }
    }
}

static bool any_open(const umb_region *r)
{
    for (uint32_t i = 0; i < r->answer.pvs_count; ++i) {
        if (r->verdicts[i] == UMB_UNDECIDED) {
            return true;
        }
    }
    return false;
}

umb_result umb_region_decide_parts(umb_region *r, uint32_t effort)
{
    uint32_t parts[3], count;
    find_parts(r, parts);
    count = parts[0] * parts[1] * parts[2];
    umb_region_decide(r, count > 1 && effort > FIRST_EFFORT ? FIRST_EFFORT : effort);
    if (count == 1 || !any_open(r)) {
        return UMB_OK;
    }
    umb_region_def def = {.isa = r->kernels->isa, .tasks = r->tasks};
    if (r->part == NULL && umb_region_create(r->index, &def, &r->part) != UMB_OK) {
        return UMB_ERROR_MEMORY;
    }
    umb_result result = UMB_OK;
    for (uint32_t n = 0; n < count && result == UMB_OK; ++n) {
        umb_region_query q = part_of(&r->query, parts, n);
        umb_region_answer answer;
        result = umb_region_solve(r->part, &q, &answer);
        if (result == UMB_OK) {
            decide_part(r, r->part, effort);
        }
    }
    for (uint32_t i = 0; i < r->answer.pvs_count; ++i) {
        uint8_t open = result == UMB_OK ? UMB_HIDDEN : UMB_UNDECIDED; /* in no part's set, if all were asked */
        r->verdicts[i] = r->verdicts[i] == UMB_UNDECIDED ? open : r->verdicts[i] == KEPT ? UMB_UNDECIDED : r->verdicts[i];
    }
    return result;
}
