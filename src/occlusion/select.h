/* Choosing occluders before the walk (Gummerus 5.2): the facets and bodies that look largest, the largest first.
 *
 * Candidates are found over the index, best first: a node is opened only while something below it could look larger
 * than what has been found, by the largest area below it and its distance. So choosing costs what lies near, not
 * what exists. Candidates outside of the frustum are left out. */
#ifndef UMB_SELECT_H
#define UMB_SELECT_H

#include "frustum/box_kernels.h"
#include "geometry/vec.h"
#include "occluder_sets.h"

/* Bodies that are one candidate have no more. */
enum { UMB_SELECT_FACES = UMB_BODY_FACETS };

/* By what candidates are ranked (measure.h). */
typedef enum umb_select_by {
    UMB_SELECT_SOLID_ANGLE,
    UMB_SELECT_AREA_ANGLE,
    UMB_SELECT_UMBRA_GROWTH
} umb_select_by;

/* An occluder that was chosen: a facet, or all of a convex body when facet is UMB_NONE. */
typedef struct umb_pick {
    const umb_occluder *place;
    const umb_facets *facets;
    uint32_t occluder; /* its number in the scene */
    uint32_t set;      /* facets of equal sets know each other's numbers */
    uint32_t facet;
    float score;
} umb_pick;

typedef struct umb_candidate {
    float score;
    uint32_t ref;   /* as in index/tree.h; of an occluder's item: UMB_REF_OCCLUDER and its number */
    uint32_t facet; /* of an occluder; UMB_NONE: the item as a whole */
    uint16_t planes;
    uint8_t ready; /* the score is its own, no bound */
} umb_candidate;

typedef struct umb_rest {
    uint32_t until; /* the frame from which on it is chosen again */
    uint32_t met;   /* the search that last came upon it: trees may hold it in parts */
    uint8_t idle;   /* how often on end it hid nothing */
} umb_rest;

/* The search among what is known of a scene's occluders. */
typedef struct umb_selector {
    umb_occluder_sets known;
    umb_rest *rests;       /* per occluder */
    size_t rest_capacity;
    uint64_t rest_structure; /* of the scene that they are for */
    uint32_t frame;
    umb_select_by by;
    uint32_t searches; /* so far */
    umb_choice all;    /* for searches that are of no frame */
    bool both_sides;   /* of this search: what is seen from behind counts too */
    /* the search */
    umb_candidate *heap;
    size_t heap_count, heap_capacity;
    const umb_choice *choice;
    const umb_box_kernels *kernels;
    double eye[3];
    bool failed; /* no memory for candidates: some were left out */
} umb_selector;

/* No coordinate of what a frame looks at is larger. */
double umb_select_reach(const umb_choice *choice);

void umb_selector_create(umb_selector *s, const umb_allocator *a);
void umb_selector_free(umb_selector *s);

/* A new frame: bring what is known up to date with the scene and the index. False without memory. */
bool umb_select_follow(umb_selector *s, const umb_choice *choice);
/* Begin to search for the frame that the selector has followed to. */
umb_result umb_select_begin(umb_selector *s, const umb_choice *choice, const umb_box_kernels *kernels);
/* Begin to search from any place, all about, by area-angle, whatever the mask and the side that is seen. */
umb_result umb_select_from(umb_selector *s, const umb_choice *choice, const umb_box_kernels *kernels, const double eye[3]);
/* The next best; false when there is none. */
bool umb_select_next(umb_selector *s, umb_pick *out);

/* An occluder's pick, one of its facets or all of a body. */
umb_pick umb_select_pick(const umb_selector *s, const umb_committed *scene, uint32_t occluder, uint32_t facet, float score);

/* How large a pick looks from the viewer of a frame: as in a search, without one. 0: it is seen from behind. */
void umb_select_look_from(umb_selector *s, const umb_choice *choice);
float umb_select_score(const umb_selector *s, const umb_pick *pick);

/* The faces of a pick as the search sees it: relative to where it searches from. */
typedef struct umb_select_look {
    umb_vec3 areas[UMB_SELECT_FACES]; /* along the front normals */
    umb_vec3 centre;
    uint32_t count;
    bool two_sided;
} umb_select_look;

void umb_select_faces(const umb_selector *s, const umb_pick *pick, umb_select_look *out);

/* True if it is not to be chosen in this frame, after what umb_select_feedback() said. */
bool umb_select_rests(const umb_selector *s, uint32_t occluder);

/* After the frame: an occluder was used and hid so many boxes. Where choice->coherence has UMB_COHERENCE_REST, one
 * that hid nothing is not chosen for 1, 2, 4, then 8 frames. */
void umb_select_feedback(umb_selector *s, uint32_t occluder, uint32_t hidden);

#endif
