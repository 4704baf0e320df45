/* Whatever the importer reads: glTF, OBJ, PLY, STL, AC3D, IFC and more.
 *
 * The importer runs under triangulation alone, so that meshes and nodes are the file's. Objects
 * are its mesh instances in depth-first node order; a mesh that several nodes use stays one
 * mesh. */
#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "import_files.h"
#include "model_parts.h"
#include "read_apart.h"
#include "readers.h"
#include "texture_alpha.h"

/* A node's transform to the world, accumulated in double. */
typedef struct placement {
    double m[3][4];
} placement;

typedef struct assimp_reader {
    const struct aiScene *scene;
    model *into;
    const char *path;
    texture_alphas alphas;
    uint32_t *mesh_of; /* importer's mesh -> model's mesh, MODEL_NONE without triangles, UNREAD */
    bool cards;        /* the format has no word for alpha testing: names of trees tell */
} assimp_reader;

#define UNREAD (UINT32_MAX - 1)

static placement place_child(const placement *parent, const struct aiMatrix4x4 *t)
{
    const double local[3][4] = {
        {t->a1, t->a2, t->a3, t->a4}, {t->b1, t->b2, t->b3, t->b4}, {t->c1, t->c2, t->c3, t->c4}};
    placement p;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 4; ++j) {
            p.m[i][j] = parent->m[i][0] * local[0][j] + parent->m[i][1] * local[1][j] +
                        parent->m[i][2] * local[2][j] + (j == 3 ? parent->m[i][3] : 0.0);
        }
    }
    return p;
}

static float material_number(const struct aiMaterial *material, const char *key, float otherwise)
{
    float value = otherwise;
    unsigned count = 1;
    if (aiGetMaterialFloatArray(material, key, 0, 0, &value, &count) != aiReturn_SUCCESS ||
        count != 1) {
        return otherwise;
    }
    return value;
}

/* Whether the picture on a surface is cut out: it has pixels that are not opaque or, for trees
 * of AC3D scenes, a name that tells. */
static bool has_cut_out_texture(assimp_reader *r, const struct aiMaterial *material)
{
    struct aiString texture;
    if (aiGetMaterialTexture(material, aiTextureType_DIFFUSE, 0, &texture, NULL, NULL, NULL, NULL,
                             NULL, NULL) != aiReturn_SUCCESS) {
        return false;
    }
    const char *slash = strrchr(texture.data, '/');
    return (r->cards && strncasecmp(slash != NULL ? slash + 1 : texture.data, "tree", 4) == 0) ||
           texture_has_alpha(&r->alphas, r->path, texture.data);
}

/* What the material says about hiding. glTF says it plainly; elsewhere an opacity below one, a
 * map of opacity, or a picture with holes means that one may see through. Nothing said means
 * opaque and one-sided. */
static uint8_t material_flags(assimp_reader *r, const struct aiMaterial *material)
{
    uint8_t flags = 0;
    struct aiString mode;
    bool gltf = aiGetMaterialString(material, "$mat.gltf.alphaMode", 0, 0, &mode) ==
                aiReturn_SUCCESS;
    if (gltf && strcmp(mode.data, "OPAQUE") != 0) {
        flags |= UMB_TRIANGLE_OPEN;
    }
    if (!gltf && (!(material_number(material, "$mat.opacity", 1.0f) >= 1.0f) ||
                  aiGetMaterialTextureCount(material, aiTextureType_OPACITY) != 0 ||
                  has_cut_out_texture(r, material))) {
        flags |= UMB_TRIANGLE_OPEN;
    }
    if (material_number(material, "$mat.transmission.factor", 0.0f) > 0.0f) {
        flags |= UMB_TRIANGLE_OPEN;
    }
    int two_sided = 0;
    unsigned count = 1;
    if (aiGetMaterialIntegerArray(material, "$mat.twosided", 0, 0, &two_sided, &count) ==
            aiReturn_SUCCESS &&
        two_sided != 0) {
        flags |= UMB_TRIANGLE_TWO_SIDED;
    }
    return flags;
}

/* Copy the triangles of a mesh; points and lines are no surface. False: no memory. */
static bool read_mesh(assimp_reader *r, unsigned number, bool open)
{
    const struct aiMesh *from = r->scene->mMeshes[number];
    const struct aiMaterial *material = from->mMaterialIndex < r->scene->mNumMaterials
                                            ? r->scene->mMaterials[from->mMaterialIndex]
                                            : NULL;
    uint8_t flags = material != NULL ? material_flags(r, material) : 0;
    flags |= open ? UMB_TRIANGLE_OPEN : 0;
    size_t faces = from->mVertices != NULL ? from->mNumFaces : 0;
    model_mesh mesh = {
        .positions = (float *)(void *)from->mVertices,
        .indices = malloc((3 * faces + 1) * sizeof(uint32_t)),
        .flags = malloc(faces + 1),
        .position_count = from->mNumVertices,
    };
    bool added = mesh.indices != NULL && mesh.flags != NULL;
    for (size_t f = 0; f < faces && added; ++f) {
        const struct aiFace *face = &from->mFaces[f];
        if (face->mNumIndices == 3) {
            memcpy(mesh.indices + 3 * (size_t)mesh.triangle_count, face->mIndices,
                   3 * sizeof(uint32_t));
            mesh.flags[mesh.triangle_count++] = flags;
        }
    }
    r->mesh_of[number] = MODEL_NONE;
    if (added && mesh.triangle_count != 0) {
        r->mesh_of[number] = model_add_mesh(r->into, &mesh);
        added = r->mesh_of[number] != MODEL_NONE;
    }
    free(mesh.indices);
    free(mesh.flags);
    return added;
}

/* The objects of a node, then those of its children. False: no memory. */
static bool read_node(assimp_reader *r, const struct aiNode *node, const placement *parent)
{
    placement world = place_child(parent, &node->mTransformation);
    umb_transform transform;
    for (int i = 0; i < 12; ++i) {
        transform.m[i / 4][i % 4] = (float)world.m[i / 4][i % 4];
    }
    for (unsigned i = 0; i < node->mNumMeshes; ++i) {
        unsigned number = node->mMeshes[i];
        if (number >= r->scene->mNumMeshes) {
            continue;
        }
        bool tree = r->cards && strncmp(node->mName.data, "TREE", 4) == 0;
        if (r->mesh_of[number] == UNREAD && !read_mesh(r, number, tree)) {
            return false;
        }
        const char *name = node->mName.length != 0 ? node->mName.data
                                                   : r->scene->mMeshes[number]->mName.data;
        if (model_add_object(r->into, name, r->mesh_of[number], &transform) == MODEL_NONE) {
            return false;
        }
    }
    for (unsigned i = 0; i < node->mNumChildren; ++i) {
        if (!read_node(r, node->mChildren[i], &world)) {
            return false;
        }
    }
    return true;
}

static bool read_scene(assimp_reader *r)
{
    static const placement identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    r->mesh_of = malloc(((size_t)r->scene->mNumMeshes + 1) * sizeof *r->mesh_of);
    if (r->mesh_of == NULL) {
        return false;
    }
    for (unsigned i = 0; i < r->scene->mNumMeshes; ++i) {
        r->mesh_of[i] = UNREAD;
    }
    bool read = r->scene->mRootNode == NULL || read_node(r, r->scene->mRootNode, &identity);
    free(r->mesh_of);
    texture_alphas_free(&r->alphas);
    return read;
}

/* A model not finished yet: runs in a child. */
static model *import(const char *path, umb_error *error)
{
    double origin[3] = {0};
    import_files files;
    if (!import_files_open(&files, path, origin, error)) {
        return NULL;
    }
    assimp_reader r = {.scene = aiImportFileEx(path, aiProcess_Triangulate, &files.io),
                       .into = model_create(),
                       .path = path};
    import_files_close(&files);
    r.cards = input_ends_with(path, ".ac") || input_ends_with(path, ".acc");
    bool read = false;
    if (r.scene == NULL) {
        const char *said = aiGetErrorString();
        size_t length = strcspn(said, "\n");
        length -= length != 0 && said[length - 1] == '.';
        model_fail(error, UMB_ERROR_FORMAT, "%s: the importer says: %.*s; convert the scene to glTF",
                   path, length < 120 ? (int)length : 120, said);
    } else if (r.into == NULL || !read_scene(&r)) {
        model_fail_memory(error, path);
    } else if (r.into->object_count == 0) {
        model_fail(error, UMB_ERROR_FORMAT, "%s: no meshes; name a scene with surfaces", path);
    } else {
        memcpy(r.into->origin, origin, sizeof origin);
        read = true;
    }
    if (r.scene != NULL) {
        aiReleaseImport(r.scene);
    }
    if (!read) {
        model_free(r.into);
        return NULL;
    }
    return r.into;
}

model *read_assimp(const char *path, const model_options *options, umb_error *error)
{
    model *m = read_apart(import, path, error);
    if (m != NULL && !model_finish(m, options, error)) {
        model_free(m);
        return NULL;
    }
    return m;
}
