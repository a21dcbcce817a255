// The objects of the exclusion study, meshed once a process: a second of a processor for 900 vertices, three
// for 2,000. Tests that only press, lift or look share them; how they are made is tested with make_object()
// itself. Not thread-safe.
#pragma once

#include <cstddef>

#include "trainer/objects/organ_object.h"

namespace kiroku::trainer {

/// What make_object(kind, vertices) gives; lives as long as the process.
const OrganObject& made_object(ObjectKind kind, std::size_t vertices);

}  // namespace kiroku::trainer
