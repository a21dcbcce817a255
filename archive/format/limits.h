// Every limit on what verification takes from a folder that somebody else may have made
// (docs/reference/format.md, "Limits"): with them its time grows with the folder's bytes and no faster, and
// so does its memory, by far less. What is beyond a limit of the format is refused; what is beyond a limit of
// the report is counted.
#pragma once

#include <cstddef>
#include <cstdint>

namespace kiroku::archive {

// -- of the format
/// A line of a ledger or of the appliance log, without LF.
inline constexpr std::size_t kMaximumLineBytes = 1U << 20U;
/// What follows so many bytes in lines that are too long, or hold a zero byte, is not read, whether they are
/// one line or many: a file that takes no room on a disk reads as zeros, and can be as long as one likes.
inline constexpr std::uint64_t kMostBytesOfLine = std::uint64_t{64} << 20U;
/// Values in one line or in excerpt.json: texts, numbers, lists, objects. Each takes 40 bytes when it is
/// read, and can take two in the text.
inline constexpr std::size_t kMaximumJsonValues = 1U << 17U;
/// Streams that `open` names.
inline constexpr std::size_t kMaximumStreams = 256;
/// Digits of each number of `time_base`: FFmpeg's have 32 bits.
inline constexpr std::size_t kMaximumTimeBaseDigits = 10;
/// A segment's file, and the subject's: what is longer is not read.
inline constexpr std::uint64_t kMaximumSealedBytes = std::uint64_t{1} << 30U;
/// The subject, once it is open.
inline constexpr std::uint64_t kMaximumSubjectBytes = std::uint64_t{16} << 20U;
/// So many bytes of segments that no entry names are read of a case that was cut off, all together.
inline constexpr std::uint64_t kMostBytesFound = std::uint64_t{4} << 30U;
/// In files that may have holes, since they were cut off, so many bytes of holes are read, all together: a
/// hole takes no room on a disk, and as long to hash as what does.
inline constexpr std::uint64_t kMostBytesInHoles = std::uint64_t{1} << 30U;
/// excerpt.json.
inline constexpr std::size_t kMaximumExcerptBytes = 4U << 20U;
/// Longer files are no notes: a hundred cosignatures by Ed25519 are a tenth of it, and 38 by ML-DSA-44 fit.
inline constexpr std::size_t kMaximumNoteBytes = 1U << 17U;
/// Longer files are no tokens; those in the world have 1 to 15 kB.
inline constexpr std::size_t kMaximumTokenBytes = 1U << 20U;
/// Tokens that do not hold under the trusted roots and whose signatures are verified all the same. Of further
/// ones only those are from which a path leads to a trusted root: a stranger's key may be as slow as they
/// like.
inline constexpr std::uint64_t kMostJudgedStrangers = 64;
/// Folders in folders that are entered: segments/<stream>/<file>.
inline constexpr int kMaximumFolderDepth = 3;
/// So a path has at most three names, of at most 255 bytes on every file system.
inline constexpr std::size_t kMaximumPathBytes = std::size_t{kMaximumFolderDepth} * 256;

// -- of the report
/// After so many lines that are no entries the rest of a ledger is not read: it is tampered with, and a line
/// of one byte costs as much as one of a hundred.
inline constexpr std::uint64_t kMostBrokenLines = 10'000;
/// Of one code so many findings are kept; the rest is counted.
inline constexpr std::uint64_t kMostFindingsOfOneCode = 1'000;
/// A finding's text and its file name, each: what is longer ends in "…".
inline constexpr std::size_t kMaximumFindingText = 1'000;
/// All kept findings together. Beyond it one of each code is kept, whatever its size.
inline constexpr std::size_t kMaximumFindingBytes = 16U << 20U;

}  // namespace kiroku::archive
