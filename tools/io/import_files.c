#include "import_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model_parts.h"
#include "obj_offset.h"

/* One open file: on the disk, or a place in the scene's text. */
typedef struct open_file {
    struct aiFile callbacks;
    FILE *disk;
    const input *memory;
    size_t at;
} open_file;

static open_file *opened(struct aiFile *file)
{
    return (open_file *)(void *)file->UserData;
}

static size_t file_read(struct aiFile *file, char *to, size_t size, size_t count)
{
    open_file *f = opened(file);
    if (f->disk != NULL) {
        return fread(to, size, count, f->disk);
    }
    size_t left = size != 0 ? (f->memory->size - f->at) / size : 0;
    count = count < left ? count : left;
    memcpy(to, f->memory->data + f->at, size * count);
    f->at += size * count;
    return count;
}

static size_t file_write(struct aiFile *file, const char *from, size_t size, size_t count)
{
    (void)file;
    (void)from;
    (void)size;
    (void)count;
    return 0;
}

static size_t file_tell(struct aiFile *file)
{
    open_file *f = opened(file);
    long at = f->disk != NULL ? ftell(f->disk) : 0;
    return f->disk == NULL ? f->at : at > 0 ? (size_t)at : 0;
}

static size_t file_size(struct aiFile *file)
{
    open_file *f = opened(file);
    if (f->disk == NULL) {
        return f->memory->size;
    }
    long at = ftell(f->disk);
    fseek(f->disk, 0, SEEK_END);
    long size = ftell(f->disk);
    fseek(f->disk, at, SEEK_SET);
    return size > 0 ? (size_t)size : 0;
}

static aiReturn file_seek(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
    open_file *f = opened(file);
    if (f->disk != NULL) {
        int whence = origin == aiOrigin_CUR   ? SEEK_CUR
                     : origin == aiOrigin_END ? SEEK_END
                                              : SEEK_SET;
        return fseek(f->disk, (long)offset, whence) == 0 ? aiReturn_SUCCESS : aiReturn_FAILURE;
    }
    /* Offsets are signed numbers in disguise; the sum wraps as it should. */
    size_t base = origin == aiOrigin_CUR ? f->at : origin == aiOrigin_END ? f->memory->size : 0;
    if (base + offset > f->memory->size) {
        return aiReturn_FAILURE;
    }
    f->at = base + offset;
    return aiReturn_SUCCESS;
}

static void file_flush(struct aiFile *file)
{
    (void)file;
}

static void file_close(struct aiFileIO *io, struct aiFile *file)
{
    (void)io;
    open_file *f = opened(file);
    if (f->disk != NULL) {
        fclose(f->disk);
    }
    free(f);
}

static struct aiFile *file_open(struct aiFileIO *io, const char *path, const char *mode)
{
    const import_files *files = (const import_files *)(void *)io->UserData;
    open_file *f = calloc(1, sizeof *f);
    if (f == NULL) {
        return NULL;
    }
    if (files->scene.data != NULL && strcmp(path, files->path) == 0) {
        f->memory = &files->scene;
    } else {
        f->disk = fopen(path, mode);
        if (f->disk == NULL) {
            free(f);
            return NULL;
        }
    }
    struct aiFile callbacks = {.ReadProc = file_read,
                               .WriteProc = file_write,
                               .TellProc = file_tell,
                               .FileSizeProc = file_size,
                               .SeekProc = file_seek,
                               .FlushProc = file_flush,
                               .UserData = (char *)f};
    f->callbacks = callbacks;
    return &f->callbacks;
}

bool import_files_open(import_files *files, const char *path, double origin[3], umb_error *error)
{
    memset(files, 0, sizeof *files);
    files->path = path;
    files->io.OpenProc = file_open;
    files->io.CloseProc = file_close;
    files->io.UserData = (char *)files;
    if (!input_read(path, &files->scene, error)) {
        return false;
    }
    memset(origin, 0, 3 * sizeof *origin);
    if (input_ends_with(path, ".obj")) {
        obj_offset(&files->scene, origin);
    }
    return true;
}

void import_files_close(import_files *files)
{
    input_free(&files->scene);
}
