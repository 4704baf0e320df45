/* Whether a texture lets one see through: leaves, fences and nets are cut out of their pictures. */
#ifndef TEXTURE_ALPHA_H
#define TEXTURE_ALPHA_H

#include <stdbool.h>
#include <stdint.h>

/* Answers given before; scenes name the same picture again and again. Starts zeroed. */
typedef struct texture_alphas {
    struct texture_answer *answers;
    uint32_t count;
} texture_alphas;

/* True if the picture that a scene file names has a pixel that is not opaque; where only the
 * header is read (TGA, SGI, DDS), if it has room for such pixels. False if it is not there or of
 * another kind. */
bool texture_has_alpha(texture_alphas *known, const char *scene, const char *texture);

void texture_alphas_free(texture_alphas *known);

#endif
