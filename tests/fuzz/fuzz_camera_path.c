/* Any bytes as a camera path: rows of finite numbers or one line of text, never a crash. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "io/readers.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char *text = calloc(size + 1, 1); /* inputs have a zero behind them */
    camera_path path;
    umb_error error;
    if (text == NULL) {
        return 0;
    }
    memcpy(text, data, size);
    if (read_camera_path(text, size, "input", &path, &error)) {
        for (uint32_t i = 0; i < 6 * path.count; ++i) {
            if (!isfinite(path.rows[i / 6][i % 6])) {
                abort();
            }
        }
        camera_path_free(&path);
    }
    free(text);
    return 0;
}
