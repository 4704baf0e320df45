#include "umbrage/base.h"

#define TEXT_OF(x) #x
#define TEXT(x) TEXT_OF(x)

const char *umb_version(void)
{
    return TEXT(UMB_VERSION_MAJOR) "." TEXT(UMB_VERSION_MINOR) "." TEXT(UMB_VERSION_PATCH);
}

const char *umb_result_name(umb_result result)
{
    switch (result) {
    case UMB_OK:
        return "ok";
    case UMB_ERROR_MEMORY:
        return "out of memory";
    case UMB_ERROR_ARGUMENT:
        return "bad argument";
    case UMB_ERROR_FORMAT:
        return "bad format";
    case UMB_ERROR_VERSION:
        return "unknown version";
    case UMB_ERROR_LIMIT:
        return "limit exceeded";
    case UMB_ERROR_STATE:
        return "wrong state";
    }
    return "unknown result";
}
