// SPDX-License-Identifier: Apache-2.0
// Loops that are compiled for several widths of vectors; the machine's is chosen when the program
// starts. ThreadSanitizer cannot stand that choice, which comes before it has started itself.
#pragma once

#if defined(__SANITIZE_THREAD__)
#define STIPPLE_VECTOR_CLONES
#else
#define STIPPLE_VECTOR_CLONES \
    __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#endif
