// libavfilter, which no program is linked to: with the 33 libraries that it needs it takes as long to load as
// all other libraries of a recorder, and most recordings filter nothing. Its functions are called as its own
// headers declare them; the first call loads it (libav_filter_library.cpp), and it stays.
//
// Whoever gives up files before it filters, in a box or for hours, loads it before.
#pragma once

namespace kiroku::media {

/// Loads it now. Throws kiroku::Error where that cannot be, with the package to install, as each of its
/// functions then does. Thread-safe.
void load_filter_library();

}  // namespace kiroku::media
