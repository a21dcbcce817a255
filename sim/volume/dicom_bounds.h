// What reading a DICOM file may cost. DCMTK reads sequences within each other by recursion, so that a file of
// a few megabytes has it leave the stack and end the program; and it inflates a deflated data set wholly, a
// thousand times the file's bytes. Both are looked at before DCMTK sees the file. Functions, thread-safe.
//
// Encodings: DICOM PS3.5 7.1 (elements), 7.5 (sequences), annex A.5 (deflated), PS3.10 7.1 (file meta
// information).
#pragma once

#include <cstdint>
#include <filesystem>

namespace kiroku::sim {

/// Items of a file that are read without asking how deep they lie: DCMTK takes this many within each other.
inline constexpr std::size_t kMostUnaskedItems = 500;
/// Within each other. Of radiotherapy's and of structured reports there are ten or so.
inline constexpr std::size_t kMostDicomDepth = 64;
/// Of one inflated file. A picture of a CT takes half a megabyte.
inline constexpr std::uint64_t kMostInflatedBytes = std::uint64_t{256} << 20U;

/// Returns where DCMTK may read the file, which begins as DICOM does; a file that DCMTK will call damaged is
/// one of them. kiroku::Error where its sequences lie too deep within each other or cannot be followed, or
/// where it inflates to too much; kiroku::IoError.
void require_bounded_dicom(const std::filesystem::path& file);

}  // namespace kiroku::sim
