// How the viewer tells a program behind it who asks (viewer/server/inner_door.h): in fields of the request,
// which that program believes because nobody but the viewer's own user gets through the door. They count
// nowhere else. Constants and functions; thread-safe.
#pragma once

#include <string_view>

#include "viewer/server/dispatcher.h"

namespace kiroku::viewer {

inline constexpr std::string_view kCallersUser = "x-kiroku-user";
inline constexpr std::string_view kCallersRole = "x-kiroku-role";
inline constexpr std::string_view kCallersAddress = "x-kiroku-address";

/// Whom these fields name, for one request; null where they name nobody, or a guest.
WhoCalls whom_the_viewer_names();

}  // namespace kiroku::viewer
