/* The layout of a captured frame, shared by writer and reader; docs/capture-format.md is its
 * description. */
#ifndef UMB_CAPTURE_FORMAT_H
#define UMB_CAPTURE_FORMAT_H

#include <stdint.h>

#define UMB_CAPTURE_MAGIC "UMBCAP\r\n" /* a transfer as text destroys the line end */
#define UMB_CAPTURE_VERSION 4u

/* Sections in the order of the file and the bytes of a record of each. */
#define UMB_CAPTURE_SECTIONS(X) \
    X(FRAME, 576)               \
    X(MESHES, 8)                \
    X(POSITIONS, 12)            \
    X(TRIANGLES, 12)            \
    X(FLAGS, 1)                 \
    X(OBJECTS, 84)              \
    X(OCCLUDERS, 56)            \
    X(NODES, 32)                \
    X(BOXES, 192)               \
    X(CANDIDATES, 4)            \
    X(MOVERS, 8)                \
    X(EXPIRIES, 12)             \
    X(EXACT, 4)                 \
    X(POSES, 76)                \
    X(ANSWER, 4)

enum {
#define UMB_CAPTURE_NAME(name, bytes) UMB_CAPTURE_##name,
    UMB_CAPTURE_SECTIONS(UMB_CAPTURE_NAME)
#undef UMB_CAPTURE_NAME
        UMB_CAPTURE_SECTION_COUNT
};

#define UMB_CAPTURE_TABLE 32u /* where the section table starts; the checksum covers all from here on */
#define UMB_CAPTURE_HEADER (UMB_CAPTURE_TABLE + 16u * UMB_CAPTURE_SECTION_COUNT)

/* Marks of an object. */
enum {
    UMB_CAPTURE_USED = 1u << 0,
    UMB_CAPTURE_LIVE = 1u << 1,
    UMB_CAPTURE_IS_SHAPE = 1u << 2,
    UMB_CAPTURE_HIDES = 1u << 3,
    UMB_CAPTURE_MARKS = (1u << 4) - 1
};

/* Marks of a view. */
enum {
    UMB_CAPTURE_MASK_ALL = 1u << 0,
    UMB_CAPTURE_MASKED_HIDE = 1u << 1,
    UMB_CAPTURE_VIEW_MARKS = (1u << 2) - 1
};

/* Marks of a mover. */
enum {
    UMB_CAPTURE_EXACT_MOVER = 1u << 0,
    UMB_CAPTURE_FUZZY = 1u << 1,
    UMB_CAPTURE_MOVER_MARKS = (1u << 2) - 1
};

static inline uint32_t umb_capture_record_bytes(int section)
{
    static const uint32_t bytes[UMB_CAPTURE_SECTION_COUNT] = {
#define UMB_CAPTURE_BYTES(name, size) size,
        UMB_CAPTURE_SECTIONS(UMB_CAPTURE_BYTES)
#undef UMB_CAPTURE_BYTES
    };
    return bytes[section];
}

/* Sections start at multiples of eight. */
static inline uint64_t umb_capture_align(uint64_t offset)
{
    return (offset + 7) & ~(uint64_t)7;
}

#endif
