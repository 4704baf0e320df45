/* The culler: one viewer's state over frames, and the visible set it answers with. */
#ifndef UMBRAGE_CULL_H
#define UMBRAGE_CULL_H

#include "index.h"
#include "view.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct umb_culler umb_culler;

/* Ways to decide occlusion. */
typedef enum umb_method {
    UMB_METHOD_RASTER = 0, /* strict silhouette raster (docs/conservative.md); the default */
    UMB_METHOD_NONE = 1,   /* frustum culling only */
    UMB_METHOD_PLANES = 2, /* strict, in object space, no raster: large occluders, chosen first, and their planes
                              (Coorg and Teller 1997; Gummerus 5.4) */
    UMB_METHOD_SHADOW_FRUSTA = 3, /* the same kind: each hides alone, chosen by what it hides (Hudson and others 1997) */
    UMB_METHOD_OCCLUSION_TREE = 4 /* the same kind: shadows merged into one tree, so that occluders hide together
                                     whatever they share (Bittner, Havran and Slavik 1998) */
} umb_method;

/* What a method promises. */
typedef enum umb_class {
    UMB_CLASS_STRICT = 0,     /* nothing that can be seen is hidden, at any resolution */
    UMB_CLASS_PIXEL = 1,      /* exact for the samples of one raster */
    UMB_CLASS_APPROXIMATE = 2 /* the user asked for an error: contribution culling */
} umb_class;

/* What a culler may carry over from one frame to the next (Gummerus 3.7, 5.2), as bits. Each is safe alone and with
 * any others: an occluder may be drawn at any time, a node opened or an object reported without asking, and
 * nothing is ever hidden but by a test of this frame. They pay, if at all, for one viewer that moves in small steps.
 * What is remembered of objects and occluders that come or go is dropped; more than one such commit between two frames
 * drops all. */
typedef enum umb_coherence {
    /* What changed the buffer in the last frame is drawn first, nearest first, before anything is asked (Greene's
       temporal coherence list). */
    UMB_COHERENCE_LIST = 1u << 0,
    /* Nodes that had something visible below them in the last frame are opened untested: tests begin where they
       ended (hierarchical updating). */
    UMB_COHERENCE_HIERARCHY = 1u << 1,
    /* A box that lies, in the picture and in depth, within one just found hidden is hidden without a test
       (visibility propagation, in the form that proves it). */
    UMB_COHERENCE_PROPAGATION = 1u << 2,
    /* What was visible in the last frame is reported untested, except in one frame of four, each object in its own
       (conservative hierarchical updating). May report more, for three frames. */
    UMB_COHERENCE_CONSERVATIVE = 1u << 3,
    /* An occluder that covered nothing new when it was last drawn rests for 1, 2, 4, then 8 frames, as long as its
       image stays much where and what it was; convex ones, which are cheap, do not. May report more.
       UMB_METHOD_PLANES and UMB_METHOD_SHADOW_FRUSTA: one that was chosen and hid nothing, convex or not, makes room
       for others as long. Methods that choose their occluders first know no other switch but
       the next two, and UMB_COHERENCE_LIST with UMB_METHOD_SHADOW_FRUSTA: those that hid most in the last frame are
       chosen first. */
    UMB_COHERENCE_REST = 1u << 4,
    /* UMB_METHOD_PLANES: tangent planes of occluders' edges and boxes are kept at the nodes, 19 MB of them at most, and used
       again when the eye has moved (Coorg and Teller 3.3); without, planes through the eye are made in each frame,
       which costs less (docs/results/planes.md). Answers are the same. */
    UMB_COHERENCE_PLANES = 1u << 5,
    /* Methods that choose first, in perspective and within the scene's bounds: a kd-tree divides the places of viewers, each of
       its leaves keeps lists of the occluders that look largest from there in 26 directions, and a frame takes its
       occluders from one list instead of searching for them (Coorg and Teller 4; docs/results/planes.md). A
       leaf looks about from one more of its nine points in each frame that a viewer is in it, or from all with
       umb_culler_prepare; it looks again when something large has come near. UMB_METHOD_PLANES: objects that are left are held
       against what may hide them where they stand, too (5, detail objects). May report more or fewer. */
    UMB_COHERENCE_LEAVES = 1u << 6,
    UMB_COHERENCE_ALL = (1u << 7) - 1
} umb_coherence;

typedef struct umb_culler_def {
    umb_method method;
    umb_isa isa;       /* AUTO by default; answers do not depend on it */
    umb_error *error;  /* text of failures; may be NULL; must outlive the culler */
    /* Threads that help with one frame; zeroed: none. A call to umb_cull then makes at most one run, of at most 8
       tasks: the walk, and helpers that find ahead of it the images of large occluders which the last frame drew.
       Frames with too little to hand over make no run. The walk may run on any thread of the job system, and
       waits for a helper some microseconds at most, so threads that are busy elsewhere do no harm. workers (as
       in umb_tasks) is a bound here: with 0 or 1 there is no helper; each helper keeps memory of its own, 6.4 bytes a
       pixel of the raster and room for the largest mesh. Answers, statistics and the buffer are the same to the
       bit with any tasks and without. */
    umb_tasks tasks;
    /* UMB_COHERENCE_... bits. 0: none, an answer depends on the scene and the view alone. With any, and with a
       budget, it depends on the views before, too, and on nothing else: the same frames give the same answers.
       A capture (capture.h) holds such an answer, and its replay begins without a past. */
    uint32_t coherence;
    /* Draw at most so many occluders in a frame, those with the best score: the area of the image of their box,
       times how often their drawing changed anything of late. What score it takes is learned from frame to frame;
       the first frame draws the nearest. 0: no limit. Methods that choose first take so many for each
       frame: UMB_METHOD_PLANES by how large they look, 0: 64, at most 65000; UMB_METHOD_SHADOW_FRUSTA by what they hide of
       objects sampled in view, 0: 64, at most 16384; UMB_METHOD_OCCLUSION_TREE by how large they look where no other
       hides them, 0: 128, at most 512. */
    uint32_t occluder_budget;
    /* Do not put the answer in order: objects come as they are found, the same ones as in order, in an order that
       depends on the scene, the index and the view alone. What lies below a node wholly inside the frustum is then
       copied as one range by UMB_METHOD_NONE, without a look at its boxes (unless the view has min_pixels). A
       replayed capture is in order. */
    bool unordered;
} umb_culler_def;

typedef struct umb_cull_stats {
    uint32_t visible;      /* objects reported */
    uint32_t nodes;        /* nodes opened */
    uint32_t boxes;        /* boxes tested against the frustum */
    uint32_t in_frustum;   /* objects that reached the occlusion test: in the frustum and not below a hidden node */
    uint32_t queries;      /* boxes tested for occlusion (nodes, objects, occluders) */
    uint32_t hidden_nodes; /* nodes found hidden and not opened */
    uint32_t hidden_objects; /* objects found hidden one by one */
    uint32_t occluders;    /* occluders drawn */
    uint32_t edges;        /* silhouette edges drawn */
    uint32_t small;        /* objects dropped by the contribution threshold */
    uint32_t idle;         /* occluders (or objects that might have been) not drawn: it would have changed little or nothing */
    uint32_t early;        /* of the occluders drawn: by UMB_COHERENCE_LIST, before the walk */
    uint32_t saved;        /* boxes not tested for occlusion, thanks to what was remembered */
    uint32_t resting;      /* occluders not drawn by UMB_COHERENCE_REST */
    uint32_t over_budget;  /* occluders not drawn by the budget */
    /* Moving objects (motion.h). */
    uint32_t poses;        /* that were asked for: volumes seen, and volumes that did not hold at the view's time */
    uint32_t expired;      /* of these, the latter */
    uint32_t strays;       /* of the former, objects outside of the volume that was to hold them: a broken promise, or
                              a fuzzy one */
    uint32_t hidden_movers; /* moving objects that nobody had to ask for */
    uint32_t tests;        /* occluders held against a node's boxes, by methods that choose them first */
    uint32_t left_out;     /* objects not reported because the view's mask or the candidates leave them out, of those that
                              were met: subtrees of an index that are left out as a whole are not; where an index holds objects in parts, a part may count for itself */
} umb_cull_stats;

/* The answer. Borrowed: valid until the culler's next call. */
typedef struct umb_visible_set {
    /* Ids, nearest bounds first, ties by id: by least depth along the view's forward, which is levelled where
       the view names a vertical and looks about along the ground. In no such order if the culler is unordered. */
    const uint32_t *objects;
    const uint8_t *inside;   /* beside each id: 1 if its bounds are wholly inside the frustum, else 0 */
    uint32_t count;
    umb_class class_;        /* what this answer promises */
    umb_cull_stats stats;
} umb_visible_set;

/* Make a culler over an index. Several cullers may read one index from several threads at once. */
UMB_API umb_result umb_culler_create(const umb_index *index, const umb_culler_def *def, umb_culler **out);
/* NULL is allowed. */
UMB_API void umb_culler_destroy(umb_culler *culler);

/* Do now, for the scene as committed, what is done once and not in each frame, by this call or by the first frames: facets
 * of occluders, and with UMB_COHERENCE_LEAVES all lists, which takes some milliseconds for each of up to 256 leaves. Errors:
 * UMB_ERROR_STATE as umb_cull; no memory. Nothing is answered differently without UMB_COHERENCE_LEAVES. Threads: as
 * umb_cull. */
UMB_API umb_result umb_culler_prepare(umb_culler *culler);

/* From now on report only candidates: objects whose bit is set, bit i % 32 of word i / 32 for object i; those from object_count
 * on are none. A set that is potentially visible, say, or what a query is about. Copied. bits NULL: all objects, as in the
 * beginning. What is no candidate hides as ever: an answer is that without candidates, less what is none. To ask
 * about a world without some objects give them masks (umb_view.mask). Errors: no memory; nothing has changed then. Cost: a
 * copy here; a look at a bit for each object found in each umb_cull. */
UMB_API umb_result umb_culler_set_candidates(umb_culler *culler, const uint32_t *bits, uint32_t object_count);

/* Answer one view. Allocates only when the scene or the raster has grown since the last call. Safe
 * direction: may report a hidden object visible; never the reverse, provided every object's bounds
 * contain what is drawn for it and every occluder lies inside what is drawn. Threads: one call at a
 * time for each culler. Cost: proportional to what is seen. Errors: an impossible view
 * (umb_view_check), no memory. *out is then empty. Objects that move by themselves (motion.h) are asked for through
 * the scene's callback, if their volumes are seen: it must not call this culler. */
UMB_API umb_result umb_cull(umb_culler *culler, const umb_view *view, umb_visible_set *out);

/* The occlusion buffer after the last umb_cull, as the view sees it: the picture in as many columns and rows as
 * the method's raster has, row by row from the top; at each middle, 1 / depth of a bound that what covers it lies
 * in front of; 0 where not covered. For orthographic views the value is 1 / (1 + depth - near depth). The raster
 * itself stands upright and is dense at the horizon where the view names a vertical, so this is a sampled copy, to
 * look at. Returns false, with the sizes only, when pixels is NULL or capacity (in floats) is too small, or when the
 * method has no buffer (sizes 0). */
UMB_API bool umb_culler_read_buffer(const umb_culler *culler, float *pixels, size_t capacity,
                                    uint32_t *width, uint32_t *height);

/* "raster", "none", "planes", "shadow-frusta", "occlusion-tree"; "strict", "pixel", "approximate". */
UMB_API const char *umb_method_name(umb_method method);
UMB_API const char *umb_class_name(umb_class class_);

#ifdef __cplusplus
}
#endif
#endif
