// Debian's ITK was configured for GCC alone and refuses every other compiler by its name. For Clang, which
// has what it asks for, this is included before anything of ITK.
#pragma once
#undef __clang__
#include <itk_compiler_detection.h>
#define __clang__ 1
