#include "index_name.h"

#include <string.h>

typedef struct variant {
    const char *name;
    umb_index_kind kind;
    umb_index_rule rule;
    uint32_t options;
} variant;

/* Each kind's plain name first. */
static const variant variants[] = {
    {"bvh", UMB_INDEX_BVH, UMB_RULE_DEFAULT, 0},
    {"bvh,bottom-up", UMB_INDEX_BVH, UMB_RULE_BOTTOM_UP, 0},
    {"bvh,spheres", UMB_INDEX_BVH, UMB_RULE_DEFAULT, UMB_INDEX_SPHERES},
    {"bvh,oriented", UMB_INDEX_BVH, UMB_RULE_DEFAULT, UMB_INDEX_ORIENTED},
    {"bvh,bottom-up,spheres", UMB_INDEX_BVH, UMB_RULE_BOTTOM_UP, UMB_INDEX_SPHERES},
    {"bvh,bottom-up,oriented", UMB_INDEX_BVH, UMB_RULE_BOTTOM_UP, UMB_INDEX_ORIENTED},
    {"flat", UMB_INDEX_FLAT, UMB_RULE_DEFAULT, 0},
    {"kdtree", UMB_INDEX_KDTREE, UMB_RULE_DEFAULT, 0},
    {"kdtree,median", UMB_INDEX_KDTREE, UMB_RULE_MEDIAN, 0},
    {"kdtree,bittner", UMB_INDEX_KDTREE, UMB_RULE_BITTNER, 0},
    {"kdtree,aila", UMB_INDEX_KDTREE, UMB_RULE_AILA, 0},
    {"octree", UMB_INDEX_OCTREE, UMB_RULE_DEFAULT, 0},
    {"octree,irregular", UMB_INDEX_OCTREE, UMB_RULE_IRREGULAR, 0},
    {"octree,loose", UMB_INDEX_OCTREE, UMB_RULE_LOOSE, 0},
    {"quadtree", UMB_INDEX_QUADTREE, UMB_RULE_DEFAULT, 0},
    {"quadtree,irregular", UMB_INDEX_QUADTREE, UMB_RULE_IRREGULAR, 0},
    {"quadtree,loose", UMB_INDEX_QUADTREE, UMB_RULE_LOOSE, 0},
    {"bsp", UMB_INDEX_BSP, UMB_RULE_DEFAULT, 0},
    {"bsp,nodes", UMB_INDEX_BSP, UMB_RULE_DEFAULT, UMB_INDEX_NODES},
    {"bsp,split", UMB_INDEX_BSP, UMB_RULE_DEFAULT, UMB_INDEX_SPLIT},
    {"bsp,split,nodes", UMB_INDEX_BSP, UMB_RULE_DEFAULT, UMB_INDEX_SPLIT | UMB_INDEX_NODES},
    {"bsp,naylor", UMB_INDEX_BSP, UMB_RULE_NAYLOR, 0},
    {"bsp,naylor,nodes", UMB_INDEX_BSP, UMB_RULE_NAYLOR, UMB_INDEX_NODES},
    {"bsp,naylor,split", UMB_INDEX_BSP, UMB_RULE_NAYLOR, UMB_INDEX_SPLIT},
    {"bsp,naylor,split,nodes", UMB_INDEX_BSP, UMB_RULE_NAYLOR, UMB_INDEX_SPLIT | UMB_INDEX_NODES},
    {"grid", UMB_INDEX_GRID, UMB_RULE_DEFAULT, 0},
    {"grid,nested", UMB_INDEX_GRID, UMB_RULE_NESTED, 0},
};

#define VARIANTS (sizeof(variants) / sizeof(variants[0]))

static const variant *find(const umb_index_def *def)
{
    for (size_t k = 0; k < VARIANTS; ++k) {
        if (variants[k].kind == def->kind && variants[k].rule == def->rule &&
            variants[k].options == def->options) {
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
    return (uint32_t)def->kind | (uint32_t)def->rule << 8 | def->options << 16;
}

bool umb_index_name_unpack(uint32_t packed, umb_index_def *out)
{
    out->kind = (umb_index_kind)(packed & 0xFF);
    out->rule = (umb_index_rule)(packed >> 8 & 0xFF);
    out->options = packed >> 16;
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
            out->options = variants[k].options;
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

/* ---- ways to follow ------------------------------------------------------------------------- */

static const char *const updates[] = {
    [UMB_UPDATE_DEFAULT] = "default", [UMB_UPDATE_REFIT] = "refit", [UMB_UPDATE_DELETE_INSERT] = "delete-insert",
    [UMB_UPDATE_LCA] = "lca",         [UMB_UPDATE_LAZY] = "lazy",   [UMB_UPDATE_DEEPEST] = "deepest",
    [UMB_UPDATE_INCREMENTAL] = "incremental", [UMB_UPDATE_OVERLAPPING] = "overlapping",
};

#define UPDATES (sizeof(updates) / sizeof(updates[0]))

const char *umb_index_update_name(umb_index_update update)
{
    return (size_t)update < UPDATES ? updates[update] : NULL;
}

bool umb_index_update_parse(const char *text, umb_index_update *out)
{
    for (size_t k = 0; k < UPDATES; ++k) {
        if (strcmp(text, updates[k]) == 0) {
            *out = (umb_index_update)k;
            return true;
        }
    }
    return false;
}

bool umb_index_can_update(const umb_index_def *def)
{
    bool plain = def->update == UMB_UPDATE_DEFAULT || def->update == UMB_UPDATE_REFIT;
    if (def->update == UMB_UPDATE_OVERLAPPING) {
        return def->kind == UMB_INDEX_GRID && def->rule == UMB_RULE_DEFAULT;
    }
    return plain || (def->kind != UMB_INDEX_FLAT && umb_index_update_name(def->update) != NULL);
}
