/* One answered view, as every subcommand reports it. */
#ifndef FRAME_H
#define FRAME_H

#include "json_text.h"
#include "setup.h"

typedef struct frame {
    uint32_t row; /* of the path */
    umb_method method;
    umb_class class_;
    umb_index_def index;
    uint32_t objects;    /* of the scene */
    uint32_t in_frustum; /* objects whose bounds meet the frustum */
    umb_cull_stats stats;
    double time_ms;
    uint64_t hash;
    uint32_t *ids; /* as answered, or NULL; owned */
} frame;

/* Answer once and note what came. with_ids: keep the ids. *set is the answer itself, valid until
 * the culler's next call; may be NULL. in_frustum stays 0. */
int frame_answer(const setup *s, const options *o, const umb_view *view, bool with_ids, frame *out,
                 umb_visible_set *set);
/* How many objects meet the frustum, whatever their size on the picture. */
int frame_count_in_frustum(const setup *s, const options *o, const umb_view *view, uint32_t *out);
void frame_free(frame *f);

/* The members of a JSON object that stand for a frame, without its brackets. */
void frame_json(const frame *f, json_text *j);

/* XXH3-64 of the ids, ascending, as little-endian 32-bit words. False: no memory. */
bool frame_hash(const uint32_t *ids, uint32_t count, uint64_t *out);

/* Middle of count values (mean of the two middle ones); sorts them. 0 when there is none. */
double frame_median(double *values, uint32_t count);

#endif
