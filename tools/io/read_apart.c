#include "read_apart.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "model_parts.h"

/* What goes through the pipe: a header, then each mesh, then each object. Both ends are one
 * program, so structs go as they are. */
typedef struct header {
    uint32_t read; /* 0: error only */
    uint32_t mesh_count, object_count;
    double origin[3], up[3];
    umb_error error;
} header;

typedef struct mesh_header {
    uint32_t position_count, triangle_count;
} mesh_header;

typedef struct object_header {
    umb_transform transform;
    uint32_t mesh, name_size;
} object_header;

static bool write_some(FILE *to, const void *data, size_t size)
{
    return size == 0 || fwrite(data, 1, size, to) == size;
}

static bool write_meshes(FILE *to, const model *m)
{
    bool written = true;
    for (uint32_t i = 0; i < m->mesh_count && written; ++i) {
        const model_mesh *mesh = &m->meshes[i];
        mesh_header head = {mesh->position_count, mesh->triangle_count};
        written = write_some(to, &head, sizeof head) &&
                  write_some(to, mesh->positions, 3 * sizeof(float) * mesh->position_count) &&
                  write_some(to, mesh->indices, 3 * sizeof(uint32_t) * mesh->triangle_count) &&
                  write_some(to, mesh->flags, mesh->triangle_count);
    }
    return written;
}

static bool write_model(FILE *to, const model *m, const umb_error *error)
{
    header head;
    memset(&head, 0, sizeof head);
    head.error = *error;
    if (m != NULL) {
        head.read = 1;
        head.mesh_count = m->mesh_count;
        head.object_count = m->object_count;
        memcpy(head.origin, m->origin, sizeof head.origin);
        memcpy(head.up, m->up, sizeof head.up);
    }
    bool written = write_some(to, &head, sizeof head) && (m == NULL || write_meshes(to, m));
    for (uint32_t i = 0; m != NULL && i < m->object_count && written; ++i) {
        const model_object *o = &m->objects[i];
        object_header object = {o->transform, o->mesh, (uint32_t)strlen(o->name)};
        written = write_some(to, &object, sizeof object) &&
                  write_some(to, o->name, object.name_size);
    }
    return written && fflush(to) == 0;
}

/* Bytes of address space in use. Sanitizers reserve terabytes, so a limit must count from here. */
static rlim_t address_space(void)
{
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file != NULL) {
        if (fscanf(file, "%lu", &pages) != 1) {
            pages = 0;
        }
        fclose(file);
    }
    return (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE);
}

/* Damaged files can also make the importer run for ever or ask for all memory. What it gets is
 * far more than honest files of that size take. */
static void limit_child(const char *path)
{
    struct stat status;
    rlim_t size = stat(path, &status) == 0 && status.st_size > 0 ? (rlim_t)status.st_size : 0;
    struct rlimit core = {0, 0};
    struct rlimit seconds = {3 + size / 50000, 3 + size / 50000};
    struct rlimit memory = {address_space(), RLIM_INFINITY};
    setrlimit(RLIMIT_CORE, &core);
    setrlimit(RLIMIT_CPU, &seconds);
    if (memory.rlim_cur != 0) {
        memory.rlim_cur += ((rlim_t)2 << 30) + 256 * size;
        setrlimit(RLIMIT_AS, &memory);
    }
}

/* The child: silent, limited, and never returns into the parent's clean-up. */
static void be_child(int pipe_end, read_function *read, const char *path)
{
    limit_child(path);
    int quiet = open("/dev/null", O_WRONLY);
    if (quiet >= 0) {
        dup2(quiet, STDOUT_FILENO);
        dup2(quiet, STDERR_FILENO);
    }
    umb_error error;
    memset(&error, 0, sizeof error);
    FILE *to = fdopen(pipe_end, "wb");
    model *m = read(path, &error);
    _exit(to != NULL && write_model(to, m, &error) ? 0 : 1);
}

/* size bytes in a block of their own; NULL when they do not come. One byte more, a zero. */
static void *read_block(FILE *from, size_t count, size_t size)
{
    char *block = calloc(count * size + 1, 1);
    if (block != NULL && count != 0 && fread(block, size, count, from) != count) {
        free(block);
        return NULL;
    }
    return block;
}

static bool read_mesh(FILE *from, model *m)
{
    mesh_header head;
    if (fread(&head, sizeof head, 1, from) != 1) {
        return false;
    }
    model_mesh mesh = {
        .positions = read_block(from, head.position_count, 3 * sizeof(float)),
        .indices = read_block(from, head.triangle_count, 3 * sizeof(uint32_t)),
        .flags = read_block(from, head.triangle_count, 1),
        .position_count = head.position_count,
        .triangle_count = head.triangle_count,
    };
    bool added = mesh.positions != NULL && mesh.indices != NULL && mesh.flags != NULL &&
                 model_add_mesh(m, &mesh) != MODEL_NONE;
    free(mesh.positions);
    free(mesh.indices);
    free(mesh.flags);
    return added;
}

static bool read_object(FILE *from, model *m)
{
    object_header head;
    if (fread(&head, sizeof head, 1, from) != 1) {
        return false;
    }
    char *name = read_block(from, head.name_size, 1);
    bool added = name != NULL && model_add_object(m, name, head.mesh, &head.transform) != MODEL_NONE;
    free(name);
    return added;
}

static model *read_model(FILE *from, umb_error *error)
{
    header head;
    if (fread(&head, sizeof head, 1, from) != 1) {
        return NULL;
    }
    if (head.read == 0) {
        head.error.text[sizeof head.error.text - 1] = '\0';
        model_fail(error, head.error.code, "%s", head.error.text);
        return NULL;
    }
    model *m = model_create();
    bool read = m != NULL;
    for (uint32_t i = 0; i < head.mesh_count && read; ++i) {
        read = read_mesh(from, m);
    }
    for (uint32_t i = 0; i < head.object_count && read; ++i) {
        read = read_object(from, m);
    }
    if (!read) {
        model_free(m);
        return NULL;
    }
    memcpy(m->origin, head.origin, sizeof m->origin);
    memcpy(m->up, head.up, sizeof m->up);
    return m;
}

model *read_apart(read_function *read, const char *path, umb_error *error)
{
    int ends[2];
    if (pipe(ends) != 0) {
        return read(path, error);
    }
    pid_t child = fork();
    if (child == 0) {
        close(ends[0]);
        be_child(ends[1], read, path);
    }
    close(ends[1]);
    FILE *from = child > 0 ? fdopen(ends[0], "rb") : NULL;
    if (child < 0) {
        close(ends[0]);
        return read(path, error);
    }
    umb_error told;
    model_fail(&told, UMB_ERROR_FORMAT,
               "%s: the importer crashed or found no end; the file is damaged, export it again",
               path);
    model *m = from != NULL ? read_model(from, &told) : NULL;
    if (m == NULL && error != NULL) {
        *error = told;
    }
    if (from != NULL) {
        fclose(from);
    } else {
        close(ends[0]);
    }
    while (waitpid(child, NULL, 0) < 0 && errno == EINTR) {
    }
    return m;
}
