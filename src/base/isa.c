#include "isa.h"

#if defined(UMB_SCALAR_ONLY)
#undef UMB_HAVE_SSE4
#undef UMB_HAVE_AVX2
#undef UMB_HAVE_NEON
#endif

static bool has_sse4(void)
{
#if defined(UMB_HAVE_SSE4) && (defined(__x86_64__) || defined(__i386__))
    return __builtin_cpu_supports("sse4.1") != 0;
#else
    return false;
#endif
}

static bool has_avx2(void)
{
#if defined(UMB_HAVE_AVX2) && (defined(__x86_64__) || defined(__i386__))
    return __builtin_cpu_supports("avx2") != 0;
#else
    return false;
#endif
}

static bool has_neon(void)
{
    /* Part of every 64-bit ARM processor. */
#if defined(UMB_HAVE_NEON) && defined(__aarch64__)
    return true;
#else
    return false;
#endif
}

bool umb_isa_available(umb_isa isa)
{
    switch (isa) {
    case UMB_ISA_AUTO:
    case UMB_ISA_SCALAR:
        return true;
    case UMB_ISA_SSE4:
        return has_sse4();
    case UMB_ISA_AVX2:
        return has_avx2();
    case UMB_ISA_NEON:
        return has_neon();
    }
    return false;
}

umb_result umb_isa_resolve(umb_isa isa, umb_isa *out)
{
    *out = UMB_ISA_SCALAR;
    if (isa == UMB_ISA_AUTO) {
        static const umb_isa best_first[] = {UMB_ISA_AVX2, UMB_ISA_SSE4, UMB_ISA_NEON};
        for (int i = 0; i < 3; ++i) {
            if (umb_isa_available(best_first[i])) {
                *out = best_first[i];
                break;
            }
        }
        return UMB_OK;
    }
    if (!umb_isa_available(isa)) {
        return UMB_ERROR_ARGUMENT;
    }
    *out = isa;
    return UMB_OK;
}

const char *umb_isa_name(umb_isa isa)
{
    if (isa == UMB_ISA_AUTO) {
        (void)umb_isa_resolve(isa, &isa);
    }
    switch (isa) {
    case UMB_ISA_AUTO:
        break;
    case UMB_ISA_SCALAR:
        return "scalar";
    case UMB_ISA_SSE4:
        return "sse4";
    case UMB_ISA_AVX2:
        return "avx2";
    case UMB_ISA_NEON:
        return "neon";
    }
    return "unknown";
}
