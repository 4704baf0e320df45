/* Any bytes as a Quake 3 map: a model or one line of text, never a crash. */
#include <stdint.h>
#include <stdlib.h>

#include "io/readers.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    /* Options change what is kept and cut: both ways are walked. */
    const model_options options[2] = {{.sky = true, .split = 3}, {.two_sided = true}};
    umb_error error;
    for (int i = 0; i < 2; ++i) {
        model_free(read_q3bsp(data, size, "input", &options[i], &error));
    }
    return 0;
}
