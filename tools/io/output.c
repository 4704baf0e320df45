#include "output.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#include "model_parts.h"

FILE *output_open(const char *path, umb_error *error)
{
    FILE *f = fopen(path, "wb");
    if (!f) {
        model_fail(error, UMB_ERROR_ARGUMENT,
                   "%.150s: cannot be written (%s); name a folder that exists", path,
                   strerror(errno));
    }
    return f;
}

bool output_close(FILE *f, const char *path, bool good, umb_error *error)
{
    struct stat info;
    bool ordinary = fstat(fileno(f), &info) == 0 && S_ISREG(info.st_mode);
    bool written = !ferror(f);
    written = fclose(f) == 0 && written;
    if (good && !written) {
        model_fail(error, UMB_ERROR_MEMORY, "%.150s: not written (%s); look for space on the disk",
                   path, strerror(errno));
    }
    if ((!good || !written) && ordinary) { /* a device is no half-written file */
        remove(path);
    }
    return good && written;
}
