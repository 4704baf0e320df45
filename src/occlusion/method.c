#include "method.h"

#include "planes.h"

const umb_method_ops *umb_method_get(umb_method method)
{
    switch (method) {
    case UMB_METHOD_RASTER:
        return &umb_raster_method;
    case UMB_METHOD_PLANES:
        return &umb_planes_method;
    case UMB_METHOD_SHADOW_FRUSTA:
        return &umb_shadow_frusta_method;
    case UMB_METHOD_OCCLUSION_TREE:
        return &umb_occlusion_tree_method;
    case UMB_METHOD_NONE:
        break;
    }
    return NULL;
}

const char *umb_method_name(umb_method method)
{
    switch (method) {
    case UMB_METHOD_RASTER:
        return "raster";
    case UMB_METHOD_NONE:
        return "none";
    case UMB_METHOD_PLANES:
        return "planes";
    case UMB_METHOD_SHADOW_FRUSTA:
        return "shadow-frusta";
    case UMB_METHOD_OCCLUSION_TREE:
        return "occlusion-tree";
    }
    return "unknown";
}

const char *umb_class_name(umb_class class_)
{
    switch (class_) {
    case UMB_CLASS_STRICT:
        return "strict";
    case UMB_CLASS_PIXEL:
        return "pixel";
    case UMB_CLASS_APPROXIMATE:
        return "approximate";
    }
    return "unknown";
}
