#include "input.h"

#include <errno.h>
#include <minizip/unzip.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "model_parts.h"

/* No scene is larger; an archive's directory may claim anything. */
#define INPUT_LIMIT ((uint64_t)1 << 32)

void input_free(input *in)
{
    free(in->data);
    in->data = NULL;
    in->size = 0;
}

static bool read_all(FILE *file, const char *path, input *out, umb_error *error)
{
    struct stat status;
    if (fstat(fileno(file), &status) != 0 || !S_ISREG(status.st_mode)) {
        return model_fail(error, UMB_ERROR_FORMAT, "%s: not a file; name a scene file", path);
    }
    if (status.st_size <= 0) {
        return model_fail(error, UMB_ERROR_FORMAT, "%s: empty; name a scene file", path);
    }
    if ((uint64_t)status.st_size > INPUT_LIMIT) {
        return model_fail(error, UMB_ERROR_LIMIT, "%s: larger than 4 GiB; cut the scene", path);
    }
    out->size = (size_t)status.st_size;
    out->data = calloc(out->size + 1, 1);
    if (out->data == NULL) {
        return model_fail_memory(error, path);
    }
    if (fread(out->data, 1, out->size, file) != out->size) {
        input_free(out);
        return model_fail(error, UMB_ERROR_FORMAT,
                          "%s: cannot be read to its end; is it being written?", path);
    }
    return true;
}

bool input_read(const char *path, input *out, umb_error *error)
{
    memset(out, 0, sizeof *out);
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return model_fail(error, UMB_ERROR_FORMAT, "%s: %s; check the name", path, strerror(errno));
    }
    bool read = read_all(file, path, out, error);
    fclose(file);
    return read;
}

bool input_ends_with(const char *name, const char *ending)
{
    size_t length = strlen(name);
    size_t tail = strlen(ending);
    return length >= tail && strcasecmp(name + length - tail, ending) == 0;
}

const char *input_packed_name(const char *name)
{
    for (const char *c = name; (c = strchr(c, ':')) != NULL; ++c) {
        size_t before = (size_t)(c - name);
        if (before >= 4 &&
            (strncasecmp(c - 4, ".pk3", 4) == 0 || strncasecmp(c - 4, ".zip", 4) == 0)) {
            return c;
        }
    }
    return NULL;
}

/* Look for the maps of an archive. Leaves the archive at the last one; names goes into error
 * texts. */
static int find_maps(unzFile zip, char *names, size_t size, unz_file_pos *place)
{
    int maps = 0;
    size_t used = 0;
    names[0] = '\0';
    for (int step = unzGoToFirstFile(zip); step == UNZ_OK; step = unzGoToNextFile(zip)) {
        char name[256];
        unz_file_info info; /* some versions of minizip write it whether asked to or not */
        if (unzGetCurrentFileInfo(zip, &info, name, sizeof name, NULL, 0, NULL, 0) != UNZ_OK) {
            break;
        }
        name[sizeof name - 1] = '\0';
        if (!input_ends_with(name, ".bsp")) {
            continue;
        }
        ++maps;
        unzGetFilePos(zip, place);
        if (used + strlen(name) + 2 < size) {
            used += (size_t)snprintf(names + used, size - used, "%s%s", used != 0 ? " " : "", name);
        }
    }
    return maps;
}

static bool read_member(unzFile zip, const char *archive, input *out, umb_error *error)
{
    unz_file_info info;
    if (unzGetCurrentFileInfo(zip, &info, NULL, 0, NULL, 0, NULL, 0) != UNZ_OK ||
        unzOpenCurrentFile(zip) != UNZ_OK) {
        return model_fail(error, UMB_ERROR_FORMAT, "%s: the archive is damaged; copy it again",
                          archive);
    }
    /* Deflate packs at most 1032 to 1: a size that no such stream can give is a lie. */
    bool honest = info.uncompressed_size != 0 &&
                  (uint64_t)info.uncompressed_size <= 1032 * (uint64_t)info.compressed_size + 64;
    bool read = false;
    if (honest) {
        out->size = info.uncompressed_size;
        out->data = calloc(out->size + 1, 1);
        read = out->data != NULL;
        for (size_t done = 0; read && done < out->size;) {
            size_t left = out->size - done;
            int got = unzReadCurrentFile(zip, out->data + done,
                                         left < 1 << 20 ? (unsigned)left : 1 << 20);
            read = got > 0;
            done += read ? (size_t)got : 0;
        }
    }
    read = unzCloseCurrentFile(zip) == UNZ_OK && read; /* checks the member's CRC */
    if (!read) {
        input_free(out);
        return model_fail(error, UMB_ERROR_FORMAT,
                          "%s: a file in the archive is empty or damaged; copy it again", archive);
    }
    return true;
}

bool input_read_packed(const char *archive, const char *member, input *out, umb_error *error)
{
    memset(out, 0, sizeof *out);
    unzFile zip = unzOpen(archive);
    if (zip == NULL) {
        return model_fail(error, UMB_ERROR_FORMAT,
                          "%s: no such file or not a .pk3 archive; check the name", archive);
    }
    char names[160];
    unz_file_pos place;
    int maps = find_maps(zip, names, sizeof names, &place);
    bool found;
    if (member != NULL) {
        found = unzLocateFile(zip, member, 2) == UNZ_OK;
        if (!found) {
            model_fail(error, UMB_ERROR_FORMAT, "%s: no %s in it; it holds: %s", archive, member,
                       maps != 0 ? names : "no map");
        }
    } else {
        found = maps == 1 && unzGoToFilePos(zip, &place) == UNZ_OK;
        if (!found) {
            model_fail(error, UMB_ERROR_FORMAT,
                       "%s: holds %d maps; name one as %s:maps/NAME.bsp: %s", archive, maps,
                       archive, names);
        }
    }
    found = found && read_member(zip, archive, out, error);
    unzClose(zip);
    return found;
}
