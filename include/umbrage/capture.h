/* Capture and replay: one frame - scene, settings, view, answer - as one little-endian block
 * (docs/capture-format.md). A bug report is a file. What a culler remembers of earlier frames is not in it: an answer
 * given with coherence switches or an occluder budget (cull.h) need not be the replay's. */
#ifndef UMBRAGE_CAPTURE_H
#define UMBRAGE_CAPTURE_H

#include "cull.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Write the frame that the culler answered last into bytes, if capacity allows; *size is always set
 * to the bytes needed. Pass bytes NULL, capacity 0 to ask. UMB_ERROR_STATE before the first
 * umb_cull, and when the scene was committed since, if that changed anything or something in it moves by itself (motion.h),
 * or other candidates were set; UMB_ERROR_ARGUMENT when bytes is not NULL and capacity is too small (nothing is
 * written). Of objects that move by themselves their volumes are written, and the poses that were asked for; the loaded scene
 * knows no others: what it is asked beyond the captured view is reported as visible. */
UMB_API umb_result umb_capture_save(const umb_culler *culler, void *bytes, size_t capacity, size_t *size);

/* A loaded capture: its scene, index and culler are its own, ready for umb_cull with its view. */
typedef struct umb_capture {
    umb_scene *scene;
    umb_index *index;
    umb_culler *culler;
    umb_view view;
    umb_method method;
    umb_index_def index_def;
    uint32_t *answer; /* ids as they were answered, in order */
    uint32_t answer_count;
    void *block; /* owns answer, and the poses of what moved */
    size_t block_size;
} umb_capture;

/* Read a block. Every offset and count is checked before use; anything wrong is UMB_ERROR_FORMAT or
 * UMB_ERROR_VERSION with text, and *out is zeroed. tasks may be zeroed. isa as for a culler. */
UMB_API umb_result umb_capture_load(const void *bytes, size_t size, umb_isa isa, umb_tasks tasks,
                                    umb_capture *out, umb_error *error);
/* Free everything that a capture owns. */
UMB_API void umb_capture_free(umb_capture *capture);

#ifdef __cplusplus
}
#endif
#endif
