/* The library as it was when it was first whole: its own library, over the same views. scripts/foundation builds
 * it from the history, into a shared object that holds nothing of today's but what is below. */
#ifndef FOUNDATION_H
#define FOUNDATION_H

#include <stdbool.h>
#include <stdint.h>

/* A view in words that both know; view.h says what they mean. */
typedef struct foundation_view {
    double eye[3], right[3], up[3], forward[3];
    double x_min, x_max, y_min, y_max, near_depth, far_depth;
    bool orthographic;
} foundation_view;

/* What the shared object exports, as the symbol `foundation`. */
typedef struct foundation_interface {
    /* A scene as its own reader has it, welded, with a tree and a culler of the default method. NULL: text says why, in
       at most size bytes. */
    void *(*create)(const char *spec, char *text, uint32_t size);
    void (*destroy)(void *self);
    uint32_t (*object_count)(const void *self);
    void (*bounds)(const void *self, uint32_t object, float box[6]); /* least, then greatest */
    /* Ids of what is reported, until the next call. UINT32_MAX: it failed. */
    uint32_t (*frame)(void *self, const foundation_view *view, const uint32_t **objects);
} foundation_interface;

#endif
