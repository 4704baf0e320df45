/* Captured frames. The size and the checksum are put right first, or nothing would be read. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/checksum.h"
#include "cull/capture_format.h"
#include "umbrage/umbrage.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void sign(uint8_t *bytes, size_t size)
{
    uint64_t sum = umb_checksum(bytes + UMB_CAPTURE_TABLE, size - UMB_CAPTURE_TABLE);
    for (int i = 0; i < 8; ++i) {
        bytes[16 + i] = (uint8_t)((uint64_t)size >> (8 * i));
        bytes[24 + i] = (uint8_t)(sum >> (8 * i));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t *bytes = malloc(size + 1);
    if (bytes == NULL) {
        return 0;
    }
    memcpy(bytes, data, size);
    if (size >= UMB_CAPTURE_HEADER) {
        sign(bytes, size);
    }
    umb_capture c;
    umb_tasks none = {0};
    umb_error error;
    if (umb_capture_load(bytes, size, UMB_ISA_AUTO, none, &c, &error) == UMB_OK) {
        umb_visible_set seen;
        if (c.view.buffer_width <= 1024 && c.view.buffer_height <= 1024 &&
            umb_cull(c.culler, &c.view, &seen) == UMB_OK) {
            size_t again;
            if (umb_capture_save(c.culler, NULL, 0, &again) != UMB_OK || again == 0) {
                abort();
            }
        }
        umb_capture_free(&c);
    }
    free(bytes);
    return 0;
}
