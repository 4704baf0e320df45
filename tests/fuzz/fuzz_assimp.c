/* Any bytes under the names of the importer's formats: the first byte chooses one. The importer
 * may crash; the reader runs it apart and must live on, with one line of text. PLY is left out:
 * on most damaged files the importer finds no end, and each costs the seconds after which its
 * process is stopped. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "io/readers.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const endings[] = {"glb", "gltf", "obj", "stl", "ac", "acc", "ifc"};
    if (size == 0) {
        return 0;
    }
    char path[64];
    (void)snprintf(path, sizeof path, "/tmp/umbrage-fuzz-%ld.%s", (long)getpid(),
                   endings[data[0] % 7]);
    FILE *file = fopen(path, "wb");
    if (file == NULL) {
        return 0;
    }
    (void)fwrite(data + 1, 1, size - 1, file);
    (void)fclose(file);
    const model_options options = {.split = 3};
    umb_error error = {0};
    model *m = read_assimp(path, &options, &error);
    if (m == NULL && (error.code == UMB_OK || strchr(error.text, '\n') != NULL)) {
        abort();
    }
    model_free(m);
    (void)unlink(path);
    return 0;
}
