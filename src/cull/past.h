/* What a culler remembers of earlier frames (Gummerus 3.7 and 5.2), each part only when the switch that uses it is
 * on. Nothing in it hides anything: what it says is only what need not be asked, and what may be left undrawn.
 *
 * Everything is known by the number of a frame, by node, object and occluder number. When things come and go between
 * two frames, it follows the scene's change lists; when more has changed than they tell, all is forgotten. Answers
 * that could not be completed leave no trace. */
#ifndef UMB_PAST_H
#define UMB_PAST_H

#include "base/memory.h"
#include "index/tree.h"
#include "occlusion/method.h"

/* An object that was seen is asked about in one frame of this many, each in its own. */
#define UMB_PAST_TURN 4
/* An occluder that covers nothing rests for 1, 2, 4, ... frames, at most for two to the power of this. */
#define UMB_PAST_LONGEST_REST 3
#define UMB_PAST_SCORES 256

typedef struct umb_occluder_past {
    uint32_t drawn;  /* the frame it was last drawn in */
    uint32_t rests;  /* it rests up to and without this frame, as long as its image is much the same */
    umb_pixel_rect rect; /* of its box when it was last drawn; x0 > x1: it had none */
    uint8_t idle;    /* draws on end that changed nothing */
    uint8_t worth;   /* of its image, the part that its latest draws changed: 255 is all */
} umb_occluder_past;

/* A box found hidden, by the tile of the raster that its middle is in. */
typedef struct umb_hidden_place {
    umb_image image;
    uint32_t frame;
} umb_hidden_place;

typedef struct umb_past {
    uint32_t switches; /* UMB_COHERENCE_... */
    uint32_t budget;   /* 0: none */
    uint32_t frame;    /* of the walk that is going on; 0: nothing is known */
    uint64_t structure;
    uint32_t *open; /* per node: the frame in which something below it was last reported */
    uint32_t *seen; /* per object: the frame in which it was last reported */
    umb_occluder_past *occluders;
    uint32_t *early, *next;        /* occluders that changed the buffer, last frame and in this one */
    umb_hidden_place *places;      /* per tile */
    uint32_t early_count, next_count, width, height, columns, rows;
    uint32_t least_score;          /* with a budget: what is drawn, and of the least so many */
    uint32_t least_left, left;     /* how many more of the least may be drawn in this frame, and of all */
    uint32_t least_count;
    bool was_least; /* the last one drawn was of the least score */
    uint32_t scores[UMB_PAST_SCORES]; /* of the occluders that came up in this frame */
    size_t open_capacity, seen_capacity, occluder_capacity, early_capacity, next_capacity;
    size_t place_capacity;
} umb_past;

/* Begin a frame, with room for all that it can need. False without memory. */
bool umb_past_begin(umb_past *p, const umb_allocator *a, const umb_tree *tree, const umb_committed *scene,
                    const umb_raster_map *map);
/* The frame is answered. */
void umb_past_end(umb_past *p);
void umb_past_free(umb_past *p, const umb_allocator *a);

static inline bool umb_past_on(const umb_past *p)
{
    return p->switches != 0 || p->budget != 0;
}

/* Any of them. */
static inline bool umb_past_has(const umb_past *p, uint32_t switches)
{
    return (p->switches & switches) != 0;
}

/* True if what was seen may answer a question. */
static inline bool umb_past_knows(const umb_past *p)
{
    return umb_past_has(p, UMB_COHERENCE_HIERARCHY | UMB_COHERENCE_CONSERVATIVE);
}

/* True if occluders are to be judged before they are drawn; costly: that is no convex one. */
static inline bool umb_past_judges(const umb_past *p, bool costly)
{
    return p->budget != 0 || umb_past_has(p, UMB_COHERENCE_LIST) || (costly && umb_past_has(p, UMB_COHERENCE_REST));
}

/* True if the walk need not ask about a node: something below it was seen in the last frame. */
static inline bool umb_past_node_open(const umb_past *p, uint32_t node)
{
    return umb_past_has(p, UMB_COHERENCE_HIERARCHY) && p->open[node] == p->frame - 1;
}

/* True if an object may be reported unasked: it was reported in the last frame, and its turn to be asked about is
 * another frame. */
static inline bool umb_past_object_seen(const umb_past *p, uint32_t object)
{
    return umb_past_has(p, UMB_COHERENCE_CONSERVATIVE) && p->seen[object] == p->frame - 1 &&
           (p->frame + object) % UMB_PAST_TURN != 0;
}

/* An object is reported: it, and the nodes from this one up. */
static inline void umb_past_saw(umb_past *p, const umb_tree *tree, uint32_t object, uint32_t node)
{
    if (umb_past_has(p, UMB_COHERENCE_CONSERVATIVE)) {
        p->seen[object] = p->frame;
    }
    if (umb_past_has(p, UMB_COHERENCE_HIERARCHY)) {
        for (; node != UMB_NONE && p->open[node] != p->frame; node = tree->nodes[node].parent) {
            p->open[node] = p->frame;
        }
    }
}

/* True if a box found hidden in this frame says that this one is: it holds all its pixels, and nothing of this
 * one is nearer. */
bool umb_past_hides(const umb_past *p, const umb_image *image);
void umb_past_hidden(umb_past *p, const umb_image *image);

typedef enum umb_past_verdict {
    UMB_PAST_DRAW,
    UMB_PAST_DONE,  /* drawn in this frame already */
    UMB_PAST_RESTS, /* it hid nothing of late */
    UMB_PAST_COSTS /* beyond the budget */
} umb_past_verdict;

/* What to do with an occluder that has come up, whose box has this image; NULL: it reaches the eye. */
umb_past_verdict umb_past_judge(umb_past *p, uint32_t occluder, const umb_pixel_rect *rect);
/* It was drawn, and changed so many tiles. costly: it may rest when it changes nothing. */
void umb_past_drew(umb_past *p, uint32_t occluder, const umb_pixel_rect *rect, uint32_t tiles, bool costly);
/* The last one drawn moves by itself: where it will be in the next frame is not known before the walk. */
static inline void umb_past_unlist(umb_past *p, uint32_t occluder)
{
    p->next_count -= p->next_count > 0 && p->next[p->next_count - 1] == occluder;
}

/* The last one judged to be drawn turned out to face away, or the like: it cost the budget nothing. */
void umb_past_refund(umb_past *p);

#endif
