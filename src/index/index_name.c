#include "index_name.h"

#include <string.h>

typedef struct variant {
    const char *name;
    umb_index_kind kind;
    umb_index_rule rule;
} variant;

/* Each kind's plain name first. */
static const variant variants[] = {
    {"bvh", UMB_INDEX_BVH, UMB_RULE_DEFAULT},
    {"flat", UMB_INDEX_FLAT, UMB_RULE_DEFAULT},
    {"kdtree", UMB_INDEX_KDTREE, UMB_RULE_DEFAULT},
    {"kdtree,median", UMB_INDEX_KDTREE, UMB_RULE_MEDIAN},
    {"octree", UMB_INDEX_OCTREE, UMB_RULE_DEFAULT},
    {"octree,irregular", UMB_INDEX_OCTREE, UMB_RULE_IRREGULAR},
    {"octree,loose", UMB_INDEX_OCTREE, UMB_RULE_LOOSE},
    {"quadtree", UMB_INDEX_QUADTREE, UMB_RULE_DEFAULT},
    {"quadtree,irregular", UMB_INDEX_QUADTREE, UMB_RULE_IRREGULAR},
    {"quadtree,loose", UMB_INDEX_QUADTREE, UMB_RULE_LOOSE},
    {"grid", UMB_INDEX_GRID, UMB_RULE_DEFAULT},
    {"grid,nested", UMB_INDEX_GRID, UMB_RULE_NESTED},
};

#define VARIANTS (sizeof(variants) / sizeof(variants[0]))

static const variant *find(const umb_index_def *def)
{
    for (size_t k = 0; k < VARIANTS; ++k) {
        if (variants[k].kind == def->kind && variants[k].rule == def->rule) {
            return &variants[k];
        }
    }
    return NULL;
}

bool umb_index_name_known(const umb_index_def *def)
{
    return find(def) != NULL;
}

uint32_t umb_index_name_pack(const umb_index_def *def)
{
    return (uint32_t)def->kind | (uint32_t)def->rule << 8;
}

bool umb_index_name_unpack(uint32_t packed, umb_index_def *out)
{
    out->kind = (umb_index_kind)(packed & 0xFF);
    out->rule = (umb_index_rule)(packed >> 8);
    return find(out) != NULL;
}

/* True if the texts hold the same words, in any order behind the first. */
static bool same_words(const char *a, const char *b)
{
    if (strlen(a) != strlen(b) || strncmp(a, b, strcspn(b, ",") + 1) != 0) {
        return false;
    }
    for (const char *word = strchr(b, ','); word != NULL; word = strchr(word + 1, ',')) {
        size_t length = 1 + strcspn(word + 1, ",");
        const char *at = strchr(a, ',');
        while (at != NULL && (strncmp(at, word, length) != 0 || (at[length] != ',' && at[length] != '\0'))) {
            at = strchr(at + 1, ',');
        }
        if (at == NULL) {
            return false;
        }
    }
    return true;
}

bool umb_index_parse(const char *text, umb_index_def *out)
{
    for (size_t k = 0; k < VARIANTS; ++k) {
        if (same_words(text, variants[k].name)) {
            out->kind = variants[k].kind;
            out->rule = variants[k].rule;
            return true;
        }
    }
    return false;
}

const char *umb_index_name(const umb_index_def *def)
{
    const variant *v = find(def);
    return v != NULL ? v->name : "unknown";
}

const char *umb_index_variant(uint32_t k)
{
    return k < VARIANTS ? variants[k].name : NULL;
}

const char *umb_index_kind_name(umb_index_kind kind)
{
    umb_index_def def = {.kind = kind};
    return umb_index_name(&def);
}
